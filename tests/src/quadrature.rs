//! Gauss–Legendre quadrature on an interval.

/// Nodes and weights of the `n`-point rule on [0, 1].
#[must_use]
pub fn gauss(n: usize) -> Vec<(f64, f64)> {
    let n_f = n as f64;
    (0..n)
        .map(|i| {
            // Newton's method on the Legendre polynomial from Tricomi's start.
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n_f + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                slope = n_f * (x * p1 - p0) / (x * x - 1.0);
                let step = p1 / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            let weight = 2.0 / ((1.0 - x * x) * slope * slope);
            ((1.0 - x) / 2.0, weight / 2.0)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rule_of_n_points_is_exact_to_degree_2n_minus_1() {
        let sum: f64 = gauss(5).iter().map(|(x, w)| w * x.powi(9)).sum();
        assert!((sum - 0.1).abs() < 1e-15);
    }
}
