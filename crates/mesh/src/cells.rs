//! Meshes of triangles and quadrilaterals that know nothing of shadows: the generators
//! that the discontinuity mesh is compared with.
//!
//! A [`CellMesh`] may have *T-vertices*: vertices inside an edge of a larger cell. What
//! lies beyond every edge is known ([`Beyond`]), so that whoever puts values on the mesh
//! can keep them continuous there. [`uniform`] makes conforming meshes of any polygon;
//! a [`CellForest`] refines them cell by cell, with or without T-vertices.

mod forest;
mod generate;
mod locate;
mod strip;
#[cfg(test)]
mod tests;

pub use forest::{CellForest, Rule};
pub use generate::{CellShape, graded, uniform};
pub use locate::CellLocator;

use crate::trimesh::{ascending, shape_quality};
use glam::DVec2;
use std::collections::HashMap;

/// The vertices in the middle of edges, by the edges' ascending ends. For lookup only.
pub(crate) type Midpoints = HashMap<[u32; 2], u32>;

/// A triangle or a convex quadrilateral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    corners: [u32; 4],
    n_corners: u8,
    /// How often its size was halved since the mesh was made.
    pub level: u8,
}

impl Cell {
    /// A triangle, counter-clockwise.
    #[must_use]
    pub fn triangle([a, b, c]: [u32; 3], level: u8) -> Self {
        Self {
            corners: [a, b, c, u32::MAX],
            n_corners: 3,
            level,
        }
    }

    /// A quadrilateral, counter-clockwise.
    #[must_use]
    pub fn quadrilateral(corners: [u32; 4], level: u8) -> Self {
        Self {
            corners,
            n_corners: 4,
            level,
        }
    }

    /// The corners, counter-clockwise: three or four vertices.
    #[must_use]
    pub fn corners(&self) -> &[u32] {
        &self.corners[..usize::from(self.n_corners)]
    }

    /// Is it a quadrilateral?
    #[must_use]
    pub fn is_quadrilateral(&self) -> bool {
        self.n_corners == 4
    }

    /// The ends of edge `k`, which goes from corner `k` to the next.
    #[must_use]
    pub fn edge(&self, k: usize) -> [u32; 2] {
        let corners = self.corners();
        [corners[k], corners[(k + 1) % corners.len()]]
    }
}

/// What lies beyond an edge of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Beyond {
    /// Nothing: the border of the receiver.
    Border,
    /// One cell with the same edge.
    Cell(u32),
    /// Several smaller cells: the edge has T-vertices.
    Finer,
    /// A larger cell, of whose edge this one is a part.
    Coarser {
        /// The larger cell.
        cell: u32,
        /// Which of its edges.
        edge: u8,
        /// Where this edge's first corner is on it, 0 to 1 from its first corner.
        from: f64,
        /// Where this edge's second corner is on it.
        to: f64,
    },
}

/// A mesh of triangles and quadrilaterals, perhaps with T-vertices.
#[derive(Clone, Debug, Default)]
pub struct CellMesh {
    /// Positions in the chart. Those of the forest's inner cells may be among them.
    pub vertices: Vec<DVec2>,
    /// The cells.
    pub cells: Vec<Cell>,
    beyond: Vec<[Beyond; 4]>,
    n_t_vertices: usize,
}

impl CellMesh {
    /// A mesh of cells. Edges end at the same vertices, or halve each other at the
    /// `midpoints` of edges.
    pub(crate) fn new(vertices: Vec<DVec2>, cells: Vec<Cell>, midpoints: &Midpoints) -> Self {
        let mut mesh = Self {
            beyond: vec![[Beyond::Border; 4]; cells.len()],
            vertices,
            cells,
            n_t_vertices: 0,
        };
        mesh.link(midpoints);
        mesh
    }

