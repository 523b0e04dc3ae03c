//! What is left of a source when the cones of all occluders are cut off.
//!
//! # Source
//!
//! Cone subtraction with recursive splitting: every decision is one half-space
//! split of a piece with positive measure whose two halves share the cut, so a
//! wrong sign moves a sliver of rounding size and never a region. Compared with
//! booleans and with edge integration in `docs/numerics.md`.

use crate::cone::{cone, l1};
use crate::fragments::{Fragment, Fragments, HalfSpace, Position};
use crate::lambert::contour_sum;
use crate::place::Place;
use glam::DVec3;
use smallvec::SmallVec;
use std::ops::Range;

/// More candidates than this in one fragment, and the fragment is cut in two.
const FLAT_CANDIDATES: usize = 6;

/// Splitting ends here, whatever is left.
const DEEPEST_SPLIT: u32 = 40;

/// How many times an emitter may be cut in two for every candidate: near-linear work takes
/// a few. Where many edges meet in one place, in copies of one box, no cut parts them, and
/// the parts would double forty times.
const CUTS_PER_CANDIDATE: usize = 16;

/// Candidates whose edges are tried as dividing planes.
const PLANES_TRIED: usize = 3;

/// The cone of one candidate in [`Subtraction`].
#[derive(Clone, Copy, Debug)]
struct Cone {
    halves: u32,
    n_halves: u32,
    corners: u32,
    n_corners: u32,
}

/// A source, the cones of what hides it, and what is visible.
#[derive(Debug, Default)]
pub(super) struct Subtraction {
    pub(super) fragments: Fragments,
    halves: Vec<HalfSpace>,
    cones: Vec<Cone>,
    cone_corners: Vec<DVec3>,
    visible: Vec<Fragment>,
    /// Features of an occluder this near to the point touch it.
    slack: f64,
    /// How many times more the source may be cut in two.
    cuts_left: usize,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Coverage {
    Nothing,
    Part,
    All,
}

/// The inward sides of the pyramid from the point to a fragment; their tolerance is how far
/// an occluder must be outside to be passed over.
type Sides = SmallVec<[HalfSpace; 8]>;

impl Subtraction {
    /// Forgets all, to begin anew.
    ///
    /// * `slack` — features of an occluder this near to the point touch it; scene units.
    pub(super) fn begin(&mut self, slack: f64) {
        self.fragments.clear();
        self.halves.clear();
        self.cones.clear();
        self.cone_corners.clear();
        self.visible.clear();
        self.slack = slack;
    }

    /// Adds the cone of an occluder; `false` if it hides nothing. Like [`cone`].
    pub(super) fn add(
        &mut self,
        corners: &[DVec3],
        normal: DVec3,
        place: &Place,
        reach: (f64, f64),
    ) -> bool {
        let halves = self.halves.len() as u32;
        let n_halves = cone(&mut self.halves, corners, normal, place, reach) as u32;
        if n_halves == 0 {
            return false;
        }
        self.cones.push(Cone {
            halves,
            n_halves,
            corners: self.cone_corners.len() as u32,
            n_corners: corners.len() as u32,
        });
        let relative = corners.iter().map(|&c| c - place.point);
        self.cone_corners.extend(relative);
        true
    }

    pub(super) fn n_cones(&self) -> usize {
        self.cones.len()
    }

    /// These parts are what is visible.
    pub(super) fn show(&mut self, parts: &[Fragment]) {
        self.visible.clear();
        self.visible.extend_from_slice(parts);
    }

    /// What is visible after [`Subtraction::subtract`].
    pub(super) fn visible(&self) -> impl Iterator<Item = &[DVec3]> {
        self.visible
            .iter()
            .map(|&part| self.fragments.corners(part))
    }

    /// The form factor of what no cone hides.
    ///
    /// * `up` — the unit normal at the point.
    /// * `whole` — the form factor of all.
    /// * `slack` — rounding of what the point touches, for the audit.
    pub(super) fn subtract(
        &mut self,
        parts: &[Fragment],
        up: DVec3,
        whole: f64,
        slack: f64,
    ) -> f64 {
        let everything: SmallVec<[u32; 32]> = (0..self.cones.len() as u32).collect();
        let mut hidden = Hidden::new(up);
        self.cuts_left = CUTS_PER_CANDIDATE * everything.len();
        for &part in parts {
            self.visible_of(part, &everything, 0, &mut hidden);
        }
        let factor = self
            .visible()
            .fold(0.0, |sum, part| sum + contour_sum(part, up));
        hidden.audit(factor, whole, slack);
        factor
    }

