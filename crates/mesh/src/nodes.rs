//! The end points of curves, welded: points a few pixels apart are one node.

use std::cmp::Ordering;
use std::collections::HashMap;

use glam::DVec2;
use smallvec::SmallVec;

use crate::grid::Grid;

/// Where the pixels of a receiver lie in its chart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// The centre of pixel (0, 0).
    pub(crate) origin: DVec2,
    /// The side of a pixel.
    pub(crate) pixel: f64,
}

impl Frame {
    /// Chart coordinates to pixels, not rounded.
    pub(crate) fn to_pixels(self, p: DVec2) -> DVec2 {
        (p - self.origin) / self.pixel
    }

    /// Pixels to chart coordinates.
    pub(crate) fn to_chart(self, p: DVec2) -> DVec2 {
        self.origin + p * self.pixel
    }
}

/// A point of a curve, as given.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InputPoint {
    pub(crate) chart: DVec2,
    pub(crate) is_boundary: bool,
}

/// Where one or several points of curves are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// In pixels, not rounded.
    pub(crate) position: DVec2,
    /// In the chart: the coordinates of the first of its points.
    pub(crate) chart: DVec2,
}

/// The nodes, and which of them each input point belongs to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nodes {
    pub(crate) list: Vec<Node>,
    pub(crate) of_point: Vec<u32>,
}

/// Welds points that are within `weld` pixels of a node.
///
/// Points of the border come first, so that they stay where they are. Then come
/// other points within `snap` pixels of a segment of the border, which are moved
/// onto it: the border does not bend. `outline` are the border's segments, as
/// pairs of point indices. Nodes are numbered by coordinates within their kind,
/// whatever the order of the points. Points with the same coordinates are one.
pub(crate) fn weld_points(
    points: &[InputPoint],
    outline: &[[u32; 2]],
    frame: Frame,
    weld: f64,
    snap: f64,
) -> Nodes {
    let mut welder = Welder::new(points.len(), weld);
    let boundary: Vec<Candidate> = (0..points.len())
        .filter(|&i| points[i].is_boundary)
        .map(|i| Candidate::at(i, points[i].chart, frame.to_pixels(points[i].chart), 0))
        .collect();
    // A point that is one of the border's is where that went, though nodes that came
    // after it may be nearer.
    let position_bits = |p: DVec2| (p + DVec2::ZERO).to_array().map(f64::to_bits);
    let border_positions: Vec<(usize, [u64; 2])> = boundary
        .iter()
        .map(|c| (c.point, position_bits(c.position)))
        .collect();
    welder.add_all(boundary);
    let of_border: HashMap<[u64; 2], u32> = border_positions
        .into_iter()
        .map(|(point, bits)| (bits, welder.nodes.of_point[point]))
        .collect();

    let of_point = &welder.nodes.of_point;
    let mut segments: Vec<[u32; 2]> = outline
        .iter()
        .map(|ends| ends.map(|p| of_point[p as usize]))
        .map(|[a, b]| [a.min(b), a.max(b)])
        .filter(|[a, b]| a != b)
        .collect();
    segments.sort_unstable();
    segments.dedup();
    let segments: Vec<[DVec2; 2]> = segments
        .iter()
        .map(|ends| ends.map(|n| welder.nodes.list[n as usize].position))
        .collect();
    let grid = Grid::of_segments(&segments, snap);

    let mut on_border: Vec<(usize, u32)> = Vec::new();
    let inner: Vec<Candidate> = (0..points.len())
        .filter(|&i| !points[i].is_boundary)
        .filter_map(|i| {
            let chart = points[i].chart;
            let position = frame.to_pixels(chart);
            if let Some(&node) = of_border.get(&position_bits(position)) {
                on_border.push((i, node));
                return None;
            }
            if welder.find(position).is_none()
                && let Some(foot) = foot_on_outline(&segments, &grid, position, snap)
            {
                // What is on the border up to rounding keeps its coordinates.
                let is_rounding = foot.distance(position) < 1.0 / 64.0;
                let chart = if is_rounding {
                    chart
                } else {
                    frame.to_chart(foot)
                };
                return Some(Candidate::at(i, chart, foot, 0));
            }
            Some(Candidate::at(i, chart, position, 1))
        })
        .collect();
    welder.add_all(inner);
    for (point, node) in on_border {
        welder.nodes.of_point[point] = node;
    }
    welder.nodes
}

