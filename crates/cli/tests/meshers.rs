//! `--mesher`: generators that know nothing of shadows.

mod common;

use common::{antumbra, fixture, folder, names_in, run};

#[test]
fn every_generator_writes_every_format() {
    let folder = folder("meshers");
    for mesher in [
        "uniform",
        "graded",
        "quadtree",
        "restricted",
        "tri-quadtree",
        "adaptive",
    ] {
        for cells in ["triangles", "quads", "mixed"] {
            let mut command = antumbra();
            command
                .args([
                    "mesh",
                    "--json",
                    "--quiet",
                    "--elements",
                    "60",
                    "--degree",
                    "3",
                ])
                .args(["--mesher", mesher, "--cells", cells, "--size", "160x120"])
                .arg(fixture("basic/plate-with-hole.json"));
            for extension in ["json", "obj", "ply", "vtu", "csv", "svg", "png"] {
                command.arg("-o").arg(folder.join(format!("m.{extension}")));
            }
            let ended = run(&mut command);
            assert_eq!(ended.code(), Some(0), "{mesher} {cells}: {}", ended.stderr);
            let report = ended.json();
            assert_eq!(report["mesher"], mesher);
            let (triangles, quads) = (&report["triangles"], &report["quadrilaterals"]);
            assert_eq!(quads == 0, cells == "triangles", "{mesher} {cells}");
            assert!(triangles == 0 || cells != "quads" || mesher == "tri-quadtree");
            let has_t_vertices = report["t_vertices"] != 0;
            assert!(!has_t_vertices || !["uniform", "tri-quadtree"].contains(&mesher));
            assert_eq!(names_in(&folder).len(), 7);
            let text = std::fs::read_to_string(folder.join("m.json")).unwrap();
            let mesh: serde_json::Value = serde_json::from_str(&text).unwrap();
            let surfaces = mesh["surfaces"].as_array().unwrap();
            let elements = surfaces
                .iter()
                .flat_map(|s| s["elements"].as_array().unwrap());
            let n_quads = elements.filter(|e| e["shape"] == "quadrilateral").count();
            assert_eq!(quads.as_u64(), Some(n_quads as u64));
        }
    }
}

#[test]
fn options_that_make_no_sense_together_are_bad_usage() {
    let scene = fixture("basic/unoccluded.json");
    for (arguments, said) in [
        (vec!["mesh", "--json", "--cells", "quads"], "--cells"),
        (
            vec!["mesh", "--json", "--estimator", "residual"],
            "--estimator",
        ),
        (vec!["mesh", "--json", "--elements", "100"], "--elements"),
        (
            vec!["mesh", "--json", "--mesher", "uniform", "--events", "all"],
            "--events",
        ),
        (vec!["plan", "--mesher", "adaptive"], "plan"),
        (vec!["mesh", "--json", "--mesher", "octree"], "quadtree"),
        (
            vec![
                "mesh",
                "--json",
                "--mesher",
                "uniform",
                "--elements",
                "9",
                "--element-size",
                "1",
            ],
            "cannot be used",
        ),
    ] {
        let ended = run(antumbra().args(&arguments).arg(&scene));
        assert_eq!(ended.code(), Some(2), "{arguments:?}: {}", ended.stderr);
        assert!(
            ended.stderr.contains(said),
            "{arguments:?}: {}",
            ended.stderr
        );
    }
}

#[test]
fn solve_and_probe_know_the_generators() {
    let folder = folder("meshers-solve");
    let points = folder.join("points.csv");
    std::fs::write(&points, "surface,x,y,z\nfloor,0.3,0.2,0\n").unwrap();
    let scene = fixture("basic/unoccluded.json");
    let ended = run(antumbra()
        .args([
            "solve",
            "--json",
            "--quiet",
            "--mesher",
            "adaptive",
            "--tolerance",
            "1e-2",
        ])
        .arg(&scene));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    assert_eq!(ended.json()["converged"], true);
    let ended = run(antumbra()
        .args([
            "probe", "--json", "--exact", "--mesh", "--mesher", "uniform",
        ])
        .arg(&scene)
        .arg("--points")
        .arg(&points));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    let point = &ended.json()["points"][0];
    let [exact, mesh] = ["direct_exact", "direct_mesh"].map(|k| point[k].as_f64().unwrap());
    assert!((exact - mesh).abs() < 1e-3 * exact);
}

