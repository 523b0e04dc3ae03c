//! Corners moved onto the planes of their surfaces.
//!
//! A surface is plane if its corners are within 1e-9 of its size of one plane
//! ([`super::outline`]), and from there on the plane stands for it. A wall seen along its
//! plane then hides by its plane in one place and by its edges in another, and between the
//! two light of that size comes in. So corners move onto the planes of the surfaces that
//! they belong to: three planes, as at the corner of a room, have a point in common.

use super::outline::{Polygon, width};
use crate::scene::Scene;
use antumbra_geom::{DVec3, Plane, coarse_order, newell_normal, settled};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

/// No corner moves farther than so many times what the worst surface at it deviates: what
/// it stands on without being a corner of it stays in touch.
const FARTHEST: f64 = 4.0;

/// Nor by more than this part of the thinnest surface and the shortest edge at it, which
/// would turn over.
const THINNEST: f64 = 1e-3;

/// A plane perpendicular to an axis is taken before one that is tilted by the deviation,
/// if it holds the corners to so many times of that: coordinates of the file stay. So is
/// that of a neighbour, for parts of one wall are to stay in one plane.
const STRAIGHT: f64 = 4.0;

/// So many fans are tried where a piece is split into triangles, the best of which is taken.
const MOST_FANS: usize = 64;

/// Moves corners of surfaces that are not plane to rounding onto their planes.
///
/// A corner moves if it leaves no plane that it was on and comes nearer to the others. Where
/// more than three planes meet, not all can be had, and it may have to stay.
///
/// What is not plane to rounding then is split into triangles. Returns where: the surface,
/// how far a corner was off, and into how many.
pub(super) fn onto_planes(
    vertices: &mut [DVec3],
    polygons: &mut [Vec<Polygon>],
    extent: f64,
) -> Vec<(usize, f64, usize)> {
    // A turned scene's corners are no better.
    let in_place = Scene::ROUNDING * extent;
    let mut order: Vec<&mut Polygon> = polygons.iter_mut().flatten().collect();
    // Those in place first, they do not move; then by size, and equally large ones by their
    // direction: the order of the file does not matter.
    let is_in_place = |p: &Polygon| {
        let plane = p.plane(vertices);
        deviation(&plane, p, vertices) <= in_place
    };
    order.sort_by(|a, b| {
        let place = |p: &Polygon| coarse_order(p.area, extent * extent);
        let turned = (0..3).map(|k| a.normal[k].total_cmp(&b.normal[k]));
        is_in_place(b)
            .cmp(&is_in_place(a))
            .then(place(b).cmp(&place(a)))
            .then(turned.fold(Ordering::Equal, Ordering::then))
    });

    // The plane of each, what is to be moved, and how far it may.
    let mut planes: Vec<Plane> = Vec::with_capacity(order.len());
    let mut deviations: Vec<f64> = Vec::with_capacity(order.len());
    let mut polygons_at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    let mut farthest: BTreeMap<u32, f64> = BTreeMap::new();
    for (i, polygon) in order.iter().enumerate() {
        let own = polygon.plane(vertices);
        let tilted = deviation(&own, polygon, vertices);
        let is_off = needs_a_plane(polygon) && tilted > in_place;
        let plane = if is_off {
            let known = polygon
                .corners()
                .filter_map(|v| polygons_at.get(v))
                .flatten();
            let mut is_asked = BTreeSet::new();
            let shared = known
                .filter(|&&k| is_asked.insert(k))
                .map(|&k| (planes[k], tilted.max(deviations[k])))
                .find(|(plane, most)| holds(plane, polygon, vertices, STRAIGHT * most))
                .map(|(plane, _)| plane);
            shared
                .or_else(|| straight(&own, polygon, vertices, STRAIGHT * tilted))
                .unwrap_or(own)
        } else {
            own
        };
        // Triangles have a plane wherever their corners go, but a floor of two is to stay
        // one plane.
        if needs_a_plane(polygon) || is_axis(polygon.normal) {
            for &v in polygon.corners() {
                polygons_at.entry(v).or_default().push(i);
            }
        }
        let off = deviation(&plane, polygon, vertices);
        if is_off {
            for &v in polygon.corners() {
                let most = farthest.entry(v).or_default();
                *most = most.max(FARTHEST * off);
            }
        }
        planes.push(plane);
        deviations.push(off);
    }
    if farthest.is_empty() {
        return Vec::new();
    }
    for polygon in &order {
        for (v, edge) in shortest_edges(polygon, vertices) {
            if let Some(most) = farthest.get_mut(&v) {
                *most = most.min(THINNEST * polygon.width.min(edge));
            }
        }
    }
    let mut moved: BTreeMap<u32, DVec3> = BTreeMap::new();
    for (&v, &most) in &farthest {
        let from = vertices[v as usize];
        let at = polygons_at.get(&v).into_iter().flatten();
        let planes: Vec<Plane> = at.map(|&i| planes[i]).collect();
        let heights = |p: DVec3| planes.iter().map(move |plane| plane.distance(p).abs());
        let worst = |p: DVec3| heights(p).fold(0.0, f64::max);
        let to = settled(from, &planes, most);
        let leaves_none = heights(from)
            .zip(heights(to))
            .all(|(before, after)| after <= before.max(in_place));
        if leaves_none && worst(from) > in_place && worst(to) < worst(from) {
            moved.insert(v, to);
        }
    }
    for (&v, &to) in &moved {
        vertices[v as usize] = to;
    }
    for (polygon, plane) in order.into_iter().zip(planes) {
        let own = polygon.plane(vertices);
        if deviation(&plane, polygon, vertices) < deviation(&own, polygon, vertices) {
            polygon.normal = plane.normal * plane.normal.dot(own.normal).signum() + DVec3::ZERO;
        }
        if !polygon.corners().any(|v| moved.contains_key(v)) {
            continue;
        }
        if needs_a_plane(polygon) {
            let pieces = std::mem::take(&mut polygon.pieces);
            for piece in pieces {
                push_convex(piece, polygon.normal, vertices, &mut polygon.pieces);
            }
        } else {
            let corners: Vec<DVec3> = polygon
                .outline
                .iter()
                .map(|&v| vertices[v as usize])
                .collect();
            let newell = newell_normal(&corners);
            polygon.normal = newell / newell.length() + DVec3::ZERO;
        }
    }

    let mut split = Vec::new();
    for (surface, parts) in polygons.iter_mut().enumerate() {
        let off = |polygon: &Polygon| {
            let plane = polygon.plane(vertices);
            deviation(&plane, polygon, vertices)
        };
        let most = parts
            .iter()
            .filter(|p| needs_a_plane(p))
            .map(off)
            .fold(0.0, f64::max);
        if most <= in_place {
            continue;
        }
        let whole = std::mem::take(parts);
        for polygon in whole {
            if needs_a_plane(&polygon) && off(&polygon) > in_place {
                parts.extend(triangles(&polygon, vertices, extent));
            } else {
                parts.push(polygon);
            }
        }
        split.push((surface, most, parts.len()));
    }
    split
}

