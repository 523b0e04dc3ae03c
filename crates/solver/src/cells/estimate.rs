//! What interpolation costs: measured, and as the literature estimates it.

use super::layout::{Spot, reference};
use super::{Current, Field};
use crate::field::Light;
use antumbra_geom::Stop;
use antumbra_mesh::cells::Beyond;
use glam::DVec2;

/// How the error of an element is estimated. All are in the unit of irradiance.
///
/// The mesh's nodes are exact, so what is estimated is the error of interpolation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// The largest difference to an exact value at points that are no nodes: as the
    /// discontinuity mesh measures. The default.
    ///
    /// Points are those where quarters would have nodes, so that refinement evaluates
    /// little twice; and before the work ends, others.
    Measured,
    /// Half of the largest difference of the values in the middle of the element and of
    /// its neighbours. Tells contrast, not error.
    ///
    /// # Source
    ///
    /// Cohen, Greenberg, Immel & Brock 1986, *An efficient radiosity approach for realistic
    /// image synthesis*.
    Neighbours,
    /// The difference of the slopes of exact and interpolated irradiance along the edges,
    /// at their ends, times the length of the edge and a constant of the degree: what an
    /// interpolation error with that slope has in its middle. Sees contrast that is
    /// interpolated well as no error.
    ///
    /// Slopes are taken from exact values at a hundredth of the edge.
    ///
    /// # Source
    ///
    /// Vedel & Puech 1991, *A testbed for adaptive subdivision in progressive radiosity*.
    Gradient,
    /// The largest difference to the element of the next higher degree, at its nodes; of a
    /// bilinear element, to the bicubic one.
    HigherOrder,
    /// The largest residual of the equation at Gauss points (3 × 3 of a quadrilateral, 6
    /// of a triangle): exact irradiance less the interpolated one.
    ///
    /// # Source
    ///
    /// Lischinski, Smits & Greenberg 1994, *Bounds and error estimates for radiosity*;
    /// Campbell 1991, *Modeling global diffuse illumination for image synthesis*.
    Residual,
}

impl Estimator {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Measured,
        Self::Neighbours,
        Self::Gradient,
        Self::HigherOrder,
        Self::Residual,
    ];

    /// The name in options and reports.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Neighbours => "neighbours",
            Self::Gradient => "gradient",
            Self::HigherOrder => "higher-order",
            Self::Residual => "residual",
        }
    }

    /// The estimator of this name.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|e| e.key() == key)
    }
}

/// Which exact points an error is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Points {
    /// Where quarters have nodes.
    Nested,
    /// The same, and points off all symmetry.
    NestedAndOthers,
    /// Where the element of the higher degree has nodes.
    Higher,
    /// At Gauss points.
    Gauss,
    /// Near the ends of edges.
    EdgeEnds,
}

/// Elements longer than this fraction of their receiver are measured at both ends of
/// every edge.
const LONG: f64 = 0.1;

/// Where slopes are measured, as a share of the edge.
const NEAR_END: f64 = 0.01;

/// The largest value of an interpolation error relative to its slope at the end of a unit
/// edge, by degree: that of the product of all `t − k/p` on [0, 1], over `p!/pᵖ`.
const HEIGHT_OF_SLOPE: [f64; 4] = [0.25, 0.0962, 0.0556, 0.0378];

/// The nested points inside of quadrilaterals, by degree.
const NESTED_QUAD: [&[[f64; 2]]; 4] = [
    &[[0.5, 0.5]],
    &[[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]],
    &[
        [0.5, 1.0 / 6.0],
        [5.0 / 6.0, 0.5],
        [0.5, 5.0 / 6.0],
        [1.0 / 6.0, 0.5],
        [0.5, 0.5],
    ],
    &[
        [0.375, 0.125],
        [0.875, 0.375],
        [0.625, 0.875],
        [0.125, 0.625],
    ],
];

/// The nested points inside of triangles, by degree; those of degree 1 are all on edges.
const NESTED_TRIANGLE: [&[[f64; 2]]; 4] = [
    &[[1.0 / 3.0, 1.0 / 3.0]],
    &[[0.25, 0.25], [0.5, 0.25], [0.25, 0.5]],
    &[[1.0 / 6.0, 1.0 / 3.0], [0.5, 1.0 / 6.0], [1.0 / 3.0, 0.5]],
    &[[0.625, 0.25], [0.25, 0.125], [0.125, 0.625]],
];

