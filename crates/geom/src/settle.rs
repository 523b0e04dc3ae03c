//! Points moved onto the planes that they belong to.

use crate::DVec3;

/// Planes that meet at a smaller angle (its sine) do not hold a point together: the line
/// in which they meet would be known a thousand times worse than they.
const SMALLEST_ANGLE: f64 = 1e-3;

/// A plane through a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: DVec3,
    /// Any point of it: the plane is where `normal · (x − point) = 0`.
    pub point: DVec3,
}

impl Plane {
    /// Signed distance of a point, positive on the normal's side.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        (point - self.point).dot(self.normal)
    }
}

/// The point nearest to `from` on all planes that agree on one within `farthest`; those
/// that come later and do not agree, or are almost parallel to earlier ones, are passed
/// over.
#[must_use]
pub fn settled(from: DVec3, planes: &[Plane], farthest: f64) -> DVec3 {
    let mut directions: Vec<DVec3> = Vec::new();
    let mut kept: Vec<Plane> = Vec::new();
    let mut to = from;
    for &plane in planes {
        let mut free = plane.normal;
        for &q in &directions {
            free -= free.dot(q) * q;
        }
        let sine = free.length();
        if sine < SMALLEST_ANGLE {
            continue;
        }
        let direction = free / sine;
        let next = to - plane.distance(to) / sine * direction;
        if next.distance(from) > farthest {
            continue;
        }
        to = next;
        directions.push(direction);
        kept.push(plane);
    }
    // Once more, for the rounding of the first time; and exactly, along axes.
    for (plane, &direction) in kept.iter().zip(&directions) {
        to -= plane.distance(to) / direction.dot(plane.normal) * direction;
    }
    for plane in kept {
        if let Some(axis) = axis(plane.normal) {
            to[axis] = plane.point[axis];
        }
    }
    to
}

/// The axis to which the plane is exactly perpendicular.
fn axis(normal: DVec3) -> Option<usize> {
    // A component of 1 is not enough: it hides tilts of up to 1e-8.
    (0..3).find(|&k| normal.abs() == DVec3::AXES[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dvec3;

    #[test]
    fn point_settles_on_three_planes_and_keeps_to_axes_exactly() {
        let planes = [
            Plane {
                normal: DVec3::Z,
                point: dvec3(5.0, 5.0, 0.1),
            },
            Plane {
                normal: dvec3(0.6, 0.8, 0.0),
                point: DVec3::ZERO,
            },
            Plane {
                normal: dvec3(0.8, 0.0, 0.6),
                point: dvec3(0.0, 0.0, 0.1),
            },
        ];
        let to = settled(dvec3(1e-9, -2e-9, 0.1 + 3e-9), &planes, 1e-7);
        assert_eq!(to.z.to_bits(), 0.1f64.to_bits());
        assert!(planes.iter().all(|p| p.distance(to).abs() < 1e-16));
    }

    #[test]
    fn plane_tilted_by_a_billionth_is_no_axis() {
        let tilted = Plane {
            normal: dvec3(1.0, 1e-9, 0.0),
            point: DVec3::ZERO,
        };
        let to = settled(dvec3(0.0, 0.5, 0.0), &[tilted], 1e-8);
        assert!(tilted.distance(to).abs() < 1e-17, "{to}");
    }

    #[test]
    fn planes_that_would_move_it_too_far_are_passed_over() {
        let near = Plane {
            normal: DVec3::X,
            point: DVec3::X * 1e-9,
        };
        let far = Plane {
            normal: DVec3::Y,
            point: DVec3::Y,
        };
        let to = settled(DVec3::ZERO, &[far, near], 1e-8);
        assert_eq!(to, DVec3::X * 1e-9);
    }
}
