//! Limits of time and memory, interrupts, full disks: what is written is whole and valid,
//! and nothing else remains.

#![allow(clippy::unwrap_used, reason = "a failing test says where")]

mod common;

use common::{antumbra, fixture, folder, hall, names_in, run, start, wait};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A hall in a folder of its own.
fn hall_in(folder: &Path, n: u32) -> PathBuf {
    let path = folder.join("hall.json");
    std::fs::write(&path, hall(n)).unwrap();
    path
}

/// A partial report: what it says is unfinished adds up, and errors are numbers or said
/// to be unknown.
fn check_partial(report: &Value) {
    let receivers = report["receivers"].as_u64().unwrap();
    let by_progress = report["stopped"]["receivers"].as_object().unwrap();
    let sum: u64 = by_progress.values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(sum, receivers, "{by_progress:?}");
    let error = &report["measured_max_error"];
    assert!(error.is_null() == (report["elements"] == 0) && (error.is_null() || error.is_f64()));
    assert_eq!(report["tolerance_reached"], false);
    for effect in report["effects"].as_array().unwrap() {
        let words = effect["reason"].as_str().unwrap();
        let is_event = ["ve", "ee", "eee"].contains(&effect["name"].as_str().unwrap());
        // Of what was not looked at, nothing is promised.
        assert!(
            !is_event || effect["bound"] == 1.0 || effect["decision"] == "absent",
            "{words}"
        );
    }
}

/// A mesh in a JSON file: as many values as nodes, none of them negative or missing.
fn check_mesh(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap();
    let mesh: Value = serde_json::from_str(&text).unwrap();
    for surface in mesh["surfaces"].as_array().unwrap() {
        let nodes = surface["nodes"].as_array().unwrap().len();
        for (name, values) in surface["fields"].as_object().unwrap() {
            let values = values.as_array().unwrap();
            assert_eq!(values.len(), nodes, "{name} of {}", surface["name"]);
            let bands = values.iter().flat_map(|v| v.as_array().unwrap());
            assert!(bands.clone().count() >= nodes);
            assert!(bands.clone().all(|v| v.as_f64().is_some_and(|v| v >= 0.0)));
        }
        for element in surface["elements"].as_array().unwrap() {
            let ids = element["nodes"].as_array().unwrap();
            assert!(ids.iter().all(|i| (i.as_u64().unwrap() as usize) < nodes));
        }
    }
    mesh
}

#[test]
fn budget_far_too_small_for_the_scene_leaves_a_valid_partial_result() {
    let folder = folder("budget");
    let scene = hall_in(&folder, 20);
    let [json, vtu] = ["out.json", "out.vtu"].map(|name| folder.join(name));
    let ended = run(antumbra()
        .args(["mesh", "--budget", "1", "--json", "--quiet"])
        .arg(&scene)
        .arg("-o")
        .arg(&json)
        .arg("-o")
        .arg(&vtu));
    assert_eq!(ended.code(), Some(6), "{}", ended.stderr);
    let report = ended.json();
    check_partial(&report);
    assert_eq!(report["stopped"]["by"], "the budget of time");
    check_mesh(&json);
    assert_eq!(names_in(&folder), ["hall.json", "out.json", "out.vtu"]);
}

#[test]
fn budget_that_ends_in_any_phase_leaves_a_valid_partial_result() {
    let folder = folder("phases");
    let json = folder.join("out.json");
    for budget in ["0.02", "0.1", "0.3", "0.6"] {
        for verb in ["mesh", "solve"] {
            let ended = run(antumbra()
                .args([verb, "--budget", budget, "--json", "--quiet"])
                .args(["--events", "all", "--tolerance", "1e-4"])
                .arg(fixture("eee/boxes-16.json"))
                .arg("-o")
                .arg(&json));
            assert_eq!(ended.code(), Some(6), "{verb} {budget}: {}", ended.stderr);
            // So short a budget may end before the scene is read.
            if ended.stdout.is_empty() {
                assert!(ended.stderr.contains("before there was anything to write"));
                assert!(names_in(&folder).is_empty());
                continue;
            }
            check_partial(&ended.json());
            check_mesh(&json);
            assert_eq!(names_in(&folder), ["out.json"]);
            std::fs::remove_file(&json).unwrap();
        }
    }
}

