//! One scene at other sizes and places: the same elements, the same values.
//!
//! What a coordinate cannot carry is another scene: at an offset of a million sizes the
//! fixtures here, whose coordinates are dyadic, keep all their digits.

use antumbra::SceneInput;
use antumbra::scene::SurfaceInput;
use antumbra::{Control, Options, Outcome};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::motion::Motion;
use antumbra_tests::random::SplitMix;
use antumbra_tests::scenes::exact;
use glam::{DVec3, dvec3};
use rayon::prelude::*;

/// All fixtures of folders, by their path, but for those named.
fn names(folders: &[&str], but: &[&str]) -> Vec<String> {
    folders
        .iter()
        .flat_map(|folder| {
            json_files(&fixtures().join(folder))
                .into_iter()
                .filter_map(move |path| {
                    let stem = path.file_stem()?.to_string_lossy().into_owned();
                    Some(format!("{folder}/{stem}"))
                })
        })
        .filter(|name| !but.contains(&name.as_str()))
        .collect()
}

/// Coordinates are dyadic with few digits.
const SHORT: [&str; 4] = ["basic", "alignment", "contact", "penetration"];

fn mesh(name: &str, input: &SceneInput) -> Outcome {
    antumbra::mesh(&build(input), &Options::default(), &Control::NEVER)
        .unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Elements of every receiver.
fn sizes(meshed: &Outcome) -> Vec<usize> {
    let receivers = meshed.mesh.receivers.iter();
    receivers.map(|r| r.n_elements()).collect()
}

/// Inner points of every surface that is a convex polygon: means of its corners with
/// random weights of eight bits, so that an offset can carry them.
fn spots(input: &SceneInput, n: usize) -> Vec<(String, DVec3)> {
    let mut random = SplitMix::new(7);
    let mut spots = Vec::new();
    let is_plain = |s: &&SurfaceInput| s.vertices.len() <= 4 && s.holes.is_empty();
    for surface in input.surfaces.iter().filter(is_plain) {
        for _ in 0..n {
            let [a, b, c] = [0, 1, 2].map(|k| surface.vertices[k]);
            let mut weight = || (1 + random.bits() % 120) as f64 / 256.0;
            let (u, v) = (weight(), weight());
            spots.push((surface.name.clone(), a + (b - a) * u + (c - a) * v));
        }
    }
    spots
}

/// What differs between a scene and its image.
fn differences(name: &str, motion: &Motion) -> Vec<String> {
    let input = fixture(name);
    let image = motion.scene(&input);
    let mut wrong = Vec::new();
    let (plain, moved) = (mesh(name, &input), mesh(name, &image));
    if sizes(&plain) != sizes(&moved) {
        wrong.push(format!(
            "{name}: elements {:?}, moved {:?}",
            sizes(&plain),
            sizes(&moved)
        ));
    }
    let peak = plain.mesh.peak[0].max(f64::MIN_POSITIVE);
    for (surface, p) in spots(&input, 20) {
        let here = exact(&input, &surface, &[p])[0];
        let there = exact(&image, &surface, &[motion.point(p)])[0];
        if (here - there).abs() > 1e-9 * peak {
            wrong.push(format!("{name}: {here} on {surface} at {p}, moved {there}"));
        }
    }
    wrong
}

fn same_under(motion: &Motion, names: &[String]) {
    let wrong: Vec<String> = names
        .par_iter()
        .flat_map(|name| differences(name, motion))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A million times smaller and larger. Rounding differs, for neither is a power of two.
#[test]
fn other_sizes_have_the_same_elements() {
    let mut all = names(&SHORT, &[]);
    // Two that take long.
    let but = ["eee/boxes-16", "eee/boxes-64"];
    all.extend(names(&["eee"], &but));
    for scale in [1e-6, 1e6] {
        same_under(&Motion::scaling(scale), &all);
    }
}

/// The scenes measure 4 m.
#[test]
fn a_million_sizes_away_has_the_same_elements() {
    let shift = dvec3(4e6, -4e6, 4e6);
    same_under(&Motion::translation(shift), &names(&SHORT, &[]));
}

/// Hard scenes too, in which lengths are equal wherever they can be. But for one that takes
/// long, and those whose coordinates cannot carry it: features of 1e-6 m, which are 25
/// pixels, and of 1 cm a million metres away.
#[test]
fn hard_scenes_of_other_sizes_have_the_same_elements() {
    let but = ["hard/many-lamps", "hard/minute-lamp", "hard/far-away"];
    for name in names(&["hard"], &but) {
        let input = fixture(&name);
        let here = sizes(&mesh(&name, &input));
        for scale in [1e-6, 1e6] {
            let image = Motion::scaling(scale).scene(&input);
            assert_eq!(sizes(&mesh(&name, &image)), here, "{name} at {scale:e}");
        }
    }
}
