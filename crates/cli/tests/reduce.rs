//! `antumbra reduce`.

mod common;

use common::{antumbra, fixture, folder, names_in, run};
use serde_json::Value;

#[test]
#[cfg(unix)]
fn what_a_command_needs_is_what_remains() {
    let folder = folder("reduce");
    let out = folder.join("small.json");
    let reduce = || {
        run(antumbra()
            .args(["reduce", "--json", "--quiet"])
            // Fails as long as a surface of this name is there.
            .args(["--while", "command=! grep -q '\"box-3-top\"'"])
            .arg(fixture("eee/boxes-8.json"))
            .arg("-o")
            .arg(&out))
    };
    let ended = reduce();
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    let report = ended.json();
    assert_eq!(report["minimal"], true);
    assert_eq!(report["after"]["surfaces"], 1);
    assert_eq!(report["after"]["corners"], 3);
    let text = std::fs::read_to_string(&out).unwrap();
    let scene: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(scene["surfaces"][0]["name"], "box-3-top");
    assert_eq!(names_in(&folder), ["small.json"]);

    assert_eq!(reduce().json()["tries"], report["tries"]);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), text);
}

#[test]
fn a_scene_that_does_not_fail_is_refused_and_nothing_is_written() {
    let folder = folder("reduce-fine");
    for failure in [
        "panic",
        "negative",
        "above-unoccluded",
        "above-tolerance",
        "check",
    ] {
        let ended = run(antumbra()
            .args(["reduce", "--while", failure, "--points", "200"])
            .arg(fixture("basic/tilted-triangle.json"))
            .arg("-o")
            .arg(folder.join("small.json"))
            .args(["--", "--tolerance", "1e-2"]));
        assert_eq!(ended.code(), Some(4), "{failure}: {}", ended.stderr);
        assert!(ended.stderr.contains("does not fail"), "{}", ended.stderr);
    }
    assert!(names_in(&folder).is_empty());
}

#[test]
fn a_try_that_takes_too_long_is_ended_and_any_format_is_read() {
    let folder = folder("reduce-slow");
    let out = folder.join("small.json");
    // No process is that fast.
    let ended = run(antumbra()
        .args(["reduce", "--while", "slow=1e-9", "--quiet"])
        .arg(fixture("obj/cube-vertex-w-component.obj"))
        .arg("-o")
        .arg(&out));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    let text = std::fs::read_to_string(&out).unwrap();
    let scene: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(scene["surfaces"].as_array().unwrap().len(), 1);
}

#[test]
fn failures_that_are_none_and_budgets_are_told() {
    let ended = run(antumbra()
        .args(["reduce", "--while", "boredom"])
        .arg(fixture("basic/unoccluded.json")));
    assert_eq!(ended.code(), Some(2));
    assert!(ended.stderr.contains("above-tolerance"), "{}", ended.stderr);

    let ended = run(antumbra()
        .args([
            "reduce",
            "--while",
            "slow=1e-9",
            "--budget",
            "1e-9",
            "--quiet",
        ])
        .arg(fixture("basic/unoccluded.json")));
    assert_eq!(ended.code(), Some(6), "{}", ended.stderr);
    let scene: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert!(!scene["surfaces"].as_array().unwrap().is_empty());
}
