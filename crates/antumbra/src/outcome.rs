//! What the work ends with.

use crate::plan::Plan;
use antumbra_mesh::MeshError;
use antumbra_solver::{Improvement, Radiosity, Reached, Solution};
use antumbra_visibility::{CountByKind, CriticalCurve};

/// Why a scene could not be meshed: a bug of ours, told with the surface's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("surface '{surface}': {error}")]
pub struct Error {
    /// The surface.
    pub surface: String,
    /// What went wrong.
    pub error: MeshError,
}

/// The curves of one receiver as they went into its mesh; those of its border only if
/// the work was stopped before that.
#[derive(Clone, Debug, Default)]
pub struct ReceiverCurves {
    /// Curves with an id below this are loops of the border.
    pub n_border: usize,
    /// The others, in the order of their ids.
    pub critical: Vec<CriticalCurve>,
}

/// Events by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventCounts {
    /// Generators looked at.
    pub candidates: CountByKind,
    /// Curves found active.
    pub active: CountByKind,
    /// Curves with at least one edge in a mesh.
    pub inserted: CountByKind,
}

/// A scene that was meshed or solved.
#[derive(Debug)]
pub struct Outcome {
    /// One mesh per face of the scene, in their order.
    pub mesh: Solution,
    /// Interreflection, if it was asked for: power balance, row sums, and what was gathered
    /// from.
    pub radiosity: Option<Radiosity>,
    /// The curves of every mesh; empty for cells.
    pub curves: Vec<ReceiverCurves>,
    /// Events of all receivers; none for cells.
    pub events: EventCounts,
    /// What was simulated, and why; `None` for cells.
    pub plan: Option<Plan>,
    /// Why cells are not as small as was asked for.
    pub limit: Option<SizeLimit>,
    /// What the steps after meshing did.
    pub improvements: Vec<Improvement>,
}

impl Outcome {
    /// Of a mesh that knows no curves.
    pub(crate) fn of_cells(mesh: Solution) -> Self {
        Self {
            curves: vec![ReceiverCurves::default(); mesh.receivers.len()],
            mesh,
            radiosity: None,
            events: EventCounts::default(),
            plan: None,
            limit: None,
            improvements: Vec::new(),
        }
    }

    /// Did the work end with what there was?
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        let is_solved = |r: &Radiosity| r.reached == Reached::Finished;
        self.mesh.is_stopped() || !self.radiosity.as_ref().is_none_or(is_solved)
    }

    /// Is all as it was asked for: the tolerance kept, interreflection converged?
    #[must_use]
    pub fn has_reached_goal(&self) -> bool {
        self.mesh.has_reached_goal() && self.radiosity.as_ref().is_none_or(|r| r.is_converged)
    }
}

/// What kept elements from being as small, or as many, as was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeLimit {
    /// More elements than [`crate::Options::most_elements`]: only the mesh that refinement
    /// begins with was made.
    MostElements {
        /// Elements asked for, about.
        asked: usize,
        /// Elements allowed.
        most: usize,
    },
    /// Elements smaller than [`crate::CellOptions::least_size`] on some receivers.
    LeastSize {
        /// The size that was asked for, or that as many elements have; file units.
        asked: f64,
        /// The largest size made instead; file units.
        made: f64,
        /// Receivers on which it is larger than was asked for.
        n_receivers: usize,
        /// Receivers that light reaches.
        n_lit: usize,
        /// Allowed, relative to a receiver's diagonal.
        least: f64,
    },
    /// More elements than there are when all that err are of [`crate::CellOptions::least_size`].
    FewerElements {
        /// Elements asked for, about.
        asked: usize,
        /// Elements made.
        made: usize,
        /// Allowed, relative to a receiver's diagonal.
        least: f64,
    },
}

impl SizeLimit {
    /// One sentence; `unit` is the symbol of the file's unit of length.
    #[must_use]
    pub fn message(&self, unit: &str) -> String {
        match self {
            Self::MostElements { asked, most } => format!(
                "about {asked} elements are asked for and {most} are allowed: only the coarsest mesh was made"
            ),
            Self::LeastSize {
                asked,
                made,
                n_receivers,
                n_lit,
                least,
            } => format!(
                "what is asked for takes elements of {asked:.2e} {unit}, and on {n_receivers} of {n_lit} surfaces in the light they are larger, up to {made:.2e} {unit}: none is made smaller than {least} of its surface's diagonal"
            ),
            Self::FewerElements { asked, made, least } => format!(
                "about {asked} elements are asked for and {made} were made: none is made smaller than {least} of its surface's diagonal"
            ),
        }
    }
}
