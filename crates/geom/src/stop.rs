//! Ending long work early.

use std::fmt;

/// Asked in every loop that can run long: end with what there is?
///
/// Asking must be cheap, a look at a flag, for it is done every few microseconds.
/// Who has once said yes must keep saying so. Without a yes, results do not depend on
/// being asked.
#[derive(Clone, Copy)]
pub struct Stop<'a>(&'a (dyn Fn() -> bool + Sync));

impl<'a> Stop<'a> {
    /// Never stops.
    pub const NEVER: Self = Self(&|| false);

    /// Stops when this says so.
    #[must_use]
    pub fn new(is_wanted: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self(is_wanted)
    }

    /// Is the work to end?
    #[must_use]
    pub fn is_wanted(self) -> bool {
        (self.0)()
    }
}

impl Default for Stop<'_> {
    fn default() -> Self {
        Self::NEVER
    }
}

impl fmt::Debug for Stop<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Stop")
    }
}
