//! What one polygon does to a cone: nothing, or it peels off what lies outside of it and
//! covers the rest.

use super::cones::{Cone, Margins, Side, divide, position};
use crate::fragments::{HalfSpace, Position};
use glam::DVec3;

/// Pieces cut off a cone, and what is left of it.
#[derive(Debug, Default)]
pub(super) struct Peeler {
    /// Pieces outside, each cut off by the half-space at the same place in `cuts`.
    pieces: Vec<Cone>,
    cuts: Vec<HalfSpace>,
    n_pieces: usize,
    /// What is left, if anything was cut off.
    rest: Cone,
    next: Cone,
    values: Vec<f64>,
    /// Cones tested against a half-space.
    pub(super) n_tests: u64,
}

/// What remains of a cone inside of some half-spaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inside {
    /// Nothing, or a part that is no more than rounding.
    Nothing,
    /// All of it.
    Whole,
    /// [`Peeler::rest`]; what is outside is in [`Peeler::pieces`].
    Part,
}

impl Peeler {
    /// Cuts off what of a cone lies outside of the half-spaces.
    pub(super) fn peel(
        &mut self,
        cone: &Cone,
        halves: &[HalfSpace],
        point: DVec3,
        margins: Margins,
    ) -> Inside {
        self.n_pieces = 0;
        self.cuts.clear();
        self.n_tests += halves.len() as u64;
        let mut straddles: smallvec::SmallVec<[&HalfSpace; 12]> = smallvec::SmallVec::new();
        for half in halves {
            match position(&cone.corners, half) {
                Position::Outside => return Inside::Nothing,
                Position::Inside => {}
                Position::Straddles => straddles.push(half),
            }
        }
        for half in straddles {
            let from = if self.n_pieces == 0 { cone } else { &self.rest };
            if self.n_pieces > 0 {
                self.n_tests += 1;
                match position(&from.corners, half) {
                    Position::Outside => return Inside::Nothing,
                    Position::Inside => continue,
                    Position::Straddles => {}
                }
            }
            if self.pieces.len() == self.n_pieces {
                self.pieces.push(Cone::default());
            }
            let piece = &mut self.pieces[self.n_pieces];
            let cut = [*half, opposite(half)].map(|half| Side::new(&half, point, margins));
            divide(from, half, cut, &mut self.values, [&mut self.next, piece]);
            std::mem::swap(&mut self.rest, &mut self.next);
            self.n_pieces += 1;
            self.cuts.push(*half);
        }
        if self.n_pieces == 0 {
            Inside::Whole
        } else {
            Inside::Part
        }
    }

    /// Pieces outside, each with the half-space that it was cut off by, of which it is
    /// outside.
    pub(super) fn pieces(&self) -> impl Iterator<Item = (&Cone, &HalfSpace)> {
        self.pieces[..self.n_pieces].iter().zip(&self.cuts)
    }

    /// What is left inside, after [`Inside::Part`].
    pub(super) fn rest(&self) -> &Cone {
        &self.rest
    }
}

/// The other side of a plane.
pub(super) fn opposite(half: &HalfSpace) -> HalfSpace {
    HalfSpace {
        normal: -half.normal,
        offset: -half.offset,
        ..*half
    }
}
