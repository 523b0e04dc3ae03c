//! Joint events: several occluders between receiver and emitter.
//!
//! Two edges are a pair if a line from receiver to emitter passes both. The lines
//! through a pair are a square (a place on either edge); a grid of 8 × 8 cells
//! tells conservatively which of them run from receiver to emitter along outlines.
//! Only such pairs make VE and EEE events, and three edges only if their three
//! pairs agree.

use crate::evaluator::hull::Hull;
use crate::events::shaft::{Shaft, turns};
use crate::events::swath::orientation;
use crate::events::trace::common_plane;
use crate::events::tracer::Tracer;
use crate::events::{Event, EventKind, EventKinds};
use antumbra_scene::{Aabb, EdgeId, VertexId};
use glam::DVec3;
use smallvec::SmallVec;

/// Cells along an edge.
const N: usize = 8;

/// The cells of a pair, bit `8·row + column`: rows along the lower edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cells(u64);

impl Cells {
    const ALL: Self = Self(u64::MAX);

    fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The rows with any cell.
    fn rows(self) -> u8 {
        (0..N).fold(0, |rows, i| {
            rows | (u8::from(self.0 >> (N * i) & 0xff != 0) << i)
        })
    }

    /// The columns with any cell.
    fn columns(self) -> u8 {
        (0..N).fold(0, |columns, i| columns | (self.0 >> (N * i)) as u8)
    }
}

/// The values of a function that is linear along either edge, at the corners of
/// the square: [lower end 0, lower end 1] × [upper end 0, upper end 1].
type Corners = [[f64; 2]; 2];

/// The cells in which such a function takes values that `keep` (least, largest)
/// accepts.
fn cells(corners: &Corners, within: Cells, keep: impl Fn(f64, f64) -> bool) -> Cells {
    let all = corners.as_flattened();
    let range = |v: &[f64]| {
        v.iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &x| {
                (lo.min(x), hi.max(x))
            })
    };
    let (lo, hi) = range(all);
    if !keep(lo, hi) {
        return Cells(0);
    }
    let mut values = [[0.0; N + 1]; N + 1];
    for (i, row) in values.iter_mut().enumerate() {
        let s = i as f64 / N as f64;
        let left = corners[0][0] + (corners[1][0] - corners[0][0]) * s;
        let right = corners[0][1] + (corners[1][1] - corners[0][1]) * s;
        for (j, value) in row.iter_mut().enumerate() {
            *value = left + (right - left) * (j as f64 / N as f64);
        }
    }
    let mut kept = 0;
    for i in 0..N {
        for j in 0..N {
            let bit = 1 << (N * i + j);
            if within.0 & bit == 0 {
                continue;
            }
            let (lo, hi) = range(&[
                values[i][j],
                values[i][j + 1],
                values[i + 1][j],
                values[i + 1][j + 1],
            ]);
            if keep(lo, hi) {
                kept |= bit;
            }
        }
    }
    Cells(kept)
}

/// An edge of the shaft with what its pairs ask for.
struct Feature {
    edge: EdgeId,
    ends: [DVec3; 2],
    turns: SmallVec<[DVec3; 2]>,
}

/// A pair of edges, by their positions among the shaft's edges.
#[derive(Clone, Copy)]
struct Pair {
    upper: u32,
    cells: Cells,
}

/// Lists of pieces shorter than this are looked through without the box tree.
const SHORT_LIST: usize = 24;

/// Edges nearer to coplanar than this, relative to their lengths and distance, make
/// no EEE event: the plane they nearly lie in is the better model, and the ends of
/// the arcs lose half of their digits (`docs/numerics.md`).
const COPLANAR: f64 = 1e-7;

impl Tracer<'_, '_> {
    /// VE events of two occluders, EEE events, and coplanar edges of two occluders.
    pub(crate) fn joint(&mut self, shaft: &Shaft<'_>, kinds: EventKinds) {
        let wanted = [EventKind::Ve, EventKind::Eee, EventKind::Ee];
        if !wanted.iter().any(|&kind| kinds.contains(kind)) || shaft.faces.len() < 2 {
            return;
        }
        let features: Vec<Feature> = shaft
            .edges
            .iter()
            .map(|&edge| Feature {
                edge,
                ends: self.ends(edge),
                turns: turns(self.scene, self.adjacency, edge),
            })
            .collect();
        let mut pairs: Vec<Vec<Pair>> = Vec::with_capacity(features.len());
        let mut coplanar: Vec<[EdgeId; 2]> = Vec::new();
        let mut wedges: Vec<(VertexId, EdgeId)> = Vec::new();
        for lower in 0..features.len() {
            if self.stop.is_wanted() {
                return;
            }
            let mut found = Vec::new();
            for upper in self.above(shaft, &features, lower) {
                if self.stop.is_wanted() {
                    return;
                }
                let (a, b) = (&features[lower], &features[upper as usize]);
                let cells = self.lines_through(shaft, a, b);
                if cells.is_empty() {
                    continue;
                }
                if self.do_meet(a.edge, b.edge) || is_coplanar(a, b) {
                    if common_plane(self.scene, a.edge, b.edge).is_some() {
                        coplanar.push([a.edge.min(b.edge), a.edge.max(b.edge)]);
                    }
                    continue;
                }
                self.wedges(a, b, cells, &mut wedges);
                found.push(Pair { upper, cells });
            }
            pairs.push(found);
        }
        if kinds.contains(EventKind::Ee) {
            coplanar.sort_unstable();
            coplanar.dedup();
            for edges in coplanar {
                self.coplanar_occluders(shaft, edges);
            }
        }
        if kinds.contains(EventKind::Ve) {
            wedges.sort_unstable();
            wedges.dedup();
            for (vertex, edge) in wedges {
                let event = Event::VertexEdge { vertex, edge };
                self.vertex_edge(shaft, event, (vertex, false), (edge, false));
            }
        }
        if kinds.contains(EventKind::Eee) {
            self.triples(shaft, &features, &pairs);
        }
    }

