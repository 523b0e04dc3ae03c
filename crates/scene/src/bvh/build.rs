//! How a tree of boxes is built: from above into groups, and each group by `obvhs`.
//!
//! Groups come from splits by the surface area heuristic in bins, or at the median where
//! that peels off few boxes again and again. A group that `obvhs` makes a chain of is
//! halved at medians instead. So no tree is deeper than [`DEEPEST`], and building takes
//! time like n log n whatever the boxes.
//!
//! # Source
//!
//! Wald 2007, *On fast construction of SAH-based bounding volume hierarchies*.

use super::{Aabb, BoxTree, Node};
use glam::{DVec3, Vec3A};
use obvhs::{BvhBuildParams, bvh2::Bvh2, bvh2::builder::build_bvh2};
use std::time::Duration;

/// Boxes `obvhs` is given at a time: a chain of them fits the stack of 96 with which it
/// looks for better places, and costs no more than a microsecond a box.
const GROUP: usize = 64;

/// Levels that the heuristic decides; below them, medians do. So deep are the trees of
/// 2³² boxes whose every split takes off a half.
const BY_AREA: usize = 32;

/// Levels of the medians below: 2³² boxes are 2²⁶ groups.
const BY_MEDIAN: usize = 26;

/// Levels of a group at most: four times the logarithm of its size.
const IN_GROUP: usize = 24;

/// Levels of any tree at most.
pub(super) const DEEPEST: usize = BY_AREA + BY_MEDIAN + IN_GROUP;

/// Bins of an axis; more do not make better trees (Wald 2007).
const BINS: usize = 16;

/// Boxes of a leaf, where medians decide.
const IN_LEAF: usize = 4;

/// The tree of `(item, box)` pairs.
pub(super) fn build(boxes: &[(u32, Aabb)]) -> BoxTree {
    let mut builder = Builder {
        boxes,
        tree: BoxTree::default(),
    };
    if !boxes.is_empty() {
        let mut all: Vec<u32> = (0..boxes.len() as u32).collect();
        let root = builder.push_node();
        builder.fill(root, &mut all, 0);
    }
    builder.tree
}

struct Builder<'a> {
    boxes: &'a [(u32, Aabb)],
    tree: BoxTree,
}

