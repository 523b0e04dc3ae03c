//! Convex parts of an emitter as seen from a point, and their splitting.
//!
//! All corners are relative to the point. Fragments live in one growing buffer,
//! so that an evaluation allocates nothing once the buffer is warm.

use antumbra_scene::Aabb;
use glam::DVec3;

/// A half-space `normal · x > offset`; those of a viewing cone pass through the
/// point (`offset` 0).
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfSpace {
    pub(crate) normal: DVec3,
    pub(crate) offset: f64,
    /// Values this small are zero: rounding of the corners and of `normal`.
    pub(crate) tolerance: f64,
}

impl HalfSpace {
    /// The signed value of a corner, exactly zero if it is on the plane by
    /// [`HalfSpace::tolerance`].
    ///
    /// Two occluders that share an edge cut along the same plane; corners made
    /// by the first cut must be *on* it for the second, or slivers of 1e-16
    /// would leak through closed shells.
    #[inline]
    pub(crate) fn value(&self, x: DVec3) -> f64 {
        let v = self.normal.dot(x) - self.offset;
        if v.abs() <= self.tolerance { 0.0 } else { v }
    }

    /// Is a point outside by more than [`HalfSpace::tolerance`]?
    #[inline]
    pub(crate) fn excludes(&self, x: DVec3) -> bool {
        self.normal.dot(x) - self.offset < -self.tolerance
    }

    /// May a box reach into it, or touch it?
    #[inline]
    pub(crate) fn may_meet(&self, b: &Aabb) -> bool {
        b.max_along(self.normal) >= self.offset - self.tolerance
    }
}

/// A range of corners in [`Fragments`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fragment {
    pub(crate) start: u32,
    pub(crate) len: u32,
}

/// Where all of a fragment lies with respect to a half-space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Position {
    Inside,
    Outside,
    Straddles,
}

/// The buffer of corners.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fragments {
    corners: Vec<DVec3>,
    values: Vec<f64>,
}

impl Fragments {
    pub(crate) fn clear(&mut self) {
        self.corners.clear();
    }

    pub(crate) fn push(&mut self, corners: impl IntoIterator<Item = DVec3>) -> Fragment {
        let start = self.corners.len();
        self.corners.extend(corners);
        Fragment {
            start: start as u32,
            len: (self.corners.len() - start) as u32,
        }
    }

    #[inline]
    pub(crate) fn corners(&self, fragment: Fragment) -> &[DVec3] {
        &self.corners[fragment.start as usize..(fragment.start + fragment.len) as usize]
    }

    /// Is the fragment inside, outside or both? A fragment that only touches the
    /// plane from inside is inside; one without a corner strictly inside is
    /// outside.
    #[inline]
    pub(crate) fn position(&self, fragment: Fragment, half: &HalfSpace) -> Position {
        let (mut inside, mut outside) = (false, false);
        for &x in self.corners(fragment) {
            let v = half.value(x);
            inside |= v > 0.0;
            outside |= v < 0.0;
        }
        match (inside, outside) {
            (true, true) => Position::Straddles,
            (true, false) => Position::Inside,
            _ => Position::Outside,
        }
    }

    /// Cuts a straddling fragment: the part inside and the part outside. Both
    /// share the new corners bit for bit.
    pub(crate) fn split(&mut self, fragment: Fragment, half: &HalfSpace) -> (Fragment, Fragment) {
        let (start, len) = (fragment.start as usize, fragment.len as usize);
        self.values.clear();
        for i in start..start + len {
            self.values.push(half.value(self.corners[i]));
        }
        // One pass for each side; the cut point is a function of the edge's two
        // ends in a fixed order, so both passes agree: from the nearer end, for a place
        // near the point has as many digits as its distance from there.
        let mut sides = [Fragment { start: 0, len: 0 }; 2];
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let first = self.corners.len();
            for i in 0..len {
                let j = if i + 1 == len { 0 } else { i + 1 };
                let (vi, vj) = (self.values[i] * sign, self.values[j] * sign);
                if vi >= 0.0 {
                    let corner = self.corners[start + i];
                    self.corners.push(corner);
                }
                if (vi > 0.0 && vj < 0.0) || (vi < 0.0 && vj > 0.0) {
                    let (a, b) = if self.values[i] > 0.0 { (i, j) } else { (j, i) };
                    let (a, b) = if self.values[a] > -self.values[b] {
                        (b, a)
                    } else {
                        (a, b)
                    };
                    let (va, vb) = (self.values[a], self.values[b]);
                    let (xa, xb) = (self.corners[start + a], self.corners[start + b]);
                    self.corners.push(xa + (xb - xa) * (va / (va - vb)));
                }
            }
            sides[side] = Fragment {
                start: first as u32,
                len: (self.corners.len() - first) as u32,
            };
        }
        (sides[0], sides[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn halves_share_their_cut_and_keep_the_corners_between_them() {
        let mut fragments = Fragments::default();
        let square = fragments.push([
            dvec3(0.0, 0.0, 1.0),
            dvec3(1.0, 0.0, 1.0),
            dvec3(1.0, 1.0, 1.0),
            dvec3(0.0, 1.0, 1.0),
        ]);
        let half = HalfSpace {
            normal: dvec3(1.0, 0.0, -0.25),
            offset: 0.0,
            tolerance: 1e-15,
        };
        assert_eq!(fragments.position(square, &half), Position::Straddles);
        let (inside, outside) = fragments.split(square, &half);
        assert_eq!((inside.len, outside.len), (4, 4));
        assert!(fragments.corners(inside).iter().all(|c| c.x >= 0.25));
        assert!(fragments.corners(outside).iter().all(|c| c.x <= 0.25));
    }
}
