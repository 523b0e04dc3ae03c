//! D0: where faces touch or pierce the receiver.

use crate::events::trace::{Trace, chord};
use crate::events::tracer::Tracer;
use crate::events::{Event, EventKind};
use crate::intervals::Intervals;
use antumbra_scene::{Aabb, Face, FaceId, VertexId};
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
        let mut pieces: Vec<u32> = Vec::new();
        self.scene
            .tree
            .visit(|b| b.meets(&near), |piece| pieces.push(piece));
        let faces = self
            .adjacency
            .faces_near(self.scene, pieces, |b| b.meets(&near));
        for id in faces {
            if self.stop.is_wanted() {
                return;
            }
            let face = self.scene.face(id);
            if id == self.receiver || face.plane == self.face.plane {
                continue;
            }
            self.result.candidates[EventKind::Contact as usize] += 1;
            self.contact(id, face, &near);
        }
    }

    /// Where one face touches or pierces the receiver.
    ///
    /// * `near` — what is outside of it is too far to touch.
    fn contact(&mut self, id: FaceId, face: &Face, near: &Aabb) {
        let emitter = self.scene.material(id).is_emitter().then_some(id);
        // What has nothing over the receiver's front does not touch it; holes are no
        // higher than the outline.
        let is_over = |&v: &VertexId| self.height(self.scene.position(v)) > self.tolerance;
        if !face.outline.iter().any(is_over) {
            return;
        }
        let mut segments = self.touching_edges(id, near);
        segments.extend(self.piercing_chords(id, near));
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

    /// Edges of a face that lie on the receiver, or a hair from it, projected onto it.
    fn touching_edges(&self, id: FaceId, near: &Aabb) -> Vec<(DVec3, DVec3)> {
        let r = self.contact_radius;
        let mut segments = Vec::new();
        for ends in self.border_of(id, |b| b.meets(near)) {
            let h = ends.map(|x| self.height(x));
            let Some([from, to]) = part_within(h, r) else {
                continue;
            };
            let at = |t: f64| {
                let height = h[0] + (h[1] - h[0]) * t;
                ends[0] + (ends[1] - ends[0]) * t - self.face.normal * height
            };
            let (a, b) = (at(from), at(to));
            let lies_on_it = from == 0.0 && to == 1.0;
            if lies_on_it || a.distance(b) > LEANING * r {
                segments.push((a, b));
            }
        }
        segments
    }

    /// Where pieces of a face pierce the receiver's plane.
    fn piercing_chords(&self, id: FaceId, near: &Aabb) -> Vec<(DVec3, DVec3)> {
        let r = self.contact_radius;
        let mut segments = Vec::new();
        for piece in self
            .adjacency
            .pieces_near(self.scene, id, |b| b.meets(near))
        {
            let corners = self
                .scene
                .positions(&self.scene.pieces[piece as usize].vertices);
            let heights: Vec<f64> = corners.iter().map(|&c| self.height(c)).collect();
            if heights.iter().any(|&h| h > r) && heights.iter().any(|&h| h < -r) {
                let snap = |&h: &f64| if h.abs() <= r { 0.0 } else { h };
                let heights: Vec<f64> = heights.iter().map(snap).collect();
                segments.extend(chord(&corners, &heights));
            }
        }
        segments
    }

    /// Like `inside_receiver`, but a trace along the border counts as inside: the
    /// border's own edges are then marked as contacts too, all that lie on the trace.
    fn inside_receiver_or_border(&self, trace: &Trace) -> Intervals {
        let r = self.contact_radius;
        let off = |x: DVec3| trace.normal.dot(x - trace.origin).abs();
        let mut all: Vec<(f64, f64)> = self.inside_receiver(trace).iter().collect();
        for [a, b] in self.border_at(trace, r) {
            if off(a) <= r && off(b) <= r {
                let (s, t) = (trace.parameter(a), trace.parameter(b));
                all.push((s.min(t), s.max(t)));
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
