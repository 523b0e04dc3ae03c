//! Lagrange bases of degree 1 to 4 on a triangle and on a square.

/// Most nodes an element can have: 15 at degree 4.
pub const MOST_NODES: usize = 15;

/// Nodes of an element of this degree.
#[must_use]
pub fn n_nodes(degree: u8) -> usize {
    let p = usize::from(degree);
    (p + 1) * (p + 2) / 2
}

/// The nodes of an element as multiples of 1/degree in barycentric coordinates.
///
/// The order is that of VTK's Lagrange triangles: the three corners, the inner
/// nodes of the edges 0–1, 1–2 and 2–0 in that direction, then the inner nodes.
#[must_use]
pub fn lattice(degree: u8) -> &'static [[u8; 3]] {
    match degree {
        1 => &[[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        2 => &[
            [2, 0, 0],
            [0, 2, 0],
            [0, 0, 2],
            [1, 1, 0],
            [0, 1, 1],
            [1, 0, 1],
        ],
        3 => &[
            [3, 0, 0],
            [0, 3, 0],
            [0, 0, 3],
            [2, 1, 0],
            [1, 2, 0],
            [0, 2, 1],
            [0, 1, 2],
            [1, 0, 2],
            [2, 0, 1],
            [1, 1, 1],
        ],
        _ => &[
            [4, 0, 0],
            [0, 4, 0],
            [0, 0, 4],
            [3, 1, 0],
            [2, 2, 0],
            [1, 3, 0],
            [0, 3, 1],
            [0, 2, 2],
            [0, 1, 3],
            [1, 0, 3],
            [2, 0, 2],
            [3, 0, 1],
            [2, 1, 1],
            [1, 2, 1],
            [1, 1, 2],
        ],
    }
}

/// The values of all basis functions at a point in barycentric coordinates; only
/// the first [`n_nodes`] are set.
#[must_use]
pub fn values(degree: u8, at: [f64; 3]) -> [f64; MOST_NODES] {
    let p = f64::from(degree);
    // factor[k][m] = Π_{q<m} (p λₖ − q)/(q + 1)
    let mut factor = [[1.0; 5]; 3];
    for k in 0..3 {
        for m in 0..usize::from(degree) {
            let q = m as f64;
            factor[k][m + 1] = factor[k][m] * (p * at[k] - q) / (q + 1.0);
        }
    }
    let mut result = [0.0; MOST_NODES];
    for (value, node) in result.iter_mut().zip(lattice(degree)) {
        *value = factor[0][usize::from(node[0])]
            * factor[1][usize::from(node[1])]
            * factor[2][usize::from(node[2])];
    }
    result
}

/// Most nodes of a quadrilateral: 25 at degree 4.
pub const MOST_QUAD_NODES: usize = 25;

/// Nodes of a quadrilateral of this degree.
#[must_use]
pub fn n_quad_nodes(degree: u8) -> usize {
    let p = usize::from(degree);
    (p + 1) * (p + 1)
}

/// The nodes of a quadrilateral as multiples of 1/degree in the unit square; only the
/// first [`n_quad_nodes`] are set.
///
/// The order is that of VTK's Lagrange quadrilaterals: the four corners, the inner nodes
/// of the edges 0–1, 1–2, 3–2 and 0–3 in that direction, then the inner nodes row by row.
#[must_use]
pub fn quad_lattice(degree: u8) -> [[u8; 2]; MOST_QUAD_NODES] {
    let p = degree;
    let mut nodes = [[0; 2]; MOST_QUAD_NODES];
    let corners = [[0, 0], [p, 0], [p, p], [0, p]];
    let edges = [0, 1, 2, 3].into_iter().flat_map(|edge| {
        (1..p).map(move |i| match edge {
            0 => [i, 0],
            1 => [p, i],
            2 => [i, p],
            _ => [0, i],
        })
    });
    let inner = (1..p).flat_map(|j| (1..p).map(move |i| [i, j]));
    for (node, at) in nodes
        .iter_mut()
        .zip(corners.into_iter().chain(edges).chain(inner))
    {
        *node = at;
    }
    nodes
}

/// The values of the basis functions on a segment, at the nodes 0, 1/degree, …, 1; only
/// the first degree + 1 are set.
#[must_use]
pub fn segment_values(degree: u8, at: f64) -> [f64; 5] {
    let p = usize::from(degree);
    let x = at * f64::from(degree);
    let mut result = [0.0; 5];
    for (i, value) in result.iter_mut().enumerate().take(p + 1) {
        *value = (0..=p)
            .filter(|&j| j != i)
            .map(|j| (x - j as f64) / (i as f64 - j as f64))
            .product();
    }
    result
}

/// The values of all basis functions of a quadrilateral at a point of the unit square:
/// products of those on segments. Only the first [`n_quad_nodes`] are set.
#[must_use]
pub fn quad_values(degree: u8, [s, t]: [f64; 2]) -> [f64; MOST_QUAD_NODES] {
    let (along_s, along_t) = (segment_values(degree, s), segment_values(degree, t));
    let mut result = [0.0; MOST_QUAD_NODES];
    let lattice = quad_lattice(degree);
    for (value, node) in result.iter_mut().zip(lattice).take(n_quad_nodes(degree)) {
        *value = along_s[usize::from(node[0])] * along_t[usize::from(node[1])];
    }
    result
}

/// A quadrature rule on the triangle, exact for polynomials of degree 8: pairs of
/// barycentric coordinates and weights that add up to 1.
///
/// # Source
///
/// Dunavant 1985, the rule of 16 points.
#[must_use]
pub fn quadrature() -> [([f64; 3], f64); 16] {
    let mut rule = [([1.0 / 3.0; 3], 0.144_315_607_677_787); 16];
    let mut at = 1;
    for (a, b, w) in [
        (
            0.081_414_823_414_554,
            0.459_292_588_292_723,
            0.095_091_634_267_285,
        ),
        (
            0.658_861_384_496_480,
            0.170_569_307_751_760,
            0.103_217_370_534_718,
        ),
        (
            0.898_905_543_365_938,
            0.050_547_228_317_031,
            0.032_458_497_623_198,
        ),
    ] {
        for p in [[a, b, b], [b, a, b], [b, b, a]] {
            rule[at] = (p, w);
            at += 1;
        }
    }
    let (a, b, w) = (
        0.008_394_777_409_958,
        0.263_112_829_634_638,
        0.027_230_314_174_435,
    );
    let c = 1.0 - a - b;
    for p in [
        [a, b, c],
        [b, c, a],
        [c, a, b],
        [b, a, c],
        [a, c, b],
        [c, b, a],
    ] {
        rule[at] = (p, w);
        at += 1;
    }
    rule
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_basis_function_is_one_at_its_node_and_zero_at_the_others() {
        for degree in 1..=4 {
            assert_eq!(lattice(degree).len(), n_nodes(degree));
            for (i, node) in lattice(degree).iter().enumerate() {
                let at = node.map(|m| f64::from(m) / f64::from(degree));
                let values = values(degree, at);
                for (j, v) in values[..n_nodes(degree)].iter().enumerate() {
                    assert!((v - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn every_basis_function_of_a_quadrilateral_is_one_at_its_node_alone() {
        for degree in 1..=4 {
            let n = n_quad_nodes(degree);
            let lattice = quad_lattice(degree);
            for (i, node) in lattice[..n].iter().enumerate() {
                assert!(!lattice[..i].contains(node), "{node:?} twice");
                let at = node.map(|m| f64::from(m) / f64::from(degree));
                for (j, v) in quad_values(degree, at)[..n].iter().enumerate() {
                    assert!((v - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn quadrature_integrates_degree_eight() {
        // ∫ λ₀⁴ λ₁⁴ = 2·4!·4!/10! of the area.
        let sum: f64 = quadrature()
            .iter()
            .map(|(p, w)| w * p[0].powi(4) * p[1].powi(4))
            .sum();
        assert!((sum - 2.0 * 576.0 / 3_628_800.0).abs() < 1e-14);
        let one: f64 = quadrature().iter().map(|(_, w)| w).sum();
        assert!((one - 1.0).abs() < 1e-14);
    }
}
