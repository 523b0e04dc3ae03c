//! The convex hull of what a line of sight starts and ends on, and what reaches into it.

use crate::evaluator::Evaluator;
use crate::fragments::HalfSpace;
use antumbra_scene::{Aabb, PlaneId};
use glam::DVec3;
use smallvec::SmallVec;

/// The convex hull of two point sets: the planes around it, inwards, and its box.
pub(crate) struct Hull {
    walls: SmallVec<[HalfSpace; 32]>,
    bounds: Aabb,
}

impl Hull {
    /// The hull of an edge and a convex outline.
    pub(crate) fn of_edge_and_outline(
        [a, b]: [DVec3; 2],
        outline: &[DVec3],
        tolerance: f64,
    ) -> Self {
        let all = || outline.iter().copied().chain([a, b]);
        let mut walls = SmallVec::new();
        let mut consider = |p, q, r| walls.extend(supporting_plane([p, q, r], all(), tolerance));
        for (p, q) in edges(outline) {
            consider(p, q, a);
            consider(p, q, b);
            consider(a, b, p);
        }
        let bounds = Aabb::of(all());
        Self { walls, bounds }
    }

    /// The hull of two convex outlines.
    pub(crate) fn of_outlines(a: &[DVec3], b: &[DVec3], tolerance: f64) -> Self {
        let all = || a.iter().chain(b).copied();
        let mut walls = SmallVec::new();
        for outline in [a, b] {
            if let [p, q, r, ..] = *outline {
                walls.extend(supporting_plane([p, q, r], all(), tolerance));
            }
        }
        add_sides(&mut walls, a, b, tolerance);
        let bounds = Aabb::of(all());
        Self { walls, bounds }
    }

    /// May a box meet it?
    pub(crate) fn meets_box(&self, b: &Aabb) -> bool {
        b.meets(&self.bounds) && self.walls.iter().all(|wall| wall.may_meet(b))
    }

    /// May these points' convex hull meet it?
    pub(crate) fn meets(&self, mut points: impl Iterator<Item = DVec3> + Clone) -> bool {
        let all = points.clone();
        let reaches = |wall: &HalfSpace| all.clone().any(|x| !wall.excludes(x));
        self.walls.iter().all(reaches) && points.next().is_some()
    }

    /// Does a convex polygon reach into it, and not only touch it?
    fn holds_some_of(&self, polygon: &[DVec3]) -> bool {
        let mut part: SmallVec<[DVec3; 12]> = polygon.into();
        self.walls.iter().all(|wall| {
            part = inside(&part, wall.normal, wall.offset + wall.tolerance);
            !part.is_empty()
        })
    }
}

/// The edges of a loop.
fn edges(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().copied().zip(next.copied())
}

/// The walls of a hull that hold an edge of one outline and a corner of the other.
fn add_sides(walls: &mut SmallVec<[HalfSpace; 32]>, a: &[DVec3], b: &[DVec3], tolerance: f64) {
    for (outline, points) in [(a, b), (b, a)] {
        for (p, q) in edges(outline) {
            for &r in points {
                let all = a.iter().chain(b).copied();
                walls.extend(supporting_plane([p, q, r], all, tolerance));
            }
        }
    }
}

/// The plane through three points, if it has all of `points` on one side, the inner one,
/// and some off it.
fn supporting_plane(
    [p, q, r]: [DVec3; 3],
    points: impl Iterator<Item = DVec3>,
    tolerance: f64,
) -> Option<HalfSpace> {
    let normal = (q - p).cross(r - p).try_normalize()?;
    let offset = normal.dot(p);
    let (mut lo, mut hi) = (0.0f64, 0.0f64);
    for x in points {
        let d = normal.dot(x) - offset;
        (lo, hi) = (lo.min(d), hi.max(d));
    }
    let inwards = |normal, offset| HalfSpace {
        normal,
        offset,
        tolerance,
    };
    if hi <= tolerance && lo < -tolerance {
        Some(inwards(-normal, -offset))
    } else if lo >= -tolerance && hi > tolerance {
        Some(inwards(normal, offset))
    } else {
        None
    }
}

