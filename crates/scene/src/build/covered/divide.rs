//! Polygons of one plane divided along one another's borders.
//!
//! A common triangulation of all borders tells which triangles lie in which polygons; what
//! is covered of one is a set of triangles, and its border is a set of their edges. So
//! covered and uncovered parts, and what covers them, have their corners in common.

use crate::build::flat::crossing;
use crate::bvh::{Aabb, BoxTree};
use antumbra_geom::{
    Chart, DVec2, DVec3, cdt, convex_pieces, point_in_polygon, segments_cross, signed_area,
};
use std::collections::BTreeMap;

/// A connected part of a polygon, covered or not.
pub(super) struct Found {
    /// The outline counter-clockwise in the chart, then the holes; vertices of the scene.
    pub(super) loops: Vec<Vec<u32>>,
    pub(super) pieces: Vec<Vec<u32>>,
    pub(super) area: f64,
    pub(super) is_covered: bool,
}

/// The triangulation of some polygons of one plane.
pub(super) struct Division {
    /// Vertices of the scene; triangles index into these.
    ids: Vec<u32>,
    points: Vec<DVec2>,
    triangles: Vec<[u32; 3]>,
    neighbours: Vec<[Option<u32>; 3]>,
    /// Per polygon its triangles, ascending.
    triangles_of: Vec<Vec<u32>>,
    /// Per triangle the polygons that have it.
    polygons_at: Vec<Vec<usize>>,
    /// Which edges of the input an edge is part of.
    origins: BTreeMap<[u32; 2], Vec<u32>>,
}

/// Crossings are resolved in rounds, since a new corner may lie on further edges.
const MOST_ROUNDS: usize = 16;

impl Division {
    /// `None` if the borders cannot be told apart.
    ///
    /// * `vertices` — of the scene; crossings of borders are appended.
    /// * `polygons` — the loops of each.
    /// * `tolerance` — corners this near to an edge lie on it.
    pub(super) fn new(
        vertices: &mut Vec<DVec3>,
        chart: &Chart,
        polygons: &[Vec<Vec<u32>>],
        tolerance: f64,
    ) -> Option<Self> {
        let mut ids: Vec<u32> = polygons.iter().flatten().flatten().copied().collect();
        ids.sort_unstable();
        ids.dedup();
        let flat = |&v: &u32| chart.to_chart(vertices[v as usize]);
        let mut borders = Borders {
            points: ids.iter().map(flat).collect(),
            edges: BTreeMap::new(),
            tolerance,
        };
        let local = |v: u32| ids.binary_search(&v).ok().map(|i| i as u32);
        let mut n_edges = 0;
        for corners in polygons.iter().flatten() {
            for (i, &a) in corners.iter().enumerate() {
                let b = corners[(i + 1) % corners.len()];
                borders.add([local(a)?, local(b)?], &[n_edges]);
                n_edges += 1;
            }
        }
        borders.resolve()?;
        for &point in &borders.points[ids.len()..] {
            ids.push(vertices.len() as u32);
            vertices.push(chart.to_space(point));
        }
        let edges: Vec<[u32; 2]> = borders.edges.keys().copied().collect();
        let triangles = cdt::triangulate(&borders.points, &edges).ok()?.triangles;
        let mut division = Self {
            neighbours: cdt::neighbours(&triangles),
            triangles_of: vec![Vec::new(); polygons.len()],
            polygons_at: vec![Vec::new(); triangles.len()],
            ids,
            points: borders.points,
            triangles,
            origins: borders.edges,
        };
        division.find_members(polygons);
        Some(division)
    }

    fn corners(&self, triangle: u32) -> [DVec2; 3] {
        self.triangles[triangle as usize].map(|i| self.points[i as usize])
    }