    fn link(&mut self, midpoints: &Midpoints) {
        let mut sides: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(4 * self.cells.len());
        for (c, cell) in self.cells.iter().enumerate() {
            for k in 0..cell.corners().len() {
                let [a, b] = cell.edge(k);
                sides.push((ascending(a, b), c as u32, k as u8));
            }
        }
        sides.sort_unstable();
        let mut alone: Vec<([u32; 2], u32, u8)> = Vec::new();
        for same in sides.chunk_by(|a, b| a.0 == b.0) {
            match same {
                [(_, c, k), (_, d, l)] => {
                    self.beyond[*c as usize][usize::from(*k)] = Beyond::Cell(*d);
                    self.beyond[*d as usize][usize::from(*l)] = Beyond::Cell(*c);
                }
                several => alone.extend_from_slice(several),
            }
        }
        // An edge with a vertex in its middle and a cell on one side only: the halves
        // belong to smaller cells beyond, or are halved once more.
        let mut t_vertices = Vec::new();
        for &(_, c, k) in &alone {
            let [a, b] = self.cells[c as usize].edge(usize::from(k));
            let mut parts = vec![(a, b, 0.0, 1.0)];
            let mut is_finer = false;
            while let Some((p, q, from, to)) = parts.pop() {
                let Some(&m) = midpoints.get(&ascending(p, q)) else {
                    continue;
                };
                let middle = (from + to) / 2.0;
                for (p, q, from, to) in [(p, m, from, middle), (m, q, middle, to)] {
                    let found = alone.binary_search_by(|s| s.0.cmp(&ascending(p, q)));
                    match found.map(|i| alone[i]) {
                        Ok((_, d, l)) => {
                            // Seen from there the edge goes the other way.
                            self.beyond[d as usize][usize::from(l)] = Beyond::Coarser {
                                cell: c,
                                edge: k,
                                from: to,
                                to: from,
                            };
                            is_finer = true;
                            t_vertices.push(m);
                        }
                        Err(_) => parts.push((p, q, from, to)),
                    }
                }
            }
            if is_finer {
                self.beyond[c as usize][usize::from(k)] = Beyond::Finer;
            }
        }
        t_vertices.sort_unstable();
        t_vertices.dedup();
        self.n_t_vertices = t_vertices.len();
    }

    /// What lies beyond edge `k` of a cell.
    #[must_use]
    pub fn beyond(&self, cell: usize, k: usize) -> Beyond {
        self.beyond[cell][k]
    }

    /// Vertices inside an edge of a cell.
    #[must_use]
    pub fn n_t_vertices(&self) -> usize {
        self.n_t_vertices
    }

    /// The positions of a cell's corners; the fourth of a triangle is its third.
    #[must_use]
    pub fn corner_positions(&self, cell: usize) -> [DVec2; 4] {
        let corners = self.cells[cell].corners();
        [0, 1, 2, 3].map(|k| self.vertices[corners[k.min(corners.len() - 1)] as usize])
    }

    /// The area of a cell, in the square of the chart's unit.
    #[must_use]
    pub fn area(&self, cell: usize) -> f64 {
        let [a, b, c, d] = self.corner_positions(cell);
        // Half the cross product of the diagonals; of a triangle, d is c.
        (c - a).perp_dot(d - b) / 2.0
    }

    /// The area of all cells together.
    #[must_use]
    pub fn total_area(&self) -> f64 {
        (0..self.cells.len()).map(|c| self.area(c)).sum()
    }

    /// The mean of a cell's corners.
    #[must_use]
    pub fn centre(&self, cell: usize) -> DVec2 {
        let corners = self.cells[cell].corners();
        corners
            .iter()
            .map(|&v| self.vertices[v as usize])
            .sum::<DVec2>()
            / corners.len() as f64
    }

    /// The length of a cell's longest edge.
    #[must_use]
    pub fn longest_edge(&self, cell: usize) -> f64 {
        let cell = &self.cells[cell];
        (0..cell.corners().len())
            .map(|k| {
                let [a, b] = cell.edge(k).map(|v| self.vertices[v as usize]);
                a.distance(b)
            })
            .fold(0.0, f64::max)
    }

    /// The point of a cell with the given reference coordinates.
    ///
    /// * Of a triangle, `at` are the barycentric coordinates of the second and third corner.
    /// * Of a quadrilateral, `at` is in the unit square, in which the corners are (0, 0),
    ///   (1, 0), (1, 1), (0, 1): the bilinear map.
    #[must_use]
    pub fn point(&self, cell: usize, [s, t]: [f64; 2]) -> DVec2 {
        let [a, b, c, d] = self.corner_positions(cell);
        if self.cells[cell].is_quadrilateral() {
            a + (b - a) * s + (d - a) * t + (a - b + c - d) * (s * t)
        } else {
            a + (b - a) * s + (c - a) * t
        }
    }

