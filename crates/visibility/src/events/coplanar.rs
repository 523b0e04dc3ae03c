//! D1 events: coplanar edges, facets, and the horizon.

use crate::adjacency::Adjacency;
use crate::events::curve::{CriticalCurve, CurveEnd, JUMP_PLACES, Shape};
use crate::events::shaft::Shaft;
use crate::events::sheet::Sheet;
use crate::events::trace::{Trace, common_plane};
use crate::events::tracer::Tracer;
use crate::events::{Event, EventKind};
use crate::intervals::Intervals;
use antumbra_scene::{EdgeId, FaceId};
use glam::DVec3;
use smallvec::SmallVec;

impl Tracer<'_, '_> {
    /// Where a trace runs inside the receiver. The ends lie on the border up to
    /// rounding; the arrangement joins them to it. Border edges that lie on the trace are
    /// all taken to be on one side of it.
    pub(crate) fn inside_receiver(&self, trace: &Trace) -> Intervals {
        let off = |x: DVec3| {
            let off = trace.normal.dot(x - trace.origin);
            if off.abs() <= self.tolerance {
                0.0
            } else {
                off
            }
        };
        let mut crossings = Vec::new();
        for [a, b] in self.border_at(trace, self.tolerance) {
            let (da, db) = (off(a), off(b));
            if (da > 0.0) != (db > 0.0) {
                crossings.push(trace.parameter(a + (b - a) * (da / (da - db))));
            }
        }
        crossings.sort_by(f64::total_cmp);
        let pairs = crossings.chunks_exact(2);
        Intervals::union(pairs.map(|pair| (pair[0], pair[1])).collect())
    }

    /// The receiver's border edges of which a point may be within a distance of a trace's
    /// plane; all of them if they are few.
    pub(crate) fn border_at(&self, trace: &Trace, distance: f64) -> SmallVec<[[DVec3; 2]; 16]> {
        let (normal, offset) = (trace.normal, trace.normal.dot(trace.origin));
        let slack = 2.0 * distance + self.tolerance;
        self.border_of(self.receiver, |b| {
            b.max_along(normal) >= offset - slack && -b.max_along(-normal) <= offset + slack
        })
    }

    /// Pushes a segment for every interval.
    pub(crate) fn emit(
        &mut self,
        event: Event,
        emitter: Option<FaceId>,
        trace: &Trace,
        active: &Intervals,
    ) {
        let mut active = active.clone();
        active.drop_shorter(self.contact_radius);
        for (from, to) in active.iter() {
            let shape = Shape::Segment([trace.at(from), trace.at(to)]);
            self.push(event, emitter, shape, [CurveEnd::Other; 2]);
        }
    }

    /// The emitter's plane crosses the receiver.
    pub(crate) fn horizon(&mut self, shaft: &Shaft<'_>) {
        let sides = |t: f64| {
            self.outline
                .iter()
                .any(|&x| shaft.lamp_height(x) * t > self.tolerance)
        };
        if !(sides(1.0) && sides(-1.0)) {
            return;
        }
        self.result.candidates[EventKind::Horizon as usize] += 1;
        let lamp = shaft.lamp;
        let point = self.scene.position(lamp.outline[0]);
        if let Some(trace) = Trace::new(self.origin, self.face.normal, point, lamp.normal) {
            let inside = self.inside_receiver(&trace);
            self.emit(
                Event::EmitterPlane(shaft.emitter),
                Some(shaft.emitter),
                &trace,
                &inside,
            );
        }
    }

    /// The plane of an occluder crosses the receiver and cuts the emitter.
    pub(crate) fn facets(&mut self, shaft: &Shaft<'_>) {
        for &id in &shaft.faces {
            let plane = self.scene.planes[self.scene.face(id).plane.index()];
            // A plane that has the emitter or the receiver on one side makes none.
            let cuts = |outline: &[DVec3]| {
                let side = |x: &DVec3| plane.distance(*x);
                outline.iter().any(|x| side(x) > self.tolerance)
                    && outline.iter().any(|x| side(x) < -self.tolerance)
            };
            if cuts(&shaft.lamp_hull) && cuts(&self.outline) {
                self.result.candidates[EventKind::Facet as usize] += 1;
                self.coplanar(shaft, Event::FacetPlane(id));
            }
        }
    }

