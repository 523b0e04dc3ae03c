//! A convex source as seen from a place, before anything stands between.

use crate::cone::RELATIVE_TOLERANCE;
use crate::fragments::{Fragment, Fragments, HalfSpace, Position};
use crate::place::BEHIND;
use crate::place::Place;
use antumbra_geom::nearest_on_segment;
use antumbra_scene::PlaneId;
use glam::DVec3;
use smallvec::{SmallVec, smallvec};

/// Convex parts of a source, relative to the point.
pub(super) type Parts = SmallVec<[Fragment; 4]>;

/// A place, and the convex polygon that is looked at from there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight<'a> {
    pub(super) place: Place,
    /// Counter-clockwise seen from the front; scene units.
    pub(super) corners: &'a [DVec3],
    /// Unit normal of the source's front.
    pub(super) normal: DVec3,
    /// Plane class of the source: nothing in its own plane hides it.
    pub(super) plane: PlaneId,
}

impl Sight<'_> {
    /// The edges of the source.
    pub(super) fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        let n = self.corners.len();
        (0..n).map(move |i| (self.corners[i], self.corners[(i + 1) % n]))
    }

    /// Does the front of the source face the point (or the side it is approached from)?
    pub(super) fn shows_front(&self) -> bool {
        if self.place.plane == Some(self.plane) {
            return false;
        }
        let point = self.place.point;
        let to_point = point - self.corners[0];
        let height = self.normal.dot(to_point);
        let most = to_point.abs().max_element().max(point.abs().max_element());
        let rounding = 8.0 * f64::EPSILON * most;
        match self.place.leaves(self.normal, height, rounding) {
            Some(slope) => slope > 0.0,
            None => height > rounding,
        }
    }

    /// What lies in the source's or in the receiver's own plane hides nothing.
    pub(super) fn may_be_hidden_by(&self, plane: PlaneId) -> bool {
        plane != self.plane && Some(plane) != self.place.plane
    }

    /// The distance of the farthest corner.
    pub(super) fn reach(&self) -> f64 {
        let distance_sq = |c: &DVec3| (c - self.place.point).length_squared();
        let corners = self.corners.iter().map(distance_sq);
        corners.fold(0.0, f64::max).sqrt()
    }

    /// How far behind the point is seen what of the source touches it; 0 if none does.
    pub(super) fn behind(&self, parts: &[Fragment], fragments: &Fragments) -> f64 {
        let radius = self.place.radius();
        let is_here = |c: &DVec3| c.length() <= radius;
        let mut corners = parts.iter().flat_map(|&part| fragments.corners(part));
        if self.place.approach.is_some() && corners.any(is_here) {
            BEHIND * radius
        } else {
            0.0
        }
    }

    /// What of the parts is above the horizon.
    pub(super) fn above_horizon(
        &self,
        parts: Parts,
        reach: f64,
        fragments: &mut Fragments,
    ) -> Parts {
        let horizon = HalfSpace {
            normal: self.place.normal,
            offset: 0.0,
            tolerance: RELATIVE_TOLERANCE * reach,
        };
        let above = |part| match fragments.position(part, &horizon) {
            Position::Outside => None,
            Position::Inside => Some(part),
            Position::Straddles => Some(fragments.split(part, &horizon).0),
        };
        parts.into_iter().filter_map(above).collect()
    }

    /// The source relative to the point, as convex fragments. Where the source touches
    /// the point, the touching place is seen in the direction opposite to the
    /// approach: that direction stands in its outline, at a vanishing distance. A
    /// source that has the point inside is a fan around that direction.
    pub(super) fn parts(&self, fragments: &mut Fragments) -> Parts {
        let point = self.place.point;
        let mut corners: SmallVec<[DVec3; 8]> = self.corners.iter().map(|&c| c - point).collect();
        let Some(approach) = self.place.approach else {
            return smallvec![fragments.push(corners)];
        };
        // A source whose plane touches the point has the point in its plane.
        let height = self.normal.dot(corners[0]);
        let rounding = 8.0 * f64::EPSILON * point.abs().max_element();
        let slope = self.place.leaves(self.normal, height, rounding);
        let touches_plane = slope.is_some_and(|slope| slope > 0.0);
        if touches_plane {
            for corner in &mut corners {
                *corner -= self.normal * self.normal.dot(*corner);
            }
        }
        let r_sq = approach.radius * approach.radius;
        let behind = -approach.toward * (approach.radius * BEHIND);
        let n = corners.len();
        let edge = |i: usize| [corners[i], corners[(i + 1) % n]];
        let touches = |edge| nearest_on_segment(edge, DVec3::ZERO).length_squared() <= r_sq;
        let is_left = |[a, b]: [DVec3; 2]| a.cross(b).dot(self.normal) > 0.0;
        if touches_plane && !(0..n).map(edge).any(touches) && (0..n).map(edge).all(is_left) {
            let fan = (0..n).map(edge);
            return fan.map(|[a, b]| fragments.push([behind, a, b])).collect();
        }
        let mut outline: SmallVec<[DVec3; 8]> = SmallVec::new();
        for i in 0..n {
            let [a, b] = edge(i);
            let (a_touches, b_touches) = (a.length_squared() <= r_sq, b.length_squared() <= r_sq);
            outline.push(if a_touches { behind } else { a });
            if !a_touches && !b_touches && touches([a, b]) {
                outline.push(behind);
            }
        }
        smallvec![fragments.push(outline)]
    }
}
