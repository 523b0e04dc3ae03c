//! Form factors between surfaces, to a tolerance.
//!
//! `F` from one surface to another is the fraction of what leaves the one, diffuse
//! and uniform, that arrives at the other. Pairs with nothing between have a closed
//! form (`contour`, and `apart` where that loses digits). For the others the exact factor from a point is integrated over
//! one of the two (`pair`), on cells bounded by the critical curves of the pair
//! (`cells`), so that adaptive cubature (`cubature`) sees smooth pieces and cannot
//! miss a feature that is smaller than the distance of its points.

mod apart;
mod cells;
mod contour;
mod cubature;
mod matrix;
mod pair;

pub use matrix::{FormFactors, NotClosed, Reciprocity, Repair};

use antumbra_geom::{Control, Phase};
use antumbra_scene::{FaceId, Scene, Surface};
use antumbra_visibility::{
    CriticalCurve, Evaluator, EventKind, EventKinds, Scratch, critical_curves,
};
use cubature::{Goal, Rule};
use pair::{CONTACT, Exchange, Pair, Work};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is asked of [`form_factors`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorOptions {
    /// The error allowed of every form factor, absolute.
    pub tolerance: f64,
    /// No more exact evaluations than this for one pair of faces, beyond one for
    /// each point of its first cells.
    pub most_evaluations: u64,
}

impl Default for FactorOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            most_evaluations: 2_000_000,
        }
    }
}

/// About so many pairs are computed a second time, from the other side.
const CHECKED: usize = 256;

/// Pairs with more evaluations than this are not computed a second time.
const CHEAP: u64 = 20_000;

/// The form factors between all surfaces of a scene.
///
/// Factors are geometric: every surface counts, whatever its material. A surface sees
/// with its front, a two-sided one with both sides: its factors are then the mean of
/// both, and its area is that of both. Every surface blocks light from both sides, by
/// the rules of [`Evaluator`]. Surfaces in one plane exchange nothing, also where one
/// lies on the other: what a box on a floor covers is missing from the floor's row.
///
/// A pair is computed once and gives the factors of both directions; a sample of
/// pairs is computed from the other side as well, by independent integrals, to measure
/// the reciprocity ([`FormFactors::reciprocity`]). Nothing is normalised.
///
/// The result does not depend on the number of threads, to the bit, unless it was
/// stopped.
///
/// # Source
///
/// Area integral of the exact point factor, on a discontinuity mesh: the cells are
/// those of Heckbert 1992 and Lischinski, Tampieri & Greenberg 1992 (H92, LTG92 in
/// `docs/references.md`), for one emitter at a time.
#[must_use]
pub fn form_factors(
    evaluator: &Evaluator<'_>,
    options: &FactorOptions,
    control: &Control<'_>,
) -> FormFactors {
    let (scene, stop) = (evaluator.scene(), control.stop);
    let n = scene.faces.len() as u32;
    let rule = Rule::new();
    let contacts: Vec<Vec<CriticalCurve>> = (0..n)
        .into_par_iter()
        .map(|face| {
            let kinds = EventKinds::NONE.with(EventKind::Contact);
            let radius = CONTACT * scene.extent;
            // Where they are missing, no pair is computed either.
            critical_curves(
                evaluator,
                FaceId(face),
                kinds,
                radius,
                &Control::stopping(stop),
            )
            .unwrap_or_default()
            .curves
        })
        .collect();
    let areas = surface_areas(scene);
    let n_pairs = (n as usize * (n as usize).saturating_sub(1) / 2).max(1);
    let n_done = AtomicUsize::new(0);
    let one = |a: FaceId, b: FaceId, scratch: &mut Scratch| {
        if !may_exchange(scene, a, b) {
            return Outcome::Nothing;
        }
        if stop.is_wanted() {
            return Outcome::LeftOut(b);
        }
        let Some(pair) = Pair::new(evaluator, a, b) else {
            return Outcome::Nothing;
        };
        let [s, t] = [a, b].map(|face| scene.face(face).surface.index());
        let smaller = areas[s].min(areas[t]);
        let [faces_s, faces_t] = [s, t].map(|s| scene.surfaces[s].faces.len() as f64);
        let goal = Goal {
            error: options.tolerance * smaller / (faces_s * faces_t),
            most_evaluations: options.most_evaluations,
            stop,
        };
        let mut work = Work {
            evaluator,
            rule: &rule,
            contacts: &contacts,
            scratch,
        };
        let Some(there) = pair.exchange(pair.better(), &mut work, &goal) else {
            return Outcome::LeftOut(b);
        };
        let is_cheap = there.evaluations <= CHEAP;
        let back = (is_cheap && is_checked(a, b, n_pairs)).then(|| {
            let goal = Goal {
                // The other side may be much larger, and more happens there.
                most_evaluations: options.most_evaluations.min(32 * there.evaluations),
                ..goal
            };
            pair.exchange(1 - pair.better(), &mut work, &goal)
        });
        Outcome::Done(Entry::new(a, b, there, back.flatten()))
    };
    let row = |a: u32| -> Row {
        if stop.is_wanted() {
            return Row::left_out(scene, FaceId(a));
        }
        let pairs = (a + 1..n).into_par_iter().with_max_len(16);
        let outcomes = pairs.map_init(Scratch::default, |scratch, b| {
            let outcome = one(FaceId(a), FaceId(b), scratch);
            let done = n_done.fetch_add(1, Ordering::Relaxed);
            if matches!(outcome, Outcome::Done(_)) {
                (control.progress)(Phase::Factors, done as f64 / n_pairs as f64);
            }
            outcome
        });
        Row::new(FaceId(a), outcomes.collect())
    };
    let rows: Vec<Row> = (0..n).into_par_iter().map(row).collect();
    FormFactors::assemble(scene, &areas, &rows)
}

