//! The border of a patch: loops of vertices, and whether they are simple.

use super::patch::edges_of;
use antumbra_geom::{DVec2, bounding_box, point_in_polygon, segments_cross, signed_area};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The loops around what `outlines` cover together: the outline first, then the
/// holes by their lowest vertex. The patch lies on their left.
///
/// `None` if an edge is passed twice in one direction, or if there is not exactly
/// one outline.
pub(super) fn loops<'a>(
    outlines: impl Iterator<Item = &'a [u32]>,
    flat: impl Fn(u32) -> DVec2,
) -> Option<Vec<Vec<u32>>> {
    // Edges that are passed in both directions are inside.
    let mut passes: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for [a, b] in outlines.flat_map(edges_of) {
        *passes.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
    }
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for ([a, b], n) in passes {
        match n {
            0 => {}
            1 => edges.push([a, b]),
            -1 => edges.push([b, a]),
            _ => return None,
        }
    }
    edges.sort_unstable();

    let mut is_used = vec![false; edges.len()];
    let mut loops = Vec::new();
    for first in 0..edges.len() {
        if is_used[first] {
            continue;
        }
        let mut corners = Vec::new();
        let mut e = first;
        while !is_used[e] {
            is_used[e] = true;
            corners.push(edges[e][0]);
            e = following(&edges, e, &flat)?;
        }
        if e != first {
            return None;
        }
        loops.push(corners);
    }
    let area = |corners: &[u32]| signed_area(&corners.iter().map(|&v| flat(v)).collect::<Vec<_>>());
    let mut outlines = (0..loops.len()).filter(|&i| area(&loops[i]) > 0.0);
    let outline = outlines.next()?;
    if outlines.next().is_some() {
        return None;
    }
    loops.swap(0, outline);
    loops[1..].sort_by_key(|hole| hole.iter().min().copied());
    Some(loops)
}

/// The edge after `e`. Where several leave a vertex it is the one with the most
/// turn to the right: it bounds the same part of the outside, so that a hole that
/// touches the outline in a vertex stays a loop of its own.
fn following(edges: &[[u32; 2]], e: usize, flat: &impl Fn(u32) -> DVec2) -> Option<usize> {
    let [from, at] = edges[e];
    let start = edges.partition_point(|edge| edge[0] < at);
    let n = edges[start..].partition_point(|edge| edge[0] == at);
    if n < 2 {
        return (n == 1).then_some(start);
    }
    let back = flat(from) - flat(at);
    let turn = |i: usize| {
        let ahead = flat(edges[i][1]) - flat(at);
        let angle = back.angle_to(ahead).rem_euclid(TAU);
        if angle == 0.0 { TAU } else { angle }
    };
    (start..start + n).min_by(|&i, &j| turn(i).total_cmp(&turn(j)))
}

/// Is it one outline, counter-clockwise, with clockwise holes inside it and apart,
/// none of which crosses itself or another? They may touch in vertices.
pub(super) fn is_simple(loops: &[Vec<u32>], flat: impl Fn(u32) -> DVec2) -> bool {
    let places: Vec<Vec<DVec2>> = loops
        .iter()
        .map(|corners| corners.iter().map(|&v| flat(v)).collect())
        .collect();
    let Some((outline, holes)) = places.split_first() else {
        return false;
    };
    loops.iter().all(|corners| has_no_repeats(corners))
        && signed_area(outline) > 0.0
        && holes.iter().all(|hole| signed_area(hole) < 0.0)
        && !any_crossing(&places)
        && holes.iter().enumerate().all(|(k, hole)| {
            // No loop crosses another: one point decides.
            let point = hole[0].midpoint(hole[1]);
            let within = |other: &Vec<DVec2>| point_in_polygon(point, [other.as_slice()]);
            within(outline)
                && (0..holes.len()).all(|other| {
                    other == k || !box_holds(&holes[other], point) || !within(&holes[other])
                })
        })
}

fn has_no_repeats(corners: &[u32]) -> bool {
    let mut sorted = corners.to_vec();
    sorted.sort_unstable();
    corners.len() > 2 && sorted.windows(2).all(|pair| pair[0] != pair[1])
}

fn box_holds(corners: &[DVec2], point: DVec2) -> bool {
    let [low, high] = bounding_box(corners.iter().copied());
    low.cmple(point).all() && point.cmple(high).all()
}

/// Sweeps along x.
fn any_crossing(loops: &[Vec<DVec2>]) -> bool {
    let mut segments: Vec<[DVec2; 2]> = loops
        .iter()
        .flat_map(|corners| {
            (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]])
        })
        .collect();
    let low = |[a, b]: &[DVec2; 2]| a.min(*b);
    let high = |[a, b]: &[DVec2; 2]| a.max(*b);
    segments.sort_by(|s, t| low(s).x.total_cmp(&low(t).x));
    segments.iter().enumerate().any(|(i, s)| {
        segments[i + 1..]
            .iter()
            .take_while(|t| low(t).x <= high(s).x)
            .filter(|t| low(t).y <= high(s).y && low(s).y <= high(t).y)
            .any(|t| segments_cross(s[0], s[1], t[0], t[1]))
    })
}
