//! Refinement by bisection: of longest edges (Rivara 1984), or of edges that are named.

use std::cmp::Ordering;

use antumbra_geom::{coarse_order, exceeds};
use glam::DVec2;

use crate::trimesh::{TriMesh, ascending};

/// A triangle whose longest edge is longer than this many times the one through which a
/// neighbour is bisected is cut there as well, and not through its longest edge.
///
/// Slim triangles lie along layers. With their longest edges (no bound), a bisection
/// beside a layer goes on along all of it: at 1e-2 and 1e-3 the fixtures take 1.2 times
/// the evaluations. With any edge (1), shapes get worse wherever elements grade.
const SLIM: f64 = 2.5;

/// An edge of a triangle, and where to split it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// The triangle.
    pub triangle: u32,
    /// The edge from this corner to the next.
    pub edge: usize,
    /// The share of the edge before the new vertex, above 0 and below 1.
    pub at: f64,
}

impl TriMesh {
    /// Bisects the marked triangles across their longest edges.
    ///
    /// Neighbours are bisected as far as it takes for the mesh to stay conforming:
    /// no vertex ever lies inside an edge. Slim ones are cut where the edge is, others
    /// through their longest edges first. The halves of an edge inherit its
    /// curves. The order of `marked` and repetitions in it make no difference.
    ///
    /// Returns for each triangle which triangle before the call it is a part of. A
    /// triangle that was bisected keeps its index for one of its parts; others are
    /// appended. A triangle whose longest edge is shorter than four pixels of the
    /// arrangement stays whole.
    ///
    /// # Panics
    ///
    /// If a marked index is no triangle.
    ///
    /// # Source
    ///
    /// Rivara 1997, *New longest-edge algorithms for the refinement and/or
    /// improvement of unstructured triangulations*.
    pub fn bisect(&mut self, marked: &[u32]) -> Vec<u32> {
        let mut marked = marked.to_vec();
        marked.sort_unstable();
        marked.dedup();
        let mut refinement = Refinement::new(self);
        for t in marked {
            if refinement.is_splittable(t) {
                refinement.split(t);
            }
        }
        refinement.parents
    }

    /// Splits edges that are named, whatever their lengths, and the triangles beside them.
    ///
    /// The triangle beyond is cut in two as well, and no other. Where an edge has cut a
    /// triangle that was named itself, the latter is left at that. Nothing shorter than
    /// two pixels of the arrangement is made.
    ///
    /// Returns what [`bisect`](Self::bisect) does. The order of `splits` makes no
    /// difference.
    ///
    /// # Panics
    ///
    /// If an index is no triangle, or an edge is not below 3.
    pub fn split(&mut self, splits: &[Split]) -> Vec<u32> {
        let mut splits = splits.to_vec();
        splits.sort_by_key(|s| (s.triangle, s.edge));
        let mut refinement = Refinement::new(self);
        for split in splits {
            if refinement.was_split(split.triangle) {
                continue;
            }
            let ends = [split.edge, (split.edge + 1) % 3];
            let [p, q] = ends.map(|i| refinement.mesh.corner(split.triangle, i));
            let shorter = p.distance(q) * split.at.min(1.0 - split.at);
            if shorter >= 2.0 * refinement.mesh.pixel() {
                refinement.split_edge(split.triangle, split.edge, p + (q - p) * split.at);
            }
        }
        refinement.parents
    }

    /// The longest edge of a triangle. No two edges of a mesh are equally long:
    /// where lengths are, up to rounding, vertices decide. So the same edges are
    /// bisected in a mesh and in its images, in which equal lengths are rounded apart.
    fn longest_edge(&self, t: u32) -> usize {
        let triangle = self.triangles[t as usize];
        let mut longest = 0;
        for k in 1..3 {
            let [e, f] = [k, longest].map(|k| ascending(triangle[k], triangle[(k + 1) % 3]));
            if self.compare_lengths(e, f) == Ordering::Greater {
                longest = k;
            }
        }
        longest
    }

