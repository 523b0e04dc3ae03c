//! Two oracles against the engine: sampling, and rational arithmetic.

use antumbra::scene::SurfaceInput;
use antumbra::{Control, Options, ReceiverMesh, SceneInput};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::oracle::sampled;
use antumbra_tests::random::SplitMix;
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

/// Hard scenes whose surfaces are convex, without holes, and plane as they are written:
/// those that rational arithmetic can tell of.
fn hard_and_plain() -> Vec<String> {
    json_files(&fixtures().join("hard"))
        .iter()
        .filter_map(|path| path.file_stem())
        .map(|stem| format!("hard/{}", stem.to_string_lossy()))
        .filter(|name| fixture(name).surfaces.iter().all(is_plain))
        .collect()
}

fn is_plain(surface: &SurfaceInput) -> bool {
    let v = &surface.vertices;
    let n = v.len();
    let turn = |k: usize| (v[(k + 1) % n] - v[k]).cross(v[(k + 2) % n] - v[(k + 1) % n]);
    surface.holes.is_empty()
        && (0..n).all(|k| turn(k).dot(turn(0)) > 0.0)
        && v.iter().all(|&p| turn(0).dot(p - v[0]) == 0.0)
}

/// Inner points of a convex surface with few digits, so that they lie on its plane as
/// exactly as its corners do.
fn inner_points(surface: &SurfaceInput, n: usize, seed: u64) -> Vec<DVec3> {
    let mut random = SplitMix::new(seed);
    (0..n)
        .map(|_| {
            let k = 1 + (random.bits() as usize) % (surface.vertices.len() - 2);
            let [a, b, c] = [0, k, k + 1].map(|k| surface.vertices[k]);
            let mut weight = || (1 + random.bits() % 120) as f64 / 256.0;
            let (u, v) = (weight(), weight());
            a + (b - a) * u + (c - a) * v
        })
        .collect()
}

/// On every surface of every such scene, at points that may lie behind anything.
#[test]
fn exact_irradiance_of_hard_scenes_agrees_with_rational_arithmetic() {
    let names = hard_and_plain();
    assert!(names.len() >= 12, "only {} scenes are plain", names.len());
    let wrong: Vec<String> = names
        .par_iter()
        .flat_map(|name| {
            let scene = fixture(name);
            let most: f64 = scene.materials.iter().map(|m| m.exitance[0]).sum();
            let mut wrong = Vec::new();
            for (k, surface) in scene.surfaces.iter().enumerate() {
                let v = &surface.vertices;
                let normal = (v[1] - v[0]).cross(v[2] - v[0]);
                let points = inner_points(surface, 4, k as u64);
                // A point whose coordinates are rounded may lie below its own surface,
                // which does not hide it.
                let mut others = scene.clone();
                others.surfaces.remove(k);
                for (&p, e) in points.iter().zip(exact(&scene, &surface.name, &points)) {
                    let is_touched = scene
                        .surfaces
                        .iter()
                        .any(|s| s.name != surface.name && touches(&s.vertices, p));
                    if is_touched {
                        continue;
                    }
                    let rational = rational::irradiance(&others, p, normal);
                    if (rational - e).abs() > 1e-13 * most {
                        wrong.push(format!(
                            "{name}, {} at {p}: rational {rational}, exact {e}",
                            surface.name
                        ));
                    }
                }
            }
            wrong
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Interpolated values of the brightest receiver against sampling, which knows neither
/// events nor clipping.
#[test]
fn meshes_of_hard_scenes_agree_with_sampling() {
    let wrong: Vec<String> = hard_and_plain()
        .par_iter()
        .flat_map(|name| {
            let input = fixture(name);
            let scene = build(&input);
            let meshed = antumbra::mesh(&scene, &Options::default(), &Control::NEVER)
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            let brightest = |m: &&ReceiverMesh| m.direct.iter().copied().fold(0.0, f64::max);
            let Some(mesh) =
                (meshed.mesh.receivers.iter()).max_by(|a, b| brightest(a).total_cmp(&brightest(b)))
            else {
                return Vec::new();
            };
            let surface = scene.surface_of(mesh.face);
            let Some(written) = input.surfaces.iter().find(|s| s.name == surface.name) else {
                return Vec::new();
            };
            let normal = scene.face(mesh.face).normal;
            let mut wrong = Vec::new();
            for p in inner_points(written, 6, 99) {
                // What is covered has a mesh of its own.
                if antumbra_tests::scenes::place(&scene, &surface.name, p).face != mesh.face {
                    continue;
                }
                let uv = mesh.chart.to_chart(scene.frame.to_scene(p));
                let Some(spot) = mesh.locate(uv) else {
                    wrong.push(format!("{name}, {}: {p} is in no element", surface.name));
                    continue;
                };
                if mesh.unresolved.contains(&(spot.element as u32)) {
                    continue;
                }
                let value = mesh.direct_at(spot)[0];
                let sampled = sampled(&input, p, normal, 150);
                // The midpoint rule is off by 1e-5 of a lamp that is not near.
                let allowed = sampled.undecided + 1e-3 * meshed.mesh.peak[0] + 1e-4;
                if (sampled.irradiance - value).abs() > allowed {
                    wrong.push(format!(
                        "{name}, {} at {p}: sampled {} within {allowed:.1e}, mesh {value}",
                        surface.name, sampled.irradiance
                    ));
                }
            }
            wrong
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
