//! From an event's swath to its curves on a receiver.

use crate::adjacency::Adjacency;
use crate::border::{self, Region};
use crate::evaluator::Evaluator;
use crate::events::curve::{CriticalCurve, CurveEnd, JUMP_PLACES, Shape};
use crate::events::jump::jump_at;
use crate::events::roots::Quadratic;
use crate::events::shaft::{Shaft, form};
use crate::events::swath::{MovingPoint, Swath, finite};
use crate::events::{CriticalCurves, Event, EventKind, EventKinds};
use antumbra_geom::Stop;
use antumbra_scene::{Aabb, EdgeId, Face, FaceId, Scene, VertexId};
use glam::{DVec3, DVec4};
use smallvec::SmallVec;
use std::borrow::Cow;

/// A feature that all lines of a swath touch.
#[derive(Clone, Debug)]
pub(crate) struct Generator {
    pub(crate) feature: Feature,
    /// Where the line touches it.
    pub(crate) point: MovingPoint,
    /// Of an edge whose point is not the parameter itself: the weights of its ends,
    /// which have one sign inside.
    pub(crate) weights: Option<[[f64; 2]; 2]>,
    /// Is it the emitter's?
    pub(crate) is_emitter: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    Vertex(VertexId),
    Edge(EdgeId),
}

/// What ends a part of a swath.
#[derive(Clone, Copy, Debug)]
enum Cause {
    /// The edge of this generator ends with this vertex.
    End(usize, VertexId),
    /// Another edge is touched.
    Edge(EdgeId),
    Other,
}

/// A part of a swath, by its parameter.
#[derive(Clone, Copy, Debug)]
struct Part {
    from: f64,
    to: f64,
    causes: [Cause; 2],
}

/// Parts shorter than this are rounding.
const SHORTEST: f64 = 1e-12;

/// An arc through infinity, or one that turns by half a circle, is cut in two at
/// most this often.
const MOST_CUTS: u32 = 6;

/// The position of a shared end may differ from the end of the curve by no more
/// than this, relative to the receiver: beyond, two edges are nearly parallel as
/// seen along the line, and the curve's own end is the better one.
const SAME_END: f64 = 1e-7;

pub(crate) struct Tracer<'e, 's> {
    pub(crate) evaluator: &'e Evaluator<'s>,
    pub(crate) scene: &'s Scene,
    pub(crate) adjacency: &'e Adjacency,
    pub(crate) receiver: FaceId,
    pub(crate) face: &'s Face,
    /// Form of the receiver's plane, positive on its front.
    pub(crate) form: DVec4,
    pub(crate) origin: DVec3,
    /// Outline of the receiver.
    pub(crate) outline: Vec<DVec3>,
    region: Cow<'e, Region>,
    bounds: Aabb,
    pub(crate) size: f64,
    pub(crate) contact_radius: f64,
    pub(crate) tolerance: f64,
    /// What VE and EEE curves say of their jumps.
    pub(crate) jumps: Jumps,
    pub(crate) result: CriticalCurves,
    /// Once wanted, nothing more is traced and the result is of no use.
    pub(crate) stop: Stop<'e>,
}

/// What curves say of their jumps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Jumps {
    Measured,
    /// They are 0: measuring takes longer than finding the curves.
    Unknown,
}

impl<'e, 's> Tracer<'e, 's> {
    pub(crate) fn new(
        evaluator: &'e Evaluator<'s>,
        receiver: FaceId,
        contact_radius: f64,
        stop: Stop<'e>,
    ) -> Self {
        let scene = evaluator.scene();
        let face = scene.face(receiver);
        let outline = scene.positions(&face.outline);
        let bounds = Aabb::of(outline.iter().copied());
        let adjacency = evaluator.adjacency();
        Self {
            evaluator,
            scene,
            adjacency,
            receiver,
            face,
            form: form(face.normal, outline[0]),
            origin: outline[0],
            size: (bounds.max - bounds.min).length(),
            bounds,
            outline,
            region: adjacency.region(scene, receiver),
            contact_radius,
            tolerance: scene.plane_tolerance(),
            jumps: Jumps::Measured,
            result: CriticalCurves::default(),
            stop,
        }
    }

    /// The border edges of a face, by the positions of their ends, in the order of its
    /// loops; of a face with many those whose boxes may meet a query.
    pub(crate) fn border_of(
        &self,
        face: FaceId,
        may_meet: impl Fn(&Aabb) -> bool,
    ) -> SmallVec<[[DVec3; 2]; 16]> {
        let at = |e: [VertexId; 2]| e.map(|v| self.scene.position(v));
        match self.adjacency.border(face) {
            None => border::ends(self.scene, face).map(at).collect(),
            Some(border) => border.near(may_meet).into_iter().map(at).collect(),
        }
    }

