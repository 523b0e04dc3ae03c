//! Refinement cell by cell: a forest of quartered cells.

use super::{Cell, CellMesh, Midpoints};
use crate::trimesh::ascending;
use glam::DVec2;

/// What a refined mesh keeps to where large cells meet small ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Nothing: any number of T-vertices.
    Plain,
    /// Neighbours across an edge differ by one level at most: one T-vertex an edge.
    Restricted,
    /// The same, and cells with T-vertices are divided so that none is left: into
    /// triangles, and rectangles where two opposite edges have one.
    ///
    /// # Source
    ///
    /// Baum, Mann, Smith & Winget 1991, *Making radiosity usable*; for triangles the
    /// closure of Bank, Sherman & Weiser 1983.
    Triangulated,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    cell: Cell,
    /// Four in a row, if it is quartered.
    first_child: Option<u32>,
}

/// Triangles and quadrilaterals, each quartered as often as asked: a quadtree on every
/// cell of the mesh it starts with.
///
/// A quadrilateral is quartered at the middles of its edges and its centre, a triangle at
/// the middles of its edges. Children of triangles and parallelograms have the shape of
/// their parent.
#[derive(Clone, Debug)]
pub struct CellForest {
    vertices: Vec<DVec2>,
    nodes: Vec<Node>,
    midpoints: Midpoints,
    rule: Rule,
}

impl CellForest {
    /// A forest with one tree for each cell of a mesh without T-vertices.
    #[must_use]
    pub fn new(base: CellMesh, rule: Rule) -> Self {
        let nodes = base.cells.into_iter().map(|cell| Node {
            cell,
            first_child: None,
        });
        Self {
            vertices: base.vertices,
            nodes: nodes.collect(),
            midpoints: Midpoints::new(),
            rule,
        }
    }

    /// The rule it keeps to.
    #[must_use]
    pub fn rule(&self) -> Rule {
        self.rule
    }

    /// The mesh of all leaves, and the leaf of every cell.
    ///
    /// Several cells may belong to one leaf if its T-vertices are resolved.
    #[must_use]
    pub fn mesh(&self) -> (CellMesh, Vec<u32>) {
        let (mut cells, mut leaves) = (Vec::new(), Vec::new());
        for (i, node) in self.nodes.iter().enumerate() {
            if node.first_child.is_some() {
                continue;
            }
            if self.rule == Rule::Triangulated {
                self.without_t_vertices(node.cell, &mut cells);
            } else {
                cells.push(node.cell);
            }
            leaves.resize(cells.len(), i as u32);
        }
        let mesh = CellMesh::new(self.vertices.clone(), cells, &self.midpoints);
        (mesh, leaves)
    }

    /// Quarters leaves, and others as far as the rule asks for it.
    ///
    /// The order of `leaves` and repetitions in it make no difference; what is no leaf is
    /// passed over.
    pub fn refine(&mut self, leaves: &[u32]) {
        let mut marked = leaves.to_vec();
        marked.sort_unstable();
        marked.dedup();
        while !marked.is_empty() {
            for &i in &marked {
                if self.nodes[i as usize].first_child.is_none() {
                    self.quarter(i);
                }
            }
            marked = if self.rule == Rule::Plain {
                Vec::new()
            } else {
                (0..self.nodes.len() as u32)
                    .filter(|&i| self.breaks_rule(i))
                    .collect()
            };
        }
    }

    /// Quarters all leaves.
    pub fn refine_all(&mut self) {
        let leaves: Vec<u32> = (0..self.nodes.len() as u32).collect();
        self.refine(&leaves);
    }

    fn midpoint_of(&self, a: u32, b: u32) -> Option<u32> {
        self.midpoints.get(&ascending(a, b)).copied()
    }

    /// Has a leaf two T-vertices on an edge, or so many that it had better be quartered?
    fn breaks_rule(&self, i: u32) -> bool {
        let node = &self.nodes[i as usize];
        if node.first_child.is_some() {
            return false;
        }
        let n = node.cell.corners().len();
        let mut n_halved = 0;
        for k in 0..n {
            let [a, b] = node.cell.edge(k);
            if let Some(m) = self.midpoint_of(a, b) {
                n_halved += 1;
                if self.midpoint_of(a, m).is_some() || self.midpoint_of(m, b).is_some() {
                    return true;
                }
            }
        }
        // A triangle that is halved once keeps its shape best; a quadrilateral with a
        // T-vertex on every edge would get more triangles than quarters.
        let most = if n == 3 { 1 } else { 3 };
        self.rule == Rule::Triangulated && n_halved > most
    }

