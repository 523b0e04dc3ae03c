//! Random scenes on a lattice, where contacts, alignments and coplanar faces are the
//! rule: laws of exact light; no panic, sound meshes, no value below 0 or above that
//! without occluders.
//!
//! `ANTUMBRA_SCENES` asks for more scenes, `ANTUMBRA_FIRST` for others.

use antumbra::geom::Stop;
use antumbra::scene::FaceId;
use antumbra::solver::{Light, Sample};
use antumbra::{
    Control, Ended, Evaluator, EventKinds, Events, ExactLight, Options, ReceiverMesh, Scene,
};
use antumbra_tests::lattice::{lattice_scene, laws, varied_scene};
use antumbra_tests::meshes::triangles;
use antumbra_tests::scenes::unoccluded;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The numbers of the scenes of a run.
fn numbers(usual: u64) -> std::ops::Range<u64> {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse().ok());
    let first = number("ANTUMBRA_FIRST").unwrap_or(0);
    first..first + number("ANTUMBRA_SCENES").unwrap_or(usual)
}

/// Runs a check on all scenes; panics with the numbers of those that failed and how.
fn on_all(usual: u64, check: impl Fn(u64) -> Result<bool, String> + Sync) {
    let outcomes: Vec<(u64, Result<bool, String>)> = numbers(usual)
        .into_par_iter()
        .map(|number| {
            let outcome = catch_unwind(AssertUnwindSafe(|| check(number)));
            (
                number,
                outcome.unwrap_or_else(|_| Err("a panic".to_owned())),
            )
        })
        .collect();
    let n_accepted = outcomes.iter().filter(|(_, o)| *o != Ok(false)).count();
    let failed: Vec<String> = outcomes
        .iter()
        .filter_map(|(n, o)| o.as_ref().err().map(|e| format!("scene {n}: {e}")))
        .collect();
    assert!(
        failed.is_empty(),
        "{} of {} scenes fail:\n{}",
        failed.len(),
        outcomes.len(),
        failed[..failed.len().min(200)].join("\n")
    );
    assert!(
        n_accepted * 10 >= outcomes.len() * 9,
        "only {n_accepted} of {} scenes were accepted",
        outcomes.len()
    );
}

#[test]
fn laws_hold_on_lattice_scenes() {
    on_all(1_000, |number| {
        laws(&lattice_scene(number), number)
            .map(|n| n.is_some())
            .map_err(|broken| format!("{}: {}", broken.law, broken.what))
    });
}

#[test]
fn meshes_of_lattice_scenes_are_sound() {
    on_all(100, mesh_is_sound);
}

/// What earlier versions failed on, among 100,000 scenes.
#[test]
fn scenes_that_broke_the_mesh_stay_sound() {
    for (number, phenomenon) in [
        (
            934,
            "a curve postponed along a contact has an unbounded jump",
        ),
        (
            18_976,
            "lines become parallel to the receiver where its border crosses them",
        ),
        (
            23_102,
            "a lamp is shut in by a box, up to 1e-16 of its light",
        ),
        (31_607, "a run-time check failed"),
        (33_706, "as 18976"),
        (35_441, "as 18976"),
        (45_241, "a node settles out of what its lamp lights"),
    ] {
        if let Err(error) = mesh_is_sound(number) {
            panic!("scene {number} ({phenomenon}): {error}");
        }
    }
}

/// Meshes a scene: no panic, sound triangles, values between 0 and those without
/// occluders.
fn mesh_is_sound(number: u64) -> Result<bool, String> {
    let input = varied_scene(number);
    let Ok(built) = Scene::build(&input) else {
        return Ok(false);
    };
    let scene = built.scene;
    let events = match number % 4 {
        0 => Events::Kinds(EventKinds::ALL),
        _ => Events::OnDemand,
    };
    let options = Options {
        tolerance: antumbra::Tolerance::Relative(3e-2),
        ..Options::with_events(events)
    };
    let meshed = antumbra::mesh(&scene, &options, &Control::NEVER).map_err(|e| e.to_string())?;
    let ended = meshed.mesh.ended;
    if !matches!(ended, Ended::ToleranceReached | Ended::ResolutionReached) {
        return Err(format!("ended with {ended:?}"));
    }
    for mesh in &meshed.mesh.receivers {
        triangles(mesh).check().map_err(|e| e.to_string())?;
        let name = &scene.surface_of(mesh.face).name;
        let open = Scene::build(&unoccluded(&input, &[name]))
            .map_err(|problems| format!("{problems:?}"))?
            .scene;
        let evaluator = Evaluator::new(&open);
        let light = ExactLight::new(&evaluator, &Control::NEVER);
        let mut scratch = antumbra::Scratch::default();
        let Some(surface) = open.surface_named(name) else {
            continue;
        };
        let face = FaceId(open.surfaces[surface.index()].faces.start);
        for (uv, &e) in mesh.nodes.iter().zip(&mesh.direct) {
            let x = mesh.chart.to_space(*uv);
            let x = open.frame.to_scene(scene.frame.to_file(x));
            let most = light.at(face, x, &mut scratch)[0] + 1e-9;
            if e >= 0.0 && e <= most {
                continue;
            }
            // Nodes that touch something lie on it, within the contact radius.
            let limit = limit(mesh, face, x, &light) + 1e-6;
            if !(e >= 0.0 && e <= limit) {
                return Err(format!("{e} of {limit} on {name} at {x}"));
            }
        }
    }
    Ok(true)
}

/// The largest limit of `light` at a point, over directions of approach: where a lamp
/// touches it, there is no value but limits. At a lamp's corner they take all values up
/// to that of a lamp all over the sky.
fn limit(mesh: &ReceiverMesh, face: FaceId, point: DVec3, light: &dyn Light) -> f64 {
    let samples: Vec<Sample> = (0..360)
        .map(|k| {
            let (sin, cos) = (0.3 + f64::from(k)).to_radians().sin_cos();
            let toward = Some(mesh.chart.direction(DVec2::new(cos, sin)));
            Sample { point, toward }
        })
        .collect();
    let values = [1e-9, 1e-7, 1e-6].map(|radius| {
        light
            .irradiance(face, &samples, radius, Stop::NEVER)
            .unwrap_or_default()
            .values
    });
    let (lo, hi) = values
        .into_iter()
        .flatten()
        .fold((f64::INFINITY, 0.0), |(lo, hi), v: f64| {
            (v.min(lo), v.max(hi))
        });
    if hi - lo > 1e-3 { 1.0 } else { hi }
}
