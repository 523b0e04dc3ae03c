//! Roots of polynomials of degree one and two: every clip of a swath is one.

use smallvec::SmallVec;

/// `c₀ + c₁ t + c₂ t²`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quadratic(pub(crate) [f64; 3]);

/// Coefficients this small, relative to the others, are rounding.
const NEGLIGIBLE: f64 = 1e-14;

impl Quadratic {
    /// The product of two linear functions, each given by its values at 0 and 1.
    pub(crate) fn product(f: [f64; 2], g: [f64; 2]) -> Self {
        let (df, dg) = (f[1] - f[0], g[1] - g[0]);
        Self([f[0] * g[0], f[0] * dg + df * g[0], df * dg])
    }

    /// The linear function with these values at 0 and 1.
    pub(crate) fn linear(f: [f64; 2]) -> Self {
        Self([f[0], f[1] - f[0], 0.0])
    }

    pub(crate) fn minus(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        Self([a - d, b - e, c - f])
    }

    /// The places in the open interval 0..1 where the sign changes.
    ///
    /// # Source
    ///
    /// The root of larger size first, the other by Vieta: no cancellation.
    pub(crate) fn sign_changes(self) -> SmallVec<[f64; 2]> {
        let [c0, c1, c2] = self.0;
        let scale = c0.abs() + c1.abs() + c2.abs();
        let mut roots = SmallVec::new();
        let mut push = |t: f64| {
            if t > 0.0 && t < 1.0 {
                roots.push(t);
            }
        };
        if c2.abs() <= NEGLIGIBLE * scale {
            if c1.abs() > NEGLIGIBLE * scale {
                push(-c0 / c1);
            }
            return roots;
        }
        let discriminant = c1 * c1 - 4.0 * c2 * c0;
        if discriminant <= 0.0 {
            return roots;
        }
        let q = -0.5 * (c1 + c1.signum() * discriminant.sqrt());
        push(q / c2);
        if q != 0.0 {
            push(c0 / q);
        }
        roots
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_roots_are_found_to_the_last_digit_although_one_is_tiny() {
        // (t − 1e-12)(t − 0.5)
        let roots = Quadratic([0.5e-12, -(0.5 + 1e-12), 1.0]).sign_changes();
        assert_eq!(roots.len(), 2);
        assert!((roots[0] - 0.5).abs() < 1e-15 && (roots[1] - 1e-12).abs() < 1e-27);
        assert!(Quadratic([1.0, 0.0, 1.0]).sign_changes().is_empty());
        assert_eq!(
            Quadratic::linear([-1.0, 3.0]).sign_changes().as_slice(),
            [0.25]
        );
    }
}
