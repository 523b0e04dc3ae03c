//! Which faces, edges and vertices meet, and which edges are an outline.

use crate::border::{Border, Large, Region};
use antumbra_scene::{Aabb, EdgeId, FaceId, Scene, VertexId};
use glam::DVec3;
use smallvec::SmallVec;
use std::borrow::Cow;

/// A face at an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaceAtEdge {
    pub(crate) face: FaceId,
    /// Unit vector in the face, perpendicular to the edge, from the edge into the face.
    pub(crate) inward: DVec3,
}

/// What meets where in a scene; made once.
#[derive(Clone, Debug)]
pub(crate) struct Adjacency {
    faces_at_edge: Vec<SmallVec<[FaceAtEdge; 2]>>,
    edges_at_vertex: Vec<SmallVec<[EdgeId; 4]>>,
    edges_of_face: Vec<Vec<EdgeId>>,
    large: Large,
}

impl Adjacency {
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut faces_at_edge = vec![SmallVec::new(); scene.edges.len()];
        let mut edges_at_vertex = vec![SmallVec::<[EdgeId; 4]>::new(); scene.vertices.len()];
        let mut edges_of_face = Vec::with_capacity(scene.faces.len());
        for id in scene.face_ids() {
            let face = scene.face(id);
            let mut edges = Vec::new();
            for corners in face.loops() {
                for i in 0..corners.len() {
                    let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                    let Some(edge) = scene.edge_between(a, b) else {
                        continue;
                    };
                    edges.push(edge);
                    if !face.is_back {
                        let along = scene.position(b) - scene.position(a);
                        // Counter-clockwise: the face is to the left of its edges.
                        let inward = face.normal.cross(along).normalize_or_zero();
                        faces_at_edge[edge.index()].push(FaceAtEdge { face: id, inward });
                    }
                }
            }
            edges.sort_unstable();
            edges.dedup();
            edges_of_face.push(edges);
        }
        for (k, edge) in scene.edges.iter().enumerate() {
            for v in edge.ends {
                edges_at_vertex[v.index()].push(EdgeId(k as u32));
            }
        }
        Self {
            faces_at_edge,
            edges_at_vertex,
            edges_of_face,
            large: Large::of(scene),
        }
    }

    pub(crate) fn faces_at(&self, edge: EdgeId) -> &[FaceAtEdge] {
        &self.faces_at_edge[edge.index()]
    }

    pub(crate) fn edges_at(&self, vertex: VertexId) -> &[EdgeId] {
        &self.edges_at_vertex[vertex.index()]
    }

    pub(crate) fn edges_of(&self, face: FaceId) -> &[EdgeId] {
        &self.edges_of_face[face.index()]
    }

    /// The edges of some pieces' faces, ascending; of faces with many edges and of fronts
    /// with many parts only those whose boxes may meet a query.
    ///
    /// * `pieces` — positions in [`Scene::pieces`].
    pub(crate) fn edges_near(
        &self,
        scene: &Scene,
        pieces: impl IntoIterator<Item = u32>,
        may_meet: impl Fn(&Aabb) -> bool,
    ) -> Vec<EdgeId> {
        let mut edges = Vec::new();
        for piece in pieces {
            self.large
                .faces_of(scene, piece, &may_meet, |face| match self.border(face) {
                    None => edges.extend(self.edges_of(face)),
                    Some(border) => edges.extend(
                        border
                            .near(&may_meet)
                            .into_iter()
                            .filter_map(|[a, b]| scene.edge_between(a, b)),
                    ),
                });
        }
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// The faces of some pieces, ascending; of fronts with many parts only those whose boxes
    /// may meet a query.
    pub(crate) fn faces_near(
        &self,
        scene: &Scene,
        pieces: impl IntoIterator<Item = u32>,
        may_meet: impl Fn(&Aabb) -> bool,
    ) -> Vec<FaceId> {
        let mut faces = Vec::new();
        for piece in pieces {
            self.large
                .faces_of(scene, piece, &may_meet, |face| faces.push(face));
        }
        faces.sort_unstable();
        faces.dedup();
        faces
    }

    /// The pieces of a face, as positions in [`Scene::pieces`], ascending; of many those
    /// whose boxes may meet a query.
    pub(crate) fn pieces_near(
        &self,
        scene: &Scene,
        face: FaceId,
        may_meet: impl Fn(&Aabb) -> bool,
    ) -> SmallVec<[u32; 8]> {
        self.large.pieces_of(scene, face, may_meet)
    }

    /// The border of a face, if it has many edges.
    pub(crate) fn border(&self, face: FaceId) -> Option<&Border> {
        self.large.border(face)
    }

    /// A face in its own chart.
    pub(crate) fn region(&self, scene: &Scene, face: FaceId) -> Cow<'_, Region> {
        match self.border(face) {
            Some(border) => Cow::Borrowed(border.region()),
            None => Cow::Owned(Region::of(scene, face)),
        }
    }

    /// Do all faces at an edge lie on one side of the plane through the edge with
    /// this unit normal? Then lines of the plane that touch the edge graze the
    /// outline. Faces in the plane itself are seen edge-on and have no say.
    pub(crate) fn is_outline(&self, edge: EdgeId, normal: DVec3) -> bool {
        let (mut above, mut below) = (false, false);
        for at in self.faces_at(edge) {
            let d = normal.dot(at.inward);
            above |= d > 1e-9;
            below |= d < -1e-9;
        }
        !(above && below)
    }
}
