//! How large the cells are that refinement begins with.

use crate::options::{CellOptions, CellSize, Options};
use crate::outcome::SizeLimit;
use antumbra_geom::{DVec2, bounding_box};
use antumbra_mesh::cells::CellShape;
use antumbra_scene::Scene;
use antumbra_solver::Light;
use antumbra_solver::cells::{CellGoal, CellRefinement};

/// The size that refinement starts with, relative to the receiver's diagonal: no feature
/// of light hides in one element, or hardly.
pub(crate) const COARSEST: f64 = 0.25;

/// The size of elements to begin with.
#[derive(Clone, Copy, Debug)]
pub(crate) enum StartSize {
    /// Scene units.
    Length(f64),
    /// Of the receiver's diagonal.
    Share(f64),
}

/// With what size elements begin, and when refinement ends.
pub(crate) fn start(
    scene: &Scene,
    light: &dyn Light,
    options: &Options,
    cells: &CellOptions,
) -> (StartSize, CellGoal) {
    let lit = scene.face_ids().filter(|&f| light.reaches(f));
    let area: f64 = lit.map(|f| scene.face(f).area).sum();
    let triangle = unit_area(cells.shape);
    let is_whole = cells.refinement() == CellRefinement::Whole;
    match cells.size {
        CellSize::Tolerance => {
            let goal = CellGoal::Tolerance(options.tolerance);
            (StartSize::Share(COARSEST), goal)
        }
        CellSize::Length(length) => {
            let length = length / scene.frame.length_to_file(1.0);
            if is_whole {
                (StartSize::Length(length), CellGoal::AsGiven)
            } else {
                let n = (area / (triangle * length * length)).ceil().max(1.0);
                (StartSize::Share(COARSEST), CellGoal::Elements(n as usize))
            }
        }
        CellSize::Elements(n) if is_whole => {
            let length = (area / (triangle * n.max(1) as f64)).sqrt();
            (StartSize::Length(length), CellGoal::AsGiven)
        }
        CellSize::Elements(n) => (StartSize::Share(COARSEST), CellGoal::Elements(n)),
    }
}

/// How many elements of a size receivers that light reaches have, about; where the least
/// size is larger, of that.
pub(crate) fn n_of_size(scene: &Scene, light: &dyn Light, length: f64, cells: &CellOptions) -> f64 {
    let lit = scene.face_ids().filter(|&f| light.reaches(f));
    lit.map(|f| {
        let least = cells.least_size * diagonal(&scene.loops_in_chart(f, &scene.chart(f)));
        let length = length.max(least);
        scene.face(f).area / (unit_area(cells.shape) * length * length)
    })
    .sum()
}

/// The area of an element with edges of length 1.
fn unit_area(shape: CellShape) -> f64 {
    match shape {
        CellShape::Triangles => 3f64.sqrt() / 4.0,
        CellShape::Quadrilaterals | CellShape::Mixed => 1.0,
    }
}

/// Is the size that is asked for below the least one somewhere?
pub(crate) fn least_size_limit(
    scene: &Scene,
    light: &dyn Light,
    length: f64,
    cells: &CellOptions,
) -> Option<SizeLimit> {
    let lit = scene.face_ids().filter(|&f| light.reaches(f));
    let least: Vec<f64> = lit
        .map(|f| cells.least_size * diagonal(&scene.loops_in_chart(f, &scene.chart(f))))
        .collect();
    let larger = least.iter().copied().filter(|&l| l > length);
    let n_receivers = larger.clone().count();
    (n_receivers > 0).then(|| SizeLimit::LeastSize {
        asked: scene.frame.length_to_file(length),
        made: scene.frame.length_to_file(larger.fold(0.0, f64::max)),
        n_receivers,
        n_lit: least.len(),
        least: cells.least_size,
    })
}

/// Of the box around loops.
pub(crate) fn diagonal(loops: &[Vec<DVec2>]) -> f64 {
    let [min, max] = bounding_box(loops.iter().flatten().copied());
    (max - min).length()
}
