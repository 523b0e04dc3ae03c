//! Direct light and what is gathered.

use crate::light::ExactLight;
use antumbra_geom::{Control, Stop};
use antumbra_scene::FaceId;
use antumbra_solver::{Found, Light, Radiosity, Sample};
use antumbra_visibility::{Approach, Evaluator, Place};

/// Exact direct light, and what is reflected, gathered from a solution.
pub(crate) struct TotalLight<'a> {
    pub(crate) evaluator: &'a Evaluator<'a>,
    pub(crate) direct: &'a ExactLight<'a, 'a>,
    pub(crate) radiosity: &'a Radiosity,
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
        let indirect = self.radiosity.gather(self.evaluator, &places, &control);
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
