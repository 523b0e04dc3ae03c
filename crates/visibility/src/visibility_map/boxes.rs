//! Boxes by middle and half size: against a plane, six products and no branch.

use antumbra_scene::{Aabb, Below, BoxTree};
use glam::DVec3;

/// An axis-parallel box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub(super) middle: DVec3,
    pub(super) half: DVec3,
}

impl Block {
    /// A box that holds another, up to rounding.
    pub(super) fn of(bounds: &Aabb) -> Self {
        Self {
            middle: (bounds.min + bounds.max) / 2.0,
            half: (bounds.max - bounds.min) / 2.0,
        }
    }

    /// Squared distance of a point.
    #[inline]
    pub(super) fn distance_sq(&self, point: DVec3) -> f64 {
        let outside = (point - self.middle).abs() - self.half;
        outside.max(DVec3::ZERO).length_squared()
    }

    /// The smallest `normal · x` in the box.
    #[inline]
    pub(super) fn least_along(&self, normal: DVec3) -> f64 {
        normal.dot(self.middle) - normal.abs().dot(self.half)
    }
}

/// A ray from a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    origin: DVec3,
    /// One over each component of the direction.
    inverse: DVec3,
    /// Boxes count as wider by this on all sides; scene units.
    margin: f64,
}

impl Ray {
    pub(super) fn new(origin: DVec3, direction: DVec3, margin: f64) -> Self {
        // Parallel to a side, a ray meets it farther away than anything is; not nowhere,
        // which is not a number where the origin is in that side.
        let least = |x: f64| x.abs().max(1e-200).copysign(x);
        Self {
            origin,
            inverse: direction.map(least).recip(),
            margin,
        }
    }

    /// Does it meet a box before it is this many directions long?
    pub(super) fn meets(&self, block: &Block, longest: f64) -> bool {
        let half = block.half + self.margin;
        let a = (block.middle - half - self.origin) * self.inverse;
        let b = (block.middle + half - self.origin) * self.inverse;
        let enters = a.min(b).max_element().max(0.0);
        enters <= a.max(b).min_element().min(longest)
    }
}

/// A node of a [`Blocks`] tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockNode {
    pub(super) block: Block,
    /// The first child, which the second follows, or the first item.
    pub(super) first: u32,
    /// Items of a leaf; 0 for an inner node.
    pub(super) n_items: u32,
}

/// A hierarchy of boxes.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    /// The root first.
    pub(super) nodes: Vec<BlockNode>,
    pub(super) items: Vec<u32>,
}

impl Blocks {
    /// The same hierarchy as a tree of boxes.
    pub(super) fn of(tree: &BoxTree) -> Self {
        let mut blocks = Self::default();
        if let Some(root) = tree.root() {
            blocks.push(tree, root);
            // In the order of their numbers, children come after their parents.
            let mut sources = vec![root];
            let mut at = 0;
            while at < blocks.nodes.len() {
                match tree.below(sources[at]) {
                    Below::Nodes(children) => {
                        blocks.nodes[at].first = blocks.nodes.len() as u32;
                        for child in children {
                            blocks.push(tree, child);
                            sources.push(child);
                        }
                    }
                    Below::Items(items) => {
                        blocks.nodes[at].first = blocks.items.len() as u32;
                        blocks.nodes[at].n_items = items.len() as u32;
                        blocks.items.extend_from_slice(items);
                    }
                }
                at += 1;
            }
        }
        blocks
    }

    /// The items of a leaf.
    pub(super) fn items_of(&self, leaf: &BlockNode) -> &[u32] {
        &self.items[leaf.first as usize..(leaf.first + leaf.n_items) as usize]
    }

    /// Calls `found` with every item whose box may meet what `is_candidate` says of boxes.
    pub(super) fn visit(
        &self,
        stack: &mut Vec<u32>,
        is_candidate: impl Fn(&Block) -> bool,
        mut found: impl FnMut(u32),
    ) {
        stack.clear();
        stack.extend((!self.nodes.is_empty()).then_some(0));
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            if !is_candidate(&node.block) {
                continue;
            }
            if node.n_items == 0 {
                stack.extend([node.first, node.first + 1]);
            } else {
                self.items_of(node).iter().for_each(|&item| found(item));
            }
        }
    }

    fn push(&mut self, tree: &BoxTree, node: u32) {
        self.nodes.push(BlockNode {
            block: Block::of(tree.bounds(node)),
            first: 0,
            n_items: 0,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_boxes_in_front_of_them_only_and_touch_their_sides() {
        let block = Block {
            middle: DVec3::new(2.0, 0.0, 0.0),
            half: DVec3::splat(0.5),
        };
        let meets = |origin: DVec3, direction: DVec3, longest: f64| {
            Ray::new(origin, direction, 1e-12).meets(&block, longest)
        };
        assert!(meets(DVec3::ZERO, DVec3::X, f64::INFINITY));
        assert!(!meets(DVec3::ZERO, -DVec3::X, f64::INFINITY));
        assert!(!meets(DVec3::ZERO, DVec3::X, 1.4));
        assert!(meets(DVec3::ZERO, DVec3::X * 2.0, 0.8));
        // Along a side, from a point in its plane; and beside it.
        assert!(meets(DVec3::Y * 0.5, DVec3::X, f64::INFINITY));
        assert!(!meets(DVec3::Y * 0.6, DVec3::X, f64::INFINITY));
        assert!(meets(block.middle, DVec3::Z, 0.0));
    }
}
