//! Opaque convex polygons, and the faces that are seen where one is.
//!
//! A *screen* is what hides: a convex part of one plane. Which face is seen there is asked
//! afterwards, in its plane: a screen may be joined of pieces of many faces, a front that
//! was divided into covered and uncovered faces hides as one, and the faces of a two-sided
//! surface lie back to back.

use super::boxes::{Block, Blocks};
use super::merge::{Joined, join};
use antumbra_scene::{Aabb, BoxTree, FaceId, PlaneId, Scene, VertexId};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// All screens of a scene.
#[derive(Debug)]
pub(crate) struct Screens {
    list: Vec<Screen>,
    /// Their boxes.
    pub(super) blocks: Vec<Block>,
    corners: Vec<DVec3>,
    shares: Vec<Share>,
    trees: Vec<Blocks>,
    pub(super) tree: BoxTree,
    /// The same tree.
    pub(super) hierarchy: Blocks,
}

/// An opaque convex polygon.
#[derive(Clone, Debug)]
pub(super) struct Screen {
    /// Unit normal; corners run counter-clockwise about it.
    pub(super) normal: DVec3,
    pub(super) plane: PlaneId,
    corners: Range<u32>,
    /// What is seen from the side of the normal, and from the other.
    sides: [Sharing; 2],
}

/// What is seen on one side of a screen.
#[derive(Clone, Debug)]
struct Sharing {
    shares: Range<u32>,
    /// Where to look for them, if they are many.
    tree: Option<u32>,
}

/// So many shares are all tried.
const FEW_SHARES: usize = 8;

/// A convex piece of a face that is seen on one side of a screen.
#[derive(Clone, Debug)]
pub(super) struct Share {
    pub(super) face: FaceId,
    pub(super) shows_front: bool,
    corners: Range<u32>,
    /// Do its corners run clockwise about the normal of the screen?
    pub(super) is_turned: bool,
}

impl Share {
    /// The share as one of a screen that faces the same or the other way.
    fn turned(&self, is_turned: bool) -> Self {
        Self {
            is_turned: self.is_turned != is_turned,
            ..self.clone()
        }
    }
}

