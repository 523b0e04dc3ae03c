//! The visible part of an emitter from a point, and its irradiance there.
//!
//! # Source
//!
//! Cone subtraction with recursive splitting: every decision is one half-space
//! split of a piece with positive measure whose two halves share the cut, so a
//! wrong sign moves a sliver of rounding size and never a region. Compared with
//! booleans and with edge integration in `docs/numerics.md`.

use crate::adjacency::Adjacency;
use crate::cone::{RELATIVE_TOLERANCE, cone, distance_to_segment_sq, l1};
use crate::events::shaft::supporting_plane;
use crate::fragments::{Fragment, Fragments, HalfSpace, Position};
use crate::lambert::contour_sum;
use crate::place::Approach;
use crate::visibility_map::Screens;
use antumbra_geom::{Plane, settled};
use antumbra_scene::{Aabb, FaceId, PlaneId, Scene};
use glam::DVec3;
use std::sync::OnceLock;

/// A convex occluder with its corners in flat storage.
#[derive(Clone, Copy, Debug)]
struct Occluder {
    start: u32,
    len: u32,
    normal: DVec3,
    plane: PlaneId,
}

/// A convex part of an emitter.
#[derive(Clone, Debug)]
struct EmitterPiece {
    corners: Vec<DVec3>,
}

/// A face that emits.
#[derive(Clone, Debug)]
struct Emitter {
    face: FaceId,
    plane: PlaneId,
    normal: DVec3,
    pieces: Vec<EmitterPiece>,
    bounds: Aabb,
}

/// A convex plane polygon whose visible part is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Corners, counter-clockwise seen from the front; scene units.
    pub corners: &'a [DVec3],
    /// Unit normal of its front.
    pub normal: DVec3,
    /// Its plane class: nothing in its own plane hides it.
    pub plane: PlaneId,
}

/// Which occluders an evaluation has to look at.
#[derive(Clone, Debug)]
enum Candidates {
    /// Few: this list, by the shaft between receiver and emitter.
    List(Vec<u32>),
    /// Many: asked of the box tree for every point.
    Tree,
}

/// A receiver prepared for many evaluations: which emitters it can see at all,
/// and which occluders may stand between.
#[derive(Clone, Debug)]
pub struct View {
    normal: DVec3,
    plane: Option<PlaneId>,
    /// Per emitter of the evaluator.
    candidates: Vec<Option<Candidates>>,
}

impl View {
    /// The unit normal of the receiver.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Can any emitter light this receiver at all?
    #[must_use]
    pub fn sees_any_emitter(&self) -> bool {
        self.candidates.iter().any(Option::is_some)
    }

    /// May anything stand between this receiver and an emitter?
    #[must_use]
    pub fn may_be_occluded(&self) -> bool {
        self.candidates.iter().flatten().any(|c| match c {
            Candidates::List(list) => !list.is_empty(),
            Candidates::Tree => true,
        })
    }

    /// The emitters this receiver may see, as positions in [`Evaluator::emitters`].
    pub fn visible_emitters(&self) -> impl Iterator<Item = usize> + '_ {
        self.candidates
            .iter()
            .enumerate()
            .filter(|(_, c)| c.is_some())
            .map(|(i, _)| i)
    }
}

/// Working memory of one thread.
#[derive(Debug, Default)]
pub struct Scratch {
    fragments: Fragments,
    halves: Vec<HalfSpace>,
    cones: Vec<Cone>,
    cone_corners: Vec<DVec3>,
    visible: Vec<Fragment>,
    found: Vec<u32>,
    /// Features of an occluder this near to the point touch it.
    slack: f64,
    /// How many times more the source may be cut in two.
    cuts_left: usize,
    /// Occluders whose cones were cut against, for profiling: a count, not a time.
    pub n_cones: u64,
    /// The form factors of all emitters without occluders, summed over the emitters of
    /// the last [`Evaluator::factors`]: 1e-16 of them is rounding of what is left.
    pub unoccluded: f64,
}

/// The cone of one candidate in [`Scratch`].
#[derive(Clone, Copy, Debug)]
struct Cone {
    halves: u32,
    n_halves: u32,
    corners: u32,
    n_corners: u32,
}

/// Lists longer than this are replaced by a query of the box tree at every point.
///
/// 24 plane tests of a list cost about what the walk down a tree of a thousand
/// boxes costs (see the benchmark `exact_evaluation`).
const LONGEST_LIST: usize = 24;

/// A visible share this small is the rounding of the cuts: nothing is visible.
const DARK: f64 = 8.0 * f64::EPSILON;

/// What is visible of a source to this share is whole, and no slit.
const WHOLE: f64 = 1.0 - 1e-9;

/// Edges farther from the point than this part of the scene are seen where they are, up to
/// [`DARK`] and what the laws of light allow.
const NEAR: f64 = 1e-4;

/// More candidates than this in one fragment, and the fragment is cut in two.
const FLAT_CANDIDATES: usize = 6;

/// Splitting ends here, whatever is left.
const DEEPEST_SPLIT: u32 = 40;

