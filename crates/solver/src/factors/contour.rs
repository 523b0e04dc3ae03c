//! Form factors in closed form: the double contour integral, for polygons that see
//! each other in full.

use crate::factors::cubature::Estimate;
use antumbra_geom::Stop;
use glam::DVec3;
use std::f64::consts::TAU;

/// `A F` of two polygons that see each other in full, and its error: the area of one
/// times the form factor from it to the other. Square units of the corners.
///
/// * `a`, `b` — the loops of either polygon, counter-clockwise seen from its front,
///   holes clockwise. Neither reaches behind the other's plane.
/// * `accuracy` — the error allowed, square units; rounding adds what it adds, and the
///   error of the result says how much.
///
/// `None` if it was stopped.
///
/// Swapping the polygons swaps the inner and the outer integral, so the results
/// agree up to the errors, not to the bit.
///
/// # Source
///
/// `A F = (1/2π) ∮∮ ln r dx·dy` (Sparrow 1963, S63; Schröder & Hanrahan 1993, SH93 in
/// `docs/references.md`). The inner integral along an edge is elementary; the outer
/// one is taken by adaptive Gauss–Kronrod quadrature, whose intervals shrink towards
/// points where the edges meet.
pub(crate) fn contour_integral(
    a: &[Vec<DVec3>],
    b: &[Vec<DVec3>],
    accuracy: f64,
    stop: Stop<'_>,
) -> Option<Estimate> {
    // Adding a constant to ln r changes nothing over closed loops; with a typical
    // distance as unit the terms of distant polygons are small.
    let unit = (middle(a) - middle(b)).length().max(size(a) + size(b));
    // Relative to a corner, so that rounding is that of the pair, not of the scene.
    let origin = a[0][0];
    let n_edges = |loops: &[Vec<DVec3>]| loops.iter().map(Vec::len).sum::<usize>();
    let share = accuracy * TAU / (n_edges(a) * n_edges(b)).max(1) as f64;
    let mut sum = Estimate::default();
    for outer in edges(a, origin) {
        for inner in edges(b, origin) {
            let cosine = outer.along.dot(inner.along);
            // Smaller is rounding of right angles.
            if cosine.abs() > 1e-16 {
                let term = edge_pair(&outer, &inner, unit, share, stop)?;
                sum.value += cosine * term.value;
                // The cosine itself is rounded.
                sum.error += cosine.abs() * term.error + f64::EPSILON * term.value.abs();
            }
        }
    }
    Some(Estimate {
        value: sum.value / TAU,
        error: sum.error / TAU,
    })
}

fn middle(loops: &[Vec<DVec3>]) -> DVec3 {
    let outline = &loops[0];
    outline.iter().sum::<DVec3>() / outline.len() as f64
}

fn size(loops: &[Vec<DVec3>]) -> f64 {
    let middle = middle(loops);
    let outline = loops[0].iter();
    outline.fold(0.0, |most, x| most.max(x.distance(middle)))
}

/// An edge: a start, a unit direction and a length.
struct Line {
    start: DVec3,
    along: DVec3,
    length: f64,
}

fn edges(loops: &[Vec<DVec3>], origin: DVec3) -> impl Iterator<Item = Line> {
    loops.iter().flat_map(move |corners| {
        let n = corners.len();
        (0..n).filter_map(move |i| {
            let (start, end) = (corners[i] - origin, corners[(i + 1) % n] - origin);
            let length = start.distance(end);
            let along = (end - start).try_normalize()?;
            Some(Line {
                start,
                along,
                length,
            })
        })
    })
}

/// `∫∫ ln (r/unit) ds du` over two edges, and its error; `None` if it was stopped.
fn edge_pair(
    outer: &Line,
    inner: &Line,
    unit: f64,
    accuracy: f64,
    stop: Stop<'_>,
) -> Option<Estimate> {
    let log = |s: f64| inner_integral(outer.start + outer.along * s, inner, unit);
    // The kinks and singularities: where an end of the inner edge, or its line, is
    // nearest to the outer one.
    let across = inner.start - outer.start;
    let cosine = outer.along.dot(inner.along);
    let sine_sq = 1.0 - cosine * cosine;
    let start = across.dot(outer.along);
    let mut breaks = [
        start,
        start + inner.length * cosine,
        if sine_sq > 1e-12 {
            (start - cosine * across.dot(inner.along)) / sine_sq
        } else {
            start
        },
    ];
    breaks.sort_by(f64::total_cmp);
    let mut sum = Estimate::default();
    let mut from = 0.0;
    for to in breaks.into_iter().chain([outer.length]) {
        let to = to.clamp(from, outer.length);
        if to > from {
            let share = accuracy * (to - from) / outer.length;
            sum.add(adaptive(&log, from, to, share, stop)?);
        }
        from = to;
    }
    Some(sum)
}

