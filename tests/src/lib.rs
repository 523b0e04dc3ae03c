//! Helpers of the tests: cases with known answers, small scenes, oracles.

pub mod bits;
pub mod cases;
pub mod check_points;
pub mod families;
pub mod kept;
pub mod lattice;
pub mod meshes;
pub mod motion;
pub mod oracle;
pub mod quadrature;
pub mod random;
pub mod rational;
pub mod scenes;
pub mod structure;
