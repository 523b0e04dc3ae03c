//! Scenes made by others (`fixtures/real`, and what is valid of `fixtures/obj`): read,
//! checked, meshed, and compared with exact light at random points.
//!
//! `ANTUMBRA_POINTS` asks for more check points.

use antumbra::io::{self, ReadError};
use antumbra::scene::{LengthUnit, MaterialInput};
use antumbra::{Problem, Scene, SceneInput, Severity};
use antumbra_tests::cases::{build, fixtures};
use antumbra_tests::check_points::compare;
use antumbra_tests::scenes::{Facing, add_horizontal};
use glam::DVec3;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What lights a scene when it is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lamp {
    /// Its own.
    Own,
    /// Its last surface, with exitance 1 and no reflectance.
    Last,
    /// A square over a corner of it that faces down: its surfaces face out.
    Above,
}

/// One scene, of one file or of several of Radiance.
#[derive(Debug)]
struct RealScene {
    /// Paths inside `fixtures`.
    files: &'static [&'static str],
    lamp: Lamp,
}

/// The scenes that are valid, and a test for each.
macro_rules! real_scenes {
    ($($(#[$attribute:meta])* $name:ident: $lamp:ident, [$($file:literal),+ $(,)?];)*) => {
        const SCENES: &[RealScene] = &[
            $(RealScene { files: &[$($file),+], lamp: Lamp::$lamp },)*
        ];
        $(
            #[test]
            $(#[$attribute])*
            fn $name() {
                check(&RealScene { files: &[$($file),+], lamp: Lamp::$lamp });
            }
        )*
    };
}

real_scenes! {
    cornell_box: Own, ["real/cornell-box.json"];
    cornell_mcguire: Last, ["real/cornell-mcguire/CornellBox-Original-Merged.obj"];
    cornell_bevy: Own, ["real/cornell-bevy/CornellBox.glb"];
    cornell_tobj: Last, ["obj/no_material.obj"];
    cornell_tobj_missing_library: Last, ["obj/missing_material_file.obj"];
    tobj_cube_with_w: Above, ["obj/cube-vertex-w-component.obj"];
    tobj_cube_mixed_faces: Above, ["obj/issue-161-inconsistent-f.obj"];
    tobj_long_cube: Above, ["obj/issue-295-trianguation-failure.obj"];
    tobj_thin_face: Above, ["obj/issue-319-002.obj"];
    tobj_one_triangle: Above, ["obj/leading-zero-in-exponent-notation-issue-210.obj"];
    tobj_two_squares: Above, ["obj/smoothing-group-two-squares.obj"];
    energyplus_zone: Own, ["real/energyplus-lshaped/zone1.json"];
    energyplus_zone_corrected: Own, ["real/energyplus-lshaped/zone1-corrected.json"];
    frads_open_room: Last, [
        "real/frads-openroom/ceiling_openroom.rad",
        "real/frads-openroom/wall_openroom.rad",
        "real/frads-openroom/window_0_openroom.rad",
        "real/frads-openroom/window_1_openroom.rad",
        "real/frads-openroom/window_2_openroom.rad",
        "real/frads-openroom/window_3_openroom.rad",
        // Last, for its front is inside; that of the ceiling is not.
        "real/frads-openroom/floor_openroom.rad",
    ];
    gltf_box: Above, ["real/gltf-box/Box.gltf"];
    gltf_box_binary: Above, ["real/gltf-box/Box.glb"];
    pyradiance_room: Last, [
        "real/pyradiance-room/materials.rad",
        "real/pyradiance-room/room.rad",
    ];
    r3l_tile_room: Last, ["real/r3l-tile-room/tile-game-room6.glb"];
    radiance_diorama: Own, [
        "real/radiance-diorama/basic.mat",
        "real/radiance-diorama/diorama_walls.rad",
        "real/radiance-diorama/rect_fixture.rad",
    ];
    radiance_blinds: Last, ["real/radiance-diorama/genblinds-ref.rad"];
    radiance_box: Above, ["real/radiance-diorama/genbox-ref.rad"];
    radiance_prism: Above, ["real/radiance-diorama/genprism-ref.rad"];
    sparrowpy_cube: Above, ["real/sparrowpy-cube/cube.stl"];
    view3d_box345: Last, ["real/view3d/box345.vs3"];
    view3d_facet: Last, ["real/view3d/facet.vs3"];
    view3d_gunter1: Last, ["real/view3d/gunter1.vs3"];
    view3d_gunter2: Last, ["real/view3d/gunter2.vs3"];
    view3d_parallel_planes: Last, ["real/view3d/ParallelPlanes.vs3"];
    view3d_pinney: Last, ["real/view3d/3d-pinney.vs3"];
    view3d_test: Last, ["real/view3d/3d-test.vs3"];
    view3d_test4: Last, ["real/view3d/test4.vs3"];
    view3d_test4a: Last, ["real/view3d/test4a.vs3"];
    view3d_wdwdoor: Last, ["real/view3d/wdwdoor.vs3"];
}

/// Files that cannot be read or are refused, with a word about it.
const REFUSED: &[&str] = &[
    "obj/cornell_box_multimaterial.obj",
    "obj/invalid-face-definition.obj",
    "obj/invalid-relative-vertex-index.obj",
    "obj/issue-140-zero-face-idx.obj",
    "obj/test-nan.obj",
    "real/view3d/3d-pinney-g4.vs3",
    "real/view3d/3d-pinney-tri.vs3",
];

/// Random points a scene and tolerance.
fn n_points() -> usize {
    let asked = std::env::var("ANTUMBRA_POINTS").ok();
    asked.and_then(|n| n.parse().ok()).unwrap_or(500)
}

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|e| e.to_string())
}

fn text(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| e.to_string())
}

