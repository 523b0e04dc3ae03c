//! A conforming triangulation of a receiver whose edges remember their curves.

use std::collections::HashMap;

use antumbra_geom::cdt::{self, CdtError};
use glam::{DVec2, dvec2};

use crate::arrange::{Arrangement, Order, TaggedCurve};
use crate::sets::{CurveSets, SetId};

/// Why a receiver could not be triangulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The edges are no arrangement.
    #[error("the arrangement cannot be triangulated: {0:?}")]
    Triangulation(CdtError),
    /// The boundary curves bound no area.
    #[error("the boundary curves bound no area (the arrangement has {n_edges} edges)")]
    NoArea {
        /// How many edges the arrangement has.
        n_edges: usize,
    },
}

/// A conforming triangulation of a receiver, whose edges remember their curves.
#[derive(Clone, Debug)]
pub struct TriMesh {
    /// Positions in the chart.
    pub vertices: Vec<DVec2>,
    /// Corners, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// The triangle beyond each edge, from corner k to k + 1.
    pub(crate) neighbours: Vec<[Option<u32>; 3]>,
    /// The curves of each edge that has some, by ascending ends. For lookup only.
    pub(crate) edges: HashMap<[u32; 2], SetId>,
    pub(crate) sets: CurveSets,
    /// The strongest order of each set.
    pub(crate) orders: Vec<Order>,
    /// The side of a pixel of the arrangement: how exact positions are.
    pub(crate) pixel: f64,
}

impl TriMesh {
    /// Triangulates what the boundary curves of an arrangement bound.
    ///
    /// The triangulation is constrained Delaunay, of the vertices' pixels. Without
    /// vertices of its own: all are those of the arrangement, in the same order,
    /// less those outside.
    ///
    /// # Errors
    ///
    /// [`MeshError::NoArea`] if nothing is inside; [`MeshError::Triangulation`] if
    /// `arrangement` was not made by [`arrange`](crate::arrange).
    ///
    /// # Panics
    ///
    /// If `curves` are fewer than those the arrangement was made of.
    pub fn new(arrangement: &Arrangement, curves: &[TaggedCurve]) -> Result<Self, MeshError> {
        let pixels: Vec<DVec2> = arrangement
            .pixels
            .iter()
            .map(|p| dvec2(p[0] as f64, p[1] as f64))
            .collect();
        let ends: Vec<[u32; 2]> = arrangement.edges.iter().map(|e| e.ends).collect();
        let cdt = cdt::triangulate(&pixels, &ends).map_err(MeshError::Triangulation)?;
        let edge = |a: u32, b: u32| {
            let found = ends.binary_search(&[a.min(b), a.max(b)]).ok();
            found.map(|e| &arrangement.edges[e])
        };
        let inside = cdt::inside_by_parity(&cdt.triangles, |a, b| {
            edge(a, b).is_some_and(|e| e.separates)
        });

        // Keep what is inside, and number its vertices without gaps.
        let mut triangles: Vec<[u32; 3]> = cdt
            .triangles
            .iter()
            .zip(&inside)
            .filter(|t| *t.1)
            .map(|t| *t.0)
            .collect();
        if triangles.is_empty() {
            return Err(MeshError::NoArea {
                n_edges: ends.len(),
            });
        }
        let mut edges = HashMap::with_capacity(ends.len());
        let mut new_ids = vec![u32::MAX; pixels.len()];
        triangles
            .iter()
            .flatten()
            .for_each(|&v| new_ids[v as usize] = 0);
        let mut vertices = Vec::new();
        for (id, &p) in new_ids.iter_mut().zip(&arrangement.vertices) {
            if *id == 0 {
                *id = vertices.len() as u32;
                vertices.push(p);
            }
        }
        for triangle in &mut triangles {
            let old = *triangle;
            *triangle = old.map(|v| new_ids[v as usize]);
            for k in 0..3 {
                if let Some(e) = edge(old[k], old[(k + 1) % 3]) {
                    edges.insert(ascending(triangle[k], triangle[(k + 1) % 3]), e.curves);
                }
            }
        }

        let sets = arrangement.sets.clone();
        let orders = (0..sets.len() as u32)
            .map(|s| {
                sets.get(SetId(s))
                    .iter()
                    .map(|&c| curves[c as usize].order)
                    .min()
            })
            .map(|order| order.unwrap_or(Order::D2))
            .collect();
        let neighbours = cdt::neighbours(&triangles);
        let pixel = arrangement.pixel;
        Ok(Self {
            vertices,
            triangles,
            neighbours,
            edges,
            sets,
            orders,
            pixel,
        })
    }

