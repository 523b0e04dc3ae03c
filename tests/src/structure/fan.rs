//! What is hidden around a point of the picture: sectors between lines.

use super::stage::Passing;
use super::{Bound, Hand};
use glam::{DVec2, DVec3, dvec2};

/// The sectors into which lines through a point of the picture divide its
/// surroundings, counter-clockwise: bit i of a set is the sector from ray i to
/// the next.
pub(super) struct Fan<'a> {
    lines: &'a [Passing],
    rays: Vec<Ray>,
    /// For each line the sectors to its left.
    left: Vec<u64>,
    /// Between two rays, in radians.
    pub(super) smallest_angle: f64,
}

#[derive(Clone, Copy, Debug)]
struct Ray {
    angle: f64,
    /// Position in `lines`.
    line: usize,
    /// In the line's direction, or against it?
    is_ahead: bool,
}

impl<'a> Fan<'a> {
    pub(super) fn new(normals: &[DVec3], lines: &'a [Passing]) -> Self {
        assert!(
            lines.len() < 32,
            "{} lines meet in a corner (allowed 31)",
            lines.len()
        );
        let mut rays: Vec<Ray> = Vec::with_capacity(2 * lines.len());
        for (line, passing) in lines.iter().enumerate() {
            // The line a·x + b·y + c = 0 has the direction (b, −a), and its left
            // is where the form is positive.
            let n = normals[passing.line as usize];
            for (is_ahead, d) in [(true, dvec2(n.y, -n.x)), (false, dvec2(-n.y, n.x))] {
                let angle = d.y.atan2(d.x);
                rays.push(Ray {
                    angle,
                    line,
                    is_ahead,
                });
            }
        }
        rays.sort_by(|a, b| a.angle.total_cmp(&b.angle));
        let n_rays = rays.len();
        let mut left = vec![0; lines.len()];
        let mut smallest_angle = f64::INFINITY;
        for (i, ray) in rays.iter().enumerate() {
            let next = rays[(i + 1) % n_rays].angle;
            let turn = (next - ray.angle).rem_euclid(std::f64::consts::TAU);
            smallest_angle = smallest_angle.min(turn);
            let middle = DVec2::from_angle(ray.angle + turn / 2.0);
            for (sectors, passing) in left.iter_mut().zip(lines) {
                let n = normals[passing.line as usize].truncate();
                if n.dot(middle) > 0.0 {
                    *sectors |= 1 << i;
                }
            }
        }
        Self {
            lines,
            rays,
            left,
            smallest_angle,
        }
    }

    pub(super) fn all(&self) -> u64 {
        (1 << self.rays.len()) - 1
    }

    /// The sectors to the left (sign +1) or right of a line, if it is among these.
    pub(super) fn half(&self, line: u32, sign: f64) -> Option<u64> {
        let at = self.lines.iter().position(|p| p.line == line)?;
        let left = self.left[at];
        Some(if sign > 0.0 { left } else { self.all() & !left })
    }

    /// The rays at which visibility changes, and whether it begins there.
    fn changes(&self, visible: u64) -> impl Iterator<Item = (Ray, bool)> + '_ {
        let n = self.rays.len();
        let is_visible = move |i: usize| visible >> (i % n) & 1 == 1;
        (0..n)
            .filter(move |&i| is_visible(i) != is_visible(i + n - 1))
            .map(move |i| (self.rays[i], is_visible(i)))
    }

    /// Is everything visible, or nothing, or one side of a line?
    pub(super) fn is_straight(&self, visible: u64) -> bool {
        let mut changes = self.changes(visible).map(|(ray, _)| ray.line);
        match (changes.next(), changes.next(), changes.next()) {
            (Some(first), Some(second), None) => first == second,
            (first, ..) => first.is_none(),
        }
    }

    /// The rims along which visibility changes.
    pub(super) fn bounds(&self, visible: u64) -> Vec<Bound> {
        let mut bounds: Vec<Bound> = self
            .changes(visible)
            .filter_map(|(ray, begins)| {
                let passing = &self.lines[ray.line];
                let rim = if ray.is_ahead {
                    passing.ahead
                } else {
                    passing.behind
                };
                // Counter-clockwise of a ray ahead is the line's left.
                let visible = if begins == ray.is_ahead {
                    Hand::Left
                } else {
                    Hand::Right
                };
                rim.map(|rim| Bound { rim, visible })
            })
            .collect();
        bounds.sort();
        bounds
    }
}
