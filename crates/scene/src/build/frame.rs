//! The exact change of coordinates at the door.

use super::Findings;
use crate::input::{SceneInput, SurfaceInput};
use crate::scene::Frame;
use glam::DVec3;

/// For each surface: are all its coordinates finite? The others are reported.
pub(super) fn finite_surfaces(input: &SceneInput, findings: &mut Findings) -> Vec<bool> {
    let mut usable = vec![true; input.surfaces.len()];
    for (s, surface) in input.surfaces.iter().enumerate() {
        let Some(bad) = corners(surface).find(|p| !p.is_finite()) else {
            continue;
        };
        usable[s] = false;
        findings.error(
            Findings::surface(s),
            "non-finite",
            vec![surface.name.clone()],
            format!(
                "surface '{}': vertex ({}, {}, {}) is not finite (allowed finite numbers)",
                surface.name, bad.x, bad.y, bad.z
            ),
        );
    }
    usable
}

/// Frame of the scene and its longest extent in scene units.
///
/// Per axis with minimum m and maximum M: if m > 0 and M − m ≤ m (or the mirror
/// image), all coordinates are multiples of q = ulp(m), so is the offset o, and
/// |x − o| ≤ m < 2⁵³ q: the subtraction is exact. Otherwise the origin is within
/// one extent and a shift would gain one bit at most: the axis stays.
pub(super) fn of(
    input: &SceneInput,
    usable: &[bool],
    findings: &mut Findings,
) -> Option<(Frame, f64)> {
    let points = || {
        let surfaces = input
            .surfaces
            .iter()
            .zip(usable)
            .filter(|(_, usable)| **usable);
        surfaces.flat_map(|(surface, _)| corners(surface))
    };
    if points().next().is_none() {
        for (s, surface) in input
            .surfaces
            .iter()
            .enumerate()
            .filter(|(s, _)| usable[*s])
        {
            findings.error(
                Findings::surface(s),
                "too-few-vertices",
                vec![surface.name.clone()],
                format!(
                    "surface '{}': has no vertices, at least 3 are needed",
                    surface.name
                ),
            );
        }
        return None;
    }
    let min = points().fold(DVec3::INFINITY, DVec3::min);
    let max = points().fold(DVec3::NEG_INFINITY, DVec3::max);
    let longest = (max - min).max_element();
    let largest = max.abs().max(min.abs()).max_element();
    // Products of six coordinates must neither overflow nor vanish.
    if largest > 1e100 || longest < 1e-100 {
        let (what, number) = if largest > 1e100 {
            ("a coordinate of size", largest)
        } else {
            ("a longest extent of", longest)
        };
        findings.error(
            Findings::SCENE,
            "range",
            Vec::new(),
            format!("the scene has {what} {number:e} (allowed 1e-100 to 1e100)"),
        );
        return None;
    }
    let offset = DVec3::from_array(std::array::from_fn(|k| offset(min[k], max[k])));
    let scale = 2f64.powi(-exponent(longest));
    Some((Frame { offset, scale }, longest * scale))
}

/// A file's point in scene units; what is below 2⁻⁷⁰ of the extent is zero.
pub(super) fn to_scene(frame: &Frame, point: DVec3, extent: f64) -> DVec3 {
    let flushed = |x: f64| {
        if x.abs() < extent * 2f64.powi(-70) {
            0.0
        } else {
            x
        }
    };
    DVec3::from_array(frame.to_scene(point).to_array().map(flushed))
}

fn corners(surface: &SurfaceInput) -> impl Iterator<Item = DVec3> + '_ {
    surface
        .vertices
        .iter()
        .chain(surface.holes.iter().flatten())
        .copied()
}

fn offset(min: f64, max: f64) -> f64 {
    if max < 0.0 {
        return 0.0 - offset(-max, -min);
    }
    if min > 0.0 && max - min <= min {
        let ulp = min.next_up() - min;
        (f64::midpoint(min, max) / ulp).round() * ulp
    } else {
        0.0
    }
}

/// ⌊log₂ x⌋ of a normal positive number.
fn exponent(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_is_subtracted_exactly_far_from_the_origin() {
        let mut state = 7u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for base in [1e3, 1e6, -1e6, 1e8] {
            let xs: Vec<f64> = (0..1000).map(|_| base + random()).collect();
            let min = xs.iter().copied().fold(f64::INFINITY, f64::min);
            let max = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let o = offset(min, max);
            assert!(o != 0.0);
            for x in xs {
                assert_eq!((x - o) + o, x);
                // Two-sum residual: zero iff the difference is exact.
                let d = x - o;
                let bb = x - d;
                assert_eq!((x - (d + bb)) + (bb - o), 0.0);
            }
        }
        assert_eq!(offset(-1.0, 1.0), 0.0);
        assert_eq!(offset(0.1, 1.0), 0.0);
    }

    #[test]
    fn exponent_is_the_floor_of_the_logarithm() {
        assert_eq!([0.5, 1.0, 1.99, 2.0, 560.0].map(exponent), [-1, 0, 0, 1, 9]);
    }
}
