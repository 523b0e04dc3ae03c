//! Surfaces that face the wrong way.
//!
//! A closed surface that faces one way runs through every shared stretch once in each
//! direction. Where two of its faces run the same way, one of them is turned: so all faces
//! that hang together by stretches of two get a sign, and if both signs are there, those of
//! one sign are flipped. Which: if other surfaces lie within, it is a room, and those that
//! face outwards; else those with less area.
//!
//! Only what surrounds something is asked, as in rooms that are open: plates that share an
//! edge may face as they like. So may two-sided surfaces. Where three surfaces or more end
//! in a stretch it tells nothing.

use super::joints::{Component, Joints, Shell};
use super::{MOSTLY_JOINED, SURROUNDING};
use crate::build::listed;
use crate::bvh::Aabb;
use crate::problem::{Problem, Severity};
use crate::scene::SurfaceId;
use glam::DVec3;

/// What is thinner than this many plane tolerances surrounds nothing: sheets back to back.
const THIN: f64 = 1e3;
/// So many other surfaces are asked at most whether they lie within.
const ASKED: usize = 64;

/// A finding for every shell of a component in which surfaces are flipped.
pub(super) fn find(joints: &Joints<'_>, component: &Component) -> Vec<Problem> {
    let shells = joints.shells(component);
    let is_mixed = |shell: &&Shell| {
        let has = |s: f64| shell.faces.iter().any(|&(_, sign)| sign * s > 0.0);
        shell.is_orientable && has(1.0) && has(-1.0)
    };
    let mixed: Vec<&Shell> = shells.iter().filter(is_mixed).collect();
    if mixed.is_empty() || !surrounds(joints, component, &shells) {
        return Vec::new();
    }
    let flipped = mixed.into_iter().filter_map(|shell| flipped(joints, shell));
    flipped
        .map(|(surfaces, n)| problem(joints, &surfaces, n))
        .collect()
}

/// Is it closed, or does it lack a side at most?
fn surrounds(joints: &Joints<'_>, component: &Component, shells: &[Shell]) -> bool {
    let (mut whole, mut gap) = (0.0, 0.0);
    for stretch in joints.of(component) {
        whole += joints.length(stretch);
        if joints.ends_free(stretch).is_some() {
            let free = joints.free(stretch).iter();
            gap += free.map(|[a, b]| a.distance(*b)).sum::<f64>();
        }
    }
    gap < MOSTLY_JOINED * whole && joints.area_vectors(shells) < SURROUNDING
}

/// The flipped surfaces of a shell, ascending, and of how many.
fn flipped(joints: &Joints<'_>, shell: &Shell) -> Option<(Vec<SurfaceId>, usize)> {
    let scene = joints.scene;
    let face = |f: u32| &scene.faces[f as usize];
    let corners = shell.faces.iter().flat_map(|&(f, _)| &face(f).outline);
    let bounds = Aabb::of(corners.map(|&v| scene.position(v)));
    let centre = bounds.min.midpoint(bounds.max);
    // Positive if faces of positive sign face outwards.
    let (mut volume, mut area) = (0.0, [0.0; 2]);
    let is_two_sided = |f: u32| scene.material(crate::scene::FaceId(f)).two_sided;
    for &(f, sign) in &shell.faces {
        let plane = &scene.planes[face(f).plane.index()];
        volume += sign * face(f).area * face(f).normal.dot(plane.point - centre) / 3.0;
        if !is_two_sided(f) {
            area[usize::from(sign < 0.0)] += face(f).area;
        }
    }
    let whole: f64 = shell.faces.iter().map(|&(f, _)| face(f).area).sum();
    if area.contains(&0.0) || f64::abs(volume) <= THIN * scene.plane_tolerance() * whole {
        return None;
    }
    let wrong = if encloses(joints, shell, &bounds) {
        volume.signum()
    } else if area[0] < area[1] {
        1.0
    } else {
        -1.0
    };
    let all = shell.faces.iter().map(|&(f, _)| face(f).surface);
    let turned = shell
        .faces
        .iter()
        .filter(|&&(f, sign)| sign * wrong > 0.0 && !is_two_sided(f));
    let sorted = |mut surfaces: Vec<SurfaceId>| {
        surfaces.sort_unstable();
        surfaces.dedup();
        surfaces
    };
    let turned = sorted(turned.map(|&(f, _)| face(f).surface).collect());
    Some((turned, sorted(all.collect()).len()))
}

/// Does a surface that is no part of it lie within a shell?
fn encloses(joints: &Joints<'_>, shell: &Shell, bounds: &Aabb) -> bool {
    let scene = joints.scene;
    let mut own: Vec<SurfaceId> = Vec::with_capacity(shell.faces.len());
    own.extend(
        shell
            .faces
            .iter()
            .map(|&(f, _)| scene.faces[f as usize].surface),
    );
    own.sort_unstable();
    let others = (0..scene.surfaces.len() as u32).map(SurfaceId);
    let others = others.filter(|s| own.binary_search(s).is_err());
    let middles = others.filter_map(|s| {
        let first = scene.surfaces[s.index()].faces.clone().next()?;
        let corners = scene.positions(&scene.faces[first as usize].outline);
        Some(corners.iter().sum::<DVec3>() / corners.len() as f64)
    });
    let near = middles.filter(|&p| bounds.meets(&Aabb { min: p, max: p }));
    near.take(ASKED).any(|p| is_within(joints, shell, p))
}

/// Does a shell, turned one way, fill more than half of what is seen from a point?
fn is_within(joints: &Joints<'_>, shell: &Shell, point: DVec3) -> bool {
    let scene = joints.scene;
    let mut solid_angle = 0.0;
    for &(f, sign) in &shell.faces {
        let pieces = scene.faces[f as usize].pieces.clone();
        for piece in &scene.pieces[pieces.start as usize..pieces.end as usize] {
            let corners = scene.positions(&piece.vertices);
            for pair in corners[1..].windows(2) {
                let triangle = [corners[0], pair[0], pair[1]].map(|p| p - point);
                solid_angle += sign * seen(triangle);
            }
        }
    }
    f64::abs(solid_angle) > 2.0 * std::f64::consts::PI
}

/// The solid angle of a triangle from the origin, signed.
///
/// # Source
///
/// Van Oosterom and Strackee 1983.
fn seen([a, b, c]: [DVec3; 3]) -> f64 {
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let above = a.dot(b.cross(c));
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * above.atan2(below)
}

fn problem(joints: &Joints<'_>, flipped: &[SurfaceId], n: usize) -> Problem {
    let name = |s: &SurfaceId| joints.scene.surfaces[s.index()].name.clone();
    let names: Vec<String> = flipped.iter().map(name).collect();
    let (noun, verb) = match names.len() {
        1 => ("surface", "faces"),
        _ => ("surfaces", "face"),
    };
    let message = format!(
        "{noun} {}: flipped: {} of the {n} surfaces that bound one space together {verb} the other way (allowed 0)",
        listed(&names),
        names.len()
    );
    Problem {
        severity: Severity::Warning,
        kind: "flipped",
        found: Some(names.len() as f64),
        allowed: Some(0.0),
        message,
        names,
    }
}
