//! The nodes of a Lagrange triangle of degree 1 to 4, and its polynomials.
//!
//! A node's lattice coordinates are its barycentric coordinates times the
//! degree: three whole numbers that add up to the degree.

/// Most nodes an element can have: a quadrilateral of degree 4.
pub(crate) const MAX_NODES: usize = 25;

/// Lattice coordinates of the nodes, in VTK's order: corners, edges 0–1, 1–2
/// and 2–0, then the inner triangle by the same rule.
pub(crate) fn lattice(degree: u8) -> Vec<[u8; 3]> {
    if degree == 0 {
        return vec![[0; 3]];
    }
    let mut nodes = vec![[degree, 0, 0], [0, degree, 0], [0, 0, degree]];
    for (from, to) in [(0, 1), (1, 2), (2, 0)] {
        for k in 1..degree {
            let mut node = [0; 3];
            node[from] = degree - k;
            node[to] = k;
            nodes.push(node);
        }
    }
    if degree >= 3 {
        let inner = lattice(degree - 3);
        nodes.extend(inner.iter().map(|node| node.map(|k| k + 1)));
    }
    nodes
}

/// The degree² linear triangles between the nodes, counter-clockwise like the
/// element, as indices into its nodes.
pub(crate) fn sub_triangles(degree: u8) -> Vec<[usize; 3]> {
    let nodes = lattice(degree);
    let index = |i: u8, j: u8| {
        nodes
            .iter()
            .position(|node| node[1] == i && node[2] == j)
            .expect("the lattice holds every pair with i + j <= degree")
    };
    let mut triangles = Vec::new();
    for j in 0..degree {
        for i in 0..degree - j {
            triangles.push([index(i, j), index(i + 1, j), index(i, j + 1)]);
            if i + j + 1 < degree {
                triangles.push([index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
            }
        }
    }
    triangles
}

/// Lattice coordinates of the nodes of a quadrilateral in the unit square, times the
/// degree, in VTK's order: corners, edges 0–1, 1–2, 3–2 and 0–3, then inside row by row.
pub(crate) fn quad_lattice(degree: u8) -> Vec<[u8; 2]> {
    let p = degree;
    let mut nodes = vec![[0, 0], [p, 0], [p, p], [0, p]];
    nodes.extend((1..p).map(|i| [i, 0]));
    nodes.extend((1..p).map(|i| [p, i]));
    nodes.extend((1..p).map(|i| [i, p]));
    nodes.extend((1..p).map(|i| [0, i]));
    for j in 1..p {
        nodes.extend((1..p).map(|i| [i, j]));
    }
    nodes
}

/// The 2 degree² linear triangles between the nodes of a quadrilateral.
pub(crate) fn quad_sub_triangles(degree: u8) -> Vec<[usize; 3]> {
    let nodes = quad_lattice(degree);
    let index = |i: u8, j: u8| {
        nodes
            .iter()
            .position(|node| *node == [i, j])
            .expect("the lattice holds every pair up to the degree")
    };
    let mut triangles = Vec::new();
    for j in 0..degree {
        for i in 0..degree {
            let [a, b] = [index(i, j), index(i + 1, j)];
            let [d, c] = [index(i, j + 1), index(i + 1, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// The Lagrange polynomials of one degree on the unit square.
#[derive(Clone, Debug)]
pub(crate) struct QuadBasis {
    degree: u8,
    nodes: Vec<[u8; 2]>,
}

impl QuadBasis {
    pub(crate) fn new(degree: u8) -> Self {
        Self {
            degree,
            nodes: quad_lattice(degree),
        }
    }

    pub(crate) fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Value of the polynomial with these node values, and its derivatives, at a point of
    /// the unit square.
    pub(crate) fn evaluate(&self, at: [f64; 2], values: &[f64]) -> (f64, [f64; 2]) {
        let factors = at.map(|t| self.factors(t));
        let (mut value, mut derivative) = (0.0, [0.0; 2]);
        for (node, &v) in self.nodes.iter().zip(values) {
            let [a, b] = [0, 1].map(|k| factors[k][usize::from(node[k])]);
            value += v * a.0 * b.0;
            derivative[0] += v * a.1 * b.0;
            derivative[1] += v * a.0 * b.1;
        }
        (value, derivative)
    }

    /// The polynomials on a segment and their derivatives.
    fn factors(&self, t: f64) -> [(f64, f64); 5] {
        let p = f64::from(self.degree);
        let mut factors = [(1.0, 0.0); 5];
        for (i, factor) in factors.iter_mut().enumerate().take(self.nodes.len()) {
            for j in (0..=usize::from(self.degree)).filter(|&j| j != i) {
                let span = i as f64 - j as f64;
                let (value, slope) = *factor;
                let x = (p * t - j as f64) / span;
                *factor = (value * x, slope * x + value * p / span);
            }
        }
        factors
    }
}

/// The Lagrange polynomials of one degree.
#[derive(Clone, Debug)]
pub(crate) struct Basis {
    degree: u8,
    nodes: Vec<[u8; 3]>,
}

impl Basis {
    pub(crate) fn new(degree: u8) -> Self {
        Self {
            degree,
            nodes: lattice(degree),
        }
    }

    pub(crate) fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// Value of the polynomial with these node values, and its derivative by
    /// each barycentric coordinate, at barycentric coordinates `bary`.
    pub(crate) fn evaluate(&self, bary: [f64; 3], values: &[f64]) -> (f64, [f64; 3]) {
        let factors = bary.map(|b| self.factors(b));
        let mut value = 0.0;
        let mut derivative = [0.0; 3];
        for (node, &v) in self.nodes.iter().zip(values) {
            let [a, b, c] = [0, 1, 2].map(|k| factors[k][usize::from(node[k])]);
            value += v * a.0 * b.0 * c.0;
            derivative[0] += v * a.1 * b.0 * c.0;
            derivative[1] += v * a.0 * b.1 * c.0;
            derivative[2] += v * a.0 * b.0 * c.1;
        }
        (value, derivative)
    }

    /// `P_i(degree · b)` and its derivative by `b`, where `P_i` vanishes at
    /// `0, …, i - 1` and is 1 at `i`.
    fn factors(&self, b: f64) -> [(f64, f64); 5] {
        let p = f64::from(self.degree);
        let mut factors = [(1.0, 0.0); 5];
        for i in 0..usize::from(self.degree) {
            let (value, slope) = factors[i];
            let root = i as f64;
            let x = p * b - root;
            factors[i + 1] = (
                value * x / (root + 1.0),
                (slope * x + value * p) / (root + 1.0),
            );
        }
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_is_one_at_its_own_node_and_zero_at_the_others() {
        for degree in 1..=4 {
            let basis = Basis::new(degree);
            for (i, node) in basis.nodes.iter().enumerate() {
                let bary = node.map(|k| f64::from(k) / f64::from(degree));
                for j in 0..basis.n_nodes() {
                    let mut values = vec![0.0; basis.n_nodes()];
                    values[j] = 1.0;
                    let (value, _) = basis.evaluate(bary, &values);
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((value - expected).abs() < 1e-12, "{degree} {i} {j} {value}");
                }
            }
        }
    }

    #[test]
    fn quartic_is_reproduced_with_its_derivatives() {
        let f = |b: [f64; 3]| b[0].powi(3) * b[1] - 2.0 * b[1] * b[2] + b[2].powi(4);
        let basis = Basis::new(4);
        let values: Vec<f64> = (basis.nodes.iter())
            .map(|node| f(node.map(|k| f64::from(k) / 4.0)))
            .collect();
        let at = [0.2, 0.37, 0.43];
        let (value, d) = basis.evaluate(at, &values);
        assert!((value - f(at)).abs() < 1e-12);
        // Along the element: from corner 0 towards corner 1.
        let h = 1e-6;
        let slope =
            (f([at[0] - h, at[1] + h, at[2]]) - f([at[0] + h, at[1] - h, at[2]])) / (2.0 * h);
        assert!((d[1] - d[0] - slope).abs() < 1e-6);
    }

    #[test]
    fn basis_of_a_quadrilateral_reproduces_products_with_derivatives() {
        let f = |[s, t]: [f64; 2]| s.powi(3) * t - 2.0 * s * t.powi(3) + 0.5;
        let basis = QuadBasis::new(3);
        let at = |node: &[u8; 2]| node.map(|k| f64::from(k) / 3.0);
        let values: Vec<f64> = basis.nodes.iter().map(|node| f(at(node))).collect();
        let (value, d) = basis.evaluate([0.3, 0.8], &values);
        assert!((value - f([0.3, 0.8])).abs() < 1e-12);
        assert!((d[0] - (3.0 * 0.09 * 0.8 - 2.0 * 0.512)).abs() < 1e-12);
        assert!((d[1] - (0.027 - 6.0 * 0.3 * 0.64)).abs() < 1e-12);
        for degree in 1..=4 {
            assert_eq!(
                quad_sub_triangles(degree).len(),
                2 * usize::from(degree).pow(2)
            );
        }
    }

    #[test]
    fn sub_triangles_cover_the_element_once() {
        for degree in 1..=4 {
            let nodes = lattice(degree);
            let triangles = sub_triangles(degree);
            assert_eq!(triangles.len(), usize::from(degree).pow(2));
            for [a, b, c] in triangles {
                let at = |k: usize| [i32::from(nodes[k][1]), i32::from(nodes[k][2])];
                let ([ax, ay], [bx, by], [cx, cy]) = (at(a), at(b), at(c));
                assert_eq!((bx - ax) * (cy - ay) - (by - ay) * (cx - ax), 1);
            }
        }
    }
}
