//! How much the first derivative that jumps across a critical curve jumps.
//!
//! # Source
//!
//! (J1) and (J2) of `docs/design.md`: first and second derivative across the curve
//! of the area of the emitter that appears beyond it, times the kernel there.

use crate::cone::Approach;
use crate::evaluator::{Evaluator, Scratch, Source};
use crate::events::coplanar::Sheet;
use crate::events::curve::CriticalCurve;
use crate::events::shaft::form;
use crate::events::{Discontinuity, Event};
use antumbra_scene::{EdgeId, FaceId, VertexId};
use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use std::f64::consts::PI;

/// The parameters at which [`CriticalCurve::jumps`] are known.
pub const JUMP_PLACES: [f64; 7] = [0.01, 0.12, 0.3, 0.5, 0.7, 0.88, 0.99];

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
            Sheet::of(evaluator, receiver, event, emitter).map(|sheet| sheet.jump(x))
        }
        event => jump_of_curvature(evaluator, receiver, emitter, event, x),
    }
}

/// Irradiance of one emitter with unit exitance.
fn factor(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    emitter: FaceId,
    x: DVec3,
    approach: Option<&Approach>,
) -> f64 {
    let scene = evaluator.scene();
    let (face, lamp) = (scene.face(receiver), scene.face(emitter));
    let mut scratch = Scratch::default();
    let range = lamp.pieces.start as usize..lamp.pieces.end as usize;
    scene.pieces[range]
        .iter()
        .map(|piece| {
            let corners = scene.positions(&piece.vertices);
            let source = Source {
                corners: &corners,
                normal: lamp.normal,
                plane: lamp.plane,
            };
            let view = (face.normal, Some(face.plane));
            evaluator.visible_parts(view, &source, None, x, approach, &mut scratch, |_, _| {})
        })
        .sum()
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
        factor(evaluator, receiver, emitter, x, Some(&approach))
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
    let outlines = |vertex: VertexId| -> SmallVec<[EdgeId; 4]> {
        let grazes = |e: EdgeId| {
            let [a, b] = ends(e);
            adjacency.is_outline(e, (b - a).cross(direction).normalize_or_zero())
        };
        let edges = adjacency.edges_at(vertex).iter().copied();
        edges.filter(|&e| grazes(e)).collect()
    };
    let lamp_edges_at = |vertex: VertexId| -> SmallVec<[EdgeId; 4]> {
        let edges = adjacency.edges_of(emitter).iter().copied();
        edges
            .filter(|e| scene.edges[e.index()].ends.contains(&vertex))
            .collect()
    };
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
    let at_vertex = |edges: &[EdgeId], third: EdgeId| -> Option<f64> {
        let mut largest: Option<f64> = None;
        for (i, &e) in edges.iter().enumerate() {
            for &f in &edges[i + 1..] {
                if let Some(j) = jump([e, f, third]) {
                    largest = Some(largest.map_or(j, |l| l.max(j)));
                }
            }
        }
        largest
    };
    match event {
        Event::EmitterVertex { vertex, edge } => at_vertex(&lamp_edges_at(vertex), edge),
        Event::EmitterEdge { edge, vertex } | Event::VertexEdge { vertex, edge } => {
            at_vertex(&outlines(vertex), edge)
        }
        Event::EmitterTriple { emitter, occluders } => jump([emitter, occluders[0], occluders[1]]),
        Event::Triple(edges) => jump(edges),
        _ => None,
    }
}
