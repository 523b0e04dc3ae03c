//! Interreflection that is gathered: what it promises.

use antumbra::SceneInput;
use antumbra::gathered::{Gathered, solve};
use antumbra::values::random_places;
use antumbra::visibility::Place;
use antumbra::{Control, Evaluator, Options, Scene, Tolerance};
use antumbra_tests::bits::bits_of_meshes;
use antumbra_tests::cases::{build, fixture};
use antumbra_tests::scenes::{add_box, add_room, empty, material};
use glam::{DVec3, dvec3};

fn solved(scene: &Scene, tolerance: f64) -> Gathered {
    let options = Options {
        tolerance: Tolerance::Relative(tolerance),
        ..Options::default()
    };
    solve(scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{e}"))
}

fn on_face(scene: &Scene, place: &antumbra::values::Place) -> Place {
    let face = scene.face(place.face);
    Place {
        point: place.point,
        normal: face.normal,
        plane: Some(face.plane),
        approach: None,
    }
}

#[test]
fn meshes_keep_the_tolerance_against_a_finer_solution() {
    let tolerance = 3e-2;
    let scene = build(&fixture("real/cornell-box"));
    let [coarse, fine] = [tolerance, tolerance / 5.0].map(|t| solved(&scene, t));
    let evaluator = Evaluator::new(&scene);
    let places = random_places(&scene, 2000, &|f| !scene.face(f).is_covered);
    let at: Vec<Place> = places.iter().map(|p| on_face(&scene, p)).collect();
    let truth = fine.transport.gather(&evaluator, &at, &Control::NEVER);
    let mesh = &coarse.outcome.mesh;
    let mut n_above = 0;
    for (place, truth) in places.iter().zip(truth) {
        let receiver = &mesh.receivers[place.face.index()];
        let spot = receiver.locate(receiver.chart.to_chart(place.point));
        let spot = spot.expect("every point is in an element");
        let of = |values| receiver.interpolate(values, scene.n_bands, spot);
        let (total, direct) = (of(&receiver.irradiance), of(&receiver.direct));
        let truth = truth.expect("nothing stops it");
        for band in 0..scene.n_bands {
            let indirect = total[band] - direct[band];
            let error = (indirect - truth[band]).abs() / mesh.peak[band];
            // Direct light has an error of its own here.
            n_above += u32::from(error > 2.0 * tolerance);
        }
    }
    assert_eq!(n_above, 0);
    assert!(mesh.has_reached_goal(), "{:?}", mesh.ended);
    assert!(mesh.measured_max_error <= tolerance);
}

/// A room in which every surface gives off 0.5 and reflects half: E = M / (1 − ρ) = 1.
fn furnace() -> SceneInput {
    let mut scene = empty();
    scene.materials.push(material("even", 0.5, 0.5));
    add_room(
        &mut scene,
        "room",
        "even",
        DVec3::ZERO,
        dvec3(3.0, 4.0, 2.5),
    );
    scene
}

#[test]
fn a_furnace_with_a_box_on_the_floor_is_even_to_a_millionth() {
    let mut input = furnace();
    add_box(
        &mut input,
        "box",
        "even",
        dvec3(1.0, 1.0, 0.0),
        dvec3(2.0, 2.0, 1.0),
    );
    let scene = build(&input);
    let solved = solved(&scene, 1e-2);
    let is_open = |face| !scene.face(face).is_covered;
    for row in solved.transport.row_sums.iter().filter(|r| is_open(r.face)) {
        assert!((row.max - 1.0).abs() < 1e-9 && (row.min - 1.0).abs() < 1e-9);
    }
    assert!(solved.transport.power.imbalance < 1e-6);
    let receivers = &solved.outcome.mesh.receivers;
    for receiver in receivers.iter().filter(|r| is_open(r.face)) {
        for &value in &receiver.irradiance {
            assert!((value - 1.0).abs() < 1e-6, "{value}");
        }
    }
}

#[test]
fn no_more_than_rounding_comes_through_a_wall() {
    let mut input = empty();
    input.materials.push(material("unlit", 0.5, 0.0));
    input.materials.push(material("bright", 0.5, 1.0));
    add_room(
        &mut input,
        "lit",
        "bright",
        DVec3::ZERO,
        dvec3(1.0, 1.0, 1.0),
    );
    add_room(
        &mut input,
        "dark",
        "grey",
        dvec3(1.0, 0.0, 0.0),
        dvec3(2.0, 1.0, 1.0),
    );
    let scene = build(&input);
    let solved = solved(&scene, 3e-2);
    let mut n_dark = 0;
    for receiver in &solved.outcome.mesh.receivers {
        if scene.surface_of(receiver.face).name.starts_with("dark") {
            n_dark += 1;
            let most = receiver.irradiance.iter().copied().fold(0.0, f64::max);
            let name = &scene.surface_of(receiver.face).name;
            let at = receiver
                .irradiance
                .iter()
                .position(|&e| e == most)
                .unwrap_or(0);
            // In the corners of the common wall, by rounding.
            assert!(most < 1e-9, "{name} at {}: {most:e}", receiver.nodes[at]);
        }
    }
    assert!(n_dark >= 6);
}

#[test]
fn threads_do_not_matter() {
    let scene = build(&fixture("basic/floating-box"));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.unwrap_or_else(|e| panic!("{e}"));
        pool.install(|| {
            let solved = solved(&scene, 1e-2);
            let power = solved.transport.power.absorbed.iter().map(|p| p.to_bits());
            let mut bits = bits_of_meshes(&solved.outcome.mesh);
            bits.extend(power);
            bits
        })
    };
    assert_eq!(run(1), run(3));
}