/// The triangles of a polygon's convex pieces, but for those without an area.
fn triangles(polygon: &Polygon, vertices: &[DVec3], extent: f64) -> Vec<Polygon> {
    let corners_of = |triangle: &[u32; 3]| triangle.map(|v| vertices[v as usize]);
    let fan = |piece: &[u32], apex: usize| -> Vec<[u32; 3]> {
        let n = piece.len();
        let at = |k: usize| piece[(apex + k) % n];
        (1..n - 1).map(|k| [at(0), at(k), at(k + 1)]).collect()
    };
    let thinnest = |of: &[[u32; 3]]| {
        of.iter()
            .map(|triangle| width(&corners_of(triangle)))
            .fold(f64::INFINITY, f64::min)
    };
    let best = |piece: &Vec<u32>| -> Vec<[u32; 3]> {
        (0..piece.len())
            .step_by(piece.len().div_ceil(MOST_FANS))
            .map(|apex| fan(piece, apex))
            .max_by(|a, b| thinnest(a).total_cmp(&thinnest(b)))
            .unwrap_or_default()
    };
    polygon
        .pieces
        .iter()
        .flat_map(best)
        .filter_map(|triangle| Polygon::triangle(triangle, vertices, extent))
        .collect()
}

/// The piece, cut where a corner that hardly stood out stands in now.
fn push_convex(piece: Vec<u32>, normal: DVec3, vertices: &[DVec3], pieces: &mut Vec<Vec<u32>>) {
    let n = piece.len();
    let at = |i: usize| vertices[piece[i % n] as usize];
    let turns_in = |i: usize| {
        let turn = (at(i + 1) - at(i)).cross(at(i + 2) - at(i + 1));
        turn.dot(normal) < 0.0
    };
    let Some(i) = (0..n).find(|&i| n > 3 && turns_in(i)) else {
        pieces.push(piece);
        return;
    };
    // From the corner that stands in to the one across.
    let first = (i + 1) % n;
    let across = n / 2;
    let rotated: Vec<u32> = (0..n).map(|k| piece[(first + k) % n]).collect();
    let mut rest = vec![rotated[0]];
    rest.extend_from_slice(&rotated[across..]);
    push_convex(rotated[..=across].to_vec(), normal, vertices, pieces);
    push_convex(rest, normal, vertices, pieces);
}

/// Every corner with the shorter of the edges that meet there.
fn shortest_edges<'a>(
    polygon: &'a Polygon,
    vertices: &'a [DVec3],
) -> impl Iterator<Item = (u32, f64)> + 'a {
    let loops = std::iter::once(&polygon.outline).chain(&polygon.holes);
    loops.flat_map(move |corners| {
        let n = corners.len();
        let at = move |i: usize| vertices[corners[i % n] as usize];
        (0..n).map(move |i| {
            let (before, after) = (at(i + n - 1).distance(at(i)), at(i).distance(at(i + 1)));
            (corners[i], before.min(after))
        })
    })
}

fn is_axis(normal: DVec3) -> bool {
    DVec3::AXES.contains(&normal.abs())
}

/// Three corners always have one.
fn needs_a_plane(polygon: &Polygon) -> bool {
    polygon.corners().count() > 3
}

