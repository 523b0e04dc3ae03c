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
//! let meshed = mesh(&scene, &Options::default(), &Control::default())?;
//! for receiver in &meshed.direct.receivers {
//!     println!("{}: {} elements", scene.surface_of(receiver.face).name, receiver.n_elements());
//! }
//! println!("error at most {:.1e} of the peak", meshed.direct.measured_max_error);
//! let mut vtu = Vec::new();
//! io::write::vtu::write(&export(&scene, &meshed.direct, &meshed.curves, "ten lines"), &mut vtu)?;
//! # assert!(meshed.direct.measured_max_error <= 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod demand;
mod export;
mod light;
mod mesher;
mod pipeline;
mod plan;
pub mod reduce;
mod study;
mod thin;
pub mod values;

pub use antumbra_geom as geom;
pub use antumbra_io as io;
pub use antumbra_mesh::{Order, cells};
pub use antumbra_scene::{self as scene, Problem, Scene, SceneInput, Severity};
pub use antumbra_solver::{
    self as solver, AfterStep, DirectSolution, Ended, FactorOptions, FormFactors, Improvement,
    NotClosed, Power, Progress, RadiosityOptions, RadiositySolution, Reached, ReceiverMesh,
    Reciprocity, Repair, RowSums, Tolerance,
    cells::{CellEnded, CellMeshes, CellReceiverMesh, CellSolution, DirectMesh, Estimator},
};
pub use antumbra_visibility::{
    self as visibility, CriticalCurve, Discontinuity, Evaluator, Event, EventKind, EventKinds,
    Scratch,
};
pub use export::{export, export_cells, export_factors, generators, mesh_order_key, order_key};
pub use light::ExactLight;
pub use mesher::{
    CellMeshed, CellOptions, CellSize, CellSolved, Mesher, SizeLimit, cell_meshes, mesh_cells,
    solve_cells,
};
pub use pipeline::{
    Control, Error, EventCounts, Events, MOST_STEPS, Meshed, Options, Phase, ReceiverCurves,
    Solved, factors, mesh, plan, solve,
};
pub use plan::{Decision, Effect, Expected, Plan, Quantity};
pub use study::{Meter, Sampled, StudyOptions, quality, study};
pub use thin::thin_surfaces;
