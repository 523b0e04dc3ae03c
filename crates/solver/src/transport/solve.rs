//! The rounds of the coarse solution: rows, sweeps, a look at what is between the nodes.

use super::balance::{power, row_sums};
use super::deal::Demands;
use super::forest::{Forest, NONE};
use super::gather::{GatherScratch, Gathering};
use super::rows::{Table, place_of};
use super::smooth::smooth;
use crate::direct::{DirectMeshes, Sampler};
use crate::field::Receiver;
use crate::radiosity::{Power, Reached, RowSums};
use antumbra_geom::{Control, DVec2, Phase, Stop};
use antumbra_visibility::{Evaluator, Place};
use rayon::prelude::*;

/// How to solve for interreflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransportOptions {
    /// Error allowed of what points gather, relative to the largest direct irradiance.
    pub tolerance: f64,
    /// No more sweeps over the rows than this; 0 leaves interreflection out altogether.
    pub most_sweeps: usize,
    /// No more elements than this.
    pub most_elements: usize,
}

impl Default for TransportOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            most_sweeps: 1000,
            most_elements: 4_000_000,
        }
    }
}

/// A solution of the radiosity equation, to be gathered from.
#[derive(Debug)]
pub struct Transport {
    /// How far it got.
    pub reached: Reached,
    /// Sweeps of the last iteration.
    pub sweeps: usize,
    /// Largest change of the last sweep, relative to the peak of direct light.
    pub residual: f64,
    /// Largest difference between what is gathered and what is interpolated, relative to
    /// the peak of direct light: at points between the nodes, of the coarse solution
    /// itself. Nobody sees it; what is gathered errs less.
    pub interpolation_error: f64,
    /// Elements with rows.
    pub n_elements: usize,
    /// Rows that were made, those of elements that were divided later too.
    pub n_rows: u64,
    /// Links of the rows there are.
    pub n_links: usize,
    /// Power balance; without bands if nothing was solved.
    pub power: Power,
    /// Raw row sums, one per receiver; none if nothing was solved.
    pub row_sums: Vec<RowSums>,
    forest: Forest,
    tolerance: f64,
}

/// Elements may miss this share of the tolerance for any point.
const EACH: f64 = 1.0;

/// Links may change what a node gathers by this share of the tolerance whatever they miss.
const LINK: f64 = 0.3;

/// Elements are divided for a point that they give an error above this share of the
/// tolerance.
const DIVIDE: f64 = 0.5;

/// The coarse solution is refined where it is interpolated worse than this many tolerances,
/// and wherever somebody sees so much of an element that it matters to them.
const COARSE: f64 = 3.0;

/// Elements smaller than this share of the scene may err more, in proportion to their size:
/// they are seen by little but themselves.
const SMALL: f64 = 0.05;

/// Elements smaller than this share of the scene are not divided.
const SMALLEST: f64 = 1e-4;

/// Sweeps end when they change nothing by more than this share of the tolerance, while the
/// solution is refined; and in the end by more than this, relative to the peak.
const ROUGHLY: f64 = 1e-2;
const CONVERGED: f64 = 1e-9;

/// Rounds of refinement.
const MOST_ROUNDS: usize = 12;

/// Where interpolation is looked at.
const CHECKS: [[f64; 3]; 4] = [
    [1.0 / 3.0; 3],
    [0.49, 0.49, 0.02],
    [0.02, 0.49, 0.49],
    [0.49, 0.02, 0.49],
];

/// Before anything is known of it, indirect light is taken to be this share of the mean of
/// what is reflected.
const AMBIENT: f64 = 0.3;

/// Solves for interreflection, coarsely.
///
/// * `receivers` — all faces of the scene in their order, cut along contacts.
/// * `direct` — direct light on the same faces.
#[must_use]
pub fn solve_transport(
    evaluator: &Evaluator<'_>,
    receivers: &[Receiver],
    direct: &DirectMeshes,
    options: &TransportOptions,
    control: &Control<'_>,
) -> Transport {
    let (scene, sampler) = (evaluator.scene(), direct.sampler());
    let mut work = Work {
        evaluator,
        forest: Forest::new(scene, receivers, &sampler),
        direct: sampler,
        options: *options,
        table: Table::default(),
        errors: Vec::new(),
        n_rows: 0,
    };
    let mut transport = work.rounds(control);
    if transport.reached.has_values() {
        transport.power = power(scene, &work.forest, &work.table);
        transport.row_sums = row_sums(&work.forest, &work.table);
    }
    smooth(&mut work.forest);
    transport.n_rows = work.n_rows;
    transport.n_links = work.table.n_links();
    transport.forest = work.forest;
    transport
}

struct Work<'a, 'e, 's> {
    evaluator: &'e Evaluator<'s>,
    direct: Sampler<'a>,
    options: TransportOptions,
    forest: Forest,
    table: Table,
    /// Of interpolation, per element; infinite before it was looked at.
    errors: Vec<f64>,
    n_rows: u64,
}

