//! The form factor between two faces.

use crate::factors::apart::{Polygon, integral_apart};
use crate::factors::cells::{self, Cell, clip};
use crate::factors::contour::contour_integral;
use crate::factors::cubature::{Estimate, Goal, Integral, Integrand, Rule, integrate};
use antumbra_geom::{Chart, Control, Stop};
use antumbra_scene::{FaceId, Scene};
use antumbra_visibility::{
    CriticalCurve, Evaluator, Event, EventKinds, LONGEST_NARROWED_LIST, Place, Scratch, Source,
    critical_curves_between,
};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// What two faces exchange.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Exchange {
    /// Area times form factor, the same both ways; square scene units.
    pub(crate) value: f64,
    /// Estimated error of `value`.
    pub(crate) error: f64,
    /// Exact evaluations.
    pub(crate) evaluations: u64,
}

/// The part of a face that lies on the front of another's plane.
pub(crate) struct Side {
    face: FaceId,
    /// Its convex pieces.
    source: Source,
    /// Loops, holes included; only good for contour integrals.
    loops: Vec<Vec<DVec3>>,
    area: f64,
}

impl Side {
    fn new(scene: &Scene, id: FaceId, other: FaceId) -> Self {
        let (face, other) = (scene.face(id), scene.face(other));
        let origin = scene.position(other.outline[0]);
        let tolerance = scene.plane_tolerance();
        // A corner in the plane stays what it is.
        let height = |x: DVec3| {
            let h = other.normal.dot(x - origin);
            if h.abs() <= tolerance { 0.0 } else { h }
        };
        let part = |corners: &[DVec3]| clip(corners, height);
        let mut source = Source::of(scene, id);
        source.pieces = source.pieces.iter().map(|piece| part(piece)).collect();
        source.pieces.retain(|corners| corners.len() > 2);
        let loops = face.loops().map(|corners| part(&scene.positions(corners)));
        let doubled = |corners: &Vec<DVec3>| {
            let fan = corners.windows(2).skip(1);
            fan.map(|w| {
                (w[0] - corners[0])
                    .cross(w[1] - corners[0])
                    .dot(face.normal)
            })
            .sum::<f64>()
        };
        Self {
            face: id,
            loops: loops.filter(|l| l.len() > 2).collect(),
            area: 0.5 * source.pieces.iter().map(doubled).sum::<f64>(),
            source,
        }
    }

    fn polygon(&self) -> Polygon<'_> {
        Polygon {
            normal: self.source.normal,
            pieces: &self.source.pieces,
            area: self.area,
        }
    }

    /// The middle and the radius of a sphere around it.
    fn sphere(&self) -> (DVec3, f64) {
        let corners = || self.loops.iter().flatten();
        let middle = corners().sum::<DVec3>() / corners().count().max(1) as f64;
        let radius = corners().fold(0.0, |r: f64, x| r.max(x.distance(middle)));
        (middle, radius)
    }

    /// The factor from a point to another side, integrated along the border, at most.
    ///
    /// With the distance `d` of spheres around both it is at most `area/πd²` everywhere.
    /// Of an edge, no more than `4R` lies within `2R` of the middle of the other's sphere,
    /// of radius `R`; there it is at most 1, and beyond, where the distance from the sphere
    /// is half that from its middle, the rest adds up to no more than `4R` again.
    fn seen_along_border(&self, other: &Self) -> f64 {
        let ((a, r), (b, s)) = (self.sphere(), other.sphere());
        let apart = (a.distance(b) - r - s).max(0.0);
        let most = other.area / (PI * apart * apart);
        let along = self.edge_lengths().map(|length| length.min(8.0 * s));
        along.sum::<f64>() * if most < 1.0 { most } else { 1.0 }
    }

    fn edge_lengths(&self) -> impl Iterator<Item = f64> + '_ {
        self.loops.iter().flat_map(|corners| {
            let next = corners.iter().cycle().skip(1);
            corners.iter().zip(next).map(|(a, b)| a.distance(*b))
        })
    }
}

/// Two faces that see each other, or would.
pub(crate) struct Pair {
    sides: [Side; 2],
    occluders: Vec<u32>,
}

