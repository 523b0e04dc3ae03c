//! Bounding rectangles in the picture plane, to look at few candidates only.

use glam::{DVec2, DVec3, dvec2};

/// A rectangle in the picture plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    pub(super) min: DVec2,
    pub(super) max: DVec2,
}

impl Rectangle {
    pub(super) const EMPTY: Self = Self {
        min: DVec2::INFINITY,
        max: DVec2::NEG_INFINITY,
    };

    /// Of the image of a segment, of which only what lies before the eye is seen.
    pub(super) fn of_segment(a: DVec3, b: DVec3) -> Self {
        let (near, far) = if a.z < b.z { (a, b) } else { (b, a) };
        if far.z <= 0.0 {
            return Self::EMPTY;
        }
        let p = far.truncate() / far.z;
        if near.z > 0.0 {
            let q = near.truncate() / near.z;
            return Self {
                min: p.min(q),
                max: p.max(q),
            };
        }
        // It goes on to infinity in the direction of its point beside the eye.
        let beside = near * far.z - far * near.z;
        let reach = |from: f64, d: f64| if d > 0.0 { f64::INFINITY } else { from };
        Self {
            min: dvec2(-reach(-p.x, -beside.x), -reach(-p.y, -beside.y)),
            max: dvec2(reach(p.x, beside.x), reach(p.y, beside.y)),
        }
    }

    pub(super) fn with(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    pub(super) fn grown(self, by: f64) -> Self {
        Self {
            min: self.min - by,
            max: self.max + by,
        }
    }

    pub(super) fn meets(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    pub(super) fn common(&self, other: &Self) -> Self {
        Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        }
    }

    pub(super) fn holds(&self, p: DVec2) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }
}
