//! The door to `spade`: constrained Delaunay triangulation of crossing-free input.
//!
//! Only `try_bulk_load_cdt` is used. `add_constraint_and_split` constructs
//! crossings in floating point and panics, hangs or drops constraints on most
//! inputs with aligned segments (see `docs/numerics.md`); crossings are
//! resolved before this door.

use glam::DVec2;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

/// Why a triangulation could not be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CdtError {
    /// A coordinate is not finite, or too large or small for exact predicates.
    Coordinate,
    /// Two vertices have the same position.
    DuplicateVertex,
    /// This many constraint edges cross others (or have no length).
    Conflict(usize),
}

/// A constrained Delaunay triangulation of the convex hull of its vertices.
#[derive(Clone, Debug, Default)]
pub struct Cdt {
    /// Counter-clockwise triangles, indices into the input vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// Triangulates `vertices` so that every one of `edges` is an edge, or a chain
/// of edges where it passes through vertices exactly.
///
/// The input must be crossing-free: two edges may only meet in vertices.
///
/// # Errors
///
/// [`CdtError`], if the input is not what is asked for. Nothing panics.
pub fn triangulate(vertices: &[DVec2], edges: &[[u32; 2]]) -> Result<Cdt, CdtError> {
    let points: Vec<Point2<f64>> = vertices
        .iter()
        .map(|p| spade::mitigate_underflow(Point2::new(p.x, p.y)))
        .collect();
    let constraints = edges
        .iter()
        .map(|&[a, b]| [a as usize, b as usize])
        .collect();
    let mut n_conflicts = 0;
    let cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(
        points,
        constraints,
        |_| n_conflicts += 1,
    )
    .map_err(|_| CdtError::Coordinate)?;
    if cdt.num_vertices() != vertices.len() {
        return Err(CdtError::DuplicateVertex);
    }
    if n_conflicts > 0 {
        return Err(CdtError::Conflict(n_conflicts));
    }
    let triangles = cdt
        .inner_faces()
        .map(|face| face.vertices().map(|v| v.fix().index() as u32))
        .collect();
    Ok(Cdt { triangles })
}

/// Which triangles lie inside the region that `is_boundary` edges bound.
///
/// A triangle is inside if it is reached from outside the convex hull by an odd
/// number of boundary edges. `is_boundary` is asked with the smaller index first.
#[must_use]
pub fn inside_by_parity(
    triangles: &[[u32; 3]],
    is_boundary: impl Fn(u32, u32) -> bool,
) -> Vec<bool> {
    let neighbours = neighbours(triangles);
    let mut inside = vec![None; triangles.len()];
    let mut stack = Vec::new();
    // Start at the hull: a hull edge that is a boundary leads inside.
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            if neighbours[t][k].is_none() && inside[t].is_none() {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                inside[t] = Some(is_boundary(a.min(b), a.max(b)));
                stack.push(t);
            }
        }
    }
    while let Some(t) = stack.pop() {
        let here = inside[t] == Some(true);
        for k in 0..3 {
            if let Some(other) = neighbours[t][k] {
                let other = other as usize;
                if inside[other].is_none() {
                    let (a, b) = (triangles[t][k], triangles[t][(k + 1) % 3]);
                    inside[other] = Some(here ^ is_boundary(a.min(b), a.max(b)));
                    stack.push(other);
                }
            }
        }
    }
    inside.into_iter().map(|i| i == Some(true)).collect()
}

/// For each triangle and each of its edges (k to k + 1) the triangle beyond it.
#[must_use]
pub fn neighbours(triangles: &[[u32; 3]]) -> Vec<[Option<u32>; 3]> {
    let mut edges: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(triangles.len() * 3);
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), t as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut result = vec![[None; 3]; triangles.len()];
    for pair in edges.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if (a.0, a.1) == (b.0, b.1) {
            result[a.2 as usize][a.3 as usize] = Some(b.2);
            result[b.2 as usize][b.3 as usize] = Some(a.2);
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    #[test]
    fn square_with_a_square_hole_is_told_from_its_hole() {
        let vertices = [
            dvec2(0.0, 0.0),
            dvec2(3.0, 0.0),
            dvec2(3.0, 3.0),
            dvec2(0.0, 3.0),
            dvec2(1.0, 1.0),
            dvec2(2.0, 1.0),
            dvec2(2.0, 2.0),
            dvec2(1.0, 2.0),
        ];
        let edges = [
            [0, 1],
            [1, 2],
            [2, 3],
            [3, 0],
            [4, 5],
            [5, 6],
            [6, 7],
            [7, 4],
        ];
        let cdt = triangulate(&vertices, &edges).unwrap();
        let inside = inside_by_parity(&cdt.triangles, |a, b| {
            edges
                .iter()
                .any(|e| (e[0].min(e[1]), e[0].max(e[1])) == (a, b))
        });
        let area: f64 = cdt
            .triangles
            .iter()
            .zip(&inside)
            .filter(|(_, inside)| **inside)
            .map(|(t, _)| {
                let [a, b, c] = t.map(|i| vertices[i as usize]);
                (b - a).perp_dot(c - a) / 2.0
            })
            .sum();
        assert!((area - 8.0).abs() < 1e-14);
    }

    #[test]
    fn crossing_edges_are_an_error_and_not_a_panic() {
        let vertices = [
            dvec2(0.0, 0.0),
            dvec2(1.0, 1.0),
            dvec2(1.0, 0.0),
            dvec2(0.0, 1.0),
        ];
        assert_eq!(
            triangulate(&vertices, &[[0, 1], [2, 3]]).unwrap_err(),
            CdtError::Conflict(1)
        );
        let nan = [dvec2(f64::NAN, 0.0), dvec2(1.0, 1.0), dvec2(1.0, 0.0)];
        assert_eq!(triangulate(&nan, &[]).unwrap_err(), CdtError::Coordinate);
    }
}
