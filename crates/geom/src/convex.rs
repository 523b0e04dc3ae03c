//! Convex pieces of polygons, without new vertices.

use crate::cdt;
use crate::polygon::orient;
use glam::DVec2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Cuts a polygon with holes into convex pieces without adding a vertex.
///
/// * `points` — chart coordinates.
/// * `loops` — indices into `points`: the outline counter-clockwise, then the
///   holes; loops may touch in vertices but not cross.
///
/// Returns counter-clockwise convex pieces (a convex outline is returned whole),
/// or `None` if the loops cross.
///
/// # Source
///
/// Constrained triangulation, then merging across diagonals that no corner
/// needs (Hertel & Mehlhorn 1983).
#[must_use]
pub fn convex_pieces(points: &[DVec2], loops: &[Vec<usize>]) -> Option<Vec<Vec<usize>>> {
    if let [outline] = loops
        && is_convex(points, outline)
    {
        return Some(vec![outline.clone()]);
    }
    let mut edges: Vec<[u32; 2]> = Vec::new();
    let mut used: Vec<usize> = loops.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let local = |i: usize| used.binary_search(&i).map_or(0, |k| k as u32);
    for corners in loops {
        for i in 0..corners.len() {
            edges.push([local(corners[i]), local(corners[(i + 1) % corners.len()])]);
        }
    }
    let vertices: Vec<DVec2> = used.iter().map(|&i| points[i]).collect();
    let triangles = cdt::triangulate(&vertices, &edges).ok()?.triangles;
    let mut boundary: Vec<(u32, u32)> = edges.iter().map(|&[a, b]| (a.min(b), a.max(b))).collect();
    boundary.sort_unstable();
    let inside = cdt::inside_by_parity(&triangles, |a, b| boundary.binary_search(&(a, b)).is_ok());
    let triangles: Vec<[usize; 3]> = triangles
        .iter()
        .zip(&inside)
        .filter(|(_, inside)| **inside)
        .map(|(t, _)| t.map(|i| used[i as usize]))
        .collect();
    Some(Merging::new(points, &triangles).pieces())
}

fn is_convex(points: &[DVec2], outline: &[usize]) -> bool {
    let n = outline.len();
    let mut turns = 0.0;
    for i in 0..n {
        let [a, b, c] = [0, 1, 2].map(|k| points[outline[(i + k) % n]]);
        if orient(a, b, c) < 0.0 {
            return false;
        }
        turns += (b - a).angle_to(c - b);
    }
    // Turning more than once is a star, not a convex outline.
    turns < 1.5 * std::f64::consts::TAU
}

/// Triangles that become pieces: rings of half-edges.
///
/// Half-edge 3t + k runs from corner k of triangle t to the next. A piece has the number of
/// its first triangle.
struct Merging<'a> {
    points: &'a [DVec2],
    /// Where a half-edge starts.
    origin: Vec<usize>,
    next: Vec<u32>,
    previous: Vec<u32>,
    twin: Vec<Option<u32>>,
    piece: Vec<u32>,
}

