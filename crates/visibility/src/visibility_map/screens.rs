//! Opaque convex polygons, and the faces that are seen where one is.
//!
//! A *screen* is what hides: a convex part of one plane. Which face is seen there is asked
//! afterwards, in its plane: a screen may be joined of pieces of many faces, a front that
//! was divided into covered and uncovered faces hides as one, and the faces of a two-sided
//! surface lie back to back.

use antumbra_scene::{Aabb, BoxTree, FaceId, PlaneId, Scene};
use glam::DVec3;
use std::ops::Range;

/// All screens of a scene.
#[derive(Debug)]
pub(crate) struct Screens {
    list: Vec<Screen>,
    corners: Vec<DVec3>,
    shares: Vec<Share>,
    pub(super) tree: BoxTree,
}

/// An opaque convex polygon.
#[derive(Clone, Debug)]
pub(super) struct Screen {
    /// Unit normal; corners run counter-clockwise about it.
    pub(super) normal: DVec3,
    pub(super) plane: PlaneId,
    pub(super) bounds: Aabb,
    corners: Range<u32>,
    /// What is seen from the side of the normal, and from the other.
    sides: [Range<u32>; 2],
}

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
            corners: Vec::new(),
            shares: Vec::new(),
            tree: BoxTree::default(),
        };
        let hiding = (0..scene.pieces.len() as u32).filter(|&i| scene.pieces[i as usize].hides);
        for piece in hiding {
            screens.add(scene, piece);
        }
        let boxes: Vec<(u32, Aabb)> = (0..).zip(screens.list.iter().map(|s| s.bounds)).collect();
        screens.tree = BoxTree::new(&boxes);
        screens.share_overlaps(scene);
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
        let range = &self.get(screen).sides[usize::from(!from_front)];
        &self.shares[range.start as usize..range.end as usize]
    }

    /// Corners of a share; scene units.
    pub(super) fn share_corners(&self, share: &Share) -> &[DVec3] {
        &self.corners[share.corners.start as usize..share.corners.end as usize]
    }

    fn add(&mut self, scene: &Scene, piece: u32) {
        let of = &scene.pieces[piece as usize];
        let face = scene.face(of.face);
        let corners = self.push_corners(scene.positions(&of.vertices));
        let bounds = Aabb::of(scene.positions(&of.vertices));
        let front = self.push_fronts(scene, piece, true, &corners);
        let back = self.push_backs(scene, piece, &bounds);
        let back = back.unwrap_or_else(|| self.push_fronts(scene, piece, false, &corners));
        self.list.push(Screen {
            normal: face.normal,
            plane: face.plane,
            bounds,
            corners,
            sides: [front, back],
        });
    }

    fn push_corners(&mut self, corners: impl IntoIterator<Item = DVec3>) -> Range<u32> {
        let start = self.corners.len() as u32;
        self.corners.extend(corners);
        start..self.corners.len() as u32
    }

    /// The faces of a piece, as seen from their front or from behind.
    fn push_fronts(
        &mut self,
        scene: &Scene,
        piece: u32,
        shows_front: bool,
        corners: &Range<u32>,
    ) -> Range<u32> {
        let start = self.shares.len() as u32;
        let of = &scene.pieces[piece as usize];
        if of.n_faces == 1 {
            self.shares.push(Share {
                face: of.face,
                shows_front,
                corners: corners.clone(),
                is_turned: false,
            });
        } else {
            for face in scene.faces_of(piece) {
                for part in own_pieces(scene, face) {
                    let corners = self.push_corners(scene.positions(&scene.pieces[part].vertices));
                    self.shares.push(Share {
                        face,
                        shows_front,
                        corners,
                        is_turned: false,
                    });
                }
            }
        }
        start..self.shares.len() as u32
    }

    /// The faces behind a piece of a two-sided surface; `None` if it is not one.
    fn push_backs(&mut self, scene: &Scene, piece: u32, bounds: &Aabb) -> Option<Range<u32>> {
        let start = self.shares.len() as u32;
        let front = scene.face(scene.pieces[piece as usize].face);
        let faces = scene.surfaces[front.surface.index()].faces.clone();
        for face in faces.map(FaceId) {
            let back = scene.face(face);
            if !back.is_back || back.plane != front.plane {
                continue;
            }
            for part in own_pieces(scene, face) {
                let corners = scene.positions(&scene.pieces[part].vertices);
                if !Aabb::of(corners.iter().copied()).meets(bounds) {
                    continue;
                }
                let corners = self.push_corners(corners);
                self.shares.push(Share {
                    face,
                    shows_front: true,
                    corners,
                    is_turned: true,
                });
            }
        }
        let end = self.shares.len() as u32;
        (end > start).then_some(start..end)
    }
}

/// Coplanar screens that overlap hide as if each were alone; what is seen there is that
/// which shows its front, emitters first.
impl Screens {
    fn share_overlaps(&mut self, scene: &Scene) {
        let found: Vec<(u32, Vec<u32>)> = (0..self.list.len() as u32)
            .map(|screen| (screen, self.overlapping(scene, screen)))
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
                start..self.shares.len() as u32
            });
        }
    }

    /// Screens of the same plane that have an area in common with this one, ascending.
    fn overlapping(&self, scene: &Scene, screen: u32) -> Vec<u32> {
        let of = self.get(screen);
        let mut others = Vec::new();
        self.tree.visit(
            |bounds| bounds.meets(&of.bounds),
            |other| {
                let is_in_plane = other != screen && self.get(other).plane == of.plane;
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
fn own_pieces(scene: &Scene, face: FaceId) -> impl Iterator<Item = usize> + '_ {
    let range = &scene.face(face).pieces;
    (range.start as usize..range.end as usize).filter(|&i| scene.pieces[i].n_faces == 1)
}
