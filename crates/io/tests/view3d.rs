//! View3D's own example files.

use antumbra_io::{ReadError, scene_file, vs3};
use antumbra_scene::{LengthUnit, Scene, SceneInput, SurfaceId};
use std::path::PathBuf;

fn text(name: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/real/view3d");
    std::fs::read_to_string(folder.join(name)).expect("the fixture exists")
}

fn read(name: &str) -> Result<SceneInput, ReadError> {
    vs3::read(&text(name), LengthUnit::Metre)
}

#[test]
fn surfaces_stand_and_face_as_in_the_validation_cases() {
    for (name, case) in [
        ("facet.vs3", "facet.json"),
        ("test4.vs3", "test4.json"),
        ("test4a.vs3", "test4.json"),
        ("3d-pinney.vs3", "test4.json"),
        ("gunter1.vs3", "gunter1.json"),
        ("3d-test.vs3", "gunter1.json"),
        ("box345.vs3", "box345.json"),
    ] {
        let scene = read(name).unwrap();
        let expected = scene_file::read(&text(&format!("expected/{case}"))).unwrap();
        assert_eq!(scene.surfaces.len(), expected.surfaces.len(), "{name}");
        for (found, expected) in scene.surfaces.iter().zip(&expected.surfaces) {
            // The cases are named NUMBER:NAME; where the format turns a plane, the
            // loop may start elsewhere.
            let n = expected.vertices.len();
            let is_same = (0..n).any(|k| {
                (0..n).all(|i| {
                    let (a, b) = (found.vertices[(i + k) % n], expected.vertices[i]);
                    if name == "test4a.vs3" {
                        a.abs_diff_eq(b, 1e-15)
                    } else {
                        a == b
                    }
                })
            });
            assert_eq!(found.vertices.len(), n, "{name} {}", found.name);
            assert!(is_same, "{name}: {found:?} is not {expected:?}");
        }
        assert_eq!(scene.materials.len(), 1);
        assert_eq!(scene.materials[0].reflectance, [0.1]);
        assert!(
            Scene::build(&scene).unwrap().scene.report().closed,
            "{name}"
        );
    }
}

#[test]
fn door_and_window_are_cut_out_of_their_wall() {
    let scene = read("wdwdoor.vs3").unwrap();
    let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names[..8],
        [
            "z=0", "z=3", "x=0", "x=6", "y=0", "door:y=0", "wdw:y=0", "8:y=5"
        ]
    );
    assert_eq!(names[10], "8:y=5/11:y=5");
    let built = Scene::build(&scene).unwrap().scene;
    let area = |name: &str| built.surface_area(built.surface_named(name).unwrap());
    assert_eq!(
        [area("y=0"), area("door:y=0"), area("wdw:y=0")],
        [14.0, 2.0, 2.0]
    );
    let wall = &scene.surfaces[4];
    assert_eq!((wall.vertices.len(), wall.holes.len()), (8, 1));
    // The other long wall, made of parts, has as much.
    let parts = |s: &&antumbra_scene::Surface| s.name.starts_with("8:y=5");
    let ids = built.surfaces.iter().enumerate().filter(|(_, s)| parts(s));
    let area: f64 = ids
        .map(|(i, _)| built.surface_area(SurfaceId(i as u32)))
        .sum();
    assert_eq!(area, 14.0);
    assert!(built.report().closed);
    let notes = scene.notes.join("\n");
    assert!(
        notes.contains("'y=0': 'door:y=0', 'wdw:y=0' are cut out of it"),
        "{notes}"
    );
    assert!(
        notes.contains("'8:y=5/11:y=5', a part of '8:y=5'"),
        "{notes}"
    );
}

#[test]
fn many_obstructions_are_read() {
    let scene = read("gunter2.vs3").unwrap();
    assert_eq!(scene.surfaces.len(), 398);
    assert!(scene.notes.iter().any(|n| n.contains("share their names")));
    Scene::build(&scene).unwrap();
}

#[test]
fn broken_examples_are_refused_with_the_line() {
    for (name, line, what) in [
        ("3d-pinney-g4.vs3", 10, "is the file one of F 3a?"),
        ("3d-pinney-tri.vs3", 7, "'1' starts no line"),
    ] {
        let error = read(name).unwrap_err();
        assert_eq!(error.line, Some(line), "{name}: {error}");
        assert!(error.message.contains(what), "{error}");
    }
}

#[test]
fn hostile_files_end_in_an_error_with_its_line() {
    for (name, line, what) in [
        (
            "vertex-missing",
            7,
            "vertex 9 as a corner, but the file has 4 vertices",
        ),
        ("zero-vertex", 7, "vertex 0 as corner 2"),
        ("too-few-columns", 7, "surface 1 has 6 columns"),
        ("emittance-above-one", 7, "emittance 90 (allowed 0 to 1)"),
        ("no-number-of-one", 7, "'3.5' is no number of one"),
        ("masking-surface", 8, "'M' is a masking surface"),
        ("unknown-letter", 8, "'Q' starts no line"),
        (
            "surface-out-of-sequence",
            7,
            "surface 2 is out of sequence (1 is next)",
        ),
        ("base-later", 7, "lies in base 2 (allowed an earlier"),
        (
            "combined-chain",
            9,
            "combined with 2, which is combined itself",
        ),
        (
            "sub-surface-outside",
            11,
            "'window' does not lie within its base, 'wall'",
        ),
        (
            "sub-surface-off-plane",
            11,
            "'window' lies 1.000e-1 off the plane",
        ),
        ("sub-surface-turned", 11, "'window' faces the other way"),
        (
            "sub-surfaces-overlap",
            12,
            "'pane' overlaps sub-surface 'window'",
        ),
        ("huge-number", 7, "'1e999' is not finite"),
        ("two-dimensions", 2, "two dimensions"),
        (
            "unicode-hyphen",
            3,
            "'1e‑1' is not a number: it has '‑' (U+2011)",
        ),
        ("plane-cut-short", 3, "ends after 6 of 7 numbers"),
        ("plane-unknown-shape", 2, "shape 'X' (allowed R, T and Q)"),
        ("unknown-geometry", 1, "geometry '4' is unknown"),
    ] {
        let error = read(&format!("../../vs3/{name}.vs3")).unwrap_err();
        assert_eq!(error.line, Some(line), "{name}: {error}");
        assert!(error.message.contains(what), "{name}: {error}");
    }
    let error = read("../../vs3/no-surface.vs3").unwrap_err();
    assert!(error.message.contains("no surface in it"), "{error}");
}

#[test]
fn nested_sub_surfaces_are_each_cut_out_of_their_own_base() {
    let scene = read("../../vs3/nested.vs3").unwrap();
    let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names,
        ["wall.1", "wall.2", "door", "pane", "plate", "surface.5"]
    );
    let built = Scene::build(&scene).unwrap().scene;
    let area = |name: &&str| built.surface_area(built.surface_named(name).unwrap());
    let areas: Vec<f64> = names.iter().map(area).collect();
    assert_eq!(areas, [3.0, 6.0, 2.5, 0.5, 0.5, 5.5]);
    // Emittance 0 is 0.001, as in View3D, and an obstruction is black.
    let reflectances: Vec<f64> = scene.materials.iter().map(|m| m.reflectance[0]).collect();
    assert_eq!(reflectances, [0.1, 0.2, 0.999, 0.0]);
    let notes = scene.notes.join("\n");
    assert!(
        notes.contains("2 pieces are left, 'wall.1' to 'wall.2'"),
        "{notes}"
    );
    assert!(notes.contains("1 obstruction (O) is black"), "{notes}");
}
