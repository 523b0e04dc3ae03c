//! Triangles between the border of a polygon and the cells inside it.

use crate::arrange::{ArrangementOptions, Order, TaggedCurve, arrange};
use crate::trimesh::{MeshError, ascending, shape_quality};
use antumbra_geom::{Control, cdt, distance_to_segment};
use glam::DVec2;

/// Triangles worse than this are mended by new points: angles of about 25 degrees.
const POOR: f64 = 0.5;

/// Triangles whose circumcircle is larger than this many sizes are divided: edges of
/// about twice the size.
const LARGE: f64 = 1.15;

/// Rounds of mending; every round triangulates anew.
const MOST_ROUNDS: usize = 24;

/// No mending makes edges shorter than this fraction of the size.
const SHORTEST: f64 = 1.0 / 64.0;

/// The border as straight edges that meet only in their ends.
#[derive(Clone, Debug)]
pub(super) struct Border {
    pub(super) points: Vec<DVec2>,
    pub(super) edges: Vec<[u32; 2]>,
    loops: Vec<Vec<DVec2>>,
}

impl Border {
    /// Loops may touch each other; what lies inside is decided by parity.
    pub(super) fn new(loops: &[Vec<DVec2>]) -> Result<Self, MeshError> {
        let curves: Vec<TaggedCurve> = loops
            .iter()
            .map(|points| {
                let closed = points.iter().chain(points.first()).copied();
                TaggedCurve {
                    points: closed.collect(),
                    order: Order::Boundary,
                }
            })
            .collect();
        let arrangement =
            arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        let edges: Vec<[u32; 2]> = arrangement
            .edges
            .iter()
            .filter(|e| e.separates)
            .map(|e| e.ends)
            .collect();
        if edges.is_empty() {
            return Err(MeshError::NoArea { n_edges: 0 });
        }
        Ok(Self {
            points: arrangement.vertices,
            edges,
            loops: loops.to_vec(),
        })
    }

    pub(super) fn ends(&self, edge: usize) -> [DVec2; 2] {
        self.edges[edge].map(|v| self.points[v as usize])
    }

    /// The longest edge: the one with the lowest index of several.
    pub(super) fn longest(&self) -> usize {
        let length = |e: usize| {
            let [a, b] = self.ends(e);
            a.distance_squared(b)
        };
        (1..self.edges.len()).fold(0, |best, e| {
            if length(e) > length(best) * (1.0 + 1e-12) {
                e
            } else {
                best
            }
        })
    }

    /// The ends of the longest edge, so that the inside is on its left.
    pub(super) fn base(&self) -> [DVec2; 2] {
        let [a, b] = self.ends(self.longest());
        let inward = (a + b) / 2.0 + (b - a).perp() * 1e-6;
        if self.contains(inward) {
            [a, b]
        } else {
            [b, a]
        }
    }

    pub(super) fn contains(&self, point: DVec2) -> bool {
        antumbra_geom::point_in_polygon(point, self.loops.iter().map(Vec::as_slice))
    }

    pub(super) fn distance(&self, point: DVec2) -> f64 {
        (0..self.edges.len())
            .map(|e| distance_to_segment(self.ends(e), point))
            .fold(f64::INFINITY, f64::min)
    }

    /// The distance to edges that do not meet edge `e`: how narrow the polygon is there.
    fn width_at(&self, point: DVec2, e: usize) -> f64 {
        let [a, b] = self.edges[e];
        (0..self.edges.len())
            .filter(|&f| !self.edges[f].iter().any(|&v| v == a || v == b))
            .map(|f| distance_to_segment(self.ends(f), point))
            .fold(f64::INFINITY, f64::min)
    }

    /// The edges in parts of the size, shorter where the polygon is narrow, so that what
    /// is between is not filled with slivers.
    pub(super) fn divided(&self, size: f64) -> Region {
        let mut region = Region {
            points: self.points.clone(),
            edges: Vec::new(),
            size,
        };
        for e in 0..self.edges.len() {
            let [p, q] = self.ends(e);
            let n = (p.distance(q) / size - 1e-9).ceil().max(1.0);
            let mut places = vec![0.0];
            for i in 0..n as usize {
                self.divide(e, [i as f64 / n, (i as f64 + 1.0) / n], size, &mut places);
            }
            let [first, last] = self.edges[e];
            let mut from = first;
            for &at in &places[1..] {
                let to = if at == 1.0 {
                    last
                } else {
                    region.points.push(p + (q - p) * at);
                    region.points.len() as u32 - 1
                };
                region.edges.push(RegionEdge {
                    ends: [from, to],
                    is_fixed: false,
                });
                from = to;
            }
        }
        region
    }

    fn divide(&self, e: usize, [from, to]: [f64; 2], size: f64, places: &mut Vec<f64>) {
        let [p, q] = self.ends(e);
        let middle = (from + to) / 2.0;
        let length = (to - from) * p.distance(q);
        let width = self.width_at(p + (q - p) * middle, e);
        if length > 1.5 * width && length > 2.0 * SHORTEST * size {
            self.divide(e, [from, middle], size, places);
            self.divide(e, [middle, to], size, places);
        } else {
            places.push(to);
        }
    }
}

