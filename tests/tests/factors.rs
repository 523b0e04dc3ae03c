//! Form factors between surfaces: cases with known answers, and the laws they obey.

use antumbra::{
    Control, Evaluator, ExactLight, FactorOptions, FormFactors, SceneInput, Scratch, Stop,
};
use antumbra::{factors, values};
use antumbra_tests::cases::{build, factor_cases, fixture};
use antumbra_tests::motion::Motion;
use antumbra_tests::scenes::{
    Facing, add, add_box, add_horizontal, add_room, empty, material, place,
};
use glam::{DVec3, dvec3};

fn matrix(scene: &SceneInput) -> FormFactors {
    factors(&build(scene), &FactorOptions::default(), &Control::NEVER)
}

fn at(matrix: &FormFactors, from: &str, to: &str) -> f64 {
    matrix.factor(index(matrix, from), index(matrix, to))
}

fn index(matrix: &FormFactors, name: &str) -> usize {
    let position = matrix.names.iter().position(|n| n == name);
    position.unwrap_or_else(|| panic!("there is no surface {name}"))
}

/// A room of 4 × 3 × 2 with a box on the floor, one in the air, and a tilted
/// two-sided plate that touches a wall.
fn furnished_room() -> SceneInput {
    let mut scene = empty();
    let mut plate = material("plate", 0.5, 0.0);
    plate.two_sided = true;
    scene.materials.push(plate);
    add_room(
        &mut scene,
        "room",
        "grey",
        DVec3::ZERO,
        dvec3(4.0, 3.0, 2.0),
    );
    let size = dvec3(1.0, 0.75, 1.25);
    for (name, corner) in [
        ("standing", dvec3(0.5, 0.5, 0.0)),
        ("hanging", dvec3(2.5, 1.5, 0.5)),
    ] {
        add_box(&mut scene, name, "grey", corner, corner + size);
    }
    let plate = [
        dvec3(0.0, 1.5, 1.0),
        dvec3(0.0, 2.5, 1.0),
        dvec3(0.75, 2.5, 1.5),
        dvec3(0.75, 1.5, 1.5),
    ];
    add(&mut scene, "plate", "plate", &plate);
    scene
}

