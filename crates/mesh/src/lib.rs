//! From critical curves to a mesh: arrangement, triangulation, refinement.
//!
//! [`arrange`] turns the curves on a receiver, which may cross, overlap and
//! almost coincide, into edges that meet only in vertices. [`TriMesh`] is the
//! constrained Delaunay triangulation of these edges; every edge remembers
//! which curves it is part of, also after [`TriMesh::bisect`].
//!
//! All decisions are taken in integers, in any order of the input the same.

mod arrange;
mod bisect;
pub mod cells;
mod check;
mod cut;
mod grid;
mod halve;
mod lines;
mod locate;
mod nodes;
mod sets;
mod snap;
mod thin;
mod trimesh;

pub use arrange::{
    ArrangedEdge, Arrangement, ArrangementOptions, ArrangementReport, Order, TaggedCurve, arrange,
};
pub use bisect::Split;
pub use cut::{Cut, Origins};
pub use grid::Grid;
pub use locate::Locator;
pub use sets::{CurveSets, SetId};
pub use thin::{Folded, cells_of_corners, folded};
pub use trimesh::{MeshError, TriMesh, shape_quality};
