//! What long work has to keep to, and whom it tells.

use crate::Stop;
use std::fmt;

/// A phase of the work, for progress and timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Enumerating events and their critical curves.
    Events,
    /// Arrangement of the curves and triangulation.
    Arrangement,
    /// Exact values and refinement.
    Irradiance,
    /// Interreflection.
    Radiosity,
    /// Form factors between surfaces.
    Factors,
    /// Error against time for every mesh generator.
    Study,
}

impl Phase {
    /// The name in progress bars and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Events => "events",
            Self::Arrangement => "arrangement",
            Self::Irradiance => "irradiance",
            Self::Radiosity => "radiosity",
            Self::Factors => "factors",
            Self::Study => "study",
        }
    }
}

/// How the caller watches and stops the work: passed last to all that may take long.
///
/// Work that is stopped ends with what there is, which is valid: values are exact
/// wherever there are any. What is finished by then may differ from run to run; what is
/// not stopped does not depend on being watched.
///
/// # Example
///
/// ```
/// use antumbra_geom::{Control, Stop};
/// use std::sync::atomic::{AtomicBool, Ordering};
///
/// let interrupted = AtomicBool::new(false);
/// let is_wanted = || interrupted.load(Ordering::Relaxed);
/// let control = Control { stop: Stop::new(&is_wanted), ..Control::NEVER };
/// assert!(!control.stop.is_wanted());
/// ```
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// End with what there is? Then receivers without values get coarse meshes with
    /// exact values, and nothing is refined any more.
    pub stop: Stop<'a>,
    /// Is there no time left for coarse meshes either? Asked after `stop` has said yes:
    /// receivers that have no values yet are then left without elements.
    pub at_once: Stop<'a>,
    /// Is there room for so many bytes more? Asked before what would take a lot of
    /// memory at once.
    pub has_room: &'a (dyn Fn(u64) -> bool + Sync),
    /// Told the phase and how much of it is done, 0 to 1. Each phase starts at 0.
    pub progress: &'a (dyn Fn(Phase, f64) + Sync),
}

impl Control<'_> {
    /// Never stops, has all memory, tells nobody.
    pub const NEVER: Self = Self {
        stop: Stop::NEVER,
        at_once: Stop::NEVER,
        has_room: &|_| true,
        progress: &|_, _| {},
    };
}

impl<'a> Control<'a> {
    /// Nothing but this stop: who has one ends there, and at once.
    #[must_use]
    pub fn stopping(stop: Stop<'a>) -> Self {
        Self {
            stop,
            at_once: stop,
            ..Control::NEVER
        }
    }

    /// The same, telling nobody of progress.
    #[must_use]
    pub fn quiet(self) -> Self {
        Self {
            progress: Control::NEVER.progress,
            ..self
        }
    }
}

impl Default for Control<'_> {
    fn default() -> Self {
        Self::NEVER
    }
}

impl fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Control")
    }
}
