//! Where the curves that were left out of an element bend its light most.
//!
//! How irradiance bends across a critical curve is known in closed form, and so is what
//! interpolation makes of a bend: the error of every curve left out can be told at any
//! place without an exact evaluation, but for how errors of several add up. The error is
//! measured where they may add up to most.

use super::{Field, Order, part_inside};
use crate::basis::{lattice, values};
use antumbra_geom::coarse_order;
use glam::DVec2;
use smallvec::SmallVec;

/// Places looked at are the inner ones of a lattice of this many steps: the largest error
/// of one kink lies within a tenth of the element of one of them.
const STEPS: u8 = 12;

/// Places nearer than this, in barycentric coordinates, are one.
const APART: f64 = 0.15;

/// Places where all curves left out can cost no more than this share of the tolerance
/// together are not looked at.
const LEAST: f64 = 0.35;

/// So many places of an element are looked at when it is verified.
pub(super) const VERIFIED: usize = 4;

/// No more curves of an element are looked at, the strongest first.
const MOST_CURVES: usize = 24;

/// A curve left out of an element.
struct Bend {
    /// A point of it, and the unit vector across.
    from: DVec2,
    across: DVec2,
    /// What a unit of its error costs, relative to what is allowed; less for curves that
    /// end inside.
    strength: f64,
    is_slope: bool,
}

impl Bend {
    /// What bends, on one side of the curve.
    fn at(&self, p: DVec2) -> f64 {
        let d = self.across.dot(p - self.from).max(0.0);
        if self.is_slope { d } else { 0.5 * d * d }
    }
}

impl Field {
    /// Up to `n` places inside of an element where the curves left out of it may cost most,
    /// the worst first; fewer if there are no such curves.
    pub(super) fn bent_places(
        &self,
        t: usize,
        n: usize,
        allowed: &[f64],
    ) -> SmallVec<[[f64; 3]; 8]> {
        let mut places: SmallVec<[[f64; 3]; 8]> = SmallVec::new();
        let bends = self.bends(t, allowed);
        if bends.is_empty() || n == 0 {
            return places;
        }
        let mut candidates = self.bent_candidates(t, &bends);
        // Up to rounding, so that images of a mesh are looked at alike.
        let most = candidates.iter().map(|c| c.0).fold(0.0, f64::max);
        candidates.sort_by_key(|c| std::cmp::Reverse(coarse_order(c.0, most.max(LEAST))));
        for (cost, at) in candidates {
            if cost < LEAST {
                break;
            }
            let is_apart = |p: &[f64; 3]| (0..3).any(|k| (p[k] - at[k]).abs() >= APART);
            if places.len() < n && places.iter().all(is_apart) {
                places.push(at);
            }
        }
        places
    }

    fn bends(&self, t: usize, allowed: &[f64]) -> SmallVec<[Bend; 8]> {
        let corners = self.mesh.corners(t as u32);
        let kinks = self.kinks_above(0.0, t, allowed);
        let bend = |&(_, c): &(f64, u32)| {
            let postponed = &self.postponed[c as usize];
            let [a, b] = postponed.ends;
            let along = (b - a).try_normalize()?;
            let (from, to) = part_inside(corners, [a, b])?;
            let reach = 4.0 * self.longest_edge(t);
            let line = [a - along * reach, b + along * reach];
            let (start, end) = part_inside(corners, line)?;
            let whole = (end - start) * line[0].distance(line[1]);
            let share = ((to - from) * a.distance(b) / whole).min(1.0);
            let jumps = postponed.jump.iter().zip(allowed).filter(|j| *j.1 > 0.0);
            let strength = jumps.map(|(j, a)| j / a).fold(0.0, f64::max) * share;
            Some(Bend {
                from: a,
                across: along.perp(),
                strength,
                is_slope: self.orders[postponed.curve as usize] == Order::D1,
            })
        };
        kinks.iter().take(MOST_CURVES).filter_map(bend).collect()
    }

    /// The places of the lattice, with the most that curves left out can cost there.
    fn bent_candidates(&self, t: usize, bends: &[Bend]) -> Vec<(f64, [f64; 3])> {
        let p = f64::from(self.degree);
        let nodes: SmallVec<[DVec2; 16]> = lattice(self.degree)
            .iter()
            .map(|node| self.point(t, node.map(|m| f64::from(m) / p)))
            .collect();
        let at_nodes: Vec<SmallVec<[f64; 16]>> = bends
            .iter()
            .map(|bend| nodes.iter().map(|&n| bend.at(n)).collect())
            .collect();
        let inner = (1..STEPS).flat_map(|i| (1..STEPS - i).map(move |j| [i, j, STEPS - i - j]));
        inner
            .map(|place| {
                let at = place.map(|m| f64::from(m) / f64::from(STEPS));
                let phi = values(self.degree, at);
                let point = self.point(t, at);
                let cost = |(bend, nodes): (&Bend, &SmallVec<[f64; 16]>)| {
                    let interpolated: f64 = nodes.iter().zip(phi).map(|(v, phi)| v * phi).sum();
                    bend.strength * (bend.at(point) - interpolated).abs()
                };
                (bends.iter().zip(&at_nodes).map(cost).sum::<f64>(), at)
            })
            .collect()
    }
}
