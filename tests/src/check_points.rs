//! Meshes compared with exact light at random points.

use crate::meshes::triangles;
use crate::random::SplitMix;
use antumbra::{
    Control, Ended, Evaluator, ExactLight, Options, Outcome, ReceiverMesh, Scene, Scratch,
    Tolerance,
};
use glam::DVec2;
use rayon::prelude::*;

/// What a comparison found; errors are relative to the scene's peak.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Points looked at, as many on each receiver.
    pub n_points: usize,
    /// Those that err more than the tolerance, or lie in no element; receivers too thin for
    /// elements that are resolved are not looked at.
    pub n_above: usize,
    /// Those in elements that the mesh itself says are unresolved; their errors do not
    /// count.
    pub n_unresolved: usize,
    /// The largest error.
    pub worst: f64,
    /// Where it is: the surface and the point, file units; empty if there is none.
    pub worst_place: String,
    /// The largest direct irradiance of the mesh in any band, in the scene's units.
    pub peak: f64,
    /// Elements of all receivers.
    pub n_elements: usize,
    /// All that is wrong, one line each; empty if nothing is.
    pub wrong: Vec<String>,
}

/// Meshes to a relative tolerance, and compares with exact light at random points of all
/// receivers; `n_points` of them in total, rounded up to as many on each.
///
/// More than one point of 1000 above the tolerance, one above twice of it, one of 100 in
/// unresolved elements, an unsound mesh, a value that is negative or none, or an end
/// short of the tolerance are wrong.
///
/// # Panics
///
/// If the scene cannot be meshed.
#[must_use]
pub fn compare(
    name: &str,
    scene: &Scene,
    tolerance: f64,
    most_elements: usize,
    n_points: usize,
) -> Comparison {
    let options = Options {
        tolerance: Tolerance::Relative(tolerance),
        // So that a mesh that never ends fails, and does not fill the memory.
        most_elements,
        ..Options::default()
    };
    let meshed =
        antumbra::mesh(scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut found = Comparison {
        wrong: unsound(name, &meshed),
        peak: meshed.mesh.peak.iter().copied().fold(0.0, f64::max),
        ..Comparison::default()
    };
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let receivers = &meshed.mesh.receivers;
    let per_receiver = n_points.div_ceil(receivers.len());
    for mesh in receivers.iter().filter(|m| !is_thin(m)) {
        found.n_elements += mesh.n_elements();
        let points = random_points(mesh, per_receiver);
        let errors = errors_at(mesh, &light, &meshed.mesh.peak, &points);
        found.n_points += points.len();
        for (&(element, uv), error) in points.iter().zip(errors) {
            if mesh.unresolved.contains(&(element as u32)) {
                found.n_unresolved += 1;
                continue;
            }
            // A place in no element gives none.
            found.n_above += usize::from(error.is_nan() || error > tolerance);
            if error > found.worst {
                found.worst = error;
                let at = scene.frame.to_file(mesh.chart.to_space(uv));
                let surface = &scene.surface_of(mesh.face).name;
                found.worst_place = format!("'{surface}' at {at}");
            }
        }
    }
    let Comparison {
        n_points: n,
        n_above,
        n_unresolved,
        worst,
        ..
    } = found;
    // Between check points a few may err more.
    if n_above * 1_000 > n || worst > 2.0 * tolerance {
        found.wrong.push(format!(
            "{name}: {n_above} of {n} points above {tolerance:e}, the worst at {worst:.2e} on {}",
            found.worst_place
        ));
    }
    if n_unresolved * 100 > n {
        found.wrong.push(format!(
            "{name}: {n_unresolved} of {n} points in unresolved elements"
        ));
    }
    found
}

/// Is a receiver thinner than the smallest elements that are resolved, 2⁻²² of its length?
/// All of its elements count as unresolved, and promise nothing.
fn is_thin(mesh: &ReceiverMesh) -> bool {
    let [min, max] = antumbra::geom::bounding_box(triangles(mesh).vertices.iter().copied());
    let length = (max - min).length();
    mesh.is_thin || mesh.area() < length * length / f64::from(1 << 22)
}

/// What is wrong with a mesh whatever the exact light is.
fn unsound(name: &str, meshed: &Outcome) -> Vec<String> {
    let mut wrong = Vec::new();
    if !matches!(
        meshed.mesh.ended,
        Ended::ToleranceReached | Ended::ResolutionReached
    ) {
        wrong.push(format!("{name}: ended with {:?}", meshed.mesh.ended));
    }
    for mesh in &meshed.mesh.receivers {
        if let Err(error) = triangles(mesh).check() {
            wrong.push(format!("{name}: {error}"));
        }
        if mesh.direct.iter().any(|&e| !(e >= 0.0 && e.is_finite())) {
            wrong.push(format!("{name}: a value that is negative or none"));
        }
    }
    wrong
}

/// The error of the worst band at points of a receiver, relative to its peak; NaN in no
/// element.
fn errors_at(
    mesh: &ReceiverMesh,
    light: &ExactLight<'_, '_>,
    peak: &[f64],
    points: &[(usize, DVec2)],
) -> Vec<f64> {
    points
        .par_iter()
        .map_init(Scratch::default, |scratch, &(_, uv)| {
            let exact = light.at(mesh.face, mesh.chart.to_space(uv), scratch);
            let Some(spot) = mesh.locate(uv) else {
                return f64::NAN;
            };
            let bands = mesh.direct_at(spot).into_iter().zip(exact).zip(peak);
            bands
                .map(|((e, exact), peak)| (e - exact).abs() / peak.max(1e-300))
                .fold(0.0, f64::max)
        })
        .collect()
}

/// Uniform points of a receiver in its chart, the same in every run, with their elements.
fn random_points(mesh: &ReceiverMesh, n: usize) -> Vec<(usize, DVec2)> {
    let areas: Vec<f64> = (0..mesh.n_elements() as u32)
        .scan(0.0, |sum, t| {
            *sum += triangles(mesh).area(t).max(0.0);
            Some(*sum)
        })
        .collect();
    let mut random = SplitMix::new(u64::from(mesh.face.0) + 1);
    (0..n)
        .map(|_| random_point(mesh, &areas, &mut random))
        .collect()
}

/// A uniform point of a mesh's element, in its chart.
fn random_point(mesh: &ReceiverMesh, areas: &[f64], random: &mut SplitMix) -> (usize, DVec2) {
    let total = *areas.last().unwrap_or(&0.0);
    let wanted = total * random.unit();
    let t = areas.partition_point(|&a| a < wanted).min(areas.len() - 1);
    let [a, b, c] = triangles(mesh).corners(t as u32);
    let (mut s, mut r) = (random.unit(), random.unit());
    if s + r > 1.0 {
        (s, r) = (1.0 - s, 1.0 - r);
    }
    (t, a + (b - a) * s + (c - a) * r)
}
