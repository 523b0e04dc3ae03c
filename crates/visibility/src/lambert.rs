//! Lambert's contour sum: the form factor of a polygon from a point, in closed form.

use glam::DVec3;
use std::f64::consts::TAU;

/// `Σ Θᵢ (wᵢ·n) / 2π` over the edges of a closed outline.
///
/// * `outline` — corners relative to the point, counter-clockwise as seen from
///   the point, none below its horizon.
/// * `normal` — the unit normal at the point.
///
/// Returns the form factor from the point to the outline, dimensionless, 0 to 1
/// up to rounding (about 1e-16). An edge seen end-on subtends nothing.
///
/// # Source
///
/// Lambert 1760; Baum, Rushmeier & Winget 1989 (BRW89 in `docs/references.md`).
#[must_use]
pub fn contour_sum(outline: &[DVec3], normal: DVec3) -> f64 {
    let Some(&last) = outline.last() else {
        return 0.0;
    };
    let mut sum = 0.0;
    let mut u = last;
    for &v in outline {
        // v × u and not u × v: counter-clockwise outlines count positive.
        let axis = v.cross(u);
        let height = axis.dot(normal);
        if height != 0.0 {
            let sine = axis.length();
            if sine > 0.0 {
                sum += sine.atan2(u.dot(v)) * (height / sine);
            }
        }
        u = v;
    }
    sum / TAU
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn unit_square_above_a_point_covers_just_under_a_quarter() {
        let square = [
            dvec3(-0.5, -0.5, 1.0),
            dvec3(-0.5, 0.5, 1.0),
            dvec3(0.5, 0.5, 1.0),
            dvec3(0.5, -0.5, 1.0),
        ];
        assert!((contour_sum(&square, DVec3::Z) - 0.239_456_470_461).abs() < 1e-12);
    }

    #[test]
    fn whole_sky_is_one() {
        let far = 1e9;
        let sky = [
            dvec3(-far, -far, 1.0),
            dvec3(-far, far, 1.0),
            dvec3(far, far, 1.0),
            dvec3(far, -far, 1.0),
        ];
        assert!((contour_sum(&sky, DVec3::Z) - 1.0).abs() < 1e-8);
    }
}