impl Screens {
    /// The screens of a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut screens = Self {
            list: Vec::new(),
            blocks: Vec::new(),
            corners: Vec::new(),
            shares: Vec::new(),
            trees: Vec::new(),
            tree: BoxTree::default(),
            hierarchy: Blocks::default(),
        };
        let mut by_side: BTreeMap<(PlaneId, bool), Vec<u32>> = BTreeMap::new();
        for (i, piece) in (0..).zip(&scene.pieces) {
            let face = scene.face(piece.face);
            if piece.hides {
                let pieces = by_side.entry((face.plane, face.along_plane));
                pieces.or_default().push(i);
            }
        }
        for joined in by_side.values().flat_map(|pieces| join(scene, pieces)) {
            screens.add(scene, &joined);
        }
        let boxes = |i: u32| Aabb::of(screens.corners(i).iter().copied());
        let boxes: Vec<(u32, Aabb)> = (0..screens.list.len() as u32)
            .map(|i| (i, boxes(i)))
            .collect();
        screens.blocks = boxes.iter().map(|(_, b)| Block::of(b)).collect();
        screens.tree = BoxTree::new(&boxes);
        screens.hierarchy = Blocks::of(&screens.tree);
        screens.share_overlaps(scene, &boxes);
        screens.plant_trees();
        screens
    }

    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// A bound of the distance of all that there is from a point; scene units.
    pub(super) fn farthest_from(&self, point: DVec3) -> f64 {
        let Some(root) = self.tree.root() else {
            return 0.0;
        };
        let bounds = self.tree.bounds(root);
        let away = (bounds.max - point).abs().max((bounds.min - point).abs());
        away.length()
    }

    pub(super) fn get(&self, screen: u32) -> &Screen {
        &self.list[screen as usize]
    }

    /// Corners of a screen, counter-clockwise about its normal; scene units.
    pub(super) fn corners(&self, screen: u32) -> &[DVec3] {
        let range = &self.get(screen).corners;
        &self.corners[range.start as usize..range.end as usize]
    }

    /// What is seen on one side of a screen, in the order in which it is dealt out: what is
    /// nowhere else is of the last.
    pub(super) fn shares(&self, screen: u32, from_front: bool) -> &[Share] {
        let range = &self.get(screen).sides[usize::from(!from_front)].shares;
        &self.shares[range.start as usize..range.end as usize]
    }

    /// The boxes of these shares, by their places among them, if they are many.
    pub(super) fn tree_of_shares(&self, screen: u32, from_front: bool) -> Option<&Blocks> {
        let tree = self.get(screen).sides[usize::from(!from_front)].tree?;
        Some(&self.trees[tree as usize])
    }

    /// Corners of a share; scene units.
    pub(super) fn share_corners(&self, share: &Share) -> &[DVec3] {
        &self.corners[share.corners.start as usize..share.corners.end as usize]
    }

    fn add(&mut self, scene: &Scene, joined: &Joined) {
        let face = scene.face(scene.pieces[joined.pieces[0] as usize].face);
        let corners = self.push_corners(joined.corners.iter().copied());
        let front = self.push_fronts(scene, &joined.pieces, true);
        let back = self.push_backs(scene, &joined.pieces);
        self.list.push(Screen {
            normal: face.normal,
            plane: face.plane,
            corners,
            sides: [front, back].map(|shares| Sharing { shares, tree: None }),
        });
    }

    fn push_corners(&mut self, corners: impl IntoIterator<Item = DVec3>) -> Range<u32> {
        let start = self.corners.len() as u32;
        self.corners.extend(corners);
        start..self.corners.len() as u32
    }

    fn push_share(
        &mut self,
        scene: &Scene,
        face: FaceId,
        piece: u32,
        (shows_front, is_turned): (bool, bool),
    ) {
        let corners = self.push_corners(scene.positions(&scene.pieces[piece as usize].vertices));
        self.shares.push(Share {
            face,
            shows_front,
            corners,
            is_turned,
        });
    }

    /// The faces of some pieces, as seen from their front or from behind.
    fn push_fronts(&mut self, scene: &Scene, pieces: &[u32], shows_front: bool) -> Range<u32> {
        let start = self.shares.len();
        for &piece in pieces {
            if scene.pieces[piece as usize].n_faces == 1 {
                let face = scene.pieces[piece as usize].face;
                self.push_share(scene, face, piece, (shows_front, false));
            } else {
                for face in scene.faces_of(piece) {
                    for part in own_pieces(scene, face) {
                        self.push_share(scene, face, part, (shows_front, false));
                    }
                }
            }
        }
        self.end_shares(start)
    }

    /// What is seen of some pieces from behind: the backs of two-sided surfaces, else that
    /// they have none.
    fn push_backs(&mut self, scene: &Scene, pieces: &[u32]) -> Range<u32> {
        let start = self.shares.len();
        let mut backs: BTreeSet<(FaceId, u32)> = BTreeSet::new();
        let mut one_sided: Vec<u32> = Vec::new();
        for &piece in pieces {
            let found = backs_of(scene, piece);
            if found.is_empty() {
                one_sided.push(piece);
            }
            backs.extend(found);
        }
        for (face, piece) in backs {
            self.push_share(scene, face, piece, (true, true));
        }
        self.push_fronts(scene, &one_sided, false);
        self.end_shares(start)
    }

    /// The shares from `start` on; a single one if all are of one face.
    fn end_shares(&mut self, start: usize) -> Range<u32> {
        let key = |share: &Share| (share.face, share.shows_front);
        let shares = &self.shares[start..];
        if shares.windows(2).all(|pair| key(&pair[0]) == key(&pair[1])) {
            self.shares.truncate(start + 1);
        }
        start as u32..self.shares.len() as u32
    }

    /// Trees for the sides on which many faces are seen.
    fn plant_trees(&mut self) {
        for screen in 0..self.list.len() {
            for side in 0..2 {
                let range = self.list[screen].sides[side].shares.clone();
                if range.len() <= FEW_SHARES {
                    continue;
                }
                let shares = &self.shares[range.start as usize..range.end as usize];
                let bounds = |share| Aabb::of(self.share_corners(share).iter().copied());
                let boxes: Vec<(u32, Aabb)> = (0..).zip(shares.iter().map(bounds)).collect();
                self.list[screen].sides[side].tree = Some(self.trees.len() as u32);
                self.trees.push(Blocks::of(&BoxTree::new(&boxes)));
            }
        }
    }
}