    pub(crate) fn height(&self, x: DVec3) -> f64 {
        self.face.normal.dot(x - self.origin)
    }

    pub(crate) fn ends(&self, edge: EdgeId) -> [DVec3; 2] {
        self.scene.edges[edge.index()]
            .ends
            .map(|v| self.scene.position(v))
    }

    pub(crate) fn is_end(&self, edge: EdgeId, vertex: VertexId) -> bool {
        self.scene.edges[edge.index()].ends.contains(&vertex)
    }

    pub(crate) fn other_end(&self, edge: EdgeId, vertex: VertexId) -> DVec3 {
        let ends = self.scene.edges[edge.index()].ends;
        self.scene
            .position(if ends[0] == vertex { ends[1] } else { ends[0] })
    }

    /// Is the edge a contact (or below), whose shadow is the edge itself?
    pub(crate) fn lies_on_receiver(&self, edge: EdgeId) -> bool {
        self.ends(edge)
            .iter()
            .all(|&x| self.height(x) <= self.contact_radius)
    }

    /// All events between the receiver and one emitter.
    pub(crate) fn emitter(&mut self, emitter: FaceId, kinds: EventKinds) {
        let lamp = self.scene.face(emitter);
        if lamp.plane == self.face.plane || self.stop.is_wanted() {
            return;
        }
        let lamp_outline = self.scene.positions(&lamp.outline);
        let Some(between) = self.evaluator.between(
            &self.outline,
            (self.face.normal, self.face.plane),
            &lamp_outline,
            (lamp.normal, lamp.plane),
        ) else {
            return;
        };
        self.emitter_behind(emitter, between, kinds);
    }

    /// All events between the receiver and one emitter behind these occluders
    /// (positions in [`Scene::pieces`], ascending).
    pub(crate) fn emitter_behind(
        &mut self,
        emitter: FaceId,
        occluders: Vec<u32>,
        kinds: EventKinds,
    ) {
        let shaft = Shaft::new(
            self.scene,
            self.adjacency,
            self.receiver,
            emitter,
            occluders,
        );
        if kinds.contains(EventKind::Horizon) {
            self.horizon(&shaft);
        }
        if kinds.contains(EventKind::Facet) {
            self.facets(&shaft);
        }
        if kinds.contains(EventKind::Ee) {
            for &edge in &shaft.edges {
                for &lamp_edge in &shaft.lamp_edges {
                    self.coplanar_with_emitter(&shaft, lamp_edge, edge);
                }
            }
        }
        if kinds.contains(EventKind::Ve) {
            for &edge in &shaft.edges {
                for &vertex in &shaft.lamp_vertices {
                    self.emitter_vertex(&shaft, vertex, edge);
                }
            }
            for &vertex in &shaft.vertices {
                for &lamp_edge in &shaft.lamp_edges {
                    self.emitter_edge(&shaft, lamp_edge, vertex);
                }
            }
        }
        self.joint(&shaft, kinds);
    }

    // ----- VE and EEE ----------------------------------------------------

    /// Lines from an emitter's vertex along an occluder's edge.
    fn emitter_vertex(&mut self, shaft: &Shaft<'_>, vertex: VertexId, edge: EdgeId) {
        if self.is_end(edge, vertex) || self.lies_on_receiver(edge) {
            return;
        }
        let event = Event::EmitterVertex { vertex, edge };
        self.vertex_edge(shaft, event, (vertex, true), (edge, false));
    }

    /// Lines from an emitter's edge through an occluder's vertex.
    fn emitter_edge(&mut self, shaft: &Shaft<'_>, edge: EdgeId, vertex: VertexId) {
        let a = self.scene.position(vertex);
        if self.is_end(edge, vertex)
            || self.height(a) <= self.contact_radius
            || shaft.lamp_height(a) <= self.tolerance
        {
            return;
        }
        let event = Event::EmitterEdge { edge, vertex };
        self.vertex_edge(shaft, event, (vertex, false), (edge, true));
    }

