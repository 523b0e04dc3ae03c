//! Corners of crooked surfaces that were meant to be one.
//!
//! A quadrilateral whose corners leave its plane by far more than rounding tells how
//! sloppily its file was written. Where its corners miss those of its neighbours by no more,
//! the slits between them mean nothing, and every one of them would cost elements and
//! curves: such corners are joined, with a warning. Surfaces that are plane keep their
//! corners, so a file without crooked ones is left as it is, and so is a gap between plane
//! ones.

use crate::bvh::Aabb;
use crate::corners::{Mover, extent, loops, shortest_edge};
use crate::input::{SceneInput, SurfaceInput};
use crate::scene::Scene;
use antumbra_geom::newell_normal;
use glam::DVec3;
use std::collections::BTreeMap;

/// Corners nearer than so many times the farthest that a corner is off its plane are joined.
///
/// A quadrilateral with one corner off by d is off its plane by d/4. With 4, rooms of boxes
/// whose coordinates all have errors of 1e-9 to 1e-6 m are left without slits (99 places for
/// 316 corners).
pub(super) const REACH: f64 = 4.0;

/// Nothing is joined where a surface is off its plane by more than this part of the largest
/// crooked one's size: files of seven digits miss by 3e-6, which `check` tells of and welding
/// on request joins, and walls that were measured are warped by more.
const WORST: f64 = 1e-6;

/// A surface is crooked from this part of its size on, where it is split (see `outline`).
const CROOKED: f64 = 1e-9;

/// Joined is only where every surface is wider than so many times the distance.
const WIDER: f64 = 64.0;

/// What was joined.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mended {
    /// With joined corners.
    pub(crate) input: SceneInput,
    /// Of which surfaces, in their order.
    pub(crate) surfaces: Vec<String>,
    pub(crate) n_moved: usize,
    /// The largest distance by which a corner was moved; file units.
    pub(crate) farthest: f64,
    /// The largest that was allowed; file units.
    pub(crate) allowed: f64,
}

/// The input with the corners of its crooked surfaces joined; `None` if there is nothing to
/// join, or if that could make a surface of no width, or one of two that face the same way.
pub(crate) fn mended(input: &SceneInput) -> Option<Mended> {
    let off: Vec<Option<f64>> = input.surfaces.iter().map(deviation).collect();
    let is_crooked = |(surface, off): &(&SurfaceInput, f64)| *off > CROOKED * size(surface);
    let surfaces = input.surfaces.iter();
    let measured = surfaces.zip(&off).filter_map(|(s, off)| Some((s, (*off)?)));
    let crooked: Vec<(&SurfaceInput, f64)> = measured.filter(is_crooked).collect();
    let worst = crooked.iter().map(|c| c.1).max_by(f64::total_cmp)?;
    let largest = crooked.iter().map(|c| size(c.0)).fold(0.0, f64::max);
    if worst > WORST * largest {
        return None;
    }
    let allowed = REACH * worst;
    let is_wide = |s: &SurfaceInput| width(s).is_none_or(|width| width > WIDER * allowed);
    let (_, [p, q]) = shortest_edge(input)?;
    if p.distance(q) <= WIDER * allowed || !input.surfaces.iter().all(is_wide) {
        return None;
    }
    let plane = Scene::PLANE_TOLERANCE * extent(input);
    let may_move = |k: usize| off[k].is_some_and(|off| off > plane);
    let mut joined = input.clone();
    let mut mover = Mover::new(extent(input), allowed);
    for pass in [false, true] {
        for (k, surface) in joined.surfaces.iter_mut().enumerate() {
            if may_move(k) == pass {
                mover.surface(surface, pass);
            }
        }
    }
    let welded = mover.welded;
    if welded.n_moved == 0 || n_coincident(&joined) > n_coincident(input) {
        return None;
    }
    Some(Mended {
        input: joined,
        surfaces: welded.surfaces,
        n_moved: welded.n_moved,
        farthest: welded.farthest,
        allowed,
    })
}

/// How far corners of a surface are off its plane: half of the range of their heights. `None`
/// for triangles, which are plane, and for what is none.
fn deviation(surface: &SurfaceInput) -> Option<f64> {
    if surface.vertices.len() < 4 || loops(surface).flatten().any(|p| !p.is_finite()) {
        return None;
    }
    let normal = newell_normal(&surface.vertices).try_normalize()?;
    let origin = surface.vertices[0];
    let heights = loops(surface).flatten().map(|&p| normal.dot(p - origin));
    let (low, high) = heights.fold((0.0f64, 0.0f64), |(lo, hi), h| (lo.min(h), hi.max(h)));
    Some((high - low) / 2.0)
}

/// The diagonal of the box around a surface.
fn size(surface: &SurfaceInput) -> f64 {
    let bounds = Aabb::of(surface.vertices.iter().copied());
    (bounds.max - bounds.min).length()
}

