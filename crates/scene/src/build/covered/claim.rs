//! What the edges of a face say of it: the end of a body, or a sheet.

use super::turn::{NUDGE, Turn};
use super::{Sheets, Side};
use crate::scene::PlaneId;
use antumbra_geom::{DVec2, DVec3, point_in_polygon};

/// What the edges of one side say of it.
#[derive(Debug, Default)]
pub(super) struct Claim {
    /// Places, a nudge inside of the border, where a body rises behind the side.
    body: Vec<DVec3>,
    /// Does something that faces what is behind the side say that it is a sheet?
    is_sheet: bool,
    /// Does only what is beyond its plane say that it is the end of a body?
    is_weak_body: bool,
    /// Places, a nudge inside of the border, where something rises before the side and
    /// faces what is there.
    inhabited: Vec<DVec3>,
}

impl Claim {
    fn is_body(&self) -> bool {
        !self.is_sheet && (self.is_weak_body || !self.body.is_empty())
    }

    /// By what rises behind the side itself.
    fn is_strong_body(&self) -> bool {
        !self.is_sheet && !self.body.is_empty()
    }
}

impl Sheets<'_> {
    /// What the edges of a patch say.
    pub(super) fn claim(&self, patch: &[Side], turn: &Turn) -> Claim {
        let mut claim = Claim::default();
        for &side in patch {
            let sheet = &self.list[side.sheet];
            let normal = self.normal(side);
            for corners in sheet.loops() {
                for (i, &a) in corners.iter().enumerate() {
                    let b = corners[(i + 1) % corners.len()];
                    let ends = if side.is_back { [b, a] } else { [a, b] };
                    self.ask_edge(ends, normal, sheet.plane, turn, &mut claim);
                }
            }
        }
        claim
    }

    /// * `ends` — with the side on the left, seen from its front.
    fn ask_edge(
        &self,
        ends: [u32; 2],
        normal: DVec3,
        plane: PlaneId,
        turn: &Turn,
        claim: &mut Claim,
    ) {
        let [a, b] = ends.map(|v| self.vertices[v as usize]);
        let Some(inward) = normal.cross(b - a).try_normalize() else {
            return;
        };
        for stretch in turn.around(self, [a, b], inward, normal, plane) {
            let inside = stretch.middle + inward * (NUDGE * self.extent);
            let (Some(first), Some(last)) = (stretch.met.first(), stretch.met.last()) else {
                continue;
            };
            match (first.shows_back, first.shows_front) {
                (true, false) if first.is_behind() => claim.body.push(inside),
                (true, false) => claim.is_weak_body = true,
                (false, true) => claim.is_sheet = true,
                _ => {}
            }
            // Turned the other way, through the front, a back comes with its front.
            if !last.is_behind() && last.shows_back && !last.shows_front {
                claim.inhabited.push(inside);
            }
        }
    }

    /// Is side `b` the end of a body that stands on side `a`?
    ///
    /// A shell within a shell, with a floor in the plane of the outer one, has walls of its
    /// own that rise inside of `b` and face what is there: it is not stood upon.
    pub(super) fn stands_on(&self, of_b: &Claim, of_a: &Claim, b: Side, a: Side) -> bool {
        let any_in = |places: &[DVec3], side: Side| places.iter().any(|&x| self.has(side, x));
        of_b.is_strong_body() && (any_in(&of_b.body, a) || !any_in(&of_a.inhabited, b))
    }

    /// Does a side have this point of its plane?
    fn has(&self, side: Side, point: DVec3) -> bool {
        let sheet = &self.list[side.sheet];
        let chart = self.chart(sheet.plane);
        let loops: Vec<Vec<DVec2>> = sheet.loops().map(|l| self.flat(&chart, l)).collect();
        point_in_polygon(chart.to_chart(point), loops.iter().map(Vec::as_slice))
    }
}

/// Does a sheet of no thickness lie on the end of a body?
///
/// Only what is beyond the body's plane tells that it is one, as with the floor of a room:
/// if the sheet's own edges say the like, two rooms stand back to back.
pub(super) fn lies_on(body: &Claim, sheet: &Claim) -> bool {
    body.is_body()
        && !body.is_strong_body()
        && !sheet.is_sheet
        && !sheet.is_body()
        && sheet.inhabited.is_empty()
}
