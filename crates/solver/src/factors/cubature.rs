//! Adaptive cubature on triangles: the worst is bisected until the sum of the
//! estimated errors is small enough.

use crate::basis::quadrature;
use crate::factors::cells::area;
use antumbra_geom::Stop;
use glam::DVec2;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A rule with an error estimate.
pub(crate) struct Rule {
    points: [([f64; 3], f64); N],
    /// Orthonormal under the rule's weights: the polynomials up to degree 1, then
    /// those up to degree 3.
    basis: Vec<[f64; N]>,
}

const N: usize = 16;

/// How many of the basis are of degree 0 and 1.
const N_LINEAR: usize = 3;

impl Rule {
    pub(crate) fn new() -> Self {
        let points = quadrature();
        let mut basis: Vec<[f64; N]> = Vec::new();
        for degree in 0..=3i32 {
            for k in 0..=degree {
                // Gram–Schmidt, twice for the sake of the last bits.
                let mut v: [f64; N] = std::array::from_fn(|i| {
                    points[i].0[0].powi(degree - k) * points[i].0[1].powi(k)
                });
                for _ in 0..2 {
                    for b in &basis {
                        let along = inner(&points, &v, b);
                        v.iter_mut().zip(b).for_each(|(x, y)| *x -= along * y);
                    }
                }
                let norm = inner(&points, &v, &v).sqrt();
                basis.push(v.map(|x| x / norm));
            }
        }
        Self { points, basis }
    }

    /// The mean over a triangle of a function with these values at the rule's points,
    /// and how far off it may be.
    ///
    /// The estimate is four times what no cubic explains, the root of its mean square,
    /// times its ratio to what no plane explains: where a cubic explains much more than a plane
    /// does, the rule (of degree 8) is better still. The square of the ratio was three
    /// times too small in `V5_gunter_irregular`; without the ratio the estimate is a
    /// thousand times the error, and three times the points are needed.
    ///
    /// # Source
    ///
    /// Null rules of decreasing degree and their ratios, Berntsen & Espelid 1991.
    fn mean(&self, values: &[f64; N]) -> Estimate {
        let mut rest = *values;
        let mut beyond_linear = 0.0;
        let value = (0..N).map(|i| self.points[i].1 * values[i]).sum();
        for (k, b) in self.basis.iter().enumerate() {
            if k == N_LINEAR {
                beyond_linear = inner(&self.points, &rest, &rest);
            }
            let along = inner(&self.points, &rest, b);
            rest.iter_mut().zip(b).for_each(|(x, y)| *x -= along * y);
        }
        let beyond_cubic = inner(&self.points, &rest, &rest);
        if beyond_linear <= 0.0 {
            return Estimate { value, error: 0.0 };
        }
        let ratio = (beyond_cubic / beyond_linear).min(1.0).sqrt();
        let error = SAFETY * beyond_cubic.sqrt() * ratio;
        Estimate { value, error }
    }
}

/// Where a kink crosses all triangles alike, errors do not cancel, and without this
/// factor the estimate is a fifth too small; 1 would do in `validation/factors`.
const SAFETY: f64 = 4.0;

fn inner(points: &[([f64; 3], f64); N], a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|i| points[i].1 * a[i] * b[i]).sum()
}

/// An integral with an estimate of its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

impl Estimate {
    fn times(self, area: f64) -> Self {
        Self {
            value: self.value * area,
            error: self.error * area,
        }
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.value += other.value;
        self.error += other.error;
    }
}

/// The integral of a factor, in two ways.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Integral {
    /// Of what is seen; `None` if a part was known to be lit and not evaluated.
    pub(crate) seen: Option<Estimate>,
    /// Of what is hidden.
    pub(crate) hidden: Estimate,
    /// Was every triangle looked at, before the work was stopped?
    pub(crate) is_complete: bool,
    /// Points evaluated.
    pub(crate) evaluations: u64,
}

/// What is integrated.
pub(crate) trait Integrand: Sync {
    /// What is known of a part of the domain.
    type Context: Send + Sync;

    /// Working memory of one thread.
    type Memory: Default;

    /// What is known of a triangle in a larger part of the domain.
    fn narrow(&self, triangle: &[DVec2; 3], context: &Self::Context) -> Self::Context;

    /// Is nothing hidden anywhere in this part?
    fn is_lit(context: &Self::Context) -> bool;

    /// At a point: the factor, and that without occluders.
    fn at(&self, point: DVec2, context: &Self::Context, memory: &mut Self::Memory) -> [f64; 2];
}

