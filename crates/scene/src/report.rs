//! What can be said of a scene's geometry at a glance: counts, gaps, units.

use crate::bvh::{Aabb, BoxTree};
use crate::scene::{Scene, SurfaceId, VertexId};
use glam::DVec3;
use std::collections::BTreeMap;

/// Counts and sizes of a scene, for the report of a check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometryReport {
    /// Surfaces in the file, those without an area included.
    pub surfaces: usize,
    /// Front faces.
    pub faces: usize,
    /// Welded vertices.
    pub vertices: usize,
    /// Edges between welded vertices.
    pub edges: usize,
    /// Plane classes.
    pub planes: usize,
    /// Surfaces that emit.
    pub emitters: usize,
    /// Edges that only one face has.
    pub open_edges: usize,
    /// Vertices that lie inside an edge of some face, within the plane tolerance.
    pub t_vertices: usize,
    /// Do the faces bound a volume? Every edge, cut where vertices lie inside it,
    /// is run through as often one way as the other.
    pub closed: bool,
    /// Extents along the axes, file units.
    pub extent: DVec3,
    /// Extents along the axes, metres.
    pub extent_metres: DVec3,
    /// Sum of the areas of the fronts, square file units.
    pub area: f64,
    /// Sum of the areas of the fronts, square metres.
    pub area_square_metres: f64,
}

impl Scene {
    /// The geometry of the scene in numbers.
    #[must_use]
    pub fn report(&self) -> GeometryReport {
        let on_edges = self.vertices_on_edges();
        let mut t_vertices: Vec<VertexId> = on_edges.iter().flatten().copied().collect();
        t_vertices.sort_unstable();
        t_vertices.dedup();
        let fronts = || self.faces.iter().filter(|face| !face.is_back);
        let emits = |s: &crate::Surface| {
            !s.faces.is_empty() && self.materials[s.material.index()].is_emitter()
        };
        let bounds = self.bounds();
        let extent = (bounds.max - bounds.min) / self.frame.scale;
        let area = self
            .frame
            .area_to_file(fronts().map(|face| face.area).sum());
        let metre = self.length_unit.in_metres();
        GeometryReport {
            surfaces: self.surfaces.len(),
            faces: fronts().count(),
            vertices: self.vertices.len(),
            edges: self.edges.len(),
            planes: self.planes.len(),
            emitters: self.surfaces.iter().filter(|s| emits(s)).count(),
            open_edges: self.edges.iter().filter(|e| e.faces.len() == 1).count(),
            t_vertices: t_vertices.len(),
            closed: self.is_closed(&on_edges),
            extent,
            extent_metres: extent * metre,
            area,
            area_square_metres: area * metre * metre,
        }
    }

    /// The area of the fronts of a surface, square file units.
    #[must_use]
    pub fn surface_area(&self, surface: SurfaceId) -> f64 {
        let faces = self.surfaces[surface.index()].faces.clone();
        let faces = &self.faces[faces.start as usize..faces.end as usize];
        self.frame
            .area_to_file(faces.iter().filter(|f| !f.is_back).map(|f| f.area).sum())
    }

    /// For each edge the vertices inside it, from its first end to its second.
    fn vertices_on_edges(&self) -> Vec<Vec<VertexId>> {
        let tolerance = self.plane_tolerance();
        let boxes: Vec<(u32, Aabb)> = (0..)
            .zip(&self.vertices)
            .map(|(v, &p)| (v, Aabb { min: p, max: p }))
            .collect();
        let tree = BoxTree::new(&boxes);
        let on = self.edges.iter().map(|edge| {
            let [a, b] = edge.ends.map(|e| self.position(e));
            let along = b - a;
            let mut on: Vec<(f64, VertexId)> = Vec::new();
            tree.visit(
                // Wider than the tolerance, which the walk's rounding stays below.
                |node| node.meets_segment(a, b, 2.0 * tolerance),
                |v| {
                    let p = self.vertices[v as usize];
                    let v = VertexId(v);
                    let t = (p - a).dot(along) / along.length_squared();
                    let is_on = (0.0..=1.0).contains(&t) && p.distance(a + t * along) <= tolerance;
                    if is_on && !edge.ends.contains(&v) {
                        on.push((t, v));
                    }
                },
            );
            on.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            on.into_iter().map(|(_, v)| v).collect()
        });
        on.collect()
    }

    fn is_closed(&self, on_edges: &[Vec<VertexId>]) -> bool {
        let mut net: BTreeMap<[VertexId; 2], i64> = BTreeMap::new();
        for face in self.faces.iter().filter(|face| !face.is_back) {
            for corners in face.loops() {
                for (i, &a) in corners.iter().enumerate() {
                    let b = corners[(i + 1) % corners.len()];
                    let Some(edge) = self.edge_between(a, b) else {
                        continue;
                    };
                    let [first, last] = self.edges[edge.index()].ends;
                    let way = if a == first { 1 } else { -1 };
                    let mut from = first;
                    let inside = on_edges[edge.index()].iter().copied();
                    for to in inside.chain(std::iter::once(last)) {
                        let key = [from.min(to), from.max(to)];
                        *net.entry(key).or_default() += if from < to { way } else { -way };
                        from = to;
                    }
                }
            }
        }
        !net.is_empty() && net.values().all(|&n| n == 0)
    }
}
