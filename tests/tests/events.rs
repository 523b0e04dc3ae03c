//! Critical curves of the fixtures, as tables; and that light bends where they run.

use antumbra::scene::FaceId;
use antumbra::{
    Control, CriticalCurve, EventKind, Options, Outcome, ReceiverCurves, Scene, mesh_order_key,
    order_key,
};
use antumbra::{Discontinuity, Evaluator, EventKinds, ExactLight, Scratch};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::meshes::orders_of;
use glam::DVec3;
use std::fmt::Write as _;

const FOLDERS: [&str; 5] = ["basic", "alignment", "contact", "penetration", "eee"];

/// Fixtures whose tables would be long: their curves are counted, not listed.
const LARGE: [&str; 6] = [
    "eee/boxes-4",
    "eee/boxes-8",
    "eee/boxes-16",
    "eee/boxes-64",
    "eee/grating",
    "eee/table-and-chairs",
];

/// All small fixtures by path, sorted.
fn names() -> Vec<String> {
    let in_folder = |folder: &str| -> Vec<String> {
        json_files(&fixtures().join(folder))
            .iter()
            .filter_map(|p| {
                p.file_stem()
                    .map(|s| format!("{folder}/{}", s.to_string_lossy()))
            })
            .collect()
    };
    FOLDERS
        .into_iter()
        .flat_map(in_folder)
        .filter(|name| !LARGE.contains(&name.as_str()))
        .collect()
}

fn meshed(name: &str) -> (Scene, Outcome) {
    let scene = build(&fixture(name));
    let options = Options {
        most_elements: 100_000,
        ..Options::default()
    };
    let meshed =
        antumbra::mesh(&scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{name}: {e}"));
    (scene, meshed)
}

/// The curves of every face without refining any mesh.
fn curves(name: &str) -> (Scene, Vec<(FaceId, Vec<CriticalCurve>)>) {
    let scene = build(&fixture(name));
    let evaluator = Evaluator::new(&scene);
    let faces: Vec<FaceId> = scene.face_ids().collect();
    let of = |face: FaceId| {
        let found = antumbra::visibility::critical_curves(
            &evaluator,
            face,
            EventKinds::ALL,
            2f64.powi(-24),
            &Control::NEVER,
        )
        .unwrap_or_default();
        (face, found.curves)
    };
    let curves = faces.into_iter().map(of).collect();
    drop(evaluator);
    (scene, curves)
}

/// Six decimals, no negative zero.
fn rounded(x: f64) -> String {
    let text = format!("{x:.6}");
    if text
        .trim_start_matches('-')
        .chars()
        .all(|c| c == '0' || c == '.')
    {
        "0.000000".to_owned()
    } else {
        text
    }
}

/// One row per curve: kind, order, emitter, and its ends from left to right.
fn row(scene: &Scene, curve: &CriticalCurve) -> String {
    let end = |p: DVec3| {
        let p = scene.frame.to_file(p);
        format!("({} {} {})", rounded(p.x), rounded(p.y), rounded(p.z))
    };
    let [first, last] = curve.shape.ends();
    let mut ends = [end(first), end(last)];
    ends.sort();
    let emitter = curve
        .emitter
        .map_or("-", |f| scene.surface_of(f).name.as_str());
    let kind = curve.kind();
    format!(
        "{} {} {emitter} {} {}",
        kind.key(),
        order_key(kind.discontinuity()),
        ends[0],
        ends[1]
    )
}

fn curve_table(name: &str) -> String {
    let (scene, faces) = curves(name);
    let mut table = String::new();
    for (face, curves) in faces.iter().filter(|(_, curves)| !curves.is_empty()) {
        let counts: Vec<String> = EventKind::ALL
            .iter()
            .map(|&kind| (kind, curves.iter().filter(|c| c.kind() == kind).count()))
            .filter(|&(_, n)| n > 0)
            .map(|(kind, n)| format!("{} {n}", kind.key()))
            .collect();
        let _ = writeln!(
            table,
            "{}: {}",
            scene.surface_of(*face).name,
            counts.join(", ")
        );
        let mut rows: Vec<String> = curves.iter().map(|c| row(&scene, c)).collect();
        rows.sort();
        for row in rows {
            let _ = writeln!(table, "  {row}");
        }
    }
    table
}

#[test]
fn critical_curves_of_the_fixtures() {
    for name in names() {
        insta::assert_snapshot!(
            format!("curves__{}", name.replace('/', "__")),
            curve_table(&name)
        );
    }
}

#[test]
fn numbers_of_critical_curves_of_large_fixtures() {
    let mut table = String::new();
    for name in LARGE.into_iter().filter(|name| !name.contains("64")) {
        let scene = build(&fixture(name));
        let (options, control) = (Options::default(), Control::NEVER);
        let plan = antumbra::plan(&scene, &options, antumbra::Quantity::Direct, &control);
        let _ = writeln!(table, "{name}");
        for kind in EventKind::ALL {
            let k = kind as usize;
            let _ = writeln!(
                table,
                "  {}: {} candidates, {} curves, {} lines at 1e-3",
                kind.key(),
                plan.candidates[k],
                plan.curves[k],
                plan.lines[k]
            );
        }
        let sum = |n: &[u64; 6]| n.iter().sum::<u64>();
        assert!(
            sum(&plan.candidates) <= 20 * sum(&plan.curves),
            "{name}: culling lets too many candidates through"
        );
    }
    insta::assert_snapshot!("numbers_of_curves", table);
}

/// What a mesh holds: changes with every change of refinement.
fn statistics(name: &str) -> String {
    let (
        scene,
        Outcome {
            mesh: direct,
            curves,
            ..
        },
    ) = meshed(name);
    let mut table = format!(
        "{:?}, measured {:.2e}\n",
        direct.ended, direct.measured_max_error
    );
    for (mesh, ReceiverCurves { n_border, .. }) in direct.receivers.iter().zip(&curves) {
        let mut by_order: Vec<String> = orders_of(mesh)[*n_border..]
            .iter()
            .map(|&order| mesh_order_key(order).to_owned())
            .collect();
        by_order.sort();
        by_order.dedup();
        let _ = writeln!(
            table,
            "  {}: {} elements, {} nodes, curves of {}",
            scene.surface_of(mesh.face).name,
            mesh.n_elements(),
            mesh.nodes.len(),
            if by_order.is_empty() {
                "no order".to_owned()
            } else {
                by_order.join(" ")
            }
        );
    }
    table
}

#[test]
fn mesh_statistics_of_the_fixtures() {
    let mut all = String::new();
    for name in names() {
        let _ = write!(all, "{name}: {}", statistics(&name));
    }
    insta::assert_snapshot!("mesh_statistics", all);
}

/// Exact irradiance along a short line across a curve, at multiples of a step.
struct Profile<'a> {
    light: &'a ExactLight<'a, 'a>,
    face: FaceId,
    middle: DVec3,
    across: DVec3,
}