    /// The reference coordinates of a point, the inverse of [`point`](Self::point).
    ///
    /// Outside of its cell they are outside of the reference cell, and of a quadrilateral
    /// that is no parallelogram they may then be anything.
    #[must_use]
    pub fn reference(&self, cell: usize, point: DVec2) -> [f64; 2] {
        let [a, b, c, d] = self.corner_positions(cell);
        if !self.cells[cell].is_quadrilateral() {
            let area = (b - a).perp_dot(c - a);
            let s = (point - a).perp_dot(c - a) / area;
            let t = (b - a).perp_dot(point - a) / area;
            return [s, t];
        }
        // Newton's iteration from the middle; of a parallelogram one step is exact.
        let (u, v, w) = (b - a, d - a, a - b + c - d);
        let (mut s, mut t) = (0.5, 0.5);
        for _ in 0..16 {
            let rest = point - (a + u * s + v * t + w * (s * t));
            let (along_s, along_t) = (u + w * t, v + w * s);
            let determinant = along_s.perp_dot(along_t);
            let step = [
                rest.perp_dot(along_t) / determinant,
                along_s.perp_dot(rest) / determinant,
            ];
            // Far outside the map folds over; there any answer outside will do.
            s = (s + step[0]).clamp(-4.0, 5.0);
            t = (t + step[1]).clamp(-4.0, 5.0);
            if step[0].abs().max(step[1].abs()) < 1e-15 {
                break;
            }
        }
        [s, t]
    }

    /// How good a cell's shape is, from 0 (degenerate) to 1.
    ///
    /// * A triangle: twice the ratio of inscribed to circumscribed radius
    ///   ([`shape_quality`]); 1 is equilateral.
    /// * A quadrilateral: the worst of its corners, each `2 u×v / (u² + v²)` for the edges
    ///   u and v that meet there; 1 is a square, and a rectangle of 1 to 2 has 0.8.
    ///
    /// # Source
    ///
    /// For quadrilaterals the algebraic shape metric of Knupp 2003, *Algebraic mesh quality
    /// metrics for unstructured initial meshes*.
    #[must_use]
    pub fn quality(&self, cell: usize) -> f64 {
        let p = self.corner_positions(cell);
        if !self.cells[cell].is_quadrilateral() {
            return shape_quality([p[0], p[1], p[2]]);
        }
        (0..4)
            .map(|k| {
                let (u, v) = (p[(k + 1) % 4] - p[k], p[(k + 3) % 4] - p[k]);
                2.0 * u.perp_dot(v) / (u.length_squared() + v.length_squared())
            })
            .fold(1.0, f64::min)
            .max(0.0)
    }

    /// Checks everything a mesh promises.
    ///
    /// Cells are convex and counter-clockwise, know each other across their edges, and
    /// the part of an edge that a smaller cell has lies where it says.
    ///
    /// # Errors
    ///
    /// The first broken promise, for people.
    pub fn check(&self) -> Result<(), String> {
        for (c, cell) in self.cells.iter().enumerate() {
            let n = cell.corners().len();
            let p = self.corner_positions(c);
            for k in 0..n {
                let (u, v) = (p[(k + 1) % n] - p[k], p[(k + n - 1) % n] - p[k]);
                if u.perp_dot(v).is_nan() || u.perp_dot(v) <= 0.0 {
                    return Err(format!("cell {c} is not convex at corner {k}: {p:?}"));
                }
            }
            for k in 0..n {
                self.check_edge(c, k)?;
            }
        }
        Ok(())
    }

    fn check_edge(&self, c: usize, k: usize) -> Result<(), String> {
        let [a, b] = self.cells[c].edge(k);
        match self.beyond[c][k] {
            Beyond::Border | Beyond::Finer => Ok(()),
            Beyond::Cell(d) => {
                let other = &self.cells[d as usize];
                let back = (0..other.corners().len()).find(|&l| other.edge(l) == [b, a]);
                match back.map(|l| self.beyond[d as usize][l]) {
                    Some(Beyond::Cell(back)) if back as usize == c => Ok(()),
                    other => Err(format!(
                        "cell {c} has {d} beyond edge {k}, where it is {other:?}"
                    )),
                }
            }
            Beyond::Coarser {
                cell,
                edge,
                from,
                to,
            } => {
                if self.beyond[cell as usize][usize::from(edge)] != Beyond::Finer {
                    return Err(format!("edge {edge} of cell {cell} has no T-vertices"));
                }
                let [p, q] = self.cells[cell as usize]
                    .edge(usize::from(edge))
                    .map(|v| self.vertices[v as usize]);
                for (v, at) in [(a, from), (b, to)] {
                    let off = self.vertices[v as usize].distance(p + (q - p) * at);
                    if off > 1e-12 * (p.length() + q.length() + p.distance(q)) {
                        return Err(format!("vertex {v} is {off} off the edge of cell {cell}"));
                    }
                }
                Ok(())
            }
        }
    }
}
