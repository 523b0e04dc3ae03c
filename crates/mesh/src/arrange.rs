//! The arrangement of the curves on a receiver: edges that meet only in vertices.

use antumbra_geom::{Control, Stop};
use glam::{DVec2, dvec2};
use smallvec::SmallVec;

use crate::lines::{Piece, Segment, cut_lines, merge_pieces};
use crate::nodes::{Frame, InputPoint, Node, Nodes, weld_points};
use crate::sets::{CurveSets, SetId};
use crate::snap::{Chains, Fine, MAX_FINE_BITS, pixel_of, snap_round};

/// What a curve does to the irradiance of the receiver it lies on.
///
/// The strongest comes first: `min` of some orders is that of all curves together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Order {
    /// The border of the receiver.
    Boundary,
    /// The value jumps.
    D0,
    /// The slope jumps.
    D1,
    /// The curvature jumps.
    D2,
}

/// One curve on a receiver: a polyline in chart coordinates.
///
/// Its id is its index in the slice given to [`arrange`]. A closed curve repeats
/// its first point at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct TaggedCurve {
    /// The corners of the polyline.
    pub points: Vec<DVec2>,
    /// What the curve does to the irradiance.
    pub order: Order,
}

/// How fine an arrangement is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrangementOptions {
    /// How many times, as a power of two, a pixel fits into the receiver's longer side.
    pub bits: u32,
    /// How much finer, as a power of two, crossings are computed.
    ///
    /// Lines that go through one point in the input still do after their ends
    /// are rounded, except with a probability of about `2^-sub_bits`. At least 4;
    /// lowered where `bits + sub_bits` would exceed 44.
    pub sub_bits: u32,
    /// Segments that differ by less than about half of this are merged, in pixels.
    pub cluster: f64,
    /// Points nearer than this become one, in pixels. At least 2.
    pub weld: f64,
    /// Pixels are doubled until the arrangement has fewer edges than this, each
    /// counted for every curve segment in it.
    pub max_links: usize,
}

impl Default for ArrangementOptions {
    fn default() -> Self {
        Self {
            bits: 28,
            sub_bits: 16,
            cluster: 4.0,
            weld: 4.0,
            max_links: 50_000_000,
        }
    }
}

/// A straight part of one or several curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ArrangedEdge {
    /// Its vertices, ascending.
    pub ends: [u32; 2],
    /// The curves it is part of.
    pub curves: SetId,
    /// Is the receiver on one side only? True if borders pass here an odd number of times.
    pub separates: bool,
}

/// What happened on the way to an arrangement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ArrangementReport {
    /// Curves given.
    pub n_curves: usize,
    /// Curves left out: shorter than a few pixels, or not finite.
    pub n_skipped: usize,
    /// Different lines the curves' segments are on.
    pub n_lines: usize,
    /// Parts of these lines between two points of curves.
    pub n_pieces: usize,
    /// Vertices where pieces cross, and which are no point of a curve.
    pub n_crossings: usize,
    /// Vertices in all.
    pub n_vertices: usize,
    /// Edges in all.
    pub n_edges: usize,
    /// How many times the pixel was doubled to limit the number of edges.
    pub n_coarsened: u32,
}

/// The curves on a receiver as edges that meet only in vertices.
#[derive(Clone, Debug, Default)]
pub struct Arrangement {
    /// The vertices in chart coordinates: points of curves as they were given,
    /// elsewhere the centres of pixels.
    pub vertices: Vec<DVec2>,
    /// The vertices in pixels: exact, distinct, ascending.
    pub pixels: Vec<[i64; 2]>,
    /// The edges: ascending, no two with the same ends.
    pub edges: Vec<ArrangedEdge>,
    /// The sets of curves that edges are part of.
    pub sets: CurveSets,
    /// What happened on the way.
    pub report: ArrangementReport,
    /// Where the centre of pixel (0, 0) is in the chart.
    pub origin: DVec2,
    /// The side of a pixel.
    pub pixel: f64,
    /// No curve has moved by more than this many pixels.
    pub tolerance: f64,
}