    fn do_meet(&self, e: EdgeId, f: EdgeId) -> bool {
        let [a, b] = [e, f].map(|e| self.scene.edges[e.index()].ends);
        a.iter().any(|v| b.contains(v))
    }

    /// Edges that lines from an edge to the emitter may pass, as positions among
    /// the features, ascending.
    fn above(&self, shaft: &Shaft<'_>, features: &[Feature], lower: usize) -> Vec<u32> {
        let ends = features[lower].ends;
        let hull = Hull::of_edge_and_outline(ends, &shaft.lamp_hull, self.tolerance);
        let mut pieces: Vec<u32> = Vec::new();
        let mut add = |id: u32| {
            let piece = &self.scene.pieces[id as usize];
            let corners = piece.vertices.iter().map(|&v| self.scene.position(v));
            if hull.meets(corners) {
                pieces.push(id);
            }
        };
        if shaft.pieces.len() <= SHORT_LIST {
            shaft.pieces.iter().for_each(|&p| add(p));
        } else {
            self.scene.tree.visit(
                |b: &Aabb| hull.meets_box(b),
                |piece| {
                    if shaft.pieces.binary_search(&piece).is_ok() {
                        add(piece);
                    }
                },
            );
        }
        let may_meet = |b: &Aabb| hull.meets_box(b);
        self.adjacency
            .edges_near(self.scene, pieces, may_meet)
            .into_iter()
            .filter_map(|e| features.binary_search_by(|f| f.edge.cmp(&e)).ok())
            .filter(|&k| k != lower)
            .filter(|&k| hull.meets(features[k].ends.into_iter()))
            .map(|k| k as u32)
            .collect()
    }

    /// The cells of a pair whose lines may run from receiver to emitter, first past
    /// the lower edge and then past the upper one, both as outlines.
    fn lines_through(&self, shaft: &Shaft<'_>, lower: &Feature, upper: &Feature) -> Cells {
        let (p, q) = (lower.ends, upper.ends);
        let at = |f: &dyn Fn(DVec3, DVec3) -> f64| -> Corners {
            [
                [f(p[0], q[0]), f(p[0], q[1])],
                [f(p[1], q[0]), f(p[1], q[1])],
            ]
        };
        let positive = |_: f64, hi: f64| hi > 0.0;
        let mut kept = Cells::ALL;
        let mut clip = |corners: Corners| {
            kept = cells(&corners, kept, positive);
            kept.is_empty()
        };
        let (up, front) = (self.face.normal, shaft.lamp.normal);
        if clip(at(&|p, q| up.dot(q - p))) || clip(at(&|p, q| -front.dot(q - p))) {
            return Cells(0);
        }
        // Seen from below, the emitter's outline runs counter-clockwise, and so
        // does the receiver's seen from above.
        for (outline, sign) in [(&shaft.lamp_hull, -1.0), (&shaft.receiver_hull, 1.0)] {
            for i in 0..outline.len() {
                let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
                if clip(at(&|p, q| sign * (a - p).cross(b - p).dot(q - p))) {
                    return Cells(0);
                }
            }
        }
        for (feature, is_lower) in [(lower, true), (upper, false)] {
            if feature.turns.len() < 2 {
                continue;
            }
            // Reject where one face is surely on one side and another on the other.
            let sides: SmallVec<[Corners; 2]> = feature
                .turns
                .iter()
                .map(|&c| {
                    // The edge's own point does not matter: c is perpendicular to it.
                    at(&|p, q| {
                        if is_lower {
                            c.dot(q - feature.ends[0])
                        } else {
                            c.dot(feature.ends[0] - p)
                        }
                    })
                })
                .collect();
            let above = sides
                .iter()
                .fold(0, |m, s| m | cells(s, Cells::ALL, |lo, _| lo > 0.0).0);
            let below = sides
                .iter()
                .fold(0, |m, s| m | cells(s, Cells::ALL, |_, hi| hi < 0.0).0);
            kept = Cells(kept.0 & !(above & below));
            if kept.is_empty() {
                return kept;
            }
        }
        kept
    }