/// A value, and the sum of the magnitudes of what was added up to it: rounding is
/// relative to that.
#[derive(Clone, Copy, Debug)]
struct Term {
    value: f64,
    magnitude: f64,
}

/// `∫ ln (r/unit) du` from a point along an edge.
fn inner_integral(point: DVec3, edge: &Line, unit: f64) -> Term {
    let to_start = (edge.start - point) / unit;
    let height = to_start.cross(edge.along).length();
    let from = to_start.dot(edge.along);
    let antiderivative = |x: f64| {
        let square = x * x + height * height;
        if square == 0.0 {
            return [0.0; 2];
        }
        let [log, angle] = [0.5 * x * square.ln(), height * x.atan2(height)];
        // The places are rounded as well, relative to their distance.
        let places = x.abs() + height;
        [log - x + angle, log.abs() + angle.abs() + places]
    };
    let [end, start] = [from + edge.length / unit, from].map(antiderivative);
    Term {
        value: unit * (end[0] - start[0]),
        magnitude: unit * (end[1] + start[1]),
    }
}

/// Intervals are halved no more often than this: what is left of `x ln x` is then
/// far below rounding.
const MOST_HALVINGS: u32 = 40;

/// No more intervals than this are looked at for two edges: a singularity at either
/// end takes about a hundred.
const MOST_INTERVALS: usize = 4000;

/// `∫ f` from `a` to `b`, and its error; `None` if it was stopped.
///
/// Intervals are halved until their estimated errors are below their share of the
/// accuracy, or what Kronrod and Gauss differ by is rounding, or there are too many.
fn adaptive(
    f: &impl Fn(f64) -> Term,
    a: f64,
    b: f64,
    accuracy: f64,
    stop: Stop<'_>,
) -> Option<Estimate> {
    let mut sum = Estimate::default();
    let mut waiting = vec![(a, b, accuracy, MOST_HALVINGS)];
    let mut looked_at = 0;
    while let Some((a, b, accuracy, halvings)) = waiting.pop() {
        if stop.is_wanted() {
            return None;
        }
        let rule = gauss_kronrod(f, a, b);
        looked_at += 1;
        let rounding = ROUNDING * rule.magnitude;
        let is_good = rule.error <= accuracy || rule.difference <= rounding;
        if is_good || halvings == 0 || looked_at + waiting.len() >= MOST_INTERVALS {
            sum.value += rule.value;
            sum.error += rule.error + rounding;
        } else {
            let middle = 0.5 * (a + b);
            waiting.push((middle, b, 0.5 * accuracy, halvings - 1));
            waiting.push((a, middle, 0.5 * accuracy, halvings - 1));
        }
    }
    Some(sum)
}

/// The rounding of a term relative to its magnitude: of its places, logarithm, angle
/// and sum half a unit in the last place each.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

/// Nodes of the 15-point Kronrod rule, from the end to the middle; every second is
/// one of Gauss's 7.
const NODES: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_41,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];
const GAUSS: [f64; 4] = [
    0.129_484_966_168_869_7,
    0.279_705_391_489_276_64,
    0.381_830_050_505_118_9,
    0.417_959_183_673_469_4,
];

/// An integral by a rule, its error, the difference of the two rules, and the integral
/// of the magnitude.
struct Quadrature {
    value: f64,
    error: f64,
    difference: f64,
    magnitude: f64,
}