/// When to end.
#[derive(Clone, Copy)]
pub(crate) struct Goal<'a> {
    /// The error allowed, of the better of the two integrals.
    pub(crate) error: f64,
    /// No more points than this, but for the first of every triangle.
    pub(crate) most_evaluations: u64,
    /// Asked now and then: end with what there is?
    pub(crate) stop: Stop<'a>,
}

/// Integrates over triangles.
///
/// Both what is seen and what is hidden are integrated from the same evaluations;
/// the one with the smaller error at the start is refined. What is hidden is smooth
/// where surfaces meet, and nothing where nothing stands between; what is seen is
/// nothing in the umbra.
///
/// Sums are taken in the order of creation: the result is a function of the
/// arguments to the bit.
pub(crate) fn integrate<I: Integrand>(
    rule: &Rule,
    start: &[[DVec2; 3]],
    context: &I::Context,
    integrand: &I,
    memory: &mut I::Memory,
    goal: &Goal<'_>,
) -> Integral {
    // What is seen has to be known of all of its parts.
    let look = |triangle: &([DVec2; 3], &I::Context), of: Refined, memory: &mut I::Memory| {
        if goal.stop.is_wanted() {
            return Looked::Stopped;
        }
        let (corners, context) = *triangle;
        let context = integrand.narrow(&corners, context);
        if of == Refined::Hidden && I::is_lit(&context) {
            return Looked::Lit;
        }
        Looked::Part(Part::new(rule, corners, context, integrand, memory))
    };
    let mut look_at_all = |triangles: &[([DVec2; 3], &I::Context)],
                           of|
     -> Vec<Looked<I::Context>> {
        if triangles.len() < MANY {
            triangles.iter().map(|t| look(t, of, memory)).collect()
        } else {
            let triangles = triangles.par_iter();
            let looked = triangles.map_init(I::Memory::default, |memory, t| look(t, of, memory));
            looked.collect()
        }
    };

    // All of the domain, once.
    let mut parts: Vec<Part<I::Context>> = Vec::new();
    let (mut any_lit, mut is_complete) = (false, true);
    let start: Vec<_> = start.iter().map(|&corners| (corners, context)).collect();
    for looked in look_at_all(&start, Refined::Hidden) {
        match looked {
            Looked::Stopped => is_complete = false,
            Looked::Lit => any_lit = true,
            Looked::Part(part) => parts.push(part),
        }
    }
    let [seen, hidden] = sums(&parts);
    let refined = if !any_lit && seen.error <= hidden.error {
        Refined::Seen
    } else {
        Refined::Hidden
    };

    // Then the worst parts, until it is enough.
    let mut worst: BinaryHeap<Ranked> = (0..parts.len())
        .map(|index| Ranked {
            error: parts[index].error(refined),
            index,
        })
        .collect();
    let mut error: f64 = worst.iter().map(|r| r.error).sum();
    while is_complete && error > goal.error && (parts.len() * N) as u64 <= goal.most_evaluations {
        // Many at once where there are many.
        let n_split = (parts.len() / MANY).clamp(1, MANY).min(worst.len());
        let split: Vec<usize> = (0..n_split)
            .filter_map(|_| worst.pop().map(|r| r.index))
            .collect();
        if split.is_empty() {
            break;
        }
        let halves: Vec<_> = split
            .iter()
            .flat_map(|&k| bisected(parts[k].corners).map(|half| (half, &parts[k].context)))
            .collect();
        let looked = look_at_all(&halves, refined);
        if looked.iter().any(|l| matches!(l, Looked::Stopped)) {
            break;
        }
        for &k in &split {
            parts[k].is_split = true;
        }
        for looked in looked {
            let Looked::Part(part) = looked else {
                any_lit = true;
                continue;
            };
            worst.push(Ranked {
                error: part.error(refined),
                index: parts.len(),
            });
            parts.push(part);
        }
        error = worst.iter().map(|r| r.error).sum();
    }
    let [seen, hidden] = sums(&parts);
    Integral {
        seen: (!any_lit).then_some(seen),
        hidden,
        is_complete,
        evaluations: (parts.len() * N) as u64,
    }
}

/// From so many triangles on, threads share the work; and one in so many parts is
/// bisected before errors are compared again.
const MANY: usize = 32;

