//! Rooms that are not closed, and the surface at fault.
//!
//! A wall that was written down in the wrong place leaves a room open: light
//! escapes, and no number says so. The check works on edges. Written-down
//! coordinates do not meet to the last digit, so corners within 10⁻⁴ of the scene
//! count as one here, and edges are cut where corners lie on them. A stretch of
//! edge is *free* if an odd number of surfaces end in it, whatever the way they
//! face, and it does not lie on another (a box without bottom on a floor is closed
//! by the floor).
//!
//! A surface with more than half of its border free is *loose*: a plate, a lamp, a
//! partition, the pane in a window, or the misplaced wall. Loose surfaces are set
//! aside first, the loosest before the others, so that what they leave open shows;
//! if nothing is open without them, all is well. The surfaces that remain form
//! components, and a component is a room that is open if
//!
//! 1. it has free stretches;
//! 2. they are less than half of all its edges: so it is with every box that lacks
//!    one side, and with none that lacks two that meet;
//! 3. it surrounds something: its area vectors, which cancel in a closed shell,
//!    add up to less than 0.6 of its area. A sheet has 1, a half cylinder 0.64, a
//!    box of 12 m × 14 m × 3 m without ceiling 0.52.

use crate::build::short;
use crate::bvh::{Aabb, BoxTree};
use crate::problem::{Problem, Severity};
use crate::scene::{Face, Scene, SurfaceId};
use antumbra_geom::{DVec2, point_in_polygon};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Corners this close, relative to the scene's extent, are one: rooms are written
/// down to five digits (`real/energyplus-lshaped` misses by 2.8e-6), and a gap
/// between a lamp and its ceiling is 1.2e-4 (1 mm in 8 m).
const JOINED: f64 = 1e-4;
/// Loose is what has more of its border free.
const LOOSE: f64 = 0.5;
/// Loose surfaces that differ by less in this go together.
const LOOSE_TOGETHER: f64 = 0.1;
/// Free edges of a room, relative to all its edges.
const MOSTLY_JOINED: f64 = 0.5;
/// Sum of the area vectors of a room, relative to its area.
const SURROUNDING: f64 = 0.6;

/// A room that light can leave.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenRoom {
    /// What encloses it, ascending.
    pub surfaces: Vec<SurfaceId>,
    /// Length of the edges at which it is open, file units.
    pub gap_length: f64,
    /// The smallest box of these edges, file units.
    pub gap_from: DVec3,
    /// Its other corner.
    pub gap_to: DVec3,
    /// The surfaces that end there, and along what length, the longest first.
    pub rim: Vec<(SurfaceId, f64)>,
    /// Surfaces at or in it that have no partner along most of their border, and along
    /// which part, the largest first: perhaps one of them is what is missing.
    pub loose: Vec<(SurfaceId, f64)>,
}

impl OpenRoom {
    /// The finding, for the report of a check.
    #[must_use]
    pub fn problem(&self, scene: &Scene) -> Problem {
        let name = |&(surface, _): &(SurfaceId, f64)| scene.surfaces[surface.index()].name.clone();
        let unit = scene.length_unit.symbol();
        let length = |x: f64| format!("{} {unit}", short(round(x)));
        let point = |p: DVec3| {
            let [x, y, z] = p.to_array().map(|x| short(round(x)));
            format!("({x}, {y}, {z})")
        };
        let mut message = String::new();
        if !self.loose.is_empty() {
            let loose = listed(&self.loose, |item| {
                format!("'{}' ({:.0} % of it)", name(item), 100.0 * item.1)
            });
            message += &format!("no partner for the border of {loose}, and ");
        }
        let rim = listed(&self.rim, |item| {
            format!("'{}' ({})", name(item), length(item.1))
        });
        message += &format!(
            "a room of {} surfaces is open: between {} and {} its edges join nothing, {} in all, at {rim}",
            self.surfaces.len(),
            point(self.gap_from),
            point(self.gap_to),
            length(self.gap_length),
        );
        Problem {
            severity: Severity::Warning,
            kind: "open-room",
            names: self.loose.iter().chain(&self.rim).map(name).collect(),
            found: Some(round(self.gap_length)),
            allowed: Some(0.0),
            message,
        }
    }
}

/// Six digits: the joints are not known to more.
fn round(x: f64) -> f64 {
    let x: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    x + 0.0
}

