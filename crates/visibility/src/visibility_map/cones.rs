//! Convex cones of directions, and their division.
//!
//! A cone is kept as a convex polygon of directions: each corner lies on the triangle that
//! three unit vectors at right angles span, so no length falls below 1/√3 and none needs
//! to be made 1 again. Every edge knows the plane through the point that it lies in.

use super::boxes::Block;
use crate::cone::l1;
use crate::fragments::{HalfSpace, Position};
use glam::DVec3;

/// How far from a side what is outside may still be inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Margins {
    /// Distance of what may touch the point or lie in a side; scene units.
    pub(super) slack: f64,
    /// Distance of the farthest thing from the point, scene units: there, the rounding of a
    /// side is largest.
    pub(super) reach: f64,
}

/// A plane through the point that bounds a cone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// Inwards; of any length.
    pub(super) normal: DVec3,
    /// What is below it by more than this along `normal`, relative to the point, is outside.
    pub(super) margin: f64,
    /// Directions this near to it are on it, by rounding.
    tolerance: f64,
    /// The same for places in space.
    least: f64,
    /// Absolute values of the normal.
    width: DVec3,
}

impl Side {
    /// The inner side of a half-space through a point.
    pub(super) fn new(half: &HalfSpace, point: DVec3, margins: Margins) -> Self {
        let margin = margins.slack * l1(half.normal) + margins.reach * half.tolerance;
        Self {
            normal: half.normal,
            margin,
            tolerance: half.tolerance,
            least: half.normal.dot(point) - margin,
            width: half.normal.abs(),
        }
    }

    /// May a part of the box be inside?
    #[inline]
    pub(super) fn is_reached_by(&self, block: &Block) -> bool {
        self.normal.dot(block.middle) + self.width.dot(block.half) > self.least
    }
}

/// What comes in between two sides of this many tolerances is not known to come in: each is
/// known to one, and so are the ends of the cut along each.
const SLIT: f64 = 4.0;

/// A convex cone: its corners, counter-clockwise as seen from the point, and the side from
/// each corner to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Cone {
    pub(super) corners: Vec<DVec3>,
    pub(super) sides: Vec<Side>,
}

impl Cone {
    /// Makes this the cone of other corners and sides.
    pub(super) fn assign(&mut self, corners: &[DVec3], sides: &[Side]) {
        self.clear();
        self.corners.extend_from_slice(corners);
        self.sides.extend_from_slice(sides);
    }

    pub(super) fn clear(&mut self) {
        self.corners.clear();
        self.sides.clear();
    }

    /// Is it no wider than what is not known of one of its sides?
    pub(super) fn is_slit(&self) -> bool {
        self.sides.iter().any(|side| {
            let widest = SLIT * side.tolerance;
            self.corners.iter().all(|c| side.normal.dot(*c) <= widest)
        })
    }

    /// A direction inside.
    pub(super) fn middle(&self) -> DVec3 {
        self.corners.iter().sum()
    }
}

/// Where all of a cone lies with respect to a plane through the point. A cone that only
/// touches the plane from inside is inside; one without a corner strictly inside is
/// outside.
#[inline]
pub(super) fn position(corners: &[DVec3], half: &HalfSpace) -> Position {
    let (mut inside, mut outside) = (false, false);
    for &x in corners {
        let v = half.value(x);
        inside |= v > 0.0;
        outside |= v < 0.0;
    }
    match (inside, outside) {
        (true, true) => Position::Straddles,
        (true, false) => Position::Inside,
        _ => Position::Outside,
    }
}

/// On which side of a plane each corner of a straddling cone goes: positive, negative, or
/// 0 for those that both parts have, one between corners of different sides at most.
///
/// Of several corners in a row that are on the plane within its tolerance, one is shared,
/// or the parts would not be what the cone was; those that do not stand between different
/// sides go with their neighbours.
fn shared_out(corners: &[DVec3], half: &HalfSpace, values: &mut Vec<f64>) {
    values.clear();
    values.extend(corners.iter().map(|&x| half.value(x)));
    let n = values.len();
    let first = values.iter().position(|&v| v != 0.0);
    let first = first.expect("a straddling cone has corners on both sides");
    let mut at = 1;
    while at < n {
        let (start, before) = (at, values[(first + at - 1) % n]);
        while at < n && values[(first + at) % n] == 0.0 {
            at += 1;
        }
        let after = values[(first + at) % n];
        let between = before.is_sign_positive() != after.is_sign_positive();
        for k in start + usize::from(between)..at {
            values[(first + k) % n] = f64::MIN_POSITIVE.copysign(after);
        }
        at += 1;
    }
}

