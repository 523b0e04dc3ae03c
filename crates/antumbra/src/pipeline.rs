//! The verbs: from a scene to what is asked for.

use crate::cell_meshes::cell_meshes_for;
use crate::light::ExactLight;
use crate::options::{CellOptions, Generator, Mesher, Options};
use crate::outcome::{Error, EventCounts, Outcome, ReceiverCurves};
use crate::plan::{Plan, Quantity};
use crate::receiver::{Prepared, contact_receivers, count_inserted, prepare};
use crate::scout::Scout;
use crate::total_light::TotalLight;
use antumbra_geom::{Control, Phase, Stop};
use antumbra_scene::Scene;
use antumbra_solver::cells::Other;
use antumbra_solver::{
    DirectMeshes, DirectOptions, Ended, FactorOptions, FormFactors, Improvement, Light, Progress,
    Radiosity, RadiosityOptions, Receiver, Solution, Tolerance, form_factors, solve_radiosity,
};
use antumbra_visibility::{Evaluator, EventKinds};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Decides what a run will simulate, without meshing anything. If it was stopped, the
/// plan tells of the receivers that were looked at only.
#[must_use]
pub fn plan(scene: &Scene, options: &Options, quantity: Quantity, control: &Control<'_>) -> Plan {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, control);
    let scout = Scout::new(&evaluator, &light, options, control);
    Plan::new(scene, options, quantity, &scout)
}

/// Meshes a scene with exact direct irradiance: along its shadow boundaries, or with cells.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
pub fn mesh(scene: &Scene, options: &Options, control: &Control<'_>) -> Result<Outcome, Error> {
    if matches!(options.generator, Generator::Curves(_)) {
        (control.progress)(Phase::Events, 0.0);
    }
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, control);
    mesh_on(&evaluator, &light, &light, options, control)
}

/// The same, with what is prepared already.
///
/// * `driver` — the light that is meshed: direct light, or with what is gathered.
pub(crate) fn mesh_on(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    driver: &dyn Light,
    options: &Options,
    control: &Control<'_>,
) -> Result<Outcome, Error> {
    match options.generator {
        Generator::Curves(_) => {
            let mut ground =
                Ground::new(evaluator, light, options, Quantity::Direct, false, control)?;
            let receivers = std::mem::take(&mut ground.receivers);
            let (meshes, improvements) = ground.grow(receivers, driver, options, control);
            let finish = |meshes: DirectMeshes| (meshes.finish(), ());
            Ok(ground.outcome(meshes, improvements, finish).0)
        }
        Generator::Cells(cells) => {
            let (meshes, limit) = cell_meshes_for(evaluator, driver, options, &cells, control)?;
            Ok(Outcome {
                limit,
                ..Outcome::of_cells(meshes.finish())
            })
        }
    }
}

/// Meshes a scene and solves for interreflection.
///
/// With cells, the radiosity of patches is solved for first, on meshes of their own along
/// the shadow boundaries. Then every node gathers from the patches with exact visibility.
/// [`Mesher::Adaptive`] splits elements until irradiance *with* interreflection is within
/// the tolerance, and what is new gathers from the old radiosities; the others follow
/// direct light.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
///
/// # Source
///
/// Patches and elements: Cohen, Greenberg, Immel & Brock 1986.
pub fn solve(scene: &Scene, options: &Options, control: &Control<'_>) -> Result<Outcome, Error> {
    (control.progress)(Phase::Events, 0.0);
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, control);
    match options.generator {
        Generator::Curves(_) => {
            let (outcome, radiosity) = solve_curves(&evaluator, &light, options, control)?;
            Ok(Outcome {
                radiosity: Some(radiosity),
                ..outcome
            })
        }
        Generator::Cells(cells) => solve_cells(&evaluator, &light, options, &cells, control),
    }
}