/// Up to four items, and how many more there are.
fn listed<T>(items: &[T], text: impl Fn(&T) -> String) -> String {
    const SHOWN: usize = 4;
    let mut all = items
        .iter()
        .take(SHOWN)
        .map(text)
        .collect::<Vec<_>>()
        .join(", ");
    if items.len() > SHOWN {
        all += &format!(" and {} more", items.len() - SHOWN);
    }
    all
}

impl Scene {
    /// Sets of surfaces that look like rooms but are open, in the order of their
    /// first surfaces.
    #[must_use]
    pub fn open_rooms(&self) -> Vec<OpenRoom> {
        let joints = Joints::new(self);
        let kept = joints.kept(self);
        let loose = joints.without_partners(self);
        joints
            .components(self, &kept)
            .into_iter()
            .filter_map(|surfaces| joints.room(self, &kept, &loose, surfaces))
            .collect()
    }
}

/// Where a face runs along a stretch.
#[derive(Clone, Copy)]
struct Run {
    face: u32,
    surface: SurfaceId,
    /// From the smaller corner to the larger?
    is_forward: bool,
}

/// Stretches of edges between joined corners, and who runs along them.
struct Joints {
    tolerance: f64,
    corners: Vec<DVec3>,
    stretches: BTreeMap<[u32; 2], Stretch>,
}

/// A stretch of an edge between neighbouring corners.
#[derive(Default)]
struct Stretch {
    runs: Vec<Run>,
    /// The parts that do not lie on a surface.
    free: Vec<[DVec3; 2]>,
}

impl Joints {
    fn new(scene: &Scene) -> Self {
        let tolerance = JOINED * scene.extent;
        let (corners, corner_of) = joined(&scene.vertices, tolerance);
        let mut joints = Self {
            tolerance,
            corners,
            stretches: BTreeMap::new(),
        };
        let mut runs: Vec<([u32; 2], Run)> = Vec::new();
        for (f, face) in fronts(scene) {
            for corners in face.loops() {
                for (i, a) in corners.iter().enumerate() {
                    let b = corners[(i + 1) % corners.len()];
                    let [a, b] = [a.index(), b.index()].map(|v| corner_of[v]);
                    let run = Run {
                        face: f as u32,
                        surface: face.surface,
                        is_forward: a < b,
                    };
                    if a != b {
                        runs.push(([a.min(b), a.max(b)], run));
                    }
                }
            }
        }
        let on_edges = joints.corners_on(runs.iter().map(|(edge, _)| *edge));
        for (edge, run) in runs {
            let mut from = edge[0];
            for &to in on_edges[&edge].iter().chain([&edge[1]]) {
                let key = [from.min(to), from.max(to)];
                let run = Run {
                    is_forward: run.is_forward == (from < to),
                    ..run
                };
                joints.stretches.entry(key).or_default().runs.push(run);
                from = to;
            }
        }
        let mut stretches = std::mem::take(&mut joints.stretches);
        for (stretch, Stretch { free, .. }) in &mut stretches {
            *free = joints.uncovered(scene, stretch);
        }
        joints.stretches = stretches;
        joints
    }

    /// For every edge the corners inside it, from its first end to its second.
    fn corners_on(&self, edges: impl Iterator<Item = [u32; 2]>) -> BTreeMap<[u32; 2], Vec<u32>> {
        let boxes: Vec<(u32, Aabb)> = self
            .corners
            .iter()
            .enumerate()
            .map(|(i, &p)| (i as u32, Aabb { min: p, max: p }))
            .collect();
        let tree = BoxTree::new(&boxes);
        let mut on_edges = BTreeMap::new();
        for edge in edges {
            on_edges.entry(edge).or_insert_with(|| {
                let [a, b] = edge.map(|c| self.corners[c as usize]);
                let around = Aabb::of([a, b]);
                let around = Aabb {
                    min: around.min - self.tolerance,
                    max: around.max + self.tolerance,
                };
                let along = b - a;
                let mut on: Vec<(f64, u32)> = Vec::new();
                tree.visit(
                    |candidate| candidate.meets(&around),
                    |c| {
                        let p = self.corners[c as usize];
                        let t = (p - a).dot(along) / along.length_squared();
                        let is_inside = !edge.contains(&c) && 0.0 < t && t < 1.0;
                        if is_inside && p.distance(a + t * along) <= self.tolerance {
                            on.push((t, c));
                        }
                    },
                );
                on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
                on.into_iter().map(|(_, c)| c).collect()
            });
        }
        on_edges
    }

