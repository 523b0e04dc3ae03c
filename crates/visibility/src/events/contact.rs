//! D0: where faces touch or pierce the receiver.

use crate::events::coplanar::{Trace, chord};
use crate::events::tracer::Tracer;
use crate::events::{Event, EventKind};
use crate::intervals::Intervals;
use antumbra_scene::{Aabb, Face, FaceId};
use glam::DVec3;

/// An edge of which one end is farther than the contact radius touches the receiver along
/// the part that is nearer, if that is longer than this many radii: it leans by a few
/// roundings of its ends. Shorter ones are the feet of edges that stand on it.
const LEANING: f64 = 1024.0;

/// The part of an edge that is no farther from a plane than `r`, by its parameter, from the
/// heights of its ends.
fn part_within([a, b]: [f64; 2], r: f64) -> Option<[f64; 2]> {
    if a.abs() <= r && b.abs() <= r {
        return Some([0.0, 1.0]);
    }
    if a.min(b) > r || a.max(b) < -r {
        return None;
    }
    // Where the edge is at a height; the ends differ, for one of them is beyond.
    let at = |h: f64| ((h - a) / (b - a)).clamp(0.0, 1.0);
    let (s, t) = (at(-r), at(r));
    Some([s.min(t), s.max(t)])
}

impl Tracer<'_, '_> {
    /// D0: where faces touch or pierce the receiver.
    pub(crate) fn contacts(&mut self) {
        let r = self.contact_radius;
        let bounds = self.bounds();
        let near = Aabb {
            min: bounds.min - r,
            max: bounds.max + r,
        };
        let mut faces: Vec<FaceId> = Vec::new();
        self.scene.tree.visit(
            |b| b.meets(&near),
            |piece| faces.extend(self.scene.faces_of(piece)),
        );
        faces.sort_unstable();
        faces.dedup();
        for id in faces {
            // A floor with thousands of holes is long to look through for every face.
            if self.stop.is_wanted() {
                return;
            }
            let face = self.scene.face(id);
            if id == self.receiver || face.plane == self.face.plane {
                continue;
            }
            self.result.candidates[EventKind::Contact as usize] += 1;
            self.contact(id, face);
        }
    }

    fn contact(&mut self, id: FaceId, face: &Face) {
        let r = self.contact_radius;
        let emitter = self.scene.material(id).is_emitter().then_some(id);
        let heights = |corners: &[DVec3], this: &Self| -> Vec<f64> {
            corners.iter().map(|&c| this.height(c)).collect()
        };
        let all: Vec<DVec3> = face.loops().flat_map(|l| self.scene.positions(l)).collect();
        let all_heights = heights(&all, self);
        let highest = all_heights
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        if highest <= self.tolerance {
            return; // Nothing of it is over the receiver's front.
        }
        let foot = |x: DVec3, h: f64, this: &Self| x - this.face.normal * h;
        // Edges that lie on the receiver, or a hair from it.
        let mut segments: Vec<(DVec3, DVec3)> = Vec::new();
        for corners in face.loops().map(|l| self.scene.positions(l)) {
            let h = heights(&corners, self);
            for i in 0..corners.len() {
                let j = (i + 1) % corners.len();
                let Some([from, to]) = part_within([h[i], h[j]], r) else {
                    continue;
                };
                let at = |t: f64| {
                    let height = h[i] + (h[j] - h[i]) * t;
                    foot(corners[i] + (corners[j] - corners[i]) * t, height, self)
                };
                let (a, b) = (at(from), at(to));
                let lies_on_it = from == 0.0 && to == 1.0;
                if lies_on_it || a.distance(b) > LEANING * r {
                    segments.push((a, b));
                }
            }
        }
        // Pieces that pierce it.
        for piece in &self.scene.pieces[face.pieces.start as usize..face.pieces.end as usize] {
            let corners = self.scene.positions(&piece.vertices);
            let h = heights(&corners, self);
            if h.iter().any(|&h| h > r) && h.iter().any(|&h| h < -r) {
                let h: Vec<f64> = h
                    .iter()
                    .map(|&h| if h.abs() <= r { 0.0 } else { h })
                    .collect();
                if let Some((a, b)) = chord(&corners, &h) {
                    segments.push((a, b));
                }
            }
        }
        for (a, b) in segments {
            let Some(direction) = (b - a).try_normalize() else {
                continue;
            };
            let normal = direction.cross(self.face.normal);
            let trace = Trace {
                origin: a,
                direction,
                normal,
            };
            let length = (b - a).length();
            let inside = self.inside_receiver_or_border(&trace);
            let active = Intervals::one(0.0, length).intersect(&inside);
            self.emit(Event::Contact(id), emitter, &trace, &active);
        }
    }

    /// Like `inside_receiver`, but a trace along the border counts as inside: the
    /// border's own edges are then marked as contacts too, all that lie on the trace.
    fn inside_receiver_or_border(&self, trace: &Trace) -> Intervals {
        let r = self.contact_radius;
        let off = |x: DVec3| trace.normal.dot(x - trace.origin).abs();
        let mut all: Vec<(f64, f64)> = self.inside_receiver(trace).iter().collect();
        for corners in &self.loops {
            for i in 0..corners.len() {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                if off(a) <= r && off(b) <= r {
                    let (s, t) = (trace.parameter(a), trace.parameter(b));
                    all.push((s.min(t), s.max(t)));
                }
            }
        }
        Intervals::union(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_an_edge_that_is_near_touches() {
        let r = 1.0;
        assert_eq!(part_within([0.5, -0.9], r), Some([0.0, 1.0]));
        assert_eq!(part_within([0.0, 4.0], r), Some([0.0, 0.25]));
        assert_eq!(part_within([4.0, 0.0], r), Some([0.75, 1.0]));
        assert_eq!(part_within([-3.0, 5.0], r), Some([0.25, 0.5]));
        assert_eq!(part_within([2.0, 3.0], r), None);
        assert_eq!(part_within([-2.0, -3.0], r), None);
    }
}