    fn compare_lengths(&self, e: [u32; 2], f: [u32; 2]) -> Ordering {
        let [p, q] = [e, f].map(|[a, b]| {
            let [p, q] = [a, b].map(|v| self.vertices[v as usize]);
            coarse_order(p.distance(q), self.pixel)
        });
        p.cmp(&q).then(e.cmp(&f))
    }
}

/// A change of a mesh under way.
pub(crate) struct Refinement<'a> {
    pub(crate) mesh: &'a mut TriMesh,
    /// Which triangle before the change each is a part of.
    pub(crate) parents: Vec<u32>,
    /// Which triangles there were at the start have been bisected.
    is_split: Vec<bool>,
}

impl<'a> Refinement<'a> {
    pub(crate) fn new(mesh: &'a mut TriMesh) -> Self {
        let n = mesh.triangles.len();
        Self {
            mesh,
            parents: (0..n as u32).collect(),
            is_split: vec![false; n],
        }
    }

    /// Is the triangle so large that halves of its longest edge are shorter?
    ///
    /// At the last bits of coordinates they need not be, and bisection would not
    /// end. A pixel has more than a thousand such units. What a bisection has to
    /// bisect elsewhere has longer edges.
    fn is_splittable(&self, t: u32) -> bool {
        let triangle = self.mesh.triangles[t as usize];
        let k = self.mesh.longest_edge(t);
        let [p, q] = [triangle[k], triangle[(k + 1) % 3]].map(|v| self.mesh.vertices[v as usize]);
        p.distance(q) >= 4.0 * self.mesh.pixel()
    }

    /// Was this triangle split since the start?
    pub(crate) fn was_split(&self, t: u32) -> bool {
        self.is_split.get(t as usize).copied().unwrap_or(true)
    }

    /// Bisects a triangle, and before it whatever is in the way.
    fn split(&mut self, t: u32) {
        // The longest edges from triangle to triangle become strictly longer, so
        // the path ends: at the border, or where two share their longest edge.
        let mut path = vec![t];
        while let Some(&last) = path.last() {
            if self.is_split[t as usize] {
                return;
            }
            let k = self.mesh.longest_edge(last);
            let beyond = self.mesh.neighbours[last as usize][k];
            let back = beyond.map(|n| (n, self.side_towards(n, last)));
            match back {
                Some((n, side)) if !self.is_bisected_across(n, side) => path.push(n),
                _ => {
                    let [p, q] = [k, (k + 1) % 3].map(|i| self.mesh.corner(last, i));
                    self.split_edge(last, k, (p + q) / 2.0);
                    // Both have longer edges than the rest of the path, which stays.
                    path.pop();
                }
            }
        }
    }

    /// May a triangle be cut through this edge because a neighbour is? Through its
    /// longest edge, or if it is [`SLIM`].
    fn is_bisected_across(&self, t: u32, edge: usize) -> bool {
        let length = |k: usize| {
            let [p, q] = [k, (k + 1) % 3].map(|i| self.mesh.corner(t, i));
            p.distance(q)
        };
        let longest = self.mesh.longest_edge(t);
        longest == edge || exceeds(length(longest), SLIM * length(edge))
    }

    /// Which edge of triangle `t` leads to triangle `to`.
    pub(crate) fn side_towards(&self, t: u32, to: u32) -> usize {
        let sides = self.mesh.neighbours[t as usize];
        sides
            .iter()
            .position(|&n| n == Some(to))
            .expect("neighbours know each other")
    }