    /// Lines through a vertex and an edge; each may be the emitter's.
    pub(crate) fn vertex_edge(
        &mut self,
        shaft: &Shaft<'_>,
        event: Event,
        (vertex, is_emitter_vertex): (VertexId, bool),
        (edge, is_emitter_edge): (EdgeId, bool),
    ) {
        self.result.candidates[EventKind::Ve as usize] += 1;
        let v = self.scene.position(vertex);
        let [a, b] = self.ends(edge);
        let Some(normal) = wedge_normal(v, a, b) else {
            return;
        };
        if !is_emitter_edge && !self.adjacency.is_outline(edge, normal) {
            return;
        }
        // A plane that holds an edge at the vertex is that of coplanar edges, or of
        // a facet.
        let mut at_vertex: SmallVec<[EdgeId; 8]> = SmallVec::new();
        if is_emitter_vertex {
            at_vertex.extend(
                shaft
                    .lamp_edges
                    .iter()
                    .copied()
                    .filter(|&e| self.is_end(e, vertex)),
            );
        } else {
            at_vertex.extend(self.adjacency.edges_at(vertex).iter().copied());
        }
        if at_vertex.iter().any(|&e| {
            let off = normal.dot(self.other_end(e, vertex) - v).abs();
            off <= 4.0 * self.tolerance
                && (is_emitter_vertex || self.adjacency.is_outline(e, normal))
        }) {
            return;
        }
        let swath = Swath::new(MovingPoint::fixed(v), MovingPoint::along(a, b));
        let generators = [
            Generator {
                feature: Feature::Vertex(vertex),
                point: swath.q,
                weights: None,
                is_emitter: is_emitter_vertex,
            },
            Generator {
                feature: Feature::Edge(edge),
                point: swath.r,
                weights: None,
                is_emitter: is_emitter_edge,
            },
        ];
        let ends = self.scene.edges[edge.index()].ends;
        let causes = ends.map(|w| Cause::End(1, w));
        self.trace(shaft, event, &swath, &generators, causes);
    }

    /// Lines through three skew edges: `first` carries the parameter and may be the
    /// emitter's.
    pub(crate) fn triple(
        &mut self,
        shaft: &Shaft<'_>,
        event: Event,
        (first, is_emitter): (EdgeId, bool),
        [second, third]: [EdgeId; 2],
    ) {
        use crate::events::swath::orientation;
        self.result.candidates[EventKind::Eee as usize] += 1;
        let [a1, b1] = self.ends(first);
        let [a2, b2] = self.ends(second);
        let [a3, b3] = self.ends(third);
        let both = |f: &dyn Fn(DVec3) -> f64| [f(a1), f(b1)];
        // The plane of q(t) and the second edge cuts the third, and the other way.
        let w3 = [
            both(&|q| orientation(q, a2, b2, b3)),
            both(&|q| -orientation(q, a2, b2, a3)),
        ];
        let w2 = [
            both(&|q| orientation(q, a3, b3, b2)),
            both(&|q| -orientation(q, a3, b3, a2)),
        ];
        let swath = Swath::new(MovingPoint::along(a1, b1), MovingPoint::between(a3, b3, w3));
        let edge = |feature, point, weights, is_emitter| Generator {
            feature: Feature::Edge(feature),
            point,
            weights,
            is_emitter,
        };
        let generators = [
            edge(first, swath.q, None, is_emitter),
            edge(second, MovingPoint::between(a2, b2, w2), Some(w2), false),
            edge(third, swath.r, Some(w3), false),
        ];
        let ends = self.scene.edges[first.index()].ends;
        self.trace(
            shaft,
            event,
            &swath,
            &generators,
            ends.map(|w| Cause::End(0, w)),
        );
    }

