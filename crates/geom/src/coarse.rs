//! An order of numbers in which rounding has no say.

/// Where a positive number stands among others, up to rounding, in units that grow with
/// the scene: of numbers that agree in their first twelve binary digits most have the same
/// place, and a larger place means a larger number.
///
/// For decisions that must not change when a scene is scaled or turned: lengths that are
/// equal by symmetry differ in their last bits then, and where corners of curves were
/// rounded, in their last third. A total order, unlike comparison with a tolerance; who has
/// the same place is told apart by something else.
///
/// Two equal numbers may come to lie on two sides of a limit between places, so limits are
/// few; and two that are almost equal may share a place here and not in another scene, so
/// limits are at the same multiples of a unit in both.
///
/// * `unit` — any quantity of the same kind that the scene determines, the same one for
///   all numbers that are compared.
///
/// ```
/// use antumbra_geom::coarse_order;
///
/// assert_eq!(coarse_order(0.1 + 0.2, 1.0), coarse_order(0.3, 1.0));
/// assert!(coarse_order(0.301, 1.0) > coarse_order(0.3, 1.0));
/// assert_eq!(coarse_order(0.3, 1.0), coarse_order(0.3e6, 1e6));
/// ```
#[must_use]
pub fn coarse_order(x: f64, unit: f64) -> u64 {
    const DROPPED: u32 = 40;
    // Numbers with few digits, as in scenes on a grid, are far from a limit: those are no
    // binary fractions of a step, but the golden section of it.
    const LIMIT: u64 = 0x61_c886_4680;
    ((x / unit).max(0.0).to_bits() + LIMIT) >> DROPPED
}

/// Is a positive number larger than another by more than rounding? Lengths of scenes on a
/// grid are often equal to what they are compared with.
#[must_use]
pub fn exceeds(a: f64, b: f64) -> bool {
    a > b && coarse_order(a, b) > coarse_order(1.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exceeds_does_so_by_more_than_rounding() {
        assert!(!exceeds(0.1 + 0.2, 0.3) && !exceeds(0.3, 0.3) && !exceeds(0.2, 0.3));
        assert!(exceeds(0.301, 0.3) && exceeds(0.3, 0.0));
        assert!(!exceeds(0.0, 0.0));
    }

    #[test]
    fn places_are_the_same_in_scenes_of_any_size() {
        for k in 1..1000 {
            let x = f64::from(k) / 7.0;
            let places = [1.0, 1e-6, 1e6].map(|s| coarse_order(x * s, 3.0 * s));
            assert!(places.iter().all(|&p| p == places[0]), "{x}");
        }
    }
}