/// Reads a scene as the command line does: by the extension of its first file.
fn read(files: &[&str]) -> Result<SceneInput, ReadError> {
    let unit = LengthUnit::Metre;
    let path = fixtures().join(files[0]);
    let beside = |name: &str| path.with_file_name(name);
    let all_text = || text(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let all_bytes = || bytes(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    match path.extension().and_then(|e| e.to_str()) {
        Some("json") => io::scene_file::read(&all_text()),
        Some("obj") => io::obj::read(&all_text(), &mut |name| text(&beside(name)), unit),
        Some("gltf" | "glb") => {
            io::gltf::read(&all_bytes(), &mut |name| bytes(&beside(name)), unit)
        }
        Some("stl") => io::stl::read(&all_bytes(), unit),
        Some("vs3") => io::vs3::read(&all_text(), unit),
        Some("rad" | "mat") => rad(files),
        other => panic!("{}: no reader for {other:?}", path.display()),
    }
}

fn rad(files: &[&str]) -> Result<SceneInput, ReadError> {
    let files: Vec<io::rad::RadFile> = files
        .iter()
        .map(|&name| io::rad::RadFile {
            name: name.to_owned(),
            text: text(&fixtures().join(name)).unwrap_or_else(|e| panic!("{name}: {e}")),
        })
        .collect();
    let mut load = |root: &str, name: &str| {
        let folder = Path::new(root).parent().unwrap_or(Path::new("."));
        text(&fixtures().join(folder).join(name))
    };
    io::rad::read(&files, &mut load, LengthUnit::Metre)
}

/// The same scene with light in it.
fn lit(mut input: SceneInput, lamp: Lamp) -> SceneInput {
    let name = "lamp of the test";
    if lamp != Lamp::Own {
        input.materials.push(MaterialInput {
            name: name.to_owned(),
            reflectance: vec![0.0],
            exitance: vec![1.0],
            two_sided: false,
        });
    }
    match lamp {
        Lamp::Own => {}
        Lamp::Last => {
            if let Some(last) = input.surfaces.last_mut() {
                name.clone_into(&mut last.material);
            }
        }
        Lamp::Above => {
            let corners = || {
                input
                    .surfaces
                    .iter()
                    .flat_map(|s| s.vertices.iter().copied())
            };
            let min = corners().fold(DVec3::INFINITY, DVec3::min);
            let max = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
            let half = 0.25 * (max - min).max_element();
            let (x, y) = ([max.x - half, max.x + half], [max.y - half, max.y + half]);
            let z = max.z + 2.0 * half;
            add_horizontal(&mut input, name, name, (x, y, z), Facing::Down);
        }
    }
    input
}

/// Three digits.
fn short(x: f64) -> String {
    let rounded = format!("{x:.2e}").parse::<f64>().unwrap_or(f64::NAN);
    rounded.to_string()
}

/// Findings by kind: how many, and the first two by name.
fn problems_by_kind(table: &mut String, problems: &[Problem]) {
    let mut by_kind: BTreeMap<(Severity, &str), Vec<&Problem>> = BTreeMap::new();
    for problem in problems {
        let kind = (problem.severity, problem.kind);
        by_kind.entry(kind).or_default().push(problem);
    }
    for ((severity, kind), found) in by_kind {
        let severity = match severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let _ = writeln!(
            table,
            "  {severity} {kind}: {}{}",
            found.len(),
            named(&found)
        );
    }
}

/// The names of the first two findings that have some.
fn named(found: &[&Problem]) -> String {
    let names: Vec<String> = found
        .iter()
        .filter(|p| !p.names.is_empty())
        .take(2)
        .map(|p| p.names[..p.names.len().min(2)].join(" + "))
        .collect();
    if names.is_empty() {
        String::new()
    } else {
        format!(", {}", names.join(", "))
    }
}

/// What the check of a scene says.
fn geometry(files: &[&str], lamp: Option<Lamp>) -> String {
    let mut table = files.join(" ");
    table.push('\n');
    let input = match read(files) {
        Ok(input) => input,
        Err(error) => {
            let _ = writeln!(table, "  cannot be read: {error}");
            return table;
        }
    };
    let built = match Scene::build(&input) {
        Ok(built) => built,
        Err(problems) => {
            problems_by_kind(&mut table, &problems);
            return table;
        }
    };
    let report = built.scene.report();
    let size = report.extent_metres.to_array().map(short).join(" x ");
    let _ = writeln!(
        table,
        "  {} surfaces, {} faces, {} emitters, {size} m, {}",
        report.surfaces,
        report.faces,
        report.emitters,
        if report.closed { "closed" } else { "open" },
    );
    problems_by_kind(&mut table, &built.warnings);
    for room in built.scene.open_rooms() {
        let problem = room.problem(&built.scene);
        let _ = writeln!(
            table,
            "  open room of {} surfaces, {} of gaps: {}",
            room.surfaces.len(),
            short(room.gap_length),
            problem
                .names
                .iter()
                .take(2)
                .cloned()
                .collect::<Vec<_>>()
                .join(", "),
        );
    }
    if !input.notes.is_empty() {
        let _ = writeln!(table, "  {} notes of the reader", input.notes.len());
    }
    match lamp {
        Some(Lamp::Own) | None => {}
        Some(Lamp::Last) => {
            let last = input.surfaces.last().map_or("", |s| s.name.as_str());
            let _ = writeln!(table, "  meshed with '{last}' as lamp");
        }
        Some(Lamp::Above) => table.push_str("  meshed with a lamp above it\n"),
    }
    table
}

#[test]
fn real_scenes_and_what_the_check_says() {
    let mut tables: Vec<String> = SCENES
        .iter()
        .map(|scene| geometry(scene.files, Some(scene.lamp)))
        .chain(REFUSED.iter().map(|&file| geometry(&[file], None)))
        .collect();
    tables.sort();
    insta::assert_snapshot!("real_scenes", tables.concat());
}

/// A file that somebody adds is in one of the lists, or is named by one that is.
#[test]
fn no_real_scene_is_left_out() {
    let mut files = Vec::new();
    for folder in ["real", "obj"] {
        scene_files(&fixtures().join(folder), &mut files);
    }
    let known: Vec<PathBuf> = SCENES
        .iter()
        .flat_map(|scene| scene.files)
        .chain(REFUSED)
        .map(|file| fixtures().join(file))
        .collect();
    files.retain(|file| !known.contains(file));
    files.sort();
    assert!(known.len() > 40 && files.is_empty(), "{files:#?}");
}

/// Scene files of a folder and of those in it; but neither validation cases nor parts
/// that other files name.
fn scene_files(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for path in entries.map(|entry| entry.expect("a folder that can be read").path()) {
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if path.is_dir() && !matches!(name, "expected" | "objects") {
            scene_files(&path, files);
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let formats = ["json", "obj", "gltf", "glb", "stl", "vs3", "rad", "mat"];
        if path.is_file() && formats.contains(&extension) {
            files.push(path);
        }
    }
}

/// Meshes a scene to two tolerances and compares with exact light.
#[expect(
    clippy::print_stdout,
    reason = "`--nocapture` shows the table of all scenes"
)]
fn check(real: &RealScene) {
    let name = real.files[0];
    let input = read(real.files).unwrap_or_else(|e| panic!("{name}: {e}"));
    let scene = build(&lit(input, real.lamp));
    let mut wrong = Vec::new();
    for tolerance in [1e-2, 1e-3] {
        let start = Instant::now();
        let found = compare(name, &scene, tolerance, 200_000, n_points());
        println!(
            "{name} | {} faces | {tolerance:e} | {} elements | {:.2} s | worst {:.2e} on {} | {} of {} above, {} unresolved",
            scene.report().faces,
            found.n_elements,
            start.elapsed().as_secs_f64(),
            found.worst,
            found.worst_place,
            found.n_above,
            found.n_points,
            found.n_unresolved,
        );
        assert!(found.peak > 0.0, "{name}: nothing is lit");
        wrong.extend(found.wrong);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The check says by how much the corners of a room miss, and with what length welding
/// joins them.
#[test]
fn zone_whose_corners_miss_can_be_welded() {
    let ragged = read(&["real/energyplus-lshaped/zone1-corrected.json"])
        .unwrap_or_else(|e| panic!("a scene: {e}"));
    let gaps = ragged.corner_gaps().expect("gaps");
    assert!(
        gaps.message.contains("welding with 5e-5 m"),
        "{}",
        gaps.message
    );
    let mut welded = ragged.clone();
    let report = welded
        .weld(5e-5)
        .unwrap_or_else(|p| panic!("{}", p.message));
    assert_eq!(Some(report.farthest), gaps.found);
    for (before, after) in ragged.surfaces.iter().zip(&welded.surfaces) {
        for (p, q) in before.vertices.iter().zip(&after.vertices) {
            assert!(p.distance(*q) <= 5e-5, "{p} moved to {q}");
        }
    }
    assert!(welded.corner_gaps().is_none());
    let name = "real/energyplus-lshaped/zone1-corrected.json, welded";
    let found = compare(name, &build(&welded), 1e-2, 200_000, n_points());
    assert!(found.wrong.is_empty(), "{}", found.wrong.join("\n"));
}
