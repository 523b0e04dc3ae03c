//! Which points lie near a segment or a point.

use antumbra_geom::DVec3;
use antumbra_scene::{Aabb, BoxTree};

/// Numbered points in a hierarchy of boxes.
///
/// The hierarchy is single precision inside, so points are put around the origin
/// at a size of about one; queries are widened by more than that rounds.
pub(super) struct Nearby {
    tree: BoxTree,
    centre: DVec3,
    scale: f64,
}

impl Nearby {
    pub(super) fn new(points: &[(u32, DVec3)]) -> Self {
        let bounds = Aabb::of(points.iter().map(|p| p.1));
        let size = (bounds.max - bounds.min).max_element();
        let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
        let centre = bounds.min.midpoint(bounds.max);
        let boxes: Vec<(u32, Aabb)> = points
            .iter()
            .map(|&(id, p)| (id, Aabb::of([(p - centre) * scale])))
            .collect();
        Self {
            tree: BoxTree::new(&boxes),
            centre,
            scale,
        }
    }

    /// Points that may lie within `reach` of the segment from `a` to `b`.
    pub(super) fn along(&self, a: DVec3, b: DVec3, reach: f64) -> Vec<u32> {
        let [a, b] = [a, b].map(|p| (p - self.centre) * self.scale);
        // Rounding of the shift, of the scale and of the parameters below: a few
        // units in the last place.
        let margin = reach * self.scale + 1e-14 * (1.0 + a.abs().max(b.abs()).max_element());
        let mut found = Vec::new();
        self.tree
            .visit(|node| node.meets_segment(a, b, margin), |id| found.push(id));
        found.sort_unstable();
        found
    }

    /// Points that may lie within `reach` of a point.
    pub(super) fn around(&self, point: DVec3, reach: f64) -> Vec<u32> {
        self.along(point, point, reach)
    }
}