    fn length(&self, stretch: &[u32; 2]) -> f64 {
        let [a, b] = stretch.map(|c| self.corners[c as usize]);
        a.distance(b)
    }

    /// Surfaces without partners along most of their border, and which part of it.
    fn without_partners(&self, scene: &Scene) -> BTreeMap<SurfaceId, f64> {
        let all = vec![true; scene.surfaces.len()];
        let shares = self.free_shares(&all, |_, length| length);
        let ids = (0..).map(SurfaceId);
        ids.zip(shares)
            .filter(|(_, share)| *share > LOOSE)
            .collect()
    }

    /// Which surfaces are not loose.
    fn kept(&self, scene: &Scene) -> Vec<bool> {
        let mut kept = vec![true; scene.surfaces.len()];
        loop {
            let shares = self.free_shares(&kept, |stretch, _| {
                stretch.free.iter().map(|[a, b]| a.distance(*b)).sum()
            });
            let largest = shares.iter().copied().fold(0.0, f64::max);
            if largest <= LOOSE {
                return kept;
            }
            // The loosest go first: a pane in a window leaves its wall joined.
            let least = LOOSE.max(largest - LOOSE_TOGETHER);
            for (kept, share) in kept.iter_mut().zip(shares) {
                *kept &= share <= least;
            }
        }
    }

    /// The part of every kept surface's border where an odd number of kept surfaces
    /// end, by what such a stretch counts for, of its length.
    fn free_shares(&self, kept: &[bool], counts: impl Fn(&Stretch, f64) -> f64) -> Vec<f64> {
        let mut border = vec![[0.0; 2]; kept.len()];
        for (corners, stretch) in &self.stretches {
            let length = self.length(corners);
            let runs = || stretch.runs.iter().filter(|r| kept[r.surface.index()]);
            let is_odd = runs().count() % 2 == 1;
            let free_length = if is_odd { counts(stretch, length) } else { 0.0 };
            for run in runs() {
                let [free, all] = &mut border[run.surface.index()];
                *all += length;
                *free += free_length;
            }
        }
        border
            .iter()
            .map(|&[free, all]| if all > 0.0 { free / all } else { 0.0 })
            .collect()
    }

    /// Kept surfaces that hang together by stretches.
    fn components(&self, scene: &Scene, kept: &[bool]) -> Vec<BTreeSet<SurfaceId>> {
        fn root(parent: &mut [usize], mut i: usize) -> usize {
            while parent[i] != i {
                parent[i] = parent[parent[i]];
                i = parent[i];
            }
            i
        }
        let mut parent: Vec<usize> = (0..scene.surfaces.len()).collect();
        for Stretch { runs, .. } in self.stretches.values() {
            let mut surfaces = runs
                .iter()
                .map(|run| run.surface.index())
                .filter(|&s| kept[s]);
            let Some(first) = surfaces.next() else {
                continue;
            };
            for other in surfaces {
                let (a, b) = (root(&mut parent, first), root(&mut parent, other));
                parent[a.max(b)] = a.min(b);
            }
        }
        let mut components: BTreeMap<usize, BTreeSet<SurfaceId>> = BTreeMap::new();
        for s in (0..kept.len()).filter(|&s| kept[s] && !scene.surfaces[s].faces.is_empty()) {
            let root = root(&mut parent, s);
            components
                .entry(root)
                .or_default()
                .insert(SurfaceId(s as u32));
        }
        components.into_values().collect()
    }

