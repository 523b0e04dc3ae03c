//! Meshes of cells: the generators that know nothing of shadows.

use crate::cell_receivers::cell_receivers;
use crate::cell_size::{COARSEST, StartSize, least_size_limit, n_of_size, start};
use crate::light::ExactLight;
use crate::options::{CellOptions, CellSize, Mesher, Options};
use crate::outcome::{Error, SizeLimit};
use antumbra_geom::{Control, Phase};
use antumbra_solver::cells::{CellDirectOptions, CellGoal, CellMeshes};
use antumbra_solver::{Ended, Light};
use antumbra_visibility::Evaluator;

/// Meshes of cells with direct light, unfinished: to be asked for estimates and true errors
/// of their elements.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
pub fn cell_meshes(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    options: &Options,
    cells: &CellOptions,
    control: &Control<'_>,
) -> Result<CellMeshes, Error> {
    Ok(cell_meshes_for(evaluator, light, options, cells, control)?.0)
}

/// The meshes, and what kept their elements from being as small as was asked for.
///
/// * `driver` — the light that is meshed for.
pub(crate) fn cell_meshes_for(
    evaluator: &Evaluator<'_>,
    driver: &dyn Light,
    options: &Options,
    cells: &CellOptions,
    control: &Control<'_>,
) -> Result<(CellMeshes, Option<SizeLimit>), Error> {
    assert!(
        cells.mesher != Mesher::Discontinuity,
        "the discontinuity mesh has no cells"
    );
    (control.progress)(Phase::Arrangement, 0.0);
    let scene = evaluator.scene();
    let (mut size, mut goal) = start(scene, driver, options, cells);
    let asked = n_asked(evaluator, driver, size, goal, options, cells, control)?;
    if asked > options.most_elements {
        // Known before anything is made: there is no use in as many as are allowed.
        (size, goal) = (StartSize::Share(COARSEST), CellGoal::Elements(asked));
    }
    let mut receivers = cell_receivers(evaluator, driver, size, cells, control)?;
    if let (Mesher::Graded, CellSize::Elements(wanted), StartSize::Length(length)) =
        (cells.mesher, cells.size, &mut size)
    {
        // How many elements grading adds is seen when they are there.
        for _ in 0..MOST_TRIES {
            let lit = receivers.iter().filter(|r| driver.reaches(r.face));
            let n: usize = lit.map(|r| r.forest.mesh().0.cells.len()).sum();
            let ratio = n as f64 / wanted.max(1) as f64;
            if (0.8..=1.25).contains(&ratio) || control.stop.is_wanted() {
                break;
            }
            *length *= ratio.sqrt();
            receivers = cell_receivers(
                evaluator,
                driver,
                StartSize::Length(*length),
                cells,
                control,
            )?;
        }
    }
    (control.progress)(Phase::Irradiance, 0.0);
    let direct = CellDirectOptions {
        degree: options.chosen_degree(),
        goal,
        refinement: cells.refinement(),
        estimator: cells.estimator,
        least_size: cells.least_size,
        most_elements: options.most_elements,
    };
    let meshes = CellMeshes::solve(receivers, driver, &direct, control);
    let limit = match (size, goal) {
        _ if asked > options.most_elements => Some(SizeLimit::MostElements {
            asked,
            most: options.most_elements,
        }),
        (StartSize::Length(length), _) => least_size_limit(scene, driver, length, cells),
        (_, CellGoal::Elements(_)) if meshes.ended() == Ended::ResolutionReached => {
            Some(SizeLimit::FewerElements {
                asked,
                made: meshes.n_elements(),
                least: cells.least_size,
            })
        }
        _ => None,
    };
    Ok((meshes, limit))
}

/// Tries at a size for which a graded mesh has the number of elements that is wanted.
const MOST_TRIES: usize = 6;

/// How many elements are asked for on receivers that light reaches, about; 0 if a tolerance
/// is.
fn n_asked(
    evaluator: &Evaluator<'_>,
    driver: &dyn Light,
    size: StartSize,
    goal: CellGoal,
    options: &Options,
    cells: &CellOptions,
    control: &Control<'_>,
) -> Result<usize, Error> {
    let length = match (cells.size, goal, size) {
        (CellSize::Elements(n), ..) | (_, CellGoal::Elements(n), _) => return Ok(n),
        (CellSize::Length(_), _, StartSize::Length(length)) => length,
        _ => return Ok(0),
    };
    let n_uniform = n_of_size(evaluator.scene(), driver, length, cells);
    let most = options.most_elements as f64;
    if cells.mesher != Mesher::Graded
        || n_uniform > most
        || n_uniform * cells.grading.powi(-2) <= most
    {
        return Ok(n_uniform as usize);
    }
    // How many elements grading adds is seen on a coarse mesh of the same grading.
    let coarse = length * (n_uniform / COARSE_ELEMENTS).sqrt().max(1.0);
    let size = StartSize::Length(coarse);
    let receivers = cell_receivers(evaluator, driver, size, cells, control)?;
    let lit = receivers.iter().filter(|r| driver.reaches(r.face));
    let n: usize = lit.map(|r| r.forest.mesh().0.cells.len()).sum();
    let finer = n_uniform / n_of_size(evaluator.scene(), driver, coarse, cells);
    Ok((n as f64 * finer) as usize)
}

/// Elements of the uniform mesh on which those of graded meshes are counted beforehand.
const COARSE_ELEMENTS: f64 = 1000.0;