/// How many times an emitter may be cut in two for every candidate: near-linear work takes
/// a few. Where many edges meet in one place, in copies of one box, no cut parts them, and
/// the parts would double forty times.
const CUTS_PER_CANDIDATE: usize = 16;

/// Exact irradiance in a scene.
#[derive(Debug)]
pub struct Evaluator<'s> {
    scene: &'s Scene,
    occluders: Vec<Occluder>,
    corners: Vec<DVec3>,
    emitters: Vec<Emitter>,
    adjacency: Adjacency,
    screens: OnceLock<Screens>,
}

impl<'s> Evaluator<'s> {
    /// Prepares the occluders and emitters of a scene.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        let mut corners = Vec::new();
        let occluders = scene
            .pieces
            .iter()
            .map(|piece| {
                let face = scene.face(piece.face);
                let start = corners.len() as u32;
                corners.extend(scene.positions(&piece.vertices));
                Occluder {
                    start,
                    len: piece.vertices.len() as u32,
                    normal: face.normal,
                    plane: face.plane,
                }
            })
            .collect();
        let emitters = scene
            .emitters()
            .map(|id| {
                let face = scene.face(id);
                let pieces = scene.pieces[face.pieces.start as usize..face.pieces.end as usize]
                    .iter()
                    .map(|p| EmitterPiece {
                        corners: scene.positions(&p.vertices),
                    })
                    .collect();
                let bounds = Aabb::of(scene.positions(&face.outline));
                Emitter {
                    face: id,
                    plane: face.plane,
                    normal: face.normal,
                    pieces,
                    bounds,
                }
            })
            .collect();
        Self {
            scene,
            occluders,
            corners,
            emitters,
            adjacency: Adjacency::new(scene),
            screens: OnceLock::new(),
        }
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// What meets where.
    pub(crate) fn adjacency(&self) -> &Adjacency {
        &self.adjacency
    }

    /// What visibility maps are made of; joined when it is first asked for.
    pub(crate) fn screens(&self) -> &Screens {
        self.screens.get_or_init(|| Screens::new(self.scene))
    }

