//! From a receiver and its curves to a mesh that may grow.

use crate::demand::Choice;
use crate::outcome::{Error, ReceiverCurves};
use crate::scout::{ScoutedReceiver, exitance};
use crate::surroundings::{PIXEL, contact_radius, hot_spots, touched_points};
use crate::thin::Thin;
use antumbra_geom::{Control, Stop};
use antumbra_mesh::{ArrangementOptions, MeshError, Order, TaggedCurve, TriMesh, arrange};
use antumbra_scene::FaceId;
use antumbra_solver::{Postponed, Receiver};
use antumbra_visibility::{
    CountByKind, CriticalCurve, Discontinuity, Evaluator, EventKind, EventKinds, critical_curves,
};
use glam::DVec2;
use rayon::prelude::*;

pub(crate) struct Prepared {
    pub(crate) receiver: Receiver,
    pub(crate) curves: ReceiverCurves,
}

/// Meshes with fewer vertices are made without asking for room.
const LARGE_MESH: usize = 4096;

/// Memory that triangulating takes for every vertex, and then its nodes and their values:
/// about what was measured on `eee/boxes-64` with all events.
const BYTES_PER_VERTEX: u64 = 1200;

/// Triangulates one receiver along its curves: all, or those of contacts, the others
/// postponed. Not at all if it was stopped, or if there is no room.
pub(crate) fn prepare(
    evaluator: &Evaluator<'_>,
    scouted: ScoutedReceiver,
    knows_all_curves: bool,
    allowed: f64,
    control: &Control<'_>,
) -> Result<Prepared, Error> {
    let scene = evaluator.scene();
    let (face, critical) = (scouted.face, scouted.curves.curves);
    let chart = scene.chart(face);
    let size = scene.face(face).area.sqrt();
    let mut curves: Vec<TaggedCurve> = scene
        .loops_in_chart(face, &chart)
        .into_iter()
        .map(|mut points| {
            points.extend(points.first().copied());
            TaggedCurve {
                points,
                order: Order::Boundary,
            }
        })
        .collect();
    let n_border = curves.len();
    let border: Vec<Vec<DVec2>> = curves.iter().map(|c| c.points.clone()).collect();
    let mut orders = vec![Order::Boundary; n_border];
    let mut contacts = Vec::new();
    let mut postponed = Vec::new();
    for (curve, is_line) in critical.iter().zip(scouted.choice.is_line) {
        let order = match curve.kind().discontinuity() {
            Discontinuity::D0 => Order::D0,
            Discontinuity::D1 => Order::D1,
            Discontinuity::D2 => Order::D2,
        };
        let exitance = exitance(scene, curve);
        let points: Vec<DVec2> = curve
            .shape
            .polyline(chord_tolerance(curve, exitance, allowed, size))
            .into_iter()
            .map(|p| chart.to_chart(p))
            .collect();
        let id = orders.len() as u32;
        orders.push(order);
        if order == Order::D0 {
            contacts.push(points.clone());
        }
        if !is_line {
            postpone(curve, exitance, &points, id, &mut postponed);
            // Its place among the ids, without a line in the arrangement.
            curves.push(TaggedCurve {
                points: Vec::new(),
                order,
            });
        } else {
            curves.push(TaggedCurve { points, order });
        }
    }
    for ends in scouted.strips {
        orders.push(Order::D2);
        curves.push(TaggedCurve {
            points: ends.to_vec(),
            order: Order::D2,
        });
    }
    let mut thin = Thin::of(scene, face);
    let arrangement = match thin.is_all {
        true => None,
        false => arrange(&curves, &ArrangementOptions::default(), control),
    };
    let fits = |vertices: usize| {
        vertices < LARGE_MESH || (control.has_room)(vertices as u64 * BYTES_PER_VERTEX)
    };
    let arrangement = arrangement.filter(|a| !scouted.is_stopped && fits(a.vertices.len()));
    let mesh = match arrangement.map(|a| TriMesh::new(&a, &curves)) {
        Some(Err(MeshError::NoArea { .. })) => {
            thin = Thin::all(scene, face);
            None
        }
        Some(Err(error)) => {
            let surface = scene.surface_of(face).name.clone();
            return Err(Error { surface, error });
        }
        Some(Ok(mesh)) => Some(mesh),
        None => None,
    };
    let mesh = match mesh {
        Some(mesh) => mesh,
        None if thin.is_all => {
            postponed.clear();
            TriMesh::of_corners(&scene.loops_in_chart(face, &chart))
        }
        None => TriMesh::empty(),
    };
    let receiver = Receiver {
        folded_area: thin.area,
        is_thin: thin.is_all,
        hot_spots: hot_spots(evaluator, face, &chart),
        face,
        chart,
        contacts,
        border,
        mesh,
        orders,
        contact_radius: contact_radius(scene, face),
        touched: touched_points(scene, face, &chart),
        postponed,
        has_indirect_light: false,
        knows_all_curves: knows_all_curves && !scouted.is_stopped && !thin.is_all,
    };
    Ok(Prepared {
        receiver,
        curves: ReceiverCurves { n_border, critical },
    })
}

