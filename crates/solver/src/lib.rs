//! Elements, direct irradiance to a tolerance, form factors, radiosity.

pub mod basis;
pub mod cells;
mod direct;
mod factors;
mod field;
mod limits;
mod posterior;
mod radiosity;

pub use direct::{DirectMeshes, DirectOptions, DirectSolution, Ended, Tolerance};
pub use factors::{FactorOptions, FormFactors, NotClosed, Reciprocity, Repair, form_factors};
pub use field::{KINK_D1, KINK_D2, Light, Postponed, Progress, Receiver, ReceiverMesh, Sample};
pub use limits::Limits;
pub use posterior::{AfterStep, Improvement};
pub use radiosity::{
    Gatherer, Power, RadiosityOptions, RadiositySolution, Reached, RowSums, solve_radiosity,
};
