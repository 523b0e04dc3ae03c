//! Where the point is, to the last digit, and its hemisphere before anything is seen.

use super::Place;
use super::cones::{Margins, Side};
use super::screens::Screens;
use crate::cone::RELATIVE_TOLERANCE;
use crate::evaluator::limit::is_beside;
use crate::fragments::HalfSpace;
use antumbra_geom::{Plane, settled};
use antumbra_scene::Aabb;
use glam::DVec3;

/// The place with its point moved onto the planes of what touches it, within its own plane
/// and the distance that counts as touching.
///
/// Nodes on contacts lie beside them by the rounding of the mesh; seen from there, light of
/// that size would come in between a wall that touches the point and what joins it above.
pub(super) fn settle(place: &Place, screens: &Screens) -> Place {
    let Some(approach) = place.approach else {
        return *place;
    };
    let around = Aabb {
        min: place.point - approach.radius,
        max: place.point + approach.radius,
    };
    let mut touching: Vec<u32> = Vec::new();
    screens
        .tree
        .visit(|b| b.meets(&around), |screen| touching.push(screen));
    touching.sort_unstable();
    let own = Plane {
        normal: place.normal,
        point: place.point,
    };
    let beside = touching.iter().filter_map(|&i| {
        let (screen, corners) = (screens.get(i), screens.corners(i));
        let is_own = place.plane == Some(screen.plane);
        let polygon = (screen.normal, corners);
        (!is_own && is_beside(polygon, (place.point, place.normal), &approach)).then(|| Plane {
            normal: screen.normal,
            point: corners[0],
        })
    });
    let planes: Vec<Plane> = std::iter::once(own).chain(beside).collect();
    if planes.len() == 1 {
        return *place;
    }
    Place {
        point: settled(place.point, &planes, approach.radius),
        ..*place
    }
}

/// Four cones that together are the hemisphere: their corners, and their sides.
pub(super) fn quarters(place: &Place, margins: Margins) -> [([DVec3; 3], [Side; 3]); 4] {
    let up = place.normal;
    let along = up.any_orthonormal_vector();
    let across = up.cross(along);
    let around = [along, across, -along, -across];
    std::array::from_fn(|k| {
        let (a, b) = (around[k], around[(k + 1) % 4]);
        // Counter-clockwise as seen from the point.
        let corners = [a, up, b];
        (
            corners,
            [b, a, up].map(|n| side_along(n, place.point, margins)),
        )
    })
}

/// The side of a plane through a point with this inward normal, of length 1.
pub(super) fn side_along(normal: DVec3, point: DVec3, margins: Margins) -> Side {
    let half = HalfSpace {
        normal,
        offset: 0.0,
        tolerance: RELATIVE_TOLERANCE,
    };
    Side::new(&half, point, margins)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lambert::contour_sum;

    #[test]
    fn quarters_are_the_hemisphere() {
        for normal in [DVec3::Z, -DVec3::X, DVec3::new(0.6, -0.48, 0.64)] {
            let place = Place {
                point: DVec3::ONE,
                normal,
                plane: None,
                approach: None,
            };
            let margins = Margins {
                slack: 0.0,
                reach: 1.0,
            };
            let quarters = quarters(&place, margins);
            let sum: f64 = quarters.iter().map(|q| contour_sum(&q.0, normal)).sum();
            assert!((sum - 1.0).abs() < 4e-16, "{sum}");
            for (corners, sides) in quarters {
                for (i, side) in sides.iter().enumerate() {
                    assert!(side.normal.dot(corners[i]).abs() < 1e-15);
                    assert!(side.normal.dot(corners[(i + 1) % 3]).abs() < 1e-15);
                    assert!(side.normal.dot(corners[(i + 2) % 3]) > 0.9);
                }
            }
        }
    }
}