    /// What is wrong with a component, if it is a room that is open.
    fn room(
        &self,
        scene: &Scene,
        kept: &[bool],
        loose: &BTreeMap<SurfaceId, f64>,
        surfaces: BTreeSet<SurfaceId>,
    ) -> Option<OpenRoom> {
        let mut whole = 0.0;
        let mut gap = 0.0;
        let mut bounds = Aabb::EMPTY;
        let mut rim: BTreeMap<SurfaceId, f64> = BTreeMap::new();
        let mut beside: BTreeMap<SurfaceId, f64> = BTreeMap::new();
        for (stretch, Stretch { runs, free }) in &self.stretches {
            let mut here = runs.iter().filter(|r| surfaces.contains(&r.surface));
            let Some(first) = here.next() else { continue };
            let length = self.length(stretch);
            whole += length;
            for run in runs {
                if let Some(&share) = loose.get(&run.surface) {
                    beside.insert(run.surface, share);
                }
            }
            if here.count() % 2 == 1 {
                continue;
            }
            for &[from, to] in free {
                let length = from.distance(to);
                gap += length;
                bounds = bounds.union(Aabb::of([from, to]));
                *rim.entry(first.surface).or_default() += length;
            }
        }
        if gap <= 10.0 * self.tolerance || gap >= MOSTLY_JOINED * whole {
            return None;
        }
        if self.area_vectors(scene, kept, &surfaces) >= SURROUNDING {
            return None;
        }
        let to_file = |length: f64| scene.frame.length_to_file(length);
        let by_size = |sizes: BTreeMap<SurfaceId, f64>| {
            let mut sizes: Vec<(SurfaceId, f64)> = sizes.into_iter().collect();
            sizes.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            sizes
        };
        Some(OpenRoom {
            surfaces: surfaces.into_iter().collect(),
            gap_length: to_file(gap),
            gap_from: scene.frame.to_file(bounds.min),
            gap_to: scene.frame.to_file(bounds.max),
            rim: by_size(rim)
                .into_iter()
                .map(|(s, x)| (s, to_file(x)))
                .collect(),
            loose: by_size(beside),
        })
    }

    /// The parts of a stretch that do not lie on a surface.
    fn uncovered(&self, scene: &Scene, stretch: &[u32; 2]) -> Vec<[DVec3; 2]> {
        let [a, b] = stretch.map(|c| self.corners[c as usize]);
        let length = a.distance(b);
        let around = Aabb::of([a, b]);
        let around = Aabb {
            min: around.min - self.tolerance,
            max: around.max + self.tolerance,
        };
        let mut faces = BTreeSet::new();
        scene.tree.visit(
            |candidate| candidate.meets(&around),
            |piece| {
                faces.insert(scene.pieces[piece as usize].face);
            },
        );
        // Where the border of any face in whose plane it lies crosses it.
        let mut charts = Vec::new();
        let mut cuts = vec![0.0, 1.0];
        for face in faces {
            let chart = scene.chart(face);
            if chart.height(a).abs() > self.tolerance || chart.height(b).abs() > self.tolerance {
                continue;
            }
            let loops: Vec<Vec<DVec2>> = scene
                .face(face)
                .loops()
                .map(|corners| {
                    let corners = corners.iter();
                    corners
                        .map(|&v| chart.to_chart(scene.position(v)))
                        .collect()
                })
                .collect();
            let (a, b) = (chart.to_chart(a), chart.to_chart(b));
            for (c, d) in loops.iter().flat_map(|corners| edges(corners)) {
                let (along, across) = (b - a, d - c);
                let turn = along.perp_dot(across);
                let t = (c - a).perp_dot(across) / turn;
                if t > 0.0 && t < 1.0 {
                    cuts.push(t);
                }
                for end in [c, d] {
                    let t = (end - a).dot(along) / along.length_squared();
                    if t > 0.0 && t < 1.0 {
                        cuts.push(t);
                    }
                }
            }
            charts.push((chart, loops));
        }
        cuts.sort_by(f64::total_cmp);
        cuts.windows(2)
            .filter(|t| (t[1] - t[0]) * length > self.tolerance)
            .map(|t| [t[0], t[1]].map(|t| a + t * (b - a)))
            .filter(|[from, to]| {
                let middle = (*from + *to) / 2.0;
                !charts.iter().any(|(chart, loops)| {
                    let middle = chart.to_chart(middle);
                    point_in_polygon(middle, loops.iter().map(Vec::as_slice))
                        && loops
                            .iter()
                            .flat_map(|corners| edges(corners))
                            .all(|edge| distance(middle, edge) > self.tolerance)
                })
            })
            .collect()
    }