#[test]
fn budget_in_which_the_scene_cannot_be_read_leaves_no_file() {
    let folder = folder("reading");
    let scene = hall_in(&folder, 60);
    let ended = run(antumbra()
        .args(["mesh", "--budget", "1e-6", "--json"])
        .arg(&scene)
        .arg("-o")
        .arg(folder.join("out.json")));
    assert_eq!(ended.code(), Some(6));
    assert!(ended.stdout.is_empty());
    assert!(
        ended
            .stderr
            .contains("stopped by the budget of time before there was anything to write"),
        "{}",
        ended.stderr
    );
    assert_eq!(names_in(&folder), ["hall.json"]);
}

#[test]
fn budget_that_ends_while_outputs_are_tried_leaves_no_half_written_file() {
    // Some of these end in the middle of trying so many.
    for budget in ["0.01", "0.02", "0.03", "0.04", "0.05", "0.06"] {
        let folder = folder("trying");
        let mut command = antumbra();
        command
            .args(["mesh", "--quiet", "--budget", budget])
            .arg(fixture("basic/tilted-triangle.json"));
        for k in 0..1000 {
            command.arg("-o").arg(folder.join(format!("{k}.svg")));
        }
        let ended = run(&mut command);
        assert!(matches!(ended.code(), Some(0 | 6)), "{}", ended.stderr);
        assert!(names_in(&folder).iter().all(|name| !name.contains(".part")));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn memory_stays_below_its_limit() {
    let folder = folder("memory");
    let scene = fixture("eee/boxes-64.json");
    for (verb, limit) in [("mesh", 60u64), ("solve", 100)] {
        let ended = run(antumbra()
            .args([verb, "--json", "--quiet", "--events", "all"])
            .args(["--max-memory", &format!("{limit}MB")])
            .arg(&scene)
            .arg("-o")
            .arg(folder.join("out.json")));
        assert_eq!(ended.code(), Some(6), "{verb}: {}", ended.stderr);
        let report = ended.json();
        check_partial(&report);
        assert_eq!(report["stopped"]["by"], "the limit of memory");
        let peak = report["peak_memory_bytes"].as_u64().unwrap();
        assert!(peak <= limit << 20, "{verb}: {peak} bytes with {limit} MB");
        check_mesh(&folder.join("out.json"));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn interreflection_without_room_for_its_matrix_leaves_direct_light() {
    let folder = folder("matrix");
    let scene = hall_in(&folder, 12);
    let out = folder.join("out.json");
    // 721 faces have more than 4,000 nodes: 140 MB and more.
    let ended = run(antumbra()
        .args([
            "solve",
            "--json",
            "--quiet",
            "--tolerance",
            "0.2",
            "--degree",
            "1",
        ])
        .args(["--events", "none", "--max-memory", "120MB"])
        .arg(&scene)
        .arg("-o")
        .arg(&out));
    assert_eq!(ended.code(), Some(6), "{}", ended.stderr);
    let report = ended.json();
    assert_eq!(report["stopped"]["interreflection"], "no room");
    assert!(
        report["stopped"]["interreflection_needs_bytes"]
            .as_u64()
            .unwrap()
            > 100_000_000
    );
    assert!(report["power"].is_null() && report["converged"] == false);
    assert!(report["peak_memory_bytes"].as_u64().unwrap() <= 120 << 20);
    let mesh = check_mesh(&out);
    for surface in mesh["surfaces"].as_array().unwrap() {
        let fields: Vec<&String> = surface["fields"].as_object().unwrap().keys().collect();
        assert_eq!(fields, ["direct"]);
    }
    let interreflection = report["effects"]
        .as_array()
        .unwrap()
        .iter()
        .find(|e| e["name"] == "interreflection")
        .unwrap();
    assert_eq!(interreflection["decision"], "left out");
    assert_eq!(interreflection["bound"], 1.0);
}

#[cfg(unix)]
fn interrupt(child: &std::process::Child) {
    send("-INT", child);
}

#[cfg(unix)]
fn send(signal: &str, child: &std::process::Child) {
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args([signal, &id])
            .status()
            .unwrap()
            .success()
    );
}

/// Schedulers ask with SIGTERM.
#[test]
#[cfg(unix)]
fn interrupt_or_a_request_to_end_leaves_a_valid_partial_result() {
    for signal in ["-INT", "-TERM"] {
        let folder = folder(&format!("interrupt{signal}"));
        let scene = hall_in(&folder, 20);
        let out = folder.join("out.json");
        let child = start(
            antumbra()
                .args(["mesh", "--json"])
                .arg(&scene)
                .arg("-o")
                .arg(&out),
        );
        // Well after the scene is read, long before it is meshed.
        std::thread::sleep(std::time::Duration::from_secs(2));
        send(signal, &child);
        let ended = wait(child);
        assert_eq!(ended.code(), Some(130), "{signal}: {}", ended.stderr);
        check_partial(&ended.json());
        check_mesh(&out);
        assert_eq!(names_in(&folder), ["hall.json", "out.json"]);
    }
}

#[test]
fn factors_that_were_not_computed_are_missing_and_no_zeros() {
    let folder = folder("missing-factors");
    let scene = hall_in(&folder, 20);
    let [csv, json, txt] = ["out.csv", "out.json", "out.txt"].map(|name| folder.join(name));
    let ended = run(antumbra()
        .args(["factors", "--budget", "1", "--tolerance", "1e-12", "--json"])
        .arg("--quiet")
        .arg(&scene)
        .args([
            "-o".as_ref(),
            csv.as_os_str(),
            "-o".as_ref(),
            json.as_os_str(),
        ])
        .args(["-o".as_ref(), txt.as_os_str()]));
    assert_eq!(ended.code(), Some(6), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("pairs of faces were left out"),
        "{}",
        ended.stderr
    );
    assert!(
        ended.stderr.contains("out.txt: not written"),
        "{}",
        ended.stderr
    );
    assert_eq!(names_in(&folder), ["hall.json", "out.csv", "out.json"]);
    let report = ended.json();
    assert!(report["pairs_left_out"].as_u64().unwrap() > 0);
    let file: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let rows = file["factors"].as_array().unwrap();
    let is_missing = |row: usize| rows[row].as_array().unwrap().iter().any(Value::is_null);
    assert!((0..rows.len()).any(is_missing));
    for row in 0..rows.len() {
        assert_eq!(
            file["row_sums"][row].is_null(),
            is_missing(row),
            "row {row}"
        );
        assert_eq!(
            report["raw_row_sums"][row].is_null(),
            is_missing(row),
            "row {row}"
        );
    }
    let text = std::fs::read_to_string(&csv).unwrap();
    for (row, line) in text.lines().skip(1).enumerate() {
        assert_eq!(
            line.split(',').any(str::is_empty),
            is_missing(row),
            "row {row}"
        );
    }
}

#[test]
fn a_check_that_is_stopped_says_what_it_did_not_look_at() {
    let folder = folder("check-budget");
    let scene = hall_in(&folder, 60);
    let ended = run(antumbra().args(["check", "--budget", "1e-6"]).arg(&scene));
    assert_eq!(ended.code(), Some(6));
    assert!(ended.stdout.is_empty() && ended.stderr.contains("the budget of time"));
    let ended = run(antumbra()
        .args(["check", "--json", "--budget", "600"])
        .arg(&scene));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    assert_eq!(ended.json()["complete"], true);
}

#[test]
fn every_command_takes_a_budget_and_says_what_a_partial_result_is() {
    for verb in [
        "check", "plan", "probe", "factors", "mesh", "solve", "render", "study", "reduce",
    ] {
        let ended = run(antumbra().args([verb, "--help"]));
        assert!(ended.stdout.contains("--budget <SECONDS>"), "{verb}");
        let words = [
            "Partial result (exit codes 6, 130)",
            "the smallest scene so far",
        ];
        assert!(words.iter().any(|w| ended.stdout.contains(w)), "{verb}");
    }
}

#[test]
#[cfg(unix)]
fn second_interrupt_ends_at_once_and_leaves_no_half_written_file() {
    let folder = folder("interrupt-twice");
    let scene = hall_in(&folder, 20);
    let child = start(
        antumbra()
            .args(["mesh", "--json"])
            .arg(&scene)
            .arg("-o")
            .arg(folder.join("out.json")),
    );
    std::thread::sleep(std::time::Duration::from_secs(2));
    interrupt(&child);
    std::thread::sleep(std::time::Duration::from_millis(50));
    interrupt(&child);
    let ended = wait(child);
    assert_eq!(ended.code(), Some(130), "{}", ended.stderr);
    assert!(names_in(&folder).iter().all(|name| !name.contains(".part")));
}

#[test]
fn places_that_cannot_be_written_are_told_before_any_work() {
    let folder = folder("places");
    std::fs::create_dir(folder.join("folder.json")).unwrap();
    let protected = folder.join("protected.json");
    std::fs::write(&protected, "mine").unwrap();
    let mut permissions = std::fs::metadata(&protected).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&protected, permissions).unwrap();
    for (name, why) in [
        ("folder.json", "is a folder"),
        ("protected.json", "read-only"),
        ("missing/out.json", "does not exist"),
    ] {
        let ended = run(antumbra()
            .arg("mesh")
            .arg(fixture("basic/unoccluded.json"))
            .arg("-o")
            .arg(folder.join(name)));
        assert_eq!(ended.code(), Some(2), "{name}: {}", ended.stderr);
        assert!(
            ended.stderr.contains(name) && ended.stderr.contains(why),
            "{}",
            ended.stderr
        );
    }
    assert_eq!(std::fs::read_to_string(&protected).unwrap(), "mine");
    assert_eq!(names_in(&folder), ["folder.json", "protected.json"]);
}

/// A shell in which no file can grow beyond this many blocks of 512 bytes, as on a full
/// disk.
#[cfg(target_os = "linux")]
fn with_files_of_at_most(blocks: u32) -> Command {
    let mut shell = Command::new("sh");
    shell
        .args(["-c", &format!("ulimit -f {blocks}; exec \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_antumbra"))
        .stdin(Stdio::null());
    shell
}

#[test]
#[cfg(target_os = "linux")]
fn full_disk_is_an_error_that_names_the_file_and_leaves_nothing() {
    let folder = folder("full");
    let ended = run(with_files_of_at_most(4)
        .args(["mesh", "--quiet"])
        .arg(fixture("basic/tilted-triangle.json"))
        .arg("-o")
        .arg(folder.join("out.json")));
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("out.json: cannot be written: "),
        "{}",
        ended.stderr
    );
    assert!(names_in(&folder).is_empty(), "{:?}", names_in(&folder));
}

#[test]
#[cfg(target_os = "linux")]
fn file_that_cannot_be_written_does_not_keep_others_from_it() {
    let folder = folder("second");
    let before = folder.join("large.json");
    std::fs::write(&before, "as it was").unwrap();
    let ended = run(with_files_of_at_most(100)
        .args(["mesh", "--quiet"])
        .arg(fixture("basic/tilted-triangle.json"))
        .arg("-o")
        .arg(folder.join("first.svg"))
        .arg("-o")
        .arg(&before)
        .arg("-o")
        .arg(folder.join("third.svg")));
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("large.json: cannot be written: "),
        "{}",
        ended.stderr
    );
    assert!(
        ended.stderr.contains("written all the same: "),
        "{}",
        ended.stderr
    );
    assert_eq!(names_in(&folder), ["first.svg", "large.json", "third.svg"]);
    // What was there before is still there.
    assert_eq!(std::fs::read_to_string(&before).unwrap(), "as it was");
}

#[test]
#[cfg(target_os = "linux")]
fn full_standard_output_is_an_error_and_a_closed_one_is_none() {
    let full = std::fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let child = antumbra()
        .args(["mesh", "--json", "--quiet"])
        .arg(fixture("basic/unoccluded.json"))
        .stdout(full)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let ended = wait(child);
    assert_eq!(ended.code(), Some(1));
    assert!(
        ended.stderr.contains("standard output: cannot be written"),
        "{}",
        ended.stderr
    );

    let mut child = start(
        antumbra()
            .args(["mesh", "--json", "--quiet"])
            .arg(fixture("basic/unoccluded.json")),
    );
    drop(child.stdout.take());
    let ended = wait(child);
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    assert_eq!(ended.stderr, "");
}