impl Builder<'_> {
    /// Makes a node of some boxes, `depth` levels below the root.
    fn fill(&mut self, node: usize, group: &mut [u32], depth: usize) {
        if group.len() <= GROUP {
            let bvh = self.grouped(group);
            if levels(&bvh, 0) <= IN_GROUP {
                self.append(node, group, &bvh);
            } else {
                self.halve(node, group);
            }
            return;
        }
        let by_area = (depth < BY_AREA)
            .then(|| self.split_by_area(group))
            .flatten();
        let middle = by_area.unwrap_or_else(|| self.split_at_median(group));
        let (left, right) = group.split_at_mut(middle);
        let first = self.push_children(node, left, right);
        self.fill(first, left, depth + 1);
        self.fill(first + 1, right, depth + 1);
    }

    /// Makes a node of some boxes, halved at medians all the way down.
    fn halve(&mut self, node: usize, group: &mut [u32]) {
        if group.len() <= IN_LEAF {
            let first = self.tree.items.len() as u32;
            let items = group.iter().map(|&i| self.boxes[i as usize].0);
            self.tree.items.extend(items);
            self.tree.nodes[node] = Node {
                bounds: self.bounds(group),
                first,
                n_items: group.len() as u32,
            };
            return;
        }
        let middle = self.split_at_median(group);
        let (left, right) = group.split_at_mut(middle);
        let first = self.push_children(node, left, right);
        self.halve(first, left);
        self.halve(first + 1, right);
    }

    /// What `obvhs` makes of some boxes.
    fn grouped(&self, group: &[u32]) -> Bvh2 {
        let outward: Vec<obvhs::aabb::Aabb> = group
            .iter()
            .map(|&i| self.boxes[i as usize].1)
            .map(|b| obvhs::aabb::Aabb {
                min: Vec3A::from_array(b.min.to_array().map(down)),
                max: Vec3A::from_array(b.max.to_array().map(up)),
            })
            .collect();
        let params = BvhBuildParams::medium_build();
        build_bvh2(&outward, params, &mut Duration::default())
    }

    /// Copies a tree of `obvhs` to the place of a node.
    fn append(&mut self, node: usize, group: &[u32], bvh: &Bvh2) {
        let first_item = self.tree.items.len() as u32;
        // Its root takes the place of the node, the others follow the nodes there are.
        let offset = self.tree.nodes.len() as u32 - 1;
        for (i, n) in bvh.nodes.iter().enumerate() {
            let (from, n_items) = if n.is_leaf() {
                (first_item, n.prim_count)
            } else {
                (offset, 0)
            };
            let copy = Node {
                bounds: Aabb {
                    min: DVec3::from_array(n.aabb().min.to_array().map(f64::from)),
                    max: DVec3::from_array(n.aabb().max.to_array().map(f64::from)),
                },
                first: from + n.first_index,
                n_items,
            };
            if i == 0 {
                self.tree.nodes[node] = copy;
            } else {
                self.tree.nodes.push(copy);
            }
        }
        let boxes = bvh.primitive_indices.iter().map(|&k| group[k as usize]);
        let items = boxes.map(|i| self.boxes[i as usize].0);
        self.tree.items.extend(items);
    }

    fn push_node(&mut self) -> usize {
        self.tree.nodes.push(Node {
            bounds: Aabb::EMPTY,
            first: 0,
            n_items: 0,
        });
        self.tree.nodes.len() - 1
    }

    /// The first of a node's two children, which are yet to be filled.
    fn push_children(&mut self, node: usize, left: &[u32], right: &[u32]) -> usize {
        let first = self.push_node();
        self.push_node();
        self.tree.nodes[node] = Node {
            bounds: self.bounds(left).union(self.bounds(right)),
            first: first as u32,
            n_items: 0,
        };
        first
    }

    fn bounds(&self, group: &[u32]) -> Aabb {
        let boxes = group.iter().map(|&i| self.boxes[i as usize].1);
        boxes.fold(Aabb::EMPTY, Aabb::union)
    }

    /// Twice the middle of a box.
    fn middle(&self, i: u32) -> DVec3 {
        let bounds = &self.boxes[i as usize].1;
        bounds.min + bounds.max
    }

    /// The box of the middles.
    fn middles(&self, group: &[u32]) -> Aabb {
        Aabb::of(group.iter().map(|&i| self.middle(i)))
    }

    /// Puts the lower half of the middles along the longest axis first; equal ones keep
    /// their order.
    fn split_at_median(&self, group: &mut [u32]) -> usize {
        let middles = self.middles(group);
        let axis = (middles.max - middles.min).max_position();
        let half = group.len() / 2;
        group.select_nth_unstable_by(half, |&i, &j| {
            let at = |i: u32| self.middle(i)[axis];
            at(i).total_cmp(&at(j)).then(i.cmp(&j))
        });
        half
    }

    /// Puts those boxes first that the cheapest of the splits between bins takes off; says
    /// how many. `None` if all middles are in one bin.
    fn split_by_area(&self, group: &mut [u32]) -> Option<usize> {
        let middles = self.middles(group);
        let size = middles.max - middles.min;
        let mut best: Option<(f64, usize, usize)> = None;
        for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
            let bins = self.binned(group, &middles, axis);
            for (k, cost) in costs(&bins).into_iter().enumerate() {
                if cost.is_some_and(|cost| best.is_none_or(|(least, ..)| cost < least)) {
                    best = cost.map(|cost| (cost, axis, k));
                }
            }
        }
        let (_, axis, last) = best?;
        let is_left = |&i: &u32| bin_of(self.middle(i)[axis], &middles, axis) <= last;
        let (left, right): (Vec<u32>, Vec<u32>) = group.iter().copied().partition(is_left);
        group[..left.len()].copy_from_slice(&left);
        group[left.len()..].copy_from_slice(&right);
        Some(left.len())
    }

    fn binned(&self, group: &[u32], middles: &Aabb, axis: usize) -> [(usize, Aabb); BINS] {
        let mut bins = [(0, Aabb::EMPTY); BINS];
        for &i in group {
            let (n, bounds) = &mut bins[bin_of(self.middle(i)[axis], middles, axis)];
            *n += 1;
            *bounds = bounds.union(self.boxes[i as usize].1);
        }
        bins
    }
}

fn bin_of(middle: f64, middles: &Aabb, axis: usize) -> usize {
    let (low, high) = (middles.min[axis], middles.max[axis]);
    let t = (middle - low) / (high - low);
    ((t * BINS as f64) as usize).min(BINS - 1)
}