    /// The emitting faces, ascending: the order of all factors.
    pub fn emitters(&self) -> impl ExactSizeIterator<Item = FaceId> + '_ {
        self.emitters.iter().map(|e| e.face)
    }

    /// Prepares evaluations on a face.
    #[must_use]
    pub fn view(&self, receiver: FaceId) -> View {
        let face = self.scene.face(receiver);
        let outline = self.scene.positions(&face.outline);
        let candidates = self
            .emitters
            .iter()
            .map(|emitter| {
                if emitter.plane == face.plane || face.is_covered {
                    return None;
                }
                let lamp = self.scene.positions(&self.scene.face(emitter.face).outline);
                self.shaft(
                    (&outline, face.normal, face.plane),
                    (&lamp, emitter.normal, emitter.plane),
                )
            })
            .collect();
        View {
            normal: face.normal,
            plane: Some(face.plane),
            candidates,
        }
    }

    /// A view of a face for which nothing is prepared: every evaluation asks the box tree
    /// for all that may stand between. Values are the same.
    #[must_use]
    pub fn unprepared_view(&self, receiver: FaceId) -> View {
        let face = self.scene.face(receiver);
        let mut view = View {
            plane: Some(face.plane),
            ..self.free_view(face.normal)
        };
        if face.is_covered {
            view.candidates.fill(None);
        }
        view
    }

    /// Prepares evaluations at free sensors with this unit normal.
    #[must_use]
    pub fn free_view(&self, normal: DVec3) -> View {
        let candidates = vec![Some(Candidates::Tree); self.emitters.len()];
        View {
            normal,
            plane: None,
            candidates,
        }
    }

    /// The occluders that may stand between two polygons; `None` if these cannot
    /// see each other at all.
    fn shaft(
        &self,
        (a, normal_a, plane_a): (&[DVec3], DVec3, PlaneId),
        (b, normal_b, plane_b): (&[DVec3], DVec3, PlaneId),
    ) -> Option<Candidates> {
        let list = self.between(a, (normal_a, plane_a), b, (normal_b, plane_b))?;
        Some(if list.len() > LONGEST_LIST {
            Candidates::Tree
        } else {
            Candidates::List(list)
        })
    }

    /// All occluders (positions in [`Scene::pieces`]) that may hide a part of `b`
    /// from a point of `a`: those that meet the convex hull of both, and neither
    /// lie in nor behind one of the planes. `None` if no point of one polygon's
    /// front sees the front of the other.
    #[must_use]
    pub fn between(
        &self,
        a: &[DVec3],
        (normal_a, plane_a): (DVec3, PlaneId),
        b: &[DVec3],
        (normal_b, plane_b): (DVec3, PlaneId),
    ) -> Option<Vec<u32>> {
        let tolerance = self.scene.plane_tolerance();
        let above = |points: &[DVec3], origin: DVec3, normal: DVec3| {
            points.iter().any(|&p| normal.dot(p - origin) > tolerance)
        };
        if !above(b, a[0], normal_a) || !above(a, b[0], normal_b) {
            return None;
        }
        let bounds = Aabb::of(a.iter().chain(b).copied());
        // Planes that have the whole shaft on one side, outward normals.
        let mut walls: Vec<(DVec3, f64)> = vec![
            (-normal_a, -normal_a.dot(a[0])),
            (-normal_b, -normal_b.dot(b[0])),
        ];
        for (edges, points) in [(a, b), (b, a)] {
            for i in 0..edges.len() {
                let (p, q) = (edges[i], edges[(i + 1) % edges.len()]);
                for &r in points {
                    let all = a.iter().chain(b).copied();
                    walls.extend(supporting_plane([p, q, r], all, tolerance));
                }
            }
        }
        let mut list = Vec::new();
        self.scene.tree.visit(
            |b| {
                b.meets(&bounds)
                    && walls
                        .iter()
                        .all(|&(n, d)| -b.max_along(-n) <= d + tolerance)
            },
            |piece| {
                let occluder = &self.occluders[piece as usize];
                let corners = self.occluder_corners(piece);
                // In or beyond a wall: strictly inside of the two planes, not
                // strictly outside of the others.
                let is_between = occluder.plane != plane_a
                    && occluder.plane != plane_b
                    && walls.iter().enumerate().all(|(k, &(n, d))| {
                        let slack = if k < 2 { -tolerance } else { tolerance };
                        corners.iter().any(|&x| n.dot(x) - d < slack)
                    });
                if is_between {
                    list.push(piece);
                }
            },
        );
        list.sort_unstable();
        Some(list)
    }

    /// Those of `occluders` that reach into the convex hull of two polygons: no
    /// other hides anything of `b` from `a` but on a set of measure zero.
    ///
    /// * `a`, `b` — corners, scene units; from [`Evaluator::between`]'s polygons, or
    ///   parts of them.
    /// * `occluders` — from [`Evaluator::between`] for polygons that hold these.
    ///
    /// Occluders that only touch the hull, such as the walls of a convex room, are
    /// left out: good for integrals, not for values on the border.
    #[must_use]
    pub fn narrow(&self, a: &[DVec3], b: &[DVec3], occluders: &[u32]) -> Vec<u32> {
        let tolerance = self.scene.plane_tolerance();
        let all = || a.iter().chain(b).copied();
        let bounds = Aabb::of(all());
        let is_near =
            |&&piece: &&u32| Aabb::of(self.occluder_corners(piece).iter().copied()).meets(&bounds);
        let near: smallvec::SmallVec<[u32; 16]> =
            occluders.iter().filter(is_near).copied().collect();
        if near.is_empty() {
            return Vec::new();
        }
        let mut walls: smallvec::SmallVec<[(DVec3, f64); 32]> = smallvec::SmallVec::new();
        for polygon in [a, b] {
            if let [p, q, r, ..] = *polygon {
                walls.extend(supporting_plane([p, q, r], all(), tolerance));
            }
        }
        for (edges, points) in [(a, b), (b, a)] {
            for i in 0..edges.len() {
                let (p, q) = (edges[i], edges[(i + 1) % edges.len()]);
                for &r in points {
                    walls.extend(supporting_plane([p, q, r], all(), tolerance));
                }
            }
        }
        let reaches_in = |&piece: &u32| {
            let mut part: smallvec::SmallVec<[DVec3; 12]> = self.occluder_corners(piece).into();
            walls.iter().all(|&(normal, offset)| {
                part = inside(&part, normal, offset - tolerance);
                !part.is_empty()
            })
        };
        near.into_iter().filter(reaches_in).collect()
    }

    fn occluder_corners(&self, piece: u32) -> &[DVec3] {
        let o = &self.occluders[piece as usize];
        &self.corners[o.start as usize..(o.start + o.len) as usize]
    }

    /// Form factors from a point to the visible part of every emitter.
    ///
    /// * `point` — scene units.
    /// * `approach` — the limit from one side, for nodes on contacts.
    /// * `factors` — one value per emitter, in the order of [`Evaluator::emitters`].
    ///
    /// Each factor is in `0..=1`, dimensionless; irradiance is the sum of
    /// exitance times factor. This is one *exact evaluation*.
    ///
    /// # Panics
    ///
    /// If `factors` has not one place per emitter.
    pub fn factors(
        &self,
        view: &View,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
        factors: &mut [f64],
    ) {
        assert_eq!(factors.len(), self.emitters.len(), "one factor per emitter");
        scratch.unoccluded = 0.0;
        for ((emitter, candidates), factor) in self
            .emitters
            .iter()
            .zip(&view.candidates)
            .zip(factors.iter_mut())
        {
            *factor = 0.0;
            let Some(candidates) = candidates else {
                continue;
            };
            for piece in &emitter.pieces {
                let source = Source {
                    corners: &piece.corners,
                    normal: emitter.normal,
                    plane: emitter.plane,
                };
                let list = match candidates {
                    Candidates::List(list) => Some(list.as_slice()),
                    Candidates::Tree => None,
                };
                *factor += self.factor(
                    view,
                    &source,
                    emitter.bounds,
                    list,
                    point,
                    approach,
                    scratch,
                );
            }
        }
    }

    /// Irradiance per band at a point: the sum over emitters of exitance times
    /// factor.
    #[must_use]
    pub fn irradiance(
        &self,
        view: &View,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
    ) -> Vec<f64> {
        let mut factors = vec![0.0; self.emitters.len()];
        self.factors(view, point, approach, scratch, &mut factors);
        self.weigh(&factors)
    }

    /// Irradiance per band of factors: the sum of exitance times factor.
    #[must_use]
    pub fn weigh(&self, factors: &[f64]) -> Vec<f64> {
        let mut bands = vec![0.0; self.scene.n_bands];
        for (emitter, factor) in self.emitters.iter().zip(factors) {
            let exitance = &self.scene.material(emitter.face).exitance;
            for (band, m) in bands.iter_mut().zip(exitance) {
                *band += m * factor;
            }
        }
        bands
    }

    /// The form factor from a point to the visible part of any convex source, and
    /// that part itself: `visit` is called with each of its convex fragments
    /// (corners relative to the point).
    ///
    /// * `occluders` — the candidates, from [`Evaluator::between`]; `None` asks the
    ///   box tree.
    pub fn visible_parts(
        &self,
        (normal, plane): (DVec3, Option<PlaneId>),
        source: &Source<'_>,
        occluders: Option<&[u32]>,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
        mut visit: impl FnMut(&[DVec3], f64),
    ) -> f64 {
        let view = View {
            normal,
            plane,
            candidates: Vec::new(),
        };
        let bounds = Aabb::of(source.corners.iter().copied());
        let factor = self.factor(&view, source, bounds, occluders, point, approach, scratch);
        let is_whole = scratch.visible.len() == 1;
        for &fragment in &scratch.visible {
            let corners = scratch.fragments.corners(fragment);
            visit(
                corners,
                if is_whole {
                    factor
                } else {
                    contour_sum(corners, normal)
                },
            );
        }
        factor
    }

    /// The factor of one convex source; its fragments stay in `scratch.visible`.
    fn factor(
        &self,
        view: &View,
        source: &Source<'_>,
        bounds: Aabb,
        list: Option<&[u32]>,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
    ) -> f64 {
        scratch.fragments.clear();
        scratch.halves.clear();
        scratch.cones.clear();
        scratch.cone_corners.clear();
        scratch.visible.clear();
        if view.plane == Some(source.plane) || !is_in_front(source, (point, view.normal), approach)
        {
            return 0.0;
        }

        scratch.slack = approach.map_or(0.0, |a| 4.0 * a.radius) + self.scene.plane_tolerance();
        let mut found = std::mem::take(&mut scratch.found);
        let list = match list {
            Some(list) => list,
            None => {
                found.clear();
                self.query(view, source, bounds, point, approach, &mut found);
                &found
            }
        };
        let factor = self.factor_behind(view, source, list, point, approach, scratch);
        scratch.found = found;
        factor
    }

    /// The factor of a convex source behind these occluders.
    fn factor_behind(
        &self,
        view: &View,
        source: &Source<'_>,
        list: &[u32],
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
    ) -> f64 {
        let point = approach.map_or(point, |a| self.settle(view.normal, source, list, point, a));

        // The source relative to the point, above the horizon.
        let parts = relative_source(
            source,
            (point, view.normal),
            approach,
            &mut scratch.fragments,
        );
        let reach = source
            .corners
            .iter()
            .fold(0.0f64, |most, &c| most.max((c - point).length_squared()))
            .sqrt();
        // What touches the point is seen in a direction, a place just behind it.
        let is_here = |c: &DVec3| approach.is_some_and(|a| c.length() <= a.radius);
        let is_touched = parts
            .iter()
            .any(|&part| scratch.fragments.corners(part).iter().any(is_here));
        let behind = approach
            .filter(|_| is_touched)
            .map_or(0.0, |a| BEHIND * a.radius);
        let horizon = HalfSpace {
            normal: view.normal,
            offset: 0.0,
            tolerance: 16.0 * f64::EPSILON * reach,
        };
        let lit: smallvec::SmallVec<[Fragment; 4]> = parts
            .into_iter()
            .filter_map(|part| match scratch.fragments.position(part, &horizon) {
                Position::Outside => None,
                Position::Inside => Some(part),
                Position::Straddles => Some(scratch.fragments.split(part, &horizon).0),
            })
            .collect();
        if lit.is_empty() {
            return 0.0;
        }

        // The cones of all candidates.
        let mut nearest = f64::INFINITY;
        let mut add = |piece: u32, scratch: &mut Scratch| {
            let occluder = &self.occluders[piece as usize];
            if !may_hide(occluder.plane, source, view) {
                return;
            }
            let corners = self.occluder_corners(piece);
            let halves = scratch.halves.len() as u32;
            let n = cone(
                &mut scratch.halves,
                corners,
                occluder.normal,
                (point, view.normal),
                approach,
                (reach, behind),
            );
            if n > 0 {
                let height = occluder.normal.dot(corners[0] - point).abs();
                if height < NEAR * self.scene.extent {
                    let least = approach.map_or(0.0, |a| a.radius);
                    nearest = edges_beside(corners, point, least)
                        .fold(nearest, |nearest, edge| nearest.min(edge.2));
                }
                let start = scratch.cone_corners.len() as u32;
                scratch
                    .cone_corners
                    .extend(corners.iter().map(|&c| c - point));
                scratch.cones.push(Cone {
                    halves,
                    n_halves: n as u32,
                    corners: start,
                    n_corners: corners.len() as u32,
                });
            }
        };
        list.iter().for_each(|&piece| add(piece, scratch));
        scratch.n_cones += scratch.cones.len() as u64;

        let whole: f64 = lit
            .iter()
            .map(|&part| contour_sum(scratch.fragments.corners(part), view.normal))
            .sum();
        // A source seen edge-on may give less than nothing by rounding.
        let unoccluded = whole.max(0.0);
        scratch.unoccluded += unoccluded;
        if scratch.cones.is_empty() {
            scratch.visible.extend(lit);
            return unoccluded;
        }
        let everything: smallvec::SmallVec<[u32; 32]> = (0..scratch.cones.len() as u32).collect();
        let mut hidden = Hidden::new(view.normal);
        // It is on a half-space to the same tolerance as others, and is that near.
        let slack = if is_touched {
            RELATIVE_TOLERANCE * reach / behind
        } else {
            0.0
        };
        scratch.cuts_left = CUTS_PER_CANDIDATE * everything.len();
        for part in lit {
            visible_of(scratch, part, &everything, 0, &mut hidden);
        }
        let mut factor = 0.0;
        for &fragment in &scratch.visible {
            factor += contour_sum(scratch.fragments.corners(fragment), view.normal);
        }
        hidden.audit(factor, whole, slack);
        let slit = self.scene.rounding() / nearest;
        let is_dark = factor <= DARK * unoccluded
            || (factor <= slit
                && factor < WHOLE * unoccluded
                && self.is_slit(view, source, list, point, approach, scratch));
        if is_dark {
            scratch.visible.clear();
            return 0.0;
        }
        factor.min(unoccluded)
    }

    /// Is what is visible no more than slits along near edges?
    ///
    /// Where an edge is seen is known to the rounding of its ends by its distance: what
    /// comes in between it and another, within twice as much of the plane through it and the
    /// point, is not known to come in; nor is the end of such a slit, a spot as small.
    fn is_slit(
        &self,
        view: &View,
        source: &Source<'_>,
        list: &[u32],
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &Scratch,
    ) -> bool {
        let least = approach.map_or(0.0, |a| a.radius);
        let planes: Vec<(DVec3, f64)> = list
            .iter()
            .map(|&piece| (piece, &self.occluders[piece as usize]))
            .filter(|(_, occluder)| {
                let plane = self.scene.planes[occluder.plane.index()];
                let is_near = plane.distance(point).abs() < NEAR * self.scene.extent;
                is_near && may_hide(occluder.plane, source, view)
            })
            .flat_map(|(piece, _)| edges_beside(self.occluder_corners(piece), point, least))
            .map(|(a, b, distance)| {
                let across = a.cross(b).normalize_or_zero();
                (across, 2.0 * self.scene.rounding() / distance)
            })
            .collect();
        let widest = planes.iter().map(|plane| plane.1).fold(0.0, f64::max);
        scratch.visible.iter().all(|&fragment| {
            let corners = scratch.fragments.corners(fragment);
            let first = corners[0].normalize_or_zero();
            let is_end = |c: &DVec3| first.distance(c.normalize_or_zero()) <= widest;
            let is_along = |(across, width): &(DVec3, f64)| {
                let is_in_it = |c: &DVec3| across.dot(*c).abs() <= width * c.length();
                corners.iter().all(is_in_it)
            };
            planes.iter().any(is_along) || corners.iter().all(is_end)
        })
    }

    /// Moves a point that touches a source or occluders onto their planes, within its
    /// receiver's plane and the distance that counts as touching.
    ///
    /// Nodes on contacts lie beside them by the rounding of the mesh; seen from there,
    /// light of that size would come in between a wall that touches the point and
    /// what joins it above.
    fn settle(
        &self,
        up: DVec3,
        source: &Source<'_>,
        list: &[u32],
        point: DVec3,
        approach: &Approach,
    ) -> DVec3 {
        let is_off =
            |normal: DVec3, corners: &[DVec3]| is_beside((normal, corners), (point, up), approach);
        let of_source = (source.normal, source.corners);
        let of_occluders = list
            .iter()
            .map(|&piece| {
                let normal = self.occluders[piece as usize].normal;
                (normal, self.occluder_corners(piece))
            })
            .filter(|(normal, corners)| is_off(*normal, corners));
        // The source first: what lies behind it would not be lit at all.
        let mut planes: smallvec::SmallVec<[Plane; 4]> = smallvec::SmallVec::new();
        planes.push(Plane { normal: up, point });
        let touched =
            std::iter::once(of_source).filter(|(normal, corners)| is_off(*normal, corners));
        planes.extend(touched.chain(of_occluders).map(|(normal, corners)| Plane {
            normal,
            point: corners[0],
        }));
        if planes.len() == 1 {
            return point;
        }
        settled(point, &planes, approach.radius)
    }

    /// Candidates of one point: pieces whose box meets the pyramid from the point
    /// to the source, above the horizon and in front of the source.
    fn query(
        &self,
        view: &View,
        source: &Source<'_>,
        bounds: Aabb,
        point: DVec3,
        approach: Option<&Approach>,
        found: &mut Vec<u32>,
    ) {
        let slack = approach.map_or(0.0, |a| a.radius) + self.scene.plane_tolerance();
        let around = Aabb {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        };
        let around = Aabb {
            min: around.min - slack,
            max: around.max + slack,
        };
        let n = source.corners.len();
        let mut walls: smallvec::SmallVec<[(DVec3, f64); 12]> = smallvec::SmallVec::new();
        walls.push((-view.normal, slack - view.normal.dot(point)));
        walls.push((-source.normal, slack - source.normal.dot(source.corners[0])));
        for i in 0..n {
            let (a, b) = (source.corners[i], source.corners[(i + 1) % n]);
            // Counter-clockwise as seen from the point: a × b points inwards... and
            // outwards is b × a.
            let normal = (a - point).cross(b - point);
            if let Some(normal) = normal.try_normalize() {
                walls.push((normal, normal.dot(point) + slack));
            }
        }
        self.scene.tree.visit(
            |b| b.meets(&around) && walls.iter().all(|&(n, d)| -b.max_along(-n) <= d),
            |piece| found.push(piece),
        );
        found.sort_unstable();
    }
}