    /// Which triangles lie in which polygons. Triangles that no border parts lie in the
    /// same ones, and the largest of them tells: slivers do not know where they are.
    fn find_members(&mut self, polygons: &[Vec<Vec<u32>>]) {
        let index: BTreeMap<u32, usize> =
            self.ids.iter().enumerate().map(|(i, &v)| (v, i)).collect();
        let loops: Vec<Vec<Vec<DVec2>>> = polygons
            .iter()
            .map(|loops| {
                let flat =
                    |corners: &Vec<u32>| corners.iter().map(|v| self.points[index[v]]).collect();
                loops.iter().map(flat).collect()
            })
            .collect();
        let boxes: Vec<(u32, Aabb)> = loops
            .iter()
            .enumerate()
            .map(|(i, loops)| (i as u32, Aabb::of(loops[0].iter().map(|p| p.extend(0.0)))))
            .collect();
        let tree = BoxTree::new(&boxes);
        for region in self.regions() {
            let area = |&t: &u32| signed_area(&self.corners(t));
            let largest = region
                .iter()
                .copied()
                .max_by(|a, b| area(a).total_cmp(&area(b)));
            let Some(largest) = largest else { continue };
            let middle = self.corners(largest).into_iter().sum::<DVec2>() / 3.0;
            let query = Aabb::of([middle.extend(0.0)]);
            let mut members = Vec::new();
            tree.visit(|b| b.meets(&query), |i| members.push(i as usize));
            members.retain(|&i| point_in_polygon(middle, loops[i].iter().map(Vec::as_slice)));
            for &t in &region {
                self.polygons_at[t as usize].clone_from(&members);
            }
            for i in members {
                self.triangles_of[i].extend(&region);
            }
        }
        for triangles in &mut self.triangles_of {
            triangles.sort_unstable();
        }
    }

    /// Sets of triangles that no border parts.
    fn regions(&self) -> Vec<Vec<u32>> {
        let all: Vec<u32> = (0..self.triangles.len() as u32).collect();
        self.connected(&all, |edge| !self.origins.contains_key(&edge))
    }

    /// Sets of the given triangles (ascending) that are connected across such edges.
    fn connected(&self, among: &[u32], is_open: impl Fn([u32; 2]) -> bool) -> Vec<Vec<u32>> {
        let mut is_seen = vec![false; among.len()];
        let mut sets = Vec::new();
        for start in 0..among.len() {
            if is_seen[start] {
                continue;
            }
            is_seen[start] = true;
            let mut set = Vec::new();
            let mut stack = vec![among[start]];
            while let Some(t) = stack.pop() {
                set.push(t);
                for k in 0..3 {
                    let Some(next) = self.neighbours[t as usize][k] else {
                        continue;
                    };
                    if let Ok(place) = among.binary_search(&next)
                        && !is_seen[place]
                        && is_open(self.edge(t, k))
                    {
                        is_seen[place] = true;
                        stack.push(next);
                    }
                }
            }
            set.sort_unstable();
            sets.push(set);
        }
        sets
    }

    /// The `k`-th edge of a triangle, the smaller corner first.
    fn edge(&self, triangle: u32, k: usize) -> [u32; 2] {
        let corners = self.triangles[triangle as usize];
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        [a.min(b), a.max(b)]
    }

    /// The covered and the uncovered parts of a polygon; `None` if one has no outline.
    ///
    /// * `partners` — the polygons that cover it, ascending.
    pub(super) fn parts(&self, polygon: usize, partners: &[usize]) -> Option<Vec<Found>> {
        let is_under = |t: &&u32| {
            let mut polygons = self.polygons_at[**t as usize].iter();
            polygons.any(|p| partners.binary_search(p).is_ok())
        };
        let (covered, open): (Vec<u32>, Vec<u32>) =
            self.triangles_of[polygon].iter().partition(is_under);
        let mut parts = Vec::new();
        for (triangles, is_covered) in [(open, false), (covered, true)] {
            for component in self.connected(&triangles, |_| true) {
                parts.push(self.part(&component, is_covered)?);
            }
        }
        // Triangles come in an order that rounding may decide.
        parts.sort_by(|a, b| (a.is_covered, &a.loops).cmp(&(b.is_covered, &b.loops)));
        Some(parts)
    }

