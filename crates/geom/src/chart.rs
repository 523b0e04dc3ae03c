//! A plane's own 2-D frame.

use glam::{DVec2, DVec3, dvec2};

/// An orthonormal frame of a plane: a point and two directions in it.
///
/// `u × v = normal`. For a plane that is perpendicular to a coordinate axis
/// `u` and `v` are coordinate axes (up to sign), so that no rounding occurs
/// between the plane and space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chart {
    /// A point of the plane: chart coordinates (0, 0).
    pub origin: DVec3,
    /// First axis, unit.
    pub u: DVec3,
    /// Second axis, unit.
    pub v: DVec3,
    /// `u × v`, unit.
    pub normal: DVec3,
}

impl Chart {
    /// The chart at `origin` of the plane with the unit normal `normal`.
    #[must_use]
    pub fn new(origin: DVec3, normal: DVec3) -> Self {
        let a = normal.abs();
        // The axis least aligned with the normal gives the best conditioned frame.
        let (u, v) = if a.y == 0.0 && a.z == 0.0 {
            (DVec3::Y, DVec3::Z * normal.x.signum())
        } else if a.x == 0.0 && a.z == 0.0 {
            (DVec3::Z, DVec3::X * normal.y.signum())
        } else if a.x == 0.0 && a.y == 0.0 {
            (DVec3::X, DVec3::Y * normal.z.signum())
        } else {
            let axis = if a.x <= a.y && a.x <= a.z {
                DVec3::X
            } else if a.y <= a.z {
                DVec3::Y
            } else {
                DVec3::Z
            };
            let u = normal.cross(axis).normalize_or_zero();
            (u, normal.cross(u))
        };
        Self {
            origin,
            u,
            v,
            normal,
        }
    }

    /// Chart coordinates of the foot of `point` on the plane.
    #[must_use]
    pub fn to_chart(&self, point: DVec3) -> DVec2 {
        let p = point - self.origin;
        dvec2(p.dot(self.u), p.dot(self.v))
    }

    /// The point of the plane with the chart coordinates `uv`.
    #[must_use]
    pub fn to_space(&self, uv: DVec2) -> DVec3 {
        self.origin + self.u * uv.x + self.v * uv.y
    }

    /// The direction in space of a direction in the chart.
    #[must_use]
    pub fn direction(&self, uv: DVec2) -> DVec3 {
        self.u * uv.x + self.v * uv.y
    }

    /// The height of `point` over the plane, positive on the side of the normal.
    #[must_use]
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn chart_is_right_handed_and_round_trips() {
        for n in [
            dvec3(0.0, 0.0, 1.0),
            dvec3(0.0, -1.0, 0.0),
            dvec3(-1.0, 0.0, 0.0),
            dvec3(0.6, 0.0, 0.8),
            dvec3(1.0, 2.0, 2.0) / 3.0,
        ] {
            let chart = Chart::new(dvec3(1.0, 2.0, 3.0), n);
            assert!((chart.u.cross(chart.v) - n).length() < 1e-15);
            let uv = dvec2(0.3, -0.7);
            assert!((chart.to_chart(chart.to_space(uv)) - uv).length() < 1e-15);
            assert!(chart.height(chart.to_space(uv)).abs() < 1e-15);
        }
    }
}
