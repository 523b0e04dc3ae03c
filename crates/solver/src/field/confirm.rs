//! A last look at a finished mesh: its error at places that no element was made for.
//!
//! The check points of an element are few and fixed, so that a bend between them is missed
//! by about one element of a thousand. When all elements are within the tolerance, some
//! evaluations more are spread over the scene: more of them where an element is large and
//! its error near the tolerance; near its corners, where curves end, on curves that were left
//! out, and anywhere else.

use super::bends::VERIFIED;
use super::{Field, Light, SHORTEST};
use antumbra_geom::{Stop, distance_to_segment, exceeds};
use smallvec::SmallVec;

/// What the last look may take, relative to all evaluations so far.
pub(crate) const SHARE: f64 = 0.06;

/// Elements whose error was measured at these places too are refined above this share of
/// the tolerance: more is known of them than of others.
pub(super) const SAFETY: f64 = 0.8;

/// Elements with small errors are looked at as if they had this share of the tolerance.
const LEAST_ERROR: f64 = 0.1;

/// No element is looked at in more places.
const MOST: usize = 12;

/// How far from a corner its places are, in barycentric coordinates: between the corner and
/// the nodes next to it.
const CORNER: [f64; 2] = [0.08, 0.22];

/// Whether an element has had its last look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Look {
    #[default]
    Wanted,
    /// It was too small, or its error too far from the tolerance, for a place of its own.
    PassedOver,
    Done,
}

/// The n-th of a sequence of points that fill the unit square evenly.
///
/// # Source
///
/// The plastic number's sequence (Roberts 2018).
fn evenly(n: u64) -> [f64; 2] {
    let n = (n % (1 << 30)) as f64;
    [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|a| (0.5 + n * a).fract())
}

impl Field {
    /// How much an element asks for a last look: its size, times its error relative to the
    /// tolerance.
    fn look_weight(&self, t: usize, allowed: &[f64]) -> f64 {
        if self.looks[t] != Look::Wanted || self.is_given_up(t, allowed) {
            return 0.0;
        }
        let mut error = LEAST_ERROR;
        for (band, &a) in allowed.iter().enumerate().filter(|(_, a)| **a > 0.0) {
            error = f64::max(error, self.errors[t * self.n_bands + band] / a);
        }
        self.mesh.area(t as u32).max(0.0).sqrt() * error
    }

    /// The sum over all elements that have had no last look.
    pub(crate) fn look_weights(&self, allowed: &[f64]) -> f64 {
        if self.is_dark || !self.knows_all_curves {
            return 0.0;
        }
        (0..self.mesh.triangles.len())
            .map(|t| self.look_weight(t, allowed))
            .sum()
    }

    /// Measures the error of elements at `density` places per weight. Returns whether it
    /// was done: if it was stopped, nothing has changed.
    pub(crate) fn confirm(
        &mut self,
        light: &dyn Light,
        allowed: &[f64],
        density: f64,
        stop: Stop<'_>,
    ) -> bool {
        if self.is_dark || !self.knows_all_curves {
            return true;
        }
        let mut looks = self.looks.clone();
        let mut places = Vec::new();
        for (t, look) in looks
            .iter_mut()
            .enumerate()
            .filter(|l| *l.1 == Look::Wanted)
        {
            // Each on its own, so that rounding in one does not move those of others.
            let [dither, _] = evenly(t as u64);
            let wanted = density * self.look_weight(t, allowed) + dither;
            let wanted = (wanted as usize).min(MOST);
            *look = match wanted {
                0 => Look::PassedOver,
                _ => Look::Done,
            };
            let chosen = self.look_places(t, wanted, allowed);
            places.extend(chosen.into_iter().map(|at| (t, at)));
        }
        if !self.measure_at(&places, light, stop) {
            return false;
        }
        self.looks = looks;
        true
    }

    /// The corners of an element, those first at which most curves meet, in the mesh or
    /// left out: there irradiance bends within less than an element.
    fn busiest_corners(&self, t: usize) -> [usize; 3] {
        let triangle = self.mesh.triangles[t];
        let corners = self.mesh.corners(t as u32);
        let near = CORNER[1] * self.longest_edge(t);
        let is_line = |k: usize| self.mesh.edge_curves(triangle[k], triangle[(k + 1) % 3]);
        let count = |k: usize| {
            let lines = [k, (k + 2) % 3]
                .into_iter()
                .filter(|&e| is_line(e).is_some());
            let passes = self.crossing[t].iter().filter(|&&c| {
                exceeds(
                    near,
                    distance_to_segment(self.postponed[c as usize].ends, corners[k]),
                )
            });
            lines.count() + passes.count()
        };
        let counts: [usize; 3] = std::array::from_fn(count);
        let mut order = [t % 3, (t + 1) % 3, (t + 2) % 3];
        order.sort_by_key(|&k| std::cmp::Reverse(counts[k]));
        order
    }

    /// Places of an element, by turns near its corners, where curves that were left out cost
    /// most, and anywhere.
    fn look_places(&self, t: usize, n: usize, allowed: &[f64]) -> SmallVec<[[f64; 3]; MOST]> {
        let bent = self.bent_places(t, VERIFIED + n, allowed);
        let mut bent = bent.into_iter().skip(VERIFIED);
        let corners = self.busiest_corners(t);
        let mut places: SmallVec<[[f64; 3]; MOST]> = SmallVec::new();
        for i in 0..n {
            let even = evenly((t * MOST + i) as u64);
            places.push(match i % 4 {
                3 => bent.next().unwrap_or_else(|| anywhere(even)),
                k => near_corner(corners[k], even),
            });
        }
        // Nodes are exact, and next to edges there may be contacts.
        places.retain(|at| at.iter().all(|&x| x > 1e-3));
        let is_small = self.longest_edge(t) <= 16.0 * SHORTEST * self.size;
        if is_small { SmallVec::new() } else { places }
    }
}

/// A place near a corner of a triangle from one in the unit square.
fn near_corner(corner: usize, [u, v]: [f64; 2]) -> [f64; 3] {
    let off = CORNER[0] + (CORNER[1] - CORNER[0]) * u;
    let mut at = [0.0; 3];
    at[corner] = 1.0 - off;
    at[(corner + 1) % 3] = off * v;
    at[(corner + 2) % 3] = off * (1.0 - v);
    at
}

/// A place in a triangle from one in the unit square.
fn anywhere([u, v]: [f64; 2]) -> [f64; 3] {
    let [u, v] = if u + v > 1.0 {
        [1.0 - u, 1.0 - v]
    } else {
        [u, v]
    };
    [1.0 - u - v, u, v]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fill_a_triangle_evenly() {
        let n = 4096;
        let near_corner = (0..n)
            .map(|i| anywhere(evenly(i)))
            .inspect(|at| assert!(at.iter().all(|x| (0.0..=1.0).contains(x))))
            .filter(|at| at[1] > 0.5)
            .count();
        // A quarter of the area.
        assert!(near_corner.abs_diff(1024) < 40, "{near_corner}");
    }
}
