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
use crate::bvh::{Aabb, BoxTree};
use crate::problem::{Problem, Severity};
use crate::scene::{FaceId, Scene, SurfaceId};
use glam::DVec3;
use std::cell::OnceCell;
use std::collections::BTreeSet;

/// So many other surfaces are asked at most whether they lie within.
const ASKED: usize = 64;

/// Where the surfaces of a scene are: the middles of their corners.
#[derive(Default)]
pub(super) struct Middles {
    places: OnceCell<(Vec<(u32, Aabb)>, BoxTree)>,
}

impl Middles {
    /// The surfaces with their middles in a box, ascending, and those middles.
    fn within(&self, scene: &Scene, bounds: &Aabb) -> Vec<(SurfaceId, DVec3)> {
        let (boxes, tree) = self.places.get_or_init(|| {
            let middle = |s: usize| {
                let first = scene.surfaces[s].faces.clone().next()?;
                let corners = scene.positions(&scene.faces[first as usize].outline);
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                Some((s as u32, Aabb::of([middle])))
            };
            let boxes: Vec<_> = (0..scene.surfaces.len()).filter_map(middle).collect();
            let tree = BoxTree::new(&boxes);
            (boxes, tree)
        });
        let mut found = Vec::new();
        tree.visit(|node| node.meets(bounds), |s| found.push(s));
        found.sort_unstable();
        let place = |s: u32| {
            let i = boxes.binary_search_by_key(&s, |(s, _)| *s).ok()?;
            let middle = boxes[i].1;
            middle.meets(bounds).then_some((SurfaceId(s), middle.min))
        };
        found.into_iter().filter_map(place).collect()
    }
}

/// A finding for every shell of a component in which surfaces are flipped.
pub(super) fn find(joints: &Joints<'_>, middles: &Middles, component: &Component) -> Vec<Problem> {
    let shells = joints.shells(component);
    let is_mixed = |shell: &&Shell| {
        let has = |s: f64| shell.faces.iter().any(|&(_, sign)| sign * s > 0.0);
        shell.is_orientable && has(1.0) && has(-1.0)
    };
    let mixed: Vec<&Shell> = shells.iter().filter(is_mixed).collect();
    if mixed.is_empty() || !surrounds(joints, component, &shells) {
        return Vec::new();
    }
    let flipped = mixed
        .into_iter()
        .filter_map(|shell| flipped(joints, middles, shell));
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
fn flipped(
    joints: &Joints<'_>,
    middles: &Middles,
    shell: &Shell,
) -> Option<(Vec<SurfaceId>, usize)> {
    let scene = joints.scene;
    let face = |f: u32| &scene.faces[f as usize];
    let corners = shell.faces.iter().flat_map(|&(f, _)| &face(f).outline);
    let bounds = Aabb::of(corners.map(|&v| scene.position(v)));
    let centre = bounds.min.midpoint(bounds.max);
    // Positive if faces of positive sign face outwards.
    let (mut volume, mut area) = (0.0, [0.0; 2]);
    let is_two_sided = |f: u32| scene.material(FaceId(f)).two_sided;
    for &(f, sign) in &shell.faces {
        let plane = &scene.planes[face(f).plane.index()];
        volume += sign * face(f).area * face(f).normal.dot(plane.point - centre) / 3.0;
        if !is_two_sided(f) {
            area[usize::from(sign < 0.0)] += face(f).area;
        }
    }
    let whole: f64 = shell.faces.iter().map(|&(f, _)| face(f).area).sum();
    // What is thinner than corners are joined surrounds nothing: sheets back to back.
    if area.contains(&0.0) || f64::abs(volume) <= joints.tolerance * whole {
        return None;
    }
    let wrong = if encloses(joints, middles, shell, &bounds) {
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
fn encloses(joints: &Joints<'_>, middles: &Middles, shell: &Shell, bounds: &Aabb) -> bool {
    let scene = joints.scene;
    let own = shell.faces.iter();
    let own: BTreeSet<SurfaceId> = own.map(|&(f, _)| scene.faces[f as usize].surface).collect();
    let near = middles.within(scene, bounds).into_iter();
    let others = near.filter(|(s, _)| !own.contains(s)).take(ASKED);
    others.into_iter().any(|(_, p)| is_within(joints, shell, p))
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