    fn corners_of(&self, c: u32) -> &[DVec3] {
        let cone = self.cones[c as usize];
        &self.cone_corners[cone.corners as usize..(cone.corners + cone.n_corners) as usize]
    }

    fn halves_of(&self, c: u32) -> Range<usize> {
        let cone = self.cones[c as usize];
        cone.halves as usize..(cone.halves + cone.n_halves) as usize
    }

    /// The parts of `fragment` that none of the cones in `list` holds, pushed to
    /// [`Subtraction::visible`].
    fn visible_of(&mut self, fragment: Fragment, list: &[u32], depth: u32, hidden: &mut Hidden) {
        // Which cones can hide a part of this fragment?
        let mut relevant: SmallVec<[u32; 32]> = SmallVec::new();
        let sides = if list.len() > 2 {
            pyramid(self.fragments.corners(fragment), self.slack)
        } else {
            Sides::new()
        };
        for &c in list {
            match self.coverage(fragment, c, &sides) {
                Coverage::Nothing => {}
                Coverage::Part => relevant.push(c),
                Coverage::All => {
                    hidden.add(self.fragments.corners(fragment));
                    return;
                }
            }
        }
        if relevant.is_empty() {
            self.visible.push(fragment);
            return;
        }
        if relevant.len() > FLAT_CANDIDATES
            && depth < DEEPEST_SPLIT
            && self.cuts_left > 0
            && let Some(half) = self.dividing_plane(fragment, &relevant)
        {
            self.cuts_left -= 1;
            let (a, b) = self.fragments.split(fragment, &half);
            self.visible_of(a, &relevant, depth + 1, hidden);
            self.visible_of(b, &relevant, depth + 1, hidden);
            return;
        }
        // Few: peel them off one after the other.
        let first = self.visible.len();
        self.visible.push(fragment);
        for &c in &relevant {
            let end = self.visible.len();
            let mut kept = first;
            for i in first..end {
                let part = self.visible[i];
                // Visible pieces of what is peeled are appended behind `end`.
                if !self.peel(part, c, hidden) {
                    self.visible[kept] = part;
                    kept += 1;
                }
            }
            // Close the gap between what was kept and what was appended.
            self.visible.drain(kept..end);
        }
    }

    /// How much of a fragment a cone can hide. Conservative: `Part` may be nothing.
    fn coverage(&self, fragment: Fragment, c: u32, sides: &Sides) -> Coverage {
        let corners = self.corners_of(c);
        // A side of the pyramid that has the whole occluder outside.
        if sides
            .iter()
            .any(|side| corners.iter().all(|&q| side.excludes(q)))
        {
            return Coverage::Nothing;
        }
        let mut all = true;
        for half in &self.halves[self.halves_of(c)] {
            match self.fragments.position(fragment, half) {
                Position::Outside => return Coverage::Nothing,
                Position::Inside => {}
                Position::Straddles => all = false,
            }
        }
        if all { Coverage::All } else { Coverage::Part }
    }

    /// Removes from `part` what cone `c` hides. Returns `false` if nothing is hidden
    /// (and leaves the part as it is), else appends the visible pieces.
    fn peel(&mut self, part: Fragment, c: u32, hidden: &mut Hidden) -> bool {
        let range = self.halves_of(c);
        for k in range.clone() {
            if self.fragments.position(part, &self.halves[k]) == Position::Outside {
                return false;
            }
        }
        let before = self.visible.len();
        let mut rest = part;
        for k in range {
            let half = self.halves[k];
            match self.fragments.position(rest, &half) {
                Position::Inside => {}
                Position::Outside => {
                    // The cone passes the fragment by: give back what was cut off.
                    self.visible.truncate(before);
                    return false;
                }
                Position::Straddles => {
                    let (inside, outside) = self.fragments.split(rest, &half);
                    self.visible.push(outside);
                    rest = inside;
                }
            }
        }
        hidden.add(self.fragments.corners(rest));
        true
    }