#[test]
fn a_tolerance_that_cells_do_not_reach_ends_in_exit_code_5() {
    let ended = run(antumbra()
        .args([
            "mesh", "--json", "--quiet", "--mesher", "adaptive", "--degree", "1",
        ])
        .args(["--tolerance", "1e-2"])
        .arg(fixture("contact/panel-on-wall.json")));
    assert_eq!(ended.code(), Some(5), "{}", ended.stderr);
    let report = ended.json();
    assert_eq!(report["tolerance_reached"], false);
    assert_ne!(report["unresolved_elements"], 0);
}

#[test]
fn sizes_below_the_least_one_are_told() {
    let scene = fixture("basic/unoccluded.json");
    let mesh = |words: &[&str]| {
        run(antumbra()
            .args(["mesh", "--json", "--quiet", "--degree", "1"])
            .args(words)
            .arg(&scene))
    };
    let told = |report: &serde_json::Value| -> Vec<String> {
        let warnings = report["warnings"].as_array().unwrap().iter();
        let texts = warnings.map(|w| w.as_str().unwrap().to_owned());
        texts.filter(|w| w.contains("asked for")).collect()
    };
    for mesher in ["uniform", "graded"] {
        for size in [["--element-size", "1e-4"], ["--elements", "100000"]] {
            let limit = ["--mesher", mesher, "--least-size", "0.05"];
            let ended = mesh(&[&limit[..], &size[..]].concat());
            assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
            let told = told(&ended.json());
            assert_eq!(told.len(), 1, "{mesher} {size:?}");
            assert!(
                told[0].contains("on 1 of 1 surfaces")
                    && told[0].contains("smaller than 0.05 of its surface's diagonal")
                    && told[0].ends_with("(--least-size)"),
                "{}",
                told[0]
            );
        }
    }
    // Who follows the error has fewer elements than were asked for.
    let ended = mesh(&[
        "--mesher",
        "restricted",
        "--elements",
        "5000",
        "--least-size",
        "0.1",
    ]);
    assert_eq!(ended.code(), Some(5), "{}", ended.stderr);
    let report = ended.json();
    let elements = report["elements"].as_u64().unwrap();
    assert!(elements < 5000);
    assert!(told(&report)[0].starts_with("about 5000 elements are asked for and "));
    // Sizes that are made are not talked about.
    let ended = mesh(&["--mesher", "uniform", "--elements", "100"]);
    assert!(told(&ended.json()).is_empty());

    // The same in words.
    let folder = folder("least-size");
    let ended = run(antumbra()
        .args(["mesh", "--mesher", "uniform", "--element-size", "1e-4"])
        .args(["--least-size", "0.05", "--degree", "1"])
        .arg(&scene)
        .arg("-o")
        .arg(folder.join("m.json")));
    assert_eq!(ended.code(), Some(0), "{}", ended.stderr);
    let warnings = ended
        .stdout
        .matches("\nwarning: what is asked for takes")
        .count();
    assert_eq!(warnings, 1, "{}", ended.stdout);
}

#[test]
fn more_elements_than_are_allowed_end_before_they_are_made() {
    // 100 million elements would take hours, and all memory.
    for mesher in ["uniform", "graded", "restricted", "adaptive"] {
        for size in [["--elements", "100000000"], ["--element-size", "1e-5"]] {
            let ended = run(antumbra()
                .args(["mesh", "--json", "--quiet", "--degree", "1"])
                .args(["--mesher", mesher, "--least-size", "1e-7"])
                .args(size)
                .arg(fixture("basic/unoccluded.json")));
            assert_eq!(ended.code(), Some(5), "{mesher}: {}", ended.stderr);
            let report = ended.json();
            assert_eq!(report["ended"], "limit on elements reached");
            assert!(report["elements"].as_u64() < Some(20_000));
            let warnings = report["warnings"].as_array().unwrap();
            let told = warnings.last().unwrap().as_str().unwrap();
            assert!(
                told.contains("elements are asked for and 1000000 are allowed"),
                "{told}"
            );
        }
    }
}
