//! Plane polygons, in space and in their chart.

use crate::cdt;
use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

/// Twice the vector area of a closed outline, by Newell's formula.
///
/// Points along the normal on whose side the outline runs counter-clockwise;
/// its length is twice the enclosed area. Relative to the first corner, so that
/// far offsets cost no digits.
#[must_use]
pub fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let Some(&origin) = corners.first() else {
        return DVec3::ZERO;
    };
    let n = corners.len();
    (0..n)
        .map(|i| (corners[i] - origin).cross(corners[(i + 1) % n] - origin))
        .sum()
}

/// The area enclosed by a plane outline in space.
#[must_use]
pub fn polygon_area(corners: &[DVec3]) -> f64 {
    newell_normal(corners).length() / 2.0
}

/// The signed area of an outline in its chart: positive if counter-clockwise.
#[must_use]
pub fn signed_area(corners: &[DVec2]) -> f64 {
    let Some(&origin) = corners.first() else {
        return 0.0;
    };
    let n = corners.len();
    (0..n)
        .map(|i| (corners[i] - origin).perp_dot(corners[(i + 1) % n] - origin))
        .sum::<f64>()
        / 2.0
}

/// Is `point` inside the region bounded by `loops` (even-odd)?
///
/// Exact for the coordinates given, except that points on the border may fall
/// on either side.
#[must_use]
pub fn point_in_polygon<'a>(point: DVec2, loops: impl IntoIterator<Item = &'a [DVec2]>) -> bool {
    let mut inside = false;
    for corners in loops {
        let n = corners.len();
        for i in 0..n {
            let (a, b) = (corners[i], corners[(i + 1) % n]);
            if (a.y > point.y) != (b.y > point.y) {
                let turn = orient(a, b, point);
                if (turn > 0.0) == (b.y > a.y) {
                    inside = !inside;
                }
            }
        }
    }
    inside
}

/// Do the open segments `ab` and `cd` cross, or overlap along a length? Exact.
///
/// Segments that only touch in an end point do not cross.
#[must_use]
pub fn segments_cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let (abc, abd) = (orient(a, b, c), orient(a, b, d));
    let (cda, cdb) = (orient(c, d, a), orient(c, d, b));
    if abc == 0.0 && abd == 0.0 {
        // Collinear: compare along the longer axis.
        let along = |p: DVec2| {
            if (b - a).x.abs() >= (b - a).y.abs() {
                p.x
            } else {
                p.y
            }
        };
        let (a, b) = (along(a).min(along(b)), along(a).max(along(b)));
        let (c, d) = (along(c).min(along(d)), along(c).max(along(d)));
        return a.max(c) < b.min(d);
    }
    (abc > 0.0) != (abd > 0.0)
        && (cda > 0.0) != (cdb > 0.0)
        && abc != 0.0
        && abd != 0.0
        && cda != 0.0
        && cdb != 0.0
}

fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    orient2d(
        Coord { x: a.x, y: a.y },
        Coord { x: b.x, y: b.y },
        Coord { x: c.x, y: c.y },
    )
}

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
    let mut pieces: Vec<Vec<usize>> = triangles
        .iter()
        .zip(&inside)
        .filter(|(_, inside)| **inside)
        .map(|(t, _)| t.iter().map(|&i| used[i as usize]).collect())
        .collect();
    merge_convex(points, &mut pieces);
    Some(pieces)
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

/// Joins neighbouring pieces while the union stays convex.
fn merge_convex(points: &[DVec2], pieces: &mut Vec<Vec<usize>>) {
    let mut i = 0;
    while i < pieces.len() {
        let mut merged = None;
        'search: for j in 0..pieces.len() {
            if j == i {
                continue;
            }
            if let Some(union) = joined(&pieces[i], &pieces[j])
                && is_convex(points, &union)
            {
                merged = Some((j, union));
                break 'search;
            }
        }
        if let Some((j, union)) = merged {
            pieces[i] = union;
            pieces.remove(j);
            if j < i {
                i -= 1;
            }
        } else {
            i += 1;
        }
    }
}

/// The union of two outlines along a common edge.
fn joined(a: &[usize], b: &[usize]) -> Option<Vec<usize>> {
    for i in 0..a.len() {
        let (p, q) = (a[i], a[(i + 1) % a.len()]);
        if let Some(j) = (0..b.len()).find(|&j| b[j] == q && b[(j + 1) % b.len()] == p) {
            // a: … p | q …, and b runs from p onwards back to q.
            let mut union: Vec<usize> = (0..a.len()).map(|k| a[(i + 1 + k) % a.len()]).collect();
            union.extend((2..b.len()).map(|k| b[(j + k) % b.len()]));
            let mut distinct = union.clone();
            distinct.sort_unstable();
            distinct.dedup();
            return (distinct.len() == union.len()).then_some(union);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{dvec2, dvec3};

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
    fn newell_normal_is_twice_the_area_far_from_the_origin() {
        let at = dvec3(1e6, -1e6, 1e6);
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let corners: Vec<DVec3> = square.iter().map(|&(x, y)| at + dvec3(x, y, 0.0)).collect();
        assert_eq!(newell_normal(&corners), dvec3(0.0, 0.0, 2.0));
        assert_eq!(polygon_area(&corners), 1.0);
    }
}
