//! Interreflection: a coarse solution of the radiosity equation for all surfaces at once,
//! and what points gather from it.
//!
//! The unknowns are indirect irradiances at nodes inside of elements,
//!
//! ```text
//! E = E_direct + E_indirect ,   E_indirect(xᵢ) = Σⱼ wᵢⱼ ρⱼ (P E_direct + E_indirect)ⱼ .
//! ```
//!
//! A row is one visibility map: all that a node sees, exactly, in fragments that add up to
//! its hemisphere. Every fragment is dealt out to the coarsest elements that change the
//! node's irradiance by little enough; their weights add up to its exact form factor, so
//! that row sums are those of the geometry and nothing is ever normalised. Rows are sparse,
//! and nothing is ever asked of what is hidden.
//!
//! The solution itself is coarse: what people see is gathered from it, one bounce more
//! accurate, with exact visibility ([`Transport::gather`]).
//!
//! # Source
//!
//! Hierarchical links: Hanrahan, Salzman & Aupperle 1991. Collocation: Atkinson & Chien
//! 2000. Gathering: the iterated solution of Sloan 1976. All in `docs/references.md`.

mod balance;
mod basis;
mod deal;
mod forest;
mod gather;
mod rows;
mod smooth;
mod solve;

pub use solve::{Transport, TransportOptions, solve_transport};