/// The part of a convex polygon where `normal · x > offset`.
fn inside(polygon: &[DVec3], normal: DVec3, offset: f64) -> SmallVec<[DVec3; 12]> {
    let mut kept = SmallVec::new();
    for (p, q) in edges(polygon) {
        let (hp, hq) = (normal.dot(p) - offset, normal.dot(q) - offset);
        if hp > 0.0 {
            kept.push(p);
        }
        if (hp > 0.0) != (hq > 0.0) {
            kept.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    kept
}

impl Evaluator<'_> {
    /// All occluders (positions in [`antumbra_scene::Scene::pieces`]) that may hide a part
    /// of `b` from a point of `a`: those that meet the convex hull of both, and neither
    /// lie in nor behind one of the planes. `None` if no point of one polygon's
    /// front sees the front of the other.
    #[must_use]
    pub fn between(
        &self,
        a: &[DVec3],
        (normal_a, plane_a): (DVec3, PlaneId),
        b: &[DVec3],
        (normal_b, plane_b): (DVec3, PlaneId),
    ) -> Option<Vec<u32>> {
        let tolerance = self.scene.plane_tolerance();
        let [front_a, front_b] =
            [(normal_a, a[0]), (normal_b, b[0])].map(|(normal, x)| HalfSpace {
                normal,
                offset: normal.dot(x),
                tolerance,
            });
        let reaches_in =
            |corners: &[DVec3], wall: &HalfSpace| corners.iter().any(|&x| wall.value(x) > 0.0);
        let above = |points: &[DVec3], x: DVec3, normal: DVec3| {
            points.iter().any(|&p| normal.dot(p - x) > tolerance)
        };
        if !above(b, a[0], normal_a) || !above(a, b[0], normal_b) {
            return None;
        }
        let mut hull = Hull {
            walls: SmallVec::from_slice(&[front_a, front_b]),
            bounds: Aabb::of(a.iter().chain(b).copied()),
        };
        add_sides(&mut hull.walls, a, b, tolerance);
        let mut list = Vec::new();
        self.scene.tree.visit(
            |b| hull.meets_box(b),
            |piece| {
                let plane = self.occluders.plane(piece);
                let corners = self.occluders.corners(piece);
                let is_between = plane != plane_a
                    && plane != plane_b
                    && reaches_in(corners, &front_a)
                    && reaches_in(corners, &front_b)
                    && hull.meets(corners.iter().copied());
                if is_between {
                    list.push(piece);
                }
            },
        );
        list.sort_unstable();
        Some(list)
    }

    /// Those of `occluders` that reach into the convex hull of two polygons: no
    /// other hides anything of `b` from `a` but on a set of measure zero.
    ///
    /// * `a`, `b` — corners, scene units; from [`Evaluator::between`]'s polygons, or
    ///   parts of them.
    /// * `occluders` — from [`Evaluator::between`] for polygons that hold these.
    ///
    /// Occluders that only touch the hull, such as the walls of a convex room, are
    /// left out: good for integrals, not for values on the border.
    #[must_use]
    pub fn narrow(&self, a: &[DVec3], b: &[DVec3], occluders: &[u32]) -> Vec<u32> {
        let corners = |piece: u32| self.occluders.corners(piece);
        let bounds = Aabb::of(a.iter().chain(b).copied());
        let near: SmallVec<[u32; 16]> = occluders
            .iter()
            .copied()
            .filter(|&piece| Aabb::of(corners(piece).iter().copied()).meets(&bounds))
            .collect();
        if near.is_empty() {
            return Vec::new();
        }
        let hull = Hull::of_outlines(a, b, self.scene.plane_tolerance());
        near.into_iter()
            .filter(|&piece| hull.holds_some_of(corners(piece)))
            .collect()
    }
}
