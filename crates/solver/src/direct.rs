//! Direct irradiance on the mesh, to a tolerance that is measured.
//!
//! Nodes hold exact values. Points that are no nodes are evaluated too, to
//! measure what interpolation costs; elements above the tolerance are bisected
//! until the whole scene is below it.

use crate::field::{Field, Light, Receiver, confirm};
use crate::scale::{Scale, Tolerance};
use crate::solution::{Ended, Progress, ReceiverMesh, Solution};
use antumbra_geom::DVec2;
use antumbra_geom::{Control, Phase, Stop};
use antumbra_mesh::{Locator, TriMesh};
use rayon::prelude::*;

/// How to mesh direct light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectOptions {
    /// The error allowed anywhere.
    pub tolerance: Tolerance,
    /// Degree of the elements, 1 to 4.
    pub degree: u8,
    /// No more elements than this.
    pub most_elements: usize,
    /// Measure the error at a second set of points when all is within the
    /// tolerance, and go on where it is not?
    pub verify: bool,
}

/// No element longer than this fraction of its receiver's diagonal: so that no
/// feature the curves do not tell of hides in one element.
const COARSEST: f64 = 0.5;

/// Are all of them true? Unlike rayon's own, looks at every one.
fn all(done: impl ParallelIterator<Item = bool>) -> bool {
    done.reduce(|| true, |a, b| a && b)
}

/// Meshes with direct light that may still be refined.
#[derive(Debug)]
pub struct DirectMeshes {
    pub(crate) fields: Vec<Field>,
    pub(crate) scale: Scale,
    tolerance: Tolerance,
    ended: Ended,
    /// Places of the last look per weight; 0 before the first.
    look_density: f64,
}

impl DirectMeshes {
    /// Values on all receivers to the tolerance.
    ///
    /// Progress is the share of elements that is within the tolerance.
    pub fn solve(
        receivers: Vec<Receiver>,
        light: &dyn Light,
        options: &DirectOptions,
        control: &Control<'_>,
    ) -> Self {
        let stop = control.stop;
        let mut fields: Vec<Field> = receivers
            .into_par_iter()
            .map(|r| Field::new(r, light, options.degree, stop))
            .collect();
        fields.par_iter_mut().for_each(|field| {
            if !field.is_dark && !field.knows_all_curves() {
                field.coarsest(COARSEST, stop);
            }
        });
        let mut meshes = Self {
            scale: Scale::new(light.n_bands()),
            fields,
            tolerance: options.tolerance,
            ended: Ended::ToleranceReached,
            look_density: 0.0,
        };
        let mut is_stopped = !meshes.evaluate(light, stop) || stop.is_wanted();
        if is_stopped {
            meshes.round_off(light, control.at_once);
        }
        loop {
            let n_elements = meshes.n_elements();
            let mut levels = meshes.levels();
            let count = |levels: &[Vec<u8>]| levels.iter().flatten().filter(|&&l| l > 0).count();
            if count(&levels) == 0 && options.verify && !is_stopped {
                let allowed = meshes.allowed();
                is_stopped = !all(meshes
                    .fields
                    .par_iter_mut()
                    .map(|field| field.verify(light, &allowed, stop)));
                meshes.gather_peak();
                levels = meshes.levels();
                if count(&levels) == 0 && !is_stopped {
                    is_stopped = !meshes.confirm(light, stop);
                    levels = meshes.levels();
                }
            }
            let n_marked = count(&levels);
            (control.progress)(
                Phase::Irradiance,
                1.0 - n_marked as f64 / n_elements.max(1) as f64,
            );
            meshes.ended = if is_stopped {
                Ended::Stopped
            } else if n_marked == 0 {
                Ended::ToleranceReached
            } else if n_elements + n_marked > options.most_elements {
                Ended::TooManyElements
            } else if stop.is_wanted() {
                Ended::Stopped
            } else {
                is_stopped = !meshes.refine(levels, light, stop);
                continue;
            };
            meshes.tell_progress(&levels, options.verify);
            return meshes;
        }
    }