/// Points off every symmetry line, so that no odd or even error hides.
const OTHERS_QUAD: [[f64; 2]; 4] = [[0.42, 0.09], [0.91, 0.42], [0.58, 0.91], [0.09, 0.58]];
const OTHERS_TRIANGLE: [[f64; 2]; 3] = [[0.50, 0.08], [0.08, 0.42], [0.42, 0.50]];

/// The points of the Gauss rules of degree 5 on the square and 4 on the triangle: with
/// fewer, errors of opposite curvatures hide from all of them.
const GAUSS_QUAD: [[f64; 2]; 9] = {
    const NEAR: f64 = 0.112_701_665_379_258_3;
    const FAR: f64 = 1.0 - NEAR;
    [
        [NEAR, NEAR],
        [0.5, NEAR],
        [FAR, NEAR],
        [NEAR, 0.5],
        [0.5, 0.5],
        [FAR, 0.5],
        [NEAR, FAR],
        [0.5, FAR],
        [FAR, FAR],
    ]
};
const GAUSS_TRIANGLE: [[f64; 2]; 6] = {
    const A: f64 = 0.445_948_490_915_965;
    const B: f64 = 0.091_576_213_509_771;
    [
        [A, A],
        [1.0 - 2.0 * A, A],
        [A, 1.0 - 2.0 * A],
        [B, B],
        [1.0 - 2.0 * B, B],
        [B, 1.0 - 2.0 * B],
    ]
};

impl Field {
    /// Errors per element and band; nothing if it was stopped.
    pub(super) fn estimate(
        &mut self,
        estimator: Estimator,
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let points = match estimator {
            Estimator::Neighbours => return Some(self.differences_of_neighbours()),
            Estimator::Measured => Points::NestedAndOthers,
            Estimator::Gradient => Points::EdgeEnds,
            Estimator::HigherOrder => Points::Higher,
            Estimator::Residual => Points::Gauss,
        };
        self.errors_at(points, light, stop)
    }

    /// Largest differences to exact values; nothing if it was stopped.
    pub(super) fn errors_at(
        &mut self,
        points: Points,
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let Some(current) = self.current.take() else {
            return Some(Vec::new());
        };
        let errors = self.errors_of(&current, points, light, stop);
        self.current = Some(current);
        errors
    }

    fn errors_of(
        &mut self,
        current: &Current,
        points: Points,
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let layout = &current.layout;
        let n_cells = layout.mesh.cells.len();
        let mut errors = vec![0.0f64; n_cells * self.n_bands];
        if self.is_dark {
            return Some(errors);
        }
        let (mut wanted, mut where_to) = (Vec::new(), Vec::new());
        for c in 0..n_cells {
            for (spot, factor) in self.spots(current, c, points) {
                let place = layout.place(c, spot, &mut self.places);
                let is_quad = layout.mesh.cells[c].is_quadrilateral();
                wanted.push(place);
                where_to.push((c, reference(is_quad, spot), factor));
            }
        }
        if !self.evaluate_places(&wanted, light, stop) {
            return None;
        }
        for (place, (c, at, factor)) in wanted.into_iter().zip(where_to) {
            for (band, &exact) in self.places.values(place).iter().enumerate() {
                let value = layout.value(&current.direct, self.n_bands, c, at, band);
                let worst = &mut errors[c * self.n_bands + band];
                *worst = worst.max(factor * (value - exact).abs());
            }
        }
        Some(errors)
    }

