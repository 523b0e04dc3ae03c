//! `antumbra check`, and welding before it.
#![allow(clippy::unwrap_used, reason = "a failing test says where")]

mod common;

use common::{antumbra, folder, run};
use std::path::{Path, PathBuf};

/// How far the walls of the room miss floor and ceiling.
const GAP: f64 = 1e-4;

/// A room of 1 m whose lamp is its ceiling; one corner of every wall misses by [`GAP`].
fn ragged_room(folder: &Path) -> PathBuf {
    let ring = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let at = |[x, y]: [f64; 2], z: f64| [x, y, z];
    let mut surfaces = vec![
        ("floor".to_owned(), "grey", ring.map(|p| at(p, 0.0))),
        (
            "ceiling".to_owned(),
            "lamp",
            [3, 2, 1, 0].map(|k: usize| at(ring[k], 1.0)),
        ),
    ];
    for k in 0..4 {
        let (a, b) = (ring[k], ring[(k + 1) % 4]);
        // Along the wall, so that it stays plane.
        let off = [0, 1].map(|i| b[i] + GAP * (b[i] - a[i]));
        let corners = [at(a, 0.0), at(a, 1.0), at(off, 1.0), at(b, 0.0)];
        surfaces.push((format!("wall-{k}"), "grey", corners));
    }
    let rows: Vec<String> = surfaces
        .iter()
        .map(|(name, material, corners)| {
            format!(
                "{{\"name\": \"{name}\", \"material\": \"{material}\", \"vertices\": {corners:?}}}"
            )
        })
        .collect();
    let text = format!(
        "{{\"antumbra\": 1, \"materials\": {{\"grey\": {{\"reflectance\": 0.5}}, \"lamp\": {{\"exitance\": 1}}}}, \"surfaces\": [\n{}\n]}}\n",
        rows.join(",\n")
    );
    let path = folder.join("room.json");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn ragged_room_is_closed_by_welding_and_its_corners_are_counted() {
    let folder = folder("weld");
    let room = ragged_room(&folder);
    let ended = run(antumbra().args(["check", "--json"]).arg(&room));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    let report = ended.json();
    assert_eq!(report["closed"], false);
    assert!(report["open_edges"].as_u64() > Some(0));
    assert!(report["notes"].as_array().unwrap().is_empty());

    let weld = ["check", "--json", "--weld", "2e-4"];
    let ended = run(antumbra().args(weld).arg(&room));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    let report = ended.json();
    assert_eq!(report["accepted"], true);
    assert_eq!(report["closed"], true);
    assert_eq!(report["open_edges"], 0);
    assert_eq!(
        report["notes"],
        serde_json::json!([
            "welded: 4 corners of 'wall-0', 'wall-1', 'wall-2', 'wall-3' moved, by at most 1.00e-4 m"
        ])
    );

    // Too short to reach anything: nothing moves.
    let weld = ["check", "--json", "--weld", "5e-5"];
    let report = run(antumbra().args(weld).arg(&room)).json();
    assert_eq!(report["closed"], false);
    assert!(report["notes"].as_array().unwrap().is_empty());
}

#[test]
fn welding_with_more_than_the_shortest_edge_is_refused_in_json_too() {
    let folder = folder("weld-refused");
    let room = ragged_room(&folder);
    let ended = run(antumbra()
        .args(["check", "--json", "--weld", "2"])
        .arg(&room));
    assert_eq!(ended.code(), Some(4), "{}", ended.stderr);
    let report = ended.json();
    assert_eq!(report["accepted"], false);
    assert!(report["notes"].as_array().unwrap().is_empty());
    let problems = report["problems"].as_array().unwrap();
    assert_eq!(problems.len(), 1);
    let problem = &problems[0];
    assert_eq!(problem["severity"], "error");
    assert_eq!(problem["kind"], "weld-too-large");
    assert_eq!(problem["found"], 2.0);
    assert_eq!(problem["allowed"], 1.0);
    let message = problem["message"].as_str().unwrap();
    assert!(message.contains("its edge from"), "{message}");
    assert!(
        ended.stderr.contains("the scene cannot be used: 1 error")
            && ended.stderr.contains(message),
        "{}",
        ended.stderr
    );

    // Other commands refuse it as they refuse any scene.
    let ended = run(antumbra()
        .args(["mesh", "--json", "--weld", "2"])
        .arg(&room));
    assert_eq!(ended.code(), Some(4), "{}", ended.stderr);
    assert!(ended.stdout.is_empty() && ended.stderr.contains(message));
}
