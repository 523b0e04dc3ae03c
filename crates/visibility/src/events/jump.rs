//! How much the first derivative that jumps across a critical curve jumps.
//!
//! # Source
//!
//! (J1) and (J2) of `docs/design.md`: first and second derivative across the curve
//! of the area of the emitter that appears beyond it, times the kernel there.

use crate::evaluator::{Evaluator, Scratch, Source};
use crate::events::curve::CriticalCurve;
use crate::events::shaft::form;
use crate::events::sheet::Sheet;
use crate::events::{Discontinuity, Event};
use crate::place::{Approach, Place};
use antumbra_scene::{EdgeId, FaceId, VertexId};
use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use std::f64::consts::PI;

/// The jump across a curve at a point of it, per unit of exitance of its emitter:
/// of irradiance itself (D0), of its slope (D1; per scene unit), or of its second
/// derivative across the curve (D2; per square of the scene unit). Never negative.
///
/// `None` where it has no value: at contacts of occluders that hide no emitter, at
/// ends of edges.
#[must_use]
pub fn jump_at(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    curve: &CriticalCurve,
    x: DVec3,
) -> Option<f64> {
    let emitter = curve.emitter?;
    match curve.event {
        Event::Contact(_) => {
            let [a, b] = curve.shape.ends();
            jump_of_value(evaluator, receiver, emitter, (a, b), x)
        }
        Event::EmitterPlane(_) => slope_at_horizon(evaluator, receiver, emitter, x),
        event if event.kind().discontinuity() == Discontinuity::D1 => {
            Sheet::of(evaluator, receiver, event, emitter).map(|sheet| sheet.jump_alone(x))
        }
        event => jump_of_curvature(evaluator, receiver, emitter, event, x),
    }
}

/// Irradiance of one emitter with unit exitance.
fn factor(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    emitter: FaceId,
    point: DVec3,
    approach: Option<Approach>,
) -> f64 {
    let scene = evaluator.scene();
    let face = scene.face(receiver);
    let place = Place {
        point,
        normal: face.normal,
        plane: Some(face.plane),
        approach,
    };
    let source = Source::of(scene, emitter);
    let seen = evaluator.see(&place, &source, None, &mut Scratch::default());
    seen.factor
}

/// D0: the difference of the limits from both sides of a contact.
fn jump_of_value(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    emitter: FaceId,
    (a, b): (DVec3, DVec3),
    x: DVec3,
) -> Option<f64> {
    let scene = evaluator.scene();
    let across = (b - a).cross(scene.face(receiver).normal).try_normalize()?;
    let radius = 1e3 * scene.plane_tolerance();
    let side = |toward: DVec3| {
        let approach = Approach { toward, radius };
        factor(evaluator, receiver, emitter, x, Some(approach))
    };
    Some((side(across) - side(-across)).abs())
}

/// D1: irradiance grows from zero in front of the emitter's plane.
fn slope_at_horizon(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    emitter: FaceId,
    x: DVec3,
) -> Option<f64> {
    let scene = evaluator.scene();
    let (up, front) = (scene.face(receiver).normal, scene.face(emitter).normal);
    let across = (front - up * up.dot(front)).try_normalize()?;
    // Far enough for the digits of the value, near enough for the slope.
    let step = 1e-6 * scene.extent;
    Some(factor(evaluator, receiver, emitter, x + across * step, None) / step)
}