impl Work<'_, '_, '_> {
    fn demands(&self) -> Demands {
        Demands {
            each: EACH * self.options.tolerance,
            link: LINK * self.options.tolerance,
            divide: DIVIDE * self.options.tolerance,
        }
    }

    fn gathering(&self) -> Gathering<'_, '_> {
        Gathering {
            evaluator: self.evaluator,
            forest: &self.forest,
            allowed: self.options.tolerance,
            demands: self.demands(),
        }
    }

    /// Rounds until the solution is fine enough.
    fn rounds(&mut self, control: &Control<'_>) -> Transport {
        let stop = control.stop;
        let mut result = Transport {
            tolerance: self.options.tolerance,
            ..Transport::nothing()
        };
        self.forest.spread();
        self.forest.measure();
        self.guess();
        for round in 0..MOST_ROUNDS {
            (control.progress)(Phase::Radiosity, round as f64 / MOST_ROUNDS as f64);
            let receiving = self.forest.receiving();
            let gathering = Gathering {
                evaluator: self.evaluator,
                forest: &self.forest,
                allowed: self.options.tolerance,
                demands: self.demands(),
            };
            let Some(made) = self.table.complete(&gathering, &receiving, stop) else {
                break;
            };
            self.n_rows += made.n_rows;
            (result.sweeps, result.residual) =
                self.sweep(&receiving, ROUGHLY * self.options.tolerance, stop);
            self.forest.measure();
            result.reached = Reached::Unfinished;
            result.n_elements = receiving.len();
            let Some((worst, mut too_coarse)) = self.look(&receiving, stop) else {
                break;
            };
            result.interpolation_error = worst;
            too_coarse.extend(made.too_coarse);
            too_coarse.sort_unstable();
            too_coarse.dedup();
            let divided = self.to_divide(&receiving, &too_coarse);
            let wanted = too_coarse.len() + divided.len();
            if wanted == 0
                || round + 1 == MOST_ROUNDS
                || self.forest.elements.len() + 4 * wanted > self.options.most_elements
            {
                (result.sweeps, result.residual) = self.sweep(&receiving, CONVERGED, stop);
                self.forest.measure();
                result.reached = Reached::Finished;
                break;
            }
            self.divide(&too_coarse, &divided);
        }
        result
    }

    /// Elements are at least as bright as a guess of what indirect light will make them.
    fn guess(&mut self) {
        let forest = &mut self.forest;
        let n = forest.largest.len().max(1) as f64;
        let ambient = AMBIENT * forest.largest.iter().sum::<f64>() / n;
        for (largest, element) in forest.largest.iter_mut().zip(&forest.elements) {
            if !forest.sides[element.side as usize].is_black {
                *largest = largest.max(ambient);
            }
        }
    }

    /// Sweeps over all rows until nothing changes; their number, and the last change.
    fn sweep(&mut self, receiving: &[u32], residual: f64, stop: Stop<'_>) -> (usize, f64) {
        let n_bands = self.forest.n_bands;
        let width = super::basis::N * n_bands;
        let (mut sweeps, mut change) = (0, 0.0);
        while sweeps < self.options.most_sweeps {
            sweeps += 1;
            let values = self.table.gathered(&self.forest, receiving);
            change = 0.0f64;
            for (&e, values) in receiving.iter().zip(values) {
                let first = e as usize * width;
                let held = &mut self.forest.indirect[first..first + width];
                for (at, (held, value)) in held.iter_mut().zip(values).enumerate() {
                    let scale = self.forest.scale[at % n_bands];
                    change = change.max(scale * (value - *held).abs());
                    *held = value;
                }
            }
            self.forest.spread();
            if change <= residual || stop.is_wanted() {
                break;
            }
        }
        (sweeps, change)
    }

    /// Looks at how elements are interpolated that were not looked at before: the largest
    /// error of all, relative to the peak, and elements that are too coarse for a point
    /// between nodes. Nothing if it was stopped.
    fn look(&mut self, receiving: &[u32], stop: Stop<'_>) -> Option<(f64, Vec<u32>)> {
        self.errors
            .resize(self.forest.elements.len(), f64::INFINITY);
        let is_due = |&e: &u32| self.errors[e as usize] > self.options.tolerance;
        let todo: Vec<u32> = receiving.iter().copied().filter(is_due).collect();
        let gathering = self.gathering();
        let found: Vec<Option<(f64, Vec<u32>)>> = todo
            .par_iter()
            .map_init(GatherScratch::default, |scratch, &e| {
                if stop.is_wanted() {
                    return None;
                }
                scratch.too_coarse.clear();
                let error = error_of(&gathering, e, scratch);
                Some((error, scratch.too_coarse.clone()))
            })
            .collect();
        let mut too_coarse = Vec::new();
        for (e, found) in todo.into_iter().zip(found) {
            let (error, coarse) = found?;
            self.errors[e as usize] = error;
            too_coarse.extend(coarse);
        }
        let errors = &self.errors;
        self.forest.doubt(|e| errors[e as usize]);
        self.forest.measure();
        let all = receiving.iter().map(|&e| errors[e as usize]);
        Some((all.fold(0.0, f64::max), too_coarse))
    }

    /// The error of interpolation that an element may have whoever sees it, relative to the
    /// peak.
    fn allowed(&self, e: u32) -> f64 {
        let extent = self.evaluator.scene().extent;
        let size = self.forest.elements[e as usize].longest / extent;
        COARSE * self.options.tolerance * (SMALL / size).max(1.0)
    }

    /// Receiving elements that are to be divided: that err too much for anybody, or for
    /// those who see them.
    fn to_divide(&self, receiving: &[u32], too_coarse: &[u32]) -> Vec<u32> {
        let extent = self.evaluator.scene().extent;
        let is_above = |&e: &u32| {
            let is_missed = too_coarse.binary_search(&e).is_ok() && self.forest.errs_indirectly(e);
            (is_missed || self.errors[e as usize] > self.allowed(e))
                && self.forest.elements[e as usize].longest > SMALLEST * extent
        };
        receiving.iter().copied().filter(is_above).collect()
    }

    /// Divides elements that are seen too coarsely, and those that receive too coarsely:
    /// their quarters receive from now on.
    fn divide(&mut self, seen: &[u32], receiving: &[u32]) {
        let extent = self.evaluator.scene().extent;
        let mut all: Vec<u32> = seen.iter().chain(receiving).copied().collect();
        all.sort_unstable();
        all.dedup();
        all.retain(|&e| self.forest.elements[e as usize].longest > SMALLEST * extent);
        self.forest.divide(&all, &self.direct);
        for &e in receiving {
            let quarters = self.forest.elements[e as usize].quarters;
            if quarters != NONE {
                self.forest.elements[e as usize].is_receiving = false;
                for quarter in quarters..quarters + 4 {
                    self.forest.elements[quarter as usize].is_receiving = true;
                }
            }
        }
        self.table.forget(&self.forest);
        self.forest.spread();
        self.forest.measure();
    }
}

