//! Traces of planes on a receiver, and chords of faces in planes.

use antumbra_scene::{EdgeId, FaceId, Scene};
use glam::DVec3;
use smallvec::SmallVec;

/// The trace of a plane on the receiver: points `origin + s·direction`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trace {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// Unit normal of the plane.
    pub(crate) normal: DVec3,
}

impl Trace {
    /// The trace of the plane through `point` with this unit normal, on the plane
    /// through `origin` with the unit normal `up`.
    pub(super) fn new(origin: DVec3, up: DVec3, point: DVec3, normal: DVec3) -> Option<Self> {
        let along = up.cross(normal);
        let sine_sq = along.length_squared();
        if sine_sq < 1e-18 {
            return None;
        }
        // From the receiver's first corner along the steepest way to the plane.
        let across = normal - up * up.dot(normal);
        Some(Self {
            origin: origin - across * (normal.dot(origin - point) / sine_sq),
            direction: along / sine_sq.sqrt(),
            normal,
        })
    }

    pub(crate) fn parameter(&self, x: DVec3) -> f64 {
        (x - self.origin).dot(self.direction)
    }

    pub(crate) fn at(&self, s: f64) -> DVec3 {
        self.origin + self.direction * s
    }
}

/// The chords in which a plane cuts the pieces of a face.
pub(super) fn chords(scene: &Scene, face: FaceId, normal: DVec3, point: DVec3) -> Vec<[DVec3; 2]> {
    let range = &scene.face(face).pieces;
    let mut found = Vec::new();
    for piece in &scene.pieces[range.start as usize..range.end as usize] {
        let corners = scene.positions(&piece.vertices);
        let sides: SmallVec<[f64; 8]> = corners
            .iter()
            .map(|&c| {
                let d = normal.dot(c - point);
                if d.abs() <= scene.plane_tolerance() {
                    0.0
                } else {
                    d
                }
            })
            .collect();
        if sides.iter().any(|&d| d > 0.0)
            && sides.iter().any(|&d| d < 0.0)
            && let Some((a, b)) = chord(&corners, &sides)
        {
            found.push([a, b]);
        }
    }
    joined(found, scene.plane_tolerance())
}

/// Chords of one line, put together where one ends and the next begins: which pieces a face
/// has is the triangulation's choice.
fn joined(mut chords: Vec<[DVec3; 2]>, tolerance: f64) -> Vec<[DVec3; 2]> {
    if chords.len() < 2 {
        return chords;
    }
    let along = chords[0][1] - chords[0][0];
    for chord in &mut chords {
        if along.dot(chord[1] - chord[0]) < 0.0 {
            chord.reverse();
        }
    }
    chords.sort_by(|a, b| along.dot(a[0]).total_cmp(&along.dot(b[0])));
    chords.dedup_by(|next, kept| {
        let goes_on = next[0].distance(kept[1]) <= 4.0 * tolerance;
        if goes_on {
            kept[1] = next[1];
        }
        goes_on
    });
    chords
}

/// The unit normal of the plane that holds both edges, if one does.
pub(crate) fn common_plane(scene: &Scene, e: EdgeId, f: EdgeId) -> Option<DVec3> {
    let ends = |e: EdgeId| scene.edges[e.index()].ends.map(|v| scene.position(v));
    let ([a, b], [c, d]) = (ends(e), ends(f));
    // The best conditioned of the planes through three of the four ends.
    let candidates = [(a, b, c), (a, b, d), (c, d, a), (c, d, b)];
    let normal = candidates
        .into_iter()
        .map(|(p, q, r)| (q - p).cross(r - p))
        .max_by(|x, y| x.length_squared().total_cmp(&y.length_squared()))?;
    let scale = (b - a).length().max((d - c).length()).max((c - a).length());
    if normal.length() < 1e-9 * scale * scale {
        return None; // One line.
    }
    let normal = normal.try_normalize()?;
    let spread = [a, b, c, d]
        .iter()
        .map(|&x| normal.dot(x - a).abs())
        .fold(0.0, f64::max);
    (spread <= 4.0 * scene.plane_tolerance()).then_some(normal)
}

/// The chord in which a plane cuts a convex polygon, from the signed distances of
/// its corners; `None` if it only touches a corner.
pub(crate) fn chord(corners: &[DVec3], distances: &[f64]) -> Option<(DVec3, DVec3)> {
    let n = corners.len();
    let mut ends: SmallVec<[DVec3; 4]> = SmallVec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        let (p, q) = (distances[i], distances[j]);
        if p == 0.0 {
            ends.push(corners[i]);
        } else if (p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0) {
            ends.push(corners[i] + (corners[j] - corners[i]) * (p / (p - q)));
        }
    }
    // The two ends farthest apart: corners in the plane may come in runs.
    let mut best: Option<(DVec3, DVec3)> = None;
    let mut longest = 0.0;
    for i in 0..ends.len() {
        for j in i + 1..ends.len() {
            let length = (ends[j] - ends[i]).length_squared();
            if length > longest {
                longest = length;
                best = Some((ends[i], ends[j]));
            }
        }
    }
    best
}
