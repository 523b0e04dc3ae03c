//! Turning about an edge: which faces are met, and which of their sides is seen.

use super::Sheets;
use crate::bvh::{Aabb, BoxTree};
use crate::scene::PlaneId;
use antumbra_geom::{Chart, DVec2, DVec3, point_in_polygon};
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

/// Faces that differ by less in their angle about an edge coincide.
const COINCIDENT: f64 = 1e-9;

/// Inside of a border by this, relative to the extent: a thousand times the distance at
/// which corners count as lying on an edge, and below what a mesh resolves.
pub(super) const NUDGE: f64 = 1.0 / (1u64 << 30) as f64;

/// What is met along a stretch of an edge.
pub(super) struct Stretch {
    pub(super) middle: DVec3,
    /// Ascending by angle.
    pub(super) met: Vec<Met>,
}

/// Faces that are met at one angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    /// From the side itself through its back; radians, between 0 and 2π.
    angle: f64,
    pub(super) shows_back: bool,
    pub(super) shows_front: bool,
    sheet: usize,
}

impl Met {
    /// Is it on the back of the side's plane?
    pub(super) fn is_behind(&self) -> bool {
        self.angle < PI
    }
}

/// A search among all sheets.
pub(super) struct Turn {
    tree: BoxTree,
    /// Sheets that are known to cover each other, the smaller number first.
    pub(super) covering: BTreeSet<[usize; 2]>,
}

impl Turn {
    pub(super) fn new(sheets: &Sheets<'_>) -> Self {
        let boxes: Vec<(u32, Aabb)> = sheets
            .list
            .iter()
            .enumerate()
            .map(|(i, sheet)| {
                let corners = sheet.polygon.outline.iter();
                let bounds = Aabb::of(corners.map(|&v| sheets.vertices[v as usize]));
                (i as u32, bounds)
            })
            .collect();
        Self {
            tree: BoxTree::new(&boxes),
            covering: BTreeSet::new(),
        }
    }

    /// The faces met in a turn about an edge from `inward` through the back, coplanar ones
    /// apart; a stretch for every part of the edge where they are the same.
    pub(super) fn around(
        &self,
        sheets: &Sheets<'_>,
        ends: [DVec3; 2],
        inward: DVec3,
        normal: DVec3,
        plane: PlaneId,
    ) -> Vec<Stretch> {
        let tolerance = sheets.tolerance();
        let bounds = Aabb::of(ends);
        let query = Aabb {
            min: bounds.min - tolerance,
            max: bounds.max + tolerance,
        };
        let mut near = Vec::new();
        self.tree
            .visit(|b| b.meets(&query), |i| near.push(i as usize));
        near.sort_unstable();
        let rising: Vec<Rising> = near
            .into_iter()
            .filter(|&i| sheets.list[i].plane != plane)
            .filter_map(|i| Rising::new(sheets, i, ends))
            .collect();
        let length = ends[0].distance(ends[1]);
        let mut breaks: Vec<f64> = rising
            .iter()
            .flat_map(|r| r.breaks.iter().copied())
            .collect();
        breaks.extend([0.0, length]);
        breaks.sort_by(f64::total_cmp);
        let nudge = NUDGE * sheets.extent;
        breaks
            .windows(2)
            .filter(|pair| pair[1] - pair[0] > 2.0 * nudge)
            .map(|pair| {
                let at = 0.5 * (pair[0] + pair[1]);
                let met = rising.iter().flat_map(|r| r.met(at, nudge, inward, normal));
                Stretch {
                    middle: ends[0] + (ends[1] - ends[0]) * (at / length),
                    met: self.gathered(met.collect()),
                }
            })
            .collect()
    }

    /// Ascending by angle, coincident ones in one.
    ///
    /// Of two that cover each other the one that is met first shows its back: so it is
    /// with bodies a hair apart.
    fn gathered(&self, mut met: Vec<Met>) -> Vec<Met> {
        met.sort_by(|a, b| a.angle.total_cmp(&b.angle).then(a.sheet.cmp(&b.sheet)));
        let are_same = |a: &Met, b: &Met| b.angle - a.angle <= COINCIDENT;
        met.chunk_by(are_same)
            .map(|same| {
                let are_pressed = same.iter().enumerate().any(|(i, a)| {
                    let pair = |b: &Met| [a.sheet.min(b.sheet), a.sheet.max(b.sheet)];
                    same[i + 1..]
                        .iter()
                        .any(|b| self.covering.contains(&pair(b)))
                });
                Met {
                    shows_back: same.iter().any(|m| m.shows_back),
                    shows_front: !are_pressed && same.iter().any(|m| m.shows_front),
                    ..same[0]
                }
            })
            .collect()
    }
}

/// A sheet whose plane holds the edge.
struct Rising {
    sheet: usize,
    chart: Chart,
    loops: Vec<Vec<DVec2>>,
    /// The edge in the chart: its start and its unit direction.
    start: DVec2,
    along: DVec2,
    /// Distances along the edge where the sheet begins or ends at it.
    breaks: Vec<f64>,
    front: DVec3,
    is_two_sided: bool,
}

impl Rising {
    fn new(sheets: &Sheets<'_>, number: usize, ends: [DVec3; 2]) -> Option<Self> {
        let tolerance = sheets.tolerance();
        let sheet = &sheets.list[number];
        let chart = sheets.chart(sheet.plane);
        if ends.iter().any(|&x| chart.height(x).abs() > tolerance) {
            return None;
        }
        let [a, b] = ends.map(|x| chart.to_chart(x));
        let along = (b - a).try_normalize()?;
        let length = a.distance(b);
        let loops: Vec<Vec<DVec2>> = sheet
            .loops()
            .map(|corners| sheets.flat(&chart, corners))
            .collect();
        let mut breaks = Vec::new();
        for corners in &loops {
            for (i, &p) in corners.iter().enumerate() {
                let q = corners[(i + 1) % corners.len()];
                let [hp, hq] = [p, q].map(|x| along.perp_dot(x - a));
                if hp.abs() <= tolerance {
                    breaks.push(along.dot(p - a));
                } else if (hp > 0.0) != (hq > 0.0) && hq.abs() > tolerance {
                    breaks.push(along.dot(p + (q - p) * (hp / (hp - hq)) - a));
                }
            }
        }
        breaks.retain(|t| (0.0..=length).contains(t));
        Some(Self {
            sheet: number,
            front: if sheet.along {
                chart.normal
            } else {
                DVec3::ZERO - chart.normal
            },
            chart,
            loops,
            start: a,
            along,
            breaks,
            is_two_sided: sheet.is_two_sided,
        })
    }

    /// What is met of it at a distance along the edge: nothing, one half plane or both.
    fn met(&self, at: f64, nudge: f64, inward: DVec3, normal: DVec3) -> Vec<Met> {
        let middle = self.start + self.along * at;
        let mut met = Vec::new();
        for across in [self.along.perp(), DVec2::ZERO - self.along.perp()] {
            let beside = middle + across * nudge;
            if !point_in_polygon(beside, self.loops.iter().map(Vec::as_slice)) {
                continue;
            }
            let direction = self.chart.direction(across);
            let angle = (-direction.dot(normal)).atan2(direction.dot(inward));
            let angle = if angle < 0.0 { angle + TAU } else { angle };
            let onward = -angle.sin() * inward - angle.cos() * normal;
            let is_from_behind = self.front.dot(onward) > 0.0;
            met.push(Met {
                angle,
                sheet: self.sheet,
                shows_back: is_from_behind || self.is_two_sided,
                shows_front: !is_from_behind || self.is_two_sided,
            });
        }
        met
    }
}