    /// A connected set of triangles as a polygon.
    fn part(&self, component: &[u32], is_covered: bool) -> Option<Found> {
        let mut loops = Vec::new();
        for border in self.borders_of(component) {
            split_at_repeats(border, &mut loops);
        }
        let area = |corners: &[u32]| {
            let corners: Vec<DVec2> = corners.iter().map(|&i| self.points[i as usize]).collect();
            signed_area(&corners)
        };
        let mut uses: BTreeMap<u32, usize> = BTreeMap::new();
        for &corner in loops.iter().flatten() {
            *uses.entry(corner).or_default() += 1;
        }
        let mut loops: Vec<Vec<u32>> = loops
            .into_iter()
            .map(|corners| self.without_passed(&corners, &uses))
            .filter(|corners| corners.len() > 2)
            .map(from_its_smallest)
            .collect();
        loops.sort_unstable();
        let outline = loops.iter().position(|corners| area(corners) > 0.0)?;
        loops[..=outline].rotate_right(1);
        if loops[1..].iter().any(|corners| area(corners) > 0.0) {
            return None;
        }
        let indices: Vec<Vec<usize>> = loops
            .iter()
            .map(|corners| corners.iter().map(|&i| i as usize).collect())
            .collect();
        let pieces = convex_pieces(&self.points, &indices)?;
        let in_scene = |i: usize| self.ids[i];
        Some(Found {
            area: loops.iter().map(|corners| area(corners)).sum(),
            loops: indices
                .into_iter()
                .map(|corners| corners.into_iter().map(in_scene).collect())
                .collect(),
            pieces: pieces
                .into_iter()
                .map(|corners| corners.into_iter().map(in_scene).collect())
                .collect(),
            is_covered,
        })
    }

    /// The borders of a set of triangles (ascending), with the set on the left.
    fn borders_of(&self, set: &[u32]) -> Vec<Vec<u32>> {
        let is_in = |t: u32| set.binary_search(&t).is_ok();
        let is_border = |t: u32, k: usize| {
            let next = self.neighbours[t as usize][k];
            !next.is_some_and(is_in)
        };
        let mut is_done: BTreeMap<(u32, usize), bool> = set
            .iter()
            .flat_map(|&t| (0..3).map(move |k| (t, k)))
            .filter(|&(t, k)| is_border(t, k))
            .map(|edge| (edge, false))
            .collect();
        let starts: Vec<(u32, usize)> = is_done.keys().copied().collect();
        let mut borders = Vec::new();
        for start in starts {
            let mut border = Vec::new();
            let (mut t, mut k) = start;
            while is_done.insert((t, k), true) == Some(false) {
                border.push(self.triangles[t as usize][k]);
                // Turn about the end of this edge, inside of the set, to the next border.
                k = (k + 1) % 3;
                while !is_border(t, k) {
                    let end = self.triangles[t as usize][k];
                    let Some(next) = self.neighbours[t as usize][k] else {
                        break;
                    };
                    t = next;
                    let corners = self.triangles[t as usize];
                    k = (0..3).find(|&k| corners[k] == end).unwrap_or(0);
                }
            }
            if !border.is_empty() {
                borders.push(border);
            }
        }
        borders
    }

    /// A loop without corners at which an edge of the input only goes on; corners where
    /// loops touch stay.
    fn without_passed(&self, corners: &[u32], uses: &BTreeMap<u32, usize>) -> Vec<u32> {
        let n = corners.len();
        let origins = |a: u32, b: u32| self.origins.get(&[a.min(b), a.max(b)]);
        let is_passed = |i: usize| {
            let (before, here, after) =
                (corners[(i + n - 1) % n], corners[i], corners[(i + 1) % n]);
            let (from, to) = (origins(before, here), origins(here, after));
            let goes_on = from
                .zip(to)
                .is_some_and(|(from, to)| from.iter().any(|origin| to.contains(origin)));
            goes_on && uses.get(&here) == Some(&1)
        };
        (0..n)
            .filter(|&i| !is_passed(i))
            .map(|i| corners[i])
            .collect()
    }
}

/// A loop that begins with its smallest corner.
fn from_its_smallest(mut corners: Vec<u32>) -> Vec<u32> {
    let smallest = corners.iter().min().copied();
    let start = corners.iter().position(|c| Some(*c) == smallest);
    corners.rotate_left(start.unwrap_or(0));
    corners
}

