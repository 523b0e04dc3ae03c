//! The exact engine behind the solver's question for light.

use antumbra_geom::{Control, Stop};
use antumbra_scene::FaceId;
use antumbra_solver::{Found, Light, Sample};
use antumbra_visibility::{Approach, Evaluator, Scratch, Seen, View};
use rayon::prelude::*;

/// Exact irradiance, with a prepared view per face.
#[derive(Debug)]
pub struct ExactLight<'e, 's> {
    evaluator: &'e Evaluator<'s>,
    views: Vec<View>,
    /// Of one emitter, in any band.
    largest_exitance: f64,
}

impl<'e, 's> ExactLight<'e, 's> {
    /// Prepares every face of the scene as a receiver.
    ///
    /// Faces that are not prepared when it is stopped get a view that leaves everything to
    /// each evaluation: slower ones with the same values.
    #[must_use]
    pub fn new(evaluator: &'e Evaluator<'s>, control: &Control<'_>) -> Self {
        let stop = control.stop;
        let faces: Vec<FaceId> = evaluator.scene().face_ids().collect();
        let views = faces
            .par_iter()
            .map(|&face| {
                if stop.is_wanted() {
                    evaluator.unprepared_view(face)
                } else {
                    evaluator.view(face)
                }
            })
            .collect();
        let scene = evaluator.scene();
        let exitances = scene.emitters().flat_map(|e| &scene.material(e).exitance);
        Self {
            evaluator,
            views,
            largest_exitance: exitances.copied().fold(0.0, f64::max),
        }
    }

    /// The view of a face.
    pub(crate) fn view(&self, face: FaceId) -> &View {
        &self.views[face.index()]
    }

    /// Irradiance per band at one point of a face's front, scene units.
    #[must_use]
    pub fn at(&self, face: FaceId, point: glam::DVec3, scratch: &mut Scratch) -> Vec<f64> {
        self.evaluator
            .irradiance(&self.views[face.index()], point, None, scratch)
    }
}

/// Samples evaluated by one thread before another may take over.
const CHUNK: usize = 32;

impl Light for ExactLight<'_, '_> {
    fn n_bands(&self) -> usize {
        self.evaluator.scene().n_bands
    }

    fn irradiance(
        &self,
        receiver: FaceId,
        samples: &[Sample],
        radius: f64,
        stop: Stop<'_>,
    ) -> Option<Found> {
        let view = &self.views[receiver.index()];
        let n_emitters = self.evaluator.emitters().len();
        let parts: Option<Vec<(Vec<f64>, f64)>> = samples
            .par_chunks(CHUNK)
            .map_init(
                || (Scratch::default(), vec![Seen::default(); n_emitters]),
                |(scratch, seen), chunk| {
                    let mut most = 0.0f64;
                    let mut values = Vec::with_capacity(chunk.len() * self.n_bands());
                    for sample in chunk {
                        if stop.is_wanted() {
                            return None;
                        }
                        let approach = sample.toward.map(|toward| Approach { toward, radius });
                        self.evaluator.factors(
                            view,
                            sample.point,
                            approach.as_ref(),
                            scratch,
                            seen,
                        );
                        values.extend(self.evaluator.weigh(seen));
                        most = most.max(seen.iter().map(|s| s.unoccluded).sum());
                    }
                    Some((values, most))
                },
            )
            .collect();
        let (values, most): (Vec<_>, Vec<_>) = parts?.into_iter().unzip();
        // The largest sum of form factors without occluders at any sample.
        let most = most.into_iter().fold(0.0, f64::max);
        Some(Found {
            values: values.concat(),
            rounding: 16.0 * f64::EPSILON * most * self.largest_exitance,
        })
    }

    fn reaches(&self, receiver: FaceId) -> bool {
        self.views[receiver.index()].sees_any_emitter()
    }
}