/// What it costs to split behind every bin but the last: area times boxes on either side.
fn costs(bins: &[(usize, Aabb); BINS]) -> [Option<f64>; BINS - 1] {
    let mut costs = [None; BINS - 1];
    let (mut n, mut bounds) = (0, Aabb::EMPTY);
    for k in 0..BINS - 1 {
        n += bins[k].0;
        bounds = bounds.union(bins[k].1);
        costs[k] = (n > 0).then(|| n as f64 * half_area(&bounds));
    }
    (n, bounds) = (0, Aabb::EMPTY);
    for k in (0..BINS - 1).rev() {
        n += bins[k + 1].0;
        bounds = bounds.union(bins[k + 1].1);
        costs[k] = costs[k]
            .filter(|_| n > 0)
            .map(|left| left + n as f64 * half_area(&bounds));
    }
    costs
}

fn half_area(bounds: &Aabb) -> f64 {
    let size = bounds.max - bounds.min;
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// How many levels there are below a node.
fn levels(bvh: &Bvh2, node: u32) -> usize {
    let n = &bvh.nodes[node as usize];
    if n.is_leaf() {
        return 0;
    }
    1 + levels(bvh, n.first_index).max(levels(bvh, n.first_index + 1))
}

fn down(x: f64) -> f32 {
    let f = x as f32;
    if f64::from(f) > x { f.next_down() } else { f }
}

fn up(x: f64) -> f32 {
    let f = x as f32;
    if f64::from(f) < x { f.next_up() } else { f }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn levels_of(tree: &BoxTree, node: u32) -> usize {
        let n = &tree.nodes[node as usize];
        if n.n_items > 0 {
            return 0;
        }
        1 + levels_of(tree, n.first).max(levels_of(tree, n.first + 1))
    }

    fn at(p: DVec3, size: f64) -> Aabb {
        Aabb {
            min: p,
            max: p + size,
        }
    }

    /// Boxes of which `obvhs` makes chains, and boxes whose splits take off few.
    fn degenerate(n: u32) -> Vec<(&'static str, Vec<(u32, Aabb)>)> {
        let all = |place: &dyn Fn(f64) -> Aabb| -> Vec<(u32, Aabb)> {
            (0..n).map(|i| (i, place(f64::from(i)))).collect()
        };
        vec![
            ("touching", all(&|x| at(dvec3(x, 0.0, 0.0), 1.0))),
            ("apart", all(&|x| at(dvec3(3.0 * x, 0.0, 0.0), 1.0))),
            ("overlapping", all(&|x| at(dvec3(0.1 * x, 0.0, 0.0), 1.0))),
            ("copies", all(&|_| at(DVec3::ONE, 1.0))),
            ("points", all(&|_| at(DVec3::ONE, 0.0))),
            ("nested", all(&|x| at(DVec3::splat(-x), 2.0 * x))),
            (
                "growing",
                all(&|x| at(dvec3(1.01f64.powf(x), 0.0, 0.0), 1.0)),
            ),
            (
                "doubling",
                all(&|x| at(DVec3::splat((0.2 * x).exp2()), 0.1)),
            ),
        ]
    }

    #[test]
    fn chains_are_balanced_and_keep_every_box() {
        for n in [1, 2, 63, 64, 65, 150, 1000] {
            for (what, boxes) in degenerate(n) {
                let tree = BoxTree::new(&boxes);
                let mut items = tree.items.clone();
                items.sort_unstable();
                assert!(items.into_iter().eq(0..n), "{what} {n}");
                let found = levels_of(&tree, 0);
                let allowed = IN_GROUP + 4 * (n / 64 + 1).ilog2() as usize + BY_AREA;
                assert!(found <= allowed.min(DEEPEST), "{what} {n}: {found}");
                for (i, b) in &boxes {
                    let mut near = Vec::new();
                    tree.visit(|candidate| candidate.meets(b), |j| near.push(j));
                    assert!(near.contains(i), "{what} {n}");
                }
            }
        }
    }

    #[test]
    fn few_nodes_are_looked_at_in_a_row() {
        let asked = |n: u32| {
            let count = std::cell::Cell::new(0usize);
            let (_, boxes) = degenerate(n).swap_remove(0);
            let tree = BoxTree::new(&boxes);
            for (_, b) in &boxes {
                let is_candidate = |candidate: &Aabb| {
                    count.set(count.get() + 1);
                    candidate.meets(b)
                };
                tree.visit(is_candidate, |_| ());
            }
            count.get()
        };
        // From 500 to 8000: sixteen times as many, and four levels more.
        let (few, many) = (asked(500), asked(8000));
        assert!(many < 16 * 2 * few, "{few} {many}");
        assert!(many < 8000 * 60, "{many}");
    }
}
