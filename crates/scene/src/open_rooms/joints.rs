//! Where surfaces join: stretches of edges between joined corners.

use crate::bvh::{Aabb, BoxTree};
use crate::scene::{Face, FaceId, Scene, SurfaceId};
use crate::sets::Sets;
use antumbra_geom::{DVec2, Stop, point_in_polygon};
use glam::DVec3;
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// Corners this close, relative to the scene's extent, are one: rooms are written
/// down to five digits (`real/energyplus-lshaped` misses by 2.8e-6), and a gap
/// between a lamp and its ceiling is 1.2e-4 (1 mm in 8 m).
const JOINED: f64 = 1e-4;
/// Loose is what has more of its border free.
const LOOSE: f64 = 0.5;
/// Loose surfaces that differ by less in this go together.
const LOOSE_TOGETHER: f64 = 0.1;

/// Where a face runs along a stretch.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub(super) face: u32,
    pub(super) surface: SurfaceId,
    /// From the smaller corner to the larger?
    is_forward: bool,
}

/// A stretch of an edge between neighbouring corners.
pub(super) struct Stretch {
    /// The smaller one first.
    corners: [u32; 2],
    pub(super) runs: Vec<Run>,
    /// The parts that do not lie on a surface, once somebody asked.
    free: OnceCell<Vec<[DVec3; 2]>>,
}

/// Stretches of edges between joined corners, and who runs along them.
pub(super) struct Joints<'a> {
    pub(super) scene: &'a Scene,
    pub(super) tolerance: f64,
    /// Nobody looks at what is found after a stop.
    pub(super) stop: Stop<'a>,
    corners: Vec<DVec3>,
    /// Sorted by their corners.
    stretches: Vec<Stretch>,
    /// Per surface, ascending; one in which it runs several times is there as often.
    stretches_of: Vec<Vec<u32>>,
    /// Per surface: is it not loose?
    kept: Vec<bool>,
}

/// Kept surfaces that hang together by stretches.
#[derive(Default)]
pub(super) struct Component {
    /// Ascending.
    pub(super) surfaces: Vec<SurfaceId>,
    /// Those in which they end, ascending.
    stretches: Vec<u32>,
}

/// Faces that hang together by stretches of two, with the sign that turns each the way of
/// the first.
pub(super) struct Shell {
    pub(super) faces: Vec<(u32, f64)>,
    /// Do all stretches agree on the signs?
    pub(super) is_orientable: bool,
}

