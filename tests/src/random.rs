//! Random numbers that are the same everywhere: splitmix64.

use glam::{DMat3, DVec3, dvec3};

/// A sequence of random numbers.
///
/// # Source
///
/// Steele, Lea & Flood 2014, *Fast splittable pseudorandom number generators*.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplitMix(u64);

impl SplitMix {
    /// The sequence of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in a box.
    pub fn in_box(&mut self, min: DVec3, max: DVec3) -> DVec3 {
        let mut pick = |low: f64, high: f64| self.between(low, high);
        dvec3(pick(min.x, max.x), pick(min.y, max.y), pick(min.z, max.z))
    }

    /// A uniform rotation: of a quaternion picked in the unit ball. Without sines,
    /// which differ in their last bit from one machine to the next.
    pub fn rotation(&mut self) -> DMat3 {
        loop {
            let [w, x, y, z] = std::array::from_fn(|_| self.between(-1.0, 1.0));
            let norm_sq = w * w + x * x + y * y + z * z;
            if norm_sq > 0.01 && norm_sq <= 1.0 {
                let s = 2.0 / norm_sq;
                return DMat3::from_cols(
                    dvec3(
                        1.0 - s * (y * y + z * z),
                        s * (x * y + w * z),
                        s * (x * z - w * y),
                    ),
                    dvec3(
                        s * (x * y - w * z),
                        1.0 - s * (x * x + z * z),
                        s * (y * z + w * x),
                    ),
                    dvec3(
                        s * (x * z + w * y),
                        s * (y * z - w * x),
                        1.0 - s * (x * x + y * y),
                    ),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequence_of_the_published_generator() {
        let mut random = SplitMix::new(1_234_567);
        assert_eq!(random.bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.bits(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn rotation_is_orthonormal() {
        let r = SplitMix::new(7).rotation();
        assert!((r.transpose() * r - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, 1e-15));
        assert!((r.determinant() - 1.0).abs() < 1e-15);
    }
}
