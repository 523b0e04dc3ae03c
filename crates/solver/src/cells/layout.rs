//! Where the nodes of a mesh of cells are, and which depend on others.

use super::places::Places;
use crate::basis::{
    lattice, n_nodes, n_quad_nodes, quad_lattice, quad_values, segment_values, values,
};
use antumbra_mesh::cells::{Beyond, CellMesh};
use glam::DVec2;
use smallvec::SmallVec;

/// A point of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Spot {
    /// A corner.
    Corner(usize),
    /// At a share of edge `k`, from corner `k` on.
    Edge(usize, f64),
    /// At reference coordinates inside.
    Inside([f64; 2]),
}

/// A node at a T-vertex's edge: its value is that of the larger cell's edge there.
#[derive(Clone, Debug)]
struct Constraint {
    node: u32,
    masters: SmallVec<[(u32, f64); 5]>,
}

/// A mesh with its nodes.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) mesh: CellMesh,
    /// The leaf of the forest that each cell belongs to.
    pub(super) leaves: Vec<u32>,
    pub(super) degree: u8,
    /// Where the nodes of each cell begin in `cell_nodes`, and where the last ends.
    pub(super) first: Vec<u32>,
    pub(super) cell_nodes: Vec<u32>,
    /// The place of each node.
    pub(super) places: Vec<u32>,
    /// In the order in which values follow from others.
    constraints: Vec<Constraint>,
    pub(super) is_constrained: Vec<bool>,
    /// Inward at vertices on the border, zero elsewhere.
    inward: Vec<DVec2>,
}

/// Nodes of an element of this kind and degree.
#[must_use]
pub fn nodes_of_cell(is_quadrilateral: bool, degree: u8) -> usize {
    if is_quadrilateral {
        n_quad_nodes(degree)
    } else {
        n_nodes(degree)
    }
}

/// The local numbers of the nodes on edge `k` of an element, from corner `k` to the next.
#[must_use]
pub fn edge_nodes(is_quadrilateral: bool, degree: u8, k: usize) -> Vec<usize> {
    let n = if is_quadrilateral { 4 } else { 3 };
    let inner = usize::from(degree) - 1;
    let first = n + k * inner;
    let mut nodes = vec![k];
    if is_quadrilateral && k >= 2 {
        nodes.extend((first..first + inner).rev());
    } else {
        nodes.extend(first..first + inner);
    }
    nodes.push((k + 1) % n);
    nodes
}

/// The reference coordinates of a spot.
pub(super) fn reference(is_quadrilateral: bool, spot: Spot) -> [f64; 2] {
    let corners: &[[f64; 2]] = if is_quadrilateral {
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    } else {
        &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    };
    match spot {
        Spot::Corner(k) => corners[k],
        Spot::Edge(k, at) => {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            [0, 1].map(|i| a[i] + (b[i] - a[i]) * at)
        }
        Spot::Inside(at) => at,
    }
}

impl Layout {
    /// Finds the nodes of a mesh, and places for them.
    ///
    /// * `is_continuous` — do nodes at T-vertices follow from the larger cell?
    pub(super) fn new(
        mesh: CellMesh,
        leaves: Vec<u32>,
        degree: u8,
        is_continuous: bool,
        places: &mut Places,
    ) -> Self {
        let mut layout = Self {
            inward: inward(&mesh),
            mesh,
            leaves,
            degree,
            first: vec![0],
            cell_nodes: Vec::new(),
            places: Vec::new(),
            constraints: Vec::new(),
            is_constrained: Vec::new(),
        };
        let spots = [false, true].map(|is_quad| node_spots(is_quad, degree));
        let mut cell_places = Vec::new();
        for c in 0..layout.mesh.cells.len() {
            let is_quad = layout.mesh.cells[c].is_quadrilateral();
            for &spot in &spots[usize::from(is_quad)] {
                cell_places.push(layout.place(c, spot, places));
            }
            layout.first.push(cell_places.len() as u32);
        }
        let mut node_of_place = vec![u32::MAX; places.len()];
        for p in cell_places {
            let node = &mut node_of_place[p as usize];
            if *node == u32::MAX {
                *node = layout.places.len() as u32;
                layout.places.push(p);
            }
            layout.cell_nodes.push(*node);
        }
        layout.is_constrained = vec![false; layout.places.len()];
        if is_continuous {
            layout.constrain();
        }
        layout
    }

    /// The place at a spot of a cell: the same from all cells that have it.
    pub(super) fn place(&self, c: usize, spot: Spot, places: &mut Places) -> u32 {
        let cell = &self.mesh.cells[c];
        match spot {
            Spot::Corner(k) => {
                let v = cell.corners()[k] as usize;
                let toward = self.inward[v];
                let toward = (toward != DVec2::ZERO).then_some(toward);
                places.at(self.mesh.vertices[v], toward)
            }
            Spot::Edge(k, at) => {
                let [a, b] = cell.edge(k);
                let [p, q] = [a, b].map(|v| self.mesh.vertices[v as usize]);
                // From the vertex with the smaller id: the same bits from both sides.
                let uv = if a < b {
                    p + (q - p) * at
                } else {
                    q + (p - q) * (1.0 - at)
                };
                let is_border = self.mesh.beyond(c, k) == Beyond::Border;
                places.at(uv, is_border.then(|| (q - p).perp().normalize_or_zero()))
            }
            Spot::Inside(at) => places.at(self.mesh.point(c, at), None),
        }
    }

