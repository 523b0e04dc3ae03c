//! Whether a mesh keeps its tolerance at points that it has never seen.

use crate::meshes::triangles;
use antumbra::values::{self, Place};
use antumbra::{
    Control, Ended, Evaluator, ExactLight, Options, Outcome, ReceiverMesh, Scene, Scratch,
    Tolerance,
};
use glam::DVec2;
use rayon::prelude::*;

/// A point whose value errs more than the tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct Above {
    /// Its error relative to the tolerance.
    pub ratio: f64,
    /// The surface.
    pub surface: String,
    /// The longest edge of its element and its height, relative to the receiver.
    pub element: [f64; 2],
    /// Where it is in its element.
    pub at: [f64; 3],
    /// The element's own error relative to the tolerance.
    pub measured: f64,
}

/// What was found at all points; those in unresolved elements apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kept {
    /// Points in elements that are resolved.
    pub n_points: usize,
    /// Points in unresolved ones.
    pub n_unresolved: usize,
    /// The largest error relative to the tolerance.
    pub worst: f64,
    /// All that are above the tolerance, the worst first.
    pub above: Vec<Above>,
    /// Exact evaluations that the mesh took.
    pub n_evaluations: u64,
    /// Elements.
    pub n_elements: usize,
    /// The share of the area that is unresolved.
    pub unresolved: f64,
    /// Did it end within the tolerance?
    pub is_reached: bool,
}

/// Meshes to a relative tolerance, and compares with exact light at points that are uniform
/// over the area of all receivers.
///
/// # Panics
///
/// If the scene cannot be meshed.
#[must_use]
pub fn kept(scene: &Scene, tolerance: f64, n_points: u32) -> Kept {
    let options = Options {
        tolerance: Tolerance::Relative(tolerance),
        ..Options::default()
    };
    let meshed =
        antumbra::mesh(scene, &options, &Control::NEVER).unwrap_or_else(|error| panic!("{error}"));
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let places = values::random_places(scene, n_points, &|_| true);
    let errors: Vec<Option<Above>> = places
        .par_iter()
        .map_init(Scratch::default, |scratch, place| {
            let exact = values::exact(&light, place, scratch);
            error_at(scene, &meshed, place, &exact, tolerance)
        })
        .collect();
    let receivers = &meshed.mesh.receivers;
    let area: f64 = receivers.iter().map(ReceiverMesh::area).sum();
    let mut kept = Kept {
        n_evaluations: receivers.iter().map(|r| r.exact_evaluations).sum(),
        n_elements: receivers.iter().map(|r| r.n_elements()).sum(),
        unresolved: receivers
            .iter()
            .map(ReceiverMesh::unresolved_area)
            .sum::<f64>()
            / area,
        is_reached: meshed.mesh.ended == Ended::ToleranceReached,
        ..Kept::default()
    };
    for error in errors {
        let Some(error) = error else {
            kept.n_unresolved += 1;
            continue;
        };
        kept.n_points += 1;
        kept.worst = kept.worst.max(error.ratio);
        if error.ratio > 1.0 {
            kept.above.push(error);
        }
    }
    kept.above.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
    kept
}

/// The error at a place; nothing in an unresolved element.
fn error_at(
    scene: &Scene,
    meshed: &Outcome,
    place: &Place,
    exact: &[f64],
    tolerance: f64,
) -> Option<Above> {
    let mesh = &meshed.mesh.receivers[place.face.index()];
    let uv = mesh.chart.to_chart(place.point);
    let spot = mesh.locate(uv)?;
    let (element, at) = (spot.element, spot.at);
    if mesh.unresolved.binary_search(&(element as u32)).is_ok() {
        return None;
    }
    let bands = mesh.direct_at(spot).into_iter().zip(exact);
    let ratio = bands
        .zip(&meshed.mesh.peak)
        .map(|((e, exact), peak)| (e - exact).abs() / (peak.max(1e-300) * tolerance))
        .fold(0.0, f64::max);
    let [a, b, c]: [DVec2; 3] = triangles(mesh).corners(element as u32);
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let size = scene.face(place.face).area.sqrt();
    let height = 2.0 * triangles(mesh).area(element as u32) / longest;
    Some(Above {
        ratio,
        surface: scene.surface_of(place.face).name.clone(),
        element: [longest / size, height / size],
        at,
        measured: mesh.element_errors[element] / tolerance,
    })
}