/// A floor of 2 × 2, a lamp of 1 × 1 over it, and a plate between that leaves part
/// of every point's view.
fn shaded_floor() -> SceneInput {
    let mut scene = empty();
    let floor = ([-1.0, 1.0], [-1.0, 1.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let lamp = ([-0.5, 0.5], [-0.5, 0.5], 2.0);
    add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Down);
    let plate = [
        dvec3(-0.5, -0.25, 1.0),
        dvec3(0.75, -0.5, 1.25),
        dvec3(0.25, 0.5, 0.75),
    ];
    add(&mut scene, "plate", "grey", &plate);
    scene
}

#[test]
fn known_factors_are_met() {
    for case in factor_cases() {
        let matrix = matrix(&case.scene);
        let mut n_judged = 0;
        for (from, row) in case.names.iter().zip(&case.factors) {
            for (to, expected) in case.names.iter().zip(row) {
                let Some(expected) = expected else { continue };
                let factor = at(&matrix, from, to);
                assert!(
                    (factor - expected).abs() <= case.atol,
                    "{}: {from} to {to} is {factor}, expected {expected} ± {}",
                    case.id,
                    case.atol
                );
                n_judged += 1;
            }
        }
        assert!(n_judged > 0, "{}: no factor is judged", case.id);
        assert!(matrix.max_error() <= 1e-6, "{}: tolerance", case.id);
    }
}

/// A tetrahedron seen from inside is symmetric: every face sees a third of each other.
#[test]
fn faces_of_a_tetrahedron_see_a_third_of_each_other() {
    let corners = [
        dvec3(1.0, 1.0, 1.0),
        dvec3(1.0, -1.0, -1.0),
        dvec3(-1.0, 1.0, -1.0),
        dvec3(-1.0, -1.0, 1.0),
    ];
    let mut scene = empty();
    for (name, face) in [
        ("a", [0, 2, 1]),
        ("b", [0, 3, 2]),
        ("c", [0, 1, 3]),
        ("d", [1, 2, 3]),
    ] {
        add(&mut scene, name, "grey", &face.map(|k: usize| corners[k]));
    }
    let matrix = matrix(&scene);
    for from in ["a", "b", "c", "d"] {
        for to in ["a", "b", "c", "d"] {
            let expected = if from == to { 0.0 } else { 1.0 / 3.0 };
            assert!(
                (at(&matrix, from, to) - expected).abs() < 1e-13,
                "{from} to {to}"
            );
        }
    }
}

#[test]
fn rows_of_closed_rooms_sum_up_to_one() {
    let mut bare = empty();
    add_room(&mut bare, "room", "grey", DVec3::ZERO, dvec3(4.0, 3.0, 2.0));
    for (scene, allowed) in [(bare, 1e-13), (furnished_room(), 5e-7)] {
        let matrix = matrix(&scene);
        for (name, sum) in matrix.names.iter().zip(matrix.row_sums()) {
            // The box stands on it: nothing of it is left.
            let expected = if name == "standing.z0" { 0.0 } else { 1.0 };
            assert!((sum - expected).abs() <= allowed, "{name}: {sum}");
        }
        assert!(matrix.values.iter().all(|f| (0.0..=1.0).contains(f)));
    }
}

#[test]
fn both_directions_agree_when_computed_independently() {
    let matrix = matrix(&furnished_room());
    let reciprocity = matrix.reciprocity;
    assert!(reciprocity.pairs_checked > 40, "{reciprocity:?}");
    assert!(reciprocity.worst < 2e-6, "{reciprocity:?}");
}

#[test]
fn moved_turned_and_scaled_scenes_have_the_same_factors() {
    let scene = furnished_room();
    let expected = matrix(&scene);
    for (what, motion) in [
        ("turned", Motion::skew()),
        ("mirrored", Motion::mirror()),
        ("larger", Motion::scaling(1234.5)),
        ("shifted", Motion::translation(dvec3(1e3, -2e3, 5e2))),
    ] {
        let moved = matrix(&motion.scene(&scene));
        for (k, (a, b)) in expected.values.iter().zip(&moved.values).enumerate() {
            let n = expected.n();
            let [from, to] = [&expected.names[k / n], &expected.names[k % n]];
            assert!((a - b).abs() < 5e-7, "{what}: {from} to {to}: {a} and {b}");
        }
        let scale = motion.scale * motion.scale;
        for (a, b) in expected.areas.iter().zip(&moved.areas) {
            assert!((a * scale - b).abs() <= 1e-9 * b, "{what}: {a} and {b}");
        }
    }
}

/// The parts of a floor receive together what the floor does.
#[test]
fn splitting_a_surface_splits_its_factors() {
    let scene = shaded_floor();
    let whole = at(&matrix(&scene), "lamp", "floor");
    let mut split = scene;
    split.surfaces.retain(|s| s.name != "floor");
    // A cut that no event follows.
    let (a, b) = (dvec3(-0.7, -1.0, 0.0), dvec3(0.4, 1.0, 0.0));
    let left = [dvec3(-1.0, -1.0, 0.0), a, b, dvec3(-1.0, 1.0, 0.0)];
    let right = [a, dvec3(1.0, -1.0, 0.0), dvec3(1.0, 1.0, 0.0), b];
    add(&mut split, "left", "grey", &left);
    add(&mut split, "right", "grey", &right);
    let parts = matrix(&split);
    let sum = at(&parts, "lamp", "left") + at(&parts, "lamp", "right");
    assert!((sum - whole).abs() < 5e-7, "{sum} and {whole}");
}

#[test]
fn occluders_take_and_never_give() {
    let occluded = furnished_room();
    let mut bare = occluded.clone();
    bare.surfaces.retain(|s| s.name.starts_with("room"));
    let (occluded, bare) = (matrix(&occluded), matrix(&bare));
    let mut n_less = 0;
    for from in &bare.names {
        for to in &bare.names {
            let (less, more) = (at(&occluded, from, to), at(&bare, from, to));
            assert!(less <= more + 1e-13, "{from} to {to}: {less} above {more}");
            n_less += usize::from(less < more - 1e-3);
        }
    }
    assert!(n_less >= 20, "the furniture hides something: {n_less}");
}

/// What a box encloses gets exactly nothing from outside.
#[test]
fn a_closed_box_lets_nothing_in() {
    let matrix = matrix(&fixture("contact/closed-box-lit-from-outside"));
    let is_inside = |name: &String| name.contains("in");
    let inside: Vec<&String> = matrix.names.iter().filter(|n| is_inside(n)).collect();
    let outside: Vec<&String> = matrix.names.iter().filter(|n| !is_inside(n)).collect();
    assert!(
        !inside.is_empty() && !outside.is_empty(),
        "{:?}",
        matrix.names
    );
    for from in &outside {
        for to in &inside {
            assert_eq!(at(&matrix, from, to), 0.0, "{from} to {to}");
        }
    }
}

/// Both sides of a plate between two like squares see one of them each.
#[test]
fn factors_of_a_two_sided_plate_are_the_mean_of_its_sides() {
    let scene = |two_sided: bool| {
        let mut scene = empty();
        let mut plate = material("plate", 0.5, 0.0);
        plate.two_sided = two_sided;
        scene.materials.push(plate);
        let square = |z| ([-1.0, 1.0], [-1.0, 1.0], z);
        add_horizontal(&mut scene, "floor", "grey", square(0.0), Facing::Up);
        add_horizontal(&mut scene, "ceiling", "grey", square(2.0), Facing::Down);
        let plate = ([-0.5, 0.5], [-0.5, 0.5], 1.0);
        add_horizontal(&mut scene, "plate", "plate", plate, Facing::Up);
        scene
    };
    let (one, two) = (matrix(&scene(false)), matrix(&scene(true)));
    assert_eq!(at(&one, "plate", "floor"), 0.0);
    let up = at(&one, "plate", "ceiling");
    for to in ["floor", "ceiling"] {
        assert!((at(&two, "plate", to) - up / 2.0).abs() < 1e-13);
        // What the ceiling sends to the plate does not depend on its other side.
        assert!((at(&two, to, "plate") - at(&one, "ceiling", "plate")).abs() < 1e-13);
    }
    assert!((two.areas[2] - 2.0 * one.areas[2]).abs() < 1e-15);
}

/// The slow way: the mean of the exact point factor on a fine grid.
#[test]
fn the_midpoint_rule_agrees() {
    const N: usize = 200;
    let input = shaded_floor();
    let scene = build(&input);
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    let mut sum = 0.0;
    for i in 0..N * N {
        let middle = |k: usize| -1.0 + 2.0 * (k as f64 + 0.5) / N as f64;
        let point = dvec3(middle(i % N), middle(i / N), 0.0);
        // The lamp's exitance is 1: irradiance is the factor to it.
        let place = place(&scene, "floor", point);
        sum += values::exact(&light, &place, &mut scratch)[0];
    }
    let slow = sum / (N * N) as f64;
    let fast = at(&matrix(&input), "floor", "lamp");
    // The rule's error is about 1/24 N² times the second derivative.
    assert!((slow - fast).abs() < 2e-6, "{slow} and {fast}");
}

#[test]
fn estimated_errors_hold_what_finer_tolerances_find() {
    let scene = build(&furnished_room());
    let with = |tolerance| {
        let options = FactorOptions {
            tolerance,
            ..FactorOptions::default()
        };
        factors(&scene, &options, &Control::NEVER)
    };
    let (rough, fine) = (with(1e-4), with(1e-8));
    assert!(rough.max_error() <= 1e-4 && fine.max_error() <= 1e-8);
    assert!(rough.evaluations < fine.evaluations);
    for (k, (a, b)) in rough.values.iter().zip(&fine.values).enumerate() {
        let allowed = rough.errors[k] + fine.errors[k];
        assert!(
            (a - b).abs() <= allowed,
            "{a} and {b} differ by more than {allowed}"
        );
    }
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    let scene = build(&furnished_room());
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads start");
        pool.install(|| factors(&scene, &FactorOptions::default(), &Control::NEVER))
    };
    let (one, two) = (run(1), run(2));
    let bits = |m: &FormFactors| -> Vec<u64> {
        let all = m.values.iter().chain(&m.errors).chain(&m.areas);
        all.map(|x| x.to_bits()).chain([m.evaluations]).collect()
    };
    assert_eq!(bits(&one), bits(&two));
    assert_eq!(one.reciprocity, two.reciprocity);
}

