//! The visibility map of a point: its hemisphere in convex cones, with the face seen in
//! each.
//!
//! A cone and a list of boxes and polygons that may reach into it, nearest first, are all
//! there is at any time. The next polygon peels off what lies outside of it, edge by edge;
//! each piece goes on alone with what still reaches into it, and in the rest the polygon
//! *covers*: what lies behind its plane is dropped. Two covers that cross are divided by
//! the plane through the point and their common line. So every decision is the division of
//! a cone in two that share the cut, and the parts of all cones add up to the hemisphere
//! whatever rounding decides.
//!
//! # Source
//!
//! Weiler & Atherton 1977 (WA77 in `docs/references.md`) peel polygons front to back like
//! this on a picture; the limits at contacts are those of [`crate::cone`].

mod boxes;
mod cones;
mod cover;
mod deal;
mod merge;
mod place;
mod screens;
mod seen;
mod walk;

use crate::place::Place;
use antumbra_scene::FaceId;
use glam::DVec3;

pub(crate) use screens::Screens;
pub use walk::MapScratch;

/// A part of what is seen: one convex cone, and the face in it.
#[derive(Clone, Copy, Debug)]
pub struct VisiblePart<'a> {
    /// The face; its material says whether it is black because it is covered.
    pub face: FaceId,
    /// Is it seen from its front? Backs hide and send nothing.
    pub shows_front: bool,
    /// Was the cone not divided any further, since it is smaller than asked for?
    pub is_ended: bool,
    /// Form factor from the point, dimensionless; all parts and the sky add up to 1.
    pub factor: f64,
    /// Directions of the corners of the cone, counter-clockwise as seen from the point; of
    /// lengths between 1/√3 and 1.
    pub directions: &'a [DVec3],
    /// Corners of the fragment that is seen, in the plane of the face, in the same order;
    /// scene units. Of an ended cone, it may go beyond the face. Of a face that touches the
    /// point, one or two corners are where the point touches it.
    pub fragment: &'a [DVec3],
}

/// Sums over a visibility map, and the work it took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MapTotals {
    /// Form factor of the directions in which nothing is seen.
    pub sky: f64,
    /// Form factor of cones that are no wider than what is not known of their sides: the
    /// rounding of an edge by its distance. Nothing is said to be seen there, or closed
    /// rooms would not be dark.
    pub slits: f64,
    /// Form factor of cones that were ended early: what is seen there is that of one
    /// direction in each.
    pub ended: f64,
    /// How many cones were ended early.
    pub n_ended: u64,
    /// Cones there are in the end.
    pub n_cones: u64,
    /// Boxes tested against a plane.
    pub n_boxes: u64,
    /// Polygons looked at from the point.
    pub n_looks: u64,
    /// Cones tested against a half-space.
    pub n_halves: u64,
}
