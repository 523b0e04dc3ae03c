//! What a screen hides is dealt out to the faces that lie in it.

use super::boxes::{Block, Ray};
use super::cones::{Cone, Margins};
use super::cover::{Inside, Peeler};
use super::screens::{Screens, Share};
use super::seen::{Seen, Sights};
use super::{Place, VisiblePart};
use crate::lambert::contour_sum;
use glam::DVec3;

/// Nothing is culled by the sides of what is dealt.
const NO_MARGINS: Margins = Margins {
    slack: 0.0,
    reach: 0.0,
};

/// Working memory of dealing.
#[derive(Debug, Default)]
pub(super) struct Dealer {
    /// Shares that may be seen, by their places among those of the screen.
    found: Vec<u32>,
    stack: Vec<u32>,
    /// Cones that are not dealt yet, and those left of them.
    open: Vec<Cone>,
    left: Vec<Cone>,
    /// Cones to be used again.
    spare: Vec<Cone>,
    sights: Sights,
    peeler: Peeler,
    fragment: Vec<DVec3>,
}

impl Dealer {
    /// Deals a cone out to the shares of the screen that covers it; returns the sum of the
    /// factors. An ended cone goes to the share in its middle.
    ///
    /// * `rounding` — of corners; scene units.
    /// * `factor` — form factor of the cone.
    pub(super) fn deal(
        &mut self,
        screens: &Screens,
        (place, rounding): (&Place, f64),
        (seen, cone, factor): (&Seen, &Cone, f64),
        is_ended: bool,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        let shares = screens.shares(seen.screen, seen.shows_front);
        if let [only] = shares {
            return self.give(place, (seen, cone, factor), only, is_ended, visit);
        }
        let middle = cone.middle();
        let ray = Ray::new(place.point, middle, 64.0 * rounding);
        let is_met = |block: &Block| {
            if is_ended {
                ray.meets(block, f64::INFINITY)
            } else {
                cone.sides.iter().all(|side| side.is_reached_by(block))
            }
        };
        self.find(screens, seen, is_met, shares.len());
        let found = std::mem::take(&mut self.found);
        let (&last, others) = found.split_last().expect("the last is always among them");
        let sum = if is_ended {
            let mut others = others.iter().map(|&i| &shares[i as usize]);
            let share = others.find(|share| {
                let at = self.look(screens, (place, rounding), seen, share);
                at.is_some_and(|at| {
                    let mut halves = self.sights.halves(&at).iter();
                    halves.all(|half| half.value(middle) >= 0.0)
                })
            });
            let share = share.unwrap_or(&shares[last as usize]);
            self.give(place, (seen, cone, factor), share, true, visit)
        } else {
            let mut sum = 0.0;
            self.put(cone);
            for &i in others {
                if self.open.is_empty() {
                    break;
                }
                let share = &shares[i as usize];
                if let Some(at) = self.look(screens, (place, rounding), seen, share) {
                    sum += self.take(place, seen, &at, share, visit);
                }
            }
            while let Some(rest) = self.open.pop() {
                sum += self.give_part(place, (seen, &rest), &shares[last as usize], visit);
                self.spare.push(rest);
            }
            sum
        };
        self.found = found;
        sum
    }

    /// Finds the shares whose boxes are met, in their order; one at least.
    fn find(
        &mut self,
        screens: &Screens,
        seen: &Seen,
        is_met: impl Fn(&Block) -> bool,
        n_shares: usize,
    ) {
        self.found.clear();
        let Some(tree) = screens.tree_of_shares(seen.screen, seen.shows_front) else {
            self.found.extend(0..n_shares as u32);
            return;
        };
        let found = &mut self.found;
        tree.visit(&mut self.stack, is_met, |share| found.push(share));
        found.sort_unstable();
        if found.is_empty() {
            found.push(n_shares as u32 - 1);
        }
    }

    /// A share from the point.
    fn look(
        &mut self,
        screens: &Screens,
        (place, rounding): (&Place, f64),
        seen: &Seen,
        share: &Share,
    ) -> Option<Seen> {
        let normal = screens.get(seen.screen).normal;
        let about = if share.is_turned { -normal } else { normal };
        self.sights.clear();
        self.sights
            .look(screens.share_corners(share), about, place, rounding)
    }

    /// Gives a share what it holds of the open cones.
    fn take(
        &mut self,
        place: &Place,
        seen: &Seen,
        at: &Seen,
        share: &Share,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        let mut sum = 0.0;
        let mut peeler = std::mem::take(&mut self.peeler);
        let mut open = std::mem::take(&mut self.open);
        for cone in open.drain(..) {
            match peeler.peel(&cone, self.sights.halves(at), place.point, NO_MARGINS) {
                Inside::Nothing => {
                    self.left.push(cone);
                    continue;
                }
                Inside::Whole => sum += self.give_part(place, (seen, &cone), share, visit),
                Inside::Part => {
                    sum += self.give_part(place, (seen, peeler.rest()), share, visit);
                    for (piece, _) in peeler.pieces() {
                        let mut left = self.spare.pop().unwrap_or_default();
                        left.assign(&piece.corners, &piece.sides);
                        self.left.push(left);
                    }
                }
            }
            self.spare.push(cone);
        }
        self.peeler = peeler;
        self.open = std::mem::replace(&mut self.left, open);
        sum
    }

    fn put(&mut self, cone: &Cone) {
        let mut open = self.spare.pop().unwrap_or_default();
        open.assign(&cone.corners, &cone.sides);
        self.open.push(open);
    }

    fn give_part(
        &mut self,
        place: &Place,
        (seen, cone): (&Seen, &Cone),
        share: &Share,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        let factor = contour_sum(&cone.corners, place.normal);
        self.give(place, (seen, cone, factor), share, false, visit)
    }

    /// Tells of a part; returns its factor.
    fn give(
        &mut self,
        place: &Place,
        (seen, cone, factor): (&Seen, &Cone, f64),
        share: &Share,
        is_ended: bool,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        self.fragment.clear();
        let on_plane = |&direction: &DVec3| place.point + seen.foot(direction, place);
        self.fragment.extend(cone.corners.iter().map(on_plane));
        visit(VisiblePart {
            face: share.face,
            shows_front: share.shows_front,
            is_ended,
            factor,
            directions: &cone.corners,
            fragment: &self.fragment,
        });
        factor
    }
}