    /// An occluder's edge in one plane with an emitter's edge.
    pub(crate) fn coplanar_with_emitter(
        &mut self,
        shaft: &Shaft<'_>,
        lamp_edge: EdgeId,
        edge: EdgeId,
    ) {
        if self.lies_on_receiver(edge) {
            return;
        }
        let Some(normal) = common_plane(self.scene, lamp_edge, edge) else {
            return;
        };
        self.result.candidates[EventKind::Ee as usize] += 1;
        if self.adjacency.is_outline(edge, normal) {
            let event = Event::CoplanarEdges {
                emitter: lamp_edge,
                occluder: edge,
            };
            self.coplanar(shaft, event);
        }
    }

    /// Two occluders' edges in one plane that cuts the emitter. Edges of a face in
    /// that plane are left to the facet.
    pub(crate) fn coplanar_occluders(&mut self, shaft: &Shaft<'_>, edges: [EdgeId; 2]) {
        let Some(normal) = common_plane(self.scene, edges[0], edges[1]) else {
            return;
        };
        self.result.candidates[EventKind::Ee as usize] += 1;
        let is_outline = |adjacency: &Adjacency, e: EdgeId| {
            adjacency.is_outline(e, normal)
                && adjacency
                    .faces_at(e)
                    .iter()
                    .all(|at| normal.dot(at.inward).abs() > 1e-9)
        };
        if edges.iter().all(|&e| is_outline(self.adjacency, e)) {
            self.coplanar(shaft, Event::OccluderEdges(edges));
        }
    }

    /// Pushes the curves of a D1 event.
    fn coplanar(&mut self, shaft: &Shaft<'_>, event: Event) {
        if self.stop.is_wanted() {
            return;
        }
        let Some(mut sheet) = Sheet::of(self.evaluator, self.receiver, event, shaft.emitter) else {
            return;
        };
        let trace = sheet.trace;
        let mut inside = self.inside_receiver(&trace);
        inside = inside.intersect(&self.in_front_of(shaft, &trace));
        if inside.is_empty() {
            return;
        }
        // The ends of the receiver are marks too: shadows of what is higher than the
        // emitter have no end.
        let mut marks = sheet.marks();
        marks.extend(inside.iter().flat_map(|(from, to)| [from, to]));
        marks.sort_by(f64::total_cmp);
        for pair in marks.windows(2) {
            if self.stop.is_wanted() {
                return;
            }
            if !sheet.is_active(0.5 * (pair[0] + pair[1])) {
                continue;
            }
            let within = Intervals::one(pair[0], pair[1]).intersect(&inside);
            for (from, to) in within.iter() {
                sheet.find_blockers(from, to);
                let mut active = sheet.seen(from, to, self.stop);
                active.drop_shorter(self.contact_radius);
                for (from, to) in active.iter() {
                    let shape = Shape::Segment([trace.at(from), trace.at(to)]);
                    let jumps = JUMP_PLACES.map(|t| sheet.jump(shape.at(t)));
                    self.result.curves.push(CriticalCurve {
                        event,
                        emitter: Some(shaft.emitter),
                        shape,
                        ends: [CurveEnd::Other; 2],
                        jumps,
                    });
                }
            }
        }
    }

    /// The part of a trace in front of the emitter.
    fn in_front_of(&self, shaft: &Shaft<'_>, trace: &Trace) -> Intervals {
        let slope = shaft.lamp.normal.dot(trace.direction);
        let at_origin = shaft.lamp_height(trace.origin);
        let far = 1e9;
        if slope.abs() < 1e-12 {
            return if at_origin > 0.0 {
                Intervals::one(-far, far)
            } else {
                Intervals::default()
            };
        }
        let zero = -at_origin / slope;
        if slope > 0.0 {
            Intervals::one(zero, far)
        } else {
            Intervals::one(-far, zero)
        }
    }
}