/// Pieces of faces at the back of a piece, if its surface is two-sided.
fn backs_of(scene: &Scene, piece: u32) -> Vec<(FaceId, u32)> {
    let piece = &scene.pieces[piece as usize];
    let bounds = |vertices: &[VertexId]| Aabb::of(scene.positions(vertices));
    let (front, around) = (scene.face(piece.face), bounds(&piece.vertices));
    let faces = scene.surfaces[front.surface.index()].faces.clone();
    faces
        .map(FaceId)
        .filter(|&face| scene.face(face).is_back && scene.face(face).plane == front.plane)
        .flat_map(|face| own_pieces(scene, face).map(move |part| (face, part)))
        .filter(|&(_, part)| bounds(&scene.pieces[part as usize].vertices).meets(&around))
        .collect()
}

/// Coplanar screens that overlap hide as if each were alone; what is seen there is that
/// which shows its front, emitters first.
impl Screens {
    fn share_overlaps(&mut self, scene: &Scene, boxes: &[(u32, Aabb)]) {
        let found: Vec<(u32, Vec<u32>)> = boxes
            .iter()
            .map(|(screen, bounds)| (*screen, self.overlapping(scene, *screen, bounds)))
            .filter(|(_, others)| !others.is_empty())
            .collect();
        let sides: Vec<(u32, [Vec<Share>; 2])> = found
            .iter()
            .map(|(screen, others)| {
                let side = |front| self.shared_side(scene, *screen, others, front);
                (*screen, [side(true), side(false)])
            })
            .collect();
        for (screen, sides) in sides {
            self.list[screen as usize].sides = sides.map(|shares| {
                let start = self.shares.len() as u32;
                self.shares.extend(shares);
                let shares = start..self.shares.len() as u32;
                Sharing { shares, tree: None }
            });
        }
    }

    /// Screens of the same plane that have an area in common with this one, ascending.
    fn overlapping(&self, scene: &Scene, screen: u32, bounds: &Aabb) -> Vec<u32> {
        let plane = self.get(screen).plane;
        let mut others = Vec::new();
        self.tree.visit(
            |b| b.meets(bounds),
            |other| {
                let is_in_plane = other != screen && self.get(other).plane == plane;
                if is_in_plane && self.overlap(screen, other, scene.plane_tolerance()) {
                    others.push(other);
                }
            },
        );
        others.sort_unstable();
        others
    }

    /// Do two convex polygons of one plane have an area in common, wider than a tolerance?
    fn overlap(&self, a: u32, b: u32, tolerance: f64) -> bool {
        let is_apart = |a: u32, b: u32| {
            let (normal, corners) = (self.get(a).normal, self.corners(a));
            (0..corners.len()).any(|i| {
                let (p, q) = (corners[i], corners[(i + 1) % corners.len()]);
                let inwards = normal.cross(q - p);
                let least = tolerance * inwards.length();
                let others = self.corners(b).iter();
                others.into_iter().all(|&x| inwards.dot(x - p) <= least)
            })
        };
        !is_apart(a, b) && !is_apart(b, a)
    }

    /// What is seen on one side of a screen, of itself and of others in its plane.
    fn shared_side(&self, scene: &Scene, screen: u32, others: &[u32], front: bool) -> Vec<Share> {
        let normal = self.get(screen).normal;
        let own = self.shares(screen, front).iter();
        let mut shares: Vec<(bool, Share)> = own.map(|share| (true, share.clone())).collect();
        for &other in others {
            let is_turned = normal.dot(self.get(other).normal) < 0.0;
            let theirs = self.shares(other, front != is_turned).iter();
            shares.extend(theirs.map(|share| (false, share.turned(is_turned))));
        }
        let rank = |share: &Share| {
            let is_black = !share.shows_front || scene.face(share.face).is_covered;
            let is_dark = is_black || !scene.material(share.face).is_emitter();
            (is_black, is_dark, share.face)
        };
        shares.sort_by_key(|(_, share)| rank(share));
        // Its own fill it, so nothing is left for what comes after them.
        let last = shares.iter().rposition(|(is_own, _)| *is_own);
        shares.truncate(last.expect("a screen is of a face") + 1);
        shares.into_iter().map(|(_, share)| share).collect()
    }
}

/// The pieces that a face is made of, and not those of the front it was divided from.
fn own_pieces(scene: &Scene, face: FaceId) -> impl Iterator<Item = u32> + '_ {
    let range = scene.face(face).pieces.clone();
    range.filter(|&i| scene.pieces[i as usize].n_faces == 1)
}
