//! The plane of a D1 event.
//!
//! A whole strip of the emitter appears at once when two features lie in one
//! plane with the point: coplanar edges, facets, the emitter's own plane.

use crate::evaluator::Evaluator;
use crate::events::Event;
use crate::events::shaft::form;
use crate::events::trace::{Trace, chord, chords, common_plane};
use crate::intervals::Intervals;
use antumbra_geom::{Stop, distance_to_segment_in_space};
use antumbra_scene::{Aabb, EdgeId, FaceId};
use glam::{DVec2, DVec3, DVec4, dvec2};
use smallvec::SmallVec;
use std::f64::consts::PI;

/// A plane in which an event happens, with its own coordinates: s along its trace
/// on the receiver, h in the plane, perpendicular to the trace and upwards.
pub(crate) struct Sheet<'e, 's> {
    evaluator: &'e Evaluator<'s>,
    receiver: FaceId,
    emitter: FaceId,
    pub(super) trace: Trace,
    up: DVec3,
    /// What the emitter has in the plane: an edge, or chords.
    lamp: Vec<[DVec2; 2]>,
    /// What the lines must pass: edges, or the outline of a facet.
    layers: SmallVec<[Vec<DVec2>; 2]>,
    /// Of a facet: on which sides of the plane other faces meet each edge of its layer;
    /// nothing for edges along which it is cut off.
    beside: Vec<Option<Beside>>,
    /// The chords in which other surfaces cross the plane where lines from some stretch of
    /// the trace pass: see [`Self::find_blockers`].
    blockers: Vec<[DVec2; 2]>,
    lamp_form: DVec4,
    tolerance: f64,
}

/// On which sides of a plane faces meet an edge in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Beside {
    above: bool,
    below: bool,
}

impl Beside {
    const NOTHING: Self = Self {
        above: false,
        below: false,
    };
    const BOTH: Self = Self {
        above: true,
        below: true,
    };

    fn and(self, other: Self) -> Self {
        Self {
            above: self.above || other.above,
            below: self.below || other.below,
        }
    }
}

/// The sides of the other faces at every edge of a face, of which a part is left.
///
/// * `part` — what the planes of receiver and emitter leave of its outline.
fn beside(
    evaluator: &Evaluator<'_>,
    id: FaceId,
    normal: DVec3,
    part: &[DVec3],
) -> Vec<Option<Beside>> {
    let scene = evaluator.scene();
    let outline = &scene.face(id).outline;
    let near = 4.0 * scene.plane_tolerance();
    (0..part.len())
        .map(|k| {
            // Corners in the plane of the receiver are cut off by the tolerance: what is
            // left begins elsewhere in the outline.
            let middle = (part[k] + part[(k + 1) % part.len()]) / 2.0;
            let i = (0..outline.len()).find(|&i| {
                let ends = [outline[i], outline[(i + 1) % outline.len()]];
                let ends = ends.map(|v| scene.position(v));
                distance_to_segment_in_space(ends, middle) <= near
            })?;
            let edge = scene.edge_between(outline[i], outline[(i + 1) % outline.len()]);
            let faces = edge.map_or(&[][..], |e| evaluator.adjacency().faces_at(e));
            let heights = faces.iter().map(|at| normal.dot(at.inward));
            Some(Beside {
                above: heights.clone().any(|h| h > 1e-9),
                below: heights.clone().any(|h| h < -1e-9),
            })
        })
        .collect()
}

/// Abscissae (0 to 1) and weights of Gauss quadrature with 5 points.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_095),
    (0.230_765_344_947_158, 0.239_314_335_249_683),
    (0.5, 0.284_444_444_444_444),
    (0.769_234_655_052_842, 0.239_314_335_249_683),
    (0.953_089_922_969_332, 0.118_463_442_528_095),
];