/// Cuts a straddling cone in two that share the cut bit for bit.
///
/// * `cut` — the side of the plane inwards, then outwards.
/// * `values` — working memory.
pub(super) fn divide(
    cone: &Cone,
    half: &HalfSpace,
    cut: [Side; 2],
    values: &mut Vec<f64>,
    [inside, outside]: [&mut Cone; 2],
) {
    shared_out(&cone.corners, half, values);
    for (part, side, sign) in [(inside, cut[0], 1.0), (outside, cut[1], -1.0)] {
        part.clear();
        for (i, (&corner, &along)) in cone.corners.iter().zip(&cone.sides).enumerate() {
            let j = if i + 1 == values.len() { 0 } else { i + 1 };
            let (this, next) = (values[i] * sign, values[j] * sign);
            let is_leaving = this >= 0.0 && next < 0.0;
            if this >= 0.0 {
                part.corners.push(corner);
                let stays = this > 0.0 || !is_leaving;
                part.sides.push(if stays { along } else { side });
            }
            if (this > 0.0 && next < 0.0) || (this < 0.0 && next > 0.0) {
                // From the end that is inside, in both parts.
                let (a, b) = if values[i] > 0.0 { (i, j) } else { (j, i) };
                let (xa, xb) = (cone.corners[a], cone.corners[b]);
                let t = values[a] / (values[a] - values[b]);
                part.corners.push(xa + (xb - xa) * t);
                part.sides.push(if is_leaving { side } else { along });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lambert::contour_sum;

    const NO_MARGINS: Margins = Margins {
        slack: 0.0,
        reach: 0.0,
    };

    fn side(normal: DVec3) -> Side {
        Side::new(&half(normal), DVec3::ZERO, NO_MARGINS)
    }

    /// The octant between the axes, as a cone.
    fn octant() -> Cone {
        let corners = [DVec3::X, DVec3::Z, DVec3::Y];
        let sides = [DVec3::Y, DVec3::X, DVec3::Z].map(side);
        let mut cone = Cone::default();
        cone.assign(&corners, &sides);
        cone
    }

    fn half(normal: DVec3) -> HalfSpace {
        HalfSpace {
            normal,
            offset: 0.0,
            tolerance: 1e-15,
        }
    }

    fn halves(cone: &Cone, half: &HalfSpace) -> [Cone; 2] {
        let (mut inside, mut outside) = (Cone::default(), Cone::default());
        let cut = [half.normal, -half.normal].map(side);
        divide(
            cone,
            half,
            cut,
            &mut Vec::new(),
            [&mut inside, &mut outside],
        );
        [inside, outside]
    }

    #[test]
    fn parts_of_a_cone_add_up_to_it_and_know_their_sides() {
        let whole = octant();
        let parts = halves(&whole, &half(DVec3::new(1.0, -0.5, 0.25)));
        let sum: f64 = parts
            .iter()
            .map(|part| contour_sum(&part.corners, DVec3::Z))
            .sum();
        assert!((sum - contour_sum(&whole.corners, DVec3::Z)).abs() < 1e-16);
        for part in &parts {
            let n = part.corners.len();
            assert_eq!(n, part.sides.len());
            for (i, side) in part.sides.iter().enumerate() {
                // Its own ends are on it, all others inside.
                assert!(side.normal.dot(part.corners[i]).abs() < 1e-15);
                assert!(side.normal.dot(part.corners[(i + 1) % n]).abs() < 1e-15);
                assert!(part.corners.iter().all(|&c| side.normal.dot(c) > -1e-15));
            }
        }
    }

    #[test]
    fn corners_that_are_all_but_on_a_cut_belong_to_one_part() {
        // Four corners in a row within a tolerance that is no rounding.
        let corners = [
            (0.0, 0.1),
            (0.5, 2e-4),
            (1.0, 4e-4),
            (1.5, -3e-4),
            (2.0, -0.1),
        ];
        let corners = corners.map(|(x, y)| DVec3::new(1.0 - x, -1.0 + x * (2.0 - x) + 1.0, y));
        let mut cone = Cone::default();
        let bent = corners.map(|c| c + DVec3::Z * (c.y * c.y * 1e-4));
        cone.assign(&bent, &[side(DVec3::Z); 5]);
        let loose = HalfSpace {
            tolerance: 1e-3,
            ..half(DVec3::Z)
        };
        let parts = halves(&cone, &loose);
        let area = |corners: &[DVec3]| contour_sum(corners, DVec3::new(0.6, 0.0, 0.8));
        let sum: f64 = parts.iter().map(|part| area(&part.corners)).sum();
        assert!((sum - area(&cone.corners)).abs() < 1e-16);
        let n: usize = parts.iter().map(|part| part.corners.len()).sum();
        // One of them and a new one twice.
        assert_eq!(n, cone.corners.len() + 3);
    }

    #[test]
    fn a_cut_through_a_corner_makes_no_corner_twice() {
        let parts = halves(&octant(), &half(DVec3::new(1.0, -1.0, 0.0)));
        assert!(parts.iter().all(|part| part.corners.len() == 3));
    }
}
