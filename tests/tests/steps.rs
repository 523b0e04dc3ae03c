//! Steps after meshing lower the true error, or say that they do not.

use antumbra::{
    AfterStep, Control, CurveOptions, Evaluator, EventKinds, Events, ExactLight, Generator,
    Options, Outcome, Scene, Scratch, Tolerance, values,
};
use antumbra_tests::cases::{build, fixture};
use antumbra_tests::meshes::triangles;
use rayon::prelude::*;

/// All that is written here, and what stands for real scenes.
const FIXTURES: [&str; 12] = [
    "basic/tilted-triangle",
    "basic/floating-box",
    "basic/two-triangles",
    "basic/l-shaped-lamp",
    "basic/plate-with-hole",
    "alignment/rectangle-under-rectangle",
    "alignment/wall-plane-through-lamp",
    "contact/box-on-floor",
    "contact/panel-on-wall",
    "penetration/crossing-triangles",
    "eee/stacked-triangles",
    "real/cornell-box",
];

fn mesh(scene: &Scene, events: Events, after: &[AfterStep]) -> Outcome {
    let options = Options {
        tolerance: Tolerance::Relative(2e-2),
        degree: Some(2),
        generator: Generator::Curves(CurveOptions {
            events,
            after: std::array::from_fn(|k| after.get(k).copied()),
        }),
        ..Options::default()
    };
    antumbra::mesh(scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{e}"))
}

/// Root mean square of the error at random places, relative to the peak.
fn rms(scene: &Scene, meshed: &Outcome) -> f64 {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let places = values::random_places(scene, 20_000, &|_| true);
    let squares: Vec<f64> = places
        .par_iter()
        .map_init(Scratch::default, |scratch, place| {
            let exact = values::exact(&light, place, scratch)[0];
            let found = values::on_mesh(&meshed.mesh, place).map_or(0.0, |v| v[0]);
            ((found - exact) / meshed.mesh.peak[0]).powi(2)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn lowers_the_error(step: AfterStep, events: Events) {
    let (mut n_applied, mut n_lower) = (0, 0);
    for name in FIXTURES {
        let scene = build(&fixture(name));
        let before = rms(&scene, &mesh(&scene, events, &[]));
        let meshed = mesh(&scene, events, &[step]);
        let after = rms(&scene, &meshed);
        let done = &meshed.improvements[0];
        assert!(
            after <= 1.01 * before,
            "{name}: {} took the true error from {before:.3e} to {after:.3e}",
            step.key()
        );
        assert!(
            done.rms_error[1] <= done.rms_error[0] && done.max_error[1] <= done.max_error[0],
            "{name}: {done:?}"
        );
        assert_eq!(
            done.reason.is_none(),
            done.n_improved > 0,
            "{name}: {done:?}"
        );
        for receiver in &meshed.mesh.receivers {
            triangles(receiver)
                .check()
                .unwrap_or_else(|e| panic!("{name}: {e}"));
        }
        n_applied += usize::from(done.reason.is_none());
        n_lower += usize::from(after < before);
    }
    assert!(
        10 * n_lower >= 9 * n_applied && 2 * n_applied >= FIXTURES.len(),
        "{} was applied to {n_applied} of {} fixtures and lowers the true error on {n_lower}",
        step.key(),
        FIXTURES.len()
    );
}

#[test]
fn relocation_lowers_the_true_error_of_refined_meshes() {
    lowers_the_error(AfterStep::Relocate, Events::Kinds(EventKinds::NONE));
}

#[test]
fn relocation_lowers_the_true_error_of_discontinuity_meshes() {
    lowers_the_error(AfterStep::Relocate, Events::OnDemand);
}

#[test]
fn splitting_lowers_the_true_error() {
    lowers_the_error(AfterStep::Split, Events::OnDemand);
}

#[test]
fn elevation_lowers_the_true_error() {
    lowers_the_error(AfterStep::Elevate, Events::OnDemand);
}

/// Vertices on contacts and borders stay on them: what is dark by geometry stays dark.
#[test]
fn relocation_opens_no_leak() {
    let scene = build(&fixture("contact/closed-box-lit-from-outside"));
    let meshed = mesh(&scene, Events::OnDemand, &[AfterStep::Relocate]);
    let plain = mesh(&scene, Events::OnDemand, &[]);
    for (moved, still) in meshed.mesh.receivers.iter().zip(&plain.mesh.receivers) {
        let is_dark = still.direct.iter().all(|&e| e == 0.0);
        if is_dark {
            assert!(moved.direct.iter().all(|&e| e == 0.0));
        }
        let area = triangles(moved).total_area();
        assert!((area - triangles(still).total_area()).abs() <= 1e-12 * area);
    }
}

#[test]
fn steps_are_carried_out_one_after_the_other() {
    let scene = build(&fixture("basic/tilted-triangle"));
    let all = [AfterStep::Split, AfterStep::Relocate, AfterStep::Elevate];
    let meshed = mesh(&scene, Events::OnDemand, &all);
    let steps: Vec<AfterStep> = meshed.improvements.iter().map(|i| i.step).collect();
    assert_eq!(steps, all);
    let rms = meshed.improvements.iter().map(|i| i.rms_error);
    for (now, next) in rms.clone().zip(rms.skip(1)) {
        assert!(next[0] <= 1.000_001 * now[1], "{now:?} then {next:?}");
    }
}