    /// The length of the sum of all area vectors, relative to the area, with all
    /// faces turned the way of their neighbours.
    fn area_vectors(&self, scene: &Scene, kept: &[bool], surfaces: &BTreeSet<SurfaceId>) -> f64 {
        let mut neighbours: BTreeMap<u32, Vec<(u32, bool)>> = BTreeMap::new();
        for Stretch { runs, .. } in self.stretches.values() {
            let runs: Vec<&Run> = runs.iter().filter(|r| kept[r.surface.index()]).collect();
            if let [a, b] = runs[..]
                && surfaces.contains(&a.surface)
            {
                let is_turned = a.is_forward == b.is_forward;
                neighbours
                    .entry(a.face)
                    .or_default()
                    .push((b.face, is_turned));
                neighbours
                    .entry(b.face)
                    .or_default()
                    .push((a.face, is_turned));
            }
        }
        let mut is_seen = vec![false; scene.faces.len()];
        let (mut vectors, mut area) = (0.0, 0.0);
        for (f, _) in fronts(scene).filter(|(_, face)| surfaces.contains(&face.surface)) {
            let mut sum = DVec3::ZERO;
            let mut open = vec![(f as u32, 1.0)];
            while let Some((f, sign)) = open.pop() {
                if std::mem::replace(&mut is_seen[f as usize], true) {
                    continue;
                }
                let face = &scene.faces[f as usize];
                sum += face.normal * (sign * face.area);
                area += face.area;
                for &(next, is_turned) in neighbours.get(&f).into_iter().flatten() {
                    open.push((next, if is_turned { -sign } else { sign }));
                }
            }
            vectors += sum.length();
        }
        vectors / area
    }
}

fn fronts(scene: &Scene) -> impl Iterator<Item = (usize, &Face)> {
    scene
        .faces
        .iter()
        .enumerate()
        .filter(|(_, face)| !face.is_back)
}

fn edges(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    let n = corners.len();
    (0..n).map(move |i| (corners[i], corners[(i + 1) % n]))
}

fn distance(p: DVec2, (a, b): (DVec2, DVec2)) -> f64 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(a + t * along)
}

