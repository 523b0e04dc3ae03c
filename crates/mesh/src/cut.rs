//! Local insertion of curves: only the triangles that need one are cut.

use glam::DVec2;
use smallvec::SmallVec;

use crate::arrange::Order;
use crate::bisect::Refinement;
use crate::trimesh::TriMesh;

/// A straight piece of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Its ends, in the chart.
    pub ends: [DVec2; 2],
    /// The id of its curve.
    pub curve: u32,
    /// The curve's order.
    pub order: Order,
}

/// The triangles before a change that a triangle overlaps, ascending.
pub type Origins = SmallVec<[u32; 2]>;

/// A cut that passes a corner nearer than this fraction of the edge is taken to pass
/// through it: the curve moves by less than its effect can be seen
/// (`docs/numerics.md`).
const SNAP: f64 = 1.0 / 512.0;

/// Pixels of the arrangement: nothing shorter is made by a cut.
const SHORTEST: f64 = 64.0;

/// Where a cut enters or leaves a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Corner(usize),
    Edge(usize, DVec2),
    Inside(DVec2),
}

impl TriMesh {
    /// Puts pieces of curves into the triangles named with them, and into no others.
    ///
    /// Triangles beyond a cut edge are cut in two as well, so that the mesh stays
    /// conforming. Edges along a piece carry its curve; where it passes a corner
    /// closely it is bent to the corner. A piece that ends inside a triangle ends
    /// there in a vertex. Edges without curves around what was cut are flipped until
    /// they are Delaunay.
    ///
    /// Returns for each triangle which triangles before the call it overlaps.
    ///
    /// # Panics
    ///
    /// If an index is no triangle.
    pub fn cut(&mut self, cuts: &[(Cut, Vec<u32>)]) -> Vec<Origins> {
        let n_before = self.triangles.len() as u32;
        let mut refinement = Refinement::new(self);
        for (cut, wanted) in cuts {
            let mut wanted = wanted.clone();
            wanted.sort_unstable();
            wanted.dedup();
            // The triangles named, and what earlier cuts made of them.
            let mut work = wanted.clone();
            let n = refinement.mesh.triangles.len() as u32;
            work.extend((n_before..n).filter(|&t| {
                wanted
                    .binary_search(&refinement.parents[t as usize])
                    .is_ok()
            }));
            while let Some(t) = work.pop() {
                let before = refinement.mesh.triangles.len() as u32;
                if refinement.cut_triangle(t, cut) {
                    work.push(t);
                    let after = refinement.mesh.triangles.len() as u32;
                    work.extend((before..after).filter(|&new| {
                        wanted
                            .binary_search(&refinement.parents[new as usize])
                            .is_ok()
                    }));
                }
            }
        }
        let mut origins: Vec<Origins> = refinement
            .parents
            .iter()
            .map(|&p| Origins::from_slice(&[p]))
            .collect();
        refinement.flip(n_before as usize, &mut origins);
        origins
    }
}