/// What became of a triangle.
enum Looked<T> {
    Part(Part<T>),
    Lit,
    Stopped,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Refined {
    Seen,
    Hidden,
}

/// A triangle with its integrals of what is seen and of what is hidden.
struct Part<T> {
    corners: [DVec2; 3],
    context: T,
    seen: Estimate,
    hidden: Estimate,
    is_split: bool,
}

impl<T> Part<T> {
    fn new<I>(
        rule: &Rule,
        corners: [DVec2; 3],
        context: T,
        integrand: &I,
        memory: &mut I::Memory,
    ) -> Self
    where
        I: Integrand<Context = T>,
    {
        let [a, b, c] = corners;
        let (mut seen, mut hidden) = ([0.0; N], [0.0; N]);
        for (k, (at, _)) in rule.points.iter().enumerate() {
            let point = a * at[0] + b * at[1] + c * at[2];
            let [factor, whole] = integrand.at(point, &context, memory);
            seen[k] = factor;
            hidden[k] = (whole - factor).max(0.0);
        }
        let area = area(corners);
        let [seen, hidden] = [seen, hidden].map(|values| rule.mean(&values).times(area));
        Self {
            corners,
            context,
            seen,
            hidden,
            is_split: false,
        }
    }

    fn error(&self, of: Refined) -> f64 {
        match of {
            Refined::Seen => self.seen.error,
            Refined::Hidden => self.hidden.error,
        }
    }
}

/// What is seen and what is hidden of all parts that are not split.
fn sums<T>(parts: &[Part<T>]) -> [Estimate; 2] {
    let mut sums = [Estimate::default(); 2];
    for part in parts.iter().filter(|part| !part.is_split) {
        sums[0].add(part.seen);
        sums[1].add(part.hidden);
    }
    sums
}

/// The halves of a triangle, cut through the middle of its longest edge.
fn bisected(corners: [DVec2; 3]) -> [[DVec2; 3]; 2] {
    let length = |k: usize| corners[k].distance_squared(corners[(k + 1) % 3]);
    let mut k = 0;
    for i in 1..3 {
        if length(i) > length(k) {
            k = i;
        }
    }
    let [a, b, c] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
    let middle = (a + b) / 2.0;
    [[a, middle, c], [middle, b, c]]
}

/// A triangle in the queue: the largest error first, then the oldest.
#[derive(PartialEq)]
struct Ranked {
    error: f64,
    index: usize,
}

impl Eq for Ranked {}

impl Ord for Ranked {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error
            .total_cmp(&other.error)
            .then(other.index.cmp(&self.index))
    }
}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    /// A factor that a function of the point hides a part of.
    struct Hidden<F>(F);

    impl<F: Fn(DVec2) -> f64 + Sync> Integrand for Hidden<F> {
        type Context = ();
        type Memory = ();

        fn narrow(&self, _: &[DVec2; 3], (): &()) {}

        fn is_lit((): &()) -> bool {
            false
        }

        fn at(&self, point: DVec2, (): &(), (): &mut ()) -> [f64; 2] {
            [1.0 - (self.0)(point), 1.0]
        }
    }

    const TRIANGLE: [DVec2; 3] = [dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(0.0, 1.0)];

    fn hidden(f: impl Fn(DVec2) -> f64 + Sync, error: f64) -> Integral {
        let goal = Goal {
            error,
            most_evaluations: 1_000_000,
            stop: Stop::NEVER,
        };
        integrate(&Rule::new(), &[TRIANGLE], &(), &Hidden(f), &mut (), &goal)
    }

    #[test]
    fn a_cubic_is_integrated_at_once_and_without_error() {
        let integral = hidden(|p| p.x * p.x * p.y, 1e-12);
        // ∫∫ x² y over the triangle: 2! 1! / 5!.
        assert!((integral.hidden.value - 1.0 / 60.0).abs() < 1e-15);
        assert!(integral.hidden.error < 1e-14);
        assert_eq!(integral.evaluations, N as u64);
    }

    #[test]
    fn a_kink_is_found_and_its_error_is_not_understated() {
        // ∫ (1 − x) |x − a| dx from 0 to 1 is a²/2 − a³/6 + (1 − a)³/6.
        let exact = 0.3f64.powi(2) / 2.0 - 0.3f64.powi(3) / 6.0 + 0.7f64.powi(3) / 6.0;
        for error in [1e-3, 1e-5, 1e-7] {
            let integral = hidden(|p| (p.x - 0.3).abs(), error);
            let off = (integral.hidden.value - exact).abs();
            assert!(off <= integral.hidden.error, "{off:e} for {error:e}");
            assert!(integral.hidden.error <= error);
        }
    }
}
