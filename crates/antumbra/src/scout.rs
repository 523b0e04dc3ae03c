//! What is known of a scene before anything is meshed.

use crate::demand::{Candidate, Choice, worth_a_line};
use crate::light::ExactLight;
use crate::options::{Events, Options};
use crate::strips::strips;
use crate::surroundings::contact_radius;
use antumbra_geom::{Control, DVec2, Phase, Stop};
use antumbra_scene::{Aabb, FaceId, Scene};
use antumbra_solver::Tolerance;
use antumbra_visibility::{
    CountByKind, CriticalCurve, CriticalCurves, Evaluator, EventKind, Scratch, critical_curves,
};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What is known of a scene before anything is meshed.
pub(crate) struct Scout<'l> {
    pub(crate) light: &'l ExactLight<'l, 'l>,
    /// About the largest direct irradiance.
    pub(crate) peak: f64,
    /// The error of irradiance allowed, about; in the scene's units.
    pub(crate) allowed: f64,
    pub(crate) receivers: Vec<ScoutedReceiver>,
    /// Is there no room for the curves in what is exported? Then it was stopped.
    pub(crate) is_full: bool,
}

/// Curves between two questions for room.
const CURVES_PER_QUESTION: u64 = 4096;

/// Memory that a curve takes in a [`MeshedScene`](antumbra_io::model::MeshedScene), about:
/// its places, and its generators in words.
const BYTES_PER_EXPORTED_CURVE: u64 = 500;

/// A receiver with its curves, and which of them become lines.
pub(crate) struct ScoutedReceiver {
    pub(crate) face: FaceId,
    pub(crate) curves: CriticalCurves,
    pub(crate) choice: Choice,
    /// About how many elements light without shadows calls for.
    pub(crate) smooth_elements: f64,
    /// Lines that are in the mesh for the sake of reflected light.
    pub(crate) strips: Vec<[DVec2; 2]>,
    /// Was the work stopped before its curves were known? Then it has none.
    pub(crate) is_stopped: bool,
}

impl ScoutedReceiver {
    fn stopped(face: FaceId) -> Self {
        Self {
            face,
            curves: CriticalCurves::default(),
            choice: Choice::default(),
            smooth_elements: 0.0,
            strips: Vec::new(),
            is_stopped: true,
        }
    }
}

impl<'l> Scout<'l> {
    pub(crate) fn new(
        evaluator: &'l Evaluator<'l>,
        light: &'l ExactLight<'l, 'l>,
        options: &Options,
        control: &Control<'_>,
    ) -> Self {
        let scene = evaluator.scene();
        (control.progress)(Phase::Events, 0.0);
        let (is_full, n_curves) = (AtomicBool::new(false), AtomicU64::new(0));
        let should_stop = || is_full.load(Ordering::Relaxed) || control.stop.is_wanted();
        let stop = Stop::new(&should_stop);
        let peak = peak_estimate(evaluator, light, stop);
        let allowed = match options.tolerance {
            Tolerance::Relative(t) => t * peak,
            Tolerance::Absolute(t) => t,
        };
        let faces: Vec<FaceId> = scene.face_ids().collect();
        let (degree, events) = (options.chosen_degree(), options.curves().events);
        let receivers = faces
            .par_iter()
            .map(|&face| {
                let radius = contact_radius(scene, face);
                let kinds = events.kinds();
                let curves =
                    critical_curves(evaluator, face, kinds, radius, &Control::stopping(stop))?;
                let n = curves.curves.len() as u64;
                let before = n_curves.fetch_add(n, Ordering::Relaxed);
                // Not after every receiver: asking takes longer than a look at a flag.
                let asks = (before + n) / CURVES_PER_QUESTION > before / CURVES_PER_QUESTION;
                if asks && !(control.has_room)((before + n) * BYTES_PER_EXPORTED_CURVE) {
                    is_full.store(true, Ordering::Relaxed);
                    return None;
                }
                let choice = match events {
                    Events::OnDemand => lines(&curves.curves, scene, face, allowed, degree, stop)?,
                    Events::Kinds(_) => Choice {
                        is_line: vec![true; curves.curves.len()],
                        elements: ELEMENTS_PER_CURVE * curves.curves.len() as f64,
                    },
                };
                Some(ScoutedReceiver {
                    face,
                    curves,
                    choice,
                    smooth_elements: smooth_elements(evaluator, light, face),
                    strips: Vec::new(),
                    is_stopped: false,
                })
            })
            .zip(&faces)
            .map(|(scouted, &face)| scouted.unwrap_or_else(|| ScoutedReceiver::stopped(face)))
            .collect();
        Self {
            light,
            peak,
            allowed,
            receivers,
            is_full: is_full.into_inner(),
        }
    }

    /// Curves by kind, those that `counts` accepts by whether they become lines.
    pub(crate) fn count(&self, counts: impl Fn(bool) -> bool) -> CountByKind {
        let mut n = CountByKind::default();
        for receiver in &self.receivers {
            for (curve, &is_line) in receiver.curves.curves.iter().zip(&receiver.choice.is_line) {
                n[curve.kind() as usize] += u64::from(counts(is_line));
            }
        }
        n
    }

    /// Adds lines where reflected light bends.
    pub(crate) fn add_strips(&mut self, evaluator: &Evaluator<'_>, stop: Stop<'_>) {
        self.receivers.par_iter_mut().for_each(|receiver| {
            let radius = contact_radius(evaluator.scene(), receiver.face);
            receiver.strips = strips(evaluator, receiver.face, radius, stop);
        });
    }

