//! Faces thinner than the pixels of their arrangement: named, counted as unresolved, and
//! everything else is done.

mod common;

use common::{antumbra, fixture, folder, run};
use serde_json::Value;

/// A floor, a lamp, and a surface with these corners.
fn scene(name: &str, material: &str, corners: &[[f64; 3]]) -> std::path::PathBuf {
    let text = serde_json::json!({
        "antumbra": 1,
        "materials": {
            "grey": { "reflectance": 0.5 },
            "both": { "reflectance": 0.5, "two_sided": true },
            "lamp": { "exitance": 1 },
        },
        "surfaces": [
            { "name": "floor", "material": "grey",
              "vertices": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]] },
            { "name": "lamp", "material": "lamp",
              "vertices": [[0, 1, 3], [1, 1, 3], [1, 0, 3], [0, 0, 3]] },
            { "name": "thin", "material": material, "vertices": corners },
        ],
    });
    let path = folder("thin").join(name);
    std::fs::write(&path, text.to_string()).expect("a folder that can be written");
    path
}

fn warning_of(report: &Value, key: &str) -> String {
    let warnings = report[key].as_array().expect("a list of warnings");
    let texts = warnings.iter().map(|w| match &w["message"] {
        Value::String(text) => text.clone(),
        _ => w.as_str().unwrap_or_default().to_owned(),
    });
    let mut named = texts.filter(|text| text.contains("count as unresolved"));
    named.next().unwrap_or_default()
}

#[test]
fn a_thin_face_is_named_and_counted_and_the_rest_is_done() {
    let path = fixture("regressions/face-thinner-than-a-pixel.json");
    let check = run(antumbra().args(["check", "--json"]).arg(&path));
    assert_eq!(check.code(), Some(0), "{}", check.stderr);
    let said = warning_of(&check.json(), "problems");
    assert!(said.starts_with("surface 'rim': 1.000e-8 m wide"), "{said}");
    for verb in [&["mesh"][..], &["solve"], &["mesh", "--mesher", "graded"]] {
        let done = run(antumbra().args(verb).arg("--json").arg(&path));
        assert_eq!(done.code(), Some(0), "{verb:?}: {}", done.stderr);
        let report = done.json();
        assert_eq!(warning_of(&report, "warnings"), said);
        assert_eq!(report["unresolved_elements"], 2, "{verb:?}");
        let share = report["unresolved_area_fraction"].as_f64().unwrap();
        assert!((share - 2e-8 / 17.0).abs() < 1e-12, "{verb:?}: {share:e}");
    }
}

#[test]
fn thin_shapes_of_every_kind_are_meshed() {
    for w in [1e-9, 3e-10] {
        let strip = [
            [-1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0 + w],
            [-1.0, 0.0, 1.0 + w],
        ];
        let sliver = [[-1.0, 0.1, 1.0], [1.0, -0.2, 1.3], [0.2, -0.08 + w, 1.18]];
        let angle = [
            [-1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0 + w],
            [-1.0 + w, 0.0, 1.0 + w],
            [-1.0 + w, 0.0, 2.0],
            [-1.0, 0.0, 2.0],
        ];
        let arm = [
            [-1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 0.0, 1.0 + w],
            [0.0, 0.0, 1.0 + w],
            [0.0, 0.0, 2.0],
            [-1.0, 0.0, 2.0],
        ];
        let shapes: [(&str, &[[f64; 3]]); 4] = [
            ("strip", &strip),
            ("sliver", &sliver),
            ("angle", &angle),
            ("arm", &arm),
        ];
        for (name, corners) in shapes {
            for material in ["grey", "lamp", "both"] {
                let path = scene(&format!("{name}.json"), material, corners);
                for verb in ["mesh", "solve"] {
                    let done = run(antumbra().args([verb, "--json", "--quiet"]).arg(&path));
                    assert_eq!(
                        done.code(),
                        Some(0),
                        "{name} {w:e} {material}: {}",
                        done.stderr
                    );
                    let report = done.json();
                    let is_told = !warning_of(&report, "warnings").is_empty();
                    let share = report["unresolved_area_fraction"].as_f64().unwrap();
                    assert_eq!(is_told, share > 0.0, "{name} {w:e} {material}");
                    assert!(is_told, "{name} {w:e} {material}");
                }
            }
        }
    }
}
