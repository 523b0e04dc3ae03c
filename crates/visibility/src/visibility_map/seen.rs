//! A convex polygon as seen from a point: the directions in which it lies.

use crate::cone::{RELATIVE_TOLERANCE, edge_plane, l1};
use crate::fragments::HalfSpace;
use crate::place::BEHIND;
use crate::visibility_map::Place;
use glam::DVec3;
use std::ops::Range;

/// A polygon as seen from a point; its corners and half-spaces are in [`Sights`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Which screen it is.
    pub(super) screen: u32,
    /// Unit normal of its plane, away from the point.
    pub(super) normal: DVec3,
    /// Distance of the plane along `normal`, scene units. If the point touches the plane,
    /// how fast the approach leaves it: the distance is as small as one likes times this.
    pub(super) height: f64,
    /// Does the point touch the plane?
    pub(super) touches: bool,
    /// Is the point on the side from which the corners run counter-clockwise?
    pub(super) shows_front: bool,
    /// The distance of its farthest corner, scene units.
    pub(super) farthest: f64,
    corners: (u32, u32),
    halves: (u32, u32),
}

/// Polygons as seen from one point.
#[derive(Clone, Debug, Default)]
pub(super) struct Sights {
    corners: Vec<DVec3>,
    halves: Vec<HalfSpace>,
}

fn range((start, len): (u32, u32)) -> Range<usize> {
    start as usize..(start + len) as usize
}

impl Sights {
    pub(super) fn clear(&mut self) {
        self.corners.clear();
        self.halves.clear();
    }

    /// Corners relative to the point.
    pub(super) fn corners(&self, seen: &Seen) -> &[DVec3] {
        &self.corners[range(seen.corners)]
    }

    /// Half-spaces through the point that together hold the directions of the polygon.
    pub(super) fn halves(&self, seen: &Seen) -> &[HalfSpace] {
        &self.halves[range(seen.halves)]
    }

    /// Looks at a convex polygon; `None` if it is seen edge-on.
    ///
    /// * `corners` — counter-clockwise about `normal`, scene units.
    /// * `rounding` — of the corners; scene units.
    ///
    /// Where a plane or an edge touches the point, its half-space is the limit from
    /// [`Place::approach`], as in [`crate::cone::cone`].
    pub(super) fn look(
        &mut self,
        corners: &[DVec3],
        normal: DVec3,
        place: &Place,
        rounding: f64,
    ) -> Option<Seen> {
        let point = place.point;
        let first = corners[0] - point;
        let height = normal.dot(first);
        let edge_on = 8.0 * f64::EPSILON * (first.abs().max_element() + point.abs().max_element());
        let slope = place
            .approach
            .and_then(|a| a.leaves(normal, place.normal, height, edge_on));
        if slope.is_none() && height.abs() <= edge_on {
            return None;
        }
        let sign = slope.map_or(height, |slope| -slope).signum();
        let (start, first_half) = (self.corners.len(), self.halves.len());
        let mut farthest_sq = 0.0f64;
        for &corner in corners {
            let corner = corner - point;
            farthest_sq = farthest_sq.max(corner.length_squared());
            self.corners.push(corner);
        }
        if slope.is_some() {
            self.halves.push(HalfSpace {
                normal: normal * sign,
                offset: 0.0,
                tolerance: RELATIVE_TOLERANCE,
            });
        }
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[if i + 1 == corners.len() { 0 } else { i + 1 }];
            let plane = edge_plane(a, b, point, place.approach.as_ref()) * sign;
            // Two edges on one line are known to the rounding of their ends.
            self.halves.push(HalfSpace {
                normal: plane,
                offset: 0.0,
                tolerance: RELATIVE_TOLERANCE * l1(plane) + 2.0 * rounding * l1(b - a),
            });
        }
        Some(Seen {
            screen: u32::MAX,
            normal: normal * sign,
            height: slope.unwrap_or(height).abs(),
            touches: slope.is_some(),
            shows_front: sign < 0.0,
            farthest: farthest_sq.sqrt(),
            corners: (start as u32, corners.len() as u32),
            halves: (first_half as u32, (self.halves.len() - first_half) as u32),
        })
    }

    /// Is all of a polygon behind the plane of another?
    pub(super) fn is_behind(&self, seen: &Seen, cover: &Seen, rounding: f64) -> bool {
        match (cover.touches, seen.touches) {
            (true, touches) => !touches,
            (false, true) => false,
            (false, false) => self
                .corners(seen)
                .iter()
                .all(|&x| cover.normal.dot(x) - cover.height >= -4.0 * rounding),
        }
    }
}

impl Seen {
    /// How many times a direction leads to the plane: not at all if the point touches it.
    pub(super) fn depth(&self, direction: DVec3) -> f64 {
        if self.touches {
            0.0
        } else {
            self.height / self.normal.dot(direction)
        }
    }

    /// Where a direction meets the plane, relative to the point; no farther away than the
    /// polygon is. If the plane touches the point, just behind it.
    pub(super) fn foot(&self, direction: DVec3, place: &Place) -> DVec3 {
        let touching = place.approach.map_or(0.0, |a| BEHIND * a.radius);
        let height = if self.touches {
            self.height * touching
        } else {
            self.height
        };
        let along = self.normal.dot(direction);
        let farthest = self.farthest / direction.length();
        // Not a number and infinity are farther than the farthest.
        let t = if along * farthest > height {
            height / along
        } else {
            farthest
        };
        direction * t
    }
}

/// The directions in which `seen` is nearer than `cover`, of those in which both are.
///
/// Planes that touch the point are nearer than all others, and one is nearer than another
/// as it is while the approach goes to the point.
pub(super) fn nearer_than(seen: &Seen, cover: &Seen, rounding: f64) -> HalfSpace {
    debug_assert_eq!(seen.touches, cover.touches, "what touches is nearer");
    let (near, far) = (seen.height, cover.height);
    let rounding = if seen.touches { 0.0 } else { rounding };
    HalfSpace {
        normal: seen.normal * far - cover.normal * near,
        offset: 0.0,
        tolerance: RELATIVE_TOLERANCE * (near + far) + 4.0 * rounding,
    }
}
