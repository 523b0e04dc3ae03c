//! Direct light and what is gathered.

use crate::light::ExactLight;
use antumbra_geom::Stop;
use antumbra_scene::FaceId;
use antumbra_solver::{Found, Gatherer, Light, Sample};
use antumbra_visibility::Approach;

/// Direct light and what is gathered from a solution.
pub(crate) struct TotalLight<'a> {
    pub(crate) direct: &'a ExactLight<'a, 'a>,
    pub(crate) gatherer: Option<Gatherer<'a, 'a, 'a>>,
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
        if let Some(gatherer) = &self.gatherer {
            let points: Vec<_> = samples
                .iter()
                .map(|sample| {
                    let approach = sample.toward.map(|toward| Approach { toward, radius });
                    (receiver.index(), sample.point, approach)
                })
                .collect();
            let indirect = gatherer.gather(&points, stop);
            for (values, indirect) in found.values.chunks_exact_mut(self.n_bands()).zip(indirect) {
                for (value, indirect) in values.iter_mut().zip(indirect?) {
                    *value += indirect;
                }
            }
        }
        Some(found)
    }

    fn reaches(&self, receiver: FaceId) -> bool {
        self.gatherer.is_some() || self.direct.reaches(receiver)
    }
}
