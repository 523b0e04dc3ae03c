//! Corners moved onto the planes of their surfaces.
//!
//! A surface is plane if its corners are within 1e-9 of its size of one plane
//! ([`super::outline`]), and from there on the plane stands for it. A wall seen along its
//! plane then hides by its plane in one place and by its edges in another, and between the
//! two light of that size comes in. So corners move onto the planes of the surfaces that
//! they belong to: three planes, as at the corner of a room, have a point in common.

use super::outline::Polygon;
use crate::scene::Scene;
use antumbra_geom::{DVec3, Plane, newell_normal, settled};
use std::collections::{BTreeMap, BTreeSet};

/// No corner moves farther than so many times what the worst surface at it deviates.
const FARTHEST: f64 = 16.0;

/// A plane perpendicular to an axis is taken before one that is tilted by the deviation,
/// if it holds the corners to so many times of that: coordinates of the file stay.
const STRAIGHT: f64 = 8.0;

/// Moves corners of surfaces that are not plane to rounding onto their planes.
///
/// Where more than three planes meet in a corner, not all can be had: the largest come
/// first, and what is left off its plane is so by no more than before.
pub(super) fn onto_planes(vertices: &mut [DVec3], polygons: &mut [Vec<Polygon>], extent: f64) {
    // A turned scene's corners are no better.
    let in_place = Scene::ROUNDING * extent;
    let mut order: Vec<&mut Polygon> = polygons.iter_mut().flatten().collect();
    order.sort_by(|a, b| b.area.total_cmp(&a.area));

    // What is to be moved, and how far it may.
    let mut farthest: BTreeMap<u32, f64> = BTreeMap::new();
    for polygon in order.iter_mut().filter(|p| needs_a_plane(p)) {
        let deviation = deviation(&plane(polygon, vertices), polygon, vertices);
        if deviation <= in_place {
            continue;
        }
        straighten(polygon, vertices, STRAIGHT * deviation);
        for &v in polygon.corners() {
            let most = farthest.entry(v).or_default();
            *most = most.max(FARTHEST * deviation);
        }
    }
    if farthest.is_empty() {
        return;
    }
    let mut planes_at: BTreeMap<u32, Vec<Plane>> = BTreeMap::new();
    for polygon in order.iter().filter(|p| needs_a_plane(p)) {
        let plane = plane(polygon, vertices);
        for v in polygon.corners().filter(|v| farthest.contains_key(v)) {
            planes_at.entry(*v).or_default().push(plane);
        }
    }
    let mut moved: BTreeSet<u32> = BTreeSet::new();
    let mut positions = vertices.to_vec();
    for (v, planes) in planes_at {
        let from = vertices[v as usize];
        let worst = |p: DVec3| {
            let heights = planes.iter().map(|plane| plane.height(p).abs());
            heights.fold(0.0, f64::max)
        };
        let to = settled(from, &planes, farthest[&v]);
        if worst(from) > in_place && worst(to) < worst(from) {
            positions[v as usize] = to;
            moved.insert(v);
        }
    }
    vertices.copy_from_slice(&positions);
    for polygon in order {
        if !needs_a_plane(polygon) && polygon.corners().any(|v| moved.contains(v)) {
            let corners: Vec<DVec3> = polygon
                .outline
                .iter()
                .map(|&v| vertices[v as usize])
                .collect();
            let newell = newell_normal(&corners);
            polygon.normal = newell / newell.length() + DVec3::ZERO;
        }
    }
}

/// Three corners always have one.
fn needs_a_plane(polygon: &Polygon) -> bool {
    polygon.corners().count() > 3
}

fn plane(polygon: &Polygon, vertices: &[DVec3]) -> Plane {
    Plane {
        normal: polygon.normal,
        point: vertices[polygon.point as usize],
    }
}

fn deviation(plane: &Plane, polygon: &Polygon, vertices: &[DVec3]) -> f64 {
    polygon
        .corners()
        .map(|&v| plane.height(vertices[v as usize]).abs())
        .fold(0.0, f64::max)
}

/// Turns the plane to that perpendicular to an axis if this holds all corners as well.
fn straighten(polygon: &mut Polygon, vertices: &[DVec3], allowed: f64) {
    let axis = polygon.normal.abs().max_position();
    let straight = Plane {
        normal: DVec3::AXES[axis] * polygon.normal[axis].signum(),
        point: vertices[polygon.point as usize],
    };
    if deviation(&straight, polygon, vertices) <= allowed {
        polygon.normal = straight.normal + DVec3::ZERO;
    }
}