/// The largest difference between gathered and interpolated irradiance in an element.
fn error_of(gathering: &Gathering<'_, '_>, e: u32, scratch: &mut GatherScratch) -> f64 {
    let (forest, scene) = (gathering.forest, gathering.evaluator.scene());
    let mut worst = 0.0f64;
    for at in CHECKS {
        gathering.at(&place_of(scene, forest, e, at), scratch);
        let gathered = gathering.irradiance(&scratch.portions);
        for (band, gathered) in gathered.into_iter().enumerate() {
            let interpolated = forest.value(&forest.indirect, e, at, band);
            worst = worst.max(forest.scale[band] * (gathered - interpolated).abs());
        }
    }
    worst
}

impl Transport {
    /// Nothing was solved.
    #[must_use]
    pub fn nothing() -> Self {
        Self {
            reached: Reached::Nothing,
            sweeps: 0,
            residual: 0.0,
            interpolation_error: f64::INFINITY,
            n_elements: 0,
            n_rows: 0,
            n_links: 0,
            power: Power::default(),
            row_sums: Vec::new(),
            forest: Forest::empty(),
            tolerance: 0.0,
        }
    }

    /// Did the iteration end by itself?
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.reached == Reached::Finished && self.residual <= CONVERGED
    }

    /// Indirect irradiance per band of the coarse solution itself at a place in the chart of
    /// a receiver; `None` beside its elements, or if nothing was solved.
    #[must_use]
    pub fn interpolated(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>> {
        let forest = &self.forest;
        let point = forest.sides.get(receiver)?.chart.to_space(uv);
        let (element, at) = forest.find(receiver, point)?;
        let value = |band| forest.value(&forest.indirect, element, at, band);
        Some((0..forest.n_bands).map(value).collect())
    }

    /// Indirect irradiance per band at places, gathered with exact visibility; `None` for
    /// places that were not reached when it was stopped, and for all if nothing was solved.
    ///
    /// Places may lie on faces, with the limit from one side at contacts, or be free
    /// sensors with any normal.
    #[must_use]
    pub fn gather(
        &self,
        evaluator: &Evaluator<'_>,
        places: &[Place],
        control: &Control<'_>,
    ) -> Vec<Option<Vec<f64>>> {
        if !self.reached.has_values() {
            return vec![None; places.len()];
        }
        let gathering = Gathering {
            evaluator,
            forest: &self.forest,
            allowed: GATHERED * self.tolerance,
            demands: Demands {
                each: GATHERED * EACH * self.tolerance,
                link: GATHERED * LINK * self.tolerance,
                divide: f64::INFINITY,
            },
        };
        places
            .par_iter()
            .map_init(GatherScratch::default, |scratch, place| {
                (!control.stop.is_wanted()).then(|| {
                    gathering.at(place, scratch);
                    gathering.irradiance(&scratch.portions)
                })
            })
            .collect()
    }
}

/// What is gathered may err by this share of the tolerance in its links and cut-off.
const GATHERED: f64 = 1.0;