/// An edge that bounds a region.
#[derive(Clone, Copy, Debug)]
pub(super) struct RegionEdge {
    pub(super) ends: [u32; 2],
    /// Must it stay whole, because a cell outside of the region has it?
    pub(super) is_fixed: bool,
}

/// What is to be filled with triangles.
#[derive(Clone, Debug)]
pub(super) struct Region {
    /// Corners of its edges, and points inside.
    pub(super) points: Vec<DVec2>,
    /// Its bounds, by parity.
    pub(super) edges: Vec<RegionEdge>,
    /// The length of edges that is aimed at.
    pub(super) size: f64,
}

impl Region {
    /// The constrained Delaunay triangulation of the region, after poor and large
    /// triangles were mended by new points.
    ///
    /// * `is_free` — may a point be put there?
    ///
    /// # Source
    ///
    /// Points at circumcentres, and edges halved that these would come too near to:
    /// Ruppert 1995, *A Delaunay refinement algorithm for quality 2-dimensional mesh
    /// generation*, with a limit on rounds and lengths, so that it ends at small angles
    /// of the border.
    pub(super) fn filled(
        &mut self,
        is_free: &dyn Fn(DVec2) -> bool,
    ) -> Result<Vec<[u32; 3]>, MeshError> {
        let mut triangles = self.triangulate()?;
        for _ in 0..MOST_ROUNDS {
            if !self.mend(&triangles, is_free) {
                break;
            }
            triangles = self.triangulate()?;
        }
        Ok(triangles)
    }

    fn triangulate(&self) -> Result<Vec<[u32; 3]>, MeshError> {
        let ends: Vec<[u32; 2]> = self.edges.iter().map(|e| e.ends).collect();
        let cdt = cdt::triangulate(&self.points, &ends).map_err(MeshError::Triangulation)?;
        let mut bounds: Vec<[u32; 2]> = ends.iter().map(|&[a, b]| ascending(a, b)).collect();
        bounds.sort_unstable();
        let inside =
            cdt::inside_by_parity(&cdt.triangles, |a, b| bounds.binary_search(&[a, b]).is_ok());
        let kept = cdt.triangles.iter().zip(&inside).filter(|t| *t.1);
        Ok(kept.map(|t| *t.0).collect())
    }

    /// Adds points where triangles are poor. Returns whether there are any new.
    fn mend(&mut self, triangles: &[[u32; 3]], is_free: &dyn Fn(DVec2) -> bool) -> bool {
        let mut poor: Vec<(f64, usize)> = Vec::new();
        for (t, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|v| self.points[v as usize]);
            let quality = shape_quality(corners);
            let large = circumcircle(corners).is_some_and(|c| c.1 > LARGE * self.size);
            if quality < POOR || large {
                poor.push((quality, t));
            }
        }
        poor.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut added: Vec<DVec2> = Vec::new();
        let mut halved: Vec<usize> = Vec::new();
        for &(_, t) in &poor {
            let corners = triangles[t].map(|v| self.points[v as usize]);
            let Some((centre, radius)) = circumcircle(corners) else {
                continue;
            };
            let shortest = (0..3)
                .map(|k| corners[k].distance(corners[(k + 1) % 3]))
                .fold(f64::INFINITY, f64::min)
                .max(SHORTEST * self.size);
            // The edge whose diametral circle the centre is in, and which is nearest.
            let mut nearest: Option<(f64, usize)> = None;
            for (e, edge) in self.edges.iter().enumerate() {
                let [a, b] = edge.ends.map(|v| self.points[v as usize]);
                if (a - centre).dot(b - centre) < 0.0 {
                    let distance = distance_to_segment([a, b], centre);
                    if nearest.is_none_or(|n| distance < n.0) {
                        nearest = Some((distance, e));
                    }
                }
            }
            if let Some((_, e)) = nearest {
                let [a, b] = self.edges[e].ends.map(|v| self.points[v as usize]);
                let is_long = a.distance(b) / 2.0 >= 0.7 * shortest;
                if !self.edges[e].is_fixed && is_long && !halved.contains(&e) {
                    halved.push(e);
                }
            } else if radius >= 0.8 * shortest
                && is_free(centre)
                && added.iter().all(|p| p.distance(centre) >= 0.8 * radius)
            {
                added.push(centre);
            }
        }
        for &e in &halved {
            let edge = self.edges[e];
            let [a, b] = edge.ends;
            let m = self.points.len() as u32;
            self.points
                .push((self.points[a as usize] + self.points[b as usize]) / 2.0);
            self.edges[e].ends = [a, m];
            self.edges.push(RegionEdge {
                ends: [m, b],
                ..edge
            });
        }
        // Beside an edge that was halved a point may be no longer wanted.
        if halved.is_empty() {
            self.points.extend_from_slice(&added);
        }
        !halved.is_empty() || !added.is_empty()
    }
}

/// The centre and radius of the circle through three points; nothing if they are on a line.
fn circumcircle([a, b, c]: [DVec2; 3]) -> Option<(DVec2, f64)> {
    let (u, v) = (b - a, c - a);
    let area = 2.0 * u.perp_dot(v);
    let centre = (v.perp() * -u.length_squared() + u.perp() * v.length_squared()) / area;
    centre.is_finite().then(|| (a + centre, centre.length()))
}