fn deviation(plane: &Plane, polygon: &Polygon, vertices: &[DVec3]) -> f64 {
    polygon
        .corners()
        .map(|&v| plane.distance(vertices[v as usize]).abs())
        .fold(0.0, f64::max)
}

/// Are all corners within a distance of a plane?
fn holds(plane: &Plane, polygon: &Polygon, vertices: &[DVec3], most: f64) -> bool {
    polygon
        .corners()
        .all(|&v| plane.distance(vertices[v as usize]).abs() <= most)
}

/// The plane perpendicular to an axis that holds all corners as well, if there is one.
fn straight(own: &Plane, polygon: &Polygon, vertices: &[DVec3], allowed: f64) -> Option<Plane> {
    let axis = own.normal.abs().max_position();
    let plane = Plane {
        normal: DVec3::AXES[axis] * own.normal[axis].signum() + DVec3::ZERO,
        point: own.point,
    };
    (deviation(&plane, polygon, vertices) <= allowed).then_some(plane)
}

#[cfg(test)]
mod tests {
    use crate::input::{MaterialInput, SceneInput, SurfaceInput};
    use crate::scene::Scene;
    use glam::{DVec3, dvec3};

    /// A box of six quadrilaterals whose corners are off by `amount` along each axis.
    fn crooked_box(amount: f64) -> SceneInput {
        let corner = |k: usize| {
            let bit = |i: usize| ((k >> i) & 1) as f64;
            let off = |i: usize| {
                // Any pattern without a symmetry.
                let sign = [1.0, -1.0][(k * (2 * i + 3) / 4 + i) % 2];
                sign * amount * (1.0 + 0.25 * i as f64)
            };
            dvec3(bit(0) + off(0), 2.0 * bit(1) + off(1), bit(2) + off(2))
        };
        let sides = [
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let surfaces = sides.iter().enumerate().map(|(s, side)| SurfaceInput {
            name: format!("side {s}"),
            material: "grey".to_owned(),
            vertices: side.iter().map(|&k| corner(k)).collect(),
            holes: Vec::new(),
        });
        SceneInput {
            materials: vec![MaterialInput {
                name: "grey".to_owned(),
                reflectance: vec![0.5],
                exitance: vec![1.0],
                two_sided: false,
            }],
            surfaces: surfaces.collect(),
            ..SceneInput::default()
        }
    }

    fn farthest_off(scene: &Scene) -> f64 {
        let faces = scene.faces.iter().flat_map(|face| {
            let plane = scene.planes[face.plane.index()];
            face.outline
                .iter()
                .map(move |&v| plane.distance(scene.position(v)).abs())
        });
        faces.fold(0.0, f64::max) / scene.extent
    }

    #[test]
    fn corners_of_a_crooked_box_settle_on_all_planes() {
        for amount in [1e-13, 1e-11, 1e-10] {
            let input = crooked_box(amount);
            let scene = Scene::build(&input).expect("a box").scene;
            assert_eq!(scene.faces.len(), 6, "nothing is split");
            assert!(farthest_off(&scene) <= 2e-16, "{:e}", farthest_off(&scene));
            for (surface, given) in scene.faces.iter().zip(&input.surfaces) {
                for (&v, &p) in surface.outline.iter().zip(&given.vertices) {
                    let moved = scene.frame.to_file(scene.position(v)).distance(p);
                    assert!(moved <= 20.0 * amount, "{moved:e} for {amount:e}");
                }
            }
        }
    }

    #[test]
    fn corners_in_place_keep_their_bits() {
        let scene = Scene::build(&crooked_box(0.0)).expect("a box").scene;
        let bits: Vec<DVec3> = scene
            .vertices
            .iter()
            .map(|&v| scene.frame.to_file(v))
            .collect();
        assert!(
            bits.iter()
                .all(|p| p.x.fract() == 0.0 && p.y.fract() == 0.0 && p.z.fract() == 0.0)
        );
    }

    #[test]
    fn a_corner_that_stands_in_after_it_moved_cuts_its_piece() {
        // A quadrilateral with a fifth corner a hair inside of its lower edge.
        let vertices = [
            dvec3(0.0, 0.0, 0.0),
            dvec3(1.0, 1e-10, 0.0),
            dvec3(2.0, 0.0, 0.0),
            dvec3(2.0, 1.0, 0.0),
            dvec3(0.0, 1.0, 0.0),
        ];
        let mut pieces = Vec::new();
        super::push_convex(vec![0, 1, 2, 3, 4], DVec3::Z, &vertices, &mut pieces);
        let area = |piece: &Vec<u32>| {
            let corners: Vec<DVec3> = piece.iter().map(|&v| vertices[v as usize]).collect();
            antumbra_geom::newell_normal(&corners).z / 2.0
        };
        assert!(
            pieces.len() > 1 && pieces.iter().all(|p| area(p) > 0.1),
            "{pieces:?}"
        );
        let sum: f64 = pieces.iter().map(area).sum();
        assert!((sum - (2.0 - 1e-10)).abs() < 1e-15, "{sum}");
    }
}
