//! What a screen hides is dealt out to the faces that lie in it.

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
    /// Cones that are not dealt yet, and those left of them.
    open: Vec<Cone>,
    left: Vec<Cone>,
    /// Cones to be used again.
    spare: Vec<Cone>,
    peeler: Peeler,
    fragment: Vec<DVec3>,
}

impl Dealer {
    /// Deals a cone out to the shares of the screen that covers it; returns the sum of the
    /// factors. An ended cone goes to the share in its middle.
    pub(super) fn deal(
        &mut self,
        screens: &Screens,
        place: &Place,
        (seen, cone): (&Seen, &Cone),
        (sights, rounding): (&mut Sights, f64),
        is_ended: bool,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        let shares = screens.shares(seen.screen, seen.shows_front);
        let (last, others) = shares.split_last().expect("a screen is of a face");
        if others.is_empty() {
            return self.give(place, (seen, cone), last, is_ended, visit);
        }
        let normal = screens.get(seen.screen).normal;
        let about = |share: &Share| if share.is_turned { -normal } else { normal };
        if is_ended {
            let middle = cone.middle();
            let is_there = |share: &&Share| {
                let mark = sights.mark();
                let corners = screens.share_corners(share);
                let at = sights.look(corners, about(share), place, rounding);
                let halves = at.as_ref().map(|at| sights.halves(at));
                let is_there = halves.is_some_and(|h| h.iter().all(|h| h.value(middle) >= 0.0));
                sights.back_to(mark);
                is_there
            };
            let share = others.iter().find(is_there).unwrap_or(last);
            return self.give(place, (seen, cone), share, is_ended, visit);
        }
        let mut sum = 0.0;
        self.put(cone);
        for share in others {
            let mark = sights.mark();
            let corners = screens.share_corners(share);
            if let Some(at) = sights.look(corners, about(share), place, rounding) {
                sum += self.take(place, seen, (&at, sights), share, visit);
            }
            sights.back_to(mark);
        }
        while let Some(rest) = self.open.pop() {
            sum += self.give(place, (seen, &rest), last, false, visit);
            self.spare.push(rest);
        }
        sum
    }

    /// Gives a share what it holds of the open cones.
    fn take(
        &mut self,
        place: &Place,
        seen: &Seen,
        (at, sights): (&Seen, &Sights),
        share: &Share,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        let mut sum = 0.0;
        let mut peeler = std::mem::take(&mut self.peeler);
        let mut open = std::mem::take(&mut self.open);
        for cone in open.drain(..) {
            match peeler.peel(&cone, sights.halves(at), place.point, NO_MARGINS) {
                Inside::Nothing => {
                    self.left.push(cone);
                    continue;
                }
                Inside::Whole => sum += self.give(place, (seen, &cone), share, false, visit),
                Inside::Part => {
                    sum += self.give(place, (seen, peeler.rest()), share, false, visit);
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

    fn give(
        &mut self,
        place: &Place,
        (seen, cone): (&Seen, &Cone),
        share: &Share,
        is_ended: bool,
        visit: &mut impl FnMut(VisiblePart<'_>),
    ) -> f64 {
        let factor = contour_sum(&cone.corners, place.normal);
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
