//! Interreflection held to the tolerance: a coarse solution of all surfaces, and a mesh that
//! grows on what is gathered from it.
//!
//! What [`solve`](crate::solve) is to become. Indirect light there is interpolated on a
//! layer of its own, whose error is measured and not held to anything; here the mesh of
//! direct light goes on growing on direct plus gathered light, and `measured_max_error`
//! is that of total irradiance. On small rooms at 1e-2 that is several times faster than
//! [`solve`](crate::solve) and within the tolerance; where many things stand, and at 1e-3,
//! it is not yet fast enough to take its place (`docs/design.md`).

use crate::light::ExactLight;
use crate::options::Options;
use crate::outcome::{Error, Outcome};
use crate::pipeline::Ground;
use crate::plan::Quantity;
use crate::receiver::contact_receivers;
use antumbra_geom::{Control, Phase, Stop};
use antumbra_scene::{FaceId, Scene};
use antumbra_solver::transport::{Transport, TransportOptions, solve_transport};
use antumbra_solver::{DirectMeshes, Ended, Found, Light, Progress, Sample, Tolerance};
use antumbra_visibility::{Approach, Evaluator, Place};

/// A scene meshed on total irradiance.
#[derive(Debug)]
pub struct Gathered {
    /// The meshes: `irradiance` at the nodes is exact direct light and what is gathered.
    pub outcome: Outcome,
    /// What was gathered from.
    pub transport: Transport,
}

/// What is gathered may be off by this share of the tolerance: meshes have the rest.
const SHARE: f64 = 0.3;

/// Meshes a scene on total irradiance.
///
/// If it is stopped after direct light is meshed, the meshes are those of direct light with
/// what the coarse solution tells of indirect light.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
pub fn solve(scene: &Scene, options: &Options, control: &Control<'_>) -> Result<Gathered, Error> {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, control);
    let mut ground = Ground::new(&evaluator, &light, options, Quantity::Total, true, control)?;
    let (direct, _) = ground.grow(ground.receivers.clone(), &light, options, control);
    let transport = transport(&evaluator, &direct, options, control)?;
    if !transport.reached.has_values() {
        let finish = |meshes: DirectMeshes| (meshes.finish(), ());
        let (outcome, ()) = ground.outcome(direct, Vec::new(), finish);
        return Ok(Gathered { outcome, transport });
    }
    let total = TotalLight {
        evaluator: &evaluator,
        direct: &light,
        transport: &transport,
    };
    let mut receivers = std::mem::take(&mut ground.receivers);
    for receiver in &mut receivers {
        receiver.has_indirect_light = true;
    }
    let (meshes, improvements) = ground.grow(receivers, &total, options, control);
    let is_cut_short = |p| matches!(p, Progress::BorderOnly | Progress::Nothing);
    let outcome = if meshes.progress().any(is_cut_short) {
        // The meshes of direct light are better than none.
        let indirect = |receiver, uv| transport.interpolated(receiver, uv);
        let finish = |meshes: DirectMeshes| (meshes.finish_with_indirect(&indirect), ());
        let mut outcome = ground.outcome(direct, Vec::new(), finish).0;
        outcome.mesh.ended = Ended::Stopped;
        outcome
    } else {
        let finish =
            |meshes: DirectMeshes| (meshes.finish_total(&light, &direct, control.stop), ());
        ground.outcome(meshes, improvements, finish).0
    };
    Ok(Gathered { outcome, transport })
}

/// The coarse solution.
fn transport(
    evaluator: &Evaluator<'_>,
    direct: &DirectMeshes,
    options: &Options,
    control: &Control<'_>,
) -> Result<Transport, Error> {
    (control.progress)(Phase::Radiosity, 0.0);
    // Interreflection of a coarse mesh would be that of another scene.
    let receivers = match direct.ended() {
        Ended::Stopped => None,
        _ => contact_receivers(evaluator, control.stop)?,
    };
    let Some(receivers) = receivers else {
        return Ok(Transport::nothing());
    };
    let tolerance = match options.tolerance {
        Tolerance::Relative(t) => t,
        Tolerance::Absolute(t) => t / direct.largest().max(f64::MIN_POSITIVE),
    };
    let options = TransportOptions {
        tolerance: SHARE * tolerance,
        ..TransportOptions::default()
    };
    Ok(solve_transport(
        evaluator, &receivers, direct, &options, control,
    ))
}

/// Exact direct light, and what is reflected, gathered from a solution.
struct TotalLight<'a> {
    evaluator: &'a Evaluator<'a>,
    direct: &'a ExactLight<'a, 'a>,
    transport: &'a Transport,
}

impl Light for TotalLight<'_> {
    fn n_bands(&self) -> usize {
        self.direct.n_bands()
    }

    fn irradiance(
        &self,
        receiver: FaceId,
        samples: &[Sample],
        radius: f64,
        stop: Stop<'_>,
    ) -> Option<Found> {
        let mut found = self.direct.irradiance(receiver, samples, radius, stop)?;
        let face = self.evaluator.scene().face(receiver);
        let places: Vec<Place> = samples
            .iter()
            .map(|sample| Place {
                point: sample.point,
                normal: face.normal,
                plane: Some(face.plane),
                approach: sample.toward.map(|toward| Approach { toward, radius }),
            })
            .collect();
        let control = Control::stopping(stop);
        let indirect = self.transport.gather(self.evaluator, &places, &control);
        for (values, indirect) in found.values.chunks_exact_mut(self.n_bands()).zip(indirect) {
            for (value, indirect) in values.iter_mut().zip(indirect?) {
                *value += indirect;
            }
        }
        Some(found)
    }

    fn reaches(&self, receiver: FaceId) -> bool {
        !self.evaluator.scene().face(receiver).is_covered
    }
}
