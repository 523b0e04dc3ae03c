//! Steps after meshing on one receiver: nodes move, elements split, the degree rises.

use super::confirm::Look;
use super::{Field, Light, MOST_NODES, Snapshot};
use antumbra_geom::Stop;
use antumbra_mesh::shape_quality;
use glam::DVec2;

/// What is measured of a receiver: the largest error and the integral of its square, both
/// relative to the scale of each band; elements at the resolution limit apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Measure {
    pub(crate) max: f64,
    pub(crate) square: f64,
    pub(crate) area: f64,
}

impl Measure {
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            max: self.max.max(other.max),
            square: self.square + other.square,
            area: self.area + other.area,
        }
    }

    pub(crate) fn rms(self) -> f64 {
        if self.area > 0.0 {
            (self.square / self.area).sqrt()
        } else {
            0.0
        }
    }
}

/// A field before a step, to go back to.
pub(crate) struct Before {
    snapshot: Snapshot,
    degree: u8,
}

/// A move makes no triangle smaller than this share of what it was: then nothing inverts,
/// whatever its neighbours do.
const LEAST_AREA: f64 = 0.3;

/// A move makes no triangle's shape worse than this share of the worst around the node.
const LEAST_SHAPE: f64 = 0.6;

/// A move that breaks these rules is halved so often, then left out.
const MOST_HALVINGS: u32 = 3;

/// Where a vertex may go.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Freedom {
    Fixed,
    /// Along this unit direction: it is inside a straight constraint.
    Along(DVec2),
    Free,
}

impl Field {
    /// The error of an element, of the worst band, relative to the scale.
    pub(crate) fn relative_error(&self, t: usize, scale: &[f64]) -> f64 {
        let bands = &self.errors[t * self.n_bands..(t + 1) * self.n_bands];
        let relative = bands.iter().zip(scale).filter(|(_, s)| **s > 0.0);
        relative.map(|(e, s)| e / s).fold(0.0, f64::max)
    }

    pub(crate) fn measure(&self, scale: &[f64], allowed: &[f64]) -> Measure {
        (0..self.mesh.triangles.len())
            .filter(|&t| !self.is_at_resolution(t, allowed))
            .map(|t| {
                let (e, area) = (self.relative_error(t, scale), self.mesh.area(t as u32));
                Measure {
                    max: e,
                    square: e * e * area,
                    area,
                }
            })
            .fold(Measure::default(), Measure::and)
    }

    pub(crate) fn before(&self) -> Before {
        Before {
            snapshot: self.snapshot(),
            degree: self.degree,
        }
    }

    pub(crate) fn go_back(&mut self, before: Before) {
        self.degree = before.degree;
        self.restore(before.snapshot);
    }

    /// Evaluates what a step changed, at all check points. Returns whether it was done.
    pub(crate) fn evaluate_anew(
        &mut self,
        light: &dyn Light,
        allowed: &[f64],
        stop: Stop<'_>,
    ) -> bool {
        self.evaluate(light, stop) && self.verify(light, allowed, stop)
    }

    fn forget_element(&mut self, t: usize) {
        self.element_nodes[t] = [u32::MAX; MOST_NODES];
        self.is_verified[t] = false;
        self.looks[t] = Look::Wanted;
    }

    /// Raises the degree of all elements by one. Returns whether there is a higher one.
    pub(crate) fn elevate(&mut self) -> bool {
        if self.degree >= 4 {
            return false;
        }
        self.degree += 1;
        for t in 0..self.mesh.triangles.len() {
            self.forget_element(t);
        }
        true
    }

    /// Moves vertices towards the mean of the centroids around them, weighted by area
    /// times error: elements that err more become smaller. Vertices on a straight curve or
    /// border slide along it; its ends, crossings and singular places stay. Returns how
    /// many moved.
    ///
    /// * `damping` — the share of the way that is gone.
    ///
    /// # Source
    ///
    /// r-refinement: Cohen & Wallace 1993, section 6.3.4. The weights are normalised by
    /// their own sum, so that a translation of the mesh translates the result.
    pub(crate) fn relocate(&mut self, damping: f64, scale: &[f64], allowed: &[f64]) -> usize {
        let n = self.mesh.triangles.len();
        let errors: Vec<f64> = (0..n).map(|t| self.relative_error(t, scale)).collect();
        let largest = errors.iter().copied().fold(0.0, f64::max);
        if largest <= 0.0 {
            return 0;
        }
        let around = self.triangles_around();
        let mut is_moved = vec![false; self.mesh.vertices.len()];
        for v in 0..self.mesh.vertices.len() {
            let star = &around[v];
            let freedom = self.freedom(v as u32, star, allowed);
            if freedom == Freedom::Fixed || star.is_empty() {
                continue;
            }
            let at = self.mesh.vertices[v];
            let (mut sum, mut weights) = (DVec2::ZERO, 0.0);
            for &t in star {
                let [a, b, c] = self.mesh.corners(t);
                // An element without error still takes part a little: a node between
                // two such would have no place.
                let error = errors[t as usize].max(1e-3 * largest);
                let weight = self.mesh.area(t).max(0.0) * error;
                sum += (a + b + c) / 3.0 * weight;
                weights += weight;
            }
            if weights <= 0.0 {
                continue;
            }
            let mut step = (sum / weights - at) * damping;
            if let Freedom::Along(direction) = freedom {
                step = direction * step.dot(direction);
            }
            if let Some(place) = self.possible(v as u32, star, step, MOST_HALVINGS) {
                self.mesh.vertices[v] = place;
                is_moved[v] = true;
            }
        }
        let n_moved = is_moved.iter().filter(|&&m| m).count();
        if n_moved > 0 {
            self.forget_moved(&is_moved);
        }
        n_moved
    }