    /// A mesh of nothing.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            neighbours: Vec::new(),
            edges: HashMap::new(),
            sets: CurveSets::default(),
            orders: Vec::new(),
            pixel: 1.0,
        }
    }

    /// The curves that the edge between two vertices is part of, if any.
    #[must_use]
    pub fn edge_curves(&self, a: u32, b: u32) -> Option<SetId> {
        self.edges.get(&ascending(a, b)).copied()
    }

    /// The strongest order of the curves on the edge between two vertices.
    #[must_use]
    pub fn edge_order(&self, a: u32, b: u32) -> Option<Order> {
        self.edge_curves(a, b)
            .map(|set| self.orders[set.0 as usize])
    }

    /// The triangle beyond edge `edge`, which goes from corner `edge` to the next.
    #[must_use]
    pub fn neighbour(&self, triangle: u32, edge: usize) -> Option<u32> {
        self.neighbours[triangle as usize][edge]
    }

    /// The sets of curves that edges are part of.
    #[must_use]
    pub fn sets(&self) -> &CurveSets {
        &self.sets
    }

    pub(crate) fn corner(&self, triangle: u32, k: usize) -> DVec2 {
        self.vertices[self.triangles[triangle as usize][k] as usize]
    }

    /// Adds a curve to an edge.
    pub(crate) fn tag(&mut self, a: u32, b: u32, curve: u32, order: Order) {
        let key = ascending(a, b);
        let old = self.edges.get(&key).copied();
        let mut members = old.map_or(Vec::new(), |set| self.sets.get(set).to_vec());
        members.push(curve);
        let strongest = old.map_or(order, |set| order.min(self.orders[set.0 as usize]));
        let set = self.sets.intern(&members);
        if set.0 as usize == self.orders.len() {
            self.orders.push(strongest);
        }
        self.edges.insert(key, set);
    }

    /// The corners' positions.
    #[must_use]
    pub fn corners(&self, triangle: u32) -> [DVec2; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize])
    }

    /// The area of a triangle, in the square of the chart's unit.
    ///
    /// A sliver thinner than a pixel of the arrangement can be slightly negative.
    #[must_use]
    pub fn area(&self, triangle: u32) -> f64 {
        let [a, b, c] = self.corners(triangle);
        (b - a).perp_dot(c - a) / 2.0
    }

    /// The area of all triangles together.
    #[must_use]
    pub fn total_area(&self) -> f64 {
        (0..self.triangles.len() as u32).map(|t| self.area(t)).sum()
    }

    /// The side of a pixel of the arrangement: how exact positions are.
    #[must_use]
    pub fn pixel(&self) -> f64 {
        self.pixel
    }

    /// Checks everything a mesh promises.
    ///
    /// Triangles are counter-clockwise up to a pixel, an edge has one triangle at the
    /// border and two elsewhere, neighbours know each other, and every edge with
    /// curves is there.
    ///
    /// # Errors
    ///
    /// The first broken promise, for people.
    pub fn check(&self) -> Result<(), String> {
        for (t, corners) in self.triangles.iter().enumerate() {
            let [a, b, c] = self.corners(t as u32);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let area = self.area(t as u32);
            if area.is_nan() || area < -longest * self.pixel {
                return Err(format!("triangle {t} {corners:?} has an area of {area}"));
            }
            if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
                return Err(format!("triangle {t} {corners:?} has a corner twice"));
            }
        }
        self.check_edges()?;
        if self.neighbours != cdt::neighbours(&self.triangles) {
            return Err("neighbours are not those across edges".into());
        }
        Ok(())
    }

    fn check_edges(&self) -> Result<(), String> {
        let mut sides: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * self.triangles.len());
        for triangle in &self.triangles {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                sides.push((ascending(a, b), a < b));
            }
        }
        sides.sort_unstable();
        let mut n_with_curves = 0;
        for same in sides.chunk_by(|a, b| a.0 == b.0) {
            let [a, b] = same[0].0;
            n_with_curves += usize::from(self.edge_curves(a, b).is_some());
            match same {
                // A vertex inside an edge would make the edge look like a border.
                [_] if self.edge_order(a, b) == Some(Order::Boundary) => {}
                [_] => return Err(format!("edge {a}-{b} has one triangle but is no border")),
                [s, t] if s.1 != t.1 => {}
                _ => return Err(format!("edge {a}-{b} has {} triangles", same.len())),
            }
        }
        if n_with_curves != self.edges.len() {
            let n = self.edges.len() - n_with_curves;
            return Err(format!("{n} edges with curves are no edges of triangles"));
        }
        Ok(())
    }
}

/// How good a triangle's shape is: twice its incircle's radius over its
/// circumcircle's.
///
/// Returns 1 for an equilateral triangle, 0 for one without area or turning clockwise.
#[must_use]
pub fn shape_quality([a, b, c]: [DVec2; 3]) -> f64 {
    let [p, q, r] = [b.distance(c), c.distance(a), a.distance(b)];
    let area = (b - a).perp_dot(c - a) / 2.0;
    let product = p * q * r * (p + q + r);
    if area > 0.0 && product > 0.0 {
        (16.0 * area * area / product).min(1.0)
    } else {
        0.0
    }
}

/// The key of an edge.
pub(crate) fn ascending(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
