//! Events and the critical curves where their swaths meet a receiver.
//!
//! An event is a set of features whose common stabbing lines change what is
//! seen. Every event here is a pencil of lines in one plane; all its clips (an
//! edge's ends, a silhouette change, a blocking surface, the border of the
//! receiver) are projections onto the plane's trace on the receiver, hence
//! closed form. EEE and non-emitter VE swaths are not enumerated yet
//! ([`EventKind::Eee`] has its place in all counts).
//!
//! # Source
//!
//! Heckbert 1992; Lischinski, Tampieri & Greenberg 1992; Drettakis & Fiume 1994
//! (H92, LTG92, DF94 in `docs/references.md`); orders in `docs/design.md`.

use crate::evaluator::Evaluator;
use crate::intervals::Intervals;
use antumbra_scene::{EdgeId, Face, FaceId, Scene, VertexId};
use glam::DVec3;

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// A vertex and an edge, one of them the emitter's.
    Ve,
    /// Two coplanar edges, one of them the emitter's.
    Ee,
    /// Three skew edges.
    Eee,
    /// The plane of an occluder.
    Facet,
    /// The plane of the emitter.
    Horizon,
    /// An occluder or emitter touches or pierces the receiver.
    Contact,
}

impl EventKind {
    /// All kinds, in the order of reports.
    pub const ALL: [Self; 6] = [
        Self::Ve,
        Self::Ee,
        Self::Eee,
        Self::Facet,
        Self::Horizon,
        Self::Contact,
    ];

    /// The key used in reports and on the command line.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Ve => "ve",
            Self::Ee => "ee",
            Self::Eee => "eee",
            Self::Facet => "facet",
            Self::Horizon => "horizon",
            Self::Contact => "contact",
        }
    }

    /// The kind with this key.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.key() == key)
    }

    /// The first derivative of irradiance that jumps across its curves.
    #[must_use]
    pub fn discontinuity(self) -> Discontinuity {
        match self {
            Self::Contact => Discontinuity::D0,
            Self::Ee | Self::Facet | Self::Horizon => Discontinuity::D1,
            Self::Ve | Self::Eee => Discontinuity::D2,
        }
    }
}

/// Which derivative of irradiance is the first to jump across a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Discontinuity {
    /// Irradiance itself.
    D0,
    /// Its slope.
    D1,
    /// Its curvature.
    D2,
}

/// The features that generate a critical curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Event {
    /// An emitter's vertex and an occluder's edge.
    EmitterVertex {
        /// Of the emitter.
        vertex: VertexId,
        /// Of the occluder.
        edge: EdgeId,
    },
    /// An emitter's edge and an occluder's vertex.
    EmitterEdge {
        /// Of the emitter.
        edge: EdgeId,
        /// Of the occluder.
        vertex: VertexId,
    },
    /// An emitter's edge and an occluder's edge in one plane.
    CoplanarEdges {
        /// Of the emitter.
        emitter: EdgeId,
        /// Of the occluder.
        occluder: EdgeId,
    },
    /// The plane of a face, seen edge-on.
    FacetPlane(FaceId),
    /// The plane of the emitter.
    EmitterPlane(FaceId),
    /// A face that touches or pierces the receiver.
    Contact(FaceId),
}

impl Event {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> EventKind {
        match self {
            Self::EmitterVertex { .. } | Self::EmitterEdge { .. } => EventKind::Ve,
            Self::CoplanarEdges { .. } => EventKind::Ee,
            Self::FacetPlane(_) => EventKind::Facet,
            Self::EmitterPlane(_) => EventKind::Horizon,
            Self::Contact(_) => EventKind::Contact,
        }
    }
}

/// A curve on a receiver across which a derivative of irradiance jumps.
#[derive(Clone, Debug, PartialEq)]
pub struct CriticalCurve {
    /// What generates it.
    pub event: Event,
    /// The emitter; `None` for contacts of occluders, which cut off any light.
    pub emitter: Option<FaceId>,
    /// Polyline in the receiver's plane, scene units; two points for a segment.
    pub points: Vec<DVec3>,
}

