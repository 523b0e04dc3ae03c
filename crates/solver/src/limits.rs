//! What the work has to keep to: time, memory, interruption.

use antumbra_geom::Stop;
use std::fmt;

/// When to stop, and how much memory there is.
///
/// Work that is stopped ends with what there is, which is valid: values are exact
/// wherever there are any. What is finished by then may differ from run to run; without
/// a stop the result does not depend on the limits.
#[derive(Clone, Copy)]
pub struct Limits<'a> {
    /// Wanted when the work is to end: receivers that have no values yet get coarse
    /// meshes, and nothing is refined any more.
    pub stop: Stop<'a>,
    /// Wanted when there is no time left for coarse meshes either.
    pub at_once: Stop<'a>,
    /// Is there room for so many bytes more? Asked before large allocations.
    pub has_room: &'a (dyn Fn(u64) -> bool + Sync),
}

impl Limits<'_> {
    /// No limits.
    pub const NONE: Self = Self {
        stop: Stop::NEVER,
        at_once: Stop::NEVER,
        has_room: &|_| true,
    };
}

impl Default for Limits<'_> {
    fn default() -> Self {
        Self::NONE
    }
}

impl fmt::Debug for Limits<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Limits")
    }
}
