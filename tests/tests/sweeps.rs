//! A degeneracy approached in steps down to 1e-15, and reached: irradiance is continuous
//! where it is in nature, and the mesh does not grow.

use antumbra::{Control, Ended, Options, SceneInput, Tolerance};
use antumbra_tests::cases::build;
use antumbra_tests::motion::Motion;
use antumbra_tests::scenes::{Facing, add, add_box, add_horizontal, empty, exact, points_on};
use glam::{DVec3, dvec3};
use rayon::prelude::*;

/// 1e-1, 7e-2, 5e-2, 3e-2, 2e-2, 1.5e-2, 1e-2, … 1e-15, and the degeneracy itself.
fn steps() -> Vec<f64> {
    let decades = (1..=15).map(|k| 10f64.powi(-k));
    let mut steps: Vec<f64> = decades
        .flat_map(|t| [1.0, 0.7, 0.5, 0.3, 0.2, 0.15].map(|x| x * t))
        .collect();
    steps.push(0.0);
    steps
}

/// The floor, and a lamp three metres above it.
fn lit() -> SceneInput {
    let mut scene = empty();
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let lamp = ([-0.5, 0.5], [-0.5, 0.5], 3.0);
    add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Down);
    scene
}

/// Points of the floor, on no line of the scenes.
fn points() -> Vec<DVec3> {
    points_on(dvec3(-1.9, -1.9, 0.0), DVec3::X * 3.8, DVec3::Y * 3.8, 200)
}

/// Both sides of the degeneracy: continuous light, and meshes that do not grow.
///
/// * `rate` — how fast irradiance may change with the parameter, in units of exitance.
fn sweep(name: &str, rate: f64, scene: impl Fn(f64) -> SceneInput + Sync) {
    is_continuous(name, rate, &scene);
    is_bounded(name, &scene);
}

/// Exact light at points of the floor goes to its limit at no more than this rate.
fn is_continuous(name: &str, rate: f64, scene: impl Fn(f64) -> SceneInput) {
    let values = |t: f64| exact(&scene(t), "floor", &points());
    let limit = values(0.0);
    for t in steps().into_iter().flat_map(|t| [t, -t]) {
        for ((p, e), l) in points().iter().zip(values(t)).zip(&limit) {
            assert!(e >= 0.0 && e.is_finite(), "{name} at {t:e}: {e} at {p}");
            assert!(
                (e - l).abs() <= rate * t.abs() + 1e-12,
                "{name} at {t:e}: {e} at {p}, {l} in the limit"
            );
        }
    }
}

/// Meshes reach the tolerance with no more than three times the elements and exact
/// evaluations of generic positions.
fn is_bounded(name: &str, scene: impl Fn(f64) -> SceneInput + Sync) {
    let sizes: Vec<(f64, usize, u64)> = steps()
        .into_par_iter()
        .flat_map_iter(|t| [t, -t])
        .map(|t| {
            let options = Options {
                tolerance: Tolerance::Relative(1e-3),
                most_elements: 100_000,
                ..Options::default()
            };
            let meshed = antumbra::mesh(&build(&scene(t)), &options, &Control::NEVER)
                .unwrap_or_else(|e| panic!("{name} at {t:e}: {e}"));
            assert!(
                matches!(
                    meshed.mesh.ended,
                    Ended::ToleranceReached | Ended::ResolutionReached
                ),
                "{name} at {t:e}: {:?}",
                meshed.mesh.ended
            );
            let receivers = meshed.mesh.receivers.iter();
            let evaluations = receivers.clone().map(|r| r.exact_evaluations).sum();
            (t, receivers.map(|r| r.n_elements()).sum(), evaluations)
        })
        .collect();
    // Generic positions: no nearer than a millimetre.
    let generic = sizes.iter().filter(|(t, ..)| t.abs() > 9e-4);
    let (most, most_evaluations) = generic.fold((0, 0), |(n, e), s| (n.max(s.1), e.max(s.2)));
    for (t, n, evaluations) in sizes {
        assert!(
            n <= 3 * most && evaluations <= 3 * most_evaluations,
            "{name} at {t:e}: {n} elements and {evaluations} evaluations, {most} and {most_evaluations} in generic positions"
        );
    }
}

#[test]
fn plate_tilts_through_the_horizontal() {
    sweep("tilt", 1.0, |t| {
        let mut scene = lit();
        let at = |x: f64, y: f64| dvec3(x, y, 1.0 + t * x);
        let plate = [
            at(-0.5, -0.25),
            at(0.75, -0.25),
            at(0.75, 0.5),
            at(-0.5, 0.5),
        ];
        add(&mut scene, "plate", "grey", &plate);
        scene
    });
}

#[test]
fn box_comes_down_to_the_floor_and_goes_through() {
    // Light gets under it, by as much as the gap is wide.
    sweep("height", 30.0, |t| {
        let mut scene = lit();
        add_box(
            &mut scene,
            "box",
            "grey",
            dvec3(-0.25, 0.0, t),
            dvec3(0.5, 0.5, 0.75),
        );
        scene
    });
}

#[test]
fn edge_passes_under_the_edge_of_the_lamp() {
    sweep("alignment", 1.0, |t| {
        let mut scene = lit();
        let plate = ([-0.5 + t, 0.25], [-0.25, 0.5], 1.0);
        add_horizontal(&mut scene, "plate", "grey", plate, Facing::Up);
        scene
    });
}

#[test]
fn box_turns_through_the_directions_of_the_lamp() {
    sweep("turn", 1.0, |t| {
        let mut scene = lit();
        let mut part = empty();
        add_box(
            &mut part,
            "box",
            "grey",
            dvec3(-0.25, -0.125, 0.5),
            dvec3(0.5, 0.5, 1.0),
        );
        let part = Motion::rotation(DVec3::Z, t).scene(&part);
        scene.surfaces.extend(part.surfaces);
        scene
    });
}

#[test]
fn wall_moves_through_the_edge_of_the_lamp() {
    sweep("wall", 1.0, |t| {
        let mut scene = lit();
        let x = 0.5 + t;
        let wall = [
            dvec3(x, -0.75, 0.5),
            dvec3(x, 0.75, 0.5),
            dvec3(x, 0.75, 1.5),
            dvec3(x, -0.75, 1.5),
        ];
        add(&mut scene, "wall", "grey", &wall);
        scene
    });
}

/// Between gaps of 1e-4 and 1e-7 the light on the faces that meet falls within a layer
/// as thin as the gap.
#[test]
fn two_boxes_meet() {
    sweep("meeting", 10.0, |t| {
        let mut scene = lit();
        add_box(
            &mut scene,
            "left",
            "grey",
            dvec3(-0.5, -0.25, 0.5),
            dvec3(0.0, 0.25, 1.0),
        );
        add_box(
            &mut scene,
            "right",
            "grey",
            dvec3(t, -0.125, 0.5),
            dvec3(0.5, 0.5, 1.0),
        );
        scene
    });
}

/// As in [`two_boxes_meet`], with a lamp: its light beside it. The top of the box has two
/// layers that cross.
#[test]
fn plate_rises_to_the_lamp() {
    // Points right under it see the lamp through the gap from the side only.
    sweep("rising", 10.0, |t| {
        let mut scene = lit();
        let plate = ([-0.75, 0.0], [-0.75, 0.25], 2.75 + 0.25 - 0.125 + t);
        add_horizontal(&mut scene, "plate", "grey", plate, Facing::Up);
        add_box(
            &mut scene,
            "box",
            "grey",
            dvec3(0.25, 0.25, 2.0),
            dvec3(0.5, 0.5, 3.0 + t),
        );
        scene
    });
}
