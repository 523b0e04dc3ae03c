//! The viewing cone of an occluder: the half-spaces that together hold what it hides.

use crate::fragments::HalfSpace;
use crate::place::{ALONG, Approach, Place};
use glam::DVec3;

/// Rounding of one coordinate relative to the largest distance in play, with a
/// margin for the handful of operations between input and decision.
pub(crate) const RELATIVE_TOLERANCE: f64 = 16.0 * f64::EPSILON;

/// Appends the half-spaces of the cone in which `corners` hide what lies behind
/// them as seen from a place; returns how many, 0 if the cone is empty.
///
/// * `corners` — a convex plane polygon, either orientation.
/// * `normal` — its unit normal (counter-clockwise side).
/// * `reach` — an upper bound of the distance of everything that will be cut.
/// * `behind` — how far behind the point is seen what touches it, of the source that will be
///   cut; 0 if it does not touch the point. The polygon's plane, if the point touches it,
///   is as far behind: what stands on it is not beyond it.
///
/// The first half-space is "beyond the polygon's plane"; the others are its
/// edges. A polygon seen edge-on has an empty cone.
pub(crate) fn cone(
    out: &mut Vec<HalfSpace>,
    corners: &[DVec3],
    normal: DVec3,
    place: &Place,
    (reach, behind): (f64, f64),
) -> usize {
    let point = place.point;
    let first = corners[0] - point;
    let mut height = normal.dot(first);
    let edge_on = 8.0 * f64::EPSILON * (first.abs().max_element() + point.abs().max_element());
    let mut sign = height.signum();
    let tolerance = RELATIVE_TOLERANCE * reach;
    if let Some(slope) = place.leaves(normal, height, edge_on) {
        height = slope * behind;
        sign = -slope.signum();
    } else if height.abs() <= edge_on {
        return 0;
    }
    let start = out.len();
    out.push(HalfSpace {
        normal: normal * sign,
        offset: height.abs(),
        tolerance,
    });
    let n = corners.len();
    let edge = |i: usize| (corners[i], corners[if i + 1 == n { 0 } else { i + 1 }]);
    for i in 0..n {
        let (a, b) = edge(i);
        let plane = edge_plane(a, b, point, place.approach.as_ref()) * sign;
        out.push(HalfSpace {
            normal: plane,
            offset: 0.0,
            tolerance: tolerance * l1(plane),
        });
    }
    out.len() - start
}

/// An upper bound of a vector's length that costs no square root.
pub(crate) fn l1(v: DVec3) -> f64 {
    v.x.abs() + v.y.abs() + v.z.abs()
}

/// The normal of the plane through `point` and the edge `ab`: `(a−p) × (b−p)`.
///
/// Computed from the edge's ends in a fixed order, so that the two faces at an edge
/// find the same plane bit for bit and no light comes through between them.
///
/// Whether the point touches the edge is decided by the edge alone: of two polygons that
/// share it, one may touch the point and the other not.
pub(crate) fn edge_plane(a: DVec3, b: DVec3, point: DVec3, approach: Option<&Approach>) -> DVec3 {
    if (a.x, a.y, a.z) > (b.x, b.y, b.z) {
        return -edge_plane(b, a, point, approach);
    }
    let (qa, e) = (a - point, b - a);
    // The line counts, and not the edge: a convex piece may have several edges on one
    // line (below two windows with sills of one height), and that through a point of the
    // line and an edge elsewhere on it is no plane, but rounding.
    if let Some(approach) = approach
        && qa.cross(e).length_squared() <= approach.radius * approach.radius * e.length_squared()
    {
        // Derivative of (a − εd) × (b − εd) with respect to ε. It says nothing of a line
        // along the approach that passes the point at a distance.
        let derivative = e.cross(approach.toward);
        let rounding = 8.0 * f64::EPSILON * (qa.abs().max_element() + point.abs().max_element());
        let is_along = derivative.length_squared() <= ALONG * ALONG * e.length_squared();
        if !is_along || qa.cross(e).length_squared() <= rounding * rounding * e.length_squared() {
            return derivative;
        }
    }
    let plane = qa.cross(e);
    // A point within 1e-4 of the edge's line, relative to its distance from the
    // corner, loses that many digits of the plane: compute it with twice the digits.
    if plane.length_squared() < 1e-8 * qa.length_squared() * e.length_squared() {
        return cross_compensated(a, b, point);
    }
    plane
}

/// `(a−p) × (b−p)` in double-double arithmetic, rounded at the end.
fn cross_compensated(a: DVec3, b: DVec3, p: DVec3) -> DVec3 {
    let [a, b, p] = [a.to_array(), b.to_array(), p.to_array()];
    let qa: [Double; 3] = std::array::from_fn(|k| Double::difference(a[k], p[k]));
    let qb: [Double; 3] = std::array::from_fn(|k| Double::difference(b[k], p[k]));
    let minor = |i: usize, j: usize| {
        let (x, y) = (qa[i].product(qb[j]), qa[j].product(qb[i]));
        let high = Double::difference(x.high, y.high);
        high.high + (high.low + (x.low - y.low))
    };
    DVec3::new(minor(1, 2), minor(2, 0), minor(0, 1))
}

/// An unevaluated sum of two doubles.
///
/// # Source
///
/// Dekker 1971; Shewchuk 1997 (S97 in `docs/references.md`).
#[derive(Clone, Copy)]
struct Double {
    high: f64,
    low: f64,
}

impl Double {
    /// `a − b`, exactly.
    fn difference(a: f64, b: f64) -> Self {
        let high = a - b;
        let bb = a - high;
        let low = (a - (high + bb)) + (bb - b);
        Self { high, low }
    }

    /// The product to about 100 bits.
    fn product(self, other: Self) -> Self {
        let high = self.high * other.high;
        let (ah, al) = Self::halves(self.high);
        let (bh, bl) = Self::halves(other.high);
        let exact_tail = ((ah * bh - high) + ah * bl + al * bh) + al * bl;
        Self {
            high,
            low: exact_tail + (self.high * other.low + self.low * other.high),
        }
    }

    fn halves(x: f64) -> (f64, f64) {
        let c = 134_217_729.0 * x;
        let high = c - (c - x);
        (high, x - high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn compensated_plane_of_an_edge_next_to_the_point_is_right_to_all_digits() {
        // The point is 2⁻⁴⁰ beside the middle of a skew edge.
        let (a, b) = (dvec3(0.0, 0.0, 0.0), dvec3(0.75, 0.625, 0.875));
        let p = (a + b) / 2.0 + dvec3(2f64.powi(-40), 0.0, 0.0);
        let plane = cross_compensated(a, b, p);
        // (a−p) × (b−p) = (b−a) × (p−a) = (b−a) × 2⁻⁴⁰ x.
        let exact = (b - a).cross(dvec3(2f64.powi(-40), 0.0, 0.0));
        assert!((plane - exact).length() <= 1e-16 * exact.length());
    }
}
