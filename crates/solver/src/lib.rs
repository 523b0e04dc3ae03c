//! Elements, direct irradiance to a tolerance, radiosity.

pub mod basis;
mod direct;
mod field;
mod limits;
mod radiosity;

pub use direct::{DirectMeshes, DirectOptions, DirectSolution, Ended, Tolerance};
pub use field::{KINK_D1, KINK_D2, Light, Postponed, Progress, Receiver, ReceiverMesh, Sample};
pub use limits::Limits;
pub use radiosity::{
    Power, RadiosityOptions, RadiositySolution, Reached, RowSums, solve_radiosity,
};
