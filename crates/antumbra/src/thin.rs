//! Faces, and parts of faces, that are too thin for a mesh.
//!
//! The arrangement of a face's curves makes one place of what is nearer than a few of its
//! pixels, so that the border of a thin face folds onto itself. Such a face gets a mesh of
//! its corners alone, which is not refined; its area counts as unresolved. It hides light
//! like any other.

use crate::surroundings::contact_radius;
use antumbra_geom::bounding_box;
use antumbra_mesh::{Folded, folded};
use antumbra_scene::{FaceId, Problem, Scene, Severity, Surface};
use glam::DVec2;
use rayon::prelude::*;

/// What of a face is too thin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Thin {
    /// Scene units.
    pub(crate) area: f64,
    /// Is it all of it?
    pub(crate) is_all: bool,
}

/// Convex pieces wider than this many contact radii do not fold. Smaller, and parts are
/// missed; larger, and arrangements are made without need.
const WIDE: f64 = 4.0;

impl Thin {
    pub(crate) fn of(scene: &Scene, face: FaceId) -> Self {
        let least = WIDE * contact_radius(scene, face);
        let chart = scene.chart(face);
        let pieces = &scene.face(face).pieces;
        let is_wide = scene.pieces[pieces.start as usize..pieces.end as usize]
            .iter()
            .all(|piece| {
                let corners = piece.vertices.iter();
                let corners: Vec<DVec2> = corners
                    .map(|&v| chart.to_chart(scene.position(v)))
                    .collect();
                width(&corners) > least
            });
        if is_wide {
            return Self::default();
        }
        match folded(&scene.loops_in_chart(face, &chart)) {
            Folded::None => Self::default(),
            Folded::Parts(area) => Self {
                area,
                is_all: false,
            },
            Folded::All => Self::all(scene, face),
        }
    }

    /// A face that is too thin as a whole.
    pub(crate) fn all(scene: &Scene, face: FaceId) -> Self {
        Self {
            area: scene.face(face).area,
            is_all: true,
        }
    }
}

/// The least distance of two parallel lines between which a convex polygon lies.
fn width(corners: &[DVec2]) -> f64 {
    let n = corners.len();
    let height = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        let across = (b - a).perp().normalize_or_zero();
        let heights = corners.iter().map(|&c| across.dot(c - a));
        heights.fold(0.0, f64::max)
    };
    (0..n).map(height).fold(f64::INFINITY, f64::min)
}

/// A warning for every surface of which something is too thin for a mesh, in their order.
///
/// What is warned of counts as unresolved when the scene is meshed.
#[must_use]
pub fn thin_surfaces(scene: &Scene) -> Vec<Problem> {
    let found: Vec<Option<Problem>> = scene
        .surfaces
        .par_iter()
        .map(|surface| warning(scene, surface))
        .collect();
    found.into_iter().flatten().collect()
}

fn warning(scene: &Scene, surface: &Surface) -> Option<Problem> {
    let fronts = surface.faces.clone().map(FaceId);
    let fronts = fronts.filter(|&f| !scene.face(f).is_back);
    let thin: Vec<(FaceId, Thin)> = fronts
        .clone()
        .map(|f| (f, Thin::of(scene, f)))
        .filter(|(_, thin)| thin.area > 0.0)
        .collect();
    let &(first, _) = thin.first()?;
    let area: f64 = thin.iter().map(|(_, thin)| thin.area).sum();
    let n_faces = fronts.count();
    let is_all = thin.len() == n_faces && thin.iter().all(|(_, thin)| thin.is_all);
    let unit = scene.length_unit.symbol();
    let allowed = scene.frame.length_to_file(contact_radius(scene, first));
    let in_file = scene.frame.area_to_file(area);
    let (what, found) = if is_all {
        let found = scene.frame.length_to_file(mean_width(scene, &thin));
        (format!("{found:.3e} {unit} wide"), Some(found))
    } else {
        ("too thin in places".to_owned(), None)
    };
    Some(Problem {
        severity: Severity::Warning,
        kind: "thin",
        names: vec![surface.name.clone()],
        found,
        allowed: Some(allowed),
        message: format!(
            "surface '{}': {what}, resolved from {allowed:.3e} {unit} on: \
             {in_file:.3e} {unit}² count as unresolved",
            surface.name
        ),
    })
}

/// The area of thin faces over their lengths.
fn mean_width(scene: &Scene, thin: &[(FaceId, Thin)]) -> f64 {
    let length = |face: FaceId| {
        let loops = scene.loops_in_chart(face, &scene.chart(face));
        let [min, max] = bounding_box(loops.iter().flatten().copied());
        (max - min).length()
    };
    let area: f64 = thin.iter().map(|(_, thin)| thin.area).sum();
    area / thin.iter().map(|&(face, _)| length(face)).sum::<f64>()
}