    /// Clips a swath and pushes its curves.
    ///
    /// * `causes` — what ends it at the parameters 0 and 1.
    fn trace(
        &mut self,
        shaft: &Shaft<'_>,
        event: Event,
        swath: &Swath,
        generators: &[Generator],
        causes: [Cause; 2],
    ) {
        if self.stop.is_wanted() {
            return;
        }
        let has_emitter = generators.iter().any(|g| g.is_emitter);
        let mut breaks: SmallVec<[(f64, Cause); 32]> = SmallVec::new();
        let mut add = |form: Quadratic, cause: Cause| {
            breaks.extend(form.sign_changes().into_iter().map(|t| (t, cause)));
        };
        for (k, g) in generators.iter().enumerate() {
            if let (Some([a, b]), Feature::Edge(edge)) = (g.weights, g.feature) {
                let [va, vb] = self.scene.edges[edge.index()].ends;
                // Without the weight of one end, the point is the other.
                add(Quadratic::linear(a), Cause::End(k, vb));
                add(Quadratic::linear(b), Cause::End(k, va));
            }
            if !g.is_emitter {
                add(Quadratic::linear(g.point.form(self.form)), Cause::Other);
                add(
                    Quadratic::linear(g.point.form(shaft.lamp_form)),
                    Cause::Other,
                );
                self.silhouette_breaks(generators, k, &mut add);
            }
        }
        add(swath.form_at_hit(shaft.lamp_form, self.form), Cause::Other);
        add(swath.weight_at_hit(self.form), Cause::Other);
        // A long border is looked up once it is known where the lines are.
        let is_long = self.adjacency.border(self.receiver).is_some();
        if is_long {
            let hull = &shaft.receiver_hull;
            for i in 0..hull.len() {
                add(
                    swath.side(hull[i], hull[(i + 1) % hull.len()]),
                    Cause::Other,
                );
            }
        } else {
            for [a, b] in self.border_of(self.receiver, |_| true) {
                add(swath.side(a, b), Cause::Other);
            }
        }
        if !has_emitter {
            for &e in &shaft.lamp_edges {
                let [a, b] = self.ends(e);
                add(swath.side(a, b), Cause::Edge(e));
            }
        }
        let whole = Part {
            from: 0.0,
            to: 1.0,
            causes,
        };
        let is_inside =
            |t: f64| finite(swath.hit(self.form, t)).is_some_and(|x| self.region.contains(x));
        let parts = active_parts(whole, breaks, |t| {
            self.is_active(shaft, swath, generators, t) && (is_long || is_inside(t))
        });
        let parts: Vec<Part> = if is_long {
            let inside =
                |part: Part| active_parts(part, self.border_breaks(swath, part), is_inside);
            parts.into_iter().flat_map(inside).collect()
        } else {
            parts
        };
        for part in parts {
            if self.stop.is_wanted() {
                return;
            }
            let hidden = self.blocked(shaft, swath, generators, part);
            for part in subtract(part, hidden) {
                self.push_part(shaft, event, swath, generators, part, MOST_CUTS);
            }
        }
    }

    /// Where the lines of a part pass edges of a long border.
    fn border_breaks(&self, swath: &Swath, part: Part) -> SmallVec<[(f64, Cause); 32]> {
        let control = [
            (part.from, part.from),
            (part.from, part.to),
            (part.to, part.to),
        ]
        .map(|(s, t)| swath.blossom(self.form, s, t));
        let is_bounded = control.iter().all(|c| c.w > 0.0) || control.iter().all(|c| c.w < 0.0);
        let points = control.map(|c| c.truncate() / c.w);
        // The curve lies in the triangle of its control points: in its box, and between
        // two lines along its chord.
        let across = self
            .face
            .normal
            .cross(points[2] - points[0])
            .normalize_or_zero();
        let along = points.map(|p| across.dot(p - self.origin));
        let range = along.iter().fold((0.0f64, 0.0f64), |(lo, hi), &d| {
            (lo.min(d - along[0]), hi.max(d - along[0]))
        });
        let offset = across.dot(self.origin) + along[0];
        let slack = 4.0 * self.tolerance;
        let bounds = Aabb::of(points);
        let bounds = Aabb {
            min: bounds.min - slack,
            max: bounds.max + slack,
        };
        let edges = self.border_of(self.receiver, |b| {
            !is_bounded
                || b.meets(&bounds)
                    && b.max_along(across) >= offset + range.0 - slack
                    && -b.max_along(-across) <= offset + range.1 + slack
        });
        let changes = edges
            .into_iter()
            .flat_map(|[a, b]| swath.side(a, b).sign_changes());
        changes
            .filter(|&t| t > part.from && t < part.to)
            .map(|t| (t, Cause::Other))
            .collect()
    }

    /// Where the line runs in the plane of a face at generator k: there the face
    /// turns from one side of the line to the other.
    fn silhouette_breaks(
        &self,
        generators: &[Generator],
        k: usize,
        add: &mut impl FnMut(Quadratic, Cause),
    ) {
        // Any other point of the line tells.
        let other = &generators[if k == 0 { generators.len() - 1 } else { 0 }].point;
        let mut at_face = |id: FaceId, point: DVec3| {
            let plane = form(self.scene.face(id).normal, point);
            add(Quadratic::linear(other.form(plane)), Cause::Other);
        };
        match generators[k].feature {
            Feature::Edge(edge) => {
                let p = self.ends(edge)[0];
                for at in self.adjacency.faces_at(edge) {
                    at_face(at.face, p);
                }
            }
            Feature::Vertex(vertex) => {
                let p = self.scene.position(vertex);
                let mut faces: SmallVec<[FaceId; 8]> = self
                    .adjacency
                    .edges_at(vertex)
                    .iter()
                    .flat_map(|&e| self.adjacency.faces_at(e))
                    .map(|at| at.face)
                    .collect();
                faces.sort_unstable();
                faces.dedup();
                for face in faces {
                    at_face(face, p);
                }
            }
        }
    }

