//! What a point gathers: one visibility map, dealt out to the elements.

use super::basis::N;
use super::deal::{Dealer, Demands, Portion};
use super::forest::Forest;
use antumbra_visibility::{Evaluator, MapScratch, Place};

/// Working memory of one thread.
#[derive(Debug, Default)]
pub(crate) struct GatherScratch {
    map: MapScratch,
    pub(crate) portions: Vec<Portion>,
    /// Whole elements that were too coarse for a point.
    pub(crate) too_coarse: Vec<u32>,
}

/// What is told of one point, besides the portions.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Told {
    /// Form factor of all fronts.
    pub(crate) seen: f64,
    /// Error of the cones that were ended early at most, relative to the peak.
    pub(crate) truncated: f64,
}

/// Cones are ended when what can be seen in them is less than this share of what a point
/// is allowed to be off by.
const ENDED: f64 = 0.25;

/// The first cones that are ended have this share of what is allowed.
const FIRST_ENDED: f64 = 1e-2;

/// Gathers at points of one scene.
pub(crate) struct Gathering<'e, 's> {
    pub(crate) evaluator: &'e Evaluator<'s>,
    pub(crate) forest: &'e Forest,
    /// Error allowed at a point, relative to the peak; 0 is exact.
    pub(crate) allowed: f64,
    pub(crate) demands: Demands,
}

impl Gathering<'_, '_> {
    /// Fills the portions of a point; what it gathers is
    /// `Σ weights · reflected` of them.
    pub(crate) fn at(&self, place: &Place, scratch: &mut GatherScratch) -> Told {
        // The spread of what can be seen in a cone: nothing, or the brightest.
        let spread = self.forest.brightest();
        let mut epsilon = match spread > 0.0 {
            true => (FIRST_ENDED * self.allowed / spread).min(MOST_ENDED),
            false => MOST_ENDED,
        };
        loop {
            let told = self.once(place, epsilon, spread, scratch);
            if told.truncated <= ENDED * self.allowed {
                return told;
            }
            epsilon *= 0.5 * (ENDED * self.allowed / told.truncated);
            if epsilon < LEAST_ENDED {
                epsilon = 0.0;
            }
        }
    }

    fn once(&self, place: &Place, epsilon: f64, spread: f64, scratch: &mut GatherScratch) -> Told {
        let forest = self.forest;
        scratch.portions.clear();
        let mut dealer = Dealer {
            forest,
            point: place.point,
            normal: place.normal,
            demands: self.demands,
            portions: &mut scratch.portions,
            too_coarse: &mut scratch.too_coarse,
        };
        let mut seen = 0.0;
        let map = &mut scratch.map;
        let totals = self.evaluator.visible_faces(place, epsilon, map, |part| {
            if !part.shows_front {
                return;
            }
            seen += part.factor;
            let side = part.face.index();
            if forest.sides[side].is_black || part.factor <= 0.0 {
                return;
            }
            if part.is_ended {
                let middle = part.fragment.iter().sum::<glam::DVec3>();
                dealer.deal_at(side, middle / part.fragment.len() as f64, part.factor);
            } else {
                dealer.deal(side, part.fragment, part.factor);
            }
        });
        Told {
            seen,
            // Each is off by its own weight at most, this way or that.
            truncated: 3.0 * (totals.ended * epsilon).sqrt() * spread,
        }
    }

    /// Indirect irradiance of the portions, per band.
    pub(crate) fn irradiance(&self, portions: &[Portion]) -> Vec<f64> {
        let forest = self.forest;
        let mut bands = vec![0.0; forest.n_bands];
        for portion in portions {
            let values = forest.coefficients(&forest.reflected, portion.element);
            for i in 0..N {
                for (band, sum) in bands.iter_mut().enumerate() {
                    *sum += portion.weights[i] * values[i * forest.n_bands + band];
                }
            }
        }
        bands
    }
}

/// No larger cones are ended.
const MOST_ENDED: f64 = 1e-3;

/// If smaller cones would have to be ended, none is.
const LEAST_ENDED: f64 = 1e-9;
