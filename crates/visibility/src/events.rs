//! Events and the critical curves where their swaths meet a receiver.
//!
//! An event is a set of features whose common stabbing lines change what is
//! seen. Its lines are a *swath*: a pencil in a plane (VE, EE, facet, horizon) or
//! one family of lines of a quadric (EEE). Every clip (the ends of an edge, a
//! silhouette change, a blocking surface, the border of emitter or receiver) is a
//! root of a polynomial of degree one or two in the swath's parameter, hence
//! closed form; an interval between roots is kept or dropped as a whole.
//!
//! # Source
//!
//! Heckbert 1992; Lischinski, Tampieri & Greenberg 1992; Drettakis & Fiume 1994
//! (H92, LTG92, DF94 in `docs/references.md`); orders and jumps in `docs/design.md`.

mod contact;
mod coplanar;
mod curve;
mod joint;
mod jump;
mod roots;
pub(crate) mod shaft;
mod sheet;
mod swath;
mod trace;
mod tracer;

pub use curve::{CriticalCurve, CurveEnd, JUMP_PLACES, Shape};
pub use jump::jump_at;

use crate::evaluator::Evaluator;
use antumbra_geom::Control;
use antumbra_scene::{EdgeId, FaceId, VertexId};
use tracer::{Jumps, Tracer};

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// A vertex and an edge.
    Ve,
    /// Two coplanar edges.
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
    /// An occluder's vertex and another's edge, the line ending inside the emitter.
    VertexEdge {
        /// Of one occluder.
        vertex: VertexId,
        /// Of the other.
        edge: EdgeId,
    },
    /// An emitter's edge and an occluder's edge in one plane.
    CoplanarEdges {
        /// Of the emitter.
        emitter: EdgeId,
        /// Of the occluder.
        occluder: EdgeId,
    },
    /// Two occluders' edges in one plane that cuts the emitter; ascending.
    OccluderEdges([EdgeId; 2]),
    /// An emitter's edge and two occluders' edges, pairwise skew.
    EmitterTriple {
        /// Of the emitter.
        emitter: EdgeId,
        /// Of the occluders, ascending.
        occluders: [EdgeId; 2],
    },
    /// Three occluders' edges, pairwise skew, the line ending inside the emitter;
    /// ascending.
    Triple([EdgeId; 3]),
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
            Self::EmitterVertex { .. } | Self::EmitterEdge { .. } | Self::VertexEdge { .. } => {
                EventKind::Ve
            }
            Self::CoplanarEdges { .. } | Self::OccluderEdges(_) => EventKind::Ee,
            Self::EmitterTriple { .. } | Self::Triple(_) => EventKind::Eee,
            Self::FacetPlane(_) => EventKind::Facet,
            Self::EmitterPlane(_) => EventKind::Horizon,
            Self::Contact(_) => EventKind::Contact,
        }
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
    /// Generators whose swath was built and clipped.
    pub candidates: CountByKind,
    /// Curves that are active.
    pub active: CountByKind,
}

/// Enumerates the critical curves of a receiver.
///
/// Nothing if it is stopped: some of the curves are of no use, for the mesh between them
/// would be taken to be smooth.
///
/// * `contact_radius` — gaps smaller than this count as contact; scene units.
#[must_use]
pub fn critical_curves(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    kinds: EventKinds,
    contact_radius: f64,
    control: &Control<'_>,
) -> Option<CriticalCurves> {
    let stop = control.stop;
    if stop.is_wanted() {
        return None;
    }
    if evaluator.scene().face(receiver).is_covered {
        return Some(CriticalCurves::default());
    }
    let mut tracer = Tracer::new(evaluator, receiver, contact_radius, stop);
    if kinds.contains(EventKind::Contact) {
        tracer.contacts();
    }
    if kinds != EventKinds::NONE.with(EventKind::Contact) {
        for emitter in evaluator.emitters() {
            tracer.emitter(emitter, kinds);
        }
    }
    if stop.is_wanted() {
        return None;
    }
    let mut result = tracer.result;
    sort(&mut result.curves);
    for curve in &result.curves {
        result.active[curve.kind() as usize] += 1;
    }
    Some(result)
}

/// The critical curves on a receiver of one face as if it were the only emitter;
/// contacts are not among them, and the jumps of VE and EEE curves are not measured.
///
/// * `occluders` — what may stand between, positions in
///   [`antumbra_scene::Scene::pieces`], ascending: from [`Evaluator::between`] or
///   [`Evaluator::narrow`].
/// * `contact_radius` — gaps smaller than this count as contact; scene units.
/// * `stop` — nothing if it was stopped.
#[must_use]
pub fn critical_curves_between(
    evaluator: &Evaluator<'_>,
    receiver: FaceId,
    emitter: FaceId,
    occluders: Vec<u32>,
    kinds: EventKinds,
    contact_radius: f64,
    control: &Control<'_>,
) -> Option<Vec<CriticalCurve>> {
    let stop = control.stop;
    let mut tracer = Tracer::new(evaluator, receiver, contact_radius, stop);
    tracer.jumps = Jumps::Unknown;
    tracer.emitter_behind(emitter, occluders, kinds);
    if stop.is_wanted() {
        return None;
    }
    let mut curves = tracer.result.curves;
    sort(&mut curves);
    Some(curves)
}

/// Sorts curves by their generators, then by where they are.
fn sort(curves: &mut [CriticalCurve]) {
    curves.sort_by(|a, b| {
        let key = |c: &CriticalCurve| (c.event, c.emitter);
        key(a).cmp(&key(b)).then_with(|| {
            let [p, q] = [a.shape.ends(), b.shape.ends()];
            let flat = |ends: [glam::DVec3; 2]| ends.map(|x| x.to_array());
            flat(p)
                .partial_cmp(&flat(q))
                .unwrap_or(std::cmp::Ordering::Equal)
        })
    });
}