/// The part of a convex polygon where `normal · x < offset`.
fn inside(polygon: &[DVec3], normal: DVec3, offset: f64) -> smallvec::SmallVec<[DVec3; 12]> {
    let mut kept = smallvec::SmallVec::new();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (hp, hq) = (normal.dot(p) - offset, normal.dot(q) - offset);
        if hp < 0.0 {
            kept.push(p);
        }
        if (hp < 0.0) != (hq < 0.0) {
            kept.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    kept
}

/// Does the front of the source face the point (or the side it is approached from)?
fn is_in_front(
    source: &Source<'_>,
    (point, up): (DVec3, DVec3),
    approach: Option<&Approach>,
) -> bool {
    let to_point = point - source.corners[0];
    let height = source.normal.dot(to_point);
    let most = to_point.abs().max_element().max(point.abs().max_element());
    let rounding = 8.0 * f64::EPSILON * most;
    match approach.and_then(|a| a.leaves(source.normal, up, height, rounding)) {
        Some(slope) => slope > 0.0,
        None => height > rounding,
    }
}

/// The source relative to the point, as convex fragments. Where the source touches
/// the point, the touching place is seen in the direction opposite to the
/// approach: that direction stands in its outline, at a vanishing distance. A
/// source that has the point inside is a fan around that direction.
fn relative_source(
    source: &Source<'_>,
    (point, up): (DVec3, DVec3),
    approach: Option<&Approach>,
    fragments: &mut Fragments,
) -> smallvec::SmallVec<[Fragment; 4]> {
    let mut corners: smallvec::SmallVec<[DVec3; 8]> =
        source.corners.iter().map(|&c| c - point).collect();
    let Some(approach) = approach else {
        return smallvec::smallvec![fragments.push(corners)];
    };
    // A source whose plane touches the point has the point in its plane.
    let height = source.normal.dot(corners[0]);
    let rounding = 8.0 * f64::EPSILON * point.abs().max_element();
    let touches_plane = approach
        .leaves(source.normal, up, height, rounding)
        .is_some_and(|slope| slope > 0.0);
    if touches_plane {
        for corner in &mut corners {
            *corner -= source.normal * source.normal.dot(*corner);
        }
    }
    let r_sq = approach.radius * approach.radius;
    let behind = -approach.toward * (approach.radius * BEHIND);
    let n = corners.len();
    let edge = |i: usize| (corners[i], corners[(i + 1) % n]);
    let touches_edge =
        (0..n).any(|i| distance_to_segment_sq(edge(i).0, edge(i).1 - edge(i).0) <= r_sq);
    let is_inside = (0..n).all(|i| edge(i).0.cross(edge(i).1).dot(source.normal) > 0.0);
    if touches_plane && !touches_edge && is_inside {
        return (0..n)
            .map(|i| fragments.push([behind, edge(i).0, edge(i).1]))
            .collect();
    }
    let mut outline: smallvec::SmallVec<[DVec3; 8]> = smallvec::SmallVec::new();
    for i in 0..n {
        let (a, b) = edge(i);
        let (a_touches, b_touches) = (a.length_squared() <= r_sq, b.length_squared() <= r_sq);
        outline.push(if a_touches { behind } else { a });
        if !a_touches && !b_touches && distance_to_segment_sq(a, b - a) <= r_sq {
            outline.push(behind);
        }
    }
    smallvec::smallvec![fragments.push(outline)]
}

/// The parts of `fragment` that none of the cones in `list` holds, pushed to
/// `scratch.visible`.
fn visible_of(
    scratch: &mut Scratch,
    fragment: Fragment,
    list: &[u32],
    depth: u32,
    hidden: &mut Hidden,
) {
    // Which cones can hide a part of this fragment?
    let mut relevant: smallvec::SmallVec<[u32; 32]> = smallvec::SmallVec::new();
    let sides = if list.len() > 2 {
        pyramid(scratch.fragments.corners(fragment), scratch.slack)
    } else {
        Sides::new()
    };
    for &c in list {
        match coverage(scratch, fragment, c, &sides) {
            Coverage::Nothing => {}
            Coverage::Part => relevant.push(c),
            Coverage::All => {
                hidden.add(scratch.fragments.corners(fragment));
                return;
            }
        }
    }
    if relevant.is_empty() {
        scratch.visible.push(fragment);
        return;
    }
    if relevant.len() > FLAT_CANDIDATES
        && depth < DEEPEST_SPLIT
        && scratch.cuts_left > 0
        && let Some(half) = dividing_plane(scratch, fragment, &relevant)
    {
        scratch.cuts_left -= 1;
        let (a, b) = scratch.fragments.split(fragment, &half);
        visible_of(scratch, a, &relevant, depth + 1, hidden);
        visible_of(scratch, b, &relevant, depth + 1, hidden);
        return;
    }
    // Few: peel them off one after the other.
    let first = scratch.visible.len();
    scratch.visible.push(fragment);
    for &c in &relevant {
        let end = scratch.visible.len();
        let mut kept = first;
        for i in first..end {
            let part = scratch.visible[i];
            let before = scratch.visible.len();
            if peel(scratch, part, c, hidden) {
                // Its visible pieces were appended behind `end`.
                debug_assert!(scratch.visible.len() >= before);
            } else {
                scratch.visible[kept] = part;
                kept += 1;
            }
        }
        // Close the gap between what was kept and what was appended.
        scratch.visible.drain(kept..end);
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Coverage {
    Nothing,
    Part,
    All,
}

/// The inward normals of the pyramid from the point to a fragment, and how far an
/// occluder must be outside of each to be passed over.
type Sides = smallvec::SmallVec<[(DVec3, f64); 8]>;

/// * `slack` — a distance: occluders that touch the point are never passed over. Rounding
///   comes on top, for occluders of which no corner is farther than four extents.
fn pyramid(corners: &[DVec3], slack: f64) -> Sides {
    // Counter-clockwise seen from the point: inwards is next × this.
    let n = corners.len();
    (0..n)
        .map(|i| {
            let (this, next) = (corners[i], corners[if i + 1 == n { 0 } else { i + 1 }]);
            let side = next.cross(this);
            // A short edge's plane is known to the rounding of its ends by its length.
            let rounding = 64.0 * f64::EPSILON * l1(this) * l1(next);
            (side, slack * l1(side) + rounding)
        })
        .collect()
}

/// How much of a fragment a cone can hide. Conservative: `Part` may be nothing.
fn coverage(scratch: &Scratch, fragment: Fragment, c: u32, sides: &Sides) -> Coverage {
    let cone = scratch.cones[c as usize];
    let corners =
        &scratch.cone_corners[cone.corners as usize..(cone.corners + cone.n_corners) as usize];
    // A side of the pyramid that has the whole occluder outside.
    if sides
        .iter()
        .any(|&(side, slack)| corners.iter().all(|q| side.dot(*q) < -slack))
    {
        return Coverage::Nothing;
    }
    let halves = &scratch.halves[cone.halves as usize..(cone.halves + cone.n_halves) as usize];
    let mut all = true;
    for half in halves {
        match scratch.fragments.position(fragment, half) {
            Position::Outside => return Coverage::Nothing,
            Position::Inside => {}
            Position::Straddles => all = false,
        }
    }
    if all { Coverage::All } else { Coverage::Part }
}

/// Removes from `part` what cone `c` hides. Returns `false` if nothing is hidden
/// (and leaves the part as it is), else appends the visible pieces.
fn peel(scratch: &mut Scratch, part: Fragment, c: u32, hidden: &mut Hidden) -> bool {
    let cone = scratch.cones[c as usize];
    let range = cone.halves as usize..(cone.halves + cone.n_halves) as usize;
    for k in range.clone() {
        if scratch.fragments.position(part, &scratch.halves[k]) == Position::Outside {
            return false;
        }
    }
    let before = scratch.visible.len();
    let mut rest = part;
    for k in range {
        let half = scratch.halves[k];
        match scratch.fragments.position(rest, &half) {
            Position::Inside => {}
            Position::Outside => {
                // The cone passes the fragment by: give back what was cut off.
                scratch.visible.truncate(before);
                return false;
            }
            Position::Straddles => {
                let (inside, outside) = scratch.fragments.split(rest, &half);
                scratch.visible.push(outside);
                rest = inside;
            }
        }
    }
    hidden.add(scratch.fragments.corners(rest));
    true
}

/// The plane through the point that best divides the candidates of a fragment:
/// the one through its centroid and the middle of its longest edge, or that of a
/// candidate's own edge, which has to be cut along anyway.
fn dividing_plane(scratch: &Scratch, fragment: Fragment, list: &[u32]) -> Option<HalfSpace> {
    let mut best: Option<(usize, HalfSpace)> = None;
    let mut consider = |half: HalfSpace| {
        if scratch.fragments.position(fragment, &half) != Position::Straddles {
            return usize::MAX / 4;
        }
        let (mut inside, mut outside) = (0, 0);
        for &c in list {
            let cone = scratch.cones[c as usize];
            let corners = &scratch.cone_corners
                [cone.corners as usize..(cone.corners + cone.n_corners) as usize];
            let (mut any_inside, mut any_outside) = (false, false);
            for &q in corners {
                let v = half.value(q);
                any_inside |= v > 0.0;
                any_outside |= v < 0.0;
            }
            inside += usize::from(any_inside);
            outside += usize::from(any_outside);
        }
        // The larger half counts; candidates in both halves count twice.
        let cost = 2 * inside.max(outside) + inside + outside;
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, half));
        }
        inside.max(outside)
    };
    if let Some(half) = middle_plane(scratch.fragments.corners(fragment)) {
        let larger = consider(half);
        if larger * 4 <= list.len() * 3 {
            return Some(half);
        }
    }
    let step = list.len().div_ceil(PLANES_TRIED);
    for &c in list.iter().step_by(step) {
        let cone = scratch.cones[c as usize];
        // The first half-space is the occluder's plane, not one through the point.
        for k in 1..cone.n_halves {
            consider(scratch.halves[(cone.halves + k) as usize]);
        }
    }
    best.map(|(_, half)| half)
}

