//! Faces that cover each other in one plane and face the same way.

use super::{Findings, Units};
use crate::bvh::{Aabb, BoxTree};
use crate::problem::{Problem, Severity};
use crate::scene::{FaceId, Scene, SurfaceId, VertexId};
use antumbra_geom::{DVec2, Stop, bounding_box, signed_area};
use std::collections::BTreeMap;

/// Overlaps smaller than this part of the smaller face are rounding.
const ALLOWED: f64 = 1e-9;

/// What two surfaces have in common.
struct Overlap {
    /// Scene units.
    area: f64,
    /// Do two faces have the very same corners?
    is_duplicate: bool,
}

/// Reports overlaps: of two emitters an error, else a warning.
pub(super) fn check(scene: &Scene, findings: &mut Findings, stop: Stop<'_>) {
    let mut groups: BTreeMap<(u32, bool), Vec<FaceId>> = BTreeMap::new();
    // What is covered has no light to count twice.
    for f in scene.face_ids().filter(|&f| !scene.face(f).is_covered) {
        let face = scene.face(f);
        groups
            .entry((face.plane.0, face.along_plane))
            .or_default()
            .push(f);
    }
    let mut overlaps: BTreeMap<(SurfaceId, SurfaceId), Overlap> = BTreeMap::new();
    for faces in groups.values().filter(|faces| faces.len() > 1) {
        overlaps_in(scene, faces, &mut overlaps, stop);
    }
    let units = Units {
        frame: scene.frame,
        unit: scene.length_unit,
    };
    for ((a, b), overlap) in overlaps {
        report(scene, [a, b], &overlap, &units, findings);
    }
}

fn overlaps_in(
    scene: &Scene,
    faces: &[FaceId],
    overlaps: &mut BTreeMap<(SurfaceId, SurfaceId), Overlap>,
    stop: Stop<'_>,
) {
    let chart = scene.chart(faces[0]);
    let flat = |corners: &[VertexId]| -> Vec<DVec2> {
        corners
            .iter()
            .map(|&v| chart.to_chart(scene.position(v)))
            .collect()
    };
    let boxes: Vec<(u32, Aabb)> = faces
        .iter()
        .enumerate()
        .map(|(i, &f)| {
            let corners = flat(&scene.face(f).outline);
            (i as u32, Aabb::of(corners.iter().map(|p| p.extend(0.0))))
        })
        .collect();
    let pieces: Vec<Vec<Vec<DVec2>>> = faces
        .iter()
        .map(|&f| {
            let range = scene.face(f).pieces.clone();
            scene.pieces[range.start as usize..range.end as usize]
                .iter()
                .map(|piece| flat(&piece.vertices))
                .collect()
        })
        .collect();
    let (firsts, copies) = copies(scene, faces);
    for [i, j] in copies {
        let [a, b] = [faces[i], faces[j]].map(|f| scene.face(f));
        add(overlaps, [a.surface, b.surface], b.area, true);
    }
    let boxes: Vec<(u32, Aabb)> = firsts.iter().map(|&i| boxes[i]).collect();
    let tree = BoxTree::new(&boxes);
    let box_of = |i: usize| boxes[firsts.partition_point(|&first| first < i)].1;
    for (i, query) in &boxes {
        if stop.is_wanted() {
            return;
        }
        let mut near = Vec::new();
        tree.visit(|b| b.meets(query), |j| near.push(j));
        near.sort_unstable();
        for j in near.into_iter().filter(|j| j > i) {
            let (i, j) = (*i as usize, j as usize);
            let [a, b] = [faces[i], faces[j]].map(|f| scene.face(f));
            if a.surface == b.surface || !box_of(j).meets(query) {
                continue;
            }
            let areas = [a, b].map(|face| face.area);
            let both = [pieces[i].as_slice(), pieces[j].as_slice()];
            if let Some(area) = overlap_area(both, areas, scene.plane_tolerance()) {
                let is_duplicate = same_corners(scene, faces[i], faces[j]);
                add(overlaps, [a.surface, b.surface], area, is_duplicate);
            }
        }
    }
}

/// What two polygons of one plane have in common, if that is more than rounding.
///
/// * `pieces` — the convex pieces of each in a common chart, counter-clockwise.
/// * `tolerance` — polygons that reach this far into each other only touch.
pub(super) fn overlap_area(
    pieces: [&[Vec<DVec2>]; 2],
    areas: [f64; 2],
    tolerance: f64,
) -> Option<f64> {
    let [first, second] = pieces;
    let pairs = first
        .iter()
        .flat_map(|p| second.iter().map(move |q| (p, q)));
    let area: f64 = pairs.map(|(p, q)| common_area(p, q)).sum();
    let [length, other] = pieces.map(|pieces| {
        let [min, max] = bounding_box(pieces.iter().flatten().copied());
        min.distance(max)
    });
    let is_more = area > ALLOWED * areas[0].min(areas[1]) && area > tolerance * length.min(other);
    is_more.then_some(area)
}

