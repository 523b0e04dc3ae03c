//! The plan: its decisions, its bounds, and that runs follow it.

use antumbra::scene::SceneInput;
use antumbra::{
    Control, Decision, Evaluator, EventKind, EventKinds, Events, ExactLight, Options, Outcome,
    Plan, Quantity, Scene, Tolerance, values,
};
use antumbra_tests::cases::{build, fixture};
use antumbra_tests::random::SplitMix;
use glam::DVec3;

fn options(events: Events) -> Options {
    Options::with_events(events)
}

fn plan(scene: &Scene, quantity: Quantity) -> Plan {
    antumbra::plan(scene, &Options::default(), quantity, &Control::NEVER)
}

fn plan_of(outcome: &Outcome) -> &Plan {
    outcome.plan.as_ref().expect("meshes along curves have one")
}

/// Indirect light at one place.
fn gathered(outcome: &Outcome, evaluator: &Evaluator<'_>, at: [(usize, DVec3); 1]) -> f64 {
    let radiosity = outcome.radiosity.as_ref().expect("it was solved");
    let found = radiosity.gather(evaluator, &at, &Control::NEVER);
    found[0].as_ref().expect("nothing stops it")[0]
}

fn mesh(scene: &Scene, events: Events) -> Outcome {
    antumbra::mesh(scene, &options(events), &Control::NEVER).unwrap_or_else(|e| panic!("{e}"))
}

fn decision(plan: &Plan, name: &str) -> Decision {
    plan.effect(name)
        .unwrap_or_else(|| panic!("no effect '{name}'"))
        .decision
}

/// Fixtures of all kinds that are quick to mesh.
const FIXTURES: [&str; 10] = [
    "basic/unoccluded",
    "basic/tilted-triangle",
    "basic/two-triangles",
    "basic/floating-box",
    "basic/horizon-crosses-floor",
    "alignment/rectangle-under-rectangle",
    "contact/box-on-floor",
    "penetration/plate-through-floor",
    "eee/boxes-4",
    "eee/stacked-triangles",
];

#[test]
fn an_empty_shaft_needs_no_occlusion_and_no_curves() {
    let scene = build(&fixture("basic/unoccluded"));
    let plan = plan(&scene, Quantity::Direct);
    assert_eq!(decision(&plan, "occlusion"), Decision::Absent);
    assert_eq!(plan.curves.iter().sum::<u64>(), 0);
    let shadowed = build(&fixture("basic/floating-box"));
    let plan = antumbra::plan(
        &shadowed,
        &Options::default(),
        Quantity::Direct,
        &Control::NEVER,
    );
    assert_eq!(decision(&plan, "occlusion"), Decision::Simulated);
    assert_eq!(decision(&plan, "facet"), Decision::Simulated);
}

#[test]
fn meshing_does_what_the_plan_says() {
    for name in FIXTURES {
        let scene = build(&fixture(name));
        let plan = plan(&scene, Quantity::Direct);
        let meshed = mesh(&scene, Events::OnDemand);
        assert_eq!(plan.curves, meshed.events.active, "{name}");
        assert_eq!(plan.candidates, meshed.events.candidates, "{name}");
        for kind in EventKind::ALL {
            let (lines, inserted) = (
                plan.lines[kind as usize],
                meshed.events.inserted[kind as usize],
            );
            let carried_out = decision(plan_of(&meshed), kind.key());
            match decision(&plan, kind.key()) {
                Decision::Absent => assert_eq!(inserted, 0, "{name} {kind:?}"),
                Decision::Simulated => assert!(lines > 0, "{name} {kind:?}"),
                Decision::LeftOut => assert_eq!(
                    carried_out == Decision::Simulated,
                    inserted > 0,
                    "{name} {kind:?}"
                ),
            }
        }
        // Expected within a factor of five; of ten at contacts, to whose ends refinement
        // grades down. Small meshes apart.
        let expected = plan.expected.unwrap_or_else(|| panic!("{name}"));
        let took: u64 = meshed
            .mesh
            .receivers
            .iter()
            .map(|r| r.exact_evaluations)
            .sum();
        let ratio = expected.exact_evaluations / took as f64;
        let factor = match decision(&plan, "contact") {
            Decision::Absent => 5.0,
            _ => 10.0,
        };
        assert!(
            took < 500 || (1.0 / factor..=factor).contains(&ratio),
            "{name}: expected {}, took {took}",
            expected.exact_evaluations
        );
    }
}

/// Random points of all surfaces, in the units of the file.
fn points(scene: &SceneInput, n: usize) -> Vec<(String, DVec3)> {
    let mut random = SplitMix::new(7);
    (0..n)
        .map(|i| {
            let surface = &scene.surfaces[i % scene.surfaces.len()];
            let v = &surface.vertices;
            let k = 1 + (random.unit() * (v.len() - 2) as f64) as usize;
            let (mut s, mut t) = (random.unit(), random.unit());
            if s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            let [a, b, c] = [v[0], v[k], v[k + 1]];
            (surface.name.clone(), a + (b - a) * s + (c - a) * t)
        })
        .collect()
}