/// Along the shadow boundaries.
fn solve_curves(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    options: &Options,
    control: &Control<'_>,
) -> Result<(Outcome, Radiosity), Error> {
    let mut ground = Ground::new(evaluator, light, options, Quantity::Total, false, control)?;
    let receivers = std::mem::take(&mut ground.receivers);
    let (meshes, improvements) = ground.grow(receivers, light, options, control);
    (control.progress)(Phase::Radiosity, 0.0);
    // Interreflection of a coarse mesh would be that of another scene.
    let layer = match meshes.ended() {
        Ended::Stopped => None,
        _ => contact_receivers(evaluator, control.stop)?,
    };
    let mut of_radiosity = RadiosityOptions {
        tolerance: match options.tolerance {
            Tolerance::Relative(t) => t,
            Tolerance::Absolute(_) => options.radiosity.tolerance,
        },
        ..options.radiosity
    };
    if !ground.plan.simulates("interreflection") {
        of_radiosity.most_sweeps = 0;
    }
    let mut outcome = ground.outcome(meshes, improvements, |meshes| {
        solve_radiosity(evaluator, meshes, layer, light, &of_radiosity, control)
    });
    if !outcome.1.reached.has_values() {
        outcome.0.plan = outcome.0.plan.map(Plan::without_interreflection);
    }
    Ok(outcome)
}

/// Interreflection alone, with what is prepared already.
pub(crate) fn radiosity_on(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    options: &Options,
    control: &Control<'_>,
) -> Result<Radiosity, Error> {
    Ok(solve_curves(evaluator, light, options, control)?.1)
}

fn solve_cells(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    options: &Options,
    cells: &CellOptions,
    control: &Control<'_>,
) -> Result<Outcome, Error> {
    let of_patches = Options {
        tolerance: match options.kept_tolerance() {
            Some(tolerance) => tolerance,
            None => Options::default().tolerance,
        },
        radiosity: options.radiosity,
        ..Options::default()
    };
    let patches = radiosity_on(evaluator, light, &of_patches, control)?;
    let total = TotalLight {
        direct: light,
        gatherer: patches.gatherer(evaluator, control.stop),
    };
    let is_solved = total.gatherer.is_some();
    let is_total = cells.mesher == Mesher::Adaptive && is_solved;
    let driver: &dyn Light = if is_total { &total } else { light };
    let (meshes, limit) = cell_meshes_for(evaluator, driver, options, cells, control)?;
    let other = if is_total {
        Other::Direct(light)
    } else {
        Other::Total(&total)
    };
    let mesh = if is_solved {
        meshes.finish_solved(other, control.stop)
    } else {
        meshes.finish()
    };
    drop(total);
    Ok(Outcome {
        limit,
        radiosity: Some(patches),
        ..Outcome::of_cells(mesh)
    })
}

/// The form factors between all surfaces of a scene, to a tolerance.
///
/// See [`form_factors`] for what they mean; [`export_factors`](crate::export_factors)
/// makes a table for the writers of [`crate::io`].
///
/// # Example
///
/// ```
/// use antumbra::{Control, FactorOptions, Scene, factors, io};
///
/// // Two unit squares, one above the other.
/// let text = r#"{ "antumbra": 1, "materials": { "m": {} }, "surfaces": [
///     { "name": "a", "material": "m", "vertices": [[0,0,0], [1,0,0], [1,1,0], [0,1,0]] },
///     { "name": "b", "material": "m", "vertices": [[0,0,1], [0,1,1], [1,1,1], [1,0,1]] } ] }"#;
/// let input = io::scene_file::read(text)?;
/// let scene = Scene::build(&input).map_err(|problems| format!("{problems:#?}"))?.scene;
/// let matrix = factors(&scene, &FactorOptions::default(), &Control::NEVER);
/// assert!((matrix.factor(0, 1) - 0.199_824_895_698_387_4).abs() < 1e-14);
/// assert_eq!(matrix.row_sums()[0], matrix.factor(0, 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn factors(scene: &Scene, options: &FactorOptions, control: &Control<'_>) -> FormFactors {
    (control.progress)(Phase::Factors, 0.0);
    form_factors(&Evaluator::new(scene), options, control)
}

/// What meshes along the shadow boundaries grow from.
pub(crate) struct Ground {
    pub(crate) receivers: Vec<Receiver>,
    curves: Vec<ReceiverCurves>,
    events: EventCounts,
    plan: Plan,
    /// Is there no room for more? Then nothing grows any more.
    is_full: bool,
}