/// Candidates whose edges are tried as dividing planes.
const PLANES_TRIED: usize = 3;

/// The plane through a fragment's centroid and the middle of its longest edge.
fn middle_plane(corners: &[DVec3]) -> Option<HalfSpace> {
    let n = corners.len();
    let centroid = corners.iter().copied().sum::<DVec3>() / n as f64;
    let (mut longest, mut middle, mut reach_sq) = (0.0, DVec3::ZERO, 0.0f64);
    for i in 0..n {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        let length = (b - a).length_squared();
        reach_sq = reach_sq.max(a.length_squared());
        if length > longest {
            longest = length;
            middle = (a + b) / 2.0;
        }
    }
    // Smaller than this and the pieces are rounding.
    if longest < 1e-24 * reach_sq {
        return None;
    }
    let normal = middle.cross(centroid).try_normalize()?;
    Some(HalfSpace {
        normal,
        offset: 0.0,
        tolerance: 16.0 * f64::EPSILON * reach_sq.sqrt(),
    })
}

/// Where a source that touches the point is seen: so many contact radii behind the point.
/// Larger, and it may lie behind something that does not touch the point. Smaller, and its
/// direction is no longer told from that of a plane: what is within the tolerance of a
/// half-space is on it (at 1e-3 that was 1e-3 rad).
pub(crate) const BEHIND: f64 = 0.5;