    /// Measures the error of all elements at places that were not looked at before: so
    /// many as are worth a small part of the evaluations so far. Returns whether it was
    /// done.
    fn confirm(&mut self, light: &dyn Light, stop: Stop<'_>) -> bool {
        let allowed = self.allowed();
        let weights: Vec<f64> = self
            .fields
            .par_iter()
            .map(|field| field.look_weights(&allowed))
            .collect();
        let weight: f64 = weights.iter().sum();
        if self.look_density == 0.0 {
            let n_evaluations: u64 = self.fields.iter().map(|f| f.n_evaluations).sum();
            if weight > 0.0 {
                self.look_density = confirm::SHARE * n_evaluations as f64 / weight;
            }
        }
        let density = self.look_density;
        let is_done = all(self
            .fields
            .par_iter_mut()
            .map(|field| field.confirm(light, &allowed, density, stop)));
        self.gather_peak();
        is_done
    }

    /// Says of every receiver how far it got.
    fn tell_progress(&mut self, levels: &[Vec<u8>], verify: bool) {
        let is_stopped = self.ended == Ended::Stopped;
        for (field, levels) in self.fields.iter_mut().zip(levels) {
            let is_done = levels.iter().all(|&l| l == 0) && (!verify || field.is_verified());
            if field.progress == Progress::Unfinished && (is_done || !is_stopped) {
                field.progress = Progress::Finished;
            }
        }
    }

    /// Evaluates what is new and brings the peak up to date. Returns whether all is
    /// evaluated: receivers that were stopped are as before.
    pub(crate) fn evaluate(&mut self, light: &dyn Light, stop: Stop<'_>) -> bool {
        let is_done = all(self
            .fields
            .par_iter_mut()
            .map(|field| field.evaluate(light, stop)));
        self.gather_peak();
        is_done
    }

    /// Gives receivers without any values meshes of their borders alone; those for which
    /// there is no time have no elements. The largest come first.
    fn round_off(&mut self, light: &dyn Light, stop: Stop<'_>) {
        let mut left: Vec<&mut Field> = self
            .fields
            .iter_mut()
            .filter(|field| field.nodes.is_empty())
            .collect();
        left.sort_by(|a, b| b.size.total_cmp(&a.size));
        left.into_par_iter().for_each(|field| {
            if stop.is_wanted() {
                field.clear();
                return;
            }
            field.fall_back();
            if !field.evaluate(light, stop) {
                field.clear();
            }
        });
        self.gather_peak();
    }

    fn levels(&self) -> Vec<Vec<u8>> {
        let allowed = self.allowed();
        self.fields.par_iter().map(|f| f.levels(&allowed)).collect()
    }

    pub(crate) fn gather_peak(&mut self) {
        self.scale
            .gather(self.fields.iter().map(|field| &field.scale));
    }

    /// Refines, and evaluates what is new. Returns whether all is evaluated: receivers
    /// that were stopped are as before.
    pub(crate) fn refine(
        &mut self,
        levels: Vec<Vec<u8>>,
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> bool {
        let allowed = self.allowed();
        let is_done = all(self
            .fields
            .par_iter_mut()
            .zip(levels)
            .map(|(field, mut levels)| {
                if levels.iter().all(|&l| l == 0) {
                    return true;
                }
                if stop.is_wanted() {
                    return false;
                }
                let before = field.snapshot();
                field.cut(&mut levels, &allowed);
                field.refine(levels, &allowed, stop);
                let is_done = field.evaluate(light, stop);
                if !is_done {
                    field.restore(before);
                }
                is_done
            }));
        self.gather_peak();
        is_done
    }

    /// The error allowed in each band, in the scene's units.
    pub(crate) fn allowed(&self) -> Vec<f64> {
        self.scale.allowed(self.tolerance)
    }

    /// Largest irradiance so far, in any band.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.scale.peak.iter().copied().fold(0.0, f64::max)
    }

    /// How far every receiver got.
    pub fn progress(&self) -> impl Iterator<Item = Progress> {
        self.fields.iter().map(|f| f.progress)
    }

    /// A step after refinement was stopped.
    pub(crate) fn set_stopped(&mut self) {
        self.ended = Ended::Stopped;
    }

    /// Why refinement ended.
    #[must_use]
    pub fn ended(&self) -> Ended {
        self.ended
    }

    /// The mesh of every receiver, and the number of its curves.
    pub fn meshes(&self) -> impl Iterator<Item = (&TriMesh, usize)> {
        self.fields.iter().map(|f| (&f.mesh, f.orders.len()))
    }

