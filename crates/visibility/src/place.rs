//! Places from which a scene is looked at.

use antumbra_scene::PlaneId;
use glam::DVec3;

/// A point from which a scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Scene units.
    pub point: DVec3,
    /// Unit normal: the middle of the hemisphere.
    pub normal: DVec3,
    /// The plane of the face the point lies on: nothing in it is seen. `None` for free
    /// sensors.
    pub plane: Option<PlaneId>,
    /// The limit from one side, for nodes on contacts.
    pub approach: Option<Approach>,
}

impl Place {
    /// Distance within which features touch the point: 0 where no limit is asked for.
    pub(crate) fn radius(&self) -> f64 {
        self.approach.map_or(0.0, |a| a.radius)
    }

    /// The slope at which the approach, if there is one, leaves a plane: see
    /// [`Approach::leaves`].
    pub(crate) fn leaves(&self, normal: DVec3, height: f64, rounding: f64) -> Option<f64> {
        self.approach?.leaves(normal, self.normal, height, rounding)
    }
}

/// Limit from one side: the point is approached from `toward`.
///
/// Used at nodes on contacts (D0), where irradiance has one value per side.
/// Everything of the scene within `radius` of the point counts as touching it.
///
/// # Source
///
/// The limit of the cone's half-spaces for a point `p + ε d`, ε → 0+.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Unit direction from the point into the region whose limit is asked for,
    /// in the receiver's plane.
    pub toward: DVec3,
    /// Distance within which features touch the point; scene units.
    pub radius: f64,
}

impl Approach {
    /// The slope at which the approach leaves a plane that the point touches; `None`
    /// if the plane keeps its real height, because the point does not touch it or
    /// because it runs along with the approach, as a table a hair above the floor does.
    ///
    /// Distances and slopes count within the receiver: a plane that is inclined by
    /// 1e-9 to it leaves a contact as much as a wall does, but its height above a
    /// point a metre from its trace is no rounding.
    ///
    /// * `normal` — of the plane; unit.
    /// * `up` — of the receiver; unit.
    /// * `height` — of the plane above the point, along `normal`.
    /// * `rounding` — of `height`.
    pub(crate) fn leaves(
        &self,
        normal: DVec3,
        up: DVec3,
        height: f64,
        rounding: f64,
    ) -> Option<f64> {
        let touches = height.abs() <= self.radius;
        if !touches {
            return None;
        }
        let sine = (normal - up * up.dot(normal)).length();
        let slope = normal.dot(self.toward);
        // A plane that passes through the point to rounding has no real height to keep: a
        // side of it, however flat the approach, is that of the approach.
        let least = if height.abs() <= rounding {
            FLATTEST
        } else {
            ALONG
        };
        (height.abs() <= (self.radius * sine).max(rounding) && slope.abs() > least * sine)
            .then_some(slope)
    }
}

/// An approach with a smaller slope runs along with a plane that it starts beside.
pub(crate) const ALONG: f64 = 1e-6;

/// An approach with a smaller slope runs along with a plane that it starts on: a third of
/// a pixel of the arrangement, as seen across the receiver, is 1e-9.
const FLATTEST: f64 = 1e-10;

/// Where a source that touches the point is seen: so many contact radii behind the point.
/// Larger, and it may lie behind something that does not touch the point. Smaller, and its
/// direction is no longer told from that of a plane: what is within the tolerance of a
/// half-space is on it (at 1e-3 that was 1e-3 rad).
pub(crate) const BEHIND: f64 = 0.5;