    /// The ends of the open line at t: on the receiver, and on the emitter.
    fn line(&self, shaft: &Shaft<'_>, swath: &Swath, t: f64) -> Option<[DVec3; 2]> {
        Some([
            finite(swath.hit(self.form, t))?,
            finite(swath.hit(shaft.lamp_form, t))?,
        ])
    }

    /// Is the line at t a critical one, the receiver's border and other surfaces apart?
    fn is_active(
        &self,
        shaft: &Shaft<'_>,
        swath: &Swath,
        generators: &[Generator],
        t: f64,
    ) -> bool {
        let Some([x, y]) = self.line(shaft, swath, t) else {
            return false;
        };
        if shaft.lamp_height(x) <= self.tolerance || self.height(y) <= self.tolerance {
            return false;
        }
        let Some(direction) = (y - x).try_normalize() else {
            return false;
        };
        for g in generators {
            if let Some([a, b]) = g.weights {
                let at = |w: [f64; 2]| w[0] + (w[1] - w[0]) * t;
                if at(a) * at(b) <= 0.0 {
                    return false;
                }
            }
            if g.is_emitter {
                continue;
            }
            let Some(point) = finite(g.point.at(t)) else {
                return false;
            };
            if self.height(point) <= self.tolerance || shaft.lamp_height(point) <= self.tolerance {
                return false;
            }
            let grazes = |edge: EdgeId| {
                let [a, b] = self.ends(edge);
                let normal = (b - a).cross(direction).normalize_or_zero();
                self.adjacency.is_outline(edge, normal)
            };
            let is_outline = match g.feature {
                Feature::Edge(edge) => grazes(edge),
                Feature::Vertex(vertex) => {
                    self.adjacency.edges_at(vertex).iter().any(|&e| grazes(e))
                }
            };
            if !is_outline {
                return false;
            }
        }
        let has_emitter = generators.iter().any(|g| g.is_emitter);
        has_emitter || shaft.lamp_region.contains(y)
    }

    /// The parts of a part that other surfaces block.
    fn blocked(
        &self,
        shaft: &Shaft<'_>,
        swath: &Swath,
        generators: &[Generator],
        part: Part,
    ) -> Vec<Part> {
        let Some((bounds, slab)) = self.around(shaft, swath, part) else {
            return Vec::new();
        };
        let (normal, lo, hi) = slab;
        let own: SmallVec<[FaceId; 8]> = generators
            .iter()
            .flat_map(|g| match g.feature {
                Feature::Edge(edge) => SmallVec::<[EdgeId; 4]>::from_slice(&[edge]),
                Feature::Vertex(vertex) => self.adjacency.edges_at(vertex).into(),
            })
            .flat_map(|e| self.adjacency.faces_at(e))
            .map(|at| at.face)
            .collect();
        let mut found: SmallVec<[u32; 32]> = SmallVec::new();
        self.scene.tree.visit(
            |b| b.meets(&bounds) && b.max_along(normal) >= lo && -b.max_along(-normal) <= hi,
            |piece| found.push(piece),
        );
        found.sort_unstable();
        let mut hidden = Vec::new();
        for id in found {
            let piece = &self.scene.pieces[id as usize];
            let face = self.scene.face(piece.face);
            if face.plane == self.face.plane
                || face.plane == shaft.lamp.plane
                || own.iter().any(|&face| self.scene.is_of(id, face))
            {
                continue;
            }
            let corners: SmallVec<[DVec3; 8]> = piece
                .vertices
                .iter()
                .map(|&v| self.scene.position(v))
                .collect();
            let heights = corners.iter().map(|x| normal.dot(*x));
            if heights.clone().all(|h| h < lo) || heights.clone().all(|h| h > hi) {
                continue;
            }
            self.blocked_by(shaft, swath, part, (id, &corners), &mut hidden);
        }
        hidden
    }

