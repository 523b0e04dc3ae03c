//! What the user asks for.

use antumbra_mesh::cells::{CellShape, Rule};
use antumbra_solver::cells::{CellRefinement, Estimator};
use antumbra_solver::{AfterStep, RadiosityOptions, Tolerance};
use antumbra_visibility::{EventKind, EventKinds};

/// What the user asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Error of irradiance allowed anywhere.
    pub tolerance: Tolerance,
    /// Degree of the elements, 1 to 4; `None` chooses by the tolerance.
    pub degree: Option<u8>,
    /// What makes the mesh.
    pub generator: Generator,
    /// No more elements than this.
    pub most_elements: usize,
    /// Of the interreflection; its tolerance follows `tolerance`.
    pub radiosity: RadiosityOptions,
}

/// What makes the mesh, with what only that can be asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Generator {
    /// Curves: elements along the shadow boundaries.
    Curves(CurveOptions),
    /// Cells: knows nothing of shadows.
    Cells(CellOptions),
}

/// How to mesh along shadow boundaries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveOptions {
    /// Which events' curves are put into the mesh.
    pub events: Events,
    /// Steps after meshing, one after the other.
    pub after: [Option<AfterStep>; MOST_STEPS],
}

impl Default for CurveOptions {
    fn default() -> Self {
        Self {
            events: Events::OnDemand,
            after: [None; MOST_STEPS],
        }
    }
}

/// No more steps after meshing than this.
pub const MOST_STEPS: usize = 4;

/// Which events' curves are put into the mesh. Contacts always are: without them
/// light leaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// All are enumerated; each is put where an element's error calls for it.
    OnDemand,
    /// All of these kinds, before anything is evaluated, and no others.
    Kinds(EventKinds),
}

impl Events {
    /// The kinds that are enumerated.
    #[must_use]
    pub fn kinds(self) -> EventKinds {
        match self {
            Self::OnDemand => EventKinds::ALL,
            Self::Kinds(kinds) => kinds.with(EventKind::Contact),
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance: Tolerance::Relative(1e-3),
            degree: None,
            generator: Generator::Curves(CurveOptions::default()),
            most_elements: 4_000_000,
            radiosity: RadiosityOptions::default(),
        }
    }
}

impl Options {
    /// Those of meshes of cells.
    #[must_use]
    pub fn with_cells(cells: CellOptions) -> Self {
        Self {
            generator: Generator::Cells(cells),
            most_elements: 1_000_000,
            ..Self::default()
        }
    }

    /// Along the shadow boundaries, with these events' curves.
    #[must_use]
    pub fn with_events(events: Events) -> Self {
        let after = [None; MOST_STEPS];
        Self {
            generator: Generator::Curves(CurveOptions { events, after }),
            ..Self::default()
        }
    }

    /// What is asked of the mesh along shadow boundaries; the default for cells.
    pub(crate) fn curves(&self) -> CurveOptions {
        match self.generator {
            Generator::Curves(curves) => curves,
            Generator::Cells(_) => CurveOptions::default(),
        }
    }

    /// The name of the generator in options and reports.
    #[must_use]
    pub fn mesher(&self) -> Mesher {
        match self.generator {
            Generator::Curves(_) => Mesher::Discontinuity,
            Generator::Cells(cells) => cells.mesher,
        }
    }

    /// The tolerance that is to be kept; `None` if a number or size of cells is asked for.
    #[must_use]
    pub fn kept_tolerance(&self) -> Option<Tolerance> {
        match self.generator {
            Generator::Cells(cells) if cells.size != CellSize::Tolerance => None,
            _ => Some(self.tolerance),
        }
    }