/// How far from an arc its chords may run: a D2 curve that is misplaced by ε costs
/// J ε²/2, of which a tenth of the tolerance is spent here.
fn chord_tolerance(curve: &CriticalCurve, exitance: &[f64], allowed: f64, size: f64) -> f64 {
    let strongest = exitance.iter().copied().fold(0.0, f64::max);
    let jump = strongest * curve.largest_jump(0.0, 1.0);
    // Not below 64 pixels, not above a hundredth of the receiver.
    let least = 64.0 * PIXEL * size;
    let wanted = (0.2 * allowed / jump).sqrt();
    if wanted.is_nan() {
        1e-2 * size
    } else {
        wanted.clamp(least, 1e-2 * size)
    }
}

/// The straight pieces of a curve with their jumps.
fn postpone(
    curve: &CriticalCurve,
    exitance: &[f64],
    points: &[DVec2],
    id: u32,
    postponed: &mut Vec<Postponed>,
) {
    let total: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut done = 0.0;
    for pair in points.windows(2) {
        let length = pair[0].distance(pair[1]);
        let jump = curve.largest_jump(done / total, (done + length) / total);
        done += length;
        postponed.push(Postponed {
            ends: [pair[0], pair[1]],
            curve: id,
            jump: exitance.iter().map(|m| m * jump).collect(),
        });
    }
}

/// Gaps narrower than this fraction of a receiver get lines in its indirect layer as
/// if they were contacts: indirect light ends there almost as sharply (a panel a
/// centimetre under a ceiling).
const NEAR: f64 = 0.03;

/// Every face, cut along what touches it or nearly does, for indirect light; nothing if
/// it was stopped.
pub(crate) fn contact_receivers(
    evaluator: &Evaluator<'_>,
    stop: Stop<'_>,
) -> Result<Option<Vec<Receiver>>, Error> {
    let scene = evaluator.scene();
    let faces: Vec<FaceId> = scene.face_ids().collect();
    let contacts = EventKinds::NONE.with(EventKind::Contact);
    let receivers: Result<Vec<Option<Receiver>>, Error> = faces
        .par_iter()
        .map(|&face| {
            let radius = contact_radius(scene, face);
            let gap = NEAR * scene.face(face).area.sqrt();
            let touching =
                critical_curves(evaluator, face, contacts, radius, &Control::stopping(stop));
            let near = critical_curves(evaluator, face, contacts, gap, &Control::stopping(stop));
            let (Some(mut curves), Some(near)) = (touching, near) else {
                return Ok(None);
            };
            curves.curves.extend(near.curves);
            let is_line = vec![true; curves.curves.len()];
            let receiver = ScoutedReceiver {
                face,
                curves,
                choice: Choice {
                    is_line,
                    elements: 0.0,
                },
                smooth_elements: 0.0,
                strips: Vec::new(),
                is_stopped: false,
            };
            let control = Control::stopping(stop);
            prepare(evaluator, receiver, false, 0.0, &control).map(|p| Some(p.receiver))
        })
        .collect();
    // A mesh that was stopped lacks its contacts.
    receivers.map(|r| {
        r.into_iter()
            .collect::<Option<Vec<_>>>()
            .filter(|_| !stop.is_wanted())
    })
}

/// A mesh, and how many curves there are for it.
pub(crate) type MeshWithOrders<'a> = (&'a TriMesh, usize);

/// Adds the curves with at least one edge in a mesh.
pub(crate) fn count_inserted(
    mesh: MeshWithOrders<'_>,
    curves: &ReceiverCurves,
    inserted: &mut CountByKind,
) {
    let (mesh, n_curves) = mesh;
    let mut is_inserted = vec![false; n_curves];
    for triangle in &mesh.triangles {
        for k in 0..3 {
            let set = mesh.edge_curves(triangle[k], triangle[(k + 1) % 3]);
            for &id in set.map_or(&[][..], |set| mesh.sets().get(set)) {
                is_inserted[id as usize] = true;
            }
        }
    }
    for (curve, _) in curves
        .critical
        .iter()
        .zip(&is_inserted[curves.n_border..])
        .filter(|(_, inserted)| **inserted)
    {
        inserted[curve.kind() as usize] += 1;
    }
}
