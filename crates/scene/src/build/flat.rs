//! The corners of one surface in its chart, where predicates are exact.

use super::near::NearEdges;
use super::weld::WELD_TOLERANCE;
use crate::bvh::Aabb;
use antumbra_geom::{Chart, DVec2, DVec3, cdt, convex_pieces, segments_cross, signed_area};

/// Why a surface has no polygon.
pub(super) enum Refusal {
    /// Of zero area: a warning.
    Empty,
    /// An error: its kind and what to say.
    Bad(&'static str, String),
}

/// The outline and the holes of one surface, cleaned.
pub(super) struct Shape {
    pub(super) outline: Vec<u32>,
    pub(super) holes: Vec<Vec<u32>>,
    /// Strictly convex without holes: nothing else to check.
    pub(super) is_convex: bool,
    pub(super) n_repeated: usize,
    pub(super) n_collinear: usize,
    pub(super) n_opened: usize,
    pub(super) n_empty_holes: usize,
}

/// An edge of a surface in its chart: its loop, and its corners by local number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub(super) in_loop: usize,
    ends: [usize; 2],
}

/// The corners of a surface in its chart.
pub(super) struct Flat {
    chart: Chart,
    /// Sorted vertex ids; local numbers are positions in it.
    ids: Vec<u32>,
    points: Vec<DVec2>,
}

impl Flat {
    pub(super) fn new(chart: &Chart, vertices: &[DVec3], corners: &[u32]) -> Self {
        let mut ids = corners.to_vec();
        ids.sort_unstable();
        ids.dedup();
        let points = ids
            .iter()
            .map(|&v| chart.to_chart(vertices[v as usize]))
            .collect();
        Self {
            chart: *chart,
            ids,
            points,
        }
    }

    pub(super) fn local(&self, corners: &[u32]) -> Vec<usize> {
        corners
            .iter()
            .map(|v| self.ids.binary_search(v).unwrap_or(0))
            .collect()
    }

    pub(super) fn points(&self, corners: &[u32]) -> Vec<DVec2> {
        self.local(corners)
            .into_iter()
            .map(|i| self.points[i])
            .collect()
    }

    pub(super) fn loops(&self, shape: &Shape) -> Vec<Vec<usize>> {
        std::iter::once(&shape.outline)
            .chain(&shape.holes)
            .map(|l| self.local(l))
            .collect()
    }

    pub(super) fn segment(&self, segment: Segment) -> [DVec2; 2] {
        segment.ends.map(|i| self.points[i])
    }

    /// Two edges that cross or overlap, if there are any.
    pub(super) fn first_crossing(&self, shape: &Shape) -> Option<(Segment, Segment)> {
        let mut segments: Vec<Segment> = Vec::new();
        for (in_loop, corners) in self.loops(shape).into_iter().enumerate() {
            for i in 0..corners.len() {
                let ends = [corners[i], corners[(i + 1) % corners.len()]];
                segments.push(Segment { in_loop, ends });
            }
        }
        let span = |s: &Segment, axis: usize| {
            let [a, b] = self.segment(*s).map(|p| p.to_array()[axis]);
            (a.min(b), a.max(b))
        };
        segments.sort_by(|s, t| span(s, 0).0.total_cmp(&span(t, 0).0));
        let in_space = |s: &Segment| self.segment(*s).map(|p| p.extend(0.0));
        let near = NearEdges::new(segments.iter().map(|s| Aabb::of(in_space(s))));
        // More than coordinates of this size round.
        let margin = 1e-14 * self.points.iter().map(|p| p.length()).fold(0.0, f64::max);
        for (i, s) in segments.iter().enumerate() {
            let (end, (low, high)) = (span(s, 0).1, span(s, 1));
            for t in near.of(in_space(s), margin).into_iter().filter(|&j| j > i) {
                let t = &segments[t];
                let (other_low, other_high) = span(t, 1);
                if span(t, 0).0 > end || other_low > high || other_high < low {
                    continue;
                }
                let ([a, b], [c, d]) = (self.segment(*s), self.segment(*t));
                if segments_cross(a, b, c, d) {
                    return Some((*s, *t));
                }
            }
        }
        None
    }

    pub(super) fn pieces(&self, shape: &Shape) -> Result<Vec<Vec<u32>>, Refusal> {
        if shape.is_convex {
            return Ok(vec![shape.outline.clone()]);
        }
        let pieces = convex_pieces(&self.points, &self.loops(shape)).ok_or_else(crosses)?;
        let global: Vec<Vec<u32>> = pieces
            .iter()
            .map(|p| p.iter().map(|&i| self.ids[i]).collect())
            .collect();
        self.check_area(shape, &global)?;
        Ok(global)
    }

    pub(super) fn triangles(&self, shape: &Shape) -> Result<Vec<[u32; 3]>, Refusal> {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for corners in self.loops(shape) {
            for i in 0..corners.len() {
                edges.push([corners[i] as u32, corners[(i + 1) % corners.len()] as u32]);
            }
        }
        let triangles = cdt::triangulate(&self.points, &edges)
            .map_err(|_| crosses())?
            .triangles;
        let mut boundary: Vec<(u32, u32)> =
            edges.iter().map(|&[a, b]| (a.min(b), a.max(b))).collect();
        boundary.sort_unstable();
        let inside =
            cdt::inside_by_parity(&triangles, |a, b| boundary.binary_search(&(a, b)).is_ok());
        let kept: Vec<[u32; 3]> = triangles
            .iter()
            .zip(inside)
            .filter(|(_, inside)| *inside)
            .map(|(triangle, _)| triangle.map(|i| self.ids[i as usize]))
            .collect();
        self.check_area(shape, &kept)?;
        Ok(kept)
    }

    /// The parts make up the whole: a loop that winds differently does not pass.
    pub(super) fn check_area<P: AsRef<[u32]>>(
        &self,
        shape: &Shape,
        parts: &[P],
    ) -> Result<(), Refusal> {
        let area = |corners: &[u32]| signed_area(&self.points(corners));
        let loops = std::iter::once(&shape.outline).chain(&shape.holes);
        let whole: f64 = loops.map(|corners| area(corners)).sum();
        let size = self.points.iter().map(|p| p.length()).fold(0.0, f64::max);
        let sum: f64 = parts.iter().map(|part| area(part.as_ref())).sum();
        // A part in 10⁹, or rounding where the polygon is narrow.
        let allowed = 1e-9 * sum + size * WELD_TOLERANCE;
        if (whole - sum).abs() <= allowed {
            Ok(())
        } else {
            Err(crosses())
        }
    }
}

fn crosses() -> Refusal {
    Refusal::Bad(
        "self-intersecting",
        "the outline or a hole crosses or touches itself (allowed 0 crossings)".to_owned(),
    )
}

/// A point where two edges meet, for the eye.
pub(super) fn crossing_point(s: [DVec2; 2], t: [DVec2; 2], flat: &Flat) -> DVec3 {
    flat.chart.to_space(crossing(s, t))
}

/// Where two segments cross; the middle of the first if they are parallel.
pub(super) fn crossing([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> DVec2 {
    let along = b - a;
    let turn = along.perp_dot(d - c);
    let at = if turn == 0.0 {
        0.5
    } else {
        ((c - a).perp_dot(d - c) / turn).clamp(0.0, 1.0)
    };
    a + at * along
}
