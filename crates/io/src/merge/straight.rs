//! Straight chains of corners become edges.
//!
//! A corner goes only where all polygons that have it run through it between the
//! same two neighbours, and then from all of them: polygons that shared a chain
//! share the edge. T-vertices need no corner here.

use super::Patch;
use super::patch::edges_of;
use super::weld::Welded;
use antumbra_geom::DVec3;
use std::collections::BTreeMap;

/// So many corners go in a row, so that time stays linear.
const LONGEST_RUN: usize = 1024;

/// Drops corners that lie on the edge between those that stay, to the tolerance.
/// Loops may end with fewer than three corners: holes of that kind are dropped,
/// and outlines are left to the caller.
pub(super) fn straighten(patches: &mut [Patch], welded: &Welded) {
    // The first two neighbours of a vertex, and whether there are more.
    let mut neighbours: BTreeMap<u32, Neighbours> = BTreeMap::new();
    for [a, b] in patches
        .iter()
        .flat_map(|patch| &patch.loops)
        .flat_map(|corners| edges_of(corners))
    {
        neighbours.entry(a).or_default().add(b);
        neighbours.entry(b).or_default().add(a);
    }
    let mut chains = Chains {
        neighbours,
        welded,
        is_dropped: vec![false; welded.vertices.len()],
        is_seen: vec![false; welded.vertices.len()],
    };
    chains.straighten();
    for patch in patches {
        for corners in &mut patch.loops {
            corners.retain(|&v| !chains.is_dropped[v as usize]);
        }
        let mut is_outline = true;
        patch
            .loops
            .retain(|corners| std::mem::take(&mut is_outline) || corners.len() > 2);
    }
}

#[derive(Default)]
struct Neighbours {
    two: [Option<u32>; 2],
    has_more: bool,
}

impl Neighbours {
    fn add(&mut self, v: u32) {
        if self.two.contains(&Some(v)) {
            return;
        }
        match self.two.iter_mut().find(|place| place.is_none()) {
            Some(place) => *place = Some(v),
            None => self.has_more = true,
        }
    }

    /// The two neighbours of a vertex that may go.
    fn both(&self) -> Option<[u32; 2]> {
        match self.two {
            [Some(a), Some(b)] if !self.has_more => Some([a, b]),
            _ => None,
        }
    }
}

struct Chains<'a> {
    neighbours: BTreeMap<u32, Neighbours>,
    welded: &'a Welded,
    is_dropped: Vec<bool>,
    is_seen: Vec<bool>,
}

impl Chains<'_> {
    fn straighten(&mut self) {
        let candidates: Vec<(u32, [u32; 2])> = self
            .neighbours
            .iter()
            .filter_map(|(&v, neighbours)| Some((v, neighbours.both()?)))
            .collect();
        for (v, [a, b]) in candidates {
            if self.is_seen[v as usize] {
                continue;
            }
            let mut chain = self.walk(v, a);
            if chain.last() == Some(&v) {
                // Around: from the sharpest corner, which stays.
                chain.pop();
                let n = chain.len();
                let sharpest = (0..n)
                    .max_by(|&i, &j| {
                        let off = |i: usize| {
                            let [a, b, c] = [n - 1, 0, 1].map(|k| self.at(chain[(i + k) % n]));
                            off_segment(b, a, c)
                        };
                        off(i).total_cmp(&off(j)).then(chain[j].cmp(&chain[i]))
                    })
                    .unwrap_or(0);
                chain.rotate_left(sharpest);
                chain.push(chain[0]);
            } else {
                chain.reverse();
                chain.pop();
                chain.extend(self.walk(v, b));
                if chain.last() < chain.first() {
                    chain.reverse();
                }
            }
            self.drop_inner(&chain);
        }
    }

    /// From `v` by way of `next` up to a vertex that stays, or around to `v`.
    fn walk(&mut self, v: u32, next: u32) -> Vec<u32> {
        let mut chain = vec![v];
        let (mut before, mut at) = (v, next);
        self.is_seen[v as usize] = true;
        loop {
            chain.push(at);
            let both = self.neighbours.get(&at).and_then(Neighbours::both);
            let Some([a, b]) = both.filter(|_| at != v) else {
                return chain;
            };
            self.is_seen[at as usize] = true;
            (before, at) = (at, if a == before { b } else { a });
        }
    }

    /// Keeps the ends and as few corners between as the tolerance allows.
    fn drop_inner(&mut self, chain: &[u32]) {
        let mut from = 0;
        while from + 2 < chain.len() {
            let mut to = from + 1;
            while to + 1 < chain.len()
                && to - from < LONGEST_RUN
                && self.is_straight(&chain[from..=to + 1])
            {
                to += 1;
            }
            for &v in &chain[from + 1..to] {
                self.is_dropped[v as usize] = true;
            }
            from = to;
        }
    }

    fn is_straight(&self, run: &[u32]) -> bool {
        let [first, last] = [run[0], run[run.len() - 1]];
        first != last
            && run[1..run.len() - 1].iter().all(|&v| {
                let off = off_segment(self.at(v), self.at(first), self.at(last));
                off <= self.welded.tolerances[v as usize]
            })
    }

    fn at(&self, v: u32) -> DVec3 {
        self.welded.vertices[v as usize]
    }
}

/// The distance of a point from a segment.
fn off_segment(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let x = (point - a).dot(along) / along.length_squared();
    point.distance(a + x.clamp(0.0, 1.0) * along)
}
