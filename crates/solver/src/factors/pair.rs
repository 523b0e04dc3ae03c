//! The form factor between two faces.

use crate::factors::cells::{self, Cell, clip};
use crate::factors::contour::contour_integral;
use crate::factors::cubature::{Estimate, Goal, Integral, Integrand, Rule, integrate};
use antumbra_geom::Chart;
use antumbra_scene::{FaceId, PlaneId, Scene};
use antumbra_visibility::{
    CriticalCurve, Evaluator, Event, EventKinds, Scratch, Source, contour_sum,
    critical_curves_between,
};
use glam::{DVec2, DVec3};

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
    normal: DVec3,
    plane: PlaneId,
    /// Loops, holes included; only good for contour integrals.
    loops: Vec<Vec<DVec3>>,
    /// Convex pieces.
    pieces: Vec<Vec<DVec3>>,
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
        let part = |corners: &[_]| clip(&scene.positions(corners), height);
        let pieces: Vec<Vec<DVec3>> = scene.pieces
            [face.pieces.start as usize..face.pieces.end as usize]
            .iter()
            .map(|piece| part(&piece.vertices))
            .filter(|corners| corners.len() > 2)
            .collect();
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
            normal: face.normal,
            plane: face.plane,
            loops: face.loops().map(part).filter(|l| l.len() > 2).collect(),
            area: 0.5 * pieces.iter().map(doubled).sum::<f64>(),
            pieces,
        }
    }

    fn perimeter(&self) -> f64 {
        let length = |l: &Vec<DVec3>| {
            let next = l.iter().cycle().skip(1);
            l.iter().zip(next).map(|(a, b)| a.distance(*b)).sum::<f64>()
        };
        self.loops.iter().map(length).sum()
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

    /// What the faces exchange, integrated over one of them.
    ///
    /// * `goal` — the error allowed is that of area times form factor.
    pub(crate) fn exchange(
        &self,
        over: usize,
        work: &mut Work<'_, '_, '_>,
        goal: &Goal<'_>,
    ) -> Exchange {
        let (from, to) = (&self.sides[over], &self.sides[1 - over]);
        let accuracy = EXACT * from.area.min(to.area);
        let rounding = f64::EPSILON * from.perimeter() * to.perimeter();
        let whole = contour_integral(&from.loops, &to.loops, accuracy).max(0.0);
        let exact = Exchange {
            value: whole,
            error: accuracy + rounding,
            evaluations: 0,
        };
        if self.occluders.is_empty() {
            return exact;
        }
        let goal = Goal {
            error: goal.error - exact.error,
            ..*goal
        };
        let integral = self.cubature(from, to, work, &goal);
        if !integral.is_complete {
            // Anything from nothing to all of it.
            return Exchange {
                value: 0.0,
                error: whole + exact.error,
                evaluations: integral.evaluations,
            };
        }
        let hidden = Estimate {
            value: whole - integral.hidden.value,
            error: integral.hidden.error + exact.error,
        };
        let best = match integral.seen {
            Some(seen) if seen.error <= hidden.error => seen,
            _ => hidden,
        };
        Exchange {
            value: best.value.clamp(0.0, whole),
            error: best.error.min(whole + exact.error),
            evaluations: integral.evaluations,
        }
    }

    fn cubature(
        &self,
        from: &Side,
        to: &Side,
        work: &mut Work<'_, '_, '_>,
        goal: &Goal<'_>,
    ) -> Integral {
        let scene = work.evaluator.scene();
        let chart = scene.chart(from.face);
        let mut cells: Vec<Cell> = from
            .pieces
            .iter()
            .map(|corners| corners.iter().map(|&x| chart.to_chart(x)).collect())
            .collect();
        let tolerance = THINNEST * from.area.sqrt();
        for segment in self.lines(from, to, work) {
            if cells.len() >= MOST_CELLS {
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
        integrate(
            work.rule,
            &start,
            &self.occluders,
            &seen,
            work.scratch,
            goal,
        )
    }

    /// Where what is seen from one side is not smooth: contacts first, then the other
    /// critical curves, the strongest order first and the longest first.
    fn lines(&self, from: &Side, to: &Side, work: &Work<'_, '_, '_>) -> Vec<[DVec3; 2]> {
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
        );
        let length = |curve: &CriticalCurve| {
            let [a, b] = curve.shape.ends();
            a.distance(b)
        };
        curves.sort_by(|a, b| {
            let order = |curve: &CriticalCurve| curve.kind().discontinuity();
            let strongest = order(a).cmp(&order(b));
            strongest.then(length(b).total_cmp(&length(a)))
        });
        contacts
            .chain(&curves)
            .flat_map(|curve| {
                let points = curve.shape.polyline(CHORD * size);
                let pairs = points.windows(2).map(|pair| [pair[0], pair[1]]);
                pairs.collect::<Vec<_>>()
            })
            .collect()
    }
}

/// The accuracy of what has a closed form, as a form factor from the smaller side.
const EXACT: f64 = 1e-13;

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

/// Longer lists of occluders are replaced by a query of the box tree: lists are those
/// of a small triangle here, so that most of their occluders matter.
const LONGEST_LIST: usize = 64;

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
        let point = self.chart.to_space(point);
        let list = (occluders.len() <= LONGEST_LIST).then_some(occluders.as_slice());
        let (mut factor, mut whole) = (0.0, 0.0);
        let mut relative: Vec<DVec3> = Vec::new();
        for corners in &self.to.pieces {
            let source = Source {
                corners,
                normal: self.to.normal,
                plane: self.to.plane,
            };
            factor += self.evaluator.visible_parts(
                (self.from.normal, Some(self.from.plane)),
                &source,
                list,
                point,
                None,
                scratch,
                |_, _| {},
            );
            relative.clear();
            relative.extend(corners.iter().map(|&x| x - point));
            whole += contour_sum(&relative, self.from.normal);
        }
        [factor, whole]
    }
}
