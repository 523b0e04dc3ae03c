//! Elements, direct irradiance to a tolerance, form factors, radiosity.

pub mod basis;
pub mod cells;
mod direct;
mod factors;
mod field;
mod posterior;
mod radiosity;
mod scale;
mod solution;
pub mod transport;

pub use direct::{DirectMeshes, DirectOptions};
pub use factors::{FactorOptions, FormFactors, NotClosed, Reciprocity, Repair, form_factors};
pub use field::{KINK_D1, KINK_D2, Light, Postponed, Receiver, Sample};
pub use posterior::{AfterStep, Improvement};
pub use radiosity::{
    Gatherer, Power, Radiosity, RadiosityOptions, Reached, RowSums, solve_radiosity,
};
pub use scale::{Found, Tolerance};
pub use solution::{Cells, Elements, Ended, Progress, ReceiverMesh, Solution, Spot, Triangles};
