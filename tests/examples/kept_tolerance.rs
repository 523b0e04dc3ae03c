//! Meshes scenes and says how far single values are off at points that no mesh used.
//!
//! ```sh
//! cargo run --release -p antumbra-tests --example kept_tolerance -- 1e-3 20000 fixtures/basic/*.json
//! cargo run --release -p antumbra-tests --example kept_tolerance -- 1e-3 20000 0..60
//! ```
//!
//! A range of numbers stands for the random scenes of [`antumbra_tests::families`]. With
//! `ANTUMBRA_VERBOSE` set, the worst points of every scene are shown.

use antumbra::io::scene_file;
use antumbra::{Scene, SceneInput};
use antumbra_tests::families::family_scene;
use antumbra_tests::kept::{Above, kept};

/// The scenes that an argument names.
fn scenes(argument: &str) -> Vec<(String, SceneInput)> {
    if let Some((from, to)) = argument.split_once("..") {
        let number = |text: &str| text.parse::<u64>().expect("a range of numbers");
        return (number(from)..number(to))
            .map(|n| {
                let (family, scene) = family_scene(n);
                (format!("{family}-{n}"), scene)
            })
            .collect();
    }
    let text = std::fs::read_to_string(argument).expect("a scene file that can be read");
    let scene = scene_file::read(&text).expect("a scene file");
    vec![(argument.to_owned(), scene)]
}

#[expect(clippy::print_stdout, reason = "a table is printed")]
fn show(above: &Above) {
    println!(
        "    {:.2} on {}: element {:.1e} × {:.1e}, measured {:.2}, at {:.3?}",
        above.ratio, above.surface, above.element[0], above.element[1], above.measured, above.at
    );
}

#[expect(clippy::print_stdout, reason = "a table is printed")]
fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let tolerance: f64 = arguments[0].parse().expect("a tolerance");
    let n_points: u32 = arguments[1].parse().expect("a number of points");
    let is_verbose = std::env::var("ANTUMBRA_VERBOSE").is_ok();
    let (mut evaluations, mut points, mut above, mut worst) = (0, 0, 0, 0.0f64);
    for (name, input) in arguments[2..].iter().flat_map(|a| scenes(a)) {
        let Ok(built) = Scene::build(&input) else {
            println!("{name}: refused");
            continue;
        };
        let found = kept(&built.scene, tolerance, n_points);
        println!(
            "{name}: {} evaluations, {} elements, unresolved {:.1e}, reached {}; \
             {} of {} above, worst {:.2}",
            found.n_evaluations,
            found.n_elements,
            found.unresolved,
            found.is_reached,
            found.above.len(),
            found.n_points,
            found.worst,
        );
        if is_verbose {
            found.above.iter().take(8).for_each(show);
        }
        evaluations += found.n_evaluations;
        if found.is_reached {
            points += found.n_points;
            above += found.above.len();
            worst = worst.max(found.worst);
        }
    }
    println!(
        "all: {evaluations} evaluations; where reached, {above} of {points} above, worst {worst:.2}"
    );
}
