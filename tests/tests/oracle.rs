//! Two oracles against the engine: sampling, and rational arithmetic.

use antumbra::SceneInput;
use antumbra_tests::cases::fixture;
use antumbra_tests::oracle::sampled;
use antumbra_tests::rational;
use antumbra_tests::scenes::{exact, points_on};
use glam::{DVec3, dvec3};
use rayon::prelude::*;

const CONVEX: [&str; 10] = [
    "basic/tilted-triangle",
    "basic/floating-box",
    "basic/two-triangles",
    "basic/facet-cuts-lamp-and-floor",
    "alignment/rectangle-under-rectangle",
    "alignment/wall-plane-through-lamp",
    "contact/box-on-floor",
    "contact/table",
    "penetration/box-through-floor",
    "penetration/crossing-triangles",
];

/// Points of the floor, most of them where the shadows are, none on a lattice line.
fn floor_points(n: usize) -> Vec<DVec3> {
    points_on(dvec3(-1.25, -1.25, 0.0), DVec3::X * 2.5, DVec3::Y * 2.5, n)
}

fn sampling_agrees(name: &str) {
    let scene = fixture(name);
    let points = floor_points(8);
    let exact = exact(&scene, "floor", &points);
    points.par_iter().zip(&exact).for_each(|(&p, &e)| {
        let sampled = sampled(&scene, p, DVec3::Z, 200);
        // The midpoint rule itself is off by a few 1e-6 on the whole lamp.
        let allowed = sampled.undecided + 1e-5;
        assert!(
            (sampled.irradiance - e).abs() <= allowed,
            "{name} at {p}: sampled {} ± {allowed:.1e}, exact {e}",
            sampled.irradiance
        );
    });
}

#[test]
fn exact_irradiance_agrees_with_sampling() {
    CONVEX.iter().for_each(|name| sampling_agrees(name));
}

fn rational_agrees(name: &str, scene: &SceneInput, points: &[DVec3]) {
    let exact = exact(scene, "floor", points);
    points.par_iter().zip(&exact).for_each(|(&p, &e)| {
        let rational = rational::irradiance(scene, p, DVec3::Z);
        assert!(
            (rational - e).abs() <= 1e-13,
            "{name} at {p}: rational {rational}, exact {e}, difference {:.1e}",
            rational - e
        );
    });
}

#[test]
fn exact_irradiance_agrees_with_rational_arithmetic() {
    for name in CONVEX {
        rational_agrees(name, &fixture(name), &floor_points(40));
    }
}

/// Points from which edges, corners and planes of the scene lie exactly behind
/// one another.
#[test]
fn exact_irradiance_agrees_with_rational_arithmetic_at_aligned_points() {
    let points: Vec<DVec3> = (-7..=7)
        .flat_map(|i| (-7..=7).map(move |j| dvec3(f64::from(i) / 8.0, f64::from(j) / 8.0, 0.0)))
        .collect();
    for name in CONVEX {
        let scene = fixture(name);
        // On a contact there is no value, only one a side.
        let is_off_contacts = |p: &&DVec3| {
            !scene
                .surfaces
                .iter()
                .any(|s| s.name != "floor" && touches(&s.vertices, **p))
        };
        let points: Vec<DVec3> = points.iter().filter(is_off_contacts).copied().collect();
        rational_agrees(name, &scene, &points);
    }
}

/// Does a convex polygon's cut with the floor pass through a point of the floor?
fn touches(corners: &[DVec3], p: DVec3) -> bool {
    let n = corners.len();
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if normal.dot(p - corners[0]).abs() > 1e-9 {
        return false;
    }
    (0..n).all(|i| {
        let along = corners[(i + 1) % n] - corners[i];
        normal.dot(along.cross(p - corners[i])) >= -1e-9
    })
}
