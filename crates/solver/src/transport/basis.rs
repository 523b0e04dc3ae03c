//! Degree 2 on a triangle with six nodes inside of it.
//!
//! The nodes are the points of the rule of degree 4: products of two functions of the
//! basis are integrated exactly, so that the basis is orthogonal under the rule, and what
//! interpolates at the nodes is the projection of what is known there. No node lies on a
//! border: there are no one-sided values, and nothing leaks across a contact.
//!
//! # Source
//!
//! Dunavant 1985, the rule of six points; collocation at such nodes: Atkinson & Chien 2000
//! (AC00 in `docs/references.md`).

use std::sync::OnceLock;

/// Nodes of an element.
pub(crate) const N: usize = 6;

const A: f64 = 0.445_948_490_915_965;
const WEIGHT_A: f64 = 0.223_381_589_678_011;
const B: f64 = 0.091_576_213_509_771;
const WEIGHT_B: f64 = 0.109_951_743_655_322;

/// Nodes in barycentric coordinates, and their weights in the rule, which add up to 1.
pub(crate) const NODES: [([f64; 3], f64); N] = [
    ([A, A, 1.0 - 2.0 * A], WEIGHT_A),
    ([A, 1.0 - 2.0 * A, A], WEIGHT_A),
    ([1.0 - 2.0 * A, A, A], WEIGHT_A),
    ([B, B, 1.0 - 2.0 * B], WEIGHT_B),
    ([B, 1.0 - 2.0 * B, B], WEIGHT_B),
    ([1.0 - 2.0 * B, B, B], WEIGHT_B),
];

/// Seven points, exact for degree 5: Radon's rule (Dunavant 1985).
pub(crate) const RULE: [([f64; 3], f64); 7] = {
    const A: f64 = 0.470_142_064_105_115;
    const B: f64 = 0.101_286_507_323_456;
    const WA: f64 = 0.132_394_152_788_506;
    const WB: f64 = 0.125_939_180_544_827;
    const T: f64 = 1.0 / 3.0;
    [
        ([T, T, T], 0.225),
        ([A, A, 1.0 - 2.0 * A], WA),
        ([A, 1.0 - 2.0 * A, A], WA),
        ([1.0 - 2.0 * A, A, A], WA),
        ([B, B, 1.0 - 2.0 * B], WB),
        ([B, 1.0 - 2.0 * B, B], WB),
        ([1.0 - 2.0 * B, B, B], WB),
    ]
};

fn monomials([a, b, _]: [f64; 3]) -> [f64; N] {
    [1.0, a, b, a * a, a * b, b * b]
}

/// The six basis functions at a point in barycentric coordinates: 1 at their own node, 0
/// at the others.
pub(crate) fn phi(at: [f64; 3]) -> [f64; N] {
    let m = monomials(at);
    coefficients().map(|c| c.iter().zip(m).map(|(c, m)| c * m).sum())
}

/// Of the basis functions in monomials.
fn coefficients() -> &'static [[f64; N]; N] {
    static COEFFICIENTS: OnceLock<[[f64; N]; N]> = OnceLock::new();
    COEFFICIENTS.get_or_init(|| {
        // Rows of the monomials at the nodes, and of what is wanted there.
        let mut rows = [[0.0; 2 * N]; N];
        for (j, (row, (at, _))) in rows.iter_mut().zip(NODES).enumerate() {
            row[..N].copy_from_slice(&monomials(at));
            row[N + j] = 1.0;
        }
        for c in 0..N {
            let pivot = (c..N)
                .max_by(|&x, &y| rows[x][c].abs().total_cmp(&rows[y][c].abs()))
                .unwrap_or(c);
            rows.swap(c, pivot);
            let lead = rows[c][c];
            rows[c].iter_mut().for_each(|x| *x /= lead);
            let row = rows[c];
            for other in (0..N).filter(|&r| r != c) {
                let factor = rows[other][c];
                for (x, y) in rows[other].iter_mut().zip(row) {
                    *x -= factor * y;
                }
            }
        }
        std::array::from_fn(|i| std::array::from_fn(|k| rows[k][N + i]))
    })
}

/// Barycentric coordinates in an element of a point of its `k`-th quarter: three at the
/// corners, the fourth in the middle.
pub(crate) fn in_parent(k: usize, at: [f64; 3]) -> [f64; 3] {
    match k {
        0..3 => {
            let mut result = at.map(|l| l / 2.0);
            result[k] += 0.5;
            result
        }
        _ => at.map(|l| 0.5 - l / 2.0),
    }
}

/// How values go from an element to its quarters and back.
pub(crate) struct Tables {
    /// `down[k][j][i]`: the element's function i at node j of its quarter k.
    pub(crate) down: [[[f64; N]; N]; 4],
    /// `up[k][i][j]`: what node j of quarter k gives to the element's coefficient i.
    pub(crate) up: [[[f64; N]; N]; 4],
}

/// The tables, made once.
pub(crate) fn tables() -> &'static Tables {
    static TABLES: OnceLock<Tables> = OnceLock::new();
    TABLES.get_or_init(|| {
        let mut tables = Tables {
            down: [[[0.0; N]; N]; 4],
            up: [[[0.0; N]; N]; 4],
        };
        for k in 0..4 {
            for (j, (at, weight)) in NODES.into_iter().enumerate() {
                for (i, value) in phi(in_parent(k, at)).into_iter().enumerate() {
                    tables.down[k][j][i] = value;
                    tables.up[k][i][j] = 0.25 * weight * value / NODES[i].1;
                }
            }
        }
        tables
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_one_at_their_node_and_add_up_to_one() {
        for (i, (at, _)) in NODES.into_iter().enumerate() {
            for (j, value) in phi(at).into_iter().enumerate() {
                assert!((value - f64::from(u8::from(i == j))).abs() < 1e-13);
            }
        }
        let sum: f64 = phi([0.2, 0.7, 0.1]).iter().sum();
        assert!((sum - 1.0).abs() < 1e-13);
    }

    #[test]
    fn a_quadratic_goes_down_and_up_again_unchanged() {
        let of = |[a, b, c]: [f64; 3]| 1.0 + 2.0 * a - b * c + 3.0 * a * b;
        let tables = tables();
        let coefficients = NODES.map(|(at, _)| of(at));
        let mut back = [0.0; N];
        for k in 0..4 {
            for (j, (at, _)) in NODES.into_iter().enumerate() {
                let value: f64 = (0..N).map(|i| tables.down[k][j][i] * coefficients[i]).sum();
                assert!((value - of(in_parent(k, at))).abs() < 1e-12);
                for (back, row) in back.iter_mut().zip(&tables.up[k]) {
                    *back += row[j] * value;
                }
            }
        }
        for (back, wanted) in back.into_iter().zip(coefficients) {
            assert!((back - wanted).abs() < 1e-12);
        }
    }
}
