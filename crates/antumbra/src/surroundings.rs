//! What stands near a receiver, and touches it.

use antumbra_geom::{Chart, bounding_box};
use antumbra_scene::{Aabb, FaceId, Scene};
use antumbra_visibility::Evaluator;
use glam::{DVec2, DVec3};

/// An emitter is near if its distance is less than this fraction of the receiver.
const NEAR_EMITTER: f64 = 0.125;

/// Where the pieces of near emitters and their corners stand above a receiver: a lamp a
/// millimetre below the ceiling lights a patch of its own size there, which the nodes
/// and check points of large elements may all miss.
pub(crate) fn hot_spots(evaluator: &Evaluator<'_>, face: FaceId, chart: &Chart) -> Vec<DVec2> {
    let scene = evaluator.scene();
    let receiver = scene.face(face);
    let origin = scene.position(receiver.outline[0]);
    let bounds = Aabb::of(receiver.outline.iter().map(|&v| scene.position(v)));
    let near = NEAR_EMITTER * (bounds.max - bounds.min).length();
    let mut spots = Vec::new();
    // The scene would look for its emitters each time.
    for emitter in evaluator.emitters().filter(|&e| e != face) {
        let pieces = &scene.face(emitter).pieces;
        for piece in &scene.pieces[pieces.start as usize..pieces.end as usize] {
            let corners = scene.positions(&piece.vertices);
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            for p in std::iter::once(middle).chain(corners) {
                let height = receiver.normal.dot(p - origin);
                if height > 0.0 && height <= near {
                    spots.push(chart.to_chart(p));
                }
            }
        }
    }
    spots
}

/// Where corners of other faces touch a receiver, in no order that matters: irradiance has
/// no single value there, whether or not an edge of them lies on the receiver.
pub(crate) fn touched_points(scene: &Scene, face: FaceId, chart: &Chart) -> Vec<DVec2> {
    let receiver = scene.face(face);
    let radius = contact_radius(scene, face);
    let origin = scene.position(receiver.outline[0]);
    let mut bounds = Aabb::of(receiver.outline.iter().map(|&v| scene.position(v)));
    bounds.min -= DVec3::splat(radius);
    bounds.max += DVec3::splat(radius);
    let mut touching = Vec::new();
    scene.tree.visit(
        |b| b.meets(&bounds),
        |piece| {
            let piece = &scene.pieces[piece as usize];
            if scene.face(piece.face).plane != receiver.plane {
                let is_near = |p: DVec3| receiver.normal.dot(p - origin).abs() <= radius;
                let corners = piece.vertices.iter();
                touching.extend(corners.filter(|&&v| is_near(scene.position(v))));
            }
        },
    );
    touching.sort_unstable();
    touching.dedup();
    let mut own: Vec<_> = receiver.loops().flatten().copied().collect();
    own.sort_unstable();
    touching.retain(|v| own.binary_search(v).is_err());
    touching
        .into_iter()
        .map(|v| chart.to_chart(scene.position(v)))
        .collect()
}

/// Features closer than this to a receiver touch it; scene units.
///
/// Four pixels of its arrangement, which welds what is as near. Smaller, and the two sides
/// of the shadow of a gap would fall into one place (`contact/table` with its legs a hair
/// above the floor); larger, and gaps that the arrangement keeps open are closed to light:
/// nodes beside them have limits that no element can interpolate (two boxes 1e-8 apart took
/// 15,000 elements at twelve pixels, 1,000 at four).
pub(crate) fn contact_radius(scene: &Scene, face: FaceId) -> f64 {
    let chart = scene.chart(face);
    let corners = scene.loops_in_chart(face, &chart);
    let [min, max] = bounding_box(corners.iter().flatten().copied());
    4.0 * (max - min).max_element() * PIXEL
}

/// A pixel of the arrangement relative to its receiver.
pub(crate) const PIXEL: f64 = 1.0 / (1u64 << 28) as f64;