    /// Puts a vertex on edge `k` of a triangle and cuts the triangles beside it from
    /// there to their opposite corners. Returns the vertex.
    pub(crate) fn split_edge(&mut self, t: u32, k: usize, at: DVec2) -> u32 {
        let beyond = self.mesh.neighbours[t as usize][k].map(|n| (n, self.side_towards(n, t)));
        let mesh = &mut *self.mesh;
        let triangle = mesh.triangles[t as usize];
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        let m = mesh.vertices.len() as u32;
        mesh.vertices.push(at);
        if let Some(curves) = mesh.edges.remove(&ascending(a, b)) {
            mesh.edges.insert(ascending(a, m), curves);
            mesh.edges.insert(ascending(m, b), curves);
        }

        let (near_a, near_b) = self.halve(t, k, m);
        if let Some((n, side)) = beyond {
            // Seen from there the edge goes from b to a.
            let (beyond_b, beyond_a) = self.halve(n, side, m);
            self.join(near_a, a, m, beyond_a);
            self.join(near_b, m, b, beyond_b);
        }
        m
    }

    /// Puts a vertex inside a triangle and joins it to the corners. Returns it.
    pub(crate) fn split_inside(&mut self, t: u32, at: DVec2) -> u32 {
        let mesh = &mut *self.mesh;
        let [a, b, c] = mesh.triangles[t as usize];
        let [_, beyond_bc, beyond_ca] = mesh.neighbours[t as usize];
        let m = mesh.vertices.len() as u32;
        mesh.vertices.push(at);
        let at_b = mesh.triangles.len() as u32;
        let at_c = at_b + 1;
        mesh.triangles[t as usize] = [a, b, m];
        mesh.neighbours[t as usize][1] = Some(at_b);
        mesh.neighbours[t as usize][2] = Some(at_c);
        mesh.triangles.extend([[b, c, m], [c, a, m]]);
        mesh.neighbours.push([beyond_bc, Some(at_c), Some(t)]);
        mesh.neighbours.push([beyond_ca, Some(t), Some(at_b)]);
        for (beyond, new) in [(beyond_bc, at_b), (beyond_ca, at_c)] {
            if let Some(n) = beyond {
                let back = self.side_towards(n, t);
                self.mesh.neighbours[n as usize][back] = Some(new);
            }
        }
        let parent = self.parents[t as usize];
        self.parents.extend([parent; 2]);
        self.is_split[parent as usize] = true;
        m
    }

    /// Cuts a triangle from `m` in edge `k` to the opposite corner.
    ///
    /// Returns the halves at the edge's first and second end. Across the halves of
    /// the edge they have no neighbours yet.
    fn halve(&mut self, t: u32, k: usize, m: u32) -> (u32, u32) {
        let mesh = &mut *self.mesh;
        let triangle = mesh.triangles[t as usize];
        let sides = mesh.neighbours[t as usize];
        let [a, b, c] = [0, 1, 2].map(|i| triangle[(k + i) % 3]);
        let [_, beyond_bc, beyond_ca] = [0, 1, 2].map(|i| sides[(k + i) % 3]);

        let new = mesh.triangles.len() as u32;
        mesh.triangles[t as usize] = [a, m, c];
        mesh.neighbours[t as usize] = [None, Some(new), beyond_ca];
        mesh.triangles.push([m, b, c]);
        mesh.neighbours.push([None, beyond_bc, Some(t)]);
        if let Some(n) = beyond_bc {
            let back = self.side_towards(n, t);
            self.mesh.neighbours[n as usize][back] = Some(new);
        }

        let parent = self.parents[t as usize];
        self.parents.push(parent);
        self.is_split[parent as usize] = true;
        (t, new)
    }

    /// Makes triangles neighbours across the edge that goes from `a` to `b` in `t`.
    fn join(&mut self, t: u32, a: u32, b: u32, other: u32) {
        for (t, a, b, beyond) in [(t, a, b, other), (other, b, a, t)] {
            let triangle = self.mesh.triangles[t as usize];
            let side = (0..3).find(|&k| triangle[k] == a && triangle[(k + 1) % 3] == b);
            let side = side.expect("both halves have their half of the edge");
            self.mesh.neighbours[t as usize][side] = Some(beyond);
        }
    }
}