    fn blocked_by(
        &self,
        shaft: &Shaft<'_>,
        swath: &Swath,
        part: Part,
        (id, corners): (u32, &[DVec3]),
        hidden: &mut Vec<Part>,
    ) {
        let piece = &self.scene.pieces[id as usize];
        let face = self.scene.face(piece.face);
        let mut breaks: SmallVec<[(f64, Cause); 16]> = SmallVec::new();
        let n = corners.len();
        for i in 0..n {
            let j = (i + 1) % n;
            let changes = swath.side(corners[i], corners[j]).sign_changes();
            if changes.iter().any(|&t| t > part.from && t < part.to) {
                let cause = self
                    .scene
                    .edge_between(piece.vertices[i], piece.vertices[j])
                    .map_or(Cause::Other, Cause::Edge);
                breaks.extend(
                    changes
                        .into_iter()
                        .filter(|&t| t > part.from && t < part.to)
                        .map(|t| (t, cause)),
                );
            }
        }
        // Where the line's end passes through the piece.
        let plane = form(face.normal, corners[0]);
        for on in [self.form, shaft.lamp_form] {
            let side = |x: &DVec3| on.dot(x.extend(1.0));
            if corners.iter().any(|x| side(x) > 0.0) && corners.iter().any(|x| side(x) < 0.0) {
                breaks.extend(
                    swath
                        .form_at_hit(plane, on)
                        .sign_changes()
                        .into_iter()
                        .filter(|&t| t > part.from && t < part.to)
                        .map(|t| (t, Cause::Other)),
                );
            }
        }
        breaks.sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut from = (part.from, part.causes[0]);
        for to in breaks.into_iter().chain([(part.to, part.causes[1])]) {
            let is_blocked = self
                .line(shaft, swath, 0.5 * (from.0 + to.0))
                .is_some_and(|[x, y]| pierces(x, y, corners, face.normal, self.tolerance));
            if is_blocked {
                hidden.push(Part {
                    from: from.0,
                    to: to.0,
                    causes: [from.1, to.1],
                });
            }
            from = to;
        }
    }

    /// A box and a slab (unit normal, least and largest offset) that hold all lines
    /// of a part between receiver and emitter.
    fn around(
        &self,
        shaft: &Shaft<'_>,
        swath: &Swath,
        part: Part,
    ) -> Option<(Aabb, (DVec3, f64, f64))> {
        let mut points: SmallVec<[DVec3; 16]> = SmallVec::new();
        for (plane, outline) in [
            (self.form, &shaft.receiver_hull),
            (shaft.lamp_form, &shaft.lamp_hull),
        ] {
            let control = [
                (part.from, part.from),
                (part.from, part.to),
                (part.to, part.to),
            ]
            .map(|(s, t)| swath.blossom(plane, s, t));
            if control.iter().all(|c| c.w > 0.0) || control.iter().all(|c| c.w < 0.0) {
                points.extend(control.iter().map(|c| c.truncate() / c.w));
            } else {
                points.extend(outline.iter().copied());
            }
        }
        let middle = self.line(shaft, swath, 0.5 * (part.from + part.to))?;
        let [x0, _] = self.line(shaft, swath, part.from).unwrap_or(middle);
        let [x1, y1] = self.line(shaft, swath, part.to).unwrap_or(middle);
        let mut normal = (x1 - x0).cross(middle[1] - middle[0]);
        if normal.length_squared() < 1e-20 {
            normal = (y1 - middle[1]).cross(middle[1] - middle[0]);
        }
        let normal = normal.normalize_or_zero();
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for &p in &points {
            let d = normal.dot(p);
            (lo, hi) = (lo.min(d), hi.max(d));
        }
        let slack = self.tolerance;
        let bounds = Aabb::of(points);
        let bounds = Aabb {
            min: bounds.min - slack,
            max: bounds.max + slack,
        };
        Some((bounds, (normal, lo - slack, hi + slack)))
    }

