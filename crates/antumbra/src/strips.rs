//! Lines beside what stands close above a receiver: reflected light bends there.
//!
//! A panel a centimetre below a ceiling is no contact, and what the ceiling gets from the
//! room changes within a few centimetres of its outline. Bisection would fill that layer
//! with elements as long as they are wide. Lines parallel to the outline, at distances in
//! proportion to the gap, let them be long.

use antumbra_geom::{Control, DVec2, DVec3, Stop, distance_to_segment_in_space};
use antumbra_scene::{FaceId, Scene};
use antumbra_visibility::{Evaluator, Event, EventKind, EventKinds, critical_curves};

/// Gaps narrower than this share of a receiver have lines.
const NEAR: f64 = 0.03;

/// Distances of the lines from the outline, in gaps: most of the change is within two,
/// nearly all within five.
const DISTANCES: [f64; 7] = [-5.0, -2.0, -0.7, 0.0, 0.7, 2.0, 5.0];

/// Lines beside everything that nearly touches a receiver; none if it was stopped.
pub(crate) fn strips(
    evaluator: &Evaluator<'_>,
    face: FaceId,
    contact_radius: f64,
    stop: Stop<'_>,
) -> Vec<[DVec2; 2]> {
    let scene = evaluator.scene();
    let chart = scene.chart(face);
    let near = NEAR * scene.face(face).area.sqrt();
    let contacts = EventKinds::NONE.with(EventKind::Contact);
    let control = Control::stopping(stop);
    let found = critical_curves(evaluator, face, contacts, near, &control).unwrap_or_default();
    let mut lines = Vec::new();
    for curve in found.curves {
        let Event::Contact(other) = curve.event else {
            continue;
        };
        let ends = curve.shape.ends();
        let gap = distance_to_outline(scene, other, (ends[0] + ends[1]) / 2.0);
        if gap <= contact_radius || gap > near {
            continue;
        }
        let [a, b] = ends.map(|p| chart.to_chart(p));
        let along = (b - a).normalize_or_zero();
        for distance in DISTANCES.map(|d| d * gap) {
            // Longer by as much, so that they meet those of the next edge.
            let longer = along * distance.abs();
            let beside = along.perp() * distance;
            lines.push([a + beside - longer, b + beside + longer]);
        }
    }
    lines
}

/// The distance of a point from the nearest border of a face.
fn distance_to_outline(scene: &Scene, face: FaceId, point: DVec3) -> f64 {
    let mut nearest = f64::INFINITY;
    for border in scene.face(face).loops() {
        let corners = scene.positions(border);
        for (i, &a) in corners.iter().enumerate() {
            let ends = [a, corners[(i + 1) % corners.len()]];
            nearest = nearest.min(distance_to_segment_in_space(ends, point));
        }
    }
    nearest
}
