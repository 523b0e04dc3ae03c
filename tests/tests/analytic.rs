//! Form factors that have a closed form.

use antumbra::SceneInput;
use antumbra_tests::quadrature::gauss;
use antumbra_tests::scenes::{
    Facing, add, add_box, add_horizontal, add_room, empty, exact, exact_free, points_on,
};
use glam::{DVec3, dvec3};
use std::f64::consts::{PI, TAU};

/// A unit square under a unit square that emits, one apart.
fn opposed() -> SceneInput {
    let mut scene = empty();
    add_horizontal(
        &mut scene,
        "floor",
        "grey",
        ([0.0, 1.0], [0.0, 1.0], 0.0),
        Facing::Up,
    );
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([0.0, 1.0], [0.0, 1.0], 1.0),
        Facing::Down,
    );
    scene
}

#[test]
fn opposed_unit_squares_have_the_known_form_factor() {
    let rule = gauss(16);
    let points: Vec<DVec3> = rule
        .iter()
        .flat_map(|&(x, _)| rule.iter().map(move |&(y, _)| dvec3(x, y, 0.0)))
        .collect();
    let weights = rule
        .iter()
        .flat_map(|&(_, v)| rule.iter().map(move |&(_, w)| v * w));
    let factors = exact(&opposed(), "floor", &points);
    let got: f64 = factors.iter().zip(weights).map(|(f, w)| f * w).sum();

    let root = 2f64.sqrt();
    let known =
        2.0 / PI * ((4.0f64 / 3.0).sqrt().ln() + 2.0 * root * (1.0 / root).atan() - PI / 2.0);
    assert!((known - 0.199_824_896).abs() < 5e-10);
    assert!((got - known).abs() < 1e-12, "{got} is not {known}");
}

#[test]
fn perpendicular_unit_squares_have_the_known_form_factor() {
    let mut scene = empty();
    add_horizontal(
        &mut scene,
        "floor",
        "grey",
        ([0.0, 1.0], [0.0, 1.0], 0.0),
        Facing::Up,
    );
    let wall = [
        dvec3(0.0, 0.0, 0.0),
        dvec3(0.0, 1.0, 0.0),
        dvec3(0.0, 1.0, 1.0),
        dvec3(0.0, 0.0, 1.0),
    ];
    add(&mut scene, "wall", "lamp", &wall);
    // The factor is not smooth at the ends of the common edge: x = s³, and y with
    // both ends drawn out, y = s²(3 − 2s), make the integrand smooth enough.
    let rule = gauss(48);
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for &(s, v) in &rule {
        for &(t, w) in &rule {
            points.push(dvec3(s.powi(3), t * t * (3.0 - 2.0 * t), 0.0));
            weights.push(v * 3.0 * s * s * w * 6.0 * t * (1.0 - t));
        }
    }
    let factors = exact(&scene, "floor", &points);
    let got: f64 = factors.iter().zip(&weights).map(|(f, w)| f * w).sum();

    let root = 2f64.sqrt();
    let known = (PI / 2.0 - root * (1.0 / root).atan() + 0.75f64.ln() / 4.0) / PI;
    assert!((known - 0.200_043_776).abs() < 5e-10);
    assert!((got - known).abs() < 1e-10, "{got} is not {known}");
}

/// Factor from a point to a rectangle a × b parallel to it, with one corner right
/// above it at height `c`; odd in a and b.
fn corner_factor(a: f64, b: f64, c: f64) -> f64 {
    let (a, b) = (a / c, b / c);
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / p * (b / p).atan() + b / q * (a / q).atan()) / TAU
}

#[test]
fn point_under_a_parallel_rectangle_has_the_known_factor() {
    let mut scene = empty();
    add_horizontal(
        &mut scene,
        "floor",
        "grey",
        ([-4.0, 4.0], [-4.0, 4.0], 0.0),
        Facing::Up,
    );
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([-0.5, 1.5], [0.25, 1.0], 0.75),
        Facing::Down,
    );
    let points = points_on(dvec3(-4.0, -4.0, 0.0), DVec3::X * 8.0, DVec3::Y * 8.0, 500);
    for (p, got) in points.iter().zip(exact(&scene, "floor", &points)) {
        let corner = |x: f64, y: f64| corner_factor(x - p.x, y - p.y, 0.75);
        let known = corner(1.5, 1.0) - corner(-0.5, 1.0) - corner(1.5, 0.25) + corner(-0.5, 0.25);
        assert!((got - known).abs() < 1e-14, "at {p}: {got} is not {known}");
    }
}

#[test]
fn emitter_seen_from_behind_gives_nothing() {
    let mut scene = opposed();
    scene.surfaces[1].vertices.reverse();
    let points = points_on(DVec3::ZERO, DVec3::X, DVec3::Y, 20);
    assert!(exact(&scene, "floor", &points).iter().all(|&e| e == 0.0));
}

#[test]
fn closed_cube_encloses_every_point_of_its_faces() {
    let mut scene = empty();
    add_room(&mut scene, "room", "lamp", DVec3::ZERO, DVec3::ONE);
    encloses(&scene, 200);
}

#[test]
fn closed_room_with_boxes_encloses_every_point() {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "lamp",
        dvec3(-2.0, -1.5, 0.0),
        dvec3(2.0, 1.5, 3.0),
    );
    add_box(
        &mut scene,
        "standing",
        "lamp",
        dvec3(-1.0, -1.0, 0.0),
        dvec3(0.0, 0.25, 1.0),
    );
    add_box(
        &mut scene,
        "floating",
        "lamp",
        dvec3(0.25, -0.5, 1.25),
        dvec3(1.5, 0.75, 2.0),
    );
    // Under the standing box there is nothing but its own bottom face.
    scene.surfaces.retain(|s| s.name != "standing.z0");
    encloses(&scene, 60);
}

/// Everything emits 1 and the scene is closed, so every point receives 1.
fn encloses(scene: &SceneInput, n: usize) {
    for surface in &scene.surfaces {
        let v = &surface.vertices;
        let mut points = points_on(v[0], v[1] - v[0], v[3] - v[0], n);
        // The floor under the box is outside.
        points.retain(|p| {
            let is_under = p.z == 0.0 && p.x > -1.0 && p.x < 0.0 && p.y > -1.0 && p.y < 0.25;
            scene.surfaces.len() == 6 || !is_under
        });
        for (p, e) in points.iter().zip(exact(scene, &surface.name, &points)) {
            assert!((e - 1.0).abs() < 1e-12, "on {} at {p}: {e}", surface.name);
        }
    }
}

#[test]
fn sensor_inside_a_closed_cube_receives_one_whatever_its_normal() {
    let mut scene = empty();
    add_room(&mut scene, "room", "lamp", DVec3::ZERO, DVec3::ONE);
    let points = points_on(
        dvec3(0.125, 0.25, 0.375),
        dvec3(0.5, 0.25, 0.0),
        dvec3(0.0, 0.25, 0.5),
        100,
    );
    let sensors: Vec<_> = points
        .iter()
        .map(|&p| (p, (p * 7.0 - 3.0) + DVec3::X * 0.1))
        .collect();
    for e in exact_free(&scene, &sensors) {
        assert!((e - 1.0).abs() < 1e-12, "{e}");
    }
}
