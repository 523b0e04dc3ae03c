//! Where a point touches something: the limit it settles to, and slits that are none.

use crate::evaluator::occluders::Occluders;
use crate::evaluator::sight::Sight;
use crate::fragments::HalfSpace;
use crate::place::Approach;
use antumbra_geom::{Plane, nearest_on_segment, settled};
use antumbra_scene::Scene;
use glam::DVec3;
use smallvec::SmallVec;

/// Edges farther from the point than this part of the scene are seen where they are, up to
/// rounding and what the laws of light allow.
const NEAR: f64 = 1e-4;

/// Does a polygon touch the point but for a little, which the point may move?
///
/// * `up` — the unit normal at the point.
pub(crate) fn is_beside(
    (normal, corners): (DVec3, &[DVec3]),
    (point, up): (DVec3, DVec3),
    approach: &Approach,
) -> bool {
    let height = normal.dot(corners[0] - point);
    let across = normal - up * up.dot(normal);
    height != 0.0
        && height.abs() <= approach.radius
        && normal.dot(approach.toward).abs() > 1e-6
        && across.length_squared() >= 1e-6
        && (0..corners.len()).all(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
            let along = b - a;
            normal.cross(along).dot(point - a) >= -approach.radius * along.length()
        })
}

/// Moves a point that touches a source or occluders onto their planes, within its
/// receiver's plane and the distance that counts as touching.
///
/// Nodes on contacts lie beside them by the rounding of the mesh; seen from there,
/// light of that size would come in between a wall that touches the point and
/// what joins it above.
pub(super) fn settle(sight: &Sight<'_>, list: &[u32], occluders: &Occluders) -> DVec3 {
    let (point, up) = (sight.place.point, sight.place.normal);
    let Some(approach) = sight.place.approach else {
        return point;
    };
    // The source first: what lies behind it would not be lit at all.
    let source = std::iter::once((sight.normal, sight.corners));
    let touching = list
        .iter()
        .map(|&piece| (occluders.normal(piece), occluders.corners(piece)));
    let mut planes: SmallVec<[Plane; 4]> = SmallVec::new();
    planes.push(Plane { normal: up, point });
    planes.extend(
        source
            .chain(touching)
            .filter(|&polygon| is_beside(polygon, (point, up), &approach))
            .map(|(normal, corners)| Plane {
                normal,
                point: corners[0],
            }),
    );
    if planes.len() == 1 {
        return point;
    }
    settled(point, &planes, approach.radius)
}

/// The edges of near occluders, or what is visible along them.
pub(super) struct Slits<'a> {
    pub(super) scene: &'a Scene,
    pub(super) sight: &'a Sight<'a>,
}

impl Slits<'_> {
    /// Is a plane so near that its edges may be seen beside where they are?
    ///
    /// * `height` — of the plane over the point.
    pub(super) fn is_near(&self, height: f64) -> bool {
        height.abs() < NEAR * self.scene.extent
    }

    /// The edges of a polygon that do not touch the point: their ends, relative to the
    /// point, and their distances.
    fn edges_beside<'c>(
        &self,
        corners: &'c [DVec3],
    ) -> impl Iterator<Item = (DVec3, DVec3, f64)> + use<'c> {
        let (point, least) = (self.sight.place.point, self.sight.place.radius());
        (0..corners.len())
            .map(move |i| {
                let [a, b] = [corners[i], corners[(i + 1) % corners.len()]].map(|c| c - point);
                let distance_sq = nearest_on_segment([a, b], DVec3::ZERO).length_squared();
                (a, b, distance_sq.sqrt())
            })
            .filter(move |edge| edge.2 > least)
    }

    /// The distance of the nearest edge of a polygon that does not touch the point, if that
    /// is less than `nearest`.
    pub(super) fn nearer(&self, nearest: f64, corners: &[DVec3]) -> f64 {
        let edges = self.edges_beside(corners);
        edges.fold(nearest, |nearest, edge| nearest.min(edge.2))
    }

    /// Is what is visible no more than slits along near edges?
    ///
    /// Where an edge is seen is known to the rounding of its ends by its distance: what
    /// comes in between it and another, within twice as much of the plane through it and the
    /// point, is not known to come in; nor is the end of such a slit, a spot as small.
    pub(super) fn are_all<'v>(
        &self,
        list: &[u32],
        occluders: &Occluders,
        mut visible: impl Iterator<Item = &'v [DVec3]>,
    ) -> bool {
        let is_near = |&piece: &u32| {
            let plane = occluders.plane(piece);
            let height = self.scene.planes[plane.index()].distance(self.sight.place.point);
            self.is_near(height) && self.sight.may_be_hidden_by(plane)
        };
        let planes: Vec<HalfSpace> = list
            .iter()
            .copied()
            .filter(is_near)
            .flat_map(|piece| self.edges_beside(occluders.corners(piece)))
            .map(|(a, b, distance)| HalfSpace {
                normal: a.cross(b).normalize_or_zero(),
                offset: 0.0,
                tolerance: 2.0 * self.scene.rounding() / distance,
            })
            .collect();
        let widest = planes.iter().map(|plane| plane.tolerance);
        let widest = widest.fold(0.0, f64::max);
        visible.all(|corners| {
            let first = corners[0].normalize_or_zero();
            let is_end = |c: &DVec3| first.distance(c.normalize_or_zero()) <= widest;
            let is_along = |plane: &HalfSpace| {
                let is_in_it =
                    |c: &DVec3| plane.normal.dot(*c).abs() <= plane.tolerance * c.length();
                corners.iter().all(is_in_it)
            };
            planes.iter().any(is_along) || corners.iter().all(is_end)
        })
    }
}
