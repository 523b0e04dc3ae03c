//! Which curves pay before anything is evaluated.
//!
//! Without a line in the mesh, elements along a kink have to be refined to the size
//! at which it costs no more than the tolerance: the number of such steps along a
//! curve is what a line saves. The line itself costs elements at its ends and where
//! it crosses others.

use antumbra_geom::{Stop, bounding_box, coarse_order};
use antumbra_solver::{KINK_D1, KINK_D2};
use antumbra_visibility::{CriticalCurve, Discontinuity, JUMP_PLACES};
use glam::DVec2;

/// A curve of a receiver as its chord, with the jump in units of irradiance.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    ends: [DVec2; 2],
    /// The jump at [`JUMP_PLACES`], relative to the error allowed.
    jumps: [f64; JUMP_PLACES.len()],
    is_slope: bool,
}

/// Elements along a curve for every step of the size that a kink asks for: on both
/// sides, and those that grade down to them (measured on the box fixtures:
/// `docs/accuracy.md`).
const ELEMENTS_PER_STEP: f64 = 5.0;

/// Elements that a line adds at its two ends, and at every crossing.
const ELEMENTS_PER_LINE: f64 = 3.0;
const ELEMENTS_PER_CROSSING: f64 = 2.0;

/// Curves whose directions differ by less than this (sine) run side by side.
const PARALLEL: f64 = 0.2;

/// Cells along a side of the grid in which neighbours are looked up.
const CELLS: usize = 64;

impl Candidate {
    /// * `ends` — in the chart.
    /// * `allowed` — the error of irradiance allowed.
    /// * `exitance` — of the emitter, the strongest band.
    pub(crate) fn new(
        curve: &CriticalCurve,
        ends: [DVec2; 2],
        exitance: f64,
        allowed: f64,
    ) -> Self {
        Self {
            ends,
            jumps: curve.jumps.map(|j| j * exitance / allowed),
            is_slope: curve.kind().discontinuity() == Discontinuity::D1,
        }
    }

    fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    fn at(&self, t: f64) -> DVec2 {
        self.ends[0] + (self.ends[1] - self.ends[0]) * t
    }

    fn direction(&self) -> DVec2 {
        (self.ends[1] - self.ends[0]).normalize_or_zero()
    }

    /// The inverse of the size to which elements are refined at place k; `beside` is
    /// the distance of a parallel curve of the same strength, which ends the bend.
    fn fineness(&self, k: usize, degree: u8, beside: f64) -> f64 {
        let p = usize::from(degree) - 1;
        let jump = self.jumps[k];
        if self.is_slope {
            jump * KINK_D1[p]
        } else {
            // Two parallel bends close together are one kink.
            (jump * KINK_D2[p]).sqrt().min(jump * beside * KINK_D1[p])
        }
    }
}

/// Segments by the cells of a grid that their boxes meet.
struct Neighbours {
    min: DVec2,
    cell: DVec2,
    cells: Vec<Vec<u32>>,
}

impl Neighbours {
    fn new(candidates: &[Candidate]) -> Self {
        let [min, max] = bounding_box(candidates.iter().flat_map(|c| c.ends));
        Self {
            min,
            cell: ((max - min) / CELLS as f64).max(DVec2::splat(f64::MIN_POSITIVE)),
            cells: vec![Vec::new(); CELLS * CELLS],
        }
    }

    fn range(&self, a: DVec2, b: DVec2) -> impl Iterator<Item = usize> + use<> {
        let index = |x: f64| (x.max(0.0) as usize).min(CELLS - 1);
        let lo = (a.min(b) - self.min) / self.cell;
        let hi = (a.max(b) - self.min) / self.cell;
        let (x0, x1, y0, y1) = (index(lo.x), index(hi.x), index(lo.y), index(hi.y));
        (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| y * CELLS + x))
    }

    fn insert(&mut self, id: u32, candidate: &Candidate) {
        for cell in self.range(candidate.ends[0], candidate.ends[1]) {
            self.cells[cell].push(id);
        }
    }

    /// Ids whose boxes may meet that of two points, ascending.
    fn near(&self, a: DVec2, b: DVec2) -> Vec<u32> {
        let mut ids: Vec<u32> = self
            .range(a, b)
            .flat_map(|cell| self.cells[cell].iter().copied())
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// What the curves of a receiver call for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Choice {
    /// Which of them are worth a line.
    pub(crate) is_line: Vec<bool>,
    /// About how many elements that makes: of the lines, and of refinement along the
    /// others.
    pub(crate) elements: f64,
}