#[test]
fn a_repaired_room_is_closed_and_reciprocal() {
    let mut scene = furnished_room();
    // It covers a part of the floor.
    scene.surfaces.retain(|s| !s.name.starts_with("standing"));
    let mut matrix = matrix(&scene);
    let repair = matrix.repair().expect("the room is closed");
    assert!(repair.closure < 1e-14, "{repair:?}");
    assert!(repair.largest_change < 1e-6, "{repair:?}");
    for i in 0..matrix.n() {
        for j in 0..matrix.n() {
            let there = matrix.areas[i] * matrix.factor(i, j);
            let back = matrix.areas[j] * matrix.factor(j, i);
            assert!((there - back).abs() < 1e-14);
        }
    }
}

#[test]
fn a_stopped_run_says_what_is_missing() {
    let scene = build(&furnished_room());
    let control = Control {
        stop: Stop::new(&|| true),
        ..Control::NEVER
    };
    let mut matrix = factors(&scene, &FactorOptions::default(), &control);
    assert!(matrix.left_out > 0);
    assert_eq!(matrix.reciprocity.pairs, 0);
    assert!(matrix.max_error() >= 0.5, "{}", matrix.max_error());
    // Surfaces in one plane exchange nothing, which is known; the others might.
    let known = (0..matrix.n()).filter(|&i| !matrix.missing[i * matrix.n() + i]);
    assert_eq!(known.count(), matrix.n(), "none sees itself");
    // The box's bottom is covered by the floor: that it sees nothing is known as well.
    let is_covered = |i: usize| matrix.areas[i] == 0.0;
    assert!((0..matrix.n()).all(|i| matrix.is_complete(i) == is_covered(i)));
    assert_eq!(matrix.closure(), None);
    assert!(matrix.repair().is_err());
}