/// D2: a triangle of the emitter appears, whose area grows with the square of the
/// distance from the curve.
fn jump_of_curvature(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    emitter: FaceId,
    event: Event,
    x: DVec3,
) -> Option<f64> {
    let scene = evaluator.scene();
    let ends = |e: EdgeId| scene.edges[e.index()].ends.map(|v| scene.position(v));
    let (up, lamp) = (scene.face(receiver).normal, scene.face(emitter));
    let through = |e: EdgeId| {
        let [a, b] = ends(e);
        (a - x).cross(b - x)
    };
    // The line, and how the curve runs: along the trace of the plane of vertex and
    // edge, or along the conic.
    let direction = match event {
        Event::EmitterVertex { vertex, .. }
        | Event::EmitterEdge { vertex, .. }
        | Event::VertexEdge { vertex, .. } => scene.position(vertex) - x,
        Event::EmitterTriple { occluders, .. } => {
            through(occluders[0]).cross(through(occluders[1]))
        }
        Event::Triple([e, f, _]) => through(e).cross(through(f)),
        _ => return None,
    };
    let direction = direction.try_normalize()?;
    let direction = if lamp.normal.dot(direction) > 0.0 {
        -direction
    } else {
        direction
    };
    let lamp_form = form(lamp.normal, scene.position(lamp.outline[0]));
    let distance = lamp_form.dot(x.extend(1.0)) / -lamp.normal.dot(direction);
    let kernel = up.dot(direction) * -lamp.normal.dot(direction) / (PI * distance * distance);
    if kernel.is_nan() || kernel <= 0.0 || distance <= 0.0 {
        return None;
    }

    let adjacency = evaluator.adjacency();
    // The speed of every point of the emitter's plane as x moves: towards `step`
    // in the receiver's plane, as seen through the point of an edge.
    let chart = scene.chart(emitter);
    let flat = |v: DVec3| chart.to_chart(v + chart.to_space(DVec2::ZERO));
    // An edge as a line of the emitter's plane: unit normal, and its speed per step.
    let project = |v: DVec3| v - direction * (lamp.normal.dot(v) / lamp.normal.dot(direction));
    let line = |e: EdgeId| -> Option<(DVec2, f64)> {
        let [a, b] = ends(e);
        let along = flat(project(b - a)).try_normalize()?;
        let is_emitters = adjacency.edges_of(emitter).contains(&e);
        if is_emitters {
            return Some((along.perp(), 0.0));
        }
        // Where the line passes the edge.
        let across = direction.cross(b - a);
        let to_edge = (a - x).cross(b - a).dot(across) / across.length_squared();
        (to_edge > 0.0).then_some((along.perp(), 1.0 - distance / to_edge))
    };
    // Across the curve: the direction in which the concurrency opens fastest is
    // the one along which it does not open turned by a right angle.
    let opening = |lines: [(DVec2, f64); 3], step: DVec3| {
        let moved = flat(project(step));
        let [(m1, s1), (m2, s2), (m3, s3)] = lines;
        let w = [m1.dot(moved) * s1, m2.dot(moved) * s2, m3.dot(moved) * s3];
        w[0] * m2.perp_dot(m3) + w[1] * m3.perp_dot(m1) + w[2] * m1.perp_dot(m2)
    };
    let [e1, e2] = {
        let e1 = up.any_orthonormal_vector();
        [e1, up.cross(e1)]
    };
    let jump = |edges: [EdgeId; 3]| -> Option<f64> {
        let lines = [line(edges[0])?, line(edges[1])?, line(edges[2])?];
        // Linear in the step: its gradient's length is the opening per unit across.
        let d = DVec2::new(opening(lines, e1), opening(lines, e2)).length();
        let [m1, m2, m3] = lines.map(|l| l.0);
        let angles = m1.perp_dot(m2) * m2.perp_dot(m3) * m3.perp_dot(m1);
        let jump = kernel * d * d / angles.abs();
        jump.is_finite().then_some(jump)
    };
    // The corner of a vertex against an edge: rays of the corner's outline instead of
    // whole lines, all with the vertex's speed.
    let at_vertex = |vertex: VertexId, edge: EdgeId, is_emitters: bool| -> Option<f64> {
        let speed = if is_emitters {
            0.0
        } else {
            1.0 - distance / (scene.position(vertex) - x).length()
        };
        let (across, edge_speed) = line(edge)?;
        let along = across.perp();
        let opening = |step: DVec3| across.dot(flat(project(step))) * (speed - edge_speed);
        let d = DVec2::new(opening(e1), opening(e2)).length();
        let faces: SmallVec<[FaceId; 8]> = if is_emitters {
            SmallVec::from_slice(&[emitter])
        } else {
            let edges = adjacency.edges_at(vertex).iter();
            let mut faces: SmallVec<[FaceId; 8]> = edges
                .flat_map(|&e| adjacency.faces_at(e))
                .map(|at| at.face)
                .collect();
            faces.sort_unstable();
            faces.dedup();
            faces
        };
        let sectors: SmallVec<[[DVec2; 2]; 8]> = faces
            .iter()
            .filter_map(|&f| sector(scene, f, vertex, direction))
            .map(|rays| rays.map(|r| flat(project(r))))
            .collect();
        let sum: f64 = outline_rays(&sectors)
            .iter()
            .map(|(ray, sign)| sign * ray.dot(along) / ray.dot(across))
            .sum();
        let jump = kernel * d * d * sum.abs();
        jump.is_finite().then_some(jump)
    };
    match event {
        Event::EmitterVertex { vertex, edge } => at_vertex(vertex, edge, true),
        Event::EmitterEdge { edge, vertex } | Event::VertexEdge { vertex, edge } => {
            at_vertex(vertex, edge, false)
        }
        Event::EmitterTriple { emitter, occluders } => jump([emitter, occluders[0], occluders[1]]),
        Event::Triple(edges) => jump(edges),
        _ => None,
    }
}