/// Corners such that every point is within `tolerance` of its own, and which that
/// is. The first point of a cluster is its corner, so clusters do not creep.
fn joined(points: &[DVec3], tolerance: f64) -> (Vec<DVec3>, Vec<u32>) {
    let mut corners: Vec<DVec3> = Vec::new();
    let mut corner_of = Vec::with_capacity(points.len());
    let mut grid: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    for &p in points {
        let cell = p.to_array().map(|x| (x / tolerance).floor() as i64);
        let mut known = None;
        for i in 0..27 {
            let near = [0, 1, 2].map(|k| cell[k] + [-1, 0, 1][i / [1, 3, 9][k] % 3]);
            let found = grid.get(&near).into_iter().flatten();
            let found = found
                .copied()
                .find(|&c| corners[c as usize].distance(p) <= tolerance);
            known = known.or(found);
        }
        let corner = known.unwrap_or_else(|| {
            let new = corners.len() as u32;
            corners.push(p);
            grid.entry(cell).or_default().push(new);
            new
        });
        corner_of.push(corner);
    }
    (corners, corner_of)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::{MaterialInput, SceneInput, SurfaceInput};
    use glam::dvec3;

    fn surface(name: &str, corners: &[DVec3]) -> SurfaceInput {
        SurfaceInput {
            name: name.to_owned(),
            material: "white".to_owned(),
            vertices: corners.to_vec(),
            holes: Vec::new(),
        }
    }

    fn open_rooms(surfaces: Vec<SurfaceInput>) -> Vec<Problem> {
        let input = SceneInput {
            materials: vec![MaterialInput {
                name: "white".to_owned(),
                reflectance: vec![0.5],
                exitance: vec![1.0],
                two_sided: false,
            }],
            surfaces,
            ..SceneInput::default()
        };
        let scene = Scene::build(&input).unwrap().scene;
        let rooms = scene.open_rooms();
        rooms.iter().map(|room| room.problem(&scene)).collect()
    }

    /// The walls over a plan, then floor and ceiling, facing inwards.
    fn room(plan: &[(f64, f64)], height: f64) -> Vec<SurfaceInput> {
        let at = |(x, y): (f64, f64), z: f64| dvec3(x, y, z);
        let n = plan.len();
        let mut surfaces: Vec<SurfaceInput> = (0..n)
            .map(|i| {
                let (a, b) = (plan[i], plan[(i + 1) % n]);
                let corners = [at(b, 0.0), at(a, 0.0), at(a, height), at(b, height)];
                surface(&format!("wall-{i}"), &corners)
            })
            .collect();
        let floor: Vec<DVec3> = plan.iter().map(|&p| at(p, 0.0)).collect();
        let ceiling: Vec<DVec3> = plan.iter().rev().map(|&p| at(p, height)).collect();
        surfaces.push(surface("floor", &floor));
        surfaces.push(surface("ceiling", &ceiling));
        surfaces
    }

    const BOX: [(f64, f64); 4] = [(0.0, 0.0), (6.0, 0.0), (6.0, 5.0), (0.0, 5.0)];
    const L: [(f64, f64); 6] = [
        (0.0, 0.0),
        (6.0, 0.0),
        (6.0, 2.0),
        (3.0, 2.0),
        (3.0, 5.0),
        (0.0, 5.0),
    ];

    #[test]
    fn closed_rooms_are_closed_with_whatever_stands_in_them() {
        assert_eq!(open_rooms(room(&BOX, 3.0)), []);
        assert_eq!(open_rooms(room(&L, 3.0)), []);
        let mut furnished = room(&BOX, 3.0);
        // A box without bottom, a partition on three sides, a lamp below the ceiling.
        let mut chest = room(&[(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (2.0, 1.0)], 2.5);
        chest.retain(|s| s.name != "floor");
        for s in &mut chest {
            s.name = format!("chest-{}", s.name);
        }
        furnished.append(&mut chest);
        let upright = [(3.0, 0.0), (5.0, 0.0), (5.0, 3.0), (3.0, 3.0)];
        furnished.push(surface(
            "partition",
            &upright.map(|(y, z)| dvec3(4.0, y, z)),
        ));
        let flat = [(4.5, 1.0), (5.0, 1.0), (5.0, 2.0), (4.5, 2.0)];
        furnished.push(surface("lamp", &flat.map(|(x, y)| dvec3(x, y, 2.9))));
        assert_eq!(open_rooms(furnished), []);
    }

    #[test]
    fn room_without_ceiling_is_open_along_its_walls() {
        let mut surfaces = room(&BOX, 3.0);
        surfaces.pop();
        let found = open_rooms(surfaces);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].names, ["wall-0", "wall-2", "wall-1", "wall-3"]);
        assert_eq!(found[0].found, Some(22.0));
        assert_eq!(
            found[0].message,
            "a room of 5 surfaces is open: between (0, 0, 3) and (6, 5, 3) its edges join nothing, 22 m in all, at 'wall-0' (6 m), 'wall-2' (6 m), 'wall-1' (5 m), 'wall-3' (5 m)"
        );
    }

    #[test]
    fn wall_in_the_wrong_place_is_named_first() {
        let mut surfaces = room(&L, 3.0);
        // The wall at the inner corner, pushed into the room where it fits as well.
        for p in &mut surfaces[2].vertices {
            p.x -= 3.0;
        }
        let found = open_rooms(surfaces);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].names[0], "wall-2", "{}", found[0].message);
        assert_eq!(found[0].found, Some(9.0));
    }

    #[test]
    fn corners_that_miss_by_rounding_are_joined_and_others_are_not() {
        let with_miss = |miss: f64| {
            let mut surfaces = room(&BOX, 3.0);
            surfaces[1].vertices[0].z += miss;
            surfaces[1].vertices[1].z += miss;
            open_rooms(surfaces)
        };
        assert_eq!(with_miss(3e-4), []);
        let found = with_miss(0.05);
        assert_eq!(found.len(), 1);
        assert!(found[0].names.iter().any(|n| n == "wall-1"), "{found:?}");
    }

    #[test]
    fn sheets_and_corners_are_no_rooms() {
        let mut surfaces = room(&BOX, 3.0);
        surfaces.truncate(2);
        surfaces.push(room(&BOX, 3.0).remove(4));
        assert_eq!(open_rooms(surfaces), []);
        // A fine sheet has few free edges, but surrounds nothing.
        let sheet = (0..64).map(|k| {
            let (x, y) = (f64::from(k % 8), f64::from(k / 8));
            let bump = |x: f64, y: f64| dvec3(x, y, 0.1 * x * x);
            let corners = [
                bump(x, y),
                bump(x + 1.0, y),
                bump(x + 1.0, y + 1.0),
                bump(x, y + 1.0),
            ];
            surface(&format!("sheet-{k}"), &corners)
        });
        assert_eq!(open_rooms(sheet.collect()), []);
    }
}
