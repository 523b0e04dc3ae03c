//! From a value to a colour, and the ticks between.

use crate::model::MeshedScene;

use super::band::{Band, band_values};

/// A sequence of colours from low to high, even to the eye.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMap {
    /// Dark blue over green to yellow: the default.
    #[default]
    Viridis,
    /// Black over red to light yellow.
    Inferno,
    /// Black to white.
    Grey,
}

/// Ten colours each, evenly spaced; between them, straight lines.
const VIRIDIS: [u32; 10] = [
    0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b,
    0xfde725,
];
const INFERNO: [u32; 10] = [
    0x000004, 0x1b0c41, 0x4a0c6b, 0x781c6d, 0xa52c60, 0xcf4446, 0xed6925, 0xfb9b06, 0xf7d13d,
    0xfcffa4,
];
const GREYS: [u32; 2] = [0x000000, 0xffffff];

impl ColorMap {
    /// Red, green and blue (sRGB, 0 to 1) at `fraction` of the scale; clamped.
    #[must_use]
    pub fn rgb(self, fraction: f64) -> [f64; 3] {
        let colors: &[u32] = match self {
            Self::Viridis => &VIRIDIS,
            Self::Inferno => &INFERNO,
            Self::Grey => &GREYS,
        };
        let n_steps = colors.len() - 1;
        let x = fraction.clamp(0.0, 1.0) * n_steps as f64;
        let below = (x as usize).min(n_steps - 1);
        let (a, b) = (rgb(colors[below]), rgb(colors[below + 1]));
        let t = x - below as f64;
        [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
    }
}

/// Red, green and blue of `0xRRGGBB`, 0 to 1.
pub(crate) fn rgb(hex: u32) -> [f64; 3] {
    [16, 8, 0].map(|shift| f64::from(hex >> shift & 0xff) / 255.0)
}

/// The values that the ends of a colour map stand for, and the ticks between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value of the first colour.
    pub min: f64,
    /// Value of the last colour.
    pub max: f64,
    /// Distance of the ticks, which are its multiples.
    pub step: f64,
}

impl Scale {
    /// The scale from `min` to `max` with four to ten ticks.
    ///
    /// An empty or upside-down interval is made one long.
    #[must_use]
    pub fn new(min: f64, max: f64) -> Self {
        let is_usable = min.is_finite() && max.is_finite() && max > min;
        let (min, max) = match is_usable {
            true => (min, max),
            false if min.is_finite() => (min, min + 1.0),
            false => (0.0, 1.0),
        };
        let step = nice_step((max - min) / 8.0);
        Self { min, max, step }
    }

    /// From 0 to the largest value of the field, rounded up to a tick.
    ///
    /// In the field `radiosity`, surfaces that shine themselves are left out,
    /// unless there are no others: a lamp is brighter than all it lights.
    #[must_use]
    pub fn of_field(scene: &MeshedScene, field: &str, band: Band) -> Self {
        let mut largest = 0.0_f64;
        let mut largest_lit = 0.0_f64;
        for surface in &scene.surfaces {
            let values = band_values(scene, surface, field, band);
            let max = finite_max(&values);
            largest = largest.max(max);
            // What reflects less than it receives cannot leave more than arrives.
            let arriving = finite_max(&band_values(scene, surface, "irradiance", band));
            let is_emitter = field == "radiosity" && max > arriving;
            if !is_emitter {
                largest_lit = largest_lit.max(max);
            }
        }
        let max = if largest_lit > 0.0 {
            largest_lit
        } else {
            largest
        };
        if max <= 0.0 {
            return Self::new(0.0, 1.0);
        }
        let step = nice_step(max / 8.0);
        Self {
            min: 0.0,
            max: (max / step - 1e-6).ceil() * step,
            step,
        }
    }

    /// Where `value` lies between `min` (0) and `max` (1); not clamped.
    #[must_use]
    pub fn fraction(self, value: f64) -> f64 {
        (value - self.min) / (self.max - self.min)
    }

    /// The multiples of the step from `min` to `max`.
    #[must_use]
    pub fn ticks(self) -> Vec<f64> {
        let slack = 1e-6;
        let first = (self.min / self.step - slack).ceil() as i64;
        let last = (self.max / self.step + slack).floor() as i64;
        (first..=last).map(|k| k as f64 * self.step).collect()
    }

    /// A tick's label, with the digits that its step needs.
    #[must_use]
    pub fn label(self, tick: f64) -> String {
        let largest = self.min.abs().max(self.max.abs());
        if !(1e-3..1e6).contains(&largest) {
            let digits = (largest.log10().floor() - self.step.log10().floor()).max(0.0);
            return match tick {
                0.0 => "0".to_owned(),
                _ => format!("{tick:.0$e}", digits as usize),
            };
        }
        let decimals = (-self.step.log10().floor()).max(0.0) as usize;
        format!("{:.decimals$}", tick + 0.0)
    }
}

fn finite_max(values: &[f64]) -> f64 {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    finite.fold(0.0, f64::max)
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `x`.
fn nice_step(x: f64) -> f64 {
    if x.is_nan() || x < f64::MIN_POSITIVE * 1e20 {
        return 1.0;
    }
    let power = x.log10().floor() as i32;
    let fits = |step: &f64| *step >= x * (1.0 - 1e-9);
    let step = |m: f64, power: i32| match power {
        // A power of ten below one divides better than it multiplies.
        ..0 => m / 10_f64.powi(-power),
        _ => m * 10_f64.powi(power),
    };
    let steps = [step(1.0, power), step(2.0, power), step(5.0, power)];
    steps.into_iter().find(fits).unwrap_or(step(1.0, power + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_reach_both_ends() {
        let scale = Scale::new(0.0, 0.7);
        assert_eq!(scale.step, 0.1);
        assert_eq!(scale.ticks().len(), 8);
        assert_eq!(scale.label(scale.ticks()[3]), "0.3");
        assert_eq!(Scale::new(0.0, 4000.0).label(500.0), "500");
        assert_eq!(Scale::new(0.0, 3e-5).label(1e-5), "1.0e-5");
    }

    #[test]
    fn empty_interval_becomes_a_usable_scale() {
        assert_eq!(Scale::new(f64::NAN, 3.0), Scale::new(0.0, 1.0));
        assert_eq!(Scale::new(2.0, 2.0).max, 3.0);
    }

    #[test]
    fn colors_start_and_end_with_the_table() {
        assert_eq!(ColorMap::Viridis.rgb(-1.0), rgb(VIRIDIS[0]));
        assert_eq!(ColorMap::Viridis.rgb(2.0), rgb(VIRIDIS[9]));
        assert_eq!(ColorMap::Grey.rgb(0.5), [0.5; 3]);
    }
}
