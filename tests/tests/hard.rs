//! Hostile geometry: everything that implementations of this idea are known to break on
//! (`fixtures/hard`, made by `tests/examples/hard_scenes.rs`).
//!
//! `ANTUMBRA_POINTS` asks for more check points.

use antumbra::scene::FaceId;
use antumbra::{
    Control, Ended, Evaluator, ExactLight, Options, ReceiverMesh, Scene, SceneInput, Scratch,
    Tolerance, mesh_order_key,
};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::motion::Motion;
use antumbra_tests::random::SplitMix;
use glam::DVec2;
use rayon::prelude::*;
use std::fmt::Write as _;

/// All scenes, by name.
fn names() -> Vec<String> {
    json_files(&fixtures().join("hard"))
        .iter()
        .filter_map(|path| path.file_stem())
        .map(|stem| stem.to_string_lossy().into_owned())
        .collect()
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
    let meshed = antumbra::mesh(&built.scene, &options(1e-3), &Control::default())
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let _ = writeln!(table, "  {:?}", meshed.direct.ended);
    for (mesh, curves) in meshed.direct.receivers.iter().zip(&meshed.curves) {
        let count = |key: &str| {
            let orders = mesh.orders[curves.n_border..].iter();
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
        // So that a mesh that never ends fails, and does not fill the memory.
        most_elements: 100_000,
        ..Options::default()
    }
}

/// A uniform point of a mesh's element, in its chart.
fn random_point(mesh: &ReceiverMesh, areas: &[f64], random: &mut SplitMix) -> (usize, DVec2) {
    let total = *areas.last().unwrap_or(&0.0);
    let t = areas
        .partition_point(|&a| a < total * random.unit())
        .min(areas.len() - 1);
    let [a, b, c] = mesh.mesh.corners(t as u32);
    let (mut s, mut r) = (random.unit(), random.unit());
    if s + r > 1.0 {
        (s, r) = (1.0 - s, 1.0 - r);
    }
    (t, a + (b - a) * s + (c - a) * r)
}

/// Meshes a scene and compares with exact light at random points of all receivers, as
/// many on each; returns what is wrong.
fn errors(name: &str, input: &SceneInput, tolerance: f64, n_points: usize) -> Vec<String> {
    let scene = build(input);
    let meshed = antumbra::mesh(&scene, &options(tolerance), &Control::default())
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut wrong = Vec::new();
    if !matches!(
        meshed.direct.ended,
        Ended::ToleranceReached | Ended::ResolutionReached
    ) {
        wrong.push(format!("{name}: ended with {:?}", meshed.direct.ended));
    }
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator);
    let peak = meshed.direct.peak[0];
    let receivers = &meshed.direct.receivers;
    let per_receiver = n_points.div_ceil(receivers.len());
    let (mut n_above, mut n_unresolved, mut worst) = (0, 0, 0.0f64);
    for mesh in receivers {
        if let Err(error) = mesh.mesh.check() {
            wrong.push(format!("{name}: {error}"));
        }
        if mesh.direct.iter().any(|&e| !(e >= 0.0 && e.is_finite())) {
            wrong.push(format!("{name}: a value that is negative or none"));
        }
        let areas: Vec<f64> = (0..mesh.n_elements() as u32)
            .scan(0.0, |sum, t| {
                *sum += mesh.mesh.area(t).max(0.0);
                Some(*sum)
            })
            .collect();
        let points: Vec<(usize, DVec2)> = {
            let mut random = SplitMix::new(u64::from(mesh.face.0) + 1);
            (0..per_receiver)
                .map(|_| random_point(mesh, &areas, &mut random))
                .collect()
        };
        let found: Vec<(bool, f64)> = points
            .par_iter()
            .map_init(Scratch::default, |scratch, &(t, uv)| {
                let exact = light.at(mesh.face, mesh.chart.to_space(uv), scratch)[0];
                let interpolated = mesh
                    .locate(uv)
                    .map_or(f64::NAN, |(element, at)| mesh.direct_at(element, at)[0]);
                let is_unresolved = mesh.unresolved.contains(&(t as u32));
                (
                    is_unresolved,
                    (interpolated - exact).abs() / peak.max(1e-300),
                )
            })
            .collect();
        for (is_unresolved, error) in found {
            n_unresolved += usize::from(is_unresolved);
            // A place in no element gives none.
            if !is_unresolved && !(error <= tolerance) {
                n_above += 1;
            }
            if !is_unresolved {
                worst = worst.max(error);
            }
        }
    }
    let n = per_receiver * receivers.len();
    // Between check points a few may err more.
    if n_above * 1_000 > n || worst > 2.0 * tolerance {
        wrong.push(format!(
            "{name}: {n_above} of {n} points above {tolerance:e}, the worst at {worst:.2e}"
        ));
    }
    if n_unresolved * 100 > n {
        wrong.push(format!(
            "{name}: {n_unresolved} of {n} points in unresolved elements"
        ));
    }
    wrong
}

fn within_tolerance(motion: &Motion) {
    let wrong: Vec<String> = names()
        .par_iter()
        .flat_map(|name| {
            let scene = motion.scene(&fixture(&format!("hard/{name}")));
            errors(name, &scene, 1e-3, n_points())
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn hard_scenes_are_within_the_tolerance() {
    within_tolerance(&Motion::IDENTITY);
}

#[test]
fn turned_hard_scenes_are_within_the_tolerance() {
    within_tolerance(&Motion::skew());
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
        let meshed = antumbra::mesh(&scene, &options(1e-3), &Control::default())
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let face = antumbra_tests::scenes::only_face(&scene, surface);
        let mesh = &meshed.direct.receivers[face.index()];
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
        let middle = mesh.mesh.corners(t as u32).iter().sum::<DVec2>() / 3.0;
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
