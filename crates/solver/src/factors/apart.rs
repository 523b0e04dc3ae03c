//! Form factors of polygons that see each other in full and lie apart: Gauss's rule for
//! the closed form of a point, with a bound of its error beforehand.
//!
//! The double contour integral loses digits to cancellation where polygons are small
//! against their distance or their perimeters; the factor from a point does not, and is
//! the smoother the farther away the other polygon is.

use crate::factors::cubature::Estimate;
use antumbra_geom::Stop;
use antumbra_visibility::contour_sum;
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// A plane polygon with a front, as convex pieces that are counter-clockwise there.
#[derive(Clone, Copy)]
pub(crate) struct Polygon<'a> {
    pub(crate) normal: DVec3,
    pub(crate) pieces: &'a [Vec<DVec3>],
    pub(crate) area: f64,
}

/// `A F` from one polygon to another that it sees in full: the factor from a point
/// integrated over the one, with a bound of its error. Square units of the corners.
///
/// `None` if it was stopped, or if the polygons are too near to each other for
/// [`MOST_POINTS`] points.
///
/// * `accuracy` — the error allowed of the rule, square units.
///
/// # Source
///
/// Gauss's rule in collapsed coordinates (Duffy 1982), on triangles that are bisected
/// until the bound of [`bound`] allows few enough points.
pub(crate) fn integral_apart(
    from: Polygon<'_>,
    to: Polygon<'_>,
    accuracy: f64,
    stop: Stop<'_>,
) -> Option<Estimate> {
    let n_edges: usize = to.pieces.iter().map(Vec::len).sum();
    let mut sum = Estimate {
        value: 0.0,
        error: POINT_ROUNDING * n_edges as f64 * from.area,
    };
    let mut waiting: Vec<[DVec3; 3]> = from.pieces.iter().rev().flat_map(|p| fan(p)).collect();
    let mut points = 0;
    while let Some(triangle) = waiting.pop() {
        if stop.is_wanted() {
            return None;
        }
        let doubled = (triangle[1] - triangle[0])
            .cross(triangle[2] - triangle[0])
            .length();
        if doubled == 0.0 {
            continue;
        }
        let share = accuracy * 0.5 * doubled / from.area;
        let distance = distance_bound(&triangle, to);
        let Some((rules, error)) = enough_points(&triangle, distance, to.area, doubled, share)
        else {
            points += 1;
            if points + waiting.len() > MOST_POINTS {
                return None;
            }
            waiting.extend(bisected(triangle));
            continue;
        };
        points += rules[0].len() * rules[1].len();
        if points > MOST_POINTS {
            return None;
        }
        sum.value += doubled * cubature(&triangle, rules, from.normal, to);
        sum.error += error;
    }
    // Gauss's weights and the sum.
    sum.error += 8.0 * f64::EPSILON * sum.value.abs();
    Some(sum)
}

/// Points evaluated for one pair, and triangles looked at.
const MOST_POINTS: usize = 20_000;

/// The rounding of the factor from a point, for each edge it is summed over.
const POINT_ROUNDING: f64 = 2.0 * f64::EPSILON;

fn fan(corners: &[DVec3]) -> impl Iterator<Item = [DVec3; 3]> + '_ {
    corners.windows(2).skip(1).map(|w| [corners[0], w[0], w[1]])
}

/// The halves of a triangle, cut through the middle of its longest edge.
fn bisected(corners: [DVec3; 3]) -> [[DVec3; 3]; 2] {
    let length = |k: usize| corners[k].distance_squared(corners[(k + 1) % 3]);
    let k = (1..3).fold(0, |k, i| if length(i) > length(k) { i } else { k });
    let [a, b, c] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
    let middle = 0.5 * (a + b);
    [[middle, b, c], [a, middle, c]]
}

/// The factor from a point, integrated over a triangle and divided by twice its area.
fn cubature(triangle: &[DVec3; 3], rules: [&Gauss; 2], normal: DVec3, to: Polygon<'_>) -> f64 {
    let [a, b, c] = *triangle;
    let mut relative: Vec<DVec3> = Vec::new();
    let mut sum = 0.0;
    for &(u, weight_u) in rules[0] {
        for &(w, weight_w) in rules[1] {
            let point = a + ((b - a) + (c - b) * w) * u;
            let mut factor = 0.0;
            for piece in to.pieces {
                relative.clear();
                relative.extend(piece.iter().map(|&x| x - point));
                factor += contour_sum(&relative, normal);
            }
            sum += weight_u * weight_w * u * factor;
        }
    }
    sum
}

