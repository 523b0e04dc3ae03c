//! Segments on one line become pieces that do not overlap.
//!
//! Critical curves come in bundles: many events share a plane, and their traces
//! lie on one line up to rounding. All segments near a line are cut at all the
//! nodes on it; each piece between two nodes exists once, with the set of the
//! curves that cover it. Without this step `n` overlapping segments would be cut
//! into `n^2` pieces.

use std::collections::{BTreeMap, HashMap};
use std::f64::consts::PI;

use antumbra_geom::{Stop, bounding_box};
use glam::{DVec2, dvec2};
use smallvec::SmallVec;

use crate::grid::Grid;
use crate::nodes::Node;
use crate::sets::{CurveSets, SetId};

/// A straight part of one or several curves between two nodes.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// Ascending.
    pub(crate) ends: [u32; 2],
    /// Ascending, each once.
    pub(crate) curves: SmallVec<[u32; 2]>,
    /// Is one of the curves a border?
    pub(crate) is_boundary: bool,
    /// Do borders pass here an odd number of times?
    pub(crate) toggles: bool,
}

/// A part of a line between two neighbouring nodes on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Piece {
    /// Ascending.
    pub(crate) ends: [u32; 2],
    pub(crate) curves: SetId,
    pub(crate) toggles: bool,
}

/// The segments as pieces, and how many lines they are on.
///
/// A segment belongs to a line if both its ends are within `tolerance` pixels of
/// it. Border segments define lines first, then the longest. Nodes within
/// `tolerance` of a line cut it, also those of no segment on it. Nothing if it was
/// stopped.
pub(crate) fn cut_lines(
    nodes: &[Node],
    segments: &[Segment],
    tolerance: f64,
    sets: &mut CurveSets,
    stop: Stop<'_>,
) -> Option<(Vec<Piece>, usize)> {
    let lines = cluster(nodes, segments, tolerance, stop)?;
    let positions: Vec<DVec2> = nodes.iter().map(|n| n.position).collect();
    let grid = Grid::of_points(&positions);
    let mut pieces = Vec::new();
    for line in &lines {
        if stop.is_wanted() {
            return None;
        }
        line.cut(&positions, segments, &grid, tolerance, sets, &mut pieces);
    }
    pieces.sort_unstable();
    merge_pieces(&mut pieces, sets);
    Some((pieces, lines.len()))
}

/// Makes sorted pieces with the same ends one.
pub(crate) fn merge_pieces(pieces: &mut Vec<Piece>, sets: &mut CurveSets) {
    let mut merged: Vec<Piece> = Vec::with_capacity(pieces.len());
    let mut together: Vec<SetId> = Vec::new();
    for group in pieces.chunk_by(|a, b| a.ends == b.ends) {
        together.clear();
        together.extend(group.iter().map(|p| p.curves));
        together.dedup();
        let toggles = group.iter().fold(false, |odd, p| odd ^ p.toggles);
        merged.push(Piece {
            ends: group[0].ends,
            curves: sets.union(&together),
            toggles,
        });
    }
    *pieces = merged;
}

/// A line and the segments on it.
struct Line {
    origin: DVec2,
    direction: DVec2,
    members: Vec<u32>,
}

impl Line {
    fn through([a, b]: [DVec2; 2]) -> Self {
        Self {
            origin: a,
            direction: (b - a).normalize_or_zero(),
            members: Vec::new(),
        }
    }

    fn distance(&self, p: DVec2) -> f64 {
        self.direction.perp_dot(p - self.origin).abs()
    }

    fn parameter(&self, p: DVec2) -> f64 {
        self.direction.dot(p - self.origin)
    }

    /// Appends the pieces between all nodes on the line that segments cover.
    fn cut(
        &self,
        positions: &[DVec2],
        segments: &[Segment],
        grid: &Grid,
        tolerance: f64,
        sets: &mut CurveSets,
        pieces: &mut Vec<Piece>,
    ) {
        // Which stretches of the line are covered.
        let at = |n: u32| (self.parameter(positions[n as usize]), n);
        let mut stretches: Vec<(f64, f64)> = self
            .members
            .iter()
            .map(|&m| segments[m as usize].ends.map(|n| at(n).0))
            .map(|[s, t]| (s.min(t), s.max(t)))
            .collect();
        stretches.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        stretches.dedup_by(|next, last| {
            let overlaps = next.0 <= last.1;
            if overlaps {
                last.1 = last.1.max(next.1);
            }
            overlaps
        });

        // All nodes there, along the line.
        let mut stops: Vec<(f64, u32)> = self
            .members
            .iter()
            .flat_map(|&m| segments[m as usize].ends)
            .map(at)
            .collect();
        for &(from, to) in &stretches {
            let ends = [from, to].map(|t| self.origin + t * self.direction);
            grid.walk(ends[0], ends[1], tolerance, &mut |cell| {
                for &n in grid.items(cell) {
                    let (t, n) = at(n);
                    let is_near = self.distance(positions[n as usize]) <= tolerance;
                    if is_near && from < t && t < to {
                        stops.push((t, n));
                    }
                }
            });
        }
        stops.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        stops.dedup();

        // Sweep from stop to stop with the set of segments that cover.
        let rank = |n: u32| {
            let (t, n) = at(n);
            stops.partition_point(|s| s.0.total_cmp(&t).then(s.1.cmp(&n)).is_lt())
        };
        let mut events: Vec<(usize, bool, u32)> = Vec::with_capacity(2 * self.members.len());
        for &m in &self.members {
            let [s, t] = segments[m as usize].ends.map(rank);
            events.push((s.min(t), true, m));
            events.push((s.max(t), false, m));
        }
        events.sort_unstable();
        let mut events = events.into_iter().peekable();
        let mut covering: BTreeMap<u32, u32> = BTreeMap::new();
        let mut toggles = false;
        let mut curves = None;
        for (k, pair) in stops.windows(2).enumerate() {
            while let Some((_, starts, m)) = events.next_if(|e| e.0 == k) {
                let segment = &segments[m as usize];
                toggles ^= segment.toggles;
                curves = None;
                for &c in &segment.curves {
                    let count = covering.entry(c).or_insert(0);
                    if starts {
                        *count += 1;
                    } else {
                        *count -= 1;
                        if *count == 0 {
                            covering.remove(&c);
                        }
                    }
                }
            }
            if covering.is_empty() {
                continue;
            }
            let set = *curves.get_or_insert_with(|| {
                sets.intern(&covering.keys().copied().collect::<Vec<u32>>())
            });
            let (a, b) = (pair[0].1, pair[1].1);
            pieces.push(Piece {
                ends: [a.min(b), a.max(b)],
                curves: set,
                toggles,
            });
        }
    }
}

