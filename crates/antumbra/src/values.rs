//! Values at points a user names.

use crate::light::ExactLight;
use antumbra_geom::Control;
use antumbra_scene::{FaceId, Piece, Scene, SurfaceId};
use antumbra_solver::{Radiosity, Solution};
use antumbra_visibility::{Evaluator, Scratch};
use glam::DVec3;

/// Why a point has no value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PointError {
    /// No surface has this name.
    #[error("there is no surface '{0}'")]
    UnknownSurface(String),
    /// The point does not lie on the surface.
    #[error("surface '{surface}': the point ({}, {}, {}) does not lie on it", point.x, point.y, point.z)]
    OffSurface {
        /// The surface.
        surface: String,
        /// The point, file units.
        point: DVec3,
    },
    /// The normal of a free sensor has no length.
    #[error("a free sensor at ({}, {}, {}) needs a normal that is not zero", .0.x, .0.y, .0.z)]
    NoNormal(DVec3),
}

/// A point on a face's front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The face.
    pub face: FaceId,
    /// Scene units.
    pub point: DVec3,
}

/// Finds the face of a surface at a point given in file units.
///
/// # Errors
///
/// [`PointError`] if there is no such surface or the point does not lie on it.
pub fn place(scene: &Scene, surface: &str, point: DVec3) -> Result<Place, PointError> {
    let id: SurfaceId = scene
        .surface_named(surface)
        .ok_or_else(|| PointError::UnknownSurface(surface.to_owned()))?;
    let in_scene = scene.frame.to_scene(point);
    let face = scene
        .face_containing(id, in_scene)
        .ok_or_else(|| PointError::OffSurface {
            surface: surface.to_owned(),
            point,
        })?;
    Ok(Place {
        face,
        point: in_scene,
    })
}

/// Uniform places on faces, by area; always the same for the same scene.
///
/// * `is_wanted` — which faces take part.
#[must_use]
pub fn random_places(scene: &Scene, n: u32, is_wanted: &dyn Fn(FaceId) -> bool) -> Vec<Place> {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut uniform = || {
        // SplitMix64 (Steele, Lea & Flood 2014).
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    // Triangles of the convex pieces, with the areas up to them.
    let mut triangles: Vec<(f64, FaceId, [DVec3; 3])> = Vec::new();
    let mut area = 0.0;
    let is_wanted = |piece: &&Piece| piece.n_faces == 1 && is_wanted(piece.face);
    for piece in scene.pieces.iter().filter(is_wanted) {
        let corners = scene.positions(&piece.vertices);
        for k in 1..corners.len().saturating_sub(1) {
            let [a, b, c] = [corners[0], corners[k], corners[k + 1]];
            area += (b - a).cross(c - a).length() / 2.0;
            triangles.push((area, piece.face, [a, b, c]));
        }
    }
    (0..n)
        .filter_map(|_| {
            let at = uniform() * area;
            let k = triangles.partition_point(|t| t.0 < at);
            let (_, face, [a, b, c]) = triangles.get(k)?;
            let (u, v) = (uniform(), uniform());
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            Some(Place {
                face: *face,
                point: *a + (*b - *a) * u + (*c - *a) * v,
            })
        })
        .collect()
}

/// Exact direct irradiance per band on a surface.
#[must_use]
pub fn exact(light: &ExactLight<'_, '_>, place: &Place, scratch: &mut Scratch) -> Vec<f64> {
    light.at(place.face, place.point, scratch)
}

/// Exact direct irradiance per band at a free sensor; `point` in file units.
///
/// # Errors
///
/// [`PointError::NoNormal`] if the normal has no length.
pub fn exact_free(
    evaluator: &Evaluator<'_>,
    point: DVec3,
    normal: DVec3,
    scratch: &mut Scratch,
) -> Result<Vec<f64>, PointError> {
    let normal = normal.try_normalize().ok_or(PointError::NoNormal(point))?;
    let view = evaluator.free_view(normal);
    let point = evaluator.scene().frame.to_scene(point);
    Ok(evaluator.irradiance(&view, point, None, scratch))
}

/// Interpolated direct irradiance per band; `None` outside the mesh.
#[must_use]
pub fn on_mesh(solution: &Solution, place: &Place) -> Option<Vec<f64>> {
    // Receivers are the faces, in their order.
    let receiver = &solution.receivers[place.face.index()];
    let spot = receiver.locate(receiver.chart.to_chart(place.point))?;
    Some(receiver.direct_at(spot))
}

/// Irradiance with interreflection per band at several places: exact direct light
/// and indirect light gathered with exact visibility from the solution's layer.
///
/// `None` for places that were not reached when it was stopped, and for all if
/// interreflection was not solved ([`Reached`](crate::Reached)).
#[must_use]
pub fn solved(
    light: &ExactLight<'_, '_>,
    evaluator: &Evaluator<'_>,
    solution: &Radiosity,
    places: &[Place],
    control: &Control<'_>,
) -> Vec<Option<Vec<f64>>> {
    let points: Vec<_> = places.iter().map(|p| (p.face.index(), p.point)).collect();
    let indirect = solution.gather(evaluator, &points, control);
    let mut scratch = Scratch::default();
    places
        .iter()
        .zip(indirect)
        .map(|(place, indirect)| {
            let indirect = indirect?;
            let direct = exact(light, place, &mut scratch);
            Some(direct.iter().zip(indirect).map(|(d, i)| d + i).collect())
        })
        .collect()
}