impl<'a> Joints<'a> {
    pub(super) fn new(scene: &'a Scene, stop: Stop<'a>) -> Self {
        let tolerance = JOINED * scene.extent;
        let (corners, corner_of) = joined(&scene.vertices, tolerance);
        let mut joints = Self {
            scene,
            tolerance,
            stop,
            corners,
            stretches: Vec::new(),
            stretches_of: vec![Vec::new(); scene.surfaces.len()],
            kept: vec![true; scene.surfaces.len()],
        };
        let edges = edges_of_fronts(scene, &corner_of);
        let on_edges = joints.corners_on(edges.iter().map(|(edge, _)| *edge));
        if stop.is_wanted() {
            return joints;
        }
        let mut runs: Vec<([u32; 2], Run)> = Vec::new();
        for (edge, run) in edges {
            let mut from = edge[0];
            for &to in on_edges[&edge].iter().chain([&edge[1]]) {
                let is_forward = run.is_forward == (from < to);
                runs.push(([from.min(to), from.max(to)], Run { is_forward, ..run }));
                from = to;
            }
        }
        // Stable: who runs along a stretch stays in the order of the faces.
        runs.sort_by_key(|(corners, _)| *corners);
        for same in runs.chunk_by(|a, b| a.0 == b.0) {
            let runs = without_seams(scene, same.iter().map(|(_, run)| *run));
            if runs.is_empty() {
                continue;
            }
            let i = joints.stretches.len() as u32;
            for run in &runs {
                joints.stretches_of[run.surface.index()].push(i);
            }
            joints.stretches.push(Stretch {
                corners: same[0].0,
                runs,
                free: OnceCell::new(),
            });
        }
        joints.set_loose_aside();
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
        for edge in edges.take_while(|_| !self.stop.is_wanted()) {
            on_edges.entry(edge).or_insert_with(|| {
                let [a, b] = edge.map(|c| self.corners[c as usize]);
                let along = b - a;
                let mut on: Vec<(f64, u32)> = Vec::new();
                tree.visit(
                    |candidate| candidate.meets_segment(a, b, self.tolerance),
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

    pub(super) fn length(&self, stretch: &Stretch) -> f64 {
        let [a, b] = stretch.corners.map(|c| self.corners[c as usize]);
        a.distance(b)
    }

    /// The parts of a stretch that do not lie on a surface.
    pub(super) fn free<'s>(&self, stretch: &'s Stretch) -> &'s [[DVec3; 2]] {
        stretch.free.get_or_init(|| self.uncovered(stretch))
    }

    /// The first kept surface at a stretch where an odd number of them end.
    pub(super) fn ends_free(&self, stretch: &Stretch) -> Option<SurfaceId> {
        let mut runs = self.kept_runs(stretch);
        let first = runs.next()?;
        runs.count().is_multiple_of(2).then_some(first.surface)
    }

    fn kept_runs<'s>(&'s self, stretch: &'s Stretch) -> impl Iterator<Item = &'s Run> {
        let runs = stretch.runs.iter();
        runs.filter(|run| self.kept[run.surface.index()])
    }

    /// Surfaces without partners along most of their border, and which part of it.
    pub(super) fn without_partners(&self) -> BTreeMap<SurfaceId, f64> {
        let surfaces = (0..self.kept.len()).map(|s| {
            let share = self.share(s, |stretch| {
                let is_odd = !stretch.runs.len().is_multiple_of(2);
                if is_odd { self.length(stretch) } else { 0.0 }
            });
            (SurfaceId(s as u32), share)
        });
        surfaces.filter(|(_, share)| *share > LOOSE).collect()
    }

    /// Sets surfaces aside until none is loose.
    fn set_loose_aside(&mut self) {
        let share = |joints: &Self, s: usize| {
            joints.share(s, |stretch| match joints.ends_free(stretch) {
                Some(_) if joints.stop.is_wanted() => 0.0,
                Some(_) => joints
                    .free(stretch)
                    .iter()
                    .map(|[a, b]| a.distance(*b))
                    .sum(),
                None => 0.0,
            })
        };
        let mut shares: Vec<f64> = (0..self.kept.len()).map(|s| share(self, s)).collect();
        // Shares are not negative, so their bits are in their order.
        let mut order: BTreeSet<(u64, usize)> = (0..shares.len())
            .map(|s| (shares[s].to_bits(), s))
            .collect();
        while let Some(&(largest, _)) = order.last()
            && f64::from_bits(largest) > LOOSE
            && !self.stop.is_wanted()
        {
            // The loosest go first: a pane in a window leaves its wall joined.
            let least = LOOSE.max(f64::from_bits(largest) - LOOSE_TOGETHER);
            let mut beside: BTreeSet<usize> = BTreeSet::new();
            while let Some(&(bits, s)) = order.last()
                && f64::from_bits(bits) > least
            {
                order.remove(&(bits, s));
                self.kept[s] = false;
                for &i in &self.stretches_of[s] {
                    let runs = &self.stretches[i as usize].runs;
                    beside.extend(runs.iter().map(|run| run.surface.index()));
                }
            }
            for s in beside.into_iter().filter(|&s| self.kept[s]) {
                order.remove(&(shares[s].to_bits(), s));
                shares[s] = share(self, s);
                order.insert((shares[s].to_bits(), s));
            }
        }
    }

    /// The part of a surface's border that counts, of its length.
    fn share(&self, s: usize, counts: impl Fn(&Stretch) -> f64) -> f64 {
        let (mut part, mut all) = (0.0, 0.0);
        for &i in &self.stretches_of[s] {
            let stretch = &self.stretches[i as usize];
            all += self.length(stretch);
            part += counts(stretch);
        }
        if all > 0.0 { part / all } else { 0.0 }
    }

    /// Kept surfaces that hang together by stretches, in the order of their first.
    pub(super) fn components(&self) -> Vec<Component> {
        let mut sets = Sets::new(self.kept.len());
        for stretch in &self.stretches {
            let mut surfaces = self.kept_runs(stretch).map(|run| run.surface.index());
            let Some(first) = surfaces.next() else {
                continue;
            };
            for other in surfaces {
                sets.join(first, other);
            }
        }
        let mut components: BTreeMap<usize, Component> = BTreeMap::new();
        for s in 0..self.kept.len() {
            if self.kept[s] && !self.scene.surfaces[s].faces.is_empty() {
                let component = components.entry(sets.first_of(s)).or_default();
                component.surfaces.push(SurfaceId(s as u32));
            }
        }
        for (i, stretch) in self.stretches.iter().enumerate() {
            if let Some(run) = self.kept_runs(stretch).next() {
                let root = sets.first_of(run.surface.index());
                components.entry(root).or_default().stretches.push(i as u32);
            }
        }
        components.into_values().collect()
    }

    /// The stretches in which surfaces of a component end.
    pub(super) fn of<'s>(&'s self, component: &'s Component) -> impl Iterator<Item = &'s Stretch> {
        let stretches = component.stretches.iter();
        stretches.map(|&i| &self.stretches[i as usize])
    }

    /// The parts of a stretch that do not lie on a surface.
    fn uncovered(&self, stretch: &Stretch) -> Vec<[DVec3; 2]> {
        let [a, b] = stretch.corners.map(|c| self.corners[c as usize]);
        let length = a.distance(b);
        let mut covered: Vec<[f64; 2]> = Vec::new();
        let mut faces = Vec::new();
        self.scene.tree.visit(
            |candidate| candidate.meets_segment(a, b, self.tolerance),
            |piece| {
                let face = self.scene.face(self.scene.pieces[piece as usize].face);
                let plane = &self.scene.planes[face.plane.index()];
                let is_off = |p: DVec3| plane.distance(p).abs() > self.tolerance;
                if !is_off(a) && !is_off(b) {
                    faces.extend(self.scene.faces_of(piece));
                }
            },
        );
        faces.sort_unstable();
        faces.dedup();
        // Not in the faces that it is an edge of.
        let is_border = |f: &FaceId| stretch.runs.iter().any(|run| run.face == f.0);
        for face in faces.into_iter().filter(|f| !is_border(f)) {
            let chart = self.scene.chart(face);
            let ends = [a, b].map(|p| chart.to_chart(p));
            let loops = self.scene.loops_in_chart(face, &chart);
            covered.extend(covered_by(&loops, ends, self.tolerance));
        }
        covered.sort_by(|s, t| s[0].total_cmp(&t[0]));
        let mut free = Vec::new();
        let mut from = 0.0;
        for [start, end] in covered.into_iter().chain([[1.0, 1.0]]) {
            if (start - from) * length > self.tolerance {
                free.push([from, start].map(|t| a + t * (b - a)));
            }
            from = from.max(end);
        }
        free
    }

    /// The faces of a component, turned the way of their neighbours.
    pub(super) fn shells(&self, component: &Component) -> Vec<Shell> {
        let mut neighbours: BTreeMap<u32, Vec<(u32, bool)>> = BTreeMap::new();
        for stretch in self.of(component) {
            let runs: Vec<&Run> = self.kept_runs(stretch).collect();
            if let [a, b] = runs[..] {
                let is_turned = a.is_forward == b.is_forward;
                let mut add = |a: u32, b: u32| {
                    neighbours.entry(a).or_default().push((b, is_turned));
                };
                add(a.face, b.face);
                add(b.face, a.face);
            }
        }
        let scene = self.scene;
        let mut signs: BTreeMap<u32, f64> = BTreeMap::new();
        let mut shells = Vec::new();
        let surfaces = component
            .surfaces
            .iter()
            .map(|s| &scene.surfaces[s.index()]);
        let faces = surfaces.flat_map(|surface| surface.faces.clone());
        for f in faces.filter(|&f| !scene.faces[f as usize].is_back) {
            let mut shell = Shell {
                faces: Vec::new(),
                is_orientable: true,
            };
            let mut open = vec![(f, 1.0)];
            while let Some((f, sign)) = open.pop() {
                if let Some(&known) = signs.get(&f) {
                    shell.is_orientable &= known * sign > 0.0;
                    continue;
                }
                signs.insert(f, sign);
                shell.faces.push((f, sign));
                for &(next, is_turned) in neighbours.get(&f).into_iter().flatten() {
                    open.push((next, if is_turned { -sign } else { sign }));
                }
            }
            if !shell.faces.is_empty() {
                shells.push(shell);
            }
        }
        shells
    }

    /// The length of the sum of all area vectors, relative to the area, with all
    /// faces turned the way of their neighbours.
    pub(super) fn area_vectors(&self, shells: &[Shell]) -> f64 {
        let (mut vectors, mut area) = (0.0, 0.0);
        for shell in shells {
            let mut sum = DVec3::ZERO;
            for &(f, sign) in &shell.faces {
                let face = &self.scene.faces[f as usize];
                sum += face.normal * (sign * face.area);
                area += face.area;
            }
            vectors += sum.length();
        }
        vectors / area
    }
}

/// Who runs along a stretch, but for the covered and the uncovered part of one surface on
/// either side of it: there the surface goes on.
fn without_seams(scene: &Scene, runs: impl Iterator<Item = Run>) -> Vec<Run> {
    let mut kept: Vec<Run> = Vec::new();
    for run in runs {
        let is_covered = |run: &Run| scene.faces[run.face as usize].is_covered;
        let goes_on = |other: &Run| {
            other.surface == run.surface
                && other.is_forward != run.is_forward
                && is_covered(other) != is_covered(&run)
        };
        match kept.iter().position(goes_on) {
            Some(at) => {
                kept.remove(at);
            }
            None => kept.push(run),
        }
    }
    kept
}

/// The edges of all fronts between joined corners, and whose they are.
fn edges_of_fronts(scene: &Scene, corner_of: &[u32]) -> Vec<([u32; 2], Run)> {
    let mut edges = Vec::new();
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
                    edges.push(([a.min(b), a.max(b)], run));
                }
            }
        }
    }
    edges
}