impl Refinement<'_> {
    /// Flips edges of triangles that were cut until all without curves are Delaunay.
    fn flip(&mut self, n_before: usize, origins: &mut [Origins]) {
        let mut work: Vec<u32> = (0..self.mesh.triangles.len() as u32)
            .filter(|&t| t as usize >= n_before || self.was_split(t))
            .collect();
        // Each flip makes the sum of squared edges over areas smaller, up to
        // rounding; the bound is for that.
        let mut left = 64 * work.len();
        while let Some(t) = work.pop() {
            for k in 0..3 {
                if left > 0
                    && let Some(n) = self.mesh.neighbours[t as usize][k]
                    && self.flip_edge(t, k, n)
                {
                    left -= 1;
                    let mut both = origins[t as usize].clone();
                    for &o in &origins[n as usize] {
                        if !both.contains(&o) {
                            both.push(o);
                        }
                    }
                    both.sort_unstable();
                    origins[t as usize].clone_from(&both);
                    origins[n as usize] = both;
                    work.extend([t, n]);
                    break;
                }
            }
        }
    }

    /// Flips the edge between two triangles if it has no curve and is not Delaunay.
    fn flip_edge(&mut self, t: u32, k: usize, n: u32) -> bool {
        let mesh = &mut *self.mesh;
        let [a, b, c] = [0, 1, 2].map(|i| mesh.triangles[t as usize][(k + i) % 3]);
        if mesh.edge_curves(a, b).is_some() {
            return false;
        }
        let side = self.side_towards(n, t);
        let mesh = &mut *self.mesh;
        let d = mesh.triangles[n as usize][(side + 2) % 3];
        let [pa, pb, pc, pd] = [a, b, c, d].map(|v| mesh.vertices[v as usize]);
        // The angles at c and d together are more than two right angles, and the
        // flipped triangles turn the right way by more than rounding.
        let angle = |o: DVec2, p: DVec2, q: DVec2| {
            let (u, v) = (p - o, q - o);
            u.perp_dot(v).atan2(u.dot(v)).abs()
        };
        if angle(pc, pa, pb) + angle(pd, pa, pb) <= std::f64::consts::PI + 1e-9 {
            return false;
        }
        let least = mesh.pixel * pc.distance(pd);
        if (pd - pa).perp_dot(pc - pa) <= least || (pc - pb).perp_dot(pd - pb) <= least {
            return false;
        }
        // From (a b c), (b a d) to (a d c), (d b c).
        let [_, beyond_bc, beyond_ca] = [0, 1, 2].map(|i| mesh.neighbours[t as usize][(k + i) % 3]);
        let [_, beyond_ad, beyond_db] =
            [0, 1, 2].map(|i| mesh.neighbours[n as usize][(side + i) % 3]);
        mesh.triangles[t as usize] = [a, d, c];
        mesh.neighbours[t as usize] = [beyond_ad, Some(n), beyond_ca];
        mesh.triangles[n as usize] = [d, b, c];
        mesh.neighbours[n as usize] = [beyond_db, beyond_bc, Some(t)];
        for (beyond, old, new) in [(beyond_ad, n, t), (beyond_bc, t, n)] {
            if let Some(o) = beyond {
                let back = self.side_towards(o, old);
                self.mesh.neighbours[o as usize][back] = Some(new);
            }
        }
        true
    }

    /// Cuts one triangle along a piece. Returns whether it was split: then its
    /// parts are to be looked at again.
    fn cut_triangle(&mut self, t: u32, cut: &Cut) -> bool {
        let Some([from, to]) = self.chord(t, cut.ends) else {
            return false;
        };
        match (from, to) {
            (Place::Corner(i), Place::Corner(j)) => {
                if i != j {
                    let triangle = self.mesh.triangles[t as usize];
                    self.mesh
                        .tag(triangle[i], triangle[j], cut.curve, cut.order);
                }
                false
            }
            (Place::Edge(k, at), _) | (_, Place::Edge(k, at)) => {
                self.split_edge(t, k, at);
                true
            }
            (Place::Inside(at), _) | (_, Place::Inside(at)) => {
                self.split_inside(t, at);
                true
            }
        }
    }

    /// Where a segment enters and leaves a triangle, if it runs through it.
    ///
    /// Decided by the sides of the segment's line on which the corners lie; a corner
    /// near the line is on it.
    fn chord(&self, t: u32, [p, q]: [DVec2; 2]) -> Option<[Place; 2]> {
        let corners = self.mesh.corners(t);
        let shortest = SHORTEST * self.mesh.pixel();
        let length = p.distance(q);
        let along = (q - p) / length;
        let lengths: [f64; 3] = std::array::from_fn(|k| corners[k].distance(corners[(k + 1) % 3]));
        let near = shortest.max(SNAP * lengths.iter().copied().fold(0.0, f64::max));
        let sides = corners.map(|c| {
            let side = along.perp_dot(c - p);
            if side.abs() <= near { 0.0 } else { side }
        });
        // Places on the line, in the order of its parameter.
        let mut places: SmallVec<[(f64, Place); 4]> = SmallVec::new();
        for k in 0..3 {
            let next = (k + 1) % 3;
            if sides[k] == 0.0 {
                places.push((along.dot(corners[k] - p), Place::Corner(k)));
            } else if sides[k] * sides[next] < 0.0 {
                let u = sides[k] / (sides[k] - sides[next]);
                let at = corners[k] + (corners[next] - corners[k]) * u;
                places.push((along.dot(at - p), Place::Edge(k, at)));
            }
        }
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [first, .., last] = places.as_slice() else {
            return None;
        };
        let (mut from, mut to) = (*first, *last);
        if to.0 <= shortest || from.0 >= length - shortest {
            return None;
        }
        // Ends of the piece inside the triangle.
        if from.0 < -near {
            from = (0.0, Self::end(corners, lengths, p, near));
        }
        if to.0 > length + near {
            to = (length, Self::end(corners, lengths, q, near));
        }
        (to.0 - from.0 > shortest && from.1 != to.1).then_some([from.1, to.1])
    }

    /// The place of an end of a piece: a corner or edge if that is nearer than `near`,
    /// or if the end is outside by rounding.
    fn end(corners: [DVec2; 3], lengths: [f64; 3], at: DVec2, near: f64) -> Place {
        if let Some(k) = (0..3).find(|&k| at.distance(corners[k]) <= near) {
            return Place::Corner(k);
        }
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let along = (b - a) / lengths[k];
            let s = along.dot(at - a);
            if along.perp_dot(at - a) <= near && s > 0.0 && s < lengths[k] {
                return Place::Edge(k, a + along * s);
            }
        }
        let is_inside = (0..3).all(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            (b - a).perp_dot(at - a) > 0.0
        });
        if is_inside {
            return Place::Inside(at);
        }
        let distance = |k: &usize| corners[*k].distance_squared(at);
        Place::Corner(
            (0..3)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArrangementOptions, TaggedCurve, arrange};
    use antumbra_geom::Control;
    use glam::dvec2;

    fn square() -> TriMesh {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)];
        let curves = [TaggedCurve {
            points: corners.map(|(x, y)| dvec2(x, y)).to_vec(),
            order: Order::Boundary,
        }];
        let arrangement =
            arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        TriMesh::new(&arrangement, &curves).expect("a square")
    }

    fn everywhere(mesh: &TriMesh) -> Vec<u32> {
        (0..mesh.triangles.len() as u32).collect()
    }

    fn length_of(mesh: &TriMesh, curve: u32) -> f64 {
        let mut length = 0.0;
        for triangle in &mesh.triangles {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let set = mesh.edge_curves(a, b);
                if a < b && set.is_some_and(|s| mesh.sets().get(s).contains(&curve)) {
                    length += mesh.vertices[a as usize].distance(mesh.vertices[b as usize]);
                }
            }
        }
        length
    }

    #[test]
    fn curves_that_cross_end_inside_or_pass_corners_are_whole() {
        let mut mesh = square();
        let first = everywhere(&mesh);
        mesh.bisect(&first);
        let lines = [
            [dvec2(0.0, 0.3), dvec2(1.0, 0.45)],
            [dvec2(0.2, 0.0), dvec2(0.7, 1.0)],
            [dvec2(0.31, 0.22), dvec2(0.83, 0.77)],
            [dvec2(0.0, 0.0), dvec2(0.9, 0.9)],
            [dvec2(0.500_01, 0.1), dvec2(0.5, 0.9)],
        ];
        for (i, ends) in lines.into_iter().enumerate() {
            let cut = Cut {
                ends,
                curve: 1 + i as u32,
                order: Order::D2,
            };
            let wanted = everywhere(&mesh);
            let parents = mesh.cut(&[(cut, wanted)]);
            assert_eq!(parents.len(), mesh.triangles.len());
            mesh.check().expect("a mesh");
            let length = length_of(&mesh, 1 + i as u32);
            assert!(
                (length - ends[0].distance(ends[1])).abs() < 0.01,
                "{i} {length}"
            );
        }
        assert!((mesh.total_area() - 1.0).abs() < 1e-9);
        let all = everywhere(&mesh);
        mesh.bisect(&all);
        mesh.check().expect("a mesh that can be refined");
    }

    #[test]
    fn only_the_wanted_triangles_are_cut() {
        let mut mesh = square();
        let cut = Cut {
            ends: [dvec2(0.0, 0.25), dvec2(1.0, 0.75)],
            curve: 1,
            order: Order::D1,
        };
        let n = mesh.triangles.len();
        let parents = mesh.cut(&[(cut, vec![0])]);
        mesh.check().expect("a mesh");
        assert!(parents.iter().filter(|p| p.contains(&0)).count() >= 3);
        assert!(parents.iter().all(|p| !p.is_empty()));
        assert!(mesh.triangles.len() > n);
        let length = length_of(&mesh, 1);
        assert!(length > 0.4 && length < 0.8, "{length}");
    }
}
