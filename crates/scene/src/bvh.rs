//! The door to `obvhs`: a tree of boxes that never loses a candidate.
//!
//! `obvhs` stores boxes in single precision. Boxes are rounded outwards, inner
//! nodes are unions (minima and maxima, exact), and the traversal is our own, in
//! double precision over the public nodes: so every node box contains what is
//! below it, and no padding is needed.
//!
//! It clusters neighbours from below, which makes chains of boxes that are equal and
//! evenly spaced, or coincide: as deep as there are boxes, in as many rounds. So it is
//! given few boxes at a time ([`build`]), and how deep a tree is has a bound.

mod build;

use glam::DVec3;

/// An axis-parallel box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: DVec3,
    /// Upper corner.
    pub max: DVec3,
}

impl Aabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// The smallest box of some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self {
            min: b.min.min(p),
            max: b.max.max(p),
        })
    }

    /// The smallest box of both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Do the closed boxes meet?
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Does the box, wider by a margin on all sides, meet the segment from `a` to `b`?
    /// True too where it misses it by rounding that the margin is larger than.
    #[must_use]
    pub fn meets_segment(&self, a: DVec3, b: DVec3, margin: f64) -> bool {
        let (low, high) = (self.min - margin, self.max + margin);
        let along = b - a;
        let mut range = (0.0f64, 1.0f64);
        (0..3).all(|k| {
            if along[k].abs() <= margin {
                return a[k].min(b[k]) <= high[k] && low[k] <= a[k].max(b[k]);
            }
            let (s, t) = ((low[k] - a[k]) / along[k], (high[k] - a[k]) / along[k]);
            range = (range.0.max(s.min(t)), range.1.min(s.max(t)));
            range.0 <= range.1
        })
    }

    /// The largest value of `normal · x` over the box.
    #[must_use]
    pub fn max_along(&self, normal: DVec3) -> f64 {
        let pick = |n: f64, lo: f64, hi: f64| if n >= 0.0 { n * hi } else { n * lo };
        pick(normal.x, self.min.x, self.max.x)
            + pick(normal.y, self.min.y, self.max.y)
            + pick(normal.z, self.min.z, self.max.z)
    }
}

/// A node of a [`BoxTree`], in double precision.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Aabb,
    /// First child (the second follows) or first item.
    first: u32,
    /// Items of a leaf; 0 for an inner node.
    n_items: u32,
}

/// Contents of a node of a [`BoxTree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Below<'t> {
    /// Two nodes.
    Nodes([u32; 2]),
    /// The items of a leaf.
    Items(&'t [u32]),
}

/// A hierarchy of boxes over numbered items.
#[derive(Clone, Debug, Default)]
pub struct BoxTree {
    nodes: Vec<Node>,
    items: Vec<u32>,
}

impl BoxTree {
    /// The hierarchy of `(item, box)` pairs.
    #[must_use]
    pub fn new(boxes: &[(u32, Aabb)]) -> Self {
        build::build(boxes)
    }

    /// Calls `found` with every item whose box may meet the query: `is_candidate`
    /// is asked for node boxes, from the root down, and must answer `true` for
    /// every box that meets the query.
    pub fn visit(&self, is_candidate: impl Fn(&Aabb) -> bool, mut found: impl FnMut(u32)) {
        if self.nodes.is_empty() {
            return;
        }
        // Every level leaves one node waiting.
        let mut stack = [0u32; build::DEEPEST + 1];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            if !is_candidate(&node.bounds) {
                continue;
            }
            if node.n_items > 0 {
                for i in node.first..node.first + node.n_items {
                    found(self.items[i as usize]);
                }
            } else {
                stack[depth] = node.first + 1;
                stack[depth + 1] = node.first;
                depth += 2;
            }
        }
    }

    /// The node that holds all others; `None` if the tree is empty.
    #[must_use]
    pub fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    /// The box of a node.
    #[must_use]
    pub fn bounds(&self, node: u32) -> &Aabb {
        &self.nodes[node as usize].bounds
    }

    /// Nodes or items directly below a node: for walks in an order of their own.
    #[must_use]
    pub fn below(&self, node: u32) -> Below<'_> {
        let Node { first, n_items, .. } = self.nodes[node as usize];
        if n_items > 0 {
            Below::Items(&self.items[first as usize..(first + n_items) as usize])
        } else {
            Below::Nodes([first, first + 1])
        }
    }

    /// How many items there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Is there no item?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn every_box_that_meets_the_query_is_found() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let boxes: Vec<(u32, Aabb)> = (0..500)
            .map(|i| {
                let p = dvec3(random(), random(), random());
                let q = p + dvec3(random(), random(), random()) * 0.05;
                (i * 3, Aabb { min: p, max: q })
            })
            .collect();
        let tree = BoxTree::new(&boxes);
        for _ in 0..100 {
            let p = dvec3(random(), random(), random());
            let query = Aabb {
                min: p,
                max: p + DVec3::splat(0.1 * random()),
            };
            let mut found = Vec::new();
            tree.visit(|b| b.meets(&query), |i| found.push(i));
            for (i, b) in &boxes {
                if b.meets(&query) {
                    assert!(found.contains(i));
                }
            }
        }
    }
}
