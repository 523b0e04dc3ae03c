//! What can be said of a scene's geometry at a glance: counts, gaps, units.

use crate::bvh::{Aabb, BoxTree};
use crate::scene::{Face, Scene, Surface, SurfaceId, VertexId};
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
    /// Sum of the uncovered areas of the fronts, square file units.
    pub area: f64,
    /// The same in square metres.
    pub area_square_metres: f64,
    /// Sum of the areas of the fronts, covered or not, square file units.
    pub geometric_area: f64,
    /// What bodies that stand on one another cover of it, square file units.
    pub covered_area: f64,
}

/// How much of one side of a surface is covered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoveredArea {
    /// The surface.
    pub surface: SurfaceId,
    /// Is it its back?
    pub is_back: bool,
    /// The area of the side, square file units.
    pub geometric_area: f64,
    /// What of it receives and sends nothing, square file units.
    pub covered_area: f64,
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
        let sum = |is_wanted: &dyn Fn(&Face) -> bool| {
            let areas = fronts()
                .filter(|face| is_wanted(face))
                .map(|face| face.area);
            self.frame.area_to_file(areas.sum())
        };
        let area = sum(&|face| !face.is_covered);
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
            geometric_area: sum(&|_| true),
            covered_area: sum(&|face| face.is_covered),
        }
    }

    /// The sides of which something is covered, fronts before backs, in the order of the
    /// surfaces.
    #[must_use]
    pub fn covered_areas(&self) -> Vec<CoveredArea> {
        let of_side = |(i, surface): (usize, &Surface), is_back: bool| {
            let faces = &self.faces[surface.faces.start as usize..surface.faces.end as usize];
            let sum = |faces: &mut dyn Iterator<Item = &Face>| {
                self.frame.area_to_file(faces.map(|f| f.area).sum())
            };
            let side = || faces.iter().filter(move |f| f.is_back == is_back);
            CoveredArea {
                surface: SurfaceId(i as u32),
                is_back,
                geometric_area: sum(&mut side()),
                covered_area: sum(&mut side().filter(|f| f.is_covered)),
            }
        };
        let surfaces = self.surfaces.iter().enumerate();
        surfaces
            .flat_map(|surface| [false, true].map(|is_back| of_side(surface, is_back)))
            .filter(|side| side.covered_area > 0.0)
            .collect()
    }

    /// The area of the fronts of a surface, covered or not, square file units.
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