/// A lower bound of the distance between a triangle and a polygon.
fn distance_bound(triangle: &[DVec3; 3], to: Polygon<'_>) -> f64 {
    let middle = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
    let radius = triangle
        .iter()
        .fold(0.0, |r: f64, x| r.max(x.distance(middle)));
    let nearest = to.pieces.iter().fold(f64::INFINITY, |d, piece| {
        d.min(distance_to_piece(middle, piece, to.normal))
    });
    (nearest - radius).max(0.0)
}

/// The distance of a point from a convex polygon.
fn distance_to_piece(point: DVec3, piece: &[DVec3], normal: DVec3) -> f64 {
    let next = piece.iter().cycle().skip(1);
    let mut is_over = true;
    let mut nearest = f64::INFINITY;
    for (&a, &b) in piece.iter().zip(next) {
        let (edge, to_point) = (b - a, point - a);
        is_over &= normal.dot(edge.cross(to_point)) >= 0.0;
        let length_sq = edge.length_squared();
        let s = if length_sq > 0.0 {
            (to_point.dot(edge) / length_sq).clamp(0.0, 1.0)
        } else {
            0.0
        };
        nearest = nearest.min(to_point.distance(edge * s));
    }
    if is_over {
        normal.dot(point - piece[0]).abs()
    } else {
        nearest
    }
}