    /// Pushes the curve of a part of a swath.
    fn push_part(
        &mut self,
        shaft: &Shaft<'_>,
        event: Event,
        swath: &Swath,
        generators: &[Generator],
        part: Part,
        cuts: u32,
    ) {
        let is_arc = generators.len() == 3;
        let part = self.bounded(shaft, swath, part);
        let control = [
            (part.from, part.from),
            (part.from, part.to),
            (part.to, part.to),
        ]
        .map(|(s, t)| swath.blossom(self.form, s, t));
        let weights = control.map(|c| c.w);
        let is_proper = weights[0] * weights[2] > 0.0 && weights[0] * weights[1] > 0.0;
        if is_arc && !is_proper && cuts > 0 {
            let middle = 0.5 * (part.from + part.to);
            for (from, to, causes) in [
                (part.from, middle, [part.causes[0], Cause::Other]),
                (middle, part.to, [Cause::Other, part.causes[1]]),
            ] {
                let half = Part { from, to, causes };
                self.push_part(shaft, event, swath, generators, half, cuts - 1);
            }
            return;
        }
        let points = control.map(|c| c.truncate() / c.w);
        let mut places = [points[0], points[2]];
        if !places.iter().all(|&p| self.is_near(shaft, p)) {
            return;
        }
        let mut ends = [CurveEnd::Other; 2];
        for k in 0..2 {
            let end = self.curve_end(generators, part.causes[k]);
            if let Some(place) = self.end_place(end)
                && place.distance(places[k]) <= SAME_END * self.size
            {
                (places[k], ends[k]) = (place, end);
            }
        }
        if places[0].distance(places[1]) <= self.contact_radius {
            return;
        }
        let shape = if is_arc && is_proper && points[1].is_finite() {
            Shape::Arc {
                points: [places[0], points[1], places[1]],
                weight: weights[1] / (weights[0] * weights[2]).sqrt() * weights[0].signum(),
            }
        } else {
            Shape::Segment(places)
        };
        self.push(event, Some(shaft.emitter), shape, ends);
    }

    /// Is a place within a receiver's size of it? False for places that are none.
    fn is_near(&self, shaft: &Shaft<'_>, place: DVec3) -> bool {
        place.distance(shaft.receiver_hull[0]) <= 2.0 * self.size
    }

    /// The part without its ends where they lie far outside: a line that becomes
    /// parallel to the receiver crosses its border within the rounding of the parameter.
    fn bounded(&self, shaft: &Shaft<'_>, swath: &Swath, part: Part) -> Part {
        let is_near = |t: f64| {
            let hit = swath.blossom(self.form, t, t);
            self.is_near(shaft, hit.truncate() / hit.w)
        };
        let middle = 0.5 * (part.from + part.to);
        let end = |far: f64| {
            if is_near(far) || !is_near(middle) {
                return far;
            }
            let (mut near, mut far) = (middle, far);
            for _ in 0..64 {
                let t = 0.5 * (near + far);
                if is_near(t) {
                    near = t;
                } else {
                    far = t;
                }
            }
            near
        };
        Part {
            from: end(part.from),
            to: end(part.to),
            ..part
        }
    }

    /// What line a part ends with.
    fn curve_end(&self, generators: &[Generator], cause: Cause) -> CurveEnd {
        let features: SmallVec<[Feature; 3]> = generators.iter().map(|g| g.feature).collect();
        match (cause, features.as_slice()) {
            (Cause::End(_, w), [Feature::Vertex(v), Feature::Edge(_)]) => {
                CurveEnd::Vertices([*v.min(&w), *v.max(&w)])
            }
            (Cause::End(k, w), edges) => {
                let others: SmallVec<[EdgeId; 2]> = edges
                    .iter()
                    .enumerate()
                    .filter(|(i, _)| *i != k)
                    .filter_map(|(_, f)| match f {
                        Feature::Edge(e) => Some(*e),
                        Feature::Vertex(_) => None,
                    })
                    .collect();
                match others.as_slice() {
                    [e, f] => CurveEnd::VertexEdges(w, [*e.min(f), *e.max(f)]),
                    _ => CurveEnd::Other,
                }
            }
            (Cause::Edge(f), [Feature::Vertex(v), Feature::Edge(e)]) => {
                if self.is_end(f, *v) || f == *e {
                    return CurveEnd::Other;
                }
                // Edges that meet: the line passes through their common vertex.
                let ends = self.scene.edges[e.index()].ends;
                match ends.into_iter().find(|&w| self.is_end(f, w)) {
                    Some(w) => CurveEnd::Vertices([*v.min(&w), *v.max(&w)]),
                    None => CurveEnd::VertexEdges(*v, [*e.min(&f), *e.max(&f)]),
                }
            }
            _ => CurveEnd::Other,
        }
    }