    /// Leaves the receivers without curves.
    pub(crate) fn forget_curves(&mut self) {
        for receiver in &mut self.receivers {
            *receiver = ScoutedReceiver::stopped(receiver.face);
        }
    }

    /// Receivers, and those of them whose curves are not known because the work was
    /// stopped.
    pub(crate) fn n_stopped(&self) -> (usize, usize) {
        let n_stopped = self.receivers.iter().filter(|r| r.is_stopped).count();
        (self.receivers.len(), n_stopped)
    }

    pub(crate) fn candidates(&self) -> CountByKind {
        let mut n = CountByKind::default();
        for receiver in &self.receivers {
            for (sum, of_receiver) in n.iter_mut().zip(receiver.curves.candidates) {
                *sum += of_receiver;
            }
        }
        n
    }

    pub(crate) fn expected_elements(&self) -> f64 {
        self.receivers
            .iter()
            .map(|r| {
                let is_contact = |c: &&CriticalCurve| c.kind() == EventKind::Contact;
                let n_contacts = r.curves.curves.iter().filter(is_contact).count() as f64;
                2.0 + r.smooth_elements + r.choice.elements + ELEMENTS_PER_CONTACT * n_contacts
            })
            .sum()
    }
}

/// Elements that grade down to the ends of a contact (measured on tables and boxes that
/// stand on floors).
const ELEMENTS_PER_CONTACT: f64 = 60.0;

/// Elements that light without shadows calls for on a face as large as its distance
/// from the emitter (measured on unoccluded floors, degree 3 at 1e-3).
const ELEMENTS_IN_THE_OPEN: f64 = 20.0;

/// About how many elements a face needs for the nearest emitter it sees, shadows
/// apart: irradiance bends over the distance to the emitter.
fn smooth_elements(evaluator: &Evaluator<'_>, light: &ExactLight<'_, '_>, face: FaceId) -> f64 {
    let scene = evaluator.scene();
    let bounds = |f: FaceId| Aabb::of(scene.positions(&scene.face(f).outline));
    let own = bounds(face);
    let emitters: Vec<FaceId> = evaluator.emitters().collect();
    let nearest = light
        .view(face)
        .visible_emitters()
        .map(|e| {
            let other = bounds(emitters[e]);
            let gap = (own.min - other.max).max(other.min - own.max);
            gap.max(antumbra_geom::DVec3::ZERO).length()
        })
        .fold(f64::INFINITY, f64::min);
    let size = scene.face(face).area.sqrt();
    // Touching emitters: refinement ends somewhere.
    let ratio = size / nearest.max(size / 5.0);
    ELEMENTS_IN_THE_OPEN * ratio * ratio
}

/// Elements that a curve makes if all are put into the mesh (measured on the box
/// fixtures).
const ELEMENTS_PER_CURVE: f64 = 4.0;

/// About the largest irradiance of a scene (all bands): that at the middles of the
/// pieces of its faces, as far as they are known when it is stopped.
fn peak_estimate(evaluator: &Evaluator<'_>, light: &ExactLight<'_, '_>, stop: Stop<'_>) -> f64 {
    let scene = evaluator.scene();
    let peaks: Vec<f64> = scene
        .pieces
        .par_iter()
        .map_init(Scratch::default, |scratch, piece| {
            if stop.is_wanted() {
                return 0.0;
            }
            let corners = scene.positions(&piece.vertices);
            let middle = corners.iter().sum::<antumbra_geom::DVec3>() / corners.len() as f64;
            let bands = light.at(piece.face, middle, scratch);
            bands.into_iter().fold(0.0, f64::max)
        })
        .collect();
    peaks.into_iter().fold(0.0, f64::max)
}

/// Which curves of a receiver are put into its mesh at the start; contacts always
/// are. Nothing if it was stopped.
fn lines(
    critical: &[CriticalCurve],
    scene: &Scene,
    face: FaceId,
    allowed: f64,
    degree: u8,
    stop: Stop<'_>,
) -> Option<Choice> {
    let chart = scene.chart(face);
    let waits = |c: &&CriticalCurve| c.kind() != EventKind::Contact;
    let candidates: Vec<Candidate> = critical
        .iter()
        .filter(waits)
        .map(|curve| {
            let ends = curve.shape.ends().map(|p| chart.to_chart(p));
            let strongest = exitance(scene, curve).iter().copied().fold(0.0, f64::max);
            Candidate::new(curve, ends, strongest, START * allowed)
        })
        .collect();
    let chosen = worth_a_line(&candidates, degree, stop)?;
    let mut is_chosen = chosen.is_line.into_iter();
    Some(Choice {
        is_line: critical
            .iter()
            .map(|c| c.kind() == EventKind::Contact || is_chosen.next() == Some(true))
            .collect(),
        elements: chosen.elements,
    })
}

/// The exitance of a curve's emitter per band; nothing for contacts of occluders.
pub(crate) fn exitance<'s>(scene: &'s Scene, curve: &CriticalCurve) -> &'s [f64] {
    curve
        .emitter
        .map_or(&[][..], |f| &scene.material(f).exitance)
}

/// The share of the tolerance that refinement aims at.
const START: f64 = 0.45;
