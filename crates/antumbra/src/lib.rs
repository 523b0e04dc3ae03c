//! Discontinuity meshing for radiosity.
//!
//! Irradiance from an area light is smooth except along curves that geometry
//! alone decides. This library finds those curves, puts them into the mesh of
//! every polygon, fills the mesh with exact values, and refines it until the
//! measured error is below the tolerance.
//!
//! # Example
//!
//! ```
//! use antumbra::{Control, Options, Scene, export, io, mesh};
//!
//! let text = r#"{ "antumbra": 1,
//!   "materials": { "grey": { "reflectance": 0.5 }, "lamp": { "exitance": 1 } },
//!   "surfaces": [
//!     { "name": "floor", "material": "grey", "vertices": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]] },
//!     { "name": "lamp", "material": "lamp", "vertices": [[0, 1, 3], [1, 1, 3], [1, 0, 3], [0, 0, 3]] },
//!     { "name": "plate", "material": "grey", "vertices": [[0, 0, 1], [1, 0, 1], [0, 1, 1]] } ] }"#;
//!
//! let input = io::scene_file::read(text)?;
//! let scene = Scene::build(&input).map_err(|problems| format!("{problems:#?}"))?.scene;
//! let outcome = mesh(&scene, &Options::default(), &Control::NEVER)?;
//! for receiver in &outcome.mesh.receivers {
//!     println!("{}: {} elements", scene.surface_of(receiver.face).name, receiver.n_elements());
//! }
//! println!("error at most {:.1e} of the peak", outcome.mesh.measured_max_error);
//! let mut vtu = Vec::new();
//! io::write::vtu::write(&export(&scene, &outcome, "ten lines"), &mut vtu)?;
//! # assert!(outcome.mesh.measured_max_error <= 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cell_meshes;
mod cell_receivers;
mod cell_size;
mod demand;
mod export;
pub mod gathered;
mod grading;
mod light;
mod options;
mod outcome;
mod pipeline;
mod plan;
mod receiver;
pub mod reduce;
mod scout;
mod strips;
mod study;
mod surroundings;
mod thin;
mod total_light;
pub mod values;

pub use antumbra_geom::{self as geom, Control, Phase, Stop};
pub use antumbra_io as io;
pub use antumbra_mesh::{Order, TriMesh, cells};
pub use antumbra_scene::{self as scene, Problem, Scene, SceneInput, Severity};
pub use antumbra_solver::{
    self as solver, AfterStep, Elements, Ended, FactorOptions, FormFactors, Improvement, NotClosed,
    Power, Progress, Radiosity, RadiosityOptions, Reached, ReceiverMesh, Reciprocity, Repair,
    RowSums, Solution, Tolerance, cells::Estimator,
};
pub use antumbra_visibility::{
    self as visibility, CriticalCurve, Discontinuity, Evaluator, Event, EventKind, EventKinds,
    Scratch,
};
pub use cell_meshes::cell_meshes;
pub use export::{export, export_factors, generators, mesh_order_key, order_key};
pub use light::ExactLight;
pub use options::{
    CellOptions, CellSize, CurveOptions, Events, Generator, MOST_STEPS, Mesher, Options,
};
pub use outcome::{Error, EventCounts, Outcome, ReceiverCurves, SizeLimit};
pub use pipeline::{factors, mesh, plan, solve};
pub use plan::{Decision, Effect, Expected, Plan, Quantity};
pub use study::{Meter, StudyOptions, quality, study};
pub use thin::thin_surfaces;