/// The rays between which a face lies at one of its vertices, counter-clockwise as seen
/// along `direction`; `None` for a face seen edge-on.
fn sector(
    scene: &antumbra_scene::Scene,
    id: FaceId,
    vertex: VertexId,
    direction: DVec3,
) -> Option<[DVec3; 2]> {
    let face = scene.face(id);
    let facing = face.normal.dot(direction);
    if facing.abs() < 1e-9 {
        return None;
    }
    face.loops().find_map(|corners| {
        let i = corners.iter().position(|&v| v == vertex)?;
        let n = corners.len();
        let ray = |v: VertexId| scene.position(v) - scene.position(vertex);
        let (next, before) = (ray(corners[(i + 1) % n]), ray(corners[(i + n - 1) % n]));
        Some(if facing < 0.0 {
            [next, before]
        } else {
            [before, next]
        })
    })
}

/// The rays that bound the union of sectors, with the sign +1 where it begins
/// counter-clockwise and −1 where it ends.
fn outline_rays(sectors: &[[DVec2; 2]]) -> SmallVec<[(DVec2, f64); 8]> {
    use std::f64::consts::TAU;
    let turn = |from: f64, to: f64| (to - from).rem_euclid(TAU);
    let angles: SmallVec<[[f64; 2]; 8]> =
        sectors.iter().map(|s| s.map(|r| r.y.atan2(r.x))).collect();
    let is_covered = |at: f64| angles.iter().any(|&[a, b]| turn(a, at) < turn(a, b));
    let mut rays: SmallVec<[(f64, DVec2); 16]> = sectors
        .iter()
        .flatten()
        .map(|&r| (r.y.atan2(r.x), r))
        .collect();
    rays.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Two faces at an edge have the same ray, up to rounding.
    rays.dedup_by(|a, b| a.0 - b.0 < 1e-9);
    let n = rays.len();
    let gap = |i: usize| {
        let (from, to) = (rays[i].0, rays[(i + 1) % n].0);
        let width = if n == 1 { TAU } else { turn(from, to) };
        is_covered(from + 0.5 * width)
    };
    (0..n)
        .filter_map(|i| match (gap((i + n - 1) % n), gap(i)) {
            (false, true) => Some((rays[i].1, 1.0)),
            (true, false) => Some((rays[i].1, -1.0)),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    #[test]
    fn outline_of_overlapping_sectors_is_that_of_their_union() {
        let (a, b, c, d) = (
            dvec2(1.0, 0.0),
            dvec2(1.0, 1.0),
            dvec2(0.0, 1.0),
            dvec2(-1.0, 1.0),
        );
        let rays = outline_rays(&[[a, c], [b, d]]);
        assert_eq!(rays.as_slice(), [(a, 1.0), (d, -1.0)]);
        // Two sectors with a gap have four.
        assert_eq!(outline_rays(&[[a, b], [c, d]]).len(), 4);
    }
}
