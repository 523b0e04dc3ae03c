//! What may hide: corners in flat storage, and which of all have to be looked at.

use crate::evaluator::sight::Sight;
use crate::fragments::HalfSpace;
use antumbra_scene::{Aabb, PlaneId, Scene};
use glam::DVec3;
use smallvec::SmallVec;

/// Lists longer than this are replaced by a query of the box tree at every point.
///
/// 24 plane tests of a list cost about what the walk down a tree of a thousand
/// boxes costs (see the benchmark `exact_evaluation`).
const LONGEST_LIST: usize = 24;

/// The same for lists from [`crate::Evaluator::narrow`] for a small part of a face: most of
/// their occluders matter.
pub const LONGEST_NARROWED_LIST: usize = 64;

/// A convex occluder: the range of its corners, and its plane.
#[derive(Clone, Copy, Debug)]
struct Occluder {
    start: u32,
    len: u32,
    normal: DVec3,
    plane: PlaneId,
}

/// All convex pieces of a scene, by their positions in [`Scene::pieces`].
#[derive(Debug)]
pub(super) struct Occluders {
    pieces: Vec<Occluder>,
    corners: Vec<DVec3>,
}

impl Occluders {
    pub(super) fn new(scene: &Scene) -> Self {
        let mut corners = Vec::new();
        let pieces = scene.pieces.iter().map(|piece| {
            let face = scene.face(piece.face);
            let start = corners.len() as u32;
            corners.extend(scene.positions(&piece.vertices));
            Occluder {
                start,
                len: piece.vertices.len() as u32,
                normal: face.normal,
                plane: face.plane,
            }
        });
        let pieces = pieces.collect();
        Self { pieces, corners }
    }

    /// The plane class of a piece.
    pub(super) fn plane(&self, piece: u32) -> PlaneId {
        self.pieces[piece as usize].plane
    }

    /// The unit normal of a piece.
    pub(super) fn normal(&self, piece: u32) -> DVec3 {
        self.pieces[piece as usize].normal
    }

    /// The corners of a piece, scene units.
    pub(super) fn corners(&self, piece: u32) -> &[DVec3] {
        let o = &self.pieces[piece as usize];
        &self.corners[o.start as usize..(o.start + o.len) as usize]
    }
}

/// Which occluders an evaluation has to look at.
#[derive(Clone, Debug)]
pub(super) enum Candidates {
    /// Few: this list, by the shaft between receiver and emitter.
    List(Vec<u32>),
    /// Many: asked of the box tree for every point.
    Tree,
}

impl Candidates {
    /// The list, if it is short.
    pub(super) fn of(list: Vec<u32>) -> Self {
        if list.len() > LONGEST_LIST {
            Self::Tree
        } else {
            Self::List(list)
        }
    }

    /// The list; `None` asks the box tree.
    pub(super) fn list(&self) -> Option<&[u32]> {
        match self {
            Self::List(list) => Some(list),
            Self::Tree => None,
        }
    }
}

/// Candidates of one point: pieces whose box meets the pyramid from the point
/// to the source, above the horizon and in front of the source.
pub(super) fn query(scene: &Scene, sight: &Sight<'_>, found: &mut Vec<u32>) {
    let place = &sight.place;
    let slack = place.radius() + scene.plane_tolerance();
    let around = Aabb::of(sight.corners.iter().copied().chain([place.point]));
    let around = Aabb {
        min: around.min - slack,
        max: around.max + slack,
    };
    let inwards = |normal: DVec3, through: DVec3| HalfSpace {
        normal,
        offset: normal.dot(through),
        tolerance: slack,
    };
    let mut walls: SmallVec<[HalfSpace; 12]> = SmallVec::new();
    walls.push(inwards(place.normal, place.point));
    walls.push(inwards(sight.normal, sight.corners[0]));
    walls.extend(sight.edges().filter_map(|(a, b)| {
        // The corners run counter-clockwise as seen from the point.
        let normal = (b - place.point).cross(a - place.point).try_normalize()?;
        Some(inwards(normal, place.point))
    }));
    found.clear();
    scene.tree.visit(
        |b| b.meets(&around) && walls.iter().all(|wall| wall.may_meet(b)),
        |piece| found.push(piece),
    );
    found.sort_unstable();
}