/// Which candidates are worth a line: the strongest first, each only where those
/// before it do not run beside it already. Nothing if it was stopped.
pub(crate) fn worth_a_line(candidates: &[Candidate], degree: u8, stop: Stop<'_>) -> Option<Choice> {
    let mut all = Neighbours::new(candidates);
    for (i, c) in candidates.iter().enumerate() {
        all.insert(i as u32, c);
    }
    // The size at every place, with the nearest parallel of similar strength.
    let fineness: Option<Vec<[f64; JUMP_PLACES.len()]>> = candidates
        .iter()
        .enumerate()
        .map(|(i, c)| {
            if stop.is_wanted() {
                return None;
            }
            Some(std::array::from_fn(|k| {
                let beside = nearest_beside(candidates, &all, i, k, |_, other| {
                    let ratio = other.jumps[3] / c.jumps[k];
                    !other.is_slope && (0.25..=4.0).contains(&ratio)
                });
                c.fineness(k, degree, beside)
            }))
        })
        .collect();
    let fineness = fineness?;
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    // Equally strong ones in the order of their ids, however their strengths are rounded.
    let sums: Vec<f64> = fineness.iter().map(|of| of.iter().sum()).collect();
    let finite = sums.iter().copied().filter(|s| s.is_finite());
    let most = finite.fold(0.0, f64::max);
    let strength = |i: usize| coarse_order(sums[i], most);
    order.sort_by_key(|&i| (std::cmp::Reverse(strength(i)), i));

    let mut choice = Choice {
        is_line: vec![false; candidates.len()],
        elements: 0.0,
    };
    let mut lines = Neighbours::new(candidates);
    for i in order {
        if stop.is_wanted() {
            return None;
        }
        let c = &candidates[i];
        let mut steps = 0.0;
        for (k, share) in PLACE_SHARES.into_iter().enumerate() {
            let beside = nearest_beside(candidates, &lines, i, k, |_, _| true);
            let rest = if c.is_slope {
                0.25 * c.jumps[k] * beside
            } else {
                0.125 * c.jumps[k] * beside * beside
            };
            if rest > 1.0 {
                steps += share * fineness[i][k];
            }
        }
        steps *= c.length();
        let crossings = lines
            .near(c.ends[0], c.ends[1])
            .into_iter()
            .filter(|&j| do_cross(c, &candidates[j as usize]))
            .count();
        let cost = ELEMENTS_PER_LINE + ELEMENTS_PER_CROSSING * crossings as f64;
        if ELEMENTS_PER_STEP * steps > cost {
            choice.is_line[i] = true;
            choice.elements += cost;
            lines.insert(i as u32, c);
        } else {
            choice.elements += steps;
        }
    }
    Some(choice)
}

/// The share of a curve's length that each of [`JUMP_PLACES`] stands for.
const PLACE_SHARES: [f64; JUMP_PLACES.len()] = [0.065, 0.145, 0.19, 0.2, 0.19, 0.145, 0.065];

/// The distance from place k of curve i to the nearest curve that runs beside it.
fn nearest_beside(
    candidates: &[Candidate],
    among: &Neighbours,
    i: usize,
    k: usize,
    counts: impl Fn(usize, &Candidate) -> bool,
) -> f64 {
    let c = &candidates[i];
    let (at, direction) = (c.at(JUMP_PLACES[k]), c.direction());
    let mut nearest = f64::INFINITY;
    // Farther away than a cell, nothing counts as beside.
    let reach = among.cell.max_element();
    for j in among.near(at - reach, at + reach) {
        let j = j as usize;
        let other = &candidates[j];
        if j == i || direction.perp_dot(other.direction()).abs() > PARALLEL || !counts(j, other) {
            continue;
        }
        let (a, along) = (other.ends[0], other.direction());
        let (s, length) = (along.dot(at - a), other.length());
        let apart = along.perp_dot(at - a).abs();
        if s >= -ROUNDING * length && s <= (1.0 + ROUNDING) * length && apart <= reach {
            nearest = nearest.min(apart);
        }
    }
    nearest
}

/// A point this far beyond the end of a curve, relative to its length, is at the end;
/// and curves that end so near to one another do not cross. Smaller, and rounding
/// chooses; larger, and short curves beside long ones count as crossed.
const ROUNDING: f64 = 1e-9;

fn do_cross(c: &Candidate, other: &Candidate) -> bool {
    let separates = |s: &Candidate, [p, q]: [DVec2; 2]| {
        let along = s.ends[1] - s.ends[0];
        let [p, q] = [p, q].map(|p| along.perp_dot(p - s.ends[0]));
        let least = ROUNDING * along.length_squared();
        p.min(q) < -least && p.max(q) > least
    };
    separates(c, other.ends) && separates(other, c.ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    fn candidate(ends: [(f64, f64); 2], jump: f64) -> Candidate {
        Candidate {
            ends: ends.map(|(x, y)| dvec2(x, y)),
            jumps: [jump; JUMP_PLACES.len()],
            is_slope: false,
        }
    }

    #[test]
    fn of_two_strong_curves_side_by_side_one_is_enough_and_weak_ones_wait() {
        let candidates = [
            candidate([(0.0, 0.0), (1.0, 0.0)], 1e6),
            candidate([(0.0, 1e-3), (1.0, 1e-3)], 0.9e6),
            candidate([(0.0, 0.5), (1.0, 0.5)], 1e6),
            candidate([(0.0, 0.8), (1.0, 0.8)], 10.0),
        ];
        assert_eq!(
            worth_a_line(&candidates, 3, Stop::NEVER).map(|c| c.is_line),
            Some(vec![true, false, true, false])
        );
    }
}
