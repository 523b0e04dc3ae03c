//! Receivers with the cells they begin with.

use crate::cell_size::{COARSEST, StartSize, diagonal};
use crate::grading::Near;
use crate::options::{CellOptions, Mesher};
use crate::outcome::Error;
use crate::surroundings::{contact_radius, hot_spots};
use antumbra_geom::{Chart, Control, DVec2, Stop};
use antumbra_mesh::cells::{CellForest, graded, uniform};
use antumbra_mesh::{MeshError, cells_of_corners};
use antumbra_scene::FaceId;
use antumbra_solver::Light;
use antumbra_solver::cells::CellReceiver;
use antumbra_visibility::Evaluator;
use rayon::prelude::*;

/// All receivers with the cells they begin with.
pub(crate) fn cell_receivers(
    evaluator: &Evaluator<'_>,
    driver: &dyn Light,
    size: StartSize,
    options: &CellOptions,
    control: &Control<'_>,
) -> Result<Vec<CellReceiver>, Error> {
    let scene = evaluator.scene();
    let faces: Vec<FaceId> = scene.face_ids().collect();
    faces
        .par_iter()
        .map(|&face| {
            let chart = scene.chart(face);
            let forest = forest(evaluator, driver, face, &chart, size, options, control.stop);
            let is_thin = matches!(forest, Err(MeshError::NoArea { .. }));
            let forest = match forest {
                Err(MeshError::NoArea { .. }) => {
                    let border = scene.loops_in_chart(face, &chart);
                    Ok(CellForest::new(cells_of_corners(&border), options.rule()))
                }
                other => other,
            };
            Ok(CellReceiver {
                face,
                forest: forest.map_err(|error| Error {
                    surface: scene.surface_of(face).name.clone(),
                    error,
                })?,
                is_thin,
                contact_radius: contact_radius(scene, face),
                hot_spots: hot_spots(evaluator, face, &chart),
                chart,
            })
        })
        .collect()
}

/// The cells of a receiver to begin with.
fn forest(
    evaluator: &Evaluator<'_>,
    light: &dyn Light,
    face: FaceId,
    chart: &Chart,
    size: StartSize,
    options: &CellOptions,
    stop: Stop<'_>,
) -> Result<CellForest, MeshError> {
    let scene = evaluator.scene();
    let border = scene.loops_in_chart(face, chart);
    let diagonal = diagonal(&border);
    let is_lit = light.reaches(face);
    let size = match size {
        // Where no light falls, one size is as good as any other.
        _ if !is_lit => COARSEST * diagonal,
        StartSize::Share(share) => share * diagonal,
        StartSize::Length(length) => length.max(options.least_size * diagonal),
    };
    if options.mesher != Mesher::Graded || !is_lit {
        return Ok(CellForest::new(
            uniform(&border, size, options.shape)?,
            options.rule(),
        ));
    }
    let near = Near::new(evaluator, face, chart, &border, stop);
    let reach = 0.25 * diagonal;
    let grading = options.grading.clamp(1e-3, 1.0);
    let size_at = |p: DVec2| size * grading.max((near.distance(p) / reach).min(1.0));
    let most_levels = grading.recip().log2().ceil() as u8;
    graded(&border, size, &size_at, most_levels, options.shape)
}