    /// The vertices of each edge that are paired with the other edge.
    fn wedges(
        &self,
        lower: &Feature,
        upper: &Feature,
        cells: Cells,
        out: &mut Vec<(VertexId, EdgeId)>,
    ) {
        let ends = |f: &Feature| self.scene.edges[f.edge.index()].ends;
        let (rows, columns) = (cells.rows(), cells.columns());
        for (k, bit) in [(0, 1), (1, 1 << (N - 1))] {
            if rows & bit != 0 {
                out.push((ends(lower)[k], upper.edge));
            }
            if columns & bit != 0 {
                out.push((ends(upper)[k], lower.edge));
            }
        }
    }

    /// EEE events: an emitter's edge and a pair, or three pairs that agree.
    fn triples(&mut self, shaft: &Shaft<'_>, features: &[Feature], pairs: &[Vec<Pair>]) {
        for (first, above) in pairs.iter().enumerate() {
            let lower = &features[first];
            for pair in above {
                if self.stop.is_wanted() {
                    return;
                }
                let upper = &features[pair.upper as usize];
                for &lamp_edge in &shaft.lamp_edges {
                    if self.do_meet(lamp_edge, lower.edge) || self.do_meet(lamp_edge, upper.edge) {
                        continue;
                    }
                    let ends = self.ends(lamp_edge);
                    if self
                        .is_passed((lower, upper), pair.cells, ends, true)
                        .is_empty()
                    {
                        continue;
                    }
                    let occluders = [lower.edge.min(upper.edge), lower.edge.max(upper.edge)];
                    let event = Event::EmitterTriple {
                        emitter: lamp_edge,
                        occluders,
                    };
                    self.triple(shaft, event, (lamp_edge, true), occluders);
                }
                for second in &pairs[pair.upper as usize] {
                    // Lower, middle and upper edge: the pair of the outer two as well.
                    let Ok(outer) = above.binary_search_by(|p| p.upper.cmp(&second.upper)) else {
                        continue;
                    };
                    let outer = above[outer];
                    let top = &features[second.upper as usize];
                    let agree = pair.cells.rows() & outer.cells.rows() != 0
                        && pair.cells.columns() & second.cells.rows() != 0
                        && outer.cells.columns() & second.cells.columns() != 0;
                    if !agree {
                        continue;
                    }
                    let passed = self.is_passed((lower, top), outer.cells, upper.ends, false);
                    if passed.rows() & pair.cells.rows() == 0
                        || passed.columns() & second.cells.columns() == 0
                    {
                        continue;
                    }
                    let mut edges = [lower.edge, upper.edge, top.edge];
                    edges.sort_unstable();
                    let event = Event::Triple(edges);
                    self.triple(shaft, event, (edges[0], false), [edges[1], edges[2]]);
                }
            }
        }
    }

    /// The cells of a pair whose lines may meet an edge: the middle one, or one of
    /// the emitter, beyond both.
    fn is_passed(
        &self,
        (lower, upper): (&Feature, &Feature),
        within: Cells,
        [a, b]: [DVec3; 2],
        is_beyond: bool,
    ) -> Cells {
        let (p, q) = (lower.ends, upper.ends);
        let side = |p: DVec3, q: DVec3| orientation(p, q, a, b);
        let corners = [
            [side(p[0], q[0]), side(p[0], q[1])],
            [side(p[1], q[0]), side(p[1], q[1])],
        ];
        let mut kept = cells(&corners, within, |lo, hi| lo <= 0.0 && hi >= 0.0);
        // The plane of an end v and one edge of the pair: the line leaves that plane
        // on the side of the other edge, and must meet the third on the inner side
        // of v.
        for (v, w) in [(a, b), (b, a)] {
            for (fixed, moving, is_lower) in [(p, q, true), (q, p, false)] {
                if kept.is_empty() {
                    return kept;
                }
                let side = |x: DVec3| orientation(v, fixed[0], fixed[1], x);
                let inner = side(w).signum() * if !is_lower && is_beyond { -1.0 } else { 1.0 };
                let along = moving.map(|x| inner * side(x));
                let corners: Corners = if is_lower {
                    [along, along]
                } else {
                    [[along[0]; 2], [along[1]; 2]]
                };
                kept = cells(&corners, kept, |_, hi| hi >= 0.0);
            }
        }
        kept
    }
}

/// Are two edges coplanar, or so nearly that their plane is the better model?
fn is_coplanar(a: &Feature, b: &Feature) -> bool {
    let ([p, q], [r, s]) = (a.ends, b.ends);
    let volume = orientation(p, q, r, s).abs();
    let scale = (q - p).length() * (s - r).length() * (r - p).length().max((s - q).length());
    volume <= COPLANAR * scale
}