impl Ground {
    /// * `has_strips` — lines where reflected light bends, too?
    pub(crate) fn new(
        evaluator: &Evaluator<'_>,
        light: &ExactLight<'_, '_>,
        options: &Options,
        quantity: Quantity,
        has_strips: bool,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        let mut scout = Scout::new(evaluator, light, options, control);
        let plan = Plan::new(evaluator.scene(), options, quantity, &scout);
        if has_strips {
            scout.add_strips(evaluator, control.stop);
        }
        let is_full = AtomicBool::new(scout.is_full);
        let should_stop = || is_full.load(Ordering::Relaxed) || control.stop.is_wanted();
        let has_room = |bytes| {
            let has_room = (control.has_room)(bytes);
            is_full.fetch_or(!has_room, Ordering::Relaxed);
            has_room
        };
        let preparation = Control {
            stop: Stop::new(&should_stop),
            has_room: &has_room,
            ..*control
        };
        if preparation.stop.is_wanted() {
            // No mesh will have them any more: their memory is needed for what comes.
            scout.forget_curves();
        }
        let events = EventCounts {
            candidates: plan.candidates,
            active: plan.curves,
            ..EventCounts::default()
        };
        (control.progress)(Phase::Arrangement, 0.0);
        let knows_all_curves = options.curves().events.kinds() == EventKinds::ALL;
        let allowed = scout.allowed;
        let prepared: Vec<Prepared> = scout
            .receivers
            .into_par_iter()
            .map(|r| prepare(evaluator, r, knows_all_curves, allowed, &preparation))
            .collect::<Result<_, _>>()?;
        let (receivers, curves) = prepared.into_iter().map(|p| (p.receiver, p.curves)).unzip();
        Ok(Self {
            receivers,
            curves,
            events,
            plan,
            is_full: is_full.into_inner(),
        })
    }

    /// Grows meshes of a light.
    pub(crate) fn grow(
        &self,
        receivers: Vec<Receiver>,
        driver: &dyn Light,
        options: &Options,
        control: &Control<'_>,
    ) -> (DirectMeshes, Vec<Improvement>) {
        let should_stop = || self.is_full || control.stop.is_wanted();
        let control = &Control {
            stop: Stop::new(&should_stop),
            ..*control
        };
        (control.progress)(Phase::Irradiance, 0.0);
        let direct_options = DirectOptions {
            tolerance: options.tolerance,
            degree: options.chosen_degree(),
            most_elements: options.most_elements,
            verify: true,
        };
        let mut meshes = DirectMeshes::solve(receivers, driver, &direct_options, control);
        let steps = options.curves().after.into_iter().flatten();
        let improvements = match meshes.ended() {
            // There is no time to try.
            Ended::Stopped => Vec::new(),
            _ => steps
                .map(|step| meshes.improve(step, driver, options.most_elements, control))
                .collect(),
        };
        (meshes, improvements)
    }

    /// What is told of the meshes that grew, and what comes with finishing them.
    pub(crate) fn outcome<T>(
        mut self,
        meshes: DirectMeshes,
        improvements: Vec<Improvement>,
        finish: impl FnOnce(DirectMeshes) -> (Solution, T),
    ) -> (Outcome, T) {
        for (progress, curves) in meshes.progress().zip(&mut self.curves) {
            if matches!(progress, Progress::BorderOnly | Progress::Nothing) {
                curves.critical = Vec::new();
            }
        }
        for (mesh, curves) in meshes.meshes().zip(&self.curves) {
            count_inserted(mesh, curves, &mut self.events.inserted);
        }
        let is_stopped = meshes.ended() == Ended::Stopped;
        let (mesh, rest) = finish(meshes);
        let outcome = Outcome {
            plan: Some(self.plan.carried_out(&self.events.inserted, is_stopped)),
            mesh,
            radiosity: None,
            curves: self.curves,
            events: self.events,
            limit: None,
            improvements,
        };
        (outcome, rest)
    }
}