    /// Where the line of a curve's end meets the receiver: a function of the
    /// features alone, so that all curves with this end have the same point.
    fn end_place(&self, end: CurveEnd) -> Option<DVec3> {
        let (v, direction) = match end {
            CurveEnd::Vertices([v, w]) => {
                let v = self.scene.position(v);
                (v, self.scene.position(w) - v)
            }
            CurveEnd::VertexEdges(v, edges) => {
                let v = self.scene.position(v);
                let [p, q] = edges.map(|e| {
                    let [a, b] = self.ends(e);
                    (a - v).cross(b - v)
                });
                (v, p.cross(q))
            }
            CurveEnd::Other => return None,
        };
        let slope = self.face.normal.dot(direction);
        let place = v - direction * (self.height(v) / slope);
        place.is_finite().then_some(place)
    }

    /// Pushes a curve with its jumps.
    pub(crate) fn push(
        &mut self,
        event: Event,
        emitter: Option<FaceId>,
        shape: Shape,
        ends: [CurveEnd; 2],
    ) {
        let mut curve = CriticalCurve {
            event,
            emitter,
            shape,
            ends,
            jumps: [0.0; JUMP_PLACES.len()],
        };
        if event.kind() != EventKind::Contact && self.jumps == Jumps::Measured {
            curve.jumps = JUMP_PLACES.map(|t| {
                jump_at(self.evaluator, self.receiver, &curve, shape.at(t)).unwrap_or(0.0)
            });
        }
        self.result.curves.push(curve);
    }

    /// The box of the receiver.
    pub(crate) fn bounds(&self) -> Aabb {
        self.bounds
    }
}

/// Does the open segment from x to y pass through the inside of a convex polygon?
pub(crate) fn pierces(
    x: DVec3,
    y: DVec3,
    corners: &[DVec3],
    normal: DVec3,
    tolerance: f64,
) -> bool {
    let (hx, hy) = (normal.dot(x - corners[0]), normal.dot(y - corners[0]));
    if hx.abs() <= tolerance || hy.abs() <= tolerance || hx * hy > 0.0 {
        return false;
    }
    let d = y - x;
    let length = d.length();
    let n = corners.len();
    let (mut left, mut right) = (true, true);
    for i in 0..n {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        let side = (a - x).cross(b - x).dot(d);
        let least = 4.0 * tolerance * length * (b - a).length();
        left &= side > least;
        right &= side < -least;
    }
    left || right
}

/// The parts of a part in which lines are active.
///
/// * `breaks` — where that changes, in any order; between two of them its middle tells.
fn active_parts(
    part: Part,
    mut breaks: SmallVec<[(f64, Cause); 32]>,
    is_active: impl Fn(f64) -> bool,
) -> Vec<Part> {
    breaks.sort_by(|x, y| x.0.total_cmp(&y.0));
    let mut parts: Vec<Part> = Vec::new();
    let mut from = (part.from, part.causes[0]);
    for to in breaks.into_iter().chain([(part.to, part.causes[1])]) {
        if to.0 - from.0 <= SHORTEST {
            continue;
        }
        if is_active(0.5 * (from.0 + to.0)) {
            match parts.last_mut() {
                Some(last) if last.to == from.0 => {
                    last.to = to.0;
                    last.causes[1] = to.1;
                }
                _ => parts.push(Part {
                    from: from.0,
                    to: to.0,
                    causes: [from.1, to.1],
                }),
            }
        }
        from = to;
    }
    parts
}

/// What is left of a part without others.
fn subtract(part: Part, mut hidden: Vec<Part>) -> Vec<Part> {
    hidden.sort_by(|a, b| a.from.total_cmp(&b.from).then(a.to.total_cmp(&b.to)));
    let mut rest = Vec::new();
    let mut from = (part.from, part.causes[0]);
    for h in hidden {
        if h.from > from.0 + SHORTEST {
            rest.push(Part {
                from: from.0,
                to: h.from,
                causes: [from.1, h.causes[0]],
            });
        }
        if h.to > from.0 {
            from = (h.to, h.causes[1]);
        }
    }
    if part.to > from.0 + SHORTEST {
        rest.push(Part {
            from: from.0,
            to: part.to,
            causes: [from.1, part.causes[1]],
        });
    }
    rest
}

/// The unit normal of the plane through a vertex and an edge, unless they are
/// nearly collinear.
pub(crate) fn wedge_normal(v: DVec3, a: DVec3, b: DVec3) -> Option<DVec3> {
    let normal = (a - v).cross(b - v);
    let scale_sq =
        (b - a).length_squared() * (a - v).length_squared().max((b - v).length_squared());
    // 2⁻⁴⁰ of the product: below, the plane's direction is rounding.
    (normal.length_squared() > 2f64.powi(-80) * scale_sq).then(|| normal.normalize_or_zero())
}
