//! Exact visibility between polygons.
//!
//! [`Evaluator`] answers how much of every emitter a point sees, in closed form,
//! whatever stands between: no sampling anywhere. [`critical_curves`] enumerates
//! the events whose curves bound shadows on a receiver. [`Evaluator::visible_faces`] gives
//! all that a point sees at once.

mod adjacency;
mod border;
mod cone;
mod evaluator;
mod events;
mod fragments;
mod intervals;
mod lambert;
mod place;
mod visibility_map;

pub use evaluator::occluders::LONGEST_NARROWED_LIST;
pub use evaluator::{Evaluator, Scratch, Seen, Source, View};
pub use events::{
    CountByKind, CriticalCurve, CriticalCurves, CurveEnd, Discontinuity, Event, EventKind,
    EventKinds, JUMP_PLACES, Shape, critical_curves, critical_curves_between, jump_at,
};
pub use lambert::contour_sum;
pub use place::{Approach, Place};
pub use visibility_map::{MapScratch, MapTotals, VisiblePart};
