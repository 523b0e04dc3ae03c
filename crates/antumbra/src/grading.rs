//! Sizes of cells that follow the distance to what light bends at.

use crate::surroundings::contact_radius;
use antumbra_geom::{
    Chart, Control, DVec2, DVec3, Stop, distance_to_segment, distance_to_segment_in_space,
};
use antumbra_scene::FaceId;
use antumbra_visibility::{Evaluator, EventKind, EventKinds, critical_curves};

/// What grading goes by.
pub(crate) struct Near {
    chart: Chart,
    /// Of the border and of what touches the receiver, in the chart.
    segments: Vec<[DVec2; 2]>,
    /// The convex pieces of emitters, corners in space.
    emitters: Vec<Vec<DVec3>>,
}

impl Near {
    pub(crate) fn new(
        evaluator: &Evaluator<'_>,
        face: FaceId,
        chart: &Chart,
        border: &[Vec<DVec2>],
        stop: Stop<'_>,
    ) -> Self {
        let scene = evaluator.scene();
        let mut segments: Vec<[DVec2; 2]> = border
            .iter()
            .flat_map(|l| (0..l.len()).map(|i| [l[i], l[(i + 1) % l.len()]]))
            .collect();
        let contacts = EventKinds::NONE.with(EventKind::Contact);
        let radius = contact_radius(scene, face);
        let found = critical_curves(evaluator, face, contacts, radius, &Control::stopping(stop));
        for curve in found.map_or(Vec::new(), |found| found.curves) {
            segments.push(curve.shape.ends().map(|p| chart.to_chart(p)));
        }
        let emitters = evaluator.emitters().filter(|&e| e != face).flat_map(|e| {
            let pieces = &scene.face(e).pieces;
            let pieces = &scene.pieces[pieces.start as usize..pieces.end as usize];
            pieces.iter().map(|piece| scene.positions(&piece.vertices))
        });
        Self {
            chart: *chart,
            segments,
            emitters: emitters.collect(),
        }
    }

    /// From a point of the receiver to the nearest of all.
    pub(crate) fn distance(&self, uv: DVec2) -> f64 {
        let segments = self.segments.iter();
        let to_segments = segments.map(|&ends| distance_to_segment(ends, uv));
        let point = self.chart.to_space(uv);
        let to_emitters = self.emitters.iter().map(|e| distance_to_convex(e, point));
        to_segments.chain(to_emitters).fold(f64::INFINITY, f64::min)
    }
}

/// The distance of a point to a plane convex polygon in space.
fn distance_to_convex(corners: &[DVec3], point: DVec3) -> f64 {
    let normal = antumbra_geom::newell_normal(corners).normalize_or_zero();
    let n = corners.len();
    let is_above = (0..n).all(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        (b - a).cross(point - a).dot(normal) >= 0.0
    });
    if is_above && n > 0 {
        return normal.dot(point - corners[0]).abs();
    }
    (0..n)
        .map(|i| distance_to_segment_in_space([corners[i], corners[(i + 1) % n]], point))
        .fold(f64::INFINITY, f64::min)
}
