//! How far solved meshes are from the truth:
//! `cargo run --release -p antumbra-tests --example solved_error -- SCENE TOLERANCE POINTS [FINER]`
//!
//! Solves a scene file, and compares its meshes at random points with what is gathered there
//! from a solution whose tolerance is FINER (default 10) times smaller. Prints the largest
//! errors relative to the peak, and where they are.

use antumbra::gathered::{Gathered, solve};
use antumbra::values::{exact, random_places};
use antumbra::visibility::Place;
use antumbra::{Control, Evaluator, ExactLight, Options, Scene, Scratch, Tolerance, io};
use std::error::Error;

#[expect(clippy::print_stdout, reason = "a table is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let path = args.next().ok_or("a scene is needed")?;
    let tolerance: f64 = args.next().ok_or("a tolerance is needed")?.parse()?;
    let n: u32 = args.next().unwrap_or("20000".into()).parse()?;
    let finer: f64 = args.next().unwrap_or("10".into()).parse()?;
    let input = io::scene_file::read(&std::fs::read_to_string(&path)?)?;
    let scene = Scene::build(&input).map_err(|p| format!("{p:#?}"))?.scene;
    let options = |t| Options {
        tolerance: Tolerance::Relative(t),
        ..Options::default()
    };
    let coarse = solve(&scene, &options(tolerance), &Control::NEVER)?;
    let fine = solve(&scene, &options(tolerance / finer), &Control::NEVER)?;
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let places = random_places(&scene, n, &|f| !scene.face(f).is_covered);
    let at: Vec<Place> = places
        .iter()
        .map(|place| Place {
            point: place.point,
            normal: scene.face(place.face).normal,
            plane: Some(scene.face(place.face).plane),
            approach: None,
        })
        .collect();
    let of = |solved: &Gathered| -> Vec<Option<Vec<f64>>> {
        let indirect = solved.transport.gather(&evaluator, &at, &Control::NEVER);
        let mut scratch = Scratch::default();
        let total = places.iter().zip(indirect).map(|(place, indirect)| {
            let direct = exact(&light, place, &mut scratch);
            Some(direct.iter().zip(indirect?).map(|(d, i)| d + i).collect())
        });
        total.collect()
    };
    let (truth, gathered) = (of(&fine), of(&coarse));
    let mesh = &coarse.outcome.mesh;
    let peak = &mesh.peak;
    let (mut errors, mut of_gathers, mut n_unresolved) = (Vec::new(), Vec::new(), 0);
    for ((place, truth), gathered) in places.iter().zip(&truth).zip(&gathered) {
        let (Some(truth), Some(gathered)) = (truth, gathered) else {
            continue;
        };
        let apart = |values: &[f64]| {
            let each = values.iter().zip(truth).zip(peak);
            each.map(|((a, b), peak)| (a - b).abs() / peak)
                .fold(0.0, f64::max)
        };
        of_gathers.push((apart(gathered), place));
        let mesh = &mesh.receivers[place.face.index()];
        let Some(spot) = mesh.locate(mesh.chart.to_chart(place.point)) else {
            continue;
        };
        if mesh.unresolved.contains(&(spot.element as u32)) {
            n_unresolved += 1;
            continue;
        }
        let found = mesh.interpolate(&mesh.irradiance, scene.n_bands, spot);
        errors.push((apart(&found), place));
    }
    println!(
        "{} elements, {} evaluations, {:?}",
        mesh.n_elements(),
        mesh.exact_evaluations(),
        mesh.ended
    );
    for (what, mut errors) in [("mesh", errors), ("gathers", of_gathers)] {
        errors.sort_by(|a, b| b.0.total_cmp(&a.0));
        let at = |share: f64| errors[((errors.len() - 1) as f64 * share) as usize].0;
        let above = errors.iter().filter(|e| e.0 > tolerance).count();
        let squares: f64 = errors.iter().map(|e| e.0 * e.0).sum();
        println!(
            "{what}: max {:.2e}, p99.9 {:.2e}, p99 {:.2e}, rms {:.2e}; {above} of {} above {tolerance:e}",
            at(0.0),
            at(1e-3),
            at(1e-2),
            (squares / errors.len() as f64).sqrt(),
            errors.len()
        );
        for (error, place) in errors.iter().take(6) {
            let p = scene.frame.to_file(place.point);
            let name = &scene.surface_of(place.face).name;
            println!(
                "  {error:.2e} on {name} at {:.4} {:.4} {:.4}",
                p.x, p.y, p.z
            );
        }
    }
    println!("{n_unresolved} points in unresolved elements");
    Ok(())
}
