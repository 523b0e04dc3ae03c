//! The visible part of an emitter from a point, and its irradiance there.
//!
//! `sight` is the emitter before anything stands between, `occluders` and `hull` say what
//! may, `subtract` cuts it off, and `limit` is for points that touch something.

pub(crate) mod hull;
pub(crate) mod limit;
pub(crate) mod occluders;
mod sight;
mod source;
mod subtract;
mod view;

pub use source::{Seen, Source};
pub use view::View;

use crate::adjacency::Adjacency;
use crate::cone::RELATIVE_TOLERANCE;
use crate::lambert::contour_sum;
use crate::place::{Approach, Place};
use crate::visibility_map::Screens;
use antumbra_scene::{FaceId, PlaneId, Scene};
use glam::DVec3;
use limit::Slits;
use occluders::Occluders;
use sight::Sight;
use std::sync::OnceLock;
use subtract::Subtraction;

/// A visible share this small is the rounding of the cuts: nothing is visible.
const DARK: f64 = 8.0 * f64::EPSILON;

/// What is visible of a source to this share is whole, and no slit.
const WHOLE: f64 = 1.0 - 1e-9;

/// Working memory of one thread.
#[derive(Debug, Default)]
pub struct Scratch {
    subtraction: Subtraction,
    found: Vec<u32>,
    /// Occluders whose cones were cut against, for profiling: a count, not a time.
    pub n_cones: u64,
}

/// Exact irradiance in a scene.
#[derive(Debug)]
pub struct Evaluator<'s> {
    scene: &'s Scene,
    occluders: Occluders,
    emitters: Vec<(FaceId, Source)>,
    adjacency: Adjacency,
    screens: OnceLock<Screens>,
}

impl<'s> Evaluator<'s> {
    /// Prepares the occluders and emitters of a scene.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        let emitters = scene.emitters().map(|id| (id, Source::of(scene, id)));
        Self {
            scene,
            occluders: Occluders::new(scene),
            emitters: emitters.collect(),
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
        self.emitters.iter().map(|emitter| emitter.0)
    }

