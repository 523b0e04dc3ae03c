//! Values without jumps between elements.
//!
//! Nodes lie inside of elements, and what two neighbours say of their common edge differs by
//! what both err by. From afar that is nothing; but what a point of a wall gets from the
//! floor beside it jumps where the floor's values do, and no mesh follows that. So the
//! values that points gather from are made continuous: neighbours agree on the mean at
//! corners and middles of edges, and small elements follow the edges of large ones. Across
//! contacts, where light does jump, they need not agree.

use super::basis::{N, NODES, phi};
use super::forest::{Forest, edge};
use crate::basis::values;

/// Corners of an element and middles of its edges, in the order of
/// [`lattice`](crate::basis::lattice).
const POINTS: [[f64; 3]; N] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
];

/// Values at the points of whole elements.
struct Agreed {
    n_bands: usize,
    /// Sums, and then means, of all bands of every point.
    values: Vec<f64>,
    counts: Vec<u32>,
}

impl Agreed {
    fn of(&self, point: u32) -> &[f64] {
        &self.values[point as usize * self.n_bands..(point as usize + 1) * self.n_bands]
    }
}

/// Makes what whole elements reflect continuous.
pub(crate) fn smooth(forest: &mut Forest) {
    let whole: Vec<u32> = (0..forest.elements.len() as u32)
        .filter(|&e| {
            let element = &forest.elements[e as usize];
            !element.is_divided() && !forest.sides[element.side as usize].is_black
        })
        .collect();
    // The middles of all edges, as far as no quarter has them.
    for &e in &whole {
        let [a, b, c] = forest.elements[e as usize].vertices;
        for (p, q) in [(a, b), (b, c), (c, a)] {
            forest.middle_of(p, q);
        }
    }
    let own = own_values(forest, &whole);
    let mut agreed = Agreed {
        n_bands: forest.n_bands,
        values: vec![0.0; forest.n_vertices as usize * forest.n_bands],
        counts: vec![0; forest.n_vertices as usize],
    };
    for (&e, own) in whole.iter().zip(&own) {
        for (point, own) in points_of(forest, e)
            .into_iter()
            .zip(own.chunks(forest.n_bands))
        {
            agreed.counts[point as usize] += 1;
            let first = point as usize * forest.n_bands;
            for (sum, value) in agreed.values[first..].iter_mut().zip(own) {
                *sum += value;
            }
        }
    }
    for (values, &count) in agreed
        .values
        .chunks_mut(forest.n_bands.max(1))
        .zip(&agreed.counts)
    {
        values
            .iter_mut()
            .for_each(|v| *v /= f64::from(count.max(1)));
    }
    follow(forest, &whole, &mut agreed);
    for (&e, own) in whole.iter().zip(own) {
        adopt(forest, e, &own, &agreed);
    }
}

/// The points of an element.
fn points_of(forest: &Forest, e: u32) -> [u32; N] {
    let [a, b, c] = forest.elements[e as usize].vertices;
    let middle = |p, q| forest.middles[&edge(p, q)];
    [a, b, c, middle(a, b), middle(b, c), middle(c, a)]
}

/// What elements say themselves of their points.
fn own_values(forest: &Forest, whole: &[u32]) -> Vec<Vec<f64>> {
    let phis = POINTS.map(phi);
    let of_one = |&e: &u32| {
        let held = forest.coefficients(&forest.reflected, e);
        let mut own = Vec::with_capacity(N * forest.n_bands);
        for phi in &phis {
            for band in 0..forest.n_bands {
                let values = (0..N).map(|i| phi[i] * held[i * forest.n_bands + band]);
                own.push(values.sum::<f64>());
            }
        }
        own
    };
    whole.iter().map(of_one).collect()
}

/// Points of small elements on an edge of a large one follow it; the longest edges first.
fn follow(forest: &Forest, whole: &[u32], agreed: &mut Agreed) {
    let mut edges: Vec<(f64, [u32; 2])> = Vec::new();
    for &e in whole {
        let element = &forest.elements[e as usize];
        for k in 0..3 {
            let next = (k + 1) % 3;
            let [p, q] = edge(element.vertices[k], element.vertices[next]);
            let middle = forest.middles[&[p, q]];
            let is_divided = [[p, middle], [middle, q]]
                .into_iter()
                .any(|[p, q]| forest.middles.contains_key(&edge(p, q)));
            if is_divided {
                let length = element.corners[k].distance(element.corners[next]);
                edges.push((length, [p, q]));
            }
        }
    }
    edges.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    edges.dedup();
    for (_, [p, q]) in edges {
        let middle = forest.middles[&[p, q]];
        let ends = [p, middle, q].map(|point| agreed.of(point).to_vec());
        follow_edge(forest, [p, middle], [0.0, 0.5], &ends, agreed);
        follow_edge(forest, [middle, q], [0.5, 1.0], &ends, agreed);
    }
}

/// A part of an edge, with its places on it; `ends` has the values at 0, ½ and 1.
fn follow_edge(
    forest: &Forest,
    [p, q]: [u32; 2],
    [from, to]: [f64; 2],
    ends: &[Vec<f64>; 3],
    agreed: &mut Agreed,
) {
    let Some(&middle) = forest.middles.get(&edge(p, q)) else {
        return;
    };
    let s = (from + to) / 2.0;
    let weights = [
        (1.0 - s) * (1.0 - 2.0 * s),
        4.0 * s * (1.0 - s),
        s * (2.0 * s - 1.0),
    ];
    let first = middle as usize * agreed.n_bands;
    let values = &mut agreed.values[first..first + agreed.n_bands];
    for (band, value) in values.iter_mut().enumerate() {
        let parts = weights
            .iter()
            .zip(ends)
            .map(|(weight, end)| weight * end[band]);
        *value = parts.sum();
    }
    follow_edge(forest, [p, middle], [from, s], ends, agreed);
    follow_edge(forest, [middle, q], [s, to], ends, agreed);
}

/// An element takes over what was agreed on, but at contacts.
fn adopt(forest: &mut Forest, e: u32, own: &[f64], agreed: &Agreed) {
    let n_bands = forest.n_bands;
    let points = points_of(forest, e);
    let first = e as usize * N * n_bands;
    let mut at_points = own.to_vec();
    for (k, &point) in points.iter().enumerate() {
        if !forest.is_cut(point) {
            at_points[k * n_bands..(k + 1) * n_bands].copy_from_slice(agreed.of(point));
        }
    }
    for (j, (at, _)) in NODES.into_iter().enumerate() {
        let phi = values(2, at);
        for band in 0..n_bands {
            let values = (0..N).map(|k| phi[k] * at_points[k * n_bands + band]);
            forest.reflected[first + j * n_bands + band] = values.sum();
        }
    }
}