    /// Area times squared error of every element.
    pub(crate) fn squares(&self, scale: &[f64]) -> Vec<f64> {
        (0..self.mesh.triangles.len())
            .map(|t| self.relative_error(t, scale).powi(2) * self.mesh.area(t as u32))
            .collect()
    }

    /// Puts vertices back to where they were if the elements around them err more since
    /// they moved. Returns how many.
    ///
    /// * `places`, `squares` — of vertices, and [`Field::squares`], before they moved.
    pub(crate) fn put_back(&mut self, places: &[DVec2], squares: &[f64], scale: &[f64]) -> usize {
        let now = self.squares(scale);
        let around = self.triangles_around();
        let sum = |of: &[f64], star: &[u32]| star.iter().map(|&t| of[t as usize]).sum::<f64>();
        let is_worse: Vec<bool> = (0..places.len())
            .map(|v| {
                self.mesh.vertices[v] != places[v]
                    && sum(&now, &around[v]) > sum(squares, &around[v])
            })
            .collect();
        // A neighbour that stays may have come too near.
        let mut n_back = 0;
        let mut is_back = vec![false; places.len()];
        for v in (0..places.len()).filter(|&v| is_worse[v]) {
            let step = places[v] - self.mesh.vertices[v];
            if self.possible(v as u32, &around[v], step, 0).is_some() {
                self.mesh.vertices[v] = places[v];
                is_back[v] = true;
                n_back += 1;
            }
        }
        if n_back > 0 {
            self.forget_moved(&is_back);
        }
        n_back
    }

    /// The place a step leads to, or a part of it after so many halvings; none if even that
    /// inverts or flattens.
    fn possible(&self, v: u32, star: &[u32], mut step: DVec2, most_halvings: u32) -> Option<DVec2> {
        let at = self.mesh.vertices[v as usize];
        let moved = |t: u32, to: DVec2| {
            self.mesh.triangles[t as usize].map(|c| {
                if c == v {
                    to
                } else {
                    self.mesh.vertices[c as usize]
                }
            })
        };
        let area = |[a, b, c]: [DVec2; 3]| (b - a).perp_dot(c - a) / 2.0;
        let worst = star
            .iter()
            .map(|&t| shape_quality(moved(t, at)))
            .fold(1.0, f64::min);
        for _ in 0..=most_halvings {
            let to = at + step;
            let is_good = star.iter().all(|&t| {
                let corners = moved(t, to);
                area(corners) > 0.0
                    && area(corners) >= LEAST_AREA * area(moved(t, at))
                    && shape_quality(corners) >= LEAST_SHAPE * worst
            });
            if is_good {
                // Steps of rounding size are none.
                return (step.length() > 1e-9 * self.size).then_some(to);
            }
            step /= 2.0;
        }
        None
    }

    /// The triangles around every vertex.
    fn triangles_around(&self) -> Vec<Vec<u32>> {
        let mut around = vec![Vec::new(); self.mesh.vertices.len()];
        for (t, corners) in self.mesh.triangles.iter().enumerate() {
            for &v in corners {
                around[v as usize].push(t as u32);
            }
        }
        around
    }

    fn freedom(&self, v: u32, star: &[u32], allowed: &[f64]) -> Freedom {
        if star.iter().any(|&t| {
            let t = t as usize;
            self.is_singular[t] || self.is_sliver(t) || self.is_at_resolution(t, allowed)
        }) {
            return Freedom::Fixed;
        }
        let mut ends: Vec<u32> = star
            .iter()
            .flat_map(|&t| self.mesh.triangles[t as usize])
            .filter(|&w| w != v && self.mesh.edge_curves(v, w).is_some())
            .collect();
        ends.sort_unstable();
        ends.dedup();
        let at = self.mesh.vertices[v as usize];
        let to = |w: u32| self.mesh.vertices[w as usize] - at;
        match ends[..] {
            [] => Freedom::Free,
            [a, b] => {
                let (p, q) = (to(a), to(b));
                let is_straight = p.perp_dot(q).abs() <= 1e-9 * p.length() * q.length()
                    && p.dot(q) < 0.0
                    && self.mesh.edge_curves(v, a) == self.mesh.edge_curves(v, b);
                match (q - p).try_normalize() {
                    Some(direction) if is_straight => Freedom::Along(direction),
                    _ => Freedom::Fixed,
                }
            }
            _ => Freedom::Fixed,
        }
    }

    /// Forgets what was known of elements with a corner that moved.
    fn forget_moved(&mut self, is_moved: &[bool]) {
        let all: Vec<u32> = (0..self.postponed.len() as u32).collect();
        for t in 0..self.mesh.triangles.len() {
            if self.mesh.triangles[t].iter().any(|&v| is_moved[v as usize]) {
                self.forget_element(t);
                self.crossing[t] = super::crossing(&self.mesh, t, &self.postponed, &all);
            }
        }
    }
}