/// The width of a surface: its area by its size. `None` if it has no size.
fn width(surface: &SurfaceInput) -> Option<f64> {
    let size = size(surface);
    let area = newell_normal(&surface.vertices).length();
    (size > 0.0 && size.is_finite() && area > 0.0).then_some(area / size)
}

/// How many times three corners in a row are those of an earlier surface that faces the same
/// way: surfaces that would be one there.
fn n_coincident(input: &SceneInput) -> usize {
    let mut seen: BTreeMap<[[u64; 3]; 3], Vec<DVec3>> = BTreeMap::new();
    let mut n = 0;
    for surface in &input.surfaces {
        let normal = newell_normal(&surface.vertices);
        let corners = &surface.vertices;
        for i in 0..corners.len() {
            let three = [0, 1, 2].map(|k| corners[(i + k) % corners.len()]);
            // Adding 0 makes one zero of two.
            let mut key = three.map(|p| (p + 0.0).to_array().map(f64::to_bits));
            key.sort_unstable();
            let normals = seen.entry(key).or_default();
            if normals.iter().any(|other| other.dot(normal) > 0.0) {
                n += 1;
            } else {
                normals.push(normal);
            }
        }
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn surface(name: &str, vertices: Vec<DVec3>) -> SurfaceInput {
        SurfaceInput {
            name: name.to_owned(),
            material: "m".to_owned(),
            vertices,
            holes: Vec::new(),
        }
    }

    /// Where the second of an [`angle`] has the corner that the first misses.
    fn plane_corner(off: f64) -> DVec3 {
        dvec3(1.0, 0.0, 0.5 * off)
    }

    /// Two quadrilaterals in a right angle with a common edge: a corner of the first is `off`
    /// above the plane of the others, which makes it off its own by a quarter of that, and
    /// misses the second by half.
    fn angle(off: f64) -> SceneInput {
        let crooked = [
            DVec3::ZERO,
            dvec3(1.0, 0.0, off),
            dvec3(1.0, 1.0, 0.0),
            DVec3::Y,
        ];
        let plane = [
            plane_corner(off),
            DVec3::ZERO,
            DVec3::Z,
            dvec3(1.0, 0.0, 1.0),
        ];
        SceneInput {
            surfaces: vec![
                surface("crooked", crooked.to_vec()),
                surface("plane", plane.to_vec()),
            ],
            ..SceneInput::default()
        }
    }

    #[test]
    fn corners_of_a_crooked_surface_join_those_of_a_plane_one() {
        let input = angle(1e-7);
        let mended = mended(&input).expect("crooked");
        assert_eq!(
            (mended.n_moved, mended.surfaces),
            (1, vec!["crooked".to_owned()])
        );
        assert!(mended.farthest <= mended.allowed, "{}", mended.farthest);
        assert_eq!(mended.input.surfaces[0].vertices[1], plane_corner(1e-7));
        assert_eq!(mended.input.surfaces[1], input.surfaces[1]);
    }

    #[test]
    fn plane_surfaces_keep_the_gaps_between_them() {
        assert_eq!(mended(&angle(0.0)), None);
        // A gap half as wide as what is joined, elsewhere.
        let mut input = angle(1e-7);
        for (name, z) in [("over", 2.0 + 5e-8), ("under", 2.0)] {
            let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
            let square = square.map(|p| p + DVec3::Z * z).to_vec();
            input.surfaces.push(surface(name, square));
        }
        let mended = mended(&input).expect("crooked");
        assert_eq!(mended.input.surfaces[2..], input.surfaces[2..]);
    }

    #[test]
    fn nothing_is_joined_where_a_surface_is_warped_on_purpose() {
        assert_eq!(mended(&angle(1e-4)), None);
        let mut input = angle(1e-7);
        let warped = angle(1e-4).surfaces.swap_remove(0).vertices;
        let above = warped.iter().map(|&p| p + DVec3::Z * 2.0).collect();
        input.surfaces.push(surface("warped", above));
        assert_eq!(mended(&input), None);
    }

    #[test]
    fn thin_surfaces_and_sheets_that_would_be_one_are_left() {
        let mut thin = angle(1e-7);
        let strip = [
            DVec3::ZERO,
            DVec3::X,
            dvec3(1.0, 1e-6, 0.0),
            dvec3(0.0, 1e-6, 0.0),
        ];
        thin.surfaces
            .push(surface("thin", strip.map(|p| p + DVec3::Z).to_vec()));
        assert_eq!(mended(&thin), None);

        let mut sheets = angle(1e-7);
        let other = sheets.surfaces[0].vertices.iter();
        let other = other.map(|&p| p + DVec3::Z * 5e-8).collect();
        sheets.surfaces.push(surface("sheet", other));
        assert_eq!(mended(&sheets), None);
    }
}
