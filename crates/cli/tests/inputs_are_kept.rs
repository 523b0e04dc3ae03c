//! Outputs never replace what the scene is read from, by whatever name.

#![allow(clippy::unwrap_used, reason = "a failing test says where")]

mod common;

use common::{Ended, antumbra, fixture, folder, names_in, run};
use std::path::{Path, PathBuf};

/// A scene in a folder of its own.
fn scene_in(folder: &Path) -> PathBuf {
    let path = folder.join("scene.json");
    std::fs::copy(fixture("basic/unoccluded.json"), &path).unwrap();
    path
}

/// Refuses, names the output, and leaves all files as they were.
fn check_refusal(ended: &Ended, says: &str, folder: &Path, names: &[&str]) {
    assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains(says), "{}", ended.stderr);
    assert_eq!(names_in(folder), names);
    let original = std::fs::read(fixture("basic/unoccluded.json")).unwrap();
    let kept = std::fs::read(folder.join("scene.json"));
    assert!(kept.map_or(true, |kept| kept == original));
}

#[test]
fn an_output_over_the_scene_is_refused_whatever_the_command_and_the_spelling() {
    let folder = folder("over-the-scene");
    let scene = scene_in(&folder);
    std::fs::create_dir(folder.join("sub")).unwrap();
    let around = folder.join("sub/../scene.json");
    for verb in ["mesh", "solve", "factors", "study"] {
        for output in [&scene, &around] {
            let ended = run(antumbra().arg(verb).arg(&scene).arg("-o").arg(output));
            check_refusal(
                &ended,
                "which the scene is read from",
                &folder,
                &["scene.json", "sub"],
            );
        }
    }
    let ended = run(antumbra()
        .args(["reduce", "--while", "panic"])
        .arg(&scene)
        .arg("-o")
        .arg(&around));
    check_refusal(
        &ended,
        "which the scene is read from",
        &folder,
        &["scene.json", "sub"],
    );
}

#[test]
#[cfg(unix)]
fn links_to_the_scene_are_the_scene() {
    let folder = folder("links-to-the-scene");
    let scene = scene_in(&folder);
    let [soft, hard] = ["soft.json", "hard.json"].map(|name| folder.join(name));
    std::os::unix::fs::symlink(&scene, &soft).unwrap();
    std::fs::hard_link(&scene, &hard).unwrap();
    let names = ["hard.json", "scene.json", "soft.json"];
    for [from, to] in [
        [&scene, &soft],
        [&scene, &hard],
        [&soft, &scene],
        [&soft, &hard],
    ] {
        let ended = run(antumbra().arg("mesh").arg(from).arg("-o").arg(to));
        check_refusal(&ended, "which the scene is read from", &folder, &names);
    }
}

/// The name of what is included says nothing of what it is.
#[test]
fn files_that_the_scene_includes_are_kept() {
    let folder = folder("included");
    let floor = "void plastic grey\n0\n0\n5 .5 .5 .5 0 0\n\ngrey polygon floor\n0\n0\n12\n\
                 0 0 0 1 0 0 1 1 0 0 1 0\n";
    std::fs::write(folder.join("floor.json"), floor).unwrap();
    std::fs::write(folder.join("all.rad"), "!xform floor.json\n").unwrap();
    let ended = run(antumbra()
        .arg("factors")
        .arg(folder.join("all.rad"))
        .arg("-o")
        .arg(folder.join("floor.json")));
    check_refusal(
        &ended,
        "which the scene is read from",
        &folder,
        &["all.rad", "floor.json"],
    );
    assert_eq!(
        std::fs::read_to_string(folder.join("floor.json")).unwrap(),
        floor
    );
}

#[test]
fn two_outputs_are_two_files() {
    let folder = folder("two-outputs");
    let scene = scene_in(&folder);
    std::fs::create_dir(folder.join("sub")).unwrap();
    let [one, other] = ["out.svg", "sub/../out.svg"].map(|name| folder.join(name));
    let ended = run(antumbra().arg("mesh").arg(&scene).args([
        "-o".as_ref(),
        one.as_os_str(),
        "-o".as_ref(),
        other.as_os_str(),
    ]));
    check_refusal(
        &ended,
        "is the same file as",
        &folder,
        &["scene.json", "sub"],
    );
}
