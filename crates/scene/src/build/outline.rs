//! From the loops of a surface to plane polygons with convex pieces.

use super::flat::{Flat, Refusal, Shape, crossing_point};
use super::loops::{open_keyholes, without_repeats};
use super::near::NearEdges;
use super::weld::WELD_TOLERANCE;
use super::{Findings, Units, short};
use crate::bvh::Aabb;
use crate::scene::Scene;
use antumbra_geom::{
    Chart, DVec2, DVec3, Plane, bounding_box, newell_normal, point_in_polygon, signed_area,
};

/// Off its plane by less than this part of its size a surface is plane: eight
/// digits more than drawing programs write, seven fewer than a rotation loses.
const FLAT: f64 = 1e-9;
/// Off its plane by up to this part of its size it is split into triangles; the
/// measured walls of the Cornell box need 1.8e-3.
const WARPED: f64 = 2e-3;

/// A plane polygon over welded vertices.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// Counter-clockwise seen from the front.
    pub(super) outline: Vec<u32>,
    /// Clockwise seen from the front.
    pub(super) holes: Vec<Vec<u32>>,
    /// Convex, counter-clockwise.
    pub(super) pieces: Vec<Vec<u32>>,
    /// Unit normal.
    pub(super) normal: DVec3,
    /// The corner nearest to the middle of the corners' heights.
    pub(super) point: u32,
    pub(super) area: f64,
    /// Thickness across the longest extent: rounding tilts the plane by its inverse.
    pub(super) width: f64,
}

impl Polygon {
    /// Of a triangle over these vertices, if it has an area.
    pub(super) fn triangle(corners: [u32; 3], vertices: &[DVec3], extent: f64) -> Option<Self> {
        let positions = corners.map(|v| vertices[v as usize]);
        let width = width(&positions);
        let newell = newell_normal(&positions);
        (width > smallest_width(extent)).then(|| Self {
            outline: corners.to_vec(),
            holes: Vec::new(),
            pieces: vec![corners.to_vec()],
            normal: newell / newell.length() + DVec3::ZERO,
            point: corners[0],
            area: newell.length() / 2.0,
            width,
        })
    }

    /// Its plane.
    pub(super) fn plane(&self, vertices: &[DVec3]) -> Plane {
        Plane {
            normal: self.normal,
            point: vertices[self.point as usize],
        }
    }

    /// All corners, of the outline and of the holes.
    pub(super) fn corners(&self) -> impl Iterator<Item = &u32> {
        self.outline.iter().chain(self.holes.iter().flatten())
    }

    /// Replaces every vertex id.
    pub(super) fn renumber(&mut self, new_id: impl Fn(u32) -> u32) {
        let loops = std::iter::once(&mut self.outline).chain(&mut self.holes);
        for v in loops.chain(&mut self.pieces).flatten() {
            *v = new_id(*v);
        }
        self.point = new_id(self.point);
    }
}

/// Makes polygons of loops and reports what it finds.
pub(super) struct Shaper<'a> {
    pub(super) vertices: &'a [DVec3],
    pub(super) extent: f64,
    pub(super) units: Units,
    /// Is what is warped split, however much?
    pub(super) triangulate: bool,
    pub(super) findings: &'a mut Findings,
}