/// The faces that are no copies of earlier ones, ascending; and the copies, each with the
/// first that has its corners. So many copies in one place are as many findings, and not as
/// many as there are pairs. Those that emit are apart, for two of them are an error.
fn copies(scene: &Scene, faces: &[FaceId]) -> (Vec<usize>, Vec<[usize; 2]>) {
    let mut first_with: BTreeMap<(Vec<VertexId>, bool), usize> = BTreeMap::new();
    let (mut firsts, mut copies) = (Vec::new(), Vec::new());
    for (j, &f) in faces.iter().enumerate() {
        let key = (sorted_corners(scene, f), scene.material(f).is_emitter());
        let i = *first_with.entry(key).or_insert(j);
        if i == j || scene.face(faces[i]).surface == scene.face(f).surface {
            firsts.push(j);
        } else {
            copies.push([i, j]);
        }
    }
    (firsts, copies)
}

/// Adds what two surfaces have in common.
fn add(
    overlaps: &mut BTreeMap<(SurfaceId, SurfaceId), Overlap>,
    [a, b]: [SurfaceId; 2],
    area: f64,
    is_duplicate: bool,
) {
    let entry = overlaps.entry((a.min(b), a.max(b))).or_insert(Overlap {
        area: 0.0,
        is_duplicate: false,
    });
    entry.area += area;
    entry.is_duplicate |= is_duplicate;
}

fn sorted_corners(scene: &Scene, face: FaceId) -> Vec<VertexId> {
    let mut ids: Vec<VertexId> = scene.face(face).loops().flatten().copied().collect();
    ids.sort_unstable();
    ids
}

/// Have both faces the same corners?
fn same_corners(scene: &Scene, a: FaceId, b: FaceId) -> bool {
    sorted_corners(scene, a) == sorted_corners(scene, b)
}

/// The area of the intersection of two convex outlines, both counter-clockwise.
///
/// # Source
///
/// Sutherland and Hodgman 1974.
fn common_area(subject: &[DVec2], clip: &[DVec2]) -> f64 {
    let mut corners = subject.to_vec();
    for (i, &a) in clip.iter().enumerate() {
        let along = clip[(i + 1) % clip.len()] - a;
        let height = |p: DVec2| along.perp_dot(p - a);
        let mut kept = Vec::with_capacity(corners.len() + 1);
        for (k, &p) in corners.iter().enumerate() {
            let q = corners[(k + 1) % corners.len()];
            let (hp, hq) = (height(p), height(q));
            if hp >= 0.0 {
                kept.push(p);
            }
            if (hp > 0.0 && hq < 0.0) || (hp < 0.0 && hq > 0.0) {
                kept.push(p + (q - p) * (hp / (hp - hq)));
            }
        }
        corners = kept;
        if corners.len() < 3 {
            return 0.0;
        }
    }
    signed_area(&corners).max(0.0)
}

fn report(
    scene: &Scene,
    surfaces: [SurfaceId; 2],
    overlap: &Overlap,
    units: &Units,
    findings: &mut Findings,
) {
    let [a, b] = surfaces.map(|s| &scene.surfaces[s.index()]);
    let emits = |m: crate::scene::MaterialId| scene.materials[m.index()].is_emitter();
    let are_emitters = emits(a.material) && emits(b.material);
    let area = units.area(overlap.area);
    let (severity, kind, message) = if are_emitters {
        (
            Severity::Error,
            "overlap",
            format!(
                "surface '{}': overlaps '{}' in one plane, {area} in common, and both emit (allowed 0)",
                a.name, b.name
            ),
        )
    } else if overlap.is_duplicate {
        (
            Severity::Warning,
            "duplicate",
            format!(
                "surface '{}': duplicate of '{}', {area} in common (allowed 0)",
                b.name, a.name
            ),
        )
    } else {
        (
            Severity::Warning,
            "overlap",
            format!(
                "surface '{}': overlaps '{}' in one plane, {area} in common (allowed 0)",
                b.name, a.name
            ),
        )
    };
    let names = vec![a.name.clone(), b.name.clone()];
    let place = Findings::surface(surfaces[if are_emitters { 0 } else { 1 }].index());
    findings.push(
        place,
        Problem {
            severity,
            kind,
            names,
            found: Some(scene.frame.area_to_file(overlap.area)),
            allowed: Some(0.0),
            message,
        },
    );
}