impl<'e, 's> Sheet<'e, 's> {
    /// The sheet of an event; `None` if it has no D1 event after all.
    pub(crate) fn of(
        evaluator: &'e Evaluator<'s>,
        receiver: FaceId,
        event: Event,
        emitter: FaceId,
    ) -> Option<Self> {
        let scene = evaluator.scene();
        let face = scene.face(receiver);
        let lamp = scene.face(emitter);
        let tolerance = scene.plane_tolerance();
        let ends = |e: EdgeId| scene.edges[e.index()].ends.map(|v| scene.position(v));
        let (point, normal) = match event {
            Event::CoplanarEdges { emitter, occluder } => {
                (ends(emitter)[0], common_plane(scene, emitter, occluder)?)
            }
            Event::OccluderEdges([e, f]) => (ends(e)[0], common_plane(scene, e, f)?),
            Event::FacetPlane(id) => {
                let plane = scene.planes[scene.face(id).plane.index()];
                (plane.point, plane.normal)
            }
            _ => return None,
        };
        let origin = scene.position(face.outline[0]);
        let trace = Trace::new(origin, face.normal, point, normal)?;
        let up = normal.cross(trace.direction);
        let up = if up.dot(face.normal) < 0.0 { -up } else { up };
        let lamp_form = form(lamp.normal, scene.position(lamp.outline[0]));
        let mut sheet = Self {
            evaluator,
            receiver,
            emitter,
            trace,
            up,
            lamp: Vec::new(),
            layers: SmallVec::new(),
            beside: Vec::new(),
            blockers: Vec::new(),
            lamp_form,
            tolerance,
        };
        let height = |x: DVec3| face.normal.dot(x - origin);
        let above = |points: &[DVec3]| clip(points, |x| height(x) - tolerance);
        let lamp_parts: Vec<[DVec3; 2]> = match event {
            Event::CoplanarEdges { emitter, .. } => vec![ends(emitter)],
            _ => chords(scene, emitter, normal, point),
        };
        for part in lamp_parts {
            if let [a, b] = above(&part)[..] {
                sheet.lamp.push([sheet.flat(a), sheet.flat(b)]);
            }
        }
        let layers: SmallVec<[Vec<DVec3>; 2]> = match event {
            Event::CoplanarEdges { occluder, .. } => {
                [ends(occluder).to_vec()].into_iter().collect()
            }
            Event::OccluderEdges(edges) => edges.iter().map(|&e| ends(e).to_vec()).collect(),
            Event::FacetPlane(id) => [scene.positions(&scene.face(id).outline)]
                .into_iter()
                .collect(),
            _ => SmallVec::new(),
        };
        for layer in layers {
            let between = clip(&above(&layer), |x| lamp_form.dot(x.extend(1.0)) - tolerance);
            if between.len() < 2 {
                return None;
            }
            if let Event::FacetPlane(id) = event {
                sheet.beside = beside(evaluator, id, normal, &between);
            }
            sheet
                .layers
                .push(between.into_iter().map(|p| sheet.flat(p)).collect());
        }
        if sheet.lamp.is_empty() {
            return None;
        }
        Some(sheet)
    }

    fn flat(&self, x: DVec3) -> DVec2 {
        let off = x - self.trace.origin;
        dvec2(off.dot(self.trace.direction), off.dot(self.up))
    }

    fn space(&self, p: DVec2) -> DVec3 {
        self.trace.origin + self.trace.direction * p.x + self.up * p.y
    }

    /// Where, along the trace, the directions to the ends of emitter and layers
    /// change their order: between two of them the kink is smooth.
    pub(super) fn marks(&self) -> Vec<f64> {
        let mut groups: Vec<&[DVec2]> = self.lamp.iter().map(<[DVec2; 2]>::as_slice).collect();
        groups.extend(self.layers.iter().map(Vec::as_slice));
        let mut marks = Vec::new();
        for (i, a) in groups.iter().enumerate() {
            for b in &groups[i + 1..] {
                for p in *a {
                    for q in *b {
                        let s = (p.x * q.y - q.x * p.y) / (q.y - p.y);
                        // Where an occluder touches the emitter, both are seen in one
                        // direction from everywhere.
                        let is_apart = p.distance(*q) > 16.0 * self.tolerance;
                        if s.is_finite() && is_apart {
                            marks.push(s);
                        }
                    }
                }
            }
        }
        marks.sort_by(f64::total_cmp);
        marks.dedup_by(|a, b| *a - *b <= 16.0 * self.tolerance);
        marks
    }