    /// Where the error of an element is taken from, and what it is multiplied by.
    fn spots(&self, current: &Current, c: usize, points: Points) -> Vec<(Spot, f64)> {
        let layout = &current.layout;
        let cell = &layout.mesh.cells[c];
        let (is_quad, n) = (cell.is_quadrilateral(), cell.corners().len());
        let p = usize::from(layout.degree) - 1;
        let inside = |list: &[[f64; 2]]| -> Vec<(Spot, f64)> {
            list.iter().map(|&at| (Spot::Inside(at), 1.0)).collect()
        };
        match points {
            Points::Nested | Points::NestedAndOthers => {
                let mut spots = inside(if is_quad {
                    NESTED_QUAD[p]
                } else {
                    NESTED_TRIANGLE[p]
                });
                let off = 0.5 / f64::from(layout.degree);
                let is_long = layout.mesh.longest_edge(c) > LONG * self.size;
                for k in 0..n {
                    // The same place from both sides.
                    let [a, b] = cell.edge(k);
                    let first = if a < b { off } else { 1.0 - off };
                    spots.push((Spot::Edge(k, first), 1.0));
                    if p > 0 && is_long {
                        spots.push((Spot::Edge(k, 1.0 - first), 1.0));
                    }
                }
                if points == Points::NestedAndOthers {
                    spots.extend(inside(if is_quad {
                        &OTHERS_QUAD
                    } else {
                        &OTHERS_TRIANGLE
                    }));
                    spots.extend(self.hot_spots_in(current, c));
                }
                spots
            }
            Points::Gauss if is_quad => inside(&GAUSS_QUAD),
            Points::Gauss => inside(&GAUSS_TRIANGLE),
            Points::Higher => higher_spots(is_quad, layout.degree),
            Points::EdgeEnds => {
                let factor = HEIGHT_OF_SLOPE[p] / NEAR_END;
                let mut spots = Vec::new();
                for k in 0..n {
                    for (corner, at) in [(k, NEAR_END), ((k + 1) % n, 1.0 - NEAR_END)] {
                        // At a node that follows from others the error does not begin
                        // with zero.
                        let node = layout.nodes_of(c)[corner];
                        if !layout.is_constrained[node as usize] {
                            spots.push((Spot::Edge(k, at), factor));
                        }
                    }
                }
                spots
            }
        }
    }

    /// Places under near emitters in an element.
    fn hot_spots_in(&self, current: &Current, c: usize) -> Vec<(Spot, f64)> {
        let mesh = &current.layout.mesh;
        let corners = mesh.corner_positions(c);
        let is_in = |p: &DVec2| {
            (0..4).all(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                a == b || (b - a).perp_dot(*p - a) > 1e-6 * (b - a).length_squared()
            })
        };
        let spots = self.hot_spots.iter().copied().filter(is_in);
        spots
            .map(|p| (Spot::Inside(mesh.reference(c, p)), 1.0))
            .collect()
    }

    fn differences_of_neighbours(&self) -> Vec<f64> {
        let Some(current) = &self.current else {
            return Vec::new();
        };
        let layout = &current.layout;
        let n_bands = self.n_bands;
        let n_cells = layout.mesh.cells.len();
        let middle = |is_quad: bool| if is_quad { [0.5, 0.5] } else { [1.0 / 3.0; 2] };
        let values: Vec<f64> = (0..n_cells)
            .flat_map(|c| {
                let at = middle(layout.mesh.cells[c].is_quadrilateral());
                (0..n_bands).map(move |band| layout.value(&current.direct, n_bands, c, at, band))
            })
            .collect();
        let mut errors = vec![0.0f64; n_cells * n_bands];
        for c in 0..n_cells {
            for k in 0..layout.mesh.cells[c].corners().len() {
                let (Beyond::Cell(d) | Beyond::Coarser { cell: d, .. }) = layout.mesh.beyond(c, k)
                else {
                    continue;
                };
                for band in 0..n_bands {
                    let (i, j) = (c * n_bands + band, d as usize * n_bands + band);
                    let half = (values[i] - values[j]).abs() / 2.0;
                    errors[i] = errors[i].max(half);
                    errors[j] = errors[j].max(half);
                }
            }
        }
        errors
    }
}

/// The nodes of the element of higher degree that the estimator compares with, corners
/// apart.
fn higher_spots(is_quadrilateral: bool, degree: u8) -> Vec<(Spot, f64)> {
    let p = match (is_quadrilateral, degree) {
        (true, 1) => 3,
        (_, degree) => degree + 1,
    };
    let n = if is_quadrilateral { 4 } else { 3 };
    let mut spots = Vec::new();
    for k in 0..n {
        for i in 1..p {
            spots.push((Spot::Edge(k, f64::from(i) / f64::from(p)), 1.0));
        }
    }
    for i in 1..p {
        let most = if is_quadrilateral { p } else { p - i };
        for j in 1..most {
            let at = [i, j].map(|m| f64::from(m) / f64::from(p));
            spots.push((Spot::Inside(at), 1.0));
        }
    }
    spots
}
