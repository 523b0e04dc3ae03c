//! Hostile geometry: everything that implementations of this idea are known to break on
//! (`fixtures/hard`, made by `tests/examples/hard_scenes.rs`).
//!
//! `ANTUMBRA_POINTS` asks for more check points.

use antumbra::scene::FaceId;
use antumbra::{Control, Options, ReceiverMesh, Scene, Tolerance, mesh_order_key};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::check_points::compare;
use antumbra_tests::meshes::{orders_of, triangles};
use antumbra_tests::motion::Motion;
use glam::{DVec2, dvec3};
use rayon::prelude::*;
use std::fmt::Write as _;

/// So that a mesh that never ends fails, and does not fill the memory.
const MOST_ELEMENTS: usize = 100_000;

/// All scenes of a folder, by name.
fn names_in(folder: &str) -> Vec<String> {
    json_files(&fixtures().join(folder))
        .iter()
        .filter_map(|path| path.file_stem())
        .map(|stem| stem.to_string_lossy().into_owned())
        .collect()
}

fn names() -> Vec<String> {
    names_in("hard")
}

/// Random points a scene.
fn n_points() -> usize {
    let asked = std::env::var("ANTUMBRA_POINTS").ok();
    asked.and_then(|n| n.parse().ok()).unwrap_or(2_000)
}

/// One line a receiver: what was found, and what became of it.
fn table_of(name: &str) -> String {
    let input = fixture(&format!("hard/{name}"));
    let built = match Scene::build(&input) {
        Ok(built) => built,
        Err(problems) => panic!("{name}: {problems:?}"),
    };
    let mut table = format!("{name}\n");
    for warning in &built.warnings {
        let _ = writeln!(table, "  warning: {}", warning.message);
    }
    let meshed = antumbra::mesh(&built.scene, &options(1e-3), &Control::NEVER)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let _ = writeln!(table, "  {:?}", meshed.mesh.ended);
    for (mesh, curves) in meshed.mesh.receivers.iter().zip(&meshed.curves) {
        let count = |key: &str| {
            let orders = orders_of(mesh)[curves.n_border..].iter();
            orders.filter(|&&o| mesh_order_key(o) == key).count()
        };
        if mesh.n_elements() <= 2 {
            continue;
        }
        let _ = writeln!(
            table,
            "  {}: {} elements, {} unresolved; curves {} d0, {} d1, {} d2",
            built.scene.surface_of(mesh.face).name,
            mesh.n_elements(),
            mesh.unresolved.len(),
            count("d0"),
            count("d1"),
            count("d2"),
        );
    }
    table
}

/// What every hard scene makes; receivers of one or two elements are left out.
#[test]
fn hard_scenes_and_what_becomes_of_them() {
    let tables: Vec<String> = names().par_iter().map(|name| table_of(name)).collect();
    insta::assert_snapshot!("hard_scenes", tables.concat());
}

fn options(tolerance: f64) -> Options {
    Options {
        tolerance: Tolerance::Relative(tolerance),
        most_elements: MOST_ELEMENTS,
        ..Options::default()
    }
}

fn within_tolerance(folder: &str, motion: &Motion) {
    let wrong: Vec<String> = names_in(folder)
        .par_iter()
        .flat_map(|name| {
            let scene = motion.scene(&fixture(&format!("{folder}/{name}")));
            compare(name, &build(&scene), 1e-3, MOST_ELEMENTS, n_points()).wrong
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn hard_scenes_are_within_the_tolerance() {
    within_tolerance("hard", &Motion::IDENTITY);
}

#[test]
fn turned_hard_scenes_are_within_the_tolerance() {
    within_tolerance("hard", &Motion::skew());
}

/// What stands on, leans on or encloses other things: places that no light reaches.
#[test]
fn scenes_with_contacts_are_within_the_tolerance() {
    within_tolerance("contact", &Motion::IDENTITY);
    within_tolerance("contact", &Motion::skew());
}

/// Scenes in which one place is dark whatever the mesh does.
#[test]
fn nothing_leaks_into_closed_places() {
    for (name, surface, region) in [
        // Inside of the box at the corner.
        ("closed-corner", "room.z0", [[0.0, 0.0], [1.0, 0.75]]),
        // Under the thin leg.
        (
            "thin-leg",
            "floor",
            [[-0.5, -0.25], [-0.49609375, -0.24609375]],
        ),
        // Under the lowest of the boxes.
        ("stacked-boxes", "floor", [[-0.75, -0.25], [-0.25, 0.25]]),
        ("t-junctions", "floor-1", [[-0.25, -0.25], [0.5, 0.5]]),
    ] {
        let scene = build(&fixture(&format!("hard/{name}")));
        let meshed = antumbra::mesh(&scene, &options(1e-3), &Control::NEVER)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        // Horizontal, at the height of the surface.
        let [low, high] = region;
        let first = antumbra_tests::scenes::only_face(&scene, surface);
        let height = scene
            .frame
            .to_file(scene.position(scene.face(first).outline[0]))
            .z;
        let middle = dvec3(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), height);
        let face = antumbra_tests::scenes::place(&scene, surface, middle).face;
        let mesh = &meshed.mesh.receivers[face.index()];
        assert!(
            is_dark(&scene, mesh, face, region),
            "{name}: light on {surface}"
        );
    }
}

/// Whether the elements of a horizontal receiver in a rectangle are 0 at all nodes.
fn is_dark(scene: &Scene, mesh: &ReceiverMesh, face: FaceId, [low, high]: [[f64; 2]; 2]) -> bool {
    assert_eq!(mesh.face, face);
    let mut n_inside = 0;
    let dark = (0..mesh.n_elements()).all(|t| {
        let middle = triangles(mesh).corners(t as u32).iter().sum::<DVec2>() / 3.0;
        let p = scene.frame.to_file(mesh.chart.to_space(middle));
        if !(p.x > low[0] && p.x < high[0] && p.y > low[1] && p.y < high[1]) {
            return true;
        }
        n_inside += 1;
        mesh.nodes_of(t)
            .iter()
            .all(|&n| mesh.direct[n as usize] == 0.0)
    });
    dark && n_inside > 0
}