/// Cuts the curves on a receiver into edges that meet only in vertices.
///
/// Curves that coincide up to a few pixels share edges; the border stays where it
/// is and others join it. Curves may end anywhere, also outside the border.
/// Curves without length or with coordinates that are not finite are left out.
/// The result does not depend on the order of the curves, except for their ids. Nothing
/// if it is stopped.
///
/// # Source
///
/// Hobby 1999 and Guibas & Marimont 1998 for the rounding; `docs/numerics.md`
/// for what comes before it.
#[must_use]
pub fn arrange(
    curves: &[TaggedCurve],
    options: &ArrangementOptions,
    control: &Control<'_>,
) -> Option<Arrangement> {
    let stop = control.stop;
    if stop.is_wanted() {
        return None;
    }
    let valid: Vec<(u32, &TaggedCurve)> = (0..)
        .zip(curves)
        .filter(|(_, c)| is_bounded(c))
        .filter(|(_, c)| c.points.iter().any(|&p| p != c.points[0]))
        .collect();
    let weld = options.weld.clamp(2.0, 1e3);
    let cluster = options.cluster.clamp(0.0, 1e3);
    let bits = options.bits.clamp(MIN_BITS, 36);

    let mut n_coarsened = 0;
    loop {
        let bits = bits - n_coarsened;
        let Some(frame) = choose_frame(&valid, bits) else {
            return Some(Arrangement {
                pixel: 1.0,
                tolerance: 1.0,
                report: ArrangementReport {
                    n_curves: curves.len(),
                    n_skipped: curves.len(),
                    ..Default::default()
                },
                ..Default::default()
            });
        };
        // At the coarsest there is no way out but through.
        let budget = if bits == MIN_BITS {
            usize::MAX
        } else {
            options.max_links
        };
        let arranger = Arranger {
            frame,
            sub_bits: options.sub_bits.clamp(4, MAX_FINE_BITS - bits),
            weld,
            cluster,
            budget,
            stop,
        };
        if let Some(mut arrangement) = arranger.arrange(&valid) {
            arrangement.report.n_curves = curves.len();
            arrangement.report.n_skipped += curves.len() - valid.len();
            arrangement.report.n_coarsened = n_coarsened;
            return Some(arrangement);
        }
        if stop.is_wanted() {
            return None;
        }
        n_coarsened += 1;
    }
}

/// Beyond this, squares overflow.
const MAX_COORDINATE: f64 = 1e100;

/// Are all coordinates finite, and their squares too?
fn is_bounded(curve: &TaggedCurve) -> bool {
    curve
        .points
        .iter()
        .all(|p| p.x.abs() < MAX_COORDINATE && p.y.abs() < MAX_COORDINATE)
}

/// Fewer pixels than this are no arrangement.
const MIN_BITS: u32 = 8;

/// Coordinates of the input are rounded to 53 bits; pixels have at most so many,
/// so that the rounding is small even for crossings at small angles.
const MAX_PIXEL_BITS: u32 = 40;

/// Curves may reach so many times as far as the border before pixels grow with them.
const OVERSHOOT: f64 = 1.125;

/// Smaller pixels lose digits to underflow.
const SMALLEST_PIXEL: f64 = 1e-270;

/// The pixels for these curves; nothing if they have no extent.
fn choose_frame(curves: &[(u32, &TaggedCurve)], bits: u32) -> Option<Frame> {
    let bounds = |only_boundary: bool| {
        curves
            .iter()
            .filter(|(_, c)| !only_boundary || c.order == Order::Boundary)
            .flat_map(|(_, c)| &c.points)
            .fold(None, |bounds: Option<(DVec2, DVec2)>, &p| {
                let (min, max) = bounds.unwrap_or((p, p));
                Some((min.min(p), max.max(p)))
            })
    };
    let (min, max) = bounds(false)?;
    let border = bounds(true).unwrap_or((min, max));
    let largest = min.abs().max(max.abs()).max_element();
    // Curves that overshoot the border by a little do not change its pixels.
    let [of_all, of_border] = [(min, max), border].map(|(min, max)| (max - min).max_element());
    let extent = if of_all <= OVERSHOOT * of_border {
        of_border
    } else {
        of_all
    };
    let pixel = (extent / (1_u64 << bits) as f64).max(largest / (1_u64 << MAX_PIXEL_BITS) as f64);
    if extent <= 0.0 || pixel < SMALLEST_PIXEL {
        return None;
    }
    let origin = (border.0 + border.1) / 2.0;
    Some(Frame { origin, pixel })
}

/// One attempt, with given pixels.
struct Arranger<'a> {
    frame: Frame,
    sub_bits: u32,
    weld: f64,
    cluster: f64,
    budget: usize,
    stop: Stop<'a>,
}