impl Pair {
    /// `None` if no point of one front sees the other.
    pub(crate) fn new(evaluator: &Evaluator<'_>, a: FaceId, b: FaceId) -> Option<Self> {
        let scene = evaluator.scene();
        let (face_a, face_b) = (scene.face(a), scene.face(b));
        if face_a.plane == face_b.plane || face_a.is_covered || face_b.is_covered {
            return None;
        }
        let [outline_a, outline_b] = [face_a, face_b].map(|f| scene.positions(&f.outline));
        let between = evaluator.between(
            &outline_a,
            (face_a.normal, face_a.plane),
            &outline_b,
            (face_b.normal, face_b.plane),
        )?;
        let sides = [Side::new(scene, a, b), Side::new(scene, b, a)];
        let [loops_a, loops_b] = [&sides[0].loops, &sides[1].loops];
        let occluders = evaluator.narrow(loops_a.first()?, loops_b.first()?, &between);
        Some(Self { sides, occluders })
    }

    /// The side that is cheaper to integrate over: the smaller one, on which less
    /// happens.
    pub(crate) fn better(&self) -> usize {
        usize::from(self.sides[1].area < self.sides[0].area)
    }

    /// What the faces exchange, integrated over one of them; `None` if it was stopped
    /// before anything was known.
    ///
    /// * `goal` — the error allowed is that of area times form factor.
    pub(crate) fn exchange(
        &self,
        over: usize,
        work: &mut Work<'_, '_, '_>,
        goal: &Goal<'_>,
    ) -> Option<Exchange> {
        let (from, to) = (&self.sides[over], &self.sides[1 - over]);
        let exact = self.unobstructed(over, work, goal)?;
        let whole = exact.value;
        if self.occluders.is_empty() {
            return Some(exact);
        }
        let goal = Goal {
            // No finer than what rounding leaves anyway.
            error: (goal.error - exact.error).max(0.5 * exact.error),
            ..*goal
        };
        let integral = self.cubature(from, to, work, &goal)?;
        if !integral.is_complete {
            return None;
        }
        let hidden = Estimate {
            value: whole - integral.hidden.value,
            error: integral.hidden.error + exact.error,
        };
        let best = match integral.seen {
            Some(seen) if seen.error <= hidden.error => seen,
            _ => hidden,
        };
        Some(Exchange {
            value: best.value.clamp(0.0, whole),
            error: best.error.min(whole + exact.error),
            evaluations: integral.evaluations,
        })
    }

    /// What the faces would exchange if nothing stood between; `None` if it was stopped.
    fn unobstructed(
        &self,
        over: usize,
        work: &Work<'_, '_, '_>,
        goal: &Goal<'_>,
    ) -> Option<Exchange> {
        let (from, to) = (&self.sides[over], &self.sides[1 - over]);
        let stop = goal.stop;
        let accuracy = EXACT * from.area.min(to.area);
        let mut best = contour_integral(&from.loops, &to.loops, accuracy, stop)?;
        if best.error > accuracy.max(NEGLIGIBLE * goal.error) {
            let better = &self.sides[self.better()];
            let other = &self.sides[1 - self.better()];
            let apart = integral_apart(better.polygon(), other.polygon(), accuracy, stop);
            if let Some(apart) = apart.filter(|apart| apart.error < best.error) {
                best = apart;
            } else if stop.is_wanted() {
                return None;
            }
        }
        Some(Exchange {
            value: best.value.max(0.0),
            error: best.error.max(accuracy) + self.rounding_of_corners(work.evaluator.scene()),
            evaluations: 0,
        })
    }

    /// How much what the faces exchange changes, at most, where their corners move by the
    /// rounding of coordinates.
    ///
    /// A border that moves by `δ` adds or takes a strip along it, and a plane that turns
    /// with it changes the cosines by `δ` over the width of the face: about `δ` times the
    /// integral of the factor of a point along the border.
    fn rounding_of_corners(&self, scene: &Scene) -> f64 {
        let offset = scene.frame.offset.abs().max_element() * scene.frame.scale;
        let moved = scene.rounding() + f64::EPSILON * offset;
        let [a, b] = &self.sides;
        moved * (a.seen_along_border(b) + b.seen_along_border(a))
    }

    fn cubature(
        &self,
        from: &Side,
        to: &Side,
        work: &mut Work<'_, '_, '_>,
        goal: &Goal<'_>,
    ) -> Option<Integral> {
        let scene = work.evaluator.scene();
        let chart = scene.chart(from.face);
        let mut cells: Vec<Cell> = from
            .source
            .pieces
            .iter()
            .map(|corners| corners.iter().map(|&x| chart.to_chart(x)).collect())
            .collect();
        let tolerance = THINNEST * from.area.sqrt();
        let stop = goal.stop;
        for segment in self.lines(from, to, work, stop)? {
            if cells.len() >= MOST_CELLS || stop.is_wanted() {
                break;
            }
            cells::cut(&mut cells, segment.map(|x| chart.to_chart(x)), tolerance);
        }
        let start: Vec<[DVec2; 3]> = cells
            .iter()
            .flat_map(|cell| cells::triangles(cell))
            .filter(|&t| cells::area(t) > 0.0)
            .collect();
        let seen = SeenFrom {
            evaluator: work.evaluator,
            chart,
            from,
            to,
        };
        Some(integrate(
            work.rule,
            &start,
            &self.occluders,
            &seen,
            work.scratch,
            goal,
        ))
    }