    /// The directions (slopes ds/dh) in which the points of a set are seen from s.
    fn slopes(s: f64, points: &[DVec2]) -> (f64, f64) {
        points
            .iter()
            .map(|p| (p.x - s) / p.y)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), m| {
                (lo.min(m), hi.max(m))
            })
    }

    /// The directions in which a part of the emitter is seen through all layers.
    fn overlap(&self, s: f64, lamp: &[DVec2]) -> (f64, f64) {
        let (mut lo, mut hi) = Self::slopes(s, lamp);
        for layer in &self.layers {
            let (l, h) = Self::slopes(s, layer);
            (lo, hi) = (lo.max(l), hi.min(h));
        }
        (lo, hi)
    }

    pub(super) fn is_active(&self, s: f64) -> bool {
        self.lamp.iter().any(|lamp| {
            let (lo, hi) = self.overlap(s, lamp);
            hi - lo > 1e-12
        })
    }

    /// The jump across the trace at a point of it, of a sheet that was not traced.
    pub(crate) fn jump_alone(mut self, x: DVec3) -> f64 {
        let s = self.trace.parameter(x);
        self.find_blockers(s, s);
        self.jump(x)
    }

    /// The jump of the slope of irradiance across the trace at a point of it, per
    /// unit of exitance: (J1) of `docs/design.md`. The blockers there must have been found.
    ///
    /// # Source
    ///
    /// A point of an edge at the distance ratio λ = |y−x|/|q−x| is projected to a
    /// point of the emitter that moves (1−λ) times as fast as x.
    pub(super) fn jump(&self, x: DVec3) -> f64 {
        let scene = self.evaluator.scene();
        let (receiver, lamp_face) = (scene.face(self.receiver), scene.face(self.emitter));
        let s = self.trace.parameter(x);
        let x = self.trace.at(s);
        let normal = self.trace.normal;
        let across = receiver.normal.cross(self.trace.direction);
        let lamp_normal = lamp_face.normal;
        let slant = (normal - lamp_normal * lamp_normal.dot(normal)).length();
        let speed = (across.dot(normal) / slant).abs();
        let mut sum = 0.0;
        for lamp in &self.lamp {
            let (lo, hi) = self.overlap(s, lamp);
            let mut seen = Intervals::one(lo, hi);
            for (from, to) in self.hidden(s) {
                seen.subtract(from, to);
            }
            for (from, to) in seen.iter() {
                // Piecewise smooth: corners of the layers divide it.
                let mut ends: SmallVec<[f64; 16]> = self
                    .layers
                    .iter()
                    .flatten()
                    .map(|p| (p.x - s) / p.y)
                    .filter(|&m| m > from && m < to)
                    .chain([from, to])
                    .collect();
                ends.sort_by(f64::total_cmp);
                for pair in ends.windows(2) {
                    let at = |m: f64| on_line(s, m, lamp[0], lamp[1]);
                    let (Some(p), Some(q)) = (at(pair[0]), at(pair[1])) else {
                        continue;
                    };
                    let length = p.distance(q);
                    for (t, weight) in GAUSS {
                        let y = p + (q - p) * t;
                        let line = self.space(y) - x;
                        let r_sq = line.length_squared();
                        let cosines = receiver.normal.dot(line) * -lamp_normal.dot(line) / r_sq;
                        let kernel = (cosines / (PI * r_sq)).max(0.0);
                        sum += weight * length * kernel * self.opening(s, (y.x - s) / y.y, y.y);
                    }
                }
            }
        }
        sum * speed
    }

    /// How fast the strip of the emitter between what competes along a line opens: the
    /// difference of distance ratios.
    fn opening(&self, s: f64, m: f64, top: f64) -> f64 {
        // Least and largest ratio, with the edge of the facet.
        let mut range: Option<[(f64, usize); 2]> = None;
        for layer in &self.layers {
            let n = layer.len();
            for i in 0..if n == 2 { 1 } else { n } {
                let (a, b) = (layer[i], layer[(i + 1) % n]);
                let (ma, mb) = ((a.x - s) / a.y, (b.x - s) / b.y);
                if (ma.min(mb)..=ma.max(mb)).contains(&m)
                    && let Some(p) = on_line(s, m, a, b)
                {
                    let here = (top / p.y, i);
                    let [lo, hi] = range.get_or_insert([here; 2]);
                    if here.0 < lo.0 {
                        *lo = here;
                    }
                    if here.0 > hi.0 {
                        *hi = here;
                    }
                }
            }
        }
        let Some([lo, hi]) = range else {
            return 0.0;
        };
        let is_emitters_edge = self.layers.len() == 1 && self.layers[0].len() == 2;
        if is_emitters_edge {
            return hi.0 - 1.0;
        }
        let side = |edge: usize| self.beside.get(edge).copied().flatten();
        let times = match (side(lo.1), side(hi.1)) {
            // A free plate hides the strip from both sides.
            (Some(Beside::NOTHING), Some(Beside::NOTHING)) if self.is_whole_facet() => 2.0,
            // With faces on both sides, at one edge or together, nothing is seen.
            (Some(a), Some(b)) if self.is_whole_facet() && a.and(b) == Beside::BOTH => 0.0,
            _ => 1.0,
        };
        times * (hi.0 - lo.0)
    }

    /// Is it a facet none of which is cut off by the planes of receiver and emitter?
    fn is_whole_facet(&self) -> bool {
        !self.beside.is_empty() && self.beside.iter().all(Option::is_some)
    }

    /// The directions in the sheet that other surfaces block.
    fn hidden(&self, s: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.blockers
            .iter()
            .map(move |chord| Self::slopes(s, chord))
    }

    /// Finds the blockers of lines from a stretch of the trace to the emitter.
    pub(super) fn find_blockers(&mut self, from: f64, to: f64) {
        let scene = self.evaluator.scene();
        let (receiver, lamp) = (scene.face(self.receiver), scene.face(self.emitter));
        let strip = |points: &[DVec2]| Strip {
            ends: [from, to].map(|s| (s, Self::slopes(s, points))),
            slack: 16.0 * self.tolerance,
        };
        let lamps: SmallVec<[Strip; 2]> = self.lamp.iter().map(|l| strip(l)).collect();
        let layers: SmallVec<[Strip; 2]> = self.layers.iter().map(|l| strip(l)).collect();
        let is_in_way = |chord: [DVec2; 2]| {
            layers.iter().all(|s| s.may_meet(chord)) && lamps.iter().any(|s| s.may_meet(chord))
        };
        self.blockers.clear();
        let stretch = [from, to].into_iter().map(|s| self.trace.at(s));
        let bounds = Aabb::of(stretch.chain(self.lamp.iter().flatten().map(|&p| self.space(p))));
        let bounds = Aabb {
            min: bounds.min - 4.0 * self.tolerance,
            max: bounds.max + 4.0 * self.tolerance,
        };
        let normal = self.trace.normal;
        let offset = normal.dot(self.trace.origin);
        let slack = 4.0 * self.tolerance;
        let mut found: SmallVec<[u32; 32]> = SmallVec::new();
        scene.tree.visit(
            |b| {
                b.meets(&bounds)
                    && b.max_along(normal) >= offset + slack
                    && -b.max_along(-normal) <= offset - slack
            },
            |piece| found.push(piece),
        );
        found.sort_unstable();
        for id in found {
            let piece = &scene.pieces[id as usize];
            let plane = scene.face(piece.face).plane;
            if plane == lamp.plane || plane == receiver.plane {
                continue;
            }
            let corners = scene.positions(&piece.vertices);
            let sides: SmallVec<[f64; 8]> = corners
                .iter()
                .map(|&c| {
                    let d = normal.dot(c) - offset;
                    if d.abs() <= slack { 0.0 } else { d }
                })
                .collect();
            if !(sides.iter().any(|&d| d > 0.0) && sides.iter().any(|&d| d < 0.0)) {
                continue;
            }
            let Some((p, q)) = chord(&corners, &sides) else {
                continue;
            };
            let part = clip(&[p, q], |x| {
                self.lamp_form.dot(x.extend(1.0)) - self.tolerance
            });
            let part = clip(&part, |x| self.flat(x).y - self.tolerance);
            if let [p, q] = part[..] {
                let chord = [self.flat(p), self.flat(q)];
                if is_in_way(chord) {
                    self.blockers.push(chord);
                }
            }
        }
    }

    /// The parts of an interval between two marks from which some of the emitter is
    /// seen past all other surfaces.
    ///
    /// What hides it changes where the direction to an end of a blocker is that to an
    /// end of emitter, layer or another blocker. Not all of them if it was stopped.
    pub(super) fn seen(&self, from: f64, to: f64, stop: Stop<'_>) -> Intervals {
        let fixed = self
            .lamp
            .iter()
            .flatten()
            .chain(self.layers.iter().flatten())
            .chain(self.blockers.iter().flatten());
        let mut marks = vec![from, to];
        for p in self.blockers.iter().flatten() {
            marks.extend(
                fixed
                    .clone()
                    .map(|q| (p.x * q.y - q.x * p.y) / (q.y - p.y))
                    .filter(|&s| s > from && s < to),
            );
        }
        marks.sort_by(f64::total_cmp);
        let mut parts: Vec<(f64, f64)> = Vec::new();
        for pair in marks.windows(2) {
            if stop.is_wanted() {
                break;
            }
            if pair[1] <= pair[0] || !self.is_seen(0.5 * (pair[0] + pair[1])) {
                continue;
            }
            match parts.last_mut() {
                Some(last) if last.1 >= pair[0] => last.1 = pair[1],
                _ => parts.push((pair[0], pair[1])),
            }
        }
        Intervals::from_sorted(parts)
    }

    fn is_seen(&self, s: f64) -> bool {
        self.lamp.iter().any(|lamp| {
            let (lo, hi) = self.overlap(s, lamp);
            let mut seen = Intervals::one(lo, hi);
            for (from, to) in self.hidden(s) {
                seen.subtract(from, to);
            }
            seen.iter().any(|(from, to)| to - from > 1e-12)
        })
    }
}

