//! What may take part in an event between one receiver and one emitter.

use crate::adjacency::Adjacency;
use crate::border::Region;
use crate::evaluator::hull::Hull;
use antumbra_scene::{Aabb, EdgeId, Face, FaceId, Scene, VertexId};
use glam::{DVec3, DVec4};
use smallvec::SmallVec;
use std::borrow::Cow;
use std::cell::LazyCell;

/// The features between a receiver and an emitter.
pub(crate) struct Shaft<'s> {
    pub(crate) emitter: FaceId,
    pub(crate) lamp: &'s Face,
    /// Form of the emitter's plane, positive on its front.
    pub(crate) lamp_form: DVec4,
    pub(crate) lamp_region: Cow<'s, Region>,
    /// A convex outline in the emitter's plane that holds it.
    pub(crate) lamp_hull: Vec<DVec3>,
    /// A convex outline in the receiver's plane that holds it.
    pub(crate) receiver_hull: Vec<DVec3>,
    pub(crate) lamp_vertices: Vec<VertexId>,
    pub(crate) lamp_edges: Vec<EdgeId>,
    /// Positions in `Scene::pieces`, ascending.
    pub(crate) pieces: Vec<u32>,
    pub(crate) faces: Vec<FaceId>,
    /// Edges that may be outlines for a line from receiver to emitter, ascending.
    pub(crate) edges: Vec<EdgeId>,
    /// Their ends, ascending.
    pub(crate) vertices: Vec<VertexId>,
}

/// The form of the plane through a point with this unit normal.
pub(crate) fn form(normal: DVec3, point: DVec3) -> DVec4 {
    normal.extend(-normal.dot(point))
}

/// A convex outline in a face's plane that holds the face, counter-clockwise seen
/// from its front: its own outline if that is convex, else a rectangle.
pub(crate) fn convex_hull(scene: &Scene, id: FaceId) -> Vec<DVec3> {
    let face = scene.face(id);
    if face.pieces.len() == 1 && face.holes.is_empty() {
        return scene.positions(&face.outline);
    }
    let chart = scene.chart(id);
    let loops = scene.loops_in_chart(id, &chart);
    let (min, max) = loops[0].iter().fold(
        (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY),
        |(min, max), &p| (min.min(p), max.max(p)),
    );
    [
        min,
        glam::dvec2(max.x, min.y),
        max,
        glam::dvec2(min.x, max.y),
    ]
    .map(|p| chart.to_space(p))
    .to_vec()
}

impl<'s> Shaft<'s> {
    /// * `pieces` — what stands between receiver and emitter, ascending.
    pub(crate) fn new(
        scene: &'s Scene,
        adjacency: &'s Adjacency,
        receiver: FaceId,
        emitter: FaceId,
        pieces: Vec<u32>,
    ) -> Self {
        let lamp = scene.face(emitter);
        let (lamp_hull, receiver_hull) =
            (convex_hull(scene, emitter), convex_hull(scene, receiver));
        let hull = LazyCell::new(|| {
            Hull::of_outlines(&receiver_hull, &lamp_hull, scene.plane_tolerance())
        });
        let may_meet = |b: &Aabb| hull.meets_box(b);
        let faces = adjacency.faces_near(scene, pieces.iter().copied(), may_meet);
        let mut edges = adjacency.edges_near(scene, pieces.iter().copied(), may_meet);
        let mut lamp_vertices: Vec<VertexId> = lamp.loops().flatten().copied().collect();
        lamp_vertices.sort_unstable();
        lamp_vertices.dedup();
        let mut shaft = Self {
            emitter,
            lamp,
            lamp_form: form(lamp.normal, scene.position(lamp.outline[0])),
            lamp_region: adjacency.region(scene, emitter),
            lamp_hull,
            receiver_hull,
            lamp_vertices,
            lamp_edges: adjacency.edges_of(emitter).to_vec(),
            pieces,
            faces,
            edges: Vec::new(),
            vertices: Vec::new(),
        };
        edges.retain(|&e| shaft.may_be_outline(scene, adjacency, e));
        shaft.vertices = edges
            .iter()
            .flat_map(|e| scene.edges[e.index()].ends)
            .collect();
        shaft.vertices.sort_unstable();
        shaft.vertices.dedup();
        shaft.edges = edges;
        shaft
    }

    /// Height over the emitter's front.
    pub(crate) fn lamp_height(&self, x: DVec3) -> f64 {
        self.lamp_form.dot(x.extend(1.0))
    }

    /// Can any line from the receiver to the emitter graze this edge? Not if two of
    /// its faces lie on different sides of every such line.
    fn may_be_outline(&self, scene: &Scene, adjacency: &Adjacency, edge: EdgeId) -> bool {
        let tolerance = scene.plane_tolerance();
        let p = scene.position(scene.edges[edge.index()].ends[0]);
        let (mut above, mut below) = (false, false);
        for c in turns(scene, adjacency, edge) {
            let range = |outline: &[DVec3]| {
                outline
                    .iter()
                    .map(|&x| c.dot(x - p))
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), h| {
                        (lo.min(h), hi.max(h))
                    })
            };
            let (lamp, receiver) = (range(&self.lamp_hull), range(&self.receiver_hull));
            above |= lamp.0 > tolerance || receiver.1 < -tolerance;
            below |= lamp.1 < -tolerance || receiver.0 > tolerance;
        }
        !(above && below)
    }
}

/// For every face at an edge a unit vector c: a line of direction d that touches the
/// edge has the face on the side of the sign of c·d.
pub(crate) fn turns(scene: &Scene, adjacency: &Adjacency, edge: EdgeId) -> SmallVec<[DVec3; 2]> {
    let [a, b] = scene.edges[edge.index()].ends.map(|v| scene.position(v));
    let along = (b - a).normalize_or_zero();
    adjacency
        .faces_at(edge)
        .iter()
        .map(|at| at.inward.cross(along))
        .collect()
}