    fn halve(&mut self, a: u32, b: u32) -> u32 {
        let key = ascending(a, b);
        if let Some(&m) = self.midpoints.get(&key) {
            return m;
        }
        let m = self.vertices.len() as u32;
        let [p, q] = key.map(|v| self.vertices[v as usize]);
        self.vertices.push((p + q) / 2.0);
        self.midpoints.insert(key, m);
        m
    }

    fn quarter(&mut self, i: u32) {
        let cell = self.nodes[i as usize].cell;
        let level = cell.level.saturating_add(1);
        let middle = |forest: &mut Self, k: usize| {
            let [a, b] = cell.edge(k);
            forest.halve(a, b)
        };
        let children = if let &[a, b, c, d] = cell.corners() {
            let [ab, bc, cd, da] = [0, 1, 2, 3].map(|k| middle(self, k));
            let m = self.vertices.len() as u32;
            let corners = [a, b, c, d].map(|v| self.vertices[v as usize]);
            self.vertices.push(corners.iter().sum::<DVec2>() / 4.0);
            [
                [a, ab, m, da],
                [ab, b, bc, m],
                [m, bc, c, cd],
                [da, m, cd, d],
            ]
            .map(|corners| Cell::quadrilateral(corners, level))
        } else {
            let [a, b, c] = [0, 1, 2].map(|k| cell.corners()[k]);
            let [ab, bc, ca] = [0, 1, 2].map(|k| middle(self, k));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                .map(|corners| Cell::triangle(corners, level))
        };
        self.nodes[i as usize].first_child = Some(self.nodes.len() as u32);
        self.nodes.extend(children.map(|cell| Node {
            cell,
            first_child: None,
        }));
    }

    /// Divides a leaf so that its T-vertices are corners.
    fn without_t_vertices(&self, cell: Cell, cells: &mut Vec<Cell>) {
        let n = cell.corners().len();
        let middles: Vec<Option<u32>> = (0..n)
            .map(|k| {
                let [a, b] = cell.edge(k);
                self.midpoint_of(a, b)
            })
            .collect();
        let halved: Vec<usize> = (0..n).filter(|&k| middles[k].is_some()).collect();
        // Turned so that the edge (or the middle one of a row of edges) that is halved
        // comes first.
        let turn = match halved.as_slice() {
            [] => {
                cells.push(cell);
                return;
            }
            &[k] => k,
            &[0, 3] => 3,
            &[k, _] => k,
            halved => {
                // Three of four: the first of the row follows the edge that is whole.
                (0..n)
                    .find(|k| !halved.contains(k))
                    .map_or(0, |k| (k + 1) % n)
            }
        };
        let corner = |k: usize| cell.corners()[(turn + k) % n];
        let middle = |k: usize| middles[(turn + k) % n].unwrap_or(corner(k));
        let level = cell.level;
        let mut triangle = |corners| cells.push(Cell::triangle(corners, level));
        let m = middle(0);
        if n == 3 {
            triangle([m, corner(2), corner(0)]);
            triangle([m, corner(1), corner(2)]);
            return;
        }
        let [a, b, c, d] = [0, 1, 2, 3].map(corner);
        let is_opposite = halved.len() == 2 && (halved[1] - halved[0]) == 2;
        if halved.len() == 1 {
            triangle([a, m, d]);
            triangle([m, b, c]);
            triangle([m, c, d]);
        } else if is_opposite {
            let n = middle(2);
            cells.push(Cell::quadrilateral([a, m, n, d], level));
            cells.push(Cell::quadrilateral([m, b, c, n], level));
        } else if halved.len() == 2 {
            let n = middle(1);
            triangle([m, b, n]);
            triangle([n, c, d]);
            triangle([m, n, d]);
            triangle([a, m, d]);
        } else {
            let (n, o) = (middle(1), middle(2));
            triangle([m, b, n]);
            triangle([n, c, o]);
            triangle([m, n, o]);
            cells.push(Cell::quadrilateral([a, m, o, d], level));
        }
    }
}