/// The integral of `f` from `a` to `b`.
///
/// The error follows from the difference of Kronrod's and Gauss's rules, relative to
/// how much `f` varies, to the power of 3/2: the difference is Gauss's error.
///
/// # Source
///
/// Kronrod 1965; QUADPACK's QK15 (Piessens et al. 1983).
fn gauss_kronrod(f: &impl Fn(f64) -> Term, a: f64, b: f64) -> Quadrature {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let values: [[Term; 2]; 8] = NODES.map(|x| [f(middle - half * x), f(middle + half * x)]);
    let (mut kronrod, mut gauss, mut magnitude) = (0.0, 0.0, 0.0);
    for (k, [left, right]) in values.iter().enumerate() {
        // The node in the middle stands there twice.
        let share = if k == 7 { 0.5 } else { 1.0 };
        kronrod += share * KRONROD[k] * (left.value + right.value);
        magnitude += share * KRONROD[k] * (left.magnitude + right.magnitude);
        if k % 2 == 1 {
            gauss += share * GAUSS[k / 2] * (left.value + right.value);
        }
    }
    let mean = 0.5 * kronrod;
    let variation: f64 = values
        .iter()
        .zip(KRONROD)
        .map(|([left, right], w)| w * ((left.value - mean).abs() + (right.value - mean).abs()))
        .sum();
    let difference = (kronrod - gauss).abs();
    let error = if variation > 0.0 {
        variation * (200.0 * difference / variation).powf(1.5).min(1.0)
    } else {
        difference
    };
    Quadrature {
        value: half * kronrod,
        error: half * error,
        difference: half * difference,
        magnitude: half * magnitude,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn square(z: f64) -> Vec<Vec<DVec3>> {
        vec![vec![
            dvec3(0.0, 0.0, z),
            dvec3(1.0, 0.0, z),
            dvec3(1.0, 1.0, z),
            dvec3(0.0, 1.0, z),
        ]]
    }

    #[test]
    fn kronrod_integrates_degree_twenty_two_and_gauss_thirteen() {
        for degree in [0, 13, 22] {
            let f = |x: f64| Term {
                value: x.powi(degree),
                magnitude: x.powi(degree),
            };
            let exact = 1.0 / f64::from(degree + 1);
            let rule = gauss_kronrod(&f, 0.0, 1.0);
            assert!(
                (rule.value - exact).abs() < 1e-15,
                "x^{degree}: {}",
                rule.value
            );
            assert!(
                degree > 13 || rule.error < 1e-15,
                "x^{degree}: {}",
                rule.error
            );
        }
    }

    /// Two unit squares a unit apart, C-11 of Howell's catalogue.
    #[test]
    fn opposed_squares_have_the_catalogue_factor() {
        let mut upper = square(1.0);
        upper[0].reverse();
        let factor = contour_integral(&square(0.0), &upper, 1e-13, Stop::NEVER).unwrap();
        let off = (factor.value - 0.199_824_895_698_387_38).abs();
        assert!(off < 1e-14 && off <= factor.error, "{factor:?}");
    }

    /// Two unit squares at a right angle with a common edge, C-14 of the catalogue.
    #[test]
    fn squares_with_a_common_edge_have_the_catalogue_factor() {
        let wall = vec![vec![
            dvec3(0.0, 0.0, 0.0),
            dvec3(0.0, 0.0, 1.0),
            dvec3(1.0, 0.0, 1.0),
            dvec3(1.0, 0.0, 0.0),
        ]];
        let exact = (1.0 - 0.199_824_895_698_387_38) / 4.0;
        for [a, b] in [[&square(0.0), &wall], [&wall, &square(0.0)]] {
            let factor = contour_integral(a, b, 1e-13, Stop::NEVER).unwrap();
            let off = (factor.value - exact).abs();
            assert!(off < 1e-13 && off <= factor.error, "{factor:?}");
        }
    }

    /// Far apart, terms cancel to less than their rounding: the integral ends there, and
    /// says so.
    #[test]
    fn an_accuracy_below_rounding_ends_with_an_honest_error() {
        let z = 1e6;
        let mut upper = square(z);
        upper[0].reverse();
        let factor = contour_integral(&square(0.0), &upper, 0.0, Stop::NEVER).unwrap();
        let exact = 1.0 / (std::f64::consts::PI * z * z);
        assert!((factor.value - exact).abs() <= factor.error, "{factor:?}");
        assert!(factor.error < 1e-8, "{factor:?}");
    }

    #[test]
    fn a_stop_is_answered() {
        let stop = Stop::new(&|| true);
        assert!(contour_integral(&square(0.0), &square(1.0), 1e-13, stop).is_none());
    }
}