impl Shaper<'_> {
    /// The polygons of a surface: none if it was refused or dropped, several if
    /// it was split.
    pub(super) fn polygons(&mut self, s: usize, name: &str, loops: &[Vec<u32>]) -> Vec<Polygon> {
        if loops.is_empty() {
            return Vec::new();
        }
        match self.try_polygons(s, name, loops) {
            Ok(polygons) => polygons,
            Err(Refusal::Empty) => {
                self.findings.warning(
                    Findings::surface(s),
                    "zero-area",
                    vec![name.to_owned()],
                    format!("surface '{name}': dropped, for it has no area"),
                );
                Vec::new()
            }
            Err(Refusal::Bad(kind, text)) => {
                let message = format!("surface '{name}': {text}");
                self.findings
                    .error(Findings::surface(s), kind, vec![name.to_owned()], message);
                Vec::new()
            }
        }
    }

    fn try_polygons(
        &mut self,
        s: usize,
        name: &str,
        loops: &[Vec<u32>],
    ) -> Result<Vec<Polygon>, Refusal> {
        check_counts(loops)?;
        let shape = self.clean(loops)?;
        self.report_cleaning(s, name, &shape);
        let positions = self.positions(&shape.outline);
        let width = width(&positions);
        if width <= self.smallest_width() {
            return Err(Refusal::Empty);
        }
        let normal = self.normal(&positions, width);
        let all: Vec<u32> = shape
            .outline
            .iter()
            .chain(shape.holes.iter().flatten())
            .copied()
            .collect();
        let (point, deviation) = self.middle(&all, normal);
        let bounds = Aabb::of(positions.iter().copied());
        let size = (bounds.max - bounds.min).length();
        let relative = deviation / size;
        // A thin surface must be flat by its thickness, or its plane has no meaning.
        let thickness = width.min(newell_normal(&positions).length() / size);
        let flat = (FLAT * size).min(1e-3 * thickness);
        let flat = flat.max(self.extent * Scene::PLANE_TOLERANCE);
        let is_flat = deviation <= flat;
        if relative > WARPED && !is_flat && !self.triangulate {
            return Err(Refusal::Bad(
                "non-planar",
                format!(
                    "not planar: a vertex lies {} off its plane, {} of its size (allowed {WARPED:e} of its size)",
                    self.units.length(deviation),
                    short(relative)
                ),
            ));
        }

        // From here on in the chart, by exact predicates.
        let chart = Chart::new(self.vertices[point as usize], normal);
        let allowed = flat / size;
        let flat = Flat::new(&chart, self.vertices, &all);
        let mut shape = shape;
        if !shape.is_convex {
            self.check_crossings(&shape, &flat)?;
            check_holes(&mut shape, &flat)?;
        }
        if thickness <= self.smallest_width() {
            return Err(Refusal::Empty);
        }
        if is_flat {
            let pieces = flat.pieces(&shape)?;
            let area = self.area(&shape.outline)
                - shape.holes.iter().map(|hole| self.area(hole)).sum::<f64>();
            let Shape { outline, holes, .. } = shape;
            return Ok(vec![Polygon {
                outline,
                holes,
                pieces,
                normal,
                point,
                area,
                width: thickness,
            }]);
        }
        let triangles = flat.triangles(&shape)?;
        let polygons: Vec<Polygon> = triangles
            .into_iter()
            .filter_map(|corners| Polygon::triangle(corners, self.vertices, self.extent))
            .collect();
        if polygons.is_empty() {
            return Err(Refusal::Empty);
        }
        self.findings.warning(
            Findings::surface(s),
            "non-planar",
            vec![name.to_owned()],
            format!(
                "surface '{name}': not planar: a vertex lies {} off its plane, {} of its size (allowed {} of its size); split into {} triangles",
                self.units.length(deviation),
                short(relative),
                short(allowed),
                polygons.len()
            ),
        );
        self.findings.with_numbers(relative, allowed);
        Ok(polygons)
    }

    /// Repeats, keyholes, touching corners, collinear corners.
    fn clean(&self, loops: &[Vec<u32>]) -> Result<Shape, Refusal> {
        let mut shape = Shape {
            outline: without_repeats(&loops[0]),
            holes: Vec::new(),
            is_convex: false,
            n_repeated: 0,
            n_collinear: 0,
            n_opened: 0,
            n_empty_holes: 0,
        };
        let mut given: Vec<Vec<u32>> = loops
            .iter()
            .map(|corners| without_repeats(corners))
            .collect();
        let total = |loops: &[Vec<u32>]| loops.iter().map(Vec::len).sum::<usize>();
        shape.n_repeated = total(loops) - total(&given);

        if loops.len() == 1 && self.is_strictly_convex(&shape.outline) {
            shape.is_convex = true;
            return Ok(shape);
        }
        let positions = self.positions(&shape.outline);
        if width(&positions) <= self.smallest_width() {
            return Err(Refusal::Empty);
        }

        // An outline bridged to its holes comes apart where it runs along an
        // edge twice; so that it does, edges are cut at corners that touch them.
        self.cut_at_touching_corners(&mut given);
        let normal = self.normal(&positions, width(&positions));
        let mut parts = open_keyholes(&given[0]);
        parts = parts
            .into_iter()
            .flat_map(|part| self.split_pinches(part, normal))
            .collect();
        let area = |part: &Vec<u32>| newell_normal(&self.positions(part)).dot(normal);
        let outer = (0..parts.len())
            .max_by(|&a, &b| {
                area(&parts[a])
                    .abs()
                    .total_cmp(&area(&parts[b]).abs())
                    .then(b.cmp(&a))
            })
            .ok_or(Refusal::Empty)?;
        shape.outline = parts.swap_remove(outer);
        let side = area(&shape.outline);
        parts.retain(|part| self.drop_collinear(part, &[]).len() > 2);
        // A hole may run the way of the outline: what lies in it is what counts.
        let chart = Chart::new(positions[0], normal);
        let in_chart = |part: &Vec<u32>| -> Vec<DVec2> {
            let corners = self.positions(part);
            corners.into_iter().map(|p| chart.to_chart(p)).collect()
        };
        let outline = in_chart(&shape.outline);
        let is_inside = |part: &Vec<u32>| {
            let corners = in_chart(part);
            point_in_polygon((corners[0] + corners[1]) / 2.0, [outline.as_slice()])
        };
        if parts
            .iter()
            .any(|part| area(part) * side > 0.0 && !is_inside(part))
        {
            return Err(Refusal::Bad(
                "self-intersecting",
                "the outline is several parts joined by a line or lies over itself (allowed one simple outline)"
                    .to_owned(),
            ));
        }
        shape.n_opened = parts.len();
        shape.holes = parts;
        shape.holes.extend(given.drain(1..));

        // A corner stays where loops touch, for there it is no mere point of a line.
        let mut all: Vec<u32> = shape
            .outline
            .iter()
            .chain(shape.holes.iter().flatten())
            .copied()
            .collect();
        all.sort_unstable();
        let shared: Vec<u32> = all
            .windows(2)
            .filter(|pair| pair[0] == pair[1])
            .map(|pair| pair[0])
            .collect();
        shape.outline = self.drop_collinear(&shape.outline, &shared);
        shape.holes = shape
            .holes
            .iter()
            .map(|hole| self.drop_collinear(hole, &shared))
            .collect();
        let n_holes = shape.holes.len();
        shape.holes.retain(|hole| hole.len() > 2);
        shape.n_empty_holes = n_holes - shape.holes.len();
        let mut given_ids: Vec<u32> = loops.iter().flatten().copied().collect();
        given_ids.sort_unstable();
        given_ids.dedup();
        let mut kept: Vec<u32> = shape
            .outline
            .iter()
            .chain(shape.holes.iter().flatten())
            .copied()
            .collect();
        kept.sort_unstable();
        kept.dedup();
        shape.n_collinear = given_ids.len() - kept.len();
        if shape.outline.len() < 3 {
            return Err(Refusal::Empty);
        }
        Ok(shape)
    }

    fn report_cleaning(&mut self, s: usize, name: &str, shape: &Shape) {
        let place = Findings::surface(s);
        let names = || vec![name.to_owned()];
        if shape.n_opened > 0 {
            self.findings.warning(
                place,
                "keyhole",
                names(),
                format!(
                    "surface '{name}': the outline runs along a line to {} and back; opened into an outline and holes",
                    counted(shape.n_opened, "hole", "holes")
                ),
            );
        }
        let mut dropped = Vec::new();
        if shape.n_repeated > 0 {
            dropped.push(format!("{} repeated", shape.n_repeated));
        }
        if shape.n_collinear > 0 {
            dropped.push(format!("{} collinear", shape.n_collinear));
        }
        if !dropped.is_empty() {
            let n = shape.n_repeated + shape.n_collinear;
            self.findings.warning(
                place,
                "repeated-vertices",
                names(),
                format!(
                    "surface '{name}': {} {} dropped",
                    dropped.join(" and "),
                    if n == 1 { "vertex" } else { "vertices" }
                ),
            );
            self.findings.with_numbers(n as f64, 0.0);
        }
        if shape.n_empty_holes > 0 {
            self.findings.warning(
                place,
                "zero-area",
                names(),
                format!(
                    "surface '{name}': {} without area dropped",
                    counted(shape.n_empty_holes, "hole", "holes")
                ),
            );
        }
    }

    fn positions(&self, corners: &[u32]) -> Vec<DVec3> {
        corners.iter().map(|&v| self.vertices[v as usize]).collect()
    }

    fn tolerance(&self) -> f64 {
        self.extent * WELD_TOLERANCE
    }

    fn smallest_width(&self) -> f64 {
        smallest_width(self.extent)
    }

    fn area(&self, corners: &[u32]) -> f64 {
        newell_normal(&self.positions(corners)).length() / 2.0
    }

    /// Unit normal; for an outline whose lobes cancel, of three of its corners.
    fn normal(&self, positions: &[DVec3], width: f64) -> DVec3 {
        let newell = newell_normal(positions);
        let (first, far) = longest(positions);
        let length = (far - first).length();
        // A quotient, not a product with the inverse: exactly unit along an axis.
        if newell.length() > 1e-6 * width * length {
            let normal = newell / newell.length() + DVec3::ZERO;
            return self.without_cancellation(positions, normal);
        }
        let cross = positions
            .iter()
            .map(|&p| (far - first).cross(p - first))
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .unwrap_or(DVec3::Z);
        cross / cross.length()
    }

    /// The normal of a long and narrow outline, in which products of two long vectors
    /// cancel: their rounding turns the plane about its width, and lifts far ends off it.
    /// Where corners are farther off it than their own rounding, and products with the
    /// shortest edges of triangles say that they need not be, that is the normal.
    fn without_cancellation(&self, positions: &[DVec3], normal: DVec3) -> DVec3 {
        let off = |normal: DVec3| {
            let heights = positions
                .iter()
                .map(|&p| normal.dot(p - positions[0]).abs());
            heights.fold(0.0, f64::max)
        };
        let found = off(normal);
        if found <= Scene::ROUNDING * self.extent {
            return normal;
        }
        let doubled = |w: &[DVec3]| {
            let sides = [w[0] - positions[0], w[1] - w[0], positions[0] - w[1]];
            let longest = (1..3).fold(0, |most, k| {
                let is_longer = sides[k].length_squared() > sides[most].length_squared();
                if is_longer { k } else { most }
            });
            sides[(longest + 1) % 3].cross(sides[(longest + 2) % 3])
        };
        let sum: DVec3 = positions.windows(2).skip(1).map(doubled).sum();
        let better = sum / sum.length() + DVec3::ZERO;
        if off(better) < 0.5 * found {
            better
        } else {
            normal
        }
    }

    /// The corner nearest to the middle of all heights, and half their range.
    fn middle(&self, corners: &[u32], normal: DVec3) -> (u32, f64) {
        let origin = self.vertices[corners[0] as usize];
        let height = |v: u32| (self.vertices[v as usize] - origin).dot(normal);
        let (mut low, mut high) = (0.0f64, 0.0f64);
        for &v in corners {
            low = low.min(height(v));
            high = high.max(height(v));
        }
        let middle = f64::midpoint(low, high);
        let off = |v: u32| (height(v) - middle).abs();
        let mut nearest = corners[0];
        for &v in corners {
            if off(v) < off(nearest) {
                nearest = v;
            }
        }
        (nearest, (high - low) / 2.0)
    }

    /// Does it turn left at every corner, once around, each corner standing out
    /// by more than the tolerance?
    fn is_strictly_convex(&self, corners: &[u32]) -> bool {
        let positions = self.positions(corners);
        let width = width(&positions);
        if width <= self.smallest_width() {
            return false;
        }
        let normal = self.normal(&positions, width);
        let n = positions.len();
        let turns_left = |a: DVec3, b: DVec3, c: DVec3| {
            (b - a).cross(c - a).dot(normal) > 2.0 * self.tolerance() * (c - a).length()
        };
        (0..n).all(|i| turns_left(positions[i], positions[(i + 1) % n], positions[(i + 2) % n]))
            && (1..n - 1).all(|i| turns_left(positions[0], positions[i], positions[i + 1]))
    }

    /// Inserts into every edge the corners of the surface that lie on it.
    fn cut_at_touching_corners(&self, loops: &mut [Vec<u32>]) {
        let mut all: Vec<u32> = loops.iter().flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        let near = NearEdges::new(all.iter().map(|&v| Aabb::of([self.vertices[v as usize]])));
        for corners in loops {
            let mut cut = Vec::with_capacity(corners.len());
            for (i, &a) in corners.iter().enumerate() {
                let b = corners[(i + 1) % corners.len()];
                cut.push(a);
                let edge = [a, b].map(|v| self.vertices[v as usize]);
                // Wider than the tolerance, which the walk's rounding stays below.
                let mut on: Vec<(f64, u32)> = near
                    .of(edge, 2.0 * self.tolerance())
                    .into_iter()
                    .map(|k| all[k])
                    .filter(|&v| v != a && v != b)
                    .filter_map(|v| Some((self.position_along(a, b, v)?, v)))
                    .collect();
                on.sort_by(|x, y| x.0.total_cmp(&y.0));
                cut.extend(on.into_iter().map(|(_, v)| v));
            }
            *corners = cut;
        }
    }

    /// Where on the open segment `ab` the vertex lies, 0 to 1, if it does.
    fn position_along(&self, a: u32, b: u32, v: u32) -> Option<f64> {
        let [a, b, v] = [a, b, v].map(|i| self.vertices[i as usize]);
        let along = b - a;
        let t = (v - a).dot(along) / along.length_squared();
        ((0.0..=1.0).contains(&t) && v.distance(a + t * along) <= self.tolerance()).then_some(t)
    }

    /// Takes apart a loop at corners it passes twice, where a part runs the
    /// other way round: a hole that touches the outline in a corner.
    fn split_pinches(&self, corners: Vec<u32>, normal: DVec3) -> Vec<Vec<u32>> {
        let mut distinct = corners.clone();
        distinct.sort_unstable();
        distinct.dedup();
        if distinct.len() == corners.len() {
            return vec![corners];
        }
        let mut parts = Vec::new();
        let mut rest = corners;
        let mut i = 0;
        while i < rest.len() {
            let again = (i + 1..rest.len()).find(|&j| rest[j] == rest[i]);
            if let Some(j) = again {
                let part = rest[i..j].to_vec();
                if newell_normal(&self.positions(&part)).dot(normal) < 0.0 {
                    rest.drain(i..j);
                    parts.push(part);
                    continue;
                }
            }
            i += 1;
        }
        parts.push(rest);
        parts
    }

    /// The loop without corners on the line through their neighbours.
    fn drop_collinear(&self, corners: &[u32], keep: &[u32]) -> Vec<u32> {
        let mut corners = without_repeats(corners);
        loop {
            let n = corners.len();
            let mut kept: Vec<u32> = Vec::with_capacity(n);
            for i in 0..n {
                let previous = kept.last().copied().unwrap_or(corners[n - 1]);
                let next = corners[(i + 1) % n];
                let is_needed = keep.binary_search(&corners[i]).is_ok()
                    || self.stands_out(previous, corners[i], next);
                if is_needed {
                    kept.push(corners[i]);
                }
            }
            let kept = without_repeats(&kept);
            if kept.len() == n || kept.len() < 3 {
                return kept;
            }
            corners = kept;
        }
    }

    fn stands_out(&self, a: u32, b: u32, c: u32) -> bool {
        let [a, b, c] = [a, b, c].map(|i| self.vertices[i as usize]);
        let base = (c - a).length();
        base > self.tolerance() && (b - a).cross(c - a).length() / base > self.tolerance()
    }

    fn check_crossings(&self, shape: &Shape, flat: &Flat) -> Result<(), Refusal> {
        let Some((first, second)) = flat.first_crossing(shape) else {
            return Ok(());
        };
        let near = self.units.point(crossing_point(
            flat.segment(first),
            flat.segment(second),
            flat,
        ));
        let which = |which: usize| {
            if which == 0 {
                "the outline".to_owned()
            } else {
                format!("hole {which}")
            }
        };
        let (a, b) = (
            first.in_loop.min(second.in_loop),
            first.in_loop.max(second.in_loop),
        );
        Err(if a == b {
            Refusal::Bad(
                "self-intersecting",
                format!(
                    "{} crosses itself near {near} (allowed 0 crossings)",
                    which(a)
                ),
            )
        } else {
            Refusal::Bad(
                "hole",
                format!(
                    "hole {b} crosses {} or runs along it near {near} (allowed 0 crossings)",
                    which(a)
                ),
            )
        })
    }
}