impl CriticalCurve {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> EventKind {
        self.event.kind()
    }
}

/// Which kinds of events to enumerate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EventKinds(u8);

impl EventKinds {
    /// Every kind.
    pub const ALL: Self = Self(0x3f);
    /// No kind.
    pub const NONE: Self = Self(0);

    /// With this kind as well.
    #[must_use]
    pub fn with(self, kind: EventKind) -> Self {
        Self(self.0 | 1 << kind as u8)
    }

    /// Is this kind among them?
    #[must_use]
    pub fn contains(self, kind: EventKind) -> bool {
        self.0 & (1 << kind as u8) != 0
    }
}

/// Counts by kind, in the order of [`EventKind::ALL`].
pub type CountByKind = [u64; 6];

/// The critical curves of one receiver.
#[derive(Clone, Debug, Default)]
pub struct CriticalCurves {
    /// Sorted by generators.
    pub curves: Vec<CriticalCurve>,
    /// Generators looked at.
    pub candidates: CountByKind,
    /// Curves that are active.
    pub active: CountByKind,
}

/// Enumerates the critical curves of a receiver.
///
/// * `contact_radius` — gaps smaller than this count as contact; scene units.
#[must_use]
pub fn critical_curves(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    kinds: EventKinds,
    contact_radius: f64,
) -> CriticalCurves {
    let mut tracer = Tracer::new(evaluator, receiver, contact_radius);
    if kinds.contains(EventKind::Contact) {
        tracer.contacts();
    }
    let emitters: Vec<FaceId> = evaluator.emitters().collect();
    for emitter in emitters {
        tracer.emitter(emitter, kinds);
    }
    let mut result = tracer.result;
    result.curves.sort_by(|a, b| {
        let key = |c: &CriticalCurve| (c.event, c.emitter);
        key(a).cmp(&key(b)).then_with(|| {
            let flat = |c: &CriticalCurve| c.points.iter().map(DVec3::to_array).collect::<Vec<_>>();
            flat(a)
                .partial_cmp(&flat(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    for curve in &result.curves {
        result.active[curve.kind() as usize] += 1;
    }
    result
}

/// Heights this close to the apex of a pencil, relative, are cut off: beyond, the
/// projection runs to infinity and out of any receiver.
const NEAR_APEX: f64 = 1e-6;

struct Tracer<'e, 's> {
    evaluator: &'e Evaluator<'s>,
    scene: &'s Scene,
    receiver: FaceId,
    face: &'s Face,
    origin: DVec3,
    /// Loops of the receiver.
    loops: Vec<Vec<DVec3>>,
    size: f64,
    contact_radius: f64,
    tolerance: f64,
    result: CriticalCurves,
}

/// The trace of a plane on the receiver: points `origin + s·direction`.
#[derive(Clone, Copy, Debug)]
struct Trace {
    origin: DVec3,
    direction: DVec3,
    /// Unit normal of the plane.
    normal: DVec3,
}

impl Trace {
    fn parameter(&self, x: DVec3) -> f64 {
        (x - self.origin).dot(self.direction)
    }

    fn at(&self, s: f64) -> DVec3 {
        self.origin + self.direction * s
    }
}

impl<'e, 's> Tracer<'e, 's> {
    fn new(evaluator: &'e Evaluator<'s>, receiver: FaceId, contact_radius: f64) -> Self {
        let scene = evaluator.scene();
        let face = scene.face(receiver);
        let loops: Vec<Vec<DVec3>> = face.loops().map(|l| scene.positions(l)).collect();
        let bounds = antumbra_scene::Aabb::of(loops[0].iter().copied());
        Self {
            evaluator,
            scene,
            receiver,
            face,
            origin: loops[0][0],
            size: (bounds.max - bounds.min).length(),
            loops,
            contact_radius,
            tolerance: scene.plane_tolerance(),
            result: CriticalCurves::default(),
        }
    }

    fn height(&self, x: DVec3) -> f64 {
        self.face.normal.dot(x - self.origin)
    }

    fn push(&mut self, event: Event, emitter: Option<FaceId>, points: Vec<DVec3>) {
        self.result.curves.push(CriticalCurve {
            event,
            emitter,
            points,
        });
    }

    /// The trace of the plane through `point` with this normal on the receiver.
    fn trace(&self, point: DVec3, normal: DVec3) -> Option<Trace> {
        let n = self.face.normal;
        let along = n.cross(normal);
        let sine_sq = along.length_squared();
        if sine_sq < 1e-18 {
            return None;
        }
        // From the receiver's first corner along the steepest way to the plane.
        let across = normal - n * n.dot(normal);
        let origin = self.origin - across * (normal.dot(self.origin - point) / sine_sq);
        Some(Trace {
            origin,
            direction: along / sine_sq.sqrt(),
            normal,
        })
    }

    /// Where a trace runs inside the receiver. The ends lie on the border up to
    /// rounding; the arrangement joins them to it.
    fn inside_receiver(&self, trace: &Trace) -> Intervals {
        let mut crossings = Vec::new();
        for corners in &self.loops {
            let n = corners.len();
            for i in 0..n {
                let (a, b) = (corners[i], corners[(i + 1) % n]);
                let (da, db) = (
                    trace.normal.dot(a - trace.origin),
                    trace.normal.dot(b - trace.origin),
                );
                if (da > 0.0) != (db > 0.0) {
                    crossings.push(trace.parameter(a + (b - a) * (da / (da - db))));
                }
            }
        }
        crossings.sort_by(f64::total_cmp);
        let mut intervals: Vec<(f64, f64)> = Vec::new();
        for pair in crossings.chunks_exact(2) {
            let (from, to) = (pair[0], pair[1]);
            match intervals.last_mut() {
                Some(last) if last.1 >= from => last.1 = to,
                _ => intervals.push((from, to)),
            }
        }
        Intervals::from_sorted(intervals)
    }

    /// Pushes a segment for every interval.
    fn emit(&mut self, event: Event, emitter: Option<FaceId>, trace: &Trace, active: &Intervals) {
        let mut active = active.clone();
        active.drop_shorter(self.contact_radius);
        for (from, to) in active.iter() {
            self.push(event, emitter, vec![trace.at(from), trace.at(to)]);
        }
    }

    // ----- contacts ------------------------------------------------------

    /// D0: where faces touch or pierce the receiver.
    fn contacts(&mut self) {
        let r = self.contact_radius;
        let bounds = antumbra_scene::Aabb::of(self.loops[0].iter().copied());
        let near = antumbra_scene::Aabb {
            min: bounds.min - r,
            max: bounds.max + r,
        };
        let mut faces: Vec<FaceId> = Vec::new();
        self.scene.tree.visit(
            |b| b.meets(&near),
            |piece| faces.push(self.scene.pieces[piece as usize].face),
        );
        faces.sort_unstable();
        faces.dedup();
        for id in faces {
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
                if h[i].abs() <= r && h[j].abs() <= r {
                    segments.push((foot(corners[i], h[i], self), foot(corners[j], h[j], self)));
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
    /// border's own edge is then marked as a contact too.
    fn inside_receiver_or_border(&self, trace: &Trace) -> Intervals {
        let r = self.contact_radius;
        for corners in &self.loops {
            for i in 0..corners.len() {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                let off = |x: DVec3| trace.normal.dot(x - trace.origin).abs();
                if off(a) <= r && off(b) <= r {
                    let (s, t) = (trace.parameter(a), trace.parameter(b));
                    let mut all: Vec<(f64, f64)> = self.inside_receiver(trace).iter().collect();
                    all.push((s.min(t), s.max(t)));
                    all.sort_by(|x, y| x.0.total_cmp(&y.0));
                    let mut merged: Vec<(f64, f64)> = Vec::new();
                    for (from, to) in all {
                        match merged.last_mut() {
                            Some(last) if last.1 >= from => last.1 = last.1.max(to),
                            _ => merged.push((from, to)),
                        }
                    }
                    return Intervals::from_sorted(merged);
                }
            }
        }
        self.inside_receiver(trace)
    }

    // ----- one emitter ---------------------------------------------------

    fn emitter(&mut self, emitter: FaceId, kinds: EventKinds) {
        let lamp = self.scene.face(emitter);
        if lamp.plane == self.face.plane {
            return;
        }
        let lamp_outline = self.scene.positions(&lamp.outline);
        let outline = self.loops[0].clone();
        let Some(between) = self.evaluator.between(
            &outline,
            (self.face.normal, self.face.plane),
            &lamp_outline,
            (lamp.normal, lamp.plane),
        ) else {
            return;
        };
        let shaft = Shaft::new(self.scene, emitter, &between);
        if kinds.contains(EventKind::Horizon) {
            self.horizon(&shaft);
        }
        if kinds.contains(EventKind::Facet) {
            self.facets(&shaft);
        }
        for &edge in &shaft.edges {
            if kinds.contains(EventKind::Ee) {
                for &lamp_edge in &shaft.lamp_edges {
                    self.coplanar_edges(&shaft, lamp_edge, edge);
                }
            }
            if kinds.contains(EventKind::Ve) {
                for &vertex in &shaft.lamp_vertices {
                    self.emitter_vertex(&shaft, vertex, edge);
                }
            }
        }
        if kinds.contains(EventKind::Ve) {
            for &vertex in &shaft.vertices {
                for &lamp_edge in &shaft.lamp_edges {
                    self.emitter_edge(&shaft, lamp_edge, vertex);
                }
            }
        }
    }

    /// D1: the emitter's plane crosses the receiver.
    fn horizon(&mut self, shaft: &Shaft<'_>) {
        let lamp = shaft.lamp;
        let sides = |t: f64| {
            self.loops[0]
                .iter()
                .any(|&x| shaft.lamp_height(x) * t > self.tolerance)
        };
        self.result.candidates[EventKind::Horizon as usize] += 1;
        if !(sides(1.0) && sides(-1.0)) {
            return;
        }
        let point = self.scene.position(lamp.outline[0]);
        if let Some(trace) = self.trace(point, lamp.normal) {
            let inside = self.inside_receiver(&trace);
            self.emit(
                Event::EmitterPlane(shaft.emitter),
                Some(shaft.emitter),
                &trace,
                &inside,
            );
        }
    }

    /// D1: the plane of an occluder crosses the receiver and cuts the emitter.
    fn facets(&mut self, shaft: &Shaft<'_>) {
        for &id in &shaft.faces {
            self.result.candidates[EventKind::Facet as usize] += 1;
            let face = self.scene.face(id);
            let plane = self.scene.planes[face.plane.index()];
            let Some(trace) = self.trace(plane.point, plane.normal) else {
                continue;
            };
            let inside = self.inside_receiver(&trace);
            if inside.is_empty() {
                continue;
            }
            // Chords of the emitter in the plane.
            let mut lamp_points = Vec::new();
            for piece in shaft.lamp_pieces(self.scene) {
                let corners = self.scene.positions(&piece);
                let h: Vec<f64> = corners
                    .iter()
                    .map(|&c| {
                        let d = plane.distance(c);
                        if d.abs() <= self.tolerance { 0.0 } else { d }
                    })
                    .collect();
                if h.iter().any(|&h| h > 0.0)
                    && h.iter().any(|&h| h < 0.0)
                    && let Some((a, b)) = chord(&corners, &h)
                {
                    lamp_points.extend([a, b]);
                }
            }
            if lamp_points.is_empty() {
                continue;
            }
            let outline = self.scene.positions(&face.outline);
            if let Some((from, to)) = self.shadow_in_plane(shaft, &trace, &lamp_points, &outline) {
                let active = Intervals::one(from, to).intersect(&inside);
                self.emit(Event::FacetPlane(id), Some(shaft.emitter), &trace, &active);
            }
        }
    }

    /// The part of a trace that some point of the emitter in the trace's plane
    /// sees through `outline`, a figure in that plane: from the least to the
    /// largest projection of its corners from the emitter's points.
    fn shadow_in_plane(
        &self,
        shaft: &Shaft<'_>,
        trace: &Trace,
        lamp_points: &[DVec3],
        outline: &[DVec3],
    ) -> Option<(f64, f64)> {
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for &y in lamp_points {
            let top = self.height(y);
            if top <= self.tolerance {
                continue;
            }
            // Only what lies between receiver and apex casts a shadow on it.
            let below = clip(outline, |x| top * (1.0 - NEAR_APEX) - self.height(x));
            let below = clip(&below, |x| self.height(x));
            let below = clip(&below, |x| shaft.lamp_height(x));
            for x in below {
                let s = trace.parameter(self.project(y, x));
                (from, to) = (from.min(s), to.max(s));
            }
        }
        (from < to).then_some((from, to))
    }

    /// The point of the receiver's plane on the line from `apex` through `x`.
    fn project(&self, apex: DVec3, x: DVec3) -> DVec3 {
        let (top, h) = (self.height(apex), self.height(x));
        apex + (x - apex) * (top / (top - h))
    }

    /// D1: an occluder's edge in one plane with an emitter's edge.
    fn coplanar_edges(&mut self, shaft: &Shaft<'_>, lamp_edge: EdgeId, edge: EdgeId) {
        self.result.candidates[EventKind::Ee as usize] += 1;
        if self.lies_on_receiver(edge) {
            return;
        }
        let Some(normal) = self.common_plane(lamp_edge, edge) else {
            return;
        };
        if !is_silhouette(self.scene, edge, normal) {
            return;
        }
        let [u, w] = self.ends(lamp_edge);
        let ends = self.ends(edge);
        let Some(trace) = self.trace(u, normal) else {
            return;
        };
        let inside = self.inside_receiver(&trace);
        if inside.is_empty() {
            return;
        }
        let mut marks = Vec::new();
        for y in [u, w] {
            if let Some((a, b)) = self.shadow_in_plane(shaft, &trace, &[y], &ends) {
                marks.extend([a, b]);
            }
        }
        marks.sort_by(f64::total_cmp);
        marks.dedup_by(|a, b| *a - *b <= 1e-12 * self.size);
        let event = Event::CoplanarEdges {
            emitter: lamp_edge,
            occluder: edge,
        };
        // It breaks where the projections of the ends lie.
        for pair in marks.windows(2) {
            let active = Intervals::one(pair[0], pair[1]).intersect(&inside);
            self.emit(event, Some(shaft.emitter), &trace, &active);
        }
    }

    fn ends(&self, edge: EdgeId) -> [DVec3; 2] {
        self.scene.edges[edge.index()]
            .ends
            .map(|v| self.scene.position(v))
    }

    /// The unit normal of the plane that holds both edges, if one does.
    fn common_plane(&self, e: EdgeId, f: EdgeId) -> Option<DVec3> {
        let ([a, b], [c, d]) = (self.ends(e), self.ends(f));
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
        (spread <= 4.0 * self.tolerance).then_some(normal)
    }

    /// D2: lines from an emitter's vertex along an occluder's edge.
    fn emitter_vertex(&mut self, shaft: &Shaft<'_>, vertex: VertexId, edge: EdgeId) {
        self.result.candidates[EventKind::Ve as usize] += 1;
        let v = self.scene.position(vertex);
        let ends = &self.scene.edges[edge.index()].ends;
        if ends.contains(&vertex) || self.height(v) <= self.tolerance || self.lies_on_receiver(edge)
        {
            return;
        }
        let [a, b] = self.ends(edge);
        let Some(normal) = wedge_normal(v, a, b) else {
            return;
        };
        if !is_silhouette(self.scene, edge, normal) {
            return;
        }
        // A plane that holds an edge of the emitter at this vertex is an EE event,
        // one in the plane of a face at this edge a facet event.
        if shaft.is_lamp_edge_in_plane(self, vertex, v, normal) {
            return;
        }
        let Some(trace) = self.trace(v, normal) else {
            return;
        };
        let inside = self.inside_receiver(&trace);
        if inside.is_empty() {
            return;
        }
        let Some((from, to)) = self.shadow_in_plane(shaft, &trace, &[v], &[a, b]) else {
            return;
        };
        let mut active = Intervals::one(from, to).intersect(&inside);
        active = active.intersect(&self.in_front_of(shaft, &trace));
        self.subtract_blocked(shaft, &trace, v, None, &[vertex], &mut active);
        let event = Event::EmitterVertex { vertex, edge };
        self.emit(event, Some(shaft.emitter), &trace, &active);
    }

    /// D2: lines from an emitter's edge through an occluder's vertex.
    fn emitter_edge(&mut self, shaft: &Shaft<'_>, lamp_edge: EdgeId, vertex: VertexId) {
        self.result.candidates[EventKind::Ve as usize] += 1;
        let a = self.scene.position(vertex);
        let top = self.height(a);
        if top <= self.contact_radius || shaft.lamp_height(a) <= self.tolerance {
            return;
        }
        if self.scene.edges[lamp_edge.index()].ends.contains(&vertex) {
            return;
        }
        let [u, w] = self.ends(lamp_edge);
        let Some(normal) = wedge_normal(a, u, w) else {
            return;
        };
        // A silhouette edge at this vertex in the same plane makes it an EE event.
        let edges = shaft.edges_at(vertex);
        if edges.iter().any(|&e| {
            let other = self.other_end(e, vertex);
            normal.dot(other - a).abs() <= 4.0 * self.tolerance
        }) {
            return;
        }
        let Some(trace) = self.trace(a, normal) else {
            return;
        };
        let inside = self.inside_receiver(&trace);
        if inside.is_empty() {
            return;
        }
        // The emitter's edge above the vertex.
        let above = clip(&[u, w], |y| self.height(y) - top * (1.0 + NEAR_APEX));
        let [u, w] = above.as_slice() else { return };
        let (u, w) = (*u, *w);
        // Silhouette changes along the pencil: where its line lies in a face at
        // the vertex. n·(a − y) is linear along the emitter's edge.
        let mut breaks = vec![0.0, 1.0];
        for &e in edges {
            for &f in &self.scene.edges[e.index()].faces {
                let n = self.scene.face(f).normal;
                let (p, q) = (n.dot(a - u), n.dot(a - w));
                if p * q < 0.0 {
                    breaks.push(p / (p - q));
                }
            }
        }
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|x, y| *x - *y < 1e-12);
        let shadow = |t: f64| trace.parameter(self.project(u + (w - u) * t, a));
        let mut active: Vec<(f64, f64)> = Vec::new();
        for pair in breaks.windows(2) {
            let middle = (pair[0] + pair[1]) / 2.0;
            let d = a - (u + (w - u) * middle);
            let is_outline = edges.iter().any(|&e| {
                let along = self.other_end(e, vertex) - a;
                is_silhouette(self.scene, e, along.cross(d).normalize_or_zero())
            });
            if is_outline {
                let (s, t) = (shadow(pair[0]), shadow(pair[1]));
                match active.last_mut() {
                    Some(last) if last.1 == s.min(t) => last.1 = s.max(t),
                    Some(last) if last.0 == s.max(t) => last.0 = s.min(t),
                    _ => active.push((s.min(t), s.max(t))),
                }
            }
        }
        active.sort_by(|x, y| x.0.total_cmp(&y.0));
        let mut active = Intervals::from_sorted(active).intersect(&inside);
        self.subtract_blocked(shaft, &trace, a, Some(()), &[vertex], &mut active);
        let event = Event::EmitterEdge {
            edge: lamp_edge,
            vertex,
        };
        self.emit(event, Some(shaft.emitter), &trace, &active);
    }

    /// Is the edge a contact, whose shadow is the edge itself?
    fn lies_on_receiver(&self, edge: EdgeId) -> bool {
        self.ends(edge)
            .iter()
            .all(|&x| self.height(x) <= self.contact_radius)
    }

    fn other_end(&self, edge: EdgeId, vertex: VertexId) -> DVec3 {
        let ends = self.scene.edges[edge.index()].ends;
        self.scene
            .position(if ends[0] == vertex { ends[1] } else { ends[0] })
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

    /// Removes from `active` where a surface stands in the pencil of lines with
    /// this apex: between apex and receiver, and (if the apex is the occluder's)
    /// between emitter and apex.
    fn subtract_blocked(
        &self,
        shaft: &Shaft<'_>,
        trace: &Trace,
        apex: DVec3,
        through: Option<()>,
        skip: &[VertexId],
        active: &mut Intervals,
    ) {
        let top = self.height(apex);
        for &id in &shaft.pieces {
            if active.is_empty() {
                return;
            }
            let piece = &self.scene.pieces[id as usize];
            if piece.vertices.iter().any(|v| skip.contains(v)) {
                continue;
            }
            let corners: smallvec::SmallVec<[DVec3; 8]> = piece
                .vertices
                .iter()
                .map(|&v| self.scene.position(v))
                .collect();
            let sides: smallvec::SmallVec<[f64; 8]> = corners
                .iter()
                .map(|&c| {
                    let d = trace.normal.dot(c - apex);
                    if d.abs() <= 4.0 * self.tolerance {
                        0.0
                    } else {
                        d
                    }
                })
                .collect();
            if !(sides.iter().any(|&d| d > 0.0) && sides.iter().any(|&d| d < 0.0)) {
                continue;
            }
            let Some((p, q)) = chord(&corners, &sides) else {
                continue;
            };
            let in_front = clip(&[p, q], |x| shaft.lamp_height(x));
            let below = clip(&in_front, |x| top * (1.0 - NEAR_APEX) - self.height(x));
            let below = clip(&below, |x| self.height(x));
            let above = if through.is_some() {
                clip(&in_front, |x| self.height(x) - top * (1.0 + NEAR_APEX))
            } else {
                Vec::new()
            };
            for part in [below, above] {
                if let [p, q] = part.as_slice() {
                    let (s, t) = (
                        trace.parameter(self.project(apex, *p)),
                        trace.parameter(self.project(apex, *q)),
                    );
                    active.subtract(s.min(t), s.max(t));
                }
            }
        }
    }
}

/// What stands between a receiver and an emitter.
struct Shaft<'s> {
    emitter: FaceId,
    lamp: &'s Face,
    lamp_point: DVec3,
    lamp_vertices: Vec<VertexId>,
    lamp_edges: Vec<EdgeId>,
    /// Positions in `Scene::pieces`.
    pieces: Vec<u32>,
    faces: Vec<FaceId>,
    edges: Vec<EdgeId>,
    vertices: Vec<VertexId>,
    /// `edges` of each of `vertices`.
    edges_at: Vec<Vec<EdgeId>>,
}

impl<'s> Shaft<'s> {
    fn new(scene: &'s Scene, emitter: FaceId, pieces: &[u32]) -> Self {
        let lamp = scene.face(emitter);
        let mut faces: Vec<FaceId> = pieces
            .iter()
            .map(|&p| scene.pieces[p as usize].face)
            .collect();
        faces.dedup();
        faces.sort_unstable();
        faces.dedup();
        let edges_of = |face: &Face| -> Vec<EdgeId> {
            face.loops()
                .flat_map(|l| {
                    (0..l.len()).filter_map(|i| scene.edge_between(l[i], l[(i + 1) % l.len()]))
                })
                .collect()
        };
        let mut edges: Vec<EdgeId> = faces
            .iter()
            .flat_map(|&f| edges_of(scene.face(f)))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut vertices: Vec<VertexId> = edges
            .iter()
            .flat_map(|e| scene.edges[e.index()].ends)
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut edges_at = vec![Vec::new(); vertices.len()];
        for &e in &edges {
            for v in scene.edges[e.index()].ends {
                if let Ok(i) = vertices.binary_search(&v) {
                    edges_at[i].push(e);
                }
            }
        }
        let mut lamp_vertices: Vec<VertexId> = lamp.loops().flatten().copied().collect();
        lamp_vertices.sort_unstable();
        lamp_vertices.dedup();
        let mut lamp_edges = edges_of(lamp);
        lamp_edges.sort_unstable();
        lamp_edges.dedup();
        Self {
            emitter,
            lamp,
            lamp_point: scene.position(lamp.outline[0]),
            lamp_vertices,
            lamp_edges,
            pieces: pieces.to_vec(),
            faces,
            edges,
            vertices,
            edges_at,
        }
    }

    /// Height over the emitter's front.
    fn lamp_height(&self, x: DVec3) -> f64 {
        self.lamp.normal.dot(x - self.lamp_point)
    }

    fn lamp_pieces(&self, scene: &Scene) -> Vec<Vec<VertexId>> {
        scene.pieces[self.lamp.pieces.start as usize..self.lamp.pieces.end as usize]
            .iter()
            .map(|p| p.vertices.clone())
            .collect()
    }

    fn edges_at(&self, vertex: VertexId) -> &[EdgeId] {
        self.vertices
            .binary_search(&vertex)
            .map_or(&[], |i| &self.edges_at[i])
    }

    /// Does an edge of the emitter at `vertex` lie in the plane through it?
    fn is_lamp_edge_in_plane(
        &self,
        tracer: &Tracer<'_, '_>,
        vertex: VertexId,
        v: DVec3,
        normal: DVec3,
    ) -> bool {
        self.lamp_edges
            .iter()
            .filter(|e| tracer.scene.edges[e.index()].ends.contains(&vertex))
            .any(|&e| normal.dot(tracer.other_end(e, vertex) - v).abs() <= 4.0 * tracer.tolerance)
    }
}

/// The unit normal of the plane through a vertex and an edge, unless they are
/// nearly collinear.
fn wedge_normal(v: DVec3, a: DVec3, b: DVec3) -> Option<DVec3> {
    let normal = (a - v).cross(b - v);
    let scale_sq =
        (b - a).length_squared() * (a - v).length_squared().max((b - v).length_squared());
    // 2⁻⁴⁰ of the product: below, the plane's direction is rounding.
    (normal.length_squared() > 2f64.powi(-80) * scale_sq).then(|| normal.normalize_or_zero())
}

/// Do all faces at an edge lie on one side of the plane through the edge with
/// this normal? Then lines of the plane that touch the edge graze the outline.
///
/// Faces in the plane itself are seen edge-on and have no say.
fn is_silhouette(scene: &Scene, edge: EdgeId, normal: DVec3) -> bool {
    let edge = &scene.edges[edge.index()];
    let [a, b] = edge.ends.map(|v| scene.position(v));
    let along = b - a;
    let (mut above, mut below) = (false, false);
    for &f in &edge.faces {
        let face = scene.face(f);
        // In the face, perpendicular to the edge, towards the face.
        let mut inward = face.normal.cross(along).normalize_or_zero();
        if !runs_along(face, edge.ends) {
            inward = -inward;
        }
        let d = normal.dot(inward);
        above |= d > 1e-9;
        below |= d < -1e-9;
    }
    !(above && below)
}

/// Does a face's outline (or hole) run from the first end to the second?
fn runs_along(face: &Face, [a, b]: [VertexId; 2]) -> bool {
    face.loops()
        .any(|l| (0..l.len()).any(|i| l[i] == a && l[(i + 1) % l.len()] == b))
}

/// The chord in which a plane cuts a convex polygon, from the signed distances of
/// its corners; `None` if it only touches a corner.
fn chord(corners: &[DVec3], distances: &[f64]) -> Option<(DVec3, DVec3)> {
    let n = corners.len();
    let mut ends: smallvec::SmallVec<[DVec3; 4]> = smallvec::SmallVec::new();
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

/// Clips a convex outline (or a segment of two points) to where `height` is not
/// negative; `height` must be affine.
fn clip(outline: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let n = outline.len();
    let mut kept = Vec::with_capacity(n + 1);
    for i in 0..n {
        let (a, b) = (outline[i], outline[(i + 1) % n]);
        let (p, q) = (height(a), height(b));
        if p >= 0.0 {
            kept.push(a);
        }
        // A segment has one edge, not two.
        let is_edge = n > 2 || i + 1 < n;
        if is_edge && ((p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0)) {
            kept.push(a + (b - a) * (p / (p - q)));
        }
    }
    kept
}