impl Arranger<'_> {
    /// Nothing if there would be too many edges, or if it was stopped.
    fn arrange(&self, curves: &[(u32, &TaggedCurve)]) -> Option<Arrangement> {
        let (nodes, segments) = self.segments(curves);
        let mut sets = CurveSets::default();
        let (pieces, n_lines) = cut_lines(
            &nodes.list,
            &segments,
            self.cluster / 4.0,
            &mut sets,
            self.stop,
        )?;

        let fine: Vec<[Fine; 2]> = pieces
            .iter()
            .map(|piece| piece.ends.map(|n| self.fine(&nodes.list[n as usize])))
            .collect();
        let chains = snap_round(&fine, self.sub_bits, self.budget, self.stop)?;
        let edges = chain_edges(&pieces, &chains, &mut sets);
        let (vertices, n_nodes) = self.vertices(&nodes, &pieces, &chains.pixels);

        let report = ArrangementReport {
            n_curves: curves.len(),
            n_skipped: curves.len() - n_kept(curves, &segments),
            n_lines,
            n_pieces: pieces.len(),
            n_crossings: vertices.len() - n_nodes,
            n_vertices: vertices.len(),
            n_edges: edges.len(),
            n_coarsened: 0,
        };
        Some(Arrangement {
            vertices,
            pixels: chains.pixels,
            edges,
            sets,
            report,
            origin: self.frame.origin,
            pixel: self.frame.pixel,
            // To the border and to a node; to a line; to the centre of a pixel.
            tolerance: self.cluster / 2.0 + self.weld + self.cluster / 2.0 + 1.0,
        })
    }

    /// The curves' nodes, and the segments between them: sorted, each once.
    fn segments(&self, curves: &[(u32, &TaggedCurve)]) -> (Nodes, Vec<Segment>) {
        let mut points = Vec::new();
        let mut spans: Vec<([u32; 2], u32, bool)> = Vec::new();
        for &(id, curve) in curves {
            let is_boundary = curve.order == Order::Boundary;
            for (k, &chart) in curve.points.iter().enumerate() {
                let i = points.len() as u32;
                if k > 0 {
                    spans.push(([i - 1, i], id, is_boundary));
                }
                points.push(InputPoint { chart, is_boundary });
            }
        }
        let outline: Vec<[u32; 2]> = spans.iter().filter(|s| s.2).map(|s| s.0).collect();
        let nodes = weld_points(&points, &outline, self.frame, self.weld, self.cluster / 2.0);

        for (ends, ..) in &mut spans {
            let [a, b] = ends.map(|p| nodes.of_point[p as usize]);
            *ends = [a.min(b), a.max(b)];
        }
        spans.retain(|([a, b], ..)| a != b);
        spans.sort_unstable();
        let segments = spans
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| {
                let mut curves: SmallVec<[u32; 2]> = same.iter().map(|s| s.1).collect();
                curves.dedup();
                let n_borders = same.iter().filter(|s| s.2).count();
                Segment {
                    ends: same[0].0,
                    curves,
                    is_boundary: n_borders > 0,
                    toggles: n_borders % 2 == 1,
                }
            })
            .collect();
        (nodes, segments)
    }

    fn fine(&self, node: &Node) -> Fine {
        let scale = (1_i64 << self.sub_bits) as f64;
        (node.position * scale).round().to_array().map(|x| x as i64)
    }

    /// The vertices in the chart, and how many of them are nodes.
    fn vertices(
        &self,
        nodes: &Nodes,
        pieces: &[Piece],
        pixels: &[[i64; 2]],
    ) -> (Vec<DVec2>, usize) {
        let centre = |p: &[i64; 2]| self.frame.to_chart(dvec2(p[0] as f64, p[1] as f64));
        let mut vertices: Vec<DVec2> = pixels.iter().map(centre).collect();
        let mut used: Vec<u32> = pieces.iter().flat_map(|p| p.ends).collect();
        used.sort_unstable();
        used.dedup();
        for &n in &used {
            // Nodes are more than a pixel apart: no two have the same.
            let node = &nodes.list[n as usize];
            let pixel = pixel_of(self.fine(node), self.sub_bits);
            if let Ok(v) = pixels.binary_search(&pixel) {
                vertices[v] = node.chart;
            }
        }
        (vertices, used.len())
    }
}

/// How many curves have a segment.
fn n_kept(curves: &[(u32, &TaggedCurve)], segments: &[Segment]) -> usize {
    let mut kept: Vec<u32> = segments
        .iter()
        .flat_map(|s| s.curves.iter().copied())
        .collect();
    kept.sort_unstable();
    kept.dedup();
    kept.len().min(curves.len())
}

/// The links of all chains as edges: sorted, each once.
fn chain_edges(pieces: &[Piece], chains: &Chains, sets: &mut CurveSets) -> Vec<ArrangedEdge> {
    let mut links: Vec<Piece> = Vec::with_capacity(chains.links.len());
    let mut start = 0;
    for (piece, &end) in pieces.iter().zip(&chains.ends) {
        for pair in chains.links[start..end].windows(2) {
            let (a, b) = (pair[0], pair[1]);
            links.push(Piece {
                ends: [a.min(b), a.max(b)],
                ..*piece
            });
        }
        start = end;
    }
    links.sort_unstable();
    merge_pieces(&mut links, sets);
    links
        .iter()
        .map(|l| ArrangedEdge {
            ends: l.ends,
            curves: l.curves,
            separates: l.toggles,
        })
        .collect()
}
