//! Form factors in closed form: the double contour integral, for polygons that see
//! each other in full.

use glam::DVec3;
use std::f64::consts::TAU;

/// `A F` of two polygons that see each other in full: the area of one times the form
/// factor from it to the other. Square units of the corners.
///
/// * `a`, `b` — the loops of either polygon, counter-clockwise seen from its front,
///   holes clockwise. Neither reaches behind the other's plane.
/// * `accuracy` — the error allowed, square units; rounding may add about 1e-16 of
///   the product of the perimeters.
///
/// Swapping the polygons swaps the inner and the outer integral, so the results
/// agree up to the accuracy, not to the bit.
///
/// # Source
///
/// `A F = (1/2π) ∮∮ ln r dx·dy` (Sparrow 1963, S63; Schröder & Hanrahan 1993, SH93 in
/// `docs/references.md`). The inner integral along an edge is elementary; the outer
/// one is taken by adaptive Gauss–Kronrod quadrature, whose intervals shrink towards
/// points where the edges meet.
pub(crate) fn contour_integral(a: &[Vec<DVec3>], b: &[Vec<DVec3>], accuracy: f64) -> f64 {
    // Adding a constant to ln r changes nothing over closed loops; with a typical
    // distance as unit the terms of distant polygons are small.
    let unit = (middle(a) - middle(b)).length().max(size(a) + size(b));
    let n_edges = |loops: &[Vec<DVec3>]| loops.iter().map(Vec::len).sum::<usize>();
    let share = accuracy * TAU / (n_edges(a) * n_edges(b)).max(1) as f64;
    let mut sum = 0.0;
    for outer in edges(a) {
        for inner in edges(b) {
            let cosine = outer.along.dot(inner.along);
            // Smaller is rounding of right angles.
            if cosine.abs() > 1e-16 {
                sum += cosine * edge_pair(&outer, &inner, unit, share);
            }
        }
    }
    sum / TAU
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

fn edges(loops: &[Vec<DVec3>]) -> impl Iterator<Item = Line> {
    loops.iter().flat_map(|corners| {
        let n = corners.len();
        (0..n).filter_map(move |i| {
            let (start, end) = (corners[i], corners[(i + 1) % n]);
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

/// `∫∫ ln (r/unit) ds du` over two edges.
fn edge_pair(outer: &Line, inner: &Line, unit: f64, accuracy: f64) -> f64 {
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
    let mut sum = 0.0;
    let mut from = 0.0;
    for to in breaks.into_iter().chain([outer.length]) {
        let to = to.clamp(from, outer.length);
        if to > from {
            sum += adaptive(
                &log,
                from,
                to,
                accuracy * (to - from) / outer.length,
                MOST_HALVINGS,
            );
        }
        from = to;
    }
    sum
}

/// `∫ ln (r/unit) du` from a point along an edge.
fn inner_integral(point: DVec3, edge: &Line, unit: f64) -> f64 {
    let to_start = (edge.start - point) / unit;
    let height = to_start.cross(edge.along).length();
    let from = to_start.dot(edge.along);
    let antiderivative = |x: f64| {
        let square = x * x + height * height;
        if square == 0.0 {
            return 0.0;
        }
        0.5 * x * square.ln() - x + height * x.atan2(height)
    };
    unit * (antiderivative(from + edge.length / unit) - antiderivative(from))
}

/// Intervals are halved no more often than this: what is left of `x ln x` is then
/// far below rounding.
const MOST_HALVINGS: u32 = 40;

/// `∫ f` from `a` to `b`.
fn adaptive(f: &impl Fn(f64) -> f64, a: f64, b: f64, accuracy: f64, halvings: u32) -> f64 {
    let rule = gauss_kronrod(f, a, b);
    if rule.error <= accuracy.max(ROUNDING * rule.magnitude) || halvings == 0 {
        return rule.value;
    }
    let middle = 0.5 * (a + b);
    adaptive(f, a, middle, 0.5 * accuracy, halvings - 1)
        + adaptive(f, middle, b, 0.5 * accuracy, halvings - 1)
}

/// An error below this share of the integral of the absolute value is rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

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

/// An integral by a rule, its error, and the integral of the absolute value.
struct Quadrature {
    value: f64,
    error: f64,
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
fn gauss_kronrod(f: &impl Fn(f64) -> f64, a: f64, b: f64) -> Quadrature {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let values: [[f64; 2]; 8] = NODES.map(|x| [f(middle - half * x), f(middle + half * x)]);
    let (mut kronrod, mut gauss, mut magnitude) = (0.0, 0.0, 0.0);
    for (k, &[left, right]) in values.iter().enumerate() {
        // The node in the middle stands there twice.
        let share = if k == 7 { 0.5 } else { 1.0 };
        kronrod += share * KRONROD[k] * (left + right);
        magnitude += share * KRONROD[k] * (left.abs() + right.abs());
        if k % 2 == 1 {
            gauss += share * GAUSS[k / 2] * (left + right);
        }
    }
    let mean = 0.5 * kronrod;
    let variation: f64 = values
        .iter()
        .zip(KRONROD)
        .map(|([left, right], w)| w * ((left - mean).abs() + (right - mean).abs()))
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
            let f = |x: f64| x.powi(degree);
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
        let factor = contour_integral(&square(0.0), &upper, 1e-13);
        assert!(
            (factor - 0.199_824_895_698_387_38).abs() < 1e-14,
            "{factor}"
        );
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
        let factor = contour_integral(&square(0.0), &wall, 1e-13);
        let exact = (1.0 - 0.199_824_895_698_387_38) / 4.0;
        assert!((factor - exact).abs() < 1e-13, "{factor}");
        let back = contour_integral(&wall, &square(0.0), 1e-13);
        assert!((back - exact).abs() < 1e-13, "{back}");
    }
}
