//! Plane polygons, in space and in their chart.

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
            inside ^= is_left_of(point, [corners[i], corners[(i + 1) % n]]);
        }
    }
    inside
}

/// Does the ray from a point along +x cross a segment? Exact, but for points on it.
///
/// A point is inside of what an odd number of border edges is crossed from.
#[must_use]
pub fn is_left_of(point: DVec2, [a, b]: [DVec2; 2]) -> bool {
    (a.y > point.y) != (b.y > point.y) && (orient(a, b, point) > 0.0) == (b.y > a.y)
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

pub(crate) fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    orient2d(
        Coord { x: a.x, y: a.y },
        Coord { x: b.x, y: b.y },
        Coord { x: c.x, y: c.y },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn newell_normal_is_twice_the_area_far_from_the_origin() {
        let at = dvec3(1e6, -1e6, 1e6);
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let corners: Vec<DVec3> = square.iter().map(|&(x, y)| at + dvec3(x, y, 0.0)).collect();
        assert_eq!(newell_normal(&corners), dvec3(0.0, 0.0, 2.0));
        assert_eq!(polygon_area(&corners), 1.0);
    }
}
