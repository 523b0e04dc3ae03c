//! What a study runs: the ladders of all generators, estimators, steps after meshing.

use super::{MOST_ELEMENTS, Make, Reference, Runner, Sampled, StudyOptions};
use crate::light::ExactLight;
use crate::mesher::Mesher;
use crate::pipeline::{Control, Error, Options, mesh};
use antumbra_io::study::{Effectivity, Series, Step};
use antumbra_scene::Scene;
use antumbra_solver::Tolerance;

/// All series, with their ladders.
pub(crate) fn runners<'a>(scene: &'a Scene, options: &'a StudyOptions) -> Vec<Runner<'a>> {
    let mut runners = Vec::new();
    for &mesher in &options.meshers {
        for &degree in &options.degrees {
            let ladder = ladder(scene, options, mesher, degree);
            runners.push(Runner {
                series: Series {
                    mesher: mesher.key().to_owned(),
                    degree,
                    ..Series::default()
                },
                ladder: ladder.into_iter(),
                spent: 0.0,
                maps: Vec::new(),
            });
        }
    }
    runners
}

fn ladder<'a>(
    scene: &'a Scene,
    options: &'a StudyOptions,
    mesher: Mesher,
    degree: u8,
) -> Vec<(String, Make<'a>)> {
    match mesher {
        Mesher::Discontinuity => options
            .tolerances
            .iter()
            .map(|&tolerance| {
                let make: Make<'a> = Box::new(move |control| {
                    discontinuity(scene, degree, tolerance, control).map(Some)
                });
                (format!("tolerance {tolerance:e}"), make)
            })
            .collect(),
    }
}

fn discontinuity(
    scene: &Scene,
    degree: u8,
    tolerance: f64,
    control: &Control<'_>,
) -> Result<Box<dyn Sampled>, Error> {
    let options = Options {
        tolerance: Tolerance::Relative(tolerance),
        degree: Some(degree),
        most_elements: MOST_ELEMENTS,
        ..Options::default()
    };
    Ok(Box::new(mesh(scene, &options, control)?.direct))
}

/// What estimators say of the errors.
pub(crate) fn effectivities(
    _scene: &Scene,
    _options: &StudyOptions,
    _light: &ExactLight<'_, '_>,
    _control: &Control<'_>,
) -> Result<Vec<Effectivity>, Error> {
    Ok(Vec::new())
}

/// What steps after meshing do.
pub(crate) fn steps(
    _scene: &Scene,
    _options: &StudyOptions,
    _reference: &Reference,
    _control: &Control<'_>,
) -> Result<Vec<Step>, Error> {
    Ok(Vec::new())
}
