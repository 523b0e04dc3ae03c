//! What other programs read is read here too, and what is wrong with a scene is said by all
//! commands that it matters to.
#![allow(clippy::unwrap_used, reason = "a failing test says where")]

mod common;

use common::{antumbra, fixture, folder};
use serde_json::Value;
use std::path::Path;

/// Exit code, standard output and standard error.
fn run(arguments: &[&str], scene: &Path) -> (Option<i32>, String, String) {
    let output = antumbra().args(arguments).arg(scene).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (
        output.status.code(),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn rows_and_copies_of_which_trees_become_chains_are_checked() {
    for (name, surfaces) in [
        ("row-of-touching-triangles.json", 151),
        ("row-of-slats.json", 302),
        ("copies-in-a-row.json", 136),
        ("saw-teeth.gltf", 140),
        ("strip.stl", 150),
    ] {
        let (code, out, err) = run(&["check", "--json"], &fixture("door").join(name));
        assert_eq!(code, Some(0), "{name}: {err}");
        let report: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(report["surfaces"], surfaces, "{name}");
    }
}

#[test]
fn reversed_wall_is_named_by_all_to_whom_it_matters() {
    let scene = fixture("door/reversed-wall.json");
    let (_, out, _) = run(&["check", "--json"], &scene);
    let report: Value = serde_json::from_str(&out).unwrap();
    let problems = report["problems"].as_array().unwrap();
    let flipped: Vec<&Value> = problems.iter().filter(|p| p["kind"] == "flipped").collect();
    assert_eq!(flipped.len(), 1);
    assert_eq!(flipped[0]["names"], serde_json::json!(["wall2"]));
    for verb in ["factors", "solve"] {
        let (code, out, err) = run(&[verb, "--json"], &scene);
        assert_eq!(code, Some(0), "{verb}: {err}");
        let report: Value = serde_json::from_str(&out).unwrap();
        let warnings = report["warnings"].as_array().unwrap();
        let said = |what: &str| warnings.iter().any(|w| w.as_str().unwrap().contains(what));
        assert!(said("'wall2': flipped"), "{verb}: {warnings:?}");
        assert!(err.contains("'wall2': flipped"), "{verb}: {err}");
        // Factors need no light.
        assert_eq!(said("no surface emits"), verb == "solve");
        assert_eq!(err.contains("no surface emits"), verb == "solve");
    }
}

#[test]
fn warped_surfaces_are_split_in_foreign_files_and_on_request() {
    let folder = folder("warped");
    let obj = folder.join("warped.obj");
    std::fs::write(&obj, "v 0 0 0\nv 1 0 0\nv 1 1 .3\nv 0 1 0\nf 1 2 3 4\n").unwrap();
    let (code, out, err) = run(&["check"], &obj);
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("split into 2 triangles"), "{out}");
    let json = folder.join("warped.json");
    let text = r#"{ "antumbra": 1, "materials": { "m": {} }, "surfaces": [{ "name": "p",
        "material": "m", "vertices": [[0,0,0],[1,0,0],[1,1,0.3],[0,1,0]] }] }"#;
    std::fs::write(&json, text).unwrap();
    let (code, _, err) = run(&["check"], &json);
    assert_eq!(code, Some(4));
    assert!(
        err.contains("'p': not planar") && err.contains("--triangulate"),
        "{err}"
    );
    for verb in ["check", "mesh", "solve", "factors", "plan"] {
        let (code, _, err) = run(&[verb, "--json", "--triangulate"], &json);
        assert_eq!(code, Some(0), "{verb}: {err}");
    }
}

#[test]
fn names_in_old_encodings_are_kept_and_said() {
    let folder = folder("encodings");
    let latin =
        |text: &str| -> Vec<u8> { text.chars().map(|c| u8::try_from(c).unwrap()).collect() };
    let wide = |text: &str| -> Vec<u8> {
        let units = [0xfeff].into_iter().chain(text.encode_utf16());
        units.flat_map(u16::to_le_bytes).collect()
    };
    let obj = "mtllib weiß.mtl\no Büro\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl Weiß\nf 1 2 3\n";
    let rad =
        "void plastic weiß\n0\n0\n5 .5 .5 .5 0 0\nweiß polygon Büro\n0\n0\n9 0 0 0 1 0 0 0 1 0\n";
    let mtl = "newmtl Weiß\nKd 1 1 1\n";
    std::fs::write(folder.join("weiß.mtl"), latin(mtl)).unwrap();
    for (name, bytes, encoding) in [
        ("latin.obj", latin(obj), "Latin-1"),
        ("wide.obj", wide(obj), "UTF-16"),
        ("latin.rad", latin(rad), "Latin-1"),
        ("wide.rad", wide(rad), "UTF-16"),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        let (code, out, err) = run(&["factors", "--json"], &path);
        assert_eq!(code, Some(0), "{name}: {err}");
        assert!(out.contains("Büro"), "{name}: {out}");
        assert!(
            err.contains(&format!("'{name}' is not UTF-8: read as {encoding}")),
            "{err}"
        );
    }
    // A scene file is UTF-8.
    let json = folder.join("latin.json");
    std::fs::write(&json, latin("{ \"antumbra\": 1, \"ö\": 1 }")).unwrap();
    assert_eq!(run(&["check"], &json).0, Some(3));
}