/// Sorts the segments into lines; nothing if it was stopped.
fn cluster(
    nodes: &[Node],
    segments: &[Segment],
    tolerance: f64,
    stop: Stop<'_>,
) -> Option<Vec<Line>> {
    let ends = |s: u32| {
        segments[s as usize]
            .ends
            .map(|n| nodes[n as usize].position)
    };
    let length_sq = |s: u32| ends(s)[0].distance_squared(ends(s)[1]);
    // A total order, whatever the order of the input: ends differ.
    let mut order: Vec<u32> = (0..segments.len() as u32).collect();
    order.sort_by(|&a, &b| {
        let (s, t) = (&segments[a as usize], &segments[b as usize]);
        (t.is_boundary.cmp(&s.is_boundary))
            .then_with(|| length_sq(b).total_cmp(&length_sq(a)))
            .then_with(|| s.ends.cmp(&t.ends))
    });

    let cells = LineCells::new(nodes, tolerance);
    let mut lines: Vec<Line> = Vec::new();
    let mut by_cell: HashMap<[i64; 2], SmallVec<[u32; 2]>> = HashMap::new();
    for s in order {
        if stop.is_wanted() {
            return None;
        }
        let [a, b] = ends(s);
        let (key, near) = cells.around(a, b);
        let found = near
            .iter()
            .filter_map(|cell| by_cell.get(cell))
            .flatten()
            .filter(|&&l| {
                [a, b]
                    .iter()
                    .all(|&p| lines[l as usize].distance(p) <= tolerance)
            })
            .min();
        let line = found.copied().unwrap_or_else(|| {
            lines.push(Line::through([a, b]));
            let id = lines.len() as u32 - 1;
            by_cell.entry(key).or_default().push(id);
            id
        });
        lines[line as usize].members.push(s);
    }
    Some(lines)
}

/// Lines by direction and distance from the centre, in cells.
///
/// A segment much shorter than the receiver may miss the cell of its line, as
/// its direction is uncertain; then it makes a line of its own, and is cut by the
/// same nodes all the same.
struct LineCells {
    centre: DVec2,
    n_angles: f64,
    spacing: f64,
}

impl LineCells {
    fn new(nodes: &[Node], tolerance: f64) -> Self {
        let [min, max] = bounding_box(nodes.iter().map(|n| n.position));
        // Over the radius, one cell of angle is one `width` of distance.
        let width = 4.0 * tolerance.max(0.25);
        let radius = ((max - min).length() / 2.0).max(1.0);
        let n_angles = (PI * radius / width).floor().max(1.0);
        Self {
            centre: (min + max) / 2.0,
            n_angles,
            spacing: 3.0 * width,
        }
    }

    /// The cell of a segment, and all cells where its line may be.
    fn around(&self, a: DVec2, b: DVec2) -> ([i64; 2], [[i64; 2]; 9]) {
        let d = (b - a).normalize_or_zero();
        let d = if d.y < 0.0 || (d.y == 0.0 && d.x < 0.0) {
            -d
        } else {
            d
        };
        // Measured where the line is nearest to the centre of the segment.
        let offset = dvec2(-d.y, d.x).dot((a + b) / 2.0 - self.centre);
        let angle = (d.y.atan2(d.x) / PI * self.n_angles).clamp(0.0, self.n_angles);
        let key = |turn: f64, step: i64| {
            let (mut row, mut offset) = (angle.floor() + turn, offset);
            // Half a turn is the same line from the other side.
            if row < 0.0 {
                (row, offset) = (row + self.n_angles, -offset);
            } else if row >= self.n_angles {
                (row, offset) = (row - self.n_angles, -offset);
            }
            [row as i64, (offset / self.spacing).floor() as i64 + step]
        };
        let mut near = [[0; 2]; 9];
        for (k, cell) in near.iter_mut().enumerate() {
            *cell = key((k / 3) as f64 - 1.0, (k % 3) as i64 - 1);
        }
        (key(0.0, 0), near)
    }
}
