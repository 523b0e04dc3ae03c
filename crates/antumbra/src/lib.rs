//! Discontinuity meshing for radiosity.
//!
//! Irradiance from an area light is smooth except along curves that geometry
//! alone decides. This library finds those curves, puts them into the mesh of
//! every polygon, fills the mesh with exact values, and refines it until the
//! measured error is below the tolerance.

mod export;
mod light;
mod pipeline;
pub mod values;

pub use antumbra_io as io;
pub use antumbra_mesh::Order;
pub use antumbra_scene::{self as scene, Problem, Scene, SceneInput, Severity};
pub use antumbra_solver::{
    self as solver, DirectSolution, Ended, Power, RadiosityOptions, RadiositySolution,
    ReceiverMesh, RowSums, Tolerance,
};
pub use antumbra_visibility::{
    self as visibility, CriticalCurve, Discontinuity, Evaluator, Event, EventKind, EventKinds,
    Scratch,
};
pub use export::{export, generators, mesh_order_key, order_key};
pub use light::ExactLight;
pub use pipeline::{
    Control, Error, EventCounts, Meshed, Options, Phase, ReceiverCurves, Solved, mesh, solve,
};