/// The nearest point within `snap` of `p` that is inside a segment.
fn foot_on_outline(segments: &[[DVec2; 2]], grid: &Grid, p: DVec2, snap: f64) -> Option<DVec2> {
    if segments.is_empty() {
        return None;
    }
    let mut nearest = (snap * snap, None);
    for &i in grid.items(grid.cell_of(p)) {
        let [a, b] = segments[i as usize];
        let d = b - a;
        let t = d.dot(p - a) / d.length_squared();
        if t > 0.0 && t < 1.0 {
            let foot = a + t * d;
            let distance_sq = foot.distance_squared(p);
            if distance_sq < nearest.0 || (distance_sq <= nearest.0 && nearest.1.is_none()) {
                nearest = (distance_sq, Some(foot));
            }
        }
    }
    nearest.1
}

/// A point on its way to become a node, or part of one.
struct Candidate {
    point: usize,
    chart: DVec2,
    position: DVec2,
    rank: u8,
}

impl Candidate {
    fn at(point: usize, chart: DVec2, position: DVec2, rank: u8) -> Self {
        Self {
            point,
            chart,
            position,
            rank,
        }
    }

    fn cmp(&self, other: &Self) -> Ordering {
        let key = |c: &Self| [c.position.x, c.position.y, c.chart.x, c.chart.y];
        self.rank.cmp(&other.rank).then_with(|| {
            let pairs = key(self).into_iter().zip(key(other));
            pairs.fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(&b)))
        })
    }
}

/// Makes nodes which are more than `weld` apart.
struct Welder {
    nodes: Nodes,
    weld: f64,
    cell: f64,
    /// Nodes by cell. For lookup only.
    by_cell: HashMap<[i64; 2], SmallVec<[u32; 2]>>,
}

impl Welder {
    fn new(n_points: usize, weld: f64) -> Self {
        let nodes = Nodes {
            list: Vec::new(),
            of_point: vec![0; n_points],
        };
        Self {
            nodes,
            weld,
            cell: weld.max(1e-3),
            by_cell: HashMap::new(),
        }
    }

    /// Never chained: a point joins the place of a node, not of its last point.
    fn add_all(&mut self, mut candidates: Vec<Candidate>) {
        candidates.sort_by(Candidate::cmp);
        for c in candidates {
            let node = self.find(c.position).unwrap_or_else(|| self.insert(&c));
            self.nodes.of_point[c.point] = node;
        }
    }

    /// The nearest node within reach; of equally near ones the first.
    fn find(&self, p: DVec2) -> Option<u32> {
        let [x, y] = self.cell_of(p);
        let mut nearest: Option<(f64, u32)> = None;
        for cell in (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| [x, y])) {
            for &n in self.by_cell.get(&cell).into_iter().flatten() {
                let distance = self.nodes.list[n as usize].position.distance(p);
                if distance <= self.weld && nearest.is_none_or(|best| (distance, n) < best) {
                    nearest = Some((distance, n));
                }
            }
        }
        nearest.map(|(_, n)| n)
    }

    fn insert(&mut self, c: &Candidate) -> u32 {
        let id = self.nodes.list.len() as u32;
        self.nodes.list.push(Node {
            position: c.position,
            chart: c.chart,
        });
        self.by_cell
            .entry(self.cell_of(c.position))
            .or_default()
            .push(id);
        id
    }

    fn cell_of(&self, p: DVec2) -> [i64; 2] {
        (p / self.cell).floor().to_array().map(|x| x as i64)
    }
}
