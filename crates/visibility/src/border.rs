//! Parts of large faces by where they are: border edges, and the faces that a front was
//! divided into.
//!
//! A floor on which thousands of things stand has an edge for each of their sides. Every
//! one of these sides asks for what of the floor is near it; so what is many stands in a
//! box tree. What is few is looked through, and found whether it is near or not.

use antumbra_geom::{Chart, is_left_of};
use antumbra_scene::{Aabb, BoxTree, FaceId, Scene, VertexId};
use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use std::collections::BTreeMap;

/// More than this are looked up in a box tree: 24 plane tests cost about what the walk down
/// a tree does (see the evaluator's `LONGEST_LIST`), and a test of an edge is less.
const MANY: usize = 32;

/// The border of a face with many edges.
#[derive(Clone, Debug)]
pub(crate) struct Border {
    /// Ends of all edges, in the order of the loops.
    ends: Vec<[VertexId; 2]>,
    tree: BoxTree,
    region: Region,
}

impl Border {
    fn of(scene: &Scene, face: FaceId) -> Self {
        let ends: Vec<[VertexId; 2]> = ends(scene, face).collect();
        let boxes = ends.iter().map(|e| Aabb::of(e.map(|v| scene.position(v))));
        let boxes: Vec<(u32, Aabb)> = (0..).zip(boxes).collect();
        Self {
            ends,
            tree: BoxTree::new(&boxes),
            region: Region::of(scene, face),
        }
    }

    /// The edges that a query may meet, in the order of the loops.
    pub(crate) fn near(&self, may_meet: impl Fn(&Aabb) -> bool) -> SmallVec<[[VertexId; 2]; 16]> {
        let mut found: SmallVec<[u32; 32]> = SmallVec::new();
        self.tree.visit(may_meet, |k| found.push(k));
        found.sort_unstable();
        found.into_iter().map(|k| self.ends[k as usize]).collect()
    }

    /// The face in its own chart.
    pub(crate) fn region(&self) -> &Region {
        &self.region
    }
}

/// The ends of a face's edges, loop by loop.
pub(crate) fn ends(scene: &Scene, face: FaceId) -> impl Iterator<Item = [VertexId; 2]> {
    let edges = |corners| {
        let corners: &[VertexId] = corners;
        (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]])
    };
    scene.face(face).loops().flat_map(edges)
}

/// A face in its own chart.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    chart: Chart,
    edges: Vec<[DVec2; 2]>,
    /// Of many edges: their boxes.
    tree: Option<BoxTree>,
}

impl Region {
    pub(crate) fn of(scene: &Scene, face: FaceId) -> Self {
        let chart = scene.chart(face);
        let flat = |v: VertexId| chart.to_chart(scene.position(v));
        let edges: Vec<[DVec2; 2]> = ends(scene, face).map(|e| e.map(flat)).collect();
        let tree = (edges.len() > MANY).then(|| {
            let boxes = edges.iter().map(|e| Aabb::of(e.map(|p| p.extend(0.0))));
            BoxTree::new(&(0..).zip(boxes).collect::<Vec<_>>())
        });
        Self { chart, edges, tree }
    }

    /// Is a point of the face's plane inside of the face?
    pub(crate) fn contains(&self, x: DVec3) -> bool {
        let p = self.chart.to_chart(x);
        let mut inside = false;
        let mut pass = |edge: &[DVec2; 2]| inside ^= is_left_of(p, *edge);
        match &self.tree {
            None => self.edges.iter().for_each(pass),
            Some(tree) => tree.visit(
                |b| b.min.y <= p.y && b.max.y >= p.y && b.max.x >= p.x,
                |k| pass(&self.edges[k as usize]),
            ),
        }
        inside
    }
}

/// What of a scene is looked up: borders of many edges, fronts of many parts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Large {
    borders: BTreeMap<FaceId, Border>,
    /// The parts of a divided front by the first of them.
    parts: BTreeMap<FaceId, BoxTree>,
    /// Positions in [`Scene::pieces`] of a face of many.
    pieces: BTreeMap<FaceId, BoxTree>,
}

impl Large {
    pub(crate) fn of(scene: &Scene) -> Self {
        let is_long = |&f: &FaceId| ends(scene, f).nth(MANY).is_some();
        let borders = scene.face_ids().filter(is_long);
        let divided = scene.pieces.iter().filter(|p| p.n_faces as usize > MANY);
        let mut parts = BTreeMap::new();
        for piece in divided {
            parts.entry(piece.face).or_insert_with(|| {
                let boxes = (piece.face.0..piece.face.0 + piece.n_faces).map(|f| {
                    let outline = scene.positions(&scene.face(FaceId(f)).outline);
                    (f, Aabb::of(outline))
                });
                BoxTree::new(&boxes.collect::<Vec<_>>())
            });
        }
        let is_many = |&f: &FaceId| scene.face(f).pieces.len() > MANY;
        let pieces = scene.face_ids().filter(is_many).map(|f| {
            let boxes = scene.face(f).pieces.clone().map(|k| {
                let corners = scene.positions(&scene.pieces[k as usize].vertices);
                (k, Aabb::of(corners))
            });
            (f, BoxTree::new(&boxes.collect::<Vec<_>>()))
        });
        Self {
            borders: borders.map(|f| (f, Border::of(scene, f))).collect(),
            parts,
            pieces: pieces.collect(),
        }
    }

    /// The pieces of a face, as positions in [`Scene::pieces`], ascending; of many those that
    /// a query may meet.
    pub(crate) fn pieces_of(
        &self,
        scene: &Scene,
        face: FaceId,
        may_meet: impl Fn(&Aabb) -> bool,
    ) -> SmallVec<[u32; 8]> {
        let Some(tree) = self.pieces.get(&face) else {
            return scene.face(face).pieces.clone().collect();
        };
        let mut found = SmallVec::new();
        tree.visit(may_meet, |k| found.push(k));
        found.sort_unstable();
        found
    }

    /// The border of a face with many edges.
    pub(crate) fn border(&self, face: FaceId) -> Option<&Border> {
        self.borders.get(&face)
    }

    /// Calls `found` with the faces that a piece is of; of many, with those that a query
    /// may meet.
    pub(crate) fn faces_of(
        &self,
        scene: &Scene,
        piece: u32,
        may_meet: impl Fn(&Aabb) -> bool,
        mut found: impl FnMut(FaceId),
    ) {
        match self.parts.get(&scene.pieces[piece as usize].face) {
            Some(parts) if scene.pieces[piece as usize].n_faces as usize > MANY => {
                parts.visit(may_meet, |f| found(FaceId(f)));
            }
            _ => scene.faces_of(piece).for_each(found),
        }
    }
}
