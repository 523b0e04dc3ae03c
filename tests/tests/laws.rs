//! Laws that exact irradiance obeys in any scene, on random lattice scenes.
//!
//! Coordinates are multiples of 1/8, so edges are parallel, corners lie in planes
//! of other faces and boxes stand on the floor all the time. The points are off
//! the lattice: on a contact there is no single value.

use antumbra::SceneInput;
use antumbra::scene::SurfaceInput;
use antumbra_tests::motion::Motion;
use antumbra_tests::scenes::{
    Facing, add, add_box, add_horizontal, empty, exact, material, unoccluded,
};
use glam::{DVec3, dvec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The same scenes in every run; `LAWS_SEED` and `LAWS_CASES` look further.
fn laws() -> ProptestConfig {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u32>().ok());
    ProptestConfig {
        cases: number("LAWS_CASES").unwrap_or(256),
        rng_seed: RngSeed::Fixed(u64::from(number("LAWS_SEED").unwrap_or(1))),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

#[derive(Clone, Debug)]
enum Occluder {
    Box {
        min: [i32; 3],
        size: [i32; 3],
    },
    Parallelogram {
        origin: [i32; 3],
        u: [i32; 3],
        v: [i32; 3],
    },
}

/// A lamp in eighths: corner and sides, height, and the rise along x.
#[derive(Clone, Debug)]
struct Lamp {
    x: [i32; 2],
    y: [i32; 2],
    z: i32,
    rise: i32,
}

fn eighths(p: [i32; 3]) -> DVec3 {
    DVec3::from_array(p.map(|c| f64::from(c) / 8.0))
}

fn occluder() -> impl Strategy<Value = Occluder> {
    let place = [-10..=6i32, -10..=6i32, 0..=12i32];
    let step = || [-6..=6i32, -6..=6i32, -3..=6i32];
    prop_oneof![
        (place.clone(), [1..=6i32, 1..=6i32, 1..=6i32])
            .prop_map(|(min, size)| Occluder::Box { min, size }),
        (place, step(), step())
            .prop_filter("has an area", |(_, u, v)| eighths(*u).cross(eighths(*v))
                != DVec3::ZERO)
            .prop_map(|(origin, u, v)| Occluder::Parallelogram { origin, u, v }),
    ]
}

fn lamp(left: i32) -> impl Strategy<Value = Lamp> {
    (
        0..=3i32,
        2..=8i32,
        -8..=2i32,
        2..=8i32,
        19..=24i32,
        -2..=4i32,
    )
        .prop_map(move |(x, dx, y, dy, z, rise)| Lamp {
            x: [left + x, left + x + dx],
            y: [y, y + dy],
            z,
            rise,
        })
}

fn scene() -> impl Strategy<Value = SceneInput> {
    (
        lamp(-12),
        proptest::option::of(lamp(1)),
        proptest::collection::vec(occluder(), 2..=6),
    )
        .prop_map(|(first, second, occluders)| {
            let mut scene = empty();
            let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
            add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
            for (k, lamp) in std::iter::once(first).chain(second).enumerate() {
                let Lamp { x, y, z, rise } = lamp;
                let corners = [
                    [x[0], y[0], z],
                    [x[0], y[1], z],
                    [x[1], y[1], z + rise],
                    [x[1], y[0], z + rise],
                ];
                add(
                    &mut scene,
                    &format!("lamp{k}"),
                    "lamp",
                    &corners.map(eighths),
                );
            }
            for (k, occluder) in occluders.into_iter().enumerate() {
                let name = format!("occluder{k}");
                match occluder {
                    Occluder::Box { min, size } => {
                        let min = eighths(min);
                        add_box(&mut scene, &name, "grey", min, min + eighths(size));
                    }
                    Occluder::Parallelogram { origin, u, v } => {
                        let (o, u, v) = (eighths(origin), eighths(u), eighths(v));
                        add(&mut scene, &name, "grey", &[o, o + u, o + u + v, o + v]);
                    }
                }
            }
            scene
        })
}

/// Points of the floor a third of a cell off the lattice, in twentieths of a bit:
/// dyadic, so that they can be moved and scaled without rounding.
fn points() -> Vec<DVec3> {
    let off = 43_691.0 / 1_048_576.0;
    (-9..9)
        .step_by(3)
        .flat_map(|i| {
            (-9..9)
                .step_by(3)
                .map(move |j| (f64::from(i), f64::from(j)))
        })
        .map(|(i, j)| dvec3(i / 8.0 + off, j / 8.0 + off * 1.5, 0.0))
        .collect()
}

fn on_floor(scene: &SceneInput) -> Vec<f64> {
    exact(scene, "floor", &points())
}

/// The largest difference.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
}

fn moved(scene: &SceneInput, motion: &Motion) -> Vec<f64> {
    let points: Vec<DVec3> = points().into_iter().map(|p| motion.point(p)).collect();
    exact(&motion.scene(scene), "floor", &points)
}

proptest! {
    #![proptest_config(laws())]

    #[test]
    fn occluders_only_take_light_away(scene in scene()) {
        let bare = on_floor(&unoccluded(&scene, &["floor"]));
        for (e, most) in on_floor(&scene).iter().zip(&bare) {
            prop_assert!(*e >= 0.0 && *e <= most + 1e-15, "{e} is not in 0..={most}");
        }
    }

    #[test]
    fn one_more_occluder_adds_no_light(scene in scene(), k in 2usize..8) {
        let mut fewer = scene.clone();
        let last = fewer.surfaces.len() - 1;
        if fewer.surfaces[k.min(last)].material == "grey" {
            fewer.surfaces.remove(k.min(last));
        }
        for (e, most) in on_floor(&scene).iter().zip(on_floor(&fewer)) {
            prop_assert!(*e <= most + 1e-13, "{e} with, {most} without");
        }
    }

    #[test]
    fn rotation_changes_nothing(
        scene in scene(), x in -1.0..1.0f64, y in -1.0..1.0f64, z in 0.1..1.0f64, angle in 0.1..3.0f64
    ) {
        let motion = Motion::rotation(dvec3(x, y, z), angle);
        let off = difference(&on_floor(&scene), &moved(&scene, &motion));
        prop_assert!(off <= 1e-12, "off by {off:.1e}");
    }

    #[test]
    fn scaling_by_a_power_of_two_changes_no_bit(scene in scene(), exponent in -40..40i32) {
        let motion = Motion::scaling(f64::from(exponent).exp2());
        prop_assert_eq!(on_floor(&scene), moved(&scene, &motion));
    }

    #[test]
    fn scaling_by_three_changes_nothing(scene in scene()) {
        let off = difference(&on_floor(&scene), &moved(&scene, &Motion::scaling(3.0)));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn translation_changes_nothing(scene in scene(), by in [-999..999i32, -999..999i32, -999..999i32]) {
        let motion = Motion::translation(eighths(by));
        let off = difference(&on_floor(&scene), &moved(&scene, &motion));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn mirror_image_has_the_same_light(scene in scene()) {
        let off = difference(&on_floor(&scene), &moved(&scene, &Motion::mirror()));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn order_of_surfaces_and_corners_changes_nothing(scene in scene(), by in 1usize..7) {
        let mut other = scene.clone();
        other.surfaces.reverse();
        let n = other.surfaces.len();
        other.surfaces.rotate_left(by % n);
        for surface in &mut other.surfaces {
            let n = surface.vertices.len();
            surface.vertices.rotate_left(by % n);
        }
        let off = difference(&on_floor(&scene), &on_floor(&other));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn winding_of_occluders_changes_nothing(scene in scene()) {
        let mut other = scene.clone();
        for surface in other.surfaces.iter_mut().filter(|s| s.name.starts_with("occluder")) {
            surface.vertices.reverse();
        }
        let off = difference(&on_floor(&scene), &on_floor(&other));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn occluders_in_two_parts_hide_the_same(scene in scene()) {
        let other = in_triangles(&scene, "occluder");
        let off = difference(&on_floor(&scene), &on_floor(&other));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn emitters_in_two_parts_give_the_same(scene in scene()) {
        let other = in_triangles(&scene, "lamp");
        let off = difference(&on_floor(&scene), &on_floor(&other));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn occluder_twice_in_one_place_hides_the_same(scene in scene()) {
        let mut other = scene.clone();
        let last = other.surfaces.iter().rev().find(|s| s.name.starts_with("occluder")).cloned();
        other.surfaces.extend(last.map(|s| SurfaceInput { name: "again".to_owned(), ..s }));
        let off = difference(&on_floor(&scene), &on_floor(&other));
        prop_assert!(off <= 1e-13, "off by {off:.1e}");
    }

    #[test]
    fn what_lies_behind_the_receiver_changes_nothing(scene in scene()) {
        let mut other = scene.clone();
        add_box(&mut other, "below", "grey", dvec3(-1.0, -1.0, -1.0), dvec3(1.0, 0.5, -0.25));
        let off = difference(&on_floor(&scene), &on_floor(&other));
        prop_assert!(off <= 1e-15, "off by {off:.1e}");
    }

    #[test]
    fn irradiance_is_linear_in_exitance(scene in scene(), factor in 0.01..100.0f64) {
        let with = |first: f64, second: f64| {
            let mut scene = scene.clone();
            scene.materials =
                vec![material("grey", 0.5, 0.0), material("a", 0.0, first), material("b", 0.0, second)];
            for surface in &mut scene.surfaces {
                match surface.name.as_str() {
                    "lamp0" => surface.material = "a".to_owned(),
                    "lamp1" => surface.material = "b".to_owned(),
                    _ => {}
                }
            }
            on_floor(&scene)
        };
        let (both, first, second) = (with(1.0, factor), with(1.0, 0.0), with(0.0, 1.0));
        let sum: Vec<f64> = first.iter().zip(&second).map(|(a, b)| a + factor * b).collect();
        let off = difference(&both, &sum);
        prop_assert!(off <= 1e-13 * (1.0 + factor), "off by {off:.1e}");
    }
}

/// Every quadrilateral whose name starts so is cut along a diagonal.
fn in_triangles(scene: &SceneInput, name: &str) -> SceneInput {
    let mut cut = scene.clone();
    cut.surfaces = scene
        .surfaces
        .iter()
        .flat_map(|s| {
            let v = &s.vertices;
            let part = |suffix: &str, corners: &[DVec3]| SurfaceInput {
                name: format!("{}{suffix}", s.name),
                vertices: corners.to_vec(),
                ..s.clone()
            };
            if s.name.starts_with(name) && v.len() == 4 {
                vec![
                    part("/0", &[v[0], v[1], v[2]]),
                    part("/1", &[v[0], v[2], v[3]]),
                ]
            } else {
                vec![s.clone()]
            }
        })
        .collect();
    cut
}