impl<'a> Merging<'a> {
    fn new(points: &'a [DVec2], triangles: &[[usize; 3]]) -> Self {
        let n = 3 * triangles.len() as u32;
        let corners: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v as u32)).collect();
        let neighbours = cdt::neighbours(&corners);
        let twin = (0..n).map(|h| {
            let (t, k) = ((h / 3) as usize, (h % 3) as usize);
            let end = corners[t][(k + 1) % 3];
            let other = neighbours[t][k]?;
            let k = (0..3).find(|&k| corners[other as usize][k] == end)?;
            Some(3 * other + k as u32)
        });
        Self {
            points,
            origin: triangles.as_flattened().to_vec(),
            next: (0..n).map(|h| h / 3 * 3 + (h + 1) % 3).collect(),
            previous: (0..n).map(|h| h / 3 * 3 + (h + 2) % 3).collect(),
            twin: twin.collect(),
            piece: (0..n).map(|h| h / 3).collect(),
        }
    }

    /// Joins neighbouring pieces while the union stays convex, each as long as it can be
    /// joined to any, and to the first of those.
    fn pieces(mut self) -> Vec<Vec<usize>> {
        let n = self.origin.len() as u32 / 3;
        let mut pieces = Vec::new();
        for i in 0..n {
            if self.piece[3 * i as usize] != i {
                continue;
            }
            let start = self.grow(i);
            pieces.push(self.ring(start).map(|h| self.origin[h as usize]).collect());
        }
        pieces
    }

    /// The half-edges of a piece, from one of them on.
    fn ring(&self, start: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(start), move |&h| {
            let next = self.next[h as usize];
            (next != start).then_some(next)
        })
    }

    /// Joins to a piece what can be joined to it; where its ring starts.
    ///
    /// Angles grow only, so a neighbour that does not fit never will: each edge is asked
    /// once.
    fn grow(&mut self, i: u32) -> u32 {
        let mut start = 3 * i;
        let mut open: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
        let beyond = |merging: &Self, h: u32| {
            let twin = merging.twin[h as usize]?;
            Some(Reverse((merging.piece[twin as usize], h)))
        };
        open.extend(self.ring(start).filter_map(|h| beyond(self, h)));
        while let Some(Reverse((_, h))) = open.pop() {
            let twin = self.twin[h as usize].filter(|&t| self.piece[t as usize] != i);
            let Some(twin) = twin.filter(|&twin| self.fits(h, twin)) else {
                continue;
            };
            let joined: Vec<u32> = self.ring(self.next[twin as usize]).collect();
            start = self.next[h as usize];
            self.link(self.previous[h as usize], self.next[twin as usize]);
            self.link(self.previous[twin as usize], start);
            for h in joined {
                self.piece[h as usize] = i;
                if h != twin {
                    open.extend(beyond(self, h));
                }
            }
        }
        start
    }

    fn link(&mut self, before: u32, after: u32) {
        self.next[before as usize] = after;
        self.previous[after as usize] = before;
    }

    /// Is the union of two convex pieces along an edge convex, and does it not touch itself?
    fn fits(&self, h: u32, twin: u32) -> bool {
        let origin = |h: u32| self.origin[h as usize];
        let next = |h: u32| self.next[h as usize];
        let corner = |into: u32, out: u32| {
            let (a, b, c) = (origin(into), origin(out), origin(next(out)));
            let [p, q, r] = [a, b, c].map(|v| self.points[v]);
            a != c && orient(p, q, r) >= 0.0
        };
        corner(self.previous[h as usize], next(twin))
            && corner(self.previous[twin as usize], next(h))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{segments_cross, signed_area};
    use glam::dvec2;

    fn total(points: &[DVec2], pieces: &[Vec<usize>]) -> f64 {
        pieces
            .iter()
            .map(|p| signed_area(&p.iter().map(|&i| points[i]).collect::<Vec<_>>()))
            .sum()
    }

    #[test]
    fn l_shape_is_two_convex_pieces() {
        let points = [
            dvec2(0.0, 0.0),
            dvec2(2.0, 0.0),
            dvec2(2.0, 1.0),
            dvec2(1.0, 1.0),
            dvec2(1.0, 2.0),
            dvec2(0.0, 2.0),
        ];
        let pieces = convex_pieces(&points, &[(0..6).collect()]).unwrap();
        assert_eq!(pieces.len(), 2);
        assert!((total(&points, &pieces) - 3.0).abs() < 1e-15);
        assert!(pieces.iter().all(|p| is_convex(&points, p)));
    }

    #[test]
    fn frame_keeps_its_area() {
        let points = [
            dvec2(0.0, 0.0),
            dvec2(3.0, 0.0),
            dvec2(3.0, 3.0),
            dvec2(0.0, 3.0),
            dvec2(1.0, 1.0),
            dvec2(1.0, 2.0),
            dvec2(2.0, 2.0),
            dvec2(2.0, 1.0),
        ];
        let pieces = convex_pieces(&points, &[vec![0, 1, 2, 3], vec![4, 5, 6, 7]]).unwrap();
        assert!((total(&points, &pieces) - 8.0).abs() < 1e-14);
        assert!(pieces.iter().all(|p| is_convex(&points, p)));
    }

    #[test]
    fn bow_tie_has_no_pieces() {
        let points = [
            dvec2(0.0, 0.0),
            dvec2(1.0, 1.0),
            dvec2(1.0, 0.0),
            dvec2(0.0, 1.0),
        ];
        assert!(convex_pieces(&points, &[vec![0, 1, 2, 3]]).is_none());
        assert!(segments_cross(points[0], points[1], points[2], points[3]));
    }

    #[test]
    fn disc_of_many_corners_in_a_frame_has_few_pieces() {
        let n = 4000;
        let disc = (0..n).map(|i| {
            let angle = -std::f64::consts::TAU * f64::from(i) / f64::from(n);
            DVec2::from_angle(angle)
        });
        let mut points: Vec<DVec2> = disc.collect();
        let corners = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)];
        points.extend(corners.map(|(x, y)| dvec2(x, y)));
        let n = n as usize;
        let hole: Vec<usize> = (0..n).collect();
        let outside = convex_pieces(&points, &[(n..n + 4).collect(), hole.clone()]).unwrap();
        assert!(outside.iter().all(|p| is_convex(&points, p)));
        let filled: f64 = total(&points, &[hole.into_iter().rev().collect()]);
        assert!((total(&points, &outside) + filled - 16.0).abs() < 1e-12);
        // Every corner of the hole stands in: no piece has two of its edges.
        assert!(outside.len() <= n + 4, "{}", outside.len());
    }
}