/// Cuts a loop where it passes a corner again.
fn split_at_repeats(border: Vec<u32>, loops: &mut Vec<Vec<u32>>) {
    let mut path: Vec<u32> = Vec::new();
    for corner in border {
        if let Some(at) = path.iter().position(|&c| c == corner) {
            loops.push(path.split_off(at));
        }
        path.push(corner);
    }
    loops.push(path);
}

/// Borders of polygons on their way to meet in corners only.
struct Borders {
    points: Vec<DVec2>,
    /// Edges, the smaller corner first, and which edges of the input each is part of.
    edges: BTreeMap<[u32; 2], Vec<u32>>,
    tolerance: f64,
}

impl Borders {
    fn add(&mut self, [a, b]: [u32; 2], origins: &[u32]) {
        if a != b {
            let all = self.edges.entry([a.min(b), a.max(b)]).or_default();
            all.extend(origins);
            all.sort_unstable();
            all.dedup();
        }
    }

    /// Cuts edges at corners that lie on them and where they cross.
    fn resolve(&mut self) -> Option<()> {
        for _ in 0..MOST_ROUNDS {
            self.cut_at_corners();
            if !self.add_crossings() {
                return Some(());
            }
        }
        None
    }

    fn bounds(&self, [a, b]: [u32; 2]) -> Aabb {
        let ends = [a, b].map(|i| self.points[i as usize].extend(0.0));
        let bounds = Aabb::of(ends);
        Aabb {
            min: bounds.min - self.tolerance,
            max: bounds.max + self.tolerance,
        }
    }

    fn cut_at_corners(&mut self) {
        let boxes = self.points.iter().enumerate();
        let boxes: Vec<(u32, Aabb)> = boxes
            .map(|(i, p)| (i as u32, Aabb::of([p.extend(0.0)])))
            .collect();
        let tree = BoxTree::new(&boxes);
        for (edge, origins) in std::mem::take(&mut self.edges) {
            let query = self.bounds(edge);
            let [a, b] = edge.map(|i| self.points[i as usize]);
            let along = b - a;
            let mut on: Vec<(f64, u32)> = Vec::new();
            tree.visit(
                |b| b.meets(&query),
                |i| {
                    let p = self.points[i as usize];
                    let t = (p - a).dot(along) / along.length_squared();
                    let is_on = t > 0.0 && t < 1.0 && p.distance(a + along * t) <= self.tolerance;
                    if !edge.contains(&i) && is_on {
                        on.push((t, i));
                    }
                },
            );
            on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            let mut from = edge[0];
            for to in on.into_iter().map(|(_, i)| i).chain([edge[1]]) {
                self.add([from, to], &origins);
                from = to;
            }
        }
    }

    /// Adds a corner wherever two edges cross; were there any?
    fn add_crossings(&mut self) -> bool {
        let edges: Vec<[u32; 2]> = self.edges.keys().copied().collect();
        let boxes: Vec<(u32, Aabb)> = edges
            .iter()
            .enumerate()
            .map(|(i, &edge)| (i as u32, self.bounds(edge)))
            .collect();
        let tree = BoxTree::new(&boxes);
        let mut crossings: Vec<DVec2> = Vec::new();
        for (i, query) in &boxes {
            let mut near = Vec::new();
            tree.visit(|b| b.meets(query), |j| near.push(j));
            near.retain(|j| j > i);
            near.sort_unstable();
            for j in near {
                let [s, t] = [*i, j].map(|k| edges[k as usize].map(|i| self.points[i as usize]));
                if segments_cross(s[0], s[1], t[0], t[1]) {
                    crossings.push(crossing(s, t));
                }
            }
        }
        let n_before = self.points.len();
        for &x in &crossings {
            let is_new = self.points[n_before..]
                .iter()
                .all(|p| p.distance(x) > self.tolerance);
            if is_new {
                self.points.push(x);
            }
        }
        !crossings.is_empty()
    }
}
