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

    /// Points that may lie within `reach` of the box around two points.
    pub(super) fn around(&self, a: DVec3, b: DVec3, reach: f64) -> Vec<u32> {
        let local = [a, b].map(|p| (p - self.centre) * self.scale);
        // Rounding of the shift and the scale: a few units in the last place.
        let margin = reach * self.scale + 1e-15 * (1.0 + local[0].abs().max_element());
        let exact = Aabb::of(local);
        let query = Aabb {
            min: exact.min - margin,
            max: exact.max + margin,
        };
        let mut found = Vec::new();
        self.tree
            .visit(|node| node.meets(&query), |id| found.push(id));
        found.sort_unstable();
        found
    }
}
