//! An order of numbers in which rounding has no say.

/// Where a positive number stands among others, up to rounding: of numbers that agree in
/// their first 24 binary digits most have the same place, and a larger place means a
/// larger number.
///
/// For decisions that must not change when a scene is scaled or turned: lengths that are
/// equal by symmetry differ in their last bits then. A total order, unlike comparison
/// with a tolerance; who has the same place is told apart by something else.
///
/// ```
/// use antumbra_geom::coarse_order;
///
/// assert_eq!(coarse_order(0.1 + 0.2), coarse_order(0.3));
/// assert!(coarse_order(0.300_001) > coarse_order(0.3));
/// ```
#[must_use]
pub fn coarse_order(x: f64) -> u64 {
    const DROPPED: u32 = 28;
    // To the nearest: short numbers, such as powers of two, are far from a limit.
    (x.max(0.0).to_bits() + (1 << (DROPPED - 1))) >> DROPPED
}
