//! Files made by others: read, or refused with a clear word.

use antumbra_io::{obj, scene_file};
use antumbra_scene::{LengthUnit, Scene, SceneInput, Severity, Side};
use std::path::PathBuf;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn read_obj(name: &str) -> Result<SceneInput, antumbra_io::ReadError> {
    let path = fixture(name);
    let text = std::fs::read_to_string(&path).expect("the fixture exists");
    let mut load =
        |mtl: &str| std::fs::read_to_string(path.with_file_name(mtl)).map_err(|e| e.to_string());
    obj::read(&text, &mut load, LengthUnit::Metre)
}

fn messages(scene: &SceneInput) -> (bool, Vec<String>) {
    match Scene::build(scene) {
        Ok(built) => (
            true,
            built.warnings.into_iter().map(|p| p.message).collect(),
        ),
        Err(problems) => (false, problems.into_iter().map(|p| p.message).collect()),
    }
}

#[test]
fn torture_files_end_in_a_scene_or_a_clear_error() {
    let mut n = 0;
    for entry in std::fs::read_dir(fixture("obj")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.ends_with(".obj") {
            continue;
        }
        n += 1;
        match read_obj(&format!("obj/{name}")) {
            Err(error) => assert!(error.line.is_some(), "{name}: {error}"),
            Ok(scene) => {
                if let Err(problems) = Scene::build(&scene) {
                    let mut errors = problems.iter().filter(|p| p.severity == Severity::Error);
                    assert!(errors.all(|p| !p.names.is_empty()), "{name}: {problems:?}");
                }
            }
        }
    }
    assert!(n >= 13, "only {n} files found");
}

#[test]
fn unusable_faces_are_named() {
    let (ok, said) = messages(&read_obj("obj/invalid-face-definition.obj").unwrap());
    assert!(!ok);
    let said = said.join("\n");
    assert!(
        said.contains("'front cube': has 1 vertex, at least 3"),
        "{said}"
    );
    assert!(
        said.contains("'back cube': has 2 vertices, at least 3"),
        "{said}"
    );

    let (ok, said) = messages(&read_obj("obj/test-nan.obj").unwrap());
    let said = said.join("\n");
    assert!(!ok && said.contains("surface 'floor.1': vertex (NaN, NaN, NaN) is not finite"));

    let error = read_obj("obj/issue-140-zero-face-idx.obj").unwrap_err();
    assert_eq!(error.line, Some(16));
}

#[test]
fn closed_cubes_are_closed_wherever_they_stand() {
    for name in [
        "issue-161-inconsistent-f",
        "cube-vertex-w-component",
        "issue-295-trianguation-failure",
    ] {
        let scene = Scene::build(&read_obj(&format!("obj/{name}.obj")).unwrap())
            .unwrap()
            .scene;
        assert!(scene.report().closed, "{name}");
        assert_eq!(scene.planes.len(), 6, "{name}");
    }
}

#[test]
fn cornell_box_builds_with_one_warning_about_its_wall() {
    let text = std::fs::read_to_string(fixture("real/cornell-box.json")).unwrap();
    let input = scene_file::read(&text).unwrap();
    assert_eq!(scene_file::write(&input), text);
    let built = Scene::build(&input).unwrap();
    let said: Vec<&str> = built.warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(
        said,
        [
            "surface 'left_red': not planar: a vertex lies 0.005 m off its plane, 0.001759 of its size (allowed 1e-9 of its size); split into 2 triangles"
        ]
    );
    let scene = built.scene;
    assert_eq!(
        (scene.surfaces.len(), scene.faces.len(), scene.n_bands),
        (16, 17, 3)
    );

    // Every wall faces the lamp's middle, and the lamp the floor.
    let lamp = scene.surface_named("light").unwrap();
    let lamp = antumbra_scene::FaceId(scene.surfaces[lamp.index()].faces.start);
    let middle = scene
        .positions(&scene.face(lamp).outline)
        .iter()
        .sum::<glam::DVec3>()
        / 4.0;
    assert!(scene.face(lamp).normal.y < -0.99);
    for name in ["floor", "ceiling", "back", "right_green", "left_red"] {
        let faces = scene.surfaces[scene.surface_named(name).unwrap().index()]
            .faces
            .clone();
        for f in faces.map(antumbra_scene::FaceId) {
            let chart = scene.chart(f);
            assert!(chart.height(middle) > 0.0, "{name}");
        }
    }
    // The boxes stand on the floor by declaration.
    let floor = scene.surface_named("floor").unwrap();
    let floor = scene.faces[scene.surfaces[floor.index()].faces.start as usize].plane;
    let front = scene.surface_named("short_front").unwrap();
    let front = &scene.faces[scene.surfaces[front.index()].faces.start as usize];
    let on = front
        .outline
        .iter()
        .filter(|&&v| scene.side(v, floor) == Side::On);
    assert_eq!(on.count(), 2);
}

#[test]
fn cornell_obj_without_its_library_is_grey_and_says_so() {
    let scene = read_obj("real/cornell-mcguire/CornellBox-Original-Merged.obj").unwrap();
    assert_eq!(scene.surfaces.len(), 16);
    assert_eq!(scene.surfaces[0].name, "CornellBox-Original.1");
    assert_eq!(scene.notes.len(), 2, "{:?}", scene.notes);
    let (ok, said) = messages(&scene);
    assert!(ok && said.iter().any(|m| m.contains("no surface emits")));
}

#[test]
fn misplaced_wall_of_an_l_shaped_zone_is_named() {
    let rooms = |name: &str| {
        let path = fixture("real/energyplus-lshaped").join(name);
        let text = std::fs::read_to_string(path).unwrap();
        let scene = Scene::build(&scene_file::read(&text).unwrap())
            .unwrap()
            .scene;
        let rooms = scene.open_rooms();
        rooms
            .iter()
            .map(|room| room.problem(&scene))
            .collect::<Vec<_>>()
    };
    let found = rooms("zone1.json");
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].names[0], "NorthWall-2");
    assert_eq!(
        found[0].message,
        "no partner for the border of 'NorthWall-2' (83 % of it), and a room of 9 surfaces is open: between (0, 6.096, 0) and (6.096, 6.096, 3.048) its edges join nothing, 18.29 m in all, at 'Roof-1' (6.096 m), 'Floor-1' (6.096 m), 'West Wall-1' (3.048 m), 'WestWall-2' (3.048 m)"
    );
    assert_eq!(rooms("zone1-corrected.json"), []);
}