/// The lines from a stretch of the trace to the hull of some points.
///
/// The least slope to them is concave along the stretch, so the lines from its ends bound
/// all others.
struct Strip {
    /// The ends of the stretch, with the least and the largest slope there.
    ends: [(f64, (f64, f64)); 2],
    slack: f64,
}

impl Strip {
    /// Is a chord not wholly on one side of all lines?
    ///
    /// The left border is the lesser of two linear functions of the height, the right one
    /// the larger: a chord is beyond one of them if its ends are.
    fn may_meet(&self, chord: [DVec2; 2]) -> bool {
        let left = |h: f64| self.ends.map(|(s, (low, _))| s + low * h);
        let right = |h: f64| self.ends.map(|(s, (_, high))| s + high * h);
        let is_left = |p: DVec2| left(p.y).iter().all(|&x| p.x < x - self.slack);
        let is_right = |p: DVec2| right(p.y).iter().all(|&x| p.x > x + self.slack);
        !(chord.iter().all(|&p| is_left(p)) || chord.iter().all(|&p| is_right(p)))
    }
}

/// Where the line from (s, 0) with this slope meets the line through two points.
fn on_line(s: f64, m: f64, a: DVec2, b: DVec2) -> Option<DVec2> {
    let d = b - a;
    // s + m h = x: the point a + t d.
    let t = (s + m * a.y - a.x) / (d.x - m * d.y);
    let p = a + d * t;
    p.is_finite().then_some(p)
}

/// Clips a convex outline (or a segment of two points) to where `height` is not
/// negative; `height` must be affine.
fn clip(outline: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let n = outline.len();
    let mut kept = Vec::with_capacity(n + 1);
    for i in 0..n {
        let (a, b) = (outline[i], outline[(i + 1) % n]);
        let (p, q) = (height(a), height(b));
        if p >= 0.0 {
            kept.push(a);
        }
        // A segment has one edge, not two.
        let is_edge = n > 2 || i + 1 < n;
        if is_edge && ((p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0)) {
            kept.push(a + (b - a) * (p / (p - q)));
        }
    }
    kept
}
