//! Scenes of polygons, checked at the door.
//!
//! [`SceneInput`] is what a reader hands over; [`Scene::build`] checks it,
//! reports *all* problems, and makes a [`Scene`] in which every later question
//! is combinatorial: welded vertices, shared edges, plane classes. A `Scene`
//! that exists is valid.

mod build;
mod bvh;
mod corners;
mod input;
mod open_rooms;
mod problem;
mod query;
mod report;
mod scene;
mod sets;
mod weld_input;

pub use antumbra_geom::Plane;
pub use build::Built;
pub use bvh::{Aabb, Below, BoxTree};
pub use corners::Welded;
pub use input::{LengthUnit, MaterialInput, Quantity, SceneInput, SurfaceInput};
pub use open_rooms::OpenRoom;
pub use problem::{Problem, Severity};
pub use report::{CoveredArea, GeometryReport};
pub use scene::{
    Edge, EdgeId, Face, FaceId, Frame, Material, MaterialId, Piece, PlaneId, Scene, Side, Surface,
    SurfaceId, VertexId,
};
