//! `antumbra study`.
#![allow(clippy::unwrap_used, reason = "a failing test says where")]

mod common;

use common::{antumbra, fixture, folder, names_in, run};

/// A study that is short and yet has all parts.
fn study(scene: &str, outputs: &[&std::path::Path]) -> common::Ended {
    let mut command = antumbra();
    command
        // The ladder ends long before the budget does.
        .args([
            "study", "--json", "--quiet", "--finest", "2e-2", "--budget", "120",
        ])
        .args(["--degrees", "1,2", "--points", "2000", "--repeats", "2"])
        .args(["--meshers", "uniform,restricted,discontinuity"])
        .arg(fixture(scene));
    for out in outputs {
        command.arg("-o").arg(out);
    }
    run(&mut command)
}

#[test]
fn a_study_is_one_page_and_its_tables_agree() {
    let folder = folder("study");
    let outputs: Vec<std::path::PathBuf> = ["s.csv", "s.html", "s.json", "s.png", "s.svg"]
        .iter()
        .map(|name| folder.join(name))
        .collect();
    let outputs: Vec<&std::path::Path> = outputs.iter().map(AsRef::as_ref).collect();
    let ended = study("alignment/rectangle-off-grid.json", &outputs);
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    assert_eq!(
        names_in(&folder),
        ["s.csv", "s.html", "s.json", "s.png", "s.svg"]
    );
    let report = ended.json();
    let file = std::fs::read_to_string(folder.join("s.json")).unwrap();
    assert_eq!(
        report,
        serde_json::from_str::<serde_json::Value>(&file).unwrap()
    );
    let series = report["series"].as_array().unwrap();
    assert_eq!(series.len(), 6);
    let n_runs: usize = series
        .iter()
        .map(|s| s["runs"].as_array().unwrap().len())
        .sum();
    let table = std::fs::read_to_string(folder.join("s.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + n_runs);
    assert!(n_runs >= 12, "{n_runs} runs");
    assert!(!report["estimators"].as_array().unwrap().is_empty());
    assert!(!report["steps"].as_array().unwrap().is_empty());
    for series in series {
        for run in series["runs"].as_array().unwrap() {
            for key in ["max", "rms", "penumbra_max", "penumbra_rms"] {
                let error = run["error"][key].as_f64().unwrap();
                assert!((0.0..=1.5).contains(&error), "{key} is {error}");
            }
            assert!(run["error"]["rms"].as_f64() <= run["error"]["max"].as_f64());
            assert!(run["elements"].as_u64() > Some(0));
            assert!(run["seconds"]["min"].as_f64() <= run["seconds"]["median"].as_f64());
        }
    }

    // Nothing is loaded from anywhere: the only addresses are names of SVG.
    let page = std::fs::read_to_string(folder.join("s.html")).unwrap();
    let addresses = page.split("http").skip(1);
    for address in addresses {
        assert!(
            address.starts_with("://www.w3.org/2000/svg"),
            "http{}",
            &address[..40]
        );
    }
    for wanted in ["<svg", "Pareto", "data:image/png;base64,", "antumbra study"] {
        assert!(page.contains(wanted), "no {wanted} in the page");
    }
    let advice = report["advice"].as_str().unwrap();
    assert!(advice.contains("--mesher"), "{advice}");
}

#[test]
fn the_discontinuity_mesh_has_full_order() {
    let ended = study("alignment/rectangle-off-grid.json", &[]);
    let report = ended.json();
    let series = report["series"].as_array().unwrap();
    let ours = series.iter().filter(|s| s["mesher"] == "discontinuity");
    for series in ours.clone() {
        let degree = series["degree"].as_f64().unwrap();
        let order = series["order_rms"].as_f64().unwrap();
        assert!(
            (order - degree - 1.0).abs() < 0.15,
            "degree {degree}: {order}"
        );
    }
    assert_eq!(ours.count(), 2);
}

#[test]
fn a_dark_scene_is_studied_too() {
    let ended = study("contact/closed-box-lit-from-outside.json", &[]);
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    assert!(ended.json()["advice"].as_str().unwrap().len() > 10);
}

#[test]
fn a_budget_ends_the_comparison_too() {
    let folder = folder("study-budget");
    let page = folder.join("s.html");
    // Exact values at so many points take minutes.
    let ended = run(antumbra()
        .args(["study", "--json", "--quiet", "--budget", "2"])
        .args(["--points", "3000000", "--meshers", "uniform"])
        .arg(fixture("eee/boxes-64.json"))
        .arg("-o")
        .arg(&page));
    assert_eq!(ended.code(), Some(6), "{}", ended.stderr);
    let advice = ended.json()["advice"].as_str().unwrap().to_owned();
    assert!(advice.ends_with("nothing was measured."), "{advice}");
    assert_eq!(names_in(&folder), ["s.html"]);
}

#[test]
fn wrong_words_are_refused_before_any_work() {
    for (words, said) in [
        (
            ["--meshers", "uniform,magic"],
            "tri-quadtree, adaptive, discontinuity is allowed",
        ),
        (["--degrees", "1,5"], "5"),
        (
            ["-o", "study.vtu"],
            "its extension is none that can be written here",
        ),
    ] {
        let ended = run(antumbra()
            .arg("study")
            .args(words)
            .arg("--json")
            .arg(fixture("basic/tilted-triangle.json")));
        assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains(said), "{}", ended.stderr);
    }
}