impl Profile<'_> {
    fn at(&self, t: f64) -> f64 {
        self.light.at(
            self.face,
            self.middle + self.across * t,
            &mut Scratch::default(),
        )[0]
    }

    /// How much the k-th derivative differs between the two sides, from values at
    /// 1, 2, … steps on either side; times the step to the k.
    fn jump(&self, order: Discontinuity, h: f64) -> f64 {
        let one_sided = |s: f64| {
            let [a, b, c, d] = [1.0, 2.0, 3.0, 4.0].map(|k| self.at(s * k * h));
            match order {
                // Cubic extrapolation of value, slope and curvature to the curve.
                Discontinuity::D0 => 4.0 * a - 6.0 * b + 4.0 * c - d,
                Discontinuity::D1 => s * (-26.0 * a + 57.0 * b - 42.0 * c + 11.0 * d) / 6.0,
                Discontinuity::D2 => 3.0 * a - 8.0 * b + 7.0 * c - 2.0 * d,
            }
        };
        (one_sided(1.0) - one_sided(-1.0)).abs()
    }
}

/// The jump of the derivative that the curve's order names is there, and only at
/// the curve: a step beside it the same formula gives next to nothing.
///
/// Returns the number of curves that show no kink.
fn smooth_curves(name: &str, kinds: &[EventKind]) -> (usize, Vec<String>) {
    let (scene, faces) = curves(name);
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let (mut n, mut smooth) = (0, Vec::new());
    for (face, curves) in faces
        .iter()
        .filter(|f| scene.surface_of(f.0).name == "floor")
    {
        let normal = scene.face(*face).normal;
        for curve in curves.iter().filter(|c| kinds.contains(&c.kind())) {
            let [a, b] = curve.shape.ends();
            let Some(along) = (b - a).try_normalize() else {
                continue;
            };
            // Several places: other curves may run close by at one of them.
            let places = [0.137, 0.271, 0.419, 0.583, 0.733, 0.877];
            let is_kinked = places.iter().any(|&t| {
                let middle = a + (b - a) * t;
                let profile = Profile {
                    light: &light,
                    face: *face,
                    middle,
                    across: normal.cross(along),
                };
                let order = curve.kind().discontinuity();
                let h = 2f64.powi(-9);
                let here = profile.jump(order, h);
                let beside = |s: f64| {
                    let middle = middle + profile.across * (s * 9.5 * h);
                    Profile { middle, ..profile }.jump(order, h)
                };
                here > 1e-12 && here > 4.0 * beside(1.0).min(beside(-1.0))
            });
            n += 1;
            if !is_kinked {
                smooth.push(format!(
                    "{}: {}",
                    scene.surface_of(*face).name,
                    row(&scene, curve)
                ));
            }
        }
    }
    (n, smooth)
}

fn every_curve_bends_the_light(name: &str, kinds: &[EventKind]) {
    let (n, smooth) = smooth_curves(name, kinds);
    assert!(n > 0, "{name} has no such curve");
    assert!(
        smooth.is_empty(),
        "{name}: no kink at {} of {n} curves:\n  {}",
        smooth.len(),
        smooth.join("\n  ")
    );
}

#[test]
fn emitter_ve_curves_of_a_tilted_triangle_bend_the_curvature() {
    every_curve_bends_the_light("basic/tilted-triangle", &[EventKind::Ve]);
}

#[test]
fn ee_curves_of_parallel_rectangles_bend_the_slope() {
    every_curve_bends_the_light("alignment/rectangle-under-rectangle", &[EventKind::Ee]);
}

#[test]
fn facet_curve_of_a_panel_bends_the_slope() {
    every_curve_bends_the_light("basic/facet-cuts-lamp-and-floor", &[EventKind::Facet]);
}

#[test]
fn horizon_curve_of_an_upright_lamp_bends_the_slope() {
    every_curve_bends_the_light("basic/horizon-crosses-floor", &[EventKind::Horizon]);
}

#[test]
fn contact_curves_of_a_box_on_the_floor_make_irradiance_jump() {
    every_curve_bends_the_light("contact/box-without-bottom-on-floor", &[EventKind::Contact]);
}

#[test]
fn contact_curve_of_a_plate_through_the_floor_makes_irradiance_jump() {
    every_curve_bends_the_light("penetration/plate-through-floor", &[EventKind::Contact]);
}