#[test]
fn switching_an_omitted_kind_of_event_on_changes_no_value_by_more_than_its_bound() {
    for name in FIXTURES {
        let input = fixture(name);
        let scene = build(&input);
        let auto = mesh(&scene, Events::OnDemand);
        let all = mesh(&scene, Events::Kinds(EventKinds::ALL));
        let peak = all.mesh.peak[0].max(auto.mesh.peak[0]);
        let bound = plan_of(&auto)
            .effects
            .iter()
            .filter(|e| EventKind::from_key(e.name).is_some())
            .map(|e| e.bound)
            .fold(0.0, f64::max)
            .max(2e-3);
        for (surface, point) in points(&input, 2000) {
            let Ok(place) = values::place(&scene, &surface, point) else {
                continue;
            };
            let value = |m: &Outcome| values::on_mesh(&m.mesh, &place).map(|v| v[0]);
            if let (Some(a), Some(b)) = (value(&auto), value(&all)) {
                assert!(
                    (a - b).abs() <= bound * peak,
                    "{name}: {a} with curves on demand, {b} with all, at {point} of {surface}"
                );
            }
        }
    }
}

#[test]
fn interreflection_is_left_out_where_its_bound_is_below_a_tenth_of_the_tolerance() {
    // A grey that brings 5e-5 of the peak at most.
    let mut input = fixture("basic/floating-box");
    for material in &mut input.materials {
        material.reflectance = vec![5e-5];
    }
    let scene = build(&input);
    let options = Options {
        tolerance: Tolerance::Relative(1e-3),
        ..Options::default()
    };
    let dark = plan(&scene, Quantity::Total);
    let effect = dark
        .effect("interreflection")
        .unwrap_or_else(|| panic!("no effect"));
    assert_eq!(effect.decision, Decision::LeftOut);
    assert!(effect.bound <= 1e-4 && effect.bound > 0.0);
    // Switched on by asking for a finer tolerance: no value changes by more.
    let off = antumbra::solve(&scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
    let fine = Options {
        tolerance: Tolerance::Relative(1e-5),
        degree: Some(3),
        ..options
    };
    let on = antumbra::solve(&scene, &fine, &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        decision(plan_of(&on), "interreflection"),
        Decision::Simulated
    );
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let peak = on.mesh.peak[0];
    let mut scratch = antumbra::Scratch::default();
    for (surface, point) in points(&input, 100) {
        let Ok(place) = values::place(&scene, &surface, point) else {
            continue;
        };
        let direct = light.at(place.face, place.point, &mut scratch)[0];
        let at = [(place.face.index(), place.point)];
        let total = |s: &antumbra::Outcome| direct + gathered(s, &evaluator, at);
        assert!((total(&on) - total(&off)).abs() <= effect.bound * peak * 1.01);
    }
    for mesh in &off.mesh.receivers {
        assert_eq!(mesh.direct, mesh.irradiance, "nothing is reflected");
    }
}

#[test]
fn bounces_carry_all_but_a_hundredth_of_the_tolerance() {
    let mut input = fixture("basic/floating-box");
    for material in &mut input.materials {
        material.reflectance = vec![0.5];
    }
    let plan = plan(&build(&input), Quantity::Total);
    let rest = 0.5f64.powi(plan.bounces as i32 + 1) / 0.5;
    let before = 0.5f64.powi(plan.bounces as i32) / 0.5;
    assert!(rest <= 1e-5 && before > 1e-5, "{} bounces", plan.bounces);
}

#[test]
fn on_demand_needs_fewer_evaluations_than_all_curves_or_none() {
    for (name, of_all, of_none) in [("eee/boxes-8", 0.5, 1.0), ("basic/two-triangles", 1.0, 0.5)] {
        let scene = build(&fixture(name));
        let evaluations = |events: Events, tolerance: f64| -> u64 {
            let options = Options {
                tolerance: Tolerance::Relative(tolerance),
                ..Options::with_events(events)
            };
            let meshed =
                antumbra::mesh(&scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
            meshed
                .mesh
                .receivers
                .iter()
                .map(|r| r.exact_evaluations)
                .sum()
        };
        let auto = evaluations(Events::OnDemand, 1e-3) as f64;
        let all = evaluations(Events::Kinds(EventKinds::ALL), 1e-3) as f64;
        let none = evaluations(Events::Kinds(EventKinds::NONE), 1e-3) as f64;
        assert!(
            auto <= of_all * all && auto <= of_none * none,
            "{name}: {auto} {all} {none}"
        );
        // The finer, the more lines save.
        let auto = evaluations(Events::OnDemand, 1e-4) as f64;
        let none = evaluations(Events::Kinds(EventKinds::NONE), 1e-4) as f64;
        assert!(auto <= 0.6 * none, "{name}: {auto} {none} at 1e-4");
    }
}
