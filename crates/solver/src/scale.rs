//! What errors are measured against.

/// The error that is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Relative to the largest irradiance of the scene, per band.
    Relative(f64),
    /// In the scene's units.
    Absolute(f64),
}

/// Irradiance found at samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// One sample after the other, a value for each band; in the scene's units.
    pub values: Vec<f64>,
    /// How much of them may be rounding, in any band.
    pub rounding: f64,
}

/// The largest irradiance found so far, per band.
#[derive(Clone, Debug)]
pub(crate) struct Scale {
    /// In the scene's units.
    pub(crate) peak: Vec<f64>,
    /// What may be rounding of all values.
    rounding: f64,
}

impl Scale {
    /// Nothing was found yet.
    pub(crate) fn new(n_bands: usize) -> Self {
        Self {
            peak: vec![0.0; n_bands],
            rounding: 0.0,
        }
    }

    /// Takes in what was found.
    pub(crate) fn take(&mut self, found: &Found) {
        self.raise(&found.values, found.rounding);
    }

    /// Takes in the scales of all receivers.
    pub(crate) fn gather<'a>(&mut self, all: impl Iterator<Item = &'a Self>) {
        for of_receiver in all {
            self.raise(&of_receiver.peak, of_receiver.rounding);
        }
    }

    fn raise(&mut self, values: &[f64], rounding: f64) {
        self.rounding = self.rounding.max(rounding);
        for bands in values.chunks_exact(self.peak.len().max(1)) {
            for (peak, &value) in self.peak.iter_mut().zip(bands) {
                *peak = peak.max(value);
            }
        }
    }

    /// What errors in each band are relative to: the peak, but no less than a thousand
    /// times what may be rounding. In a scene where all light is rounding, what leaks
    /// into a box by 1e-16 is nothing to be resolved.
    pub(crate) fn per_band(&self) -> Vec<f64> {
        let least = 1e3 * self.rounding;
        self.peak
            .iter()
            .map(|&p| if p > 0.0 { p.max(least) } else { 0.0 })
            .collect()
    }

    /// The error allowed in each band, in the scene's units.
    pub(crate) fn allowed(&self, tolerance: Tolerance) -> Vec<f64> {
        let mut allowed = self.per_band();
        for band in &mut allowed {
            *band = match tolerance {
                Tolerance::Relative(t) => t * *band,
                Tolerance::Absolute(t) => t,
            };
        }
        allowed
    }
}
