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
