//! Which corners or edges of one surface lie near an edge of it.

use crate::bvh::{Aabb, BoxTree};
use antumbra_geom::DVec3;

/// So few are looked through faster than a tree is built.
const FEW: usize = 64;

/// Numbered boxes, in a tree if there are many.
pub(super) struct NearEdges {
    n: usize,
    tree: Option<BoxTree>,
}

impl NearEdges {
    pub(super) fn new(boxes: impl ExactSizeIterator<Item = Aabb>) -> Self {
        let n = boxes.len();
        let tree = (n > FEW).then(|| {
            let numbered: Vec<(u32, Aabb)> = (0..).zip(boxes).collect();
            BoxTree::new(&numbered)
        });
        Self { n, tree }
    }

    /// The numbers of all boxes that come within a margin of a segment, ascending, and of
    /// others perhaps.
    pub(super) fn of(&self, [a, b]: [DVec3; 2], margin: f64) -> Vec<usize> {
        let Some(tree) = &self.tree else {
            return (0..self.n).collect();
        };
        let mut found = Vec::new();
        let meets = |node: &Aabb| node.meets_segment(a, b, margin);
        tree.visit(meets, |i| found.push(i as usize));
        found.sort_unstable();
        found
    }
}
