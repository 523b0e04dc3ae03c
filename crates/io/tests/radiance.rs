//! Rooms and generated objects of Radiance and the programs around it.

use antumbra_io::ReadError;
use antumbra_io::rad::{self, RadFile};
use antumbra_scene::{LengthUnit, Scene, SceneInput};
use std::path::PathBuf;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn read(folder: &str, names: &[&str]) -> Result<SceneInput, ReadError> {
    let folder = fixture(folder);
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).map_err(|e| e.to_string());
    let files: Vec<RadFile> = names
        .iter()
        .map(|name| RadFile {
            name: (*name).to_owned(),
            text: text(name).expect("the fixture exists"),
        })
        .collect();
    rad::read(&files, &mut |_, name| text(name), LengthUnit::Metre)
}

fn opened(scene: &SceneInput) -> Vec<String> {
    let built = Scene::build(scene).expect("the room is accepted");
    let warnings = built.warnings.into_iter();
    warnings
        .filter(|w| w.kind == "keyhole")
        .map(|w| w.names[0].clone())
        .collect()
}

#[test]
fn included_room_is_the_room_of_its_parts() {
    let materials = "materials.rad";
    let included = read("real/pyradiance-room", &[materials, "room.rad"]).unwrap();
    let parts = [
        "Ground",
        "ExteriorWalls",
        "Floor",
        "InteriorWall",
        "Ceiling",
    ];
    let parts = parts.map(|name| format!("objects/{name}.rad"));
    let mut names = vec![materials];
    names.extend(parts.iter().map(String::as_str));
    let given = read("real/pyradiance-room", &names).unwrap();
    assert_eq!(given, included);
    assert_eq!((given.surfaces.len(), given.materials.len()), (18, 5));
    assert!(given.materials.iter().all(|m| m.two_sided));
    assert!(given.notes.is_empty(), "{:?}", given.notes);
    // One of the holes runs the way of its outline.
    assert_eq!(opened(&given), ["f_5_0", "f_19_0"]);

    names.push("objects/Glazing.rad");
    let glazed = read("real/pyradiance-room", &names).unwrap();
    assert_eq!(glazed.surfaces.len(), 19);
    assert!(glazed.notes[0].contains("'Glazing' is glass: 1 polygon is black"));
    let scene = Scene::build(&glazed).unwrap().scene;
    let area = |name: &str| scene.surface_area(scene.surface_named(name).unwrap());
    // The wall of 6.452524 m × 3.055937 m without the window of 6.096 m × 1.524 m.
    assert!((area("f_5_0") - (6.452524 * 3.055937 - 6.096 * 1.524)).abs() < 1e-9);
    // Closed by the pane, and without it open at the window, all but the outside.
    assert_eq!(scene.open_rooms(), []);
}

#[test]
fn four_holes_bridged_to_one_corner_are_opened() {
    let names: Vec<String> = [
        "ceiling", "floor", "wall", "window_0", "window_1", "window_2", "window_3",
    ]
    .iter()
    .map(|name| format!("{name}_openroom.rad"))
    .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let scene = read("real/frads-openroom", &names).unwrap();
    assert_eq!(scene.surfaces.len(), 27);
    let unknown: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(
        unknown,
        ["white_paint_70", "carpet_20", "white_paint_50", "glass_60"]
    );
    assert_eq!(scene.notes.len(), 4, "{:?}", scene.notes);
    assert_eq!(opened(&scene), ["wall.south.00", "wall.south.01"]);
    let built = Scene::build(&scene).unwrap().scene;
    let id = built.surface_named("wall.south.01").unwrap();
    let face = &built.faces[built.surfaces[id.index()].faces.start as usize];
    assert_eq!(face.holes.len(), 4);
    assert!((built.surface_area(id) - (36.0 - 4.0 * 4.5)).abs() < 1e-9);
    assert_eq!(built.open_rooms(), []);
}

#[test]
fn diorama_has_its_luminaire_and_its_materials() {
    let names = ["basic.mat", "diorama_walls.rad", "rect_fixture.rad"];
    let scene = read("real/radiance-diorama", &names).unwrap();
    assert_eq!(scene.surfaces.len(), 11);
    let lamp = scene
        .materials
        .iter()
        .find(|m| m.name == "lum_bright")
        .unwrap();
    assert_eq!(lamp.exitance, [20.0 * std::f64::consts::PI; 3]);
    let floor = scene
        .materials
        .iter()
        .find(|m| m.name == "floor_mat")
        .unwrap();
    assert_eq!(floor.reflectance, [0.3 * 0.98, 0.2 * 0.98, 0.1 * 0.98]);
    assert_eq!(opened(&scene), ["wall.b", "wall.t"]);
}

#[test]
fn generated_objects_are_read_and_the_round_ones_counted() {
    for (name, n, notes) in [
        ("genbox-ref.rad", 26, &["'tmat' (26 polygons)"][..]),
        (
            "genprism-ref.rad",
            10,
            &[
                "'tmat' (10 polygons)",
                "22 cylinders left out",
                "12 spheres left out",
            ],
        ),
        ("genblinds-ref.rad", 120, &["'mat' (120 polygons)"]),
    ] {
        let scene = read("real/radiance-diorama", &[name]).unwrap();
        assert_eq!(scene.surfaces.len(), n, "{name}");
        assert_eq!(scene.notes.len(), notes.len(), "{:?}", scene.notes);
        for (said, expected) in scene.notes.iter().zip(notes) {
            assert!(said.contains(expected), "{said}");
        }
        let built = Scene::build(&scene).unwrap().scene;
        assert_eq!(built.open_rooms(), [], "{name}");
    }
}

#[test]
fn hostile_files_end_in_an_error_with_its_line() {
    for (name, line, what) in [
        ("too-few-reals", Some(1), "3 real arguments (5 are needed)"),
        (
            "ends-in-polygon",
            Some(2),
            "has 12 real arguments, but the file ends after 6",
        ),
        ("count-too-large", Some(1), "but the file ends after 9"),
        (
            "count-overflows",
            Some(1),
            "'18446744073709551616' is no number of real",
        ),
        ("count-too-small", Some(1), "'1' is no type"),
        (
            "not-by-threes",
            Some(1),
            "10 real arguments (3 for each corner",
        ),
        ("unknown-type", Some(1), "'polygone' is no type"),
        ("no-number", Some(1), "'one' is not a number"),
        ("nan", Some(1), "'nan' is not finite"),
        ("no-integer", Some(1), "'x' is not a whole number"),
        ("empty", None, "no polygon in it: is it a Radiance file?"),
        ("no-polygon", None, "no polygon in it"),
        ("round", None, "does it include itself?"),
    ] {
        let error = read("rad", &[&format!("{name}.rad")]).unwrap_err();
        assert_eq!(error.line, line, "{name}: {error}");
        assert!(error.message.contains(what), "{name}: {error}");
    }
}