/// The audit of an evaluation, in debug builds: visible and hidden parts must add
/// up to the whole.
#[derive(Debug)]
struct Hidden {
    #[cfg(debug_assertions)]
    normal: DVec3,
    #[cfg(debug_assertions)]
    sum: f64,
}

impl Hidden {
    fn new(normal: DVec3) -> Self {
        let _ = normal;
        Self {
            #[cfg(debug_assertions)]
            normal,
            #[cfg(debug_assertions)]
            sum: 0.0,
        }
    }

    fn add(&mut self, corners: &[DVec3]) {
        let _ = corners;
        #[cfg(debug_assertions)]
        {
            self.sum += contour_sum(corners, self.normal);
        }
    }

    fn audit(&self, visible: f64, whole: f64, slack: f64) {
        let _ = (visible, whole, slack);
        #[cfg(debug_assertions)]
        let allowed = 1e-12 + slack;
        #[cfg(debug_assertions)]
        assert!(
            (visible + self.sum - whole).abs() <= allowed && visible <= whole + allowed,
            "visible {visible} + hidden {} is not the unoccluded factor {whole}",
            self.sum
        );
    }
}

/// Does a polygon touch the point but for a little, which the point may move?
///
/// * `up` — the unit normal at the point.
pub(crate) fn is_beside(
    (normal, corners): (DVec3, &[DVec3]),
    (point, up): (DVec3, DVec3),
    approach: &Approach,
) -> bool {
    let height = normal.dot(corners[0] - point);
    let across = normal - up * up.dot(normal);
    height != 0.0
        && height.abs() <= approach.radius
        && normal.dot(approach.toward).abs() > 1e-6
        && across.length_squared() >= 1e-6
        && (0..corners.len()).all(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
            let along = b - a;
            normal.cross(along).dot(point - a) >= -approach.radius * along.length()
        })
}

/// What lies in the source's or in the receiver's own plane hides nothing.
fn may_hide(plane: PlaneId, source: &Source<'_>, view: &View) -> bool {
    plane != source.plane && Some(plane) != view.plane
}

/// The edges of a polygon that are farther from a point than `least`: their ends, relative
/// to the point, and their distances.
fn edges_beside(
    corners: &[DVec3],
    point: DVec3,
    least: f64,
) -> impl Iterator<Item = (DVec3, DVec3, f64)> {
    (0..corners.len())
        .map(move |i| {
            let (a, b) = (corners[i] - point, corners[(i + 1) % corners.len()] - point);
            (a, b, distance_to_segment_sq(a, b - a).sqrt())
        })
        .filter(move |edge| edge.2 > least)
}