    fn constrain(&mut self) {
        let p = self.degree;
        let mut found: Vec<(u8, Constraint)> = Vec::new();
        for c in 0..self.mesh.cells.len() {
            let is_quad = self.mesh.cells[c].is_quadrilateral();
            for k in 0..self.mesh.cells[c].corners().len() {
                let Beyond::Coarser {
                    cell,
                    edge,
                    from,
                    to,
                } = self.mesh.beyond(c, k)
                else {
                    continue;
                };
                let coarse = &self.mesh.cells[cell as usize];
                let level = coarse.level;
                let masters: SmallVec<[u32; 5]> =
                    edge_nodes(coarse.is_quadrilateral(), p, usize::from(edge))
                        .into_iter()
                        .map(|i| self.nodes_of(cell as usize)[i])
                        .collect();
                for (i, local) in edge_nodes(is_quad, p, k).into_iter().enumerate() {
                    let node = self.nodes_of(c)[local];
                    if masters.contains(&node) {
                        continue;
                    }
                    let at = from + (to - from) * (i as f64 / f64::from(p));
                    let weights = segment_values(p, at);
                    let masters = masters.iter().copied().zip(weights).collect();
                    found.push((level, Constraint { node, masters }));
                }
            }
        }
        // The ends of an edge with a T-vertex may themselves lie on a larger cell's edge,
        // never on a smaller one's.
        found.sort_by_key(|(level, constraint)| (*level, constraint.node));
        found.dedup_by_key(|(_, constraint)| constraint.node);
        for (_, constraint) in &found {
            self.is_constrained[constraint.node as usize] = true;
        }
        self.constraints = found.into_iter().map(|f| f.1).collect();
    }

    pub(super) fn nodes_of(&self, c: usize) -> &[u32] {
        &self.cell_nodes[self.first[c] as usize..self.first[c + 1] as usize]
    }

    /// The places whose exact values are needed: those of nodes that follow from no other.
    pub(super) fn free_places(&self) -> Vec<u32> {
        let nodes = self.places.iter().zip(&self.is_constrained);
        nodes.filter(|n| !n.1).map(|n| *n.0).collect()
    }

    /// Values at all nodes, `width` each, from values at the free ones (any others are
    /// replaced).
    pub(super) fn complete(&self, field: &mut [f64], width: usize) {
        for constraint in &self.constraints {
            for band in 0..width {
                let value = constraint
                    .masters
                    .iter()
                    .map(|&(m, w)| w * field[m as usize * width + band])
                    .sum();
                field[constraint.node as usize * width + band] = value;
            }
        }
    }

    /// Interpolates a field on the nodes, `width` values each.
    pub(super) fn value(
        &self,
        field: &[f64],
        width: usize,
        c: usize,
        at: [f64; 2],
        band: usize,
    ) -> f64 {
        let nodes = self.nodes_of(c);
        let sum = |phi: &[f64]| -> f64 {
            let terms = nodes.iter().zip(phi);
            terms
                .map(|(&node, phi)| phi * field[node as usize * width + band])
                .sum()
        };
        if self.mesh.cells[c].is_quadrilateral() {
            sum(&quad_values(self.degree, at))
        } else {
            sum(&values(self.degree, [1.0 - at[0] - at[1], at[0], at[1]]))
        }
    }
}

/// The spots of the nodes of a cell, in their order.
fn node_spots(is_quadrilateral: bool, degree: u8) -> Vec<Spot> {
    let p = f64::from(degree);
    let n = if is_quadrilateral { 4 } else { 3 };
    let mut spots: Vec<Spot> = if is_quadrilateral {
        let nodes = quad_lattice(degree).into_iter().take(n_quad_nodes(degree));
        nodes
            .map(|node| Spot::Inside(node.map(|m| f64::from(m) / p)))
            .collect()
    } else {
        let nodes = lattice(degree).iter();
        nodes
            .map(|node| Spot::Inside([node[1], node[2]].map(|m| f64::from(m) / p)))
            .collect()
    };
    for k in 0..n {
        for (i, local) in edge_nodes(is_quadrilateral, degree, k)
            .into_iter()
            .enumerate()
        {
            spots[local] = match local {
                corner if corner < n => Spot::Corner(corner),
                _ => Spot::Edge(k, i as f64 / p),
            };
        }
    }
    spots
}

/// The sum of the inward normals of the border's edges at every vertex.
fn inward(mesh: &CellMesh) -> Vec<DVec2> {
    let mut inward = vec![DVec2::ZERO; mesh.vertices.len()];
    let mut on_border = Vec::new();
    for (c, cell) in mesh.cells.iter().enumerate() {
        for k in 0..cell.corners().len() {
            if mesh.beyond(c, k) == Beyond::Border {
                let ends = cell.edge(k);
                let [p, q] = ends.map(|v| mesh.vertices[v as usize]);
                for v in ends {
                    inward[v as usize] += (q - p).perp().normalize_or_zero();
                    on_border.push((v, c));
                }
            }
        }
    }
    for (v, c) in on_border {
        let sum = &mut inward[v as usize];
        // Where borders touch the sum may point nowhere: then into a cell.
        *sum = if sum.length() > 1e-6 {
            sum.normalize_or_zero()
        } else {
            (mesh.centre(c) - mesh.vertices[v as usize]).normalize_or_zero()
        };
    }
    inward
}
