//! The engine against answers that were computed without it: `fixtures/validation`.

use antumbra::values;
use antumbra::{Control, Evaluator, ExactLight, Options, Scene, Scratch, Tolerance};
use antumbra_tests::cases::{Case, Probe, build, folder};
use rayon::prelude::*;

/// Meshing of these at the finer tolerances takes minutes with the checks on.
const COARSE_ONLY: [(&str, f64); 1] = [("H13", 1e-2)];

#[test]
fn hard_geometry_agrees_with_exact_rational_clipping() {
    agree("hard");
}

#[test]
fn closed_forms_are_met() {
    agree("closed-form");
}

#[test]
fn cie171_cases_agree() {
    agree("cie171");
}

#[test]
fn scenes_of_peers_agree() {
    agree("peers");
}

/// Judges all cases of a folder; the panic message is the table of what failed.
fn agree(name: &str) {
    let cases = folder(name);
    let failures: Vec<String> = cases.par_iter().flat_map_iter(judge).collect();
    assert!(
        failures.is_empty(),
        "{} failures in {} cases of {name}:\n  {}",
        failures.len(),
        cases.len(),
        failures.join("\n  ")
    );
}

fn judge(case: &Case) -> Vec<String> {
    assert_eq!(case.kind, "irradiance", "{}", case.id);
    let scene = build(&case.scene);
    let mut failures = judge_exact(case, &scene);
    for &tolerance in &case.tolerances {
        let is_left_out = COARSE_ONLY.iter().any(|&(id, t)| id == case.id && tolerance < t);
        if !is_left_out && let Err(says) = judge_mesh(case, &scene, tolerance) {
            failures.push(format!("{} at {tolerance:e}: {says}", case.id));
        }
    }
    failures
}

fn judge_exact(case: &Case, scene: &Scene) -> Vec<String> {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator);
    let mut scratch = Scratch::default();
    let peak = largest(&case.values);
    let allowed = case.atol_exact * if peak > 0.0 { peak } else { 1.0 };
    let mut failures = Vec::new();
    for (k, (probe, want)) in case.points.iter().zip(&case.values).enumerate() {
        let got = match probe {
            Probe::Surface(surface, point) => values::place(scene, surface, *point)
                .map(|place| values::exact(&light, &place, &mut scratch)),
            Probe::Free(point, normal) => {
                values::exact_free(&evaluator, *point, *normal, &mut scratch)
            }
        };
        match got {
            Ok(got) if (got[0] - want).abs() <= allowed => {}
            Ok(got) => failures.push(format!(
                "{} exact at point {k}: {} is not {want} (off by {:.1e} of the peak)",
                case.id,
                got[0],
                (got[0] - want).abs() / peak
            )),
            Err(error) => failures.push(format!("{} exact at point {k}: {error}", case.id)),
        }
    }
    // The first few tell the story.
    if failures.len() > 5 {
        let n_more = failures.len() - 5;
        failures.truncate(5);
        failures.push(format!("{}: {n_more} points more", case.id));
    }
    failures
}

fn judge_mesh(case: &Case, scene: &Scene, tolerance: f64) -> Result<(), String> {
    let options = Options { tolerance: Tolerance::Relative(tolerance), ..Options::default() };
    let meshed =
        antumbra::mesh(scene, &options, &Control::default()).map_err(|e| e.to_string())?;
    let want = largest(&case.values);
    let peak = largest(&meshed.direct.peak);
    if want == 0.0 {
        let lit = meshed.direct.receivers.iter().flat_map(|r| &r.direct).find(|&&v| v != 0.0);
        return lit.map_or(Ok(()), |v| Err(format!("a node has {v}, all is dark")));
    }
    if peak < want * (1.0 - 2.0 * tolerance) {
        return Err(format!("peak irradiance is {peak}, {want} was expected at a point"));
    }
    let mut errors = Vec::new();
    for (probe, want) in case.points.iter().zip(&case.values) {
        let Probe::Surface(surface, point) = probe else { continue };
        let place = values::place(scene, surface, *point).map_err(|e| e.to_string())?;
        let got = values::on_mesh(&meshed.direct, &place)
            .ok_or_else(|| format!("({point}) of '{surface}' is in no element"))?;
        errors.push((got[0] - want).abs() / peak);
    }
    errors.sort_by(f64::total_cmp);
    let n_excused = (case.wrong_side_fraction * errors.len() as f64).floor() as usize;
    let worst = errors[errors.len() - 1 - n_excused];
    let claimed = meshed.direct.measured_max_error;
    // NaN fails both.
    if worst <= 1.05 * tolerance && claimed <= tolerance {
        return Ok(());
    }
    let n_elements: usize = meshed.direct.receivers.iter().map(|r| r.n_elements()).sum();
    Err(format!(
        "worst {worst:.2e} of the peak ({n_excused} points excused), claimed {claimed:.2e}, {n_elements} elements, {:?}",
        meshed.direct.ended
    ))
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| f64::max(m, v.abs()))
}

/// Total irradiance in the first band at the points of a case, and what is known.
fn solved(case: &Case) -> Vec<(f64, f64)> {
    assert_eq!(case.kind, "radiosity", "{}", case.id);
    let scene = build(&case.scene);
    let solved = antumbra::solve(&scene, &Options::default(), &Control::default())
        .unwrap_or_else(|e| panic!("{}: {e}", case.id));
    case.points
        .iter()
        .zip(&case.values)
        .map(|(probe, &want)| {
            let Probe::Surface(surface, point) = probe else {
                panic!("{}: a mesh has no free sensors", case.id)
            };
            let place = values::place(&scene, surface, *point)
                .unwrap_or_else(|e| panic!("{}: {e}", case.id));
            let got = values::solved(&solved.radiosity, &place)
                .unwrap_or_else(|| panic!("{}: ({point}) is in no element", case.id));
            (got[0], want)
        })
        .collect()
}

fn worst_relative_to_peak(pairs: &[(f64, f64)]) -> f64 {
    let peak = pairs.iter().fold(0.0, |m, p| f64::max(m, p.1.abs()));
    pairs.iter().fold(0.0, |m, (got, want)| f64::max(m, (got - want).abs() / peak))
}

fn interreflection_agrees(id: &str) {
    let case = folder("radiosity").into_iter().find(|c| c.id == id).expect("the case is there");
    let worst = worst_relative_to_peak(&solved(&case));
    assert!(worst <= case.rtol, "{id}: worst {worst:.2e} of the peak, allowed {:.0e}", case.rtol);
}

#[test]
fn furnace_cube_has_radiosity_one_everywhere() {
    interreflection_agrees("R2a");
}

#[test]
fn furnace_room_with_reflex_corner_has_radiosity_one_everywhere() {
    interreflection_agrees("R2b");
}

#[test]
fn furnace_room_with_two_floating_cubes_has_radiosity_one_everywhere() {
    interreflection_agrees("R2c");
}

#[test]
fn empty_boxes_agree_with_the_continuous_solution() {
    for id in ["R6.1", "R6.2", "R6.3"] {
        interreflection_agrees(id);
    }
}

/// The answer is a path tracer's: its noise, and not the engine, sets the bound.
#[test]
fn cornell_box_agrees_with_path_tracing() {
    let mut cases = folder("radiosity");
    cases.retain(|c| c.id == "R8_cornell_planar");
    let pairs = solved(&cases[0]);
    let square: f64 = pairs.iter().map(|(got, want)| ((got - want) / want).powi(2)).sum();
    let rms = (square / pairs.len() as f64).sqrt();
    assert!(rms <= 0.02, "rms of the relative differences is {rms:.2e}: {pairs:?}");
}
