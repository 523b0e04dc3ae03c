//! What is looked at, and how much of it is seen.

use antumbra_scene::{FaceId, PlaneId, Scene};
use glam::DVec3;

/// Convex polygons of one plane whose visible part is asked for.
#[derive(Clone, Debug)]
pub struct Source {
    /// Corners of each, counter-clockwise seen from the front; scene units.
    pub pieces: Vec<Vec<DVec3>>,
    /// Unit normal of its front.
    pub normal: DVec3,
    /// Its plane class: nothing in its own plane hides it.
    pub plane: PlaneId,
}

impl Source {
    /// A whole face.
    #[must_use]
    pub fn of(scene: &Scene, face: FaceId) -> Self {
        let face = scene.face(face);
        let pieces = &scene.pieces[face.pieces.start as usize..face.pieces.end as usize];
        let corners = pieces.iter().map(|piece| scene.positions(&piece.vertices));
        Self {
            pieces: corners.collect(),
            normal: face.normal,
            plane: face.plane,
        }
    }
}

/// Form factors from a point to a source, dimensionless, in `0..=1`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Of the visible part.
    pub factor: f64,
    /// Of the whole, as if nothing stood between.
    pub unoccluded: f64,
}

impl std::iter::Sum for Seen {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, seen| Self {
            factor: sum.factor + seen.factor,
            unoccluded: sum.unoccluded + seen.unoccluded,
        })
    }
}