/// Which parts of a segment lie in a polygon, and not along its border; 0 at its first
/// end, 1 at its second.
fn covered_by(loops: &[Vec<DVec2>], [a, b]: [DVec2; 2], tolerance: f64) -> Vec<[f64; 2]> {
    let along = b - a;
    let length = along.length();
    // What lies on one side does not cover it.
    let heights = || {
        let corners = loops[0].iter();
        corners.map(|&p| along.perp_dot(p - a) / length)
    };
    if heights().all(|h| h <= tolerance) || heights().all(|h| h >= -tolerance) {
        return Vec::new();
    }
    let mut cuts = vec![0.0, 1.0];
    for (c, d) in loops.iter().flat_map(|corners| edges(corners)) {
        let across = d - c;
        let t = (c - a).perp_dot(across) / along.perp_dot(across);
        let ends = [c, d].map(|end| (end - a).dot(along) / along.length_squared());
        cuts.extend(
            [t, ends[0], ends[1]]
                .into_iter()
                .filter(|&t| t > 0.0 && t < 1.0),
        );
    }
    cuts.sort_by(f64::total_cmp);
    cuts.windows(2)
        .filter(|t| (t[1] - t[0]) * length > tolerance)
        .map(|t| [t[0], t[1]])
        .filter(|t| {
            let middle = a + f64::midpoint(t[0], t[1]) * along;
            let mut border = loops.iter().flat_map(|corners| edges(corners));
            point_in_polygon(middle, loops.iter().map(Vec::as_slice))
                && border.all(|edge| distance(middle, edge) > tolerance)
        })
        .collect()
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