    /// Elements of all receivers.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        self.fields.iter().map(|f| f.mesh.triangles.len()).sum()
    }

    /// Prepared to be asked for values between the nodes.
    pub(crate) fn sampler(&self) -> Sampler<'_> {
        Sampler {
            meshes: self,
            locators: self
                .fields
                .par_iter()
                .map(|f| Locator::new(&f.mesh))
                .collect(),
        }
    }

    /// Packs meshes of total irradiance, with direct light at the same nodes.
    ///
    /// * `light` — direct light; if it is stopped, `coarse` tells of it.
    /// * `coarse` — meshes of direct light alone.
    #[must_use]
    pub fn finish_total(self, light: &dyn Light, coarse: &Self, stop: Stop<'_>) -> Solution {
        let sampler = coarse.sampler();
        let mut meshes = self;
        let direct: Vec<Vec<f64>> = meshes
            .fields
            .par_iter()
            .enumerate()
            .map(|(r, field)| {
                let exact = field.at_nodes(light, stop);
                exact.unwrap_or_else(|| {
                    let nodes = field.nodes.iter();
                    nodes.flat_map(|&uv| sampler.at(r, uv)).collect()
                })
            })
            .collect();
        let totals = meshes
            .fields
            .iter_mut()
            .zip(direct)
            .map(|(field, direct)| std::mem::replace(&mut field.direct, direct))
            .collect();
        meshes.finish_with(Some(totals))
    }

    /// Packs meshes of direct light with indirect irradiance that is known elsewhere.
    ///
    /// * `indirect` — per band, at a place of a receiver.
    #[must_use]
    pub fn finish_with_indirect(
        self,
        indirect: &(dyn Fn(usize, DVec2) -> Option<Vec<f64>> + Sync),
    ) -> Solution {
        let totals = self
            .fields
            .par_iter()
            .enumerate()
            .map(|(r, field)| field.with_indirect(|uv| indirect(r, uv)))
            .collect();
        self.finish_with(Some(totals))
    }

    /// Packs the meshes and sums up what was measured.
    ///
    /// * `totals` — irradiance with interreflection on the nodes of every
    ///   receiver, if there is any.
    pub(crate) fn finish_with(self, totals: Option<Vec<Vec<f64>>>) -> Solution {
        let (allowed, scale) = (self.allowed(), self.scale.per_band());
        let totals: Vec<Option<Vec<f64>>> = match totals {
            Some(totals) => totals.into_iter().map(Some).collect(),
            None => vec![None; self.fields.len()],
        };
        let receivers: Vec<ReceiverMesh> = self
            .fields
            .into_par_iter()
            .zip(totals)
            .map(|(f, total)| f.finish(&allowed, &scale, total.as_deref()))
            .collect();
        let is_above = receivers.iter().any(|r| r.n_above > r.unresolved.len());
        let ended = match self.ended {
            Ended::ToleranceReached if is_above => Ended::ResolutionReached,
            ended => ended,
        };
        Solution::new(receivers, self.scale.peak, ended)
    }

    /// Packs the meshes and sums up what was measured.
    #[must_use]
    pub fn finish(self) -> Solution {
        self.finish_with(None)
    }
}

/// Values of meshes between their nodes.
pub(crate) struct Sampler<'a> {
    meshes: &'a DirectMeshes,
    locators: Vec<Locator>,
}

impl Sampler<'_> {
    /// Largest irradiance per band.
    pub(crate) fn peak(&self) -> &[f64] {
        &self.meshes.scale.peak
    }

    /// Does no light fall on a receiver?
    pub(crate) fn is_dark(&self, receiver: usize) -> bool {
        self.meshes.fields[receiver].is_dark
    }

    /// Interpolated irradiance per band; 0 outside of the mesh.
    pub(crate) fn at(&self, receiver: usize, uv: DVec2) -> Vec<f64> {
        let field = &self.meshes.fields[receiver];
        let found = self.locators[receiver].locate(&field.mesh, uv);
        let value = |band| match found {
            // Polynomials overshoot a little where light ends; light does not.
            Some((t, at)) => field.value(&field.direct, t as usize, at, band).max(0.0),
            None => 0.0,
        };
        (0..field.n_bands).map(value).collect()
    }
}