    /// Where what is seen from one side is not smooth: contacts first, then the other
    /// critical curves, the strongest order first and the longest first. `None` if it was
    /// stopped.
    fn lines(
        &self,
        from: &Side,
        to: &Side,
        work: &Work<'_, '_, '_>,
        stop: Stop<'_>,
    ) -> Option<Vec<[DVec3; 2]>> {
        let scene = work.evaluator.scene();
        let size = from.area.sqrt();
        let mut faces: Vec<FaceId> = self
            .occluders
            .iter()
            .flat_map(|&piece| scene.faces_of(piece))
            .collect();
        faces.sort_unstable();
        faces.dedup();
        let is_between = |curve: &&CriticalCurve| matches!(curve.event, Event::Contact(face) if faces.binary_search(&face).is_ok());
        let contacts = work.contacts[from.face.index()].iter().filter(is_between);
        let mut curves = critical_curves_between(
            work.evaluator,
            from.face,
            to.face,
            self.occluders.clone(),
            EventKinds::ALL,
            CONTACT * scene.extent,
            &Control::stopping(stop),
        )?;
        let length = |curve: &CriticalCurve| {
            let [a, b] = curve.shape.ends();
            a.distance(b)
        };
        curves.sort_by(|a, b| {
            let order = |curve: &CriticalCurve| curve.kind().discontinuity();
            let strongest = order(a).cmp(&order(b));
            strongest.then(length(b).total_cmp(&length(a)))
        });
        let chords = contacts.chain(&curves).flat_map(|curve| {
            let points = curve.shape.polyline(CHORD * size);
            let pairs = points.windows(2).map(|pair| [pair[0], pair[1]]);
            pairs.collect::<Vec<_>>()
        });
        Some(chords.collect())
    }
}

/// The accuracy of what has a closed form, as a form factor from the smaller side.
const EXACT: f64 = 1e-13;

/// An error of what has a closed form that is this small against the one allowed is not
/// worth another rule.
const NEGLIGIBLE: f64 = 1e-2;

/// Strips narrower than this, relative to the surface, are not cut off: they would
/// hold less than a millionth of a millionth of it.
const THINNEST: f64 = 1e-9;

/// Cells are cut no more when there are so many.
///
/// With 4000, `eee/boxes-8` needs more evaluations by half; with 100, the cases of
/// `validation/factors` are cut as before.
const MOST_CELLS: usize = 500;

/// Gaps narrower than this, relative to the scene, are contacts.
pub(crate) const CONTACT: f64 = 1e-9;

/// Arcs of conics are replaced by chords this close to them, relative to the surface.
const CHORD: f64 = 1e-2;

/// What all pairs share, and the memory of one thread.
pub(crate) struct Work<'w, 'e, 's> {
    pub(crate) evaluator: &'e Evaluator<'s>,
    pub(crate) rule: &'w Rule,
    /// The contacts on every face.
    pub(crate) contacts: &'w [Vec<CriticalCurve>],
    pub(crate) scratch: &'w mut Scratch,
}

/// What points of one side see of the other.
struct SeenFrom<'a, 'e, 's> {
    evaluator: &'e Evaluator<'s>,
    chart: Chart,
    from: &'a Side,
    to: &'a Side,
}

impl Integrand for SeenFrom<'_, '_, '_> {
    type Context = Vec<u32>;
    type Memory = Scratch;

    fn narrow(&self, triangle: &[DVec2; 3], occluders: &Vec<u32>) -> Vec<u32> {
        let corners = triangle.map(|uv| self.chart.to_space(uv));
        self.evaluator
            .narrow(&corners, &self.to.loops[0], occluders)
    }

    fn is_lit(occluders: &Vec<u32>) -> bool {
        occluders.is_empty()
    }

    fn at(&self, point: DVec2, occluders: &Vec<u32>, scratch: &mut Scratch) -> [f64; 2] {
        let place = Place {
            point: self.chart.to_space(point),
            normal: self.from.source.normal,
            plane: Some(self.from.source.plane),
            approach: None,
        };
        let list = (occluders.len() <= LONGEST_NARROWED_LIST).then_some(occluders.as_slice());
        let seen = self.evaluator.see(&place, &self.to.source, list, scratch);
        [seen.factor, seen.unoccluded]
    }
}