    /// The degree used: 2 for rough, 4 for fine tolerances, else 3.
    ///
    /// Measured in exact evaluations on the fixtures: `docs/accuracy.md`.
    #[must_use]
    pub fn chosen_degree(&self) -> u8 {
        let tolerance = match self.kept_tolerance() {
            Some(Tolerance::Relative(t)) => t,
            _ => 1e-3,
        };
        self.degree.unwrap_or(if tolerance > 3e-2 {
            2
        } else if tolerance > 3e-4 {
            3
        } else {
            4
        })
    }
}

/// How meshes are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mesher {
    /// Elements of one size everywhere; refined by halving the size of whole receivers.
    Uniform,
    /// Elements smaller near edges, contacts and emitters ([`CellOptions::grading`]);
    /// refined by halving all sizes of a receiver.
    Graded,
    /// A quadtree with any number of T-vertices, at which irradiance has cracks.
    Quadtree,
    /// A quadtree whose neighbours differ by one level at most; continuous.
    Restricted,
    /// The same with T-vertices resolved by triangles (Baum et al. 1991).
    TriQuadtree,
    /// Substructuring (Cohen et al. 1986): elements out of tolerance are split; after a
    /// solve, irradiance with interreflection is what is kept within it.
    Adaptive,
    /// Along the shadow boundaries: [`mesh`](crate::mesh()).
    Discontinuity,
}

impl Mesher {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Uniform,
        Self::Graded,
        Self::Quadtree,
        Self::Restricted,
        Self::TriQuadtree,
        Self::Adaptive,
        Self::Discontinuity,
    ];

    /// The name in options and reports.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Graded => "graded",
            Self::Quadtree => "quadtree",
            Self::Restricted => "restricted",
            Self::TriQuadtree => "tri-quadtree",
            Self::Adaptive => "adaptive",
            Self::Discontinuity => "discontinuity",
        }
    }

    /// The generator of this name.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.key() == key)
    }
}

impl std::fmt::Display for Mesher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.key())
    }
}

/// How fine meshes of cells become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellSize {
    /// As fine as [`Options::tolerance`] asks for.
    Tolerance,
    /// Elements of this size, in the unit of the file; graded meshes have it where they
    /// are coarsest. Meshes that follow the error get as many elements as the uniform one
    /// of this size has.
    Length(f64),
    /// About so many elements in all, on surfaces that light reaches.
    Elements(usize),
}

/// How to mesh with cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellOptions {
    /// The generator; not [`Mesher::Discontinuity`], which has
    /// [`Options`].
    pub mesher: Mesher,
    /// Triangles, quadrilaterals, or both. [`Mesher::TriQuadtree`] of quadrilaterals has
    /// triangles too, where sizes change.
    pub shape: CellShape,
    /// How fine.
    pub size: CellSize,
    /// What refinement follows.
    pub estimator: Estimator,
    /// Elements are not made smaller than this fraction of their receiver's diagonal.
    pub least_size: f64,
    /// Of graded meshes, the finest size relative to the coarsest, from 0 to 1.
    ///
    /// The size wanted at a distance d from the nearest edge of the receiver's border,
    /// surface that touches it, or emitter, is `size · max(grading, min(1, d / r))`, with r
    /// a quarter of the receiver's diagonal.
    pub grading: f64,
}

impl Default for CellOptions {
    fn default() -> Self {
        Self {
            mesher: Mesher::Adaptive,
            shape: CellShape::Mixed,
            size: CellSize::Tolerance,
            estimator: Estimator::Measured,
            least_size: 1.0 / 1024.0,
            grading: 0.125,
        }
    }
}

impl CellOptions {
    pub(crate) fn refinement(&self) -> CellRefinement {
        match self.mesher {
            Mesher::Uniform | Mesher::Graded => CellRefinement::Whole,
            _ => CellRefinement::Marked,
        }
    }

    pub(crate) fn rule(&self) -> Rule {
        match self.mesher {
            Mesher::Quadtree => Rule::Plain,
            Mesher::TriQuadtree => Rule::Triangulated,
            _ => Rule::Restricted,
        }
    }
}