    /// The plane through the point that best divides the candidates of a fragment:
    /// the one through its centroid and the middle of its longest edge, or that of a
    /// candidate's own edge, which has to be cut along anyway.
    fn dividing_plane(&self, fragment: Fragment, list: &[u32]) -> Option<HalfSpace> {
        let mut best: Option<(usize, HalfSpace)> = None;
        let mut consider = |half: HalfSpace| {
            if self.fragments.position(fragment, &half) != Position::Straddles {
                return usize::MAX / 4;
            }
            let (mut inside, mut outside) = (0, 0);
            for &c in list {
                let (mut any_inside, mut any_outside) = (false, false);
                for &q in self.corners_of(c) {
                    let v = half.value(q);
                    any_inside |= v > 0.0;
                    any_outside |= v < 0.0;
                }
                inside += usize::from(any_inside);
                outside += usize::from(any_outside);
            }
            // The larger half counts; candidates in both halves count twice.
            let cost = 2 * inside.max(outside) + inside + outside;
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, half));
            }
            inside.max(outside)
        };
        if let Some(half) = middle_plane(self.fragments.corners(fragment)) {
            let larger = consider(half);
            if larger * 4 <= list.len() * 3 {
                return Some(half);
            }
        }
        let step = list.len().div_ceil(PLANES_TRIED);
        for &c in list.iter().step_by(step) {
            // The first half-space is the occluder's plane, not one through the point.
            for &half in self.halves[self.halves_of(c)].iter().skip(1) {
                consider(half);
            }
        }
        best.map(|(_, half)| half)
    }
}

/// * `slack` — a distance: occluders that touch the point are never passed over. Rounding
///   comes on top, for occluders of which no corner is farther than four extents.
fn pyramid(corners: &[DVec3], slack: f64) -> Sides {
    // Counter-clockwise seen from the point: inwards is next × this.
    let n = corners.len();
    (0..n)
        .map(|i| {
            let (this, next) = (corners[i], corners[if i + 1 == n { 0 } else { i + 1 }]);
            let side = next.cross(this);
            // A short edge's plane is known to the rounding of its ends by its length.
            let rounding = 64.0 * f64::EPSILON * l1(this) * l1(next);
            HalfSpace {
                normal: side,
                offset: 0.0,
                tolerance: slack * l1(side) + rounding,
            }
        })
        .collect()
}

/// The plane through a fragment's centroid and the middle of its longest edge.
fn middle_plane(corners: &[DVec3]) -> Option<HalfSpace> {
    let n = corners.len();
    let centroid = corners.iter().copied().sum::<DVec3>() / n as f64;
    let (mut longest, mut middle, mut reach_sq) = (0.0, DVec3::ZERO, 0.0f64);
    for i in 0..n {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        let length = (b - a).length_squared();
        reach_sq = reach_sq.max(a.length_squared());
        if length > longest {
            longest = length;
            middle = (a + b) / 2.0;
        }
    }
    // Smaller than this and the pieces are rounding.
    if longest < 1e-24 * reach_sq {
        return None;
    }
    let normal = middle.cross(centroid).try_normalize()?;
    Some(HalfSpace {
        normal,
        offset: 0.0,
        tolerance: 16.0 * f64::EPSILON * reach_sq.sqrt(),
    })
}

/// The audit of an evaluation, in debug builds: visible and hidden parts must add
/// up to the whole.
#[derive(Debug)]
struct Hidden {
    #[cfg(debug_assertions)]
    normal: DVec3,
    #[cfg(debug_assertions)]
    sum: f64,
}

impl Hidden {
    fn new(normal: DVec3) -> Self {
        let _ = normal;
        Self {
            #[cfg(debug_assertions)]
            normal,
            #[cfg(debug_assertions)]
            sum: 0.0,
        }
    }

    fn add(&mut self, corners: &[DVec3]) {
        let _ = corners;
        #[cfg(debug_assertions)]
        {
            self.sum += contour_sum(corners, self.normal);
        }
    }

    fn audit(&self, visible: f64, whole: f64, slack: f64) {
        let _ = (visible, whole, slack);
        #[cfg(debug_assertions)]
        let allowed = 1e-12 + slack;
        #[cfg(debug_assertions)]
        assert!(
            (visible + self.sum - whole).abs() <= allowed && visible <= whole + allowed,
            "visible {visible} + hidden {} is not the unoccluded factor {whole}",
            self.sum
        );
    }
}