    /// What a point sees of every emitter.
    ///
    /// * `point` — scene units.
    /// * `approach` — the limit from one side, for nodes on contacts.
    /// * `seen` — one per emitter, in the order of [`Evaluator::emitters`].
    ///
    /// Irradiance is the sum of exitance times factor. This is one *exact evaluation*.
    ///
    /// # Panics
    ///
    /// If `seen` has not one place per emitter.
    pub fn factors(
        &self,
        view: &View,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
        seen: &mut [Seen],
    ) {
        assert_eq!(seen.len(), self.emitters.len(), "one factor per emitter");
        let place = view.place(point, approach);
        let emitters = self.emitters.iter().zip(&view.candidates);
        for (((_, source), candidates), seen) in emitters.zip(seen) {
            *seen = match candidates {
                Some(candidates) => self.see(&place, source, candidates.list(), scratch),
                None => Seen::default(),
            };
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
        let mut seen = vec![Seen::default(); self.emitters.len()];
        self.factors(view, point, approach, scratch, &mut seen);
        self.weigh(&seen)
    }

    /// Irradiance per band of what is seen: the sum of exitance times factor.
    #[must_use]
    pub fn weigh(&self, seen: &[Seen]) -> Vec<f64> {
        let mut bands = vec![0.0; self.scene.n_bands];
        for (&(face, _), seen) in self.emitters.iter().zip(seen) {
            let exitance = &self.scene.material(face).exitance;
            for (band, m) in bands.iter_mut().zip(exitance) {
                *band += m * seen.factor;
            }
        }
        bands
    }

    /// What is seen of a source from a place.
    ///
    /// * `occluders` — the candidates, from [`Evaluator::between`]; `None` asks the
    ///   box tree.
    pub fn see(
        &self,
        place: &Place,
        source: &Source,
        occluders: Option<&[u32]>,
        scratch: &mut Scratch,
    ) -> Seen {
        let piece = |corners: &Vec<DVec3>| {
            let sight = Sight {
                place: *place,
                corners,
                normal: source.normal,
                plane: source.plane,
            };
            self.see_piece(sight, occluders, scratch)
        };
        source.pieces.iter().map(piece).sum()
    }

    /// The same for one convex polygon, part by part: `visit` is told the corners of every
    /// part that is seen, relative to the place, counter-clockwise as seen from there, and
    /// its form factor.
    ///
    /// * `corners`, `facing` — of the polygon, with its plane class and unit normal.
    pub fn see_parts(
        &self,
        place: &Place,
        corners: &[DVec3],
        facing: (PlaneId, DVec3),
        occluders: Option<&[u32]>,
        scratch: &mut Scratch,
        mut visit: impl FnMut(&[DVec3], f64),
    ) -> Seen {
        let sight = Sight {
            place: *place,
            corners,
            normal: facing.1,
            plane: facing.0,
        };
        scratch.subtraction.show(&[]);
        let seen = self.see_piece(sight, occluders, scratch);
        let is_whole = scratch.subtraction.visible().count() == 1;
        for part in scratch.subtraction.visible() {
            let factor = match is_whole {
                true => seen.factor,
                false => contour_sum(part, place.normal),
            };
            visit(part, factor);
        }
        seen
    }

    fn see_piece(
        &self,
        mut sight: Sight<'_>,
        occluders: Option<&[u32]>,
        scratch: &mut Scratch,
    ) -> Seen {
        if !sight.shows_front() {
            return Seen::default();
        }
        let mut found = std::mem::take(&mut scratch.found);
        let list = occluders.unwrap_or_else(|| {
            occluders::query(self.scene, &sight, &mut found);
            &found
        });
        sight.place.point = limit::settle(&sight, list, &self.occluders);
        let seen = self.see_past(&sight, list, scratch);
        scratch.found = found;
        seen
    }

    /// What is seen past these occluders, by the point that was settled on what it touches.
    fn see_past(&self, sight: &Sight<'_>, list: &[u32], scratch: &mut Scratch) -> Seen {
        let work = &mut scratch.subtraction;
        work.begin(4.0 * sight.place.radius() + self.scene.plane_tolerance());
        let parts = sight.parts(&mut work.fragments);
        let reach = sight.reach();
        let behind = sight.behind(&parts, &work.fragments);
        let lit = sight.above_horizon(parts, reach, &mut work.fragments);
        if lit.is_empty() {
            return Seen::default();
        }
        let slits = Slits {
            scene: self.scene,
            sight,
        };
        let mut nearest = f64::INFINITY;
        for &piece in list {
            if !sight.may_be_hidden_by(self.occluders.plane(piece)) {
                continue;
            }
            let (corners, normal) = (self.occluders.corners(piece), self.occluders.normal(piece));
            if work.add(corners, normal, &sight.place, (reach, behind))
                && slits.is_near(normal.dot(corners[0] - sight.place.point))
            {
                nearest = slits.nearer(nearest, corners);
            }
        }
        scratch.n_cones += work.n_cones() as u64;

        let up = sight.place.normal;
        let factor = |&part| contour_sum(work.fragments.corners(part), up);
        let whole: f64 = lit.iter().map(factor).sum();
        // A source seen edge-on may give less than nothing by rounding.
        let unoccluded = whole.max(0.0);
        let factor = if work.n_cones() == 0 {
            work.show(&lit);
            unoccluded
        } else {
            // It is on a half-space to the same tolerance as others, and is that near.
            let slack = if behind > 0.0 {
                RELATIVE_TOLERANCE * reach / behind
            } else {
                0.0
            };
            let factor = work.subtract(&lit, up, whole, slack);
            let slit = self.scene.rounding() / nearest;
            let is_dark = factor <= DARK * unoccluded
                || (factor <= slit
                    && factor < WHOLE * unoccluded
                    && slits.are_all(list, &self.occluders, work.visible()));
            if is_dark {
                work.show(&[]);
                0.0
            } else {
                factor.min(unoccluded)
            }
        };
        Seen { factor, unoccluded }
    }
}