/// What is narrower has no area. Sixteen plane tolerances: a surface with all corners in a
/// plane class, to the tolerance, is then tilted by an eighth at most.
pub(super) fn smallest_width(extent: f64) -> f64 {
    64.0 * extent * WELD_TOLERANCE
}

fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

fn check_counts(loops: &[Vec<u32>]) -> Result<(), Refusal> {
    for (k, corners) in loops.iter().enumerate() {
        let n = corners.len();
        let mut distinct = corners.clone();
        distinct.sort_unstable();
        distinct.dedup();
        let what = if k == 0 {
            "has".to_owned()
        } else {
            format!("hole {k} has")
        };
        if n < 3 {
            return Err(Refusal::Bad(
                "too-few-vertices",
                format!(
                    "{what} {}, at least 3 are needed",
                    counted(n, "vertex", "vertices")
                ),
            ));
        }
        // Holes without area are dropped with their collinear corners.
        if k == 0 && distinct.len() < 3 {
            return Err(Refusal::Empty);
        }
    }
    Ok(())
}

/// Puts the holes clockwise and checks that they lie in the outline and apart.
fn check_holes(shape: &mut Shape, flat: &Flat) -> Result<(), Refusal> {
    let outline = flat.points(&shape.outline);
    let holes: Vec<Vec<DVec2>> = shape.holes.iter().map(|hole| flat.points(hole)).collect();
    let boxes = holes.iter().map(|hole| bounding_box(hole.iter().copied()));
    let boxes: Vec<[DVec2; 2]> = boxes.collect();
    let holds = |[low, high]: [DVec2; 2], p: DVec2| low.cmple(p).all() && p.cmple(high).all();
    for (k, hole) in holes.iter().enumerate() {
        // No loop crosses another: one point decides.
        let inside = hole[0].midpoint(hole[1]);
        if !point_in_polygon(inside, [outline.as_slice()]) {
            return Err(Refusal::Bad(
                "hole",
                format!("hole {} lies outside the outline (allowed inside)", k + 1),
            ));
        }
        let within = (0..holes.len()).find(|&other| {
            other != k
                && holds(boxes[other], inside)
                && point_in_polygon(inside, [holes[other].as_slice()])
        });
        if let Some(other) = within {
            return Err(Refusal::Bad(
                "hole",
                format!(
                    "hole {} lies inside hole {} (allowed outside)",
                    k + 1,
                    other + 1
                ),
            ));
        }
        if signed_area(hole) > 0.0 {
            shape.holes[k].reverse();
        }
    }
    Ok(())
}

/// The first corner and the corner farthest from it.
fn longest(positions: &[DVec3]) -> (DVec3, DVec3) {
    let first = positions[0];
    let far = positions.iter().copied().max_by(|a, b| {
        a.distance_squared(first)
            .total_cmp(&b.distance_squared(first))
    });
    (first, far.unwrap_or(first))
}

/// The largest distance of a corner from the line along the longest extent.
pub(super) fn width(positions: &[DVec3]) -> f64 {
    let (first, far) = longest(positions);
    let length = (far - first).length();
    if length == 0.0 {
        return 0.0;
    }
    positions
        .iter()
        .map(|&p| (p - first).cross(far - first).length() / length)
        .fold(0.0, f64::max)
}