/// The two rules that are good enough on a triangle, and the error they leave at most;
/// `None` if the longest rules are not.
fn enough_points(
    triangle: &[DVec3; 3],
    distance: f64,
    area: f64,
    doubled: f64,
    accuracy: f64,
) -> Option<([&'static Gauss; 2], f64)> {
    let [a, b, c] = *triangle;
    // Half of how far a coordinate moves a point at most.
    let extents = [0.5 * a.distance(b).max(a.distance(c)), 0.5 * b.distance(c)];
    let mut rules: [Option<&Gauss>; 2] = [None; 2];
    let mut error = 0.0;
    for k in 0..2 {
        let found = RULES.iter().find_map(|rule| {
            // Weight `u` is 1/2 in the mean; on an ellipse it grows with the point.
            let error = doubled * bound(extents[k], distance, area, rule.len());
            (error <= 0.5 * accuracy).then_some((rule, error))
        })?;
        rules[k] = Some(found.0);
        error += found.1;
    }
    Some(([rules[0]?, rules[1]?], error))
}

/// How far Gauss's rule with so many points is off the mean of the factor along a
/// segment, weighted with the place on it, at most.
///
/// * `half` — half the length of the segment.
/// * `distance` — of all its points from the polygon, at least.
/// * `area` — of the polygon.
///
/// The factor is the integral of `K = (n₁·r)(n₂·r)/(π r⁴)` over the polygon. Along the
/// segment, of direction `h` from the middle to an end, `r² = h² (t − t₀)(t − t̄₀)`, and
/// `t₀` is no nearer to `[−1, 1]` than `distance / |h|`. On the ellipse with the minor
/// half-axis `β` no point is farther from `[−1, 1]` than `β`, so with
/// `y = β |h| / distance` and the real distance `r₀` of a point of the polygon,
/// `|r²| ≥ r₀² (1 − y)²`; `n₁·r` is constant and at most `r₀`; and
/// `|n₂·r| ≤ r₀ + (2 + β)|h| ≤ r₀ (1 + y + 2y/β)`. The weight is `(1 + t)/2`, at most
/// `1 + β/2` and a bit: `(1 + √(1 + β²))/2`.
///
/// # Source
///
/// The error of Gauss's rule for functions that are analytic in an ellipse,
/// `64 M ρ^{−2n} / 15 (1 − ρ^{−2})`: Trefethen, *Approximation Theory and Approximation
/// Practice*, theorem 19.3; half of it for the mean.
fn bound(half: f64, distance: f64, area: f64, n: usize) -> f64 {
    if half == 0.0 {
        return 0.0;
    }
    let most = area / (PI * distance * distance);
    let mut least = f64::INFINITY;
    for y in [0.1, 0.2, 0.35, 0.5, 0.65, 0.8] {
        let minor = y * distance / half;
        let major = (1.0 + minor * minor).sqrt();
        let rho = minor + major;
        let growth = (1.0 + y + 2.0 * y / minor) / (1.0f64 - y).powi(4);
        let weight = 0.5 * (1.0 + major);
        let decay = rho.powi(-2 * n as i32) / (1.0 - rho.powi(-2));
        let error = 32.0 / 15.0 * most * growth * weight * decay;
        // No distance, no bound.
        if error.is_finite() {
            least = least.min(error);
        }
    }
    least
}

/// Nodes in `[0, 1]` with their weights, whose sum is 1.
type Gauss = [(f64, f64)];

/// Gauss's rules of 2, 4, … points.
static RULES: LazyLock<Vec<Vec<(f64, f64)>>> =
    LazyLock::new(|| [2, 4, 6, 8, 12, 16, 24].map(gauss).to_vec());

/// Gauss's rule of `n` points on `[0, 1]`: Newton's method for the roots of Legendre's
/// polynomial.
fn gauss(n: usize) -> Vec<(f64, f64)> {
    // The polynomial of degree n and its derivative.
    let legendre = |x: f64| {
        let (mut before, mut p) = (1.0, x);
        for k in 2..=n {
            let k = k as f64;
            (before, p) = (p, ((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k);
        }
        (p, n as f64 * (x * p - before) / (x * x - 1.0))
    };
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            for _ in 0..8 {
                let (p, slope) = legendre(x);
                x -= p / slope;
            }
            let (_, slope) = legendre(x);
            let weight = 1.0 / ((1.0 - x * x) * slope * slope);
            (0.5 * (1.0 - x), weight)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn gauss_rules_integrate_polynomials() {
        for n in [2, 8, 24] {
            let degree = 2 * n as i32 - 1;
            let sum: f64 = gauss(n).iter().map(|(x, w)| w * x.powi(degree)).sum();
            assert!((sum * f64::from(degree + 1) - 1.0).abs() < 1e-13, "{n}");
        }
    }

    fn square(z: f64, size: f64) -> Vec<Vec<DVec3>> {
        let corner = |x: f64, y: f64| dvec3(size * x, size * y, z);
        vec![vec![
            corner(0.0, 0.0),
            corner(1.0, 0.0),
            corner(1.0, 1.0),
            corner(0.0, 1.0),
        ]]
    }

    fn opposed(distance: f64, accuracy: f64) -> Option<Estimate> {
        let mut upper = square(distance, 1.0);
        upper[0].reverse();
        let polygon = |normal, pieces| Polygon {
            normal,
            pieces,
            area: 1.0,
        };
        let lower = square(0.0, 1.0);
        let (from, to) = (polygon(DVec3::Z, &lower), polygon(-DVec3::Z, &upper));
        integral_apart(from, to, accuracy, Stop::NEVER)
    }

    /// Two unit squares, C-11 of Howell's catalogue, as far as the claimed error says.
    #[test]
    fn errors_are_bounded_near_and_far() {
        for accuracy in [1e-6, 1e-9, 1e-13] {
            let found = opposed(1.0, accuracy).unwrap();
            let off = (found.value - 0.199_824_895_698_387_38).abs();
            assert!(
                off <= found.error && found.error < accuracy + 1e-14,
                "{found:?}"
            );
        }
        // Far away the factor is 1/π z² (1 − 1/z² …): all digits of it are right.
        let z: f64 = 1e5;
        let found = opposed(z, 1e-30).unwrap();
        let exact = (PI * z * z).recip() * (1.0 - 2.0 / (3.0 * z * z));
        assert!((found.value - exact).abs() <= found.error, "{found:?}");
        assert!(found.error < 1e-14, "{found:?}");
    }

    #[test]
    fn polygons_that_touch_are_left_to_others() {
        assert!(opposed(1e-9, 1e-13).is_none());
    }
}