/// May two faces see each other, for all that their planes say?
fn may_exchange(scene: &Scene, a: FaceId, b: FaceId) -> bool {
    let [a, b] = [scene.face(a), scene.face(b)];
    a.plane != b.plane && !a.is_covered && !b.is_covered
}

/// What became of a pair.
enum Outcome {
    /// No point of one front sees the other.
    Nothing,
    Done(Entry),
    /// The work was stopped before anything was known of the face and this one.
    LeftOut(FaceId),
}

/// The pairs of a face with those after it.
struct Row {
    face: FaceId,
    entries: Vec<Entry>,
    /// Faces whose pairs with this one were left out.
    left_out: Vec<FaceId>,
}

impl Row {
    fn new(face: FaceId, outcomes: Vec<Outcome>) -> Self {
        let (mut entries, mut left_out) = (Vec::new(), Vec::new());
        for outcome in outcomes {
            match outcome {
                Outcome::Nothing => {}
                Outcome::Done(entry) => entries.push(entry),
                Outcome::LeftOut(other) => left_out.push(other),
            }
        }
        Self {
            face,
            entries,
            left_out,
        }
    }

    /// A row that was not begun.
    fn left_out(scene: &Scene, face: FaceId) -> Self {
        let others = (face.0 + 1..scene.faces.len() as u32).map(FaceId);
        Self {
            face,
            entries: Vec::new(),
            left_out: others.filter(|&b| may_exchange(scene, face, b)).collect(),
        }
    }
}

/// What two faces exchange, from one side and perhaps from the other.
#[derive(Clone, Copy, Debug)]
struct Entry {
    faces: [FaceId; 2],
    exchange: Exchange,
    /// The same, integrated over the other side.
    back: Option<Exchange>,
}

impl Entry {
    /// Two results that differ by more than both estimates tell of an error: it
    /// counts, with that of the second.
    fn new(a: FaceId, b: FaceId, there: Exchange, back: Option<Exchange>) -> Self {
        let mut exchange = there;
        if let Some(back) = back {
            let difference = (there.value - back.value).abs();
            if difference > there.error + back.error {
                exchange.error = difference + back.error;
            }
            exchange.evaluations += back.evaluations;
        }
        Self {
            faces: [a, b],
            exchange,
            back,
        }
    }
}

/// Is this pair computed from both sides? All are in small scenes; in larger ones
/// about [`CHECKED`], scattered by a hash of their ids.
fn is_checked(a: FaceId, b: FaceId, n_pairs: usize) -> bool {
    let key = (u64::from(a.0) << 32 | u64::from(b.0)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (key >> 40).is_multiple_of(n_pairs.div_ceil(CHECKED) as u64)
}

/// The uncovered area of every surface, both sides of two-sided ones; square scene units.
fn surface_areas(scene: &Scene) -> Vec<f64> {
    let area = |s: &Surface| {
        let faces = &scene.faces[s.faces.start as usize..s.faces.end as usize];
        let uncovered = faces.iter().filter(|f| !f.is_covered);
        // An empty sum is −0.
        uncovered.map(|f| f.area).sum::<f64>() + 0.0
    };
    scene.surfaces.iter().map(area).collect()
}
