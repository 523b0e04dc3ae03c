//! From a scene to its mesh: the one place where visibility and mesh meet.

use crate::demand::{Candidate, Choice, worth_a_line};
use crate::light::ExactLight;
use crate::plan::{Plan, Quantity};
use crate::thin::Thin;
use antumbra_geom::{Chart, Stop, bounding_box};
use antumbra_mesh::{ArrangementOptions, MeshError, Order, TaggedCurve, TriMesh, arrange_until};
use antumbra_scene::{Aabb, FaceId, Scene};
use antumbra_solver::{
    AfterStep, DirectMeshes, DirectOptions, DirectSolution, Ended, FactorOptions, FormFactors,
    Improvement, Light, Limits, Postponed, Progress, RadiosityOptions, RadiositySolution, Receiver,
    Tolerance, form_factors, solve_radiosity,
};
use antumbra_visibility::{
    CountByKind, CriticalCurve, CriticalCurves, Discontinuity, Evaluator, EventKind, EventKinds,
    critical_curves_until,
};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What the user asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Error of direct irradiance allowed anywhere.
    pub tolerance: Tolerance,
    /// Degree of the elements, 1 to 4; `None` chooses by the tolerance.
    pub degree: Option<u8>,
    /// Which events' curves are put into the mesh.
    pub events: Events,
    /// Steps after meshing, one after the other.
    pub after: [Option<AfterStep>; MOST_STEPS],
    /// No more elements than this.
    pub most_elements: usize,
    /// Of the interreflection; its tolerance follows `tolerance`.
    pub radiosity: RadiosityOptions,
}

/// No more steps after meshing than this.
pub const MOST_STEPS: usize = 4;

/// Which events' curves are put into the mesh. Contacts always are: without them
/// light leaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// All are enumerated; each is put where an element's error calls for it.
    OnDemand,
    /// All of these kinds, before anything is evaluated, and no others.
    Kinds(EventKinds),
}

impl Events {
    /// The kinds that are enumerated.
    #[must_use]
    pub fn kinds(self) -> EventKinds {
        match self {
            Self::OnDemand => EventKinds::ALL,
            Self::Kinds(kinds) => kinds.with(EventKind::Contact),
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance: Tolerance::Relative(1e-3),
            degree: None,
            events: Events::OnDemand,
            after: [None; MOST_STEPS],
            most_elements: 4_000_000,
            radiosity: RadiosityOptions::default(),
        }
    }
}

impl Options {
    /// The degree used: 2 for rough, 4 for fine tolerances, else 3.
    ///
    /// Measured in exact evaluations on the fixtures: `docs/accuracy.md`.
    #[must_use]
    pub fn chosen_degree(&self) -> u8 {
        let tolerance = match self.tolerance {
            Tolerance::Relative(t) => t,
            Tolerance::Absolute(_) => 1e-3,
        };
        self.degree.unwrap_or(if tolerance > 3e-2 {
            2
        } else if tolerance > 3e-4 {
            3
        } else {
            4
        })
    }
}

/// A phase of the work, for progress and timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Enumerating events and their critical curves.
    Events,
    /// Arrangement of the curves and triangulation.
    Arrangement,
    /// Exact values and refinement.
    Irradiance,
    /// Interreflection.
    Radiosity,
    /// Form factors between surfaces.
    Factors,
    /// Error against time for every mesh generator.
    Study,
}

impl Phase {
    /// The name in progress bars and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Events => "events",
            Self::Arrangement => "arrangement",
            Self::Irradiance => "irradiance",
            Self::Radiosity => "radiosity",
            Self::Factors => "factors",
            Self::Study => "study",
        }
    }
}

/// How the caller watches and stops the work.
///
/// The work asks often, so an answer must be as cheap as a look at a flag; and who has
/// said stop must keep saying so. What is finished by then may differ from run to run;
/// what is not stopped does not depend on being watched.
pub struct Control<'a> {
    /// End with what there is? Then receivers without values get coarse meshes with
    /// exact values, and nothing is refined any more.
    pub should_stop: &'a (dyn Fn() -> bool + Sync),
    /// Asked after `should_stop` has said yes: is there no time left for coarse meshes
    /// either? Receivers that have no values yet are then left without elements.
    pub must_stop: &'a (dyn Fn() -> bool + Sync),
    /// Is there room for so many bytes more? Asked before what would take a lot of
    /// memory at once.
    pub has_room: &'a (dyn Fn(u64) -> bool + Sync),
    /// Told the phase and how much of it is done, 0 to 1. Each phase starts at 0.
    pub progress: &'a (dyn Fn(Phase, f64) + Sync),
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Control")
    }
}

impl Default for Control<'_> {
    fn default() -> Self {
        Self {
            should_stop: &|| false,
            must_stop: &|| false,
            has_room: &|_| true,
            progress: &|_, _| {},
        }
    }
}

impl<'a> Control<'a> {
    pub(crate) fn stop(&self) -> Stop<'a> {
        Stop::new(self.should_stop)
    }

    pub(crate) fn limits(&self) -> Limits<'a> {
        Limits {
            stop: self.stop(),
            at_once: Stop::new(self.must_stop),
            has_room: self.has_room,
        }
    }
}

/// Why a scene could not be meshed: a bug of ours, told with the surface's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("surface '{surface}': {error}")]
pub struct Error {
    /// The surface.
    pub surface: String,
    /// What went wrong.
    pub error: MeshError,
}

/// The curves of one receiver as they went into its mesh; those of its border only if
/// the work was stopped before that.
#[derive(Clone, Debug, Default)]
pub struct ReceiverCurves {
    /// Curves with an id below this are loops of the border.
    pub n_border: usize,
    /// The others, in the order of their ids.
    pub critical: Vec<CriticalCurve>,
}

/// Events by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventCounts {
    /// Generators looked at.
    pub candidates: CountByKind,
    /// Curves found active.
    pub active: CountByKind,
    /// Curves with at least one edge in a mesh.
    pub inserted: CountByKind,
}

/// A meshed scene.
#[derive(Debug)]
pub struct Meshed {
    /// One mesh per face of the scene, in their order.
    pub direct: DirectSolution,
    /// The curves of every mesh.
    pub curves: Vec<ReceiverCurves>,
    /// Events of all receivers.
    pub events: EventCounts,
    /// What was simulated, and why.
    pub plan: Plan,
    /// What the steps after meshing did.
    pub improvements: Vec<Improvement>,
}

/// A solved scene.
#[derive(Debug)]
pub struct Solved {
    /// Meshes with total irradiance, power balance, row sums.
    pub radiosity: RadiositySolution,
    /// The curves of every mesh.
    pub curves: Vec<ReceiverCurves>,
    /// Events of all receivers.
    pub events: EventCounts,
    /// What was simulated, and why.
    pub plan: Plan,
    /// What the steps after meshing did.
    pub improvements: Vec<Improvement>,
}

/// Decides what a run will simulate, without meshing anything. If it was stopped, the
/// plan tells of the receivers that were looked at only.
#[must_use]
pub fn plan(scene: &Scene, options: &Options, quantity: Quantity, control: &Control<'_>) -> Plan {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new_until(&evaluator, control.stop());
    let scout = Scout::new(&evaluator, &light, options, control);
    Plan::new(scene, options, quantity, &scout)
}

/// Meshes a scene along its shadow boundaries, with exact direct irradiance.
///
/// # Errors
///
/// [`Error`] if a face cannot be triangulated.
pub fn mesh(scene: &Scene, options: &Options, control: &Control<'_>) -> Result<Meshed, Error> {
    (control.progress)(Phase::Events, 0.0);
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new_until(&evaluator, control.stop());
    mesh_on(&evaluator, &light, &light, options, control)
}

/// The same, with what is prepared already.
///
/// * `driver` — the light that is meshed: direct light, or with what is gathered.
pub(crate) fn mesh_on(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    driver: &dyn Light,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, Error> {
    let direct = direct(evaluator, light, driver, options, Quantity::Direct, control)?;
    Ok(Meshed {
        direct: direct.meshes.finish(),
        curves: direct.curves,
        events: direct.events,
        plan: direct.plan,
        improvements: direct.improvements,
    })
}

/// Meshes a scene and solves for interreflection.
///
/// # Errors
///
/// [`Error`] if a face cannot be triangulated.
pub fn solve(scene: &Scene, options: &Options, control: &Control<'_>) -> Result<Solved, Error> {
    (control.progress)(Phase::Events, 0.0);
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new_until(&evaluator, control.stop());
    solve_on(&evaluator, &light, options, control)
}

/// The same, with what is prepared already.
pub(crate) fn solve_on(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    options: &Options,
    control: &Control<'_>,
) -> Result<Solved, Error> {
    let direct = direct(evaluator, light, light, options, Quantity::Total, control)?;
    (control.progress)(Phase::Radiosity, 0.0);
    // Interreflection of a coarse mesh would be that of another scene.
    let receivers = match direct.meshes.ended() {
        Ended::Stopped => None,
        _ => contact_receivers(evaluator, control.stop())?,
    };
    let mut radiosity_options = RadiosityOptions {
        tolerance: match options.tolerance {
            Tolerance::Relative(t) => t,
            Tolerance::Absolute(_) => options.radiosity.tolerance,
        },
        ..options.radiosity
    };
    if !direct.plan.simulates("interreflection") {
        radiosity_options.most_sweeps = 0;
    }
    let radiosity = solve_radiosity(
        evaluator,
        direct.meshes,
        receivers,
        light,
        &radiosity_options,
        &control.limits(),
        &|done| (control.progress)(Phase::Radiosity, done),
    );
    let plan = if radiosity.reached.has_values() {
        direct.plan
    } else {
        direct.plan.without_interreflection()
    };
    Ok(Solved {
        radiosity,
        curves: direct.curves,
        events: direct.events,
        plan,
        improvements: direct.improvements,
    })
}

/// The form factors between all surfaces of a scene, to a tolerance.
///
/// See [`form_factors`] for what they mean; [`export_factors`](crate::export_factors)
/// makes a table for the writers of [`crate::io`].
///
/// # Example
///
/// ```
/// use antumbra::{Control, FactorOptions, Scene, factors, io};
///
/// // Two unit squares, one above the other.
/// let text = r#"{ "antumbra": 1, "materials": { "m": {} }, "surfaces": [
///     { "name": "a", "material": "m", "vertices": [[0,0,0], [1,0,0], [1,1,0], [0,1,0]] },
///     { "name": "b", "material": "m", "vertices": [[0,0,1], [0,1,1], [1,1,1], [1,0,1]] } ] }"#;
/// let input = io::scene_file::read(text)?;
/// let scene = Scene::build(&input).map_err(|problems| format!("{problems:#?}"))?.scene;
/// let matrix = factors(&scene, &FactorOptions::default(), &Control::default());
/// assert!((matrix.factor(0, 1) - 0.199_824_895_698_387_4).abs() < 1e-14);
/// assert_eq!(matrix.row_sums()[0], matrix.factor(0, 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn factors(scene: &Scene, options: &FactorOptions, control: &Control<'_>) -> FormFactors {
    (control.progress)(Phase::Factors, 0.0);
    let evaluator = Evaluator::new(scene);
    form_factors(&evaluator, options, control.should_stop, &|done| {
        (control.progress)(Phase::Factors, done);
    })
}

/// Direct light on all faces, as it goes on to the solver.
struct Direct {
    meshes: DirectMeshes,
    curves: Vec<ReceiverCurves>,
    events: EventCounts,
    plan: Plan,
    improvements: Vec<Improvement>,
}

fn direct(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    driver: &dyn Light,
    options: &Options,
    quantity: Quantity,
    control: &Control<'_>,
) -> Result<Direct, Error> {
    let scene = evaluator.scene();
    let mut scout = Scout::new(evaluator, light, options, control);
    let plan = Plan::new(scene, options, quantity, &scout);
    let is_full = AtomicBool::new(scout.is_full);
    let should_stop = || is_full.load(Ordering::Relaxed) || (control.should_stop)();
    let limits = Limits {
        stop: Stop::new(&should_stop),
        ..control.limits()
    };
    let has_room = |bytes| {
        let has_room = (control.has_room)(bytes);
        is_full.fetch_or(!has_room, Ordering::Relaxed);
        has_room
    };
    let preparation = Limits {
        has_room: &has_room,
        ..limits
    };
    if limits.stop.is_wanted() {
        // No mesh will have them any more: their memory is needed for what comes.
        scout.forget_curves();
    }
    let mut events = EventCounts {
        candidates: plan.candidates,
        active: plan.curves,
        ..EventCounts::default()
    };
    (control.progress)(Phase::Arrangement, 0.0);
    let knows_all_curves = options.events.kinds() == EventKinds::ALL;
    let allowed = scout.allowed;
    let prepared: Vec<Prepared> = scout
        .receivers
        .into_par_iter()
        .map(|r| prepare(evaluator, r, knows_all_curves, allowed, &preparation))
        .collect::<Result<_, _>>()?;
    let (receivers, mut curves): (Vec<Receiver>, Vec<ReceiverCurves>) =
        prepared.into_iter().map(|p| (p.receiver, p.curves)).unzip();
    (control.progress)(Phase::Irradiance, 0.0);
    let direct_options = DirectOptions {
        tolerance: options.tolerance,
        degree: options.chosen_degree(),
        most_elements: options.most_elements,
        verify: true,
    };
    let mut meshes =
        DirectMeshes::solve(receivers, driver, &direct_options, &limits, &|_, done| {
            (control.progress)(Phase::Irradiance, done);
        });
    let improvements = match meshes.ended() {
        // There is no time to try.
        Ended::Stopped => Vec::new(),
        _ => options
            .after
            .into_iter()
            .flatten()
            .map(|step| meshes.improve(step, driver, options.most_elements, &limits))
            .collect(),
    };
    for (progress, curves) in meshes.progress().zip(&mut curves) {
        if matches!(progress, Progress::BorderOnly | Progress::Nothing) {
            curves.critical = Vec::new();
        }
    }
    for (mesh, curves) in meshes.meshes().zip(&curves) {
        count_inserted(mesh, curves, &mut events.inserted);
    }
    let plan = plan.carried_out(&events.inserted, meshes.ended() == Ended::Stopped);
    Ok(Direct {
        meshes,
        curves,
        events,
        plan,
        improvements,
    })
}

/// What is known of a scene before anything is meshed.
pub(crate) struct Scout<'l> {
    pub(crate) light: &'l ExactLight<'l, 'l>,
    /// About the largest direct irradiance.
    pub(crate) peak: f64,
    /// The error of irradiance allowed, about; in the scene's units.
    pub(crate) allowed: f64,
    receivers: Vec<ScoutedReceiver>,
    /// Is there no room for the curves in what is exported? Then it was stopped.
    is_full: bool,
}

/// Curves between two questions for room.
const CURVES_PER_QUESTION: u64 = 4096;

/// Memory that a curve takes in a [`MeshedScene`](antumbra_io::model::MeshedScene), about:
/// its places, and its generators in words.
const BYTES_PER_EXPORTED_CURVE: u64 = 500;

/// A receiver with its curves, and which of them become lines.
struct ScoutedReceiver {
    face: FaceId,
    curves: CriticalCurves,
    choice: Choice,
    /// About how many elements light without shadows calls for.
    smooth_elements: f64,
    /// Was the work stopped before its curves were known? Then it has none.
    is_stopped: bool,
}

impl ScoutedReceiver {
    fn stopped(face: FaceId) -> Self {
        Self {
            face,
            curves: CriticalCurves::default(),
            choice: Choice::default(),
            smooth_elements: 0.0,
            is_stopped: true,
        }
    }
}

impl<'l> Scout<'l> {
    fn new(
        evaluator: &'l Evaluator<'l>,
        light: &'l ExactLight<'l, 'l>,
        options: &Options,
        control: &Control<'_>,
    ) -> Self {
        let scene = evaluator.scene();
        (control.progress)(Phase::Events, 0.0);
        let (is_full, n_curves) = (AtomicBool::new(false), AtomicU64::new(0));
        let should_stop = || is_full.load(Ordering::Relaxed) || (control.should_stop)();
        let stop = Stop::new(&should_stop);
        let peak = peak_estimate(evaluator, light, stop);
        let allowed = match options.tolerance {
            Tolerance::Relative(t) => t * peak,
            Tolerance::Absolute(t) => t,
        };
        let faces: Vec<FaceId> = scene.face_ids().collect();
        let degree = options.chosen_degree();
        let receivers = faces
            .par_iter()
            .map(|&face| {
                let radius = contact_radius(scene, face);
                let kinds = options.events.kinds();
                let curves = critical_curves_until(evaluator, face, kinds, radius, stop)?;
                let n = curves.curves.len() as u64;
                let before = n_curves.fetch_add(n, Ordering::Relaxed);
                // Not after every receiver: asking takes longer than a look at a flag.
                let asks = (before + n) / CURVES_PER_QUESTION > before / CURVES_PER_QUESTION;
                if asks && !(control.has_room)((before + n) * BYTES_PER_EXPORTED_CURVE) {
                    is_full.store(true, Ordering::Relaxed);
                    return None;
                }
                let choice = match options.events {
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

    /// Leaves the receivers without curves.
    fn forget_curves(&mut self) {
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
            gap.max(glam::DVec3::ZERO).length()
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

/// Every face, cut along what touches it or nearly does, for indirect light; nothing if
/// it was stopped.
fn contact_receivers(
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
            let touching = critical_curves_until(evaluator, face, contacts, radius, stop);
            let near = critical_curves_until(evaluator, face, contacts, gap, stop);
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
                is_stopped: false,
            };
            let limits = Limits {
                stop,
                ..Limits::NONE
            };
            prepare(evaluator, receiver, false, 0.0, &limits).map(|p| Some(p.receiver))
        })
        .collect();
    // A mesh that was stopped lacks its contacts.
    receivers.map(|r| {
        r.into_iter()
            .collect::<Option<Vec<_>>>()
            .filter(|_| !stop.is_wanted())
    })
}

/// Meshes with fewer vertices are made without asking for room.
const LARGE_MESH: usize = 4096;

/// Memory that triangulating takes for every vertex, and then its nodes and their values:
/// about what was measured on `eee/boxes-64` with all events.
const BYTES_PER_VERTEX: u64 = 1200;

struct Prepared {
    receiver: Receiver,
    curves: ReceiverCurves,
}

/// Gaps narrower than this fraction of a receiver get lines in its indirect layer as
/// if they were contacts: indirect light ends there almost as sharply (a panel a
/// centimetre under a ceiling).
const NEAR: f64 = 0.03;

/// About the largest irradiance of a scene (all bands): that at the middles of the
/// pieces of its faces, as far as they are known when it is stopped.
fn peak_estimate(evaluator: &Evaluator<'_>, light: &ExactLight<'_, '_>, stop: Stop<'_>) -> f64 {
    let scene = evaluator.scene();
    let peaks: Vec<f64> = scene
        .pieces
        .par_iter()
        .map_init(antumbra_visibility::Scratch::default, |scratch, piece| {
            if stop.is_wanted() {
                return 0.0;
            }
            let corners = scene.positions(&piece.vertices);
            let middle = corners.iter().sum::<glam::DVec3>() / corners.len() as f64;
            let bands = light.at(piece.face, middle, scratch);
            bands.into_iter().fold(0.0, f64::max)
        })
        .collect();
    peaks.into_iter().fold(0.0, f64::max)
}

/// Adds the curves with at least one edge in a mesh.
fn count_inserted(mesh: MeshWithOrders<'_>, curves: &ReceiverCurves, inserted: &mut CountByKind) {
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

/// Triangulates one receiver along its curves: all, or those of contacts, the others
/// postponed. Not at all if it was stopped, or if there is no room.
fn prepare(
    evaluator: &Evaluator<'_>,
    scouted: ScoutedReceiver,
    knows_all_curves: bool,
    allowed: f64,
    limits: &Limits<'_>,
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
    let mut thin = Thin::of(scene, face);
    let arrangement = match thin.is_all {
        true => None,
        false => arrange_until(&curves, &ArrangementOptions::default(), limits.stop),
    };
    let fits = |vertices: usize| {
        vertices < LARGE_MESH || (limits.has_room)(vertices as u64 * BYTES_PER_VERTEX)
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
        knows_all_curves: knows_all_curves && !scouted.is_stopped && !thin.is_all,
    };
    Ok(Prepared {
        receiver,
        curves: ReceiverCurves { n_border, critical },
    })
}

/// An emitter is near if its distance is less than this fraction of the receiver.
const NEAR_EMITTER: f64 = 0.125;

/// Where the pieces of near emitters and their corners stand above a receiver: a lamp a
/// millimetre below the ceiling lights a patch of its own size there, which the nodes
/// and check points of large elements may all miss.
pub(crate) fn hot_spots(evaluator: &Evaluator<'_>, face: FaceId, chart: &Chart) -> Vec<DVec2> {
    let scene = evaluator.scene();
    let receiver = scene.face(face);
    let origin = scene.position(receiver.outline[0]);
    let bounds = Aabb::of(receiver.outline.iter().map(|&v| scene.position(v)));
    let near = NEAR_EMITTER * (bounds.max - bounds.min).length();
    let mut spots = Vec::new();
    // The scene would look for its emitters each time.
    for emitter in evaluator.emitters().filter(|&e| e != face) {
        let pieces = &scene.face(emitter).pieces;
        for piece in &scene.pieces[pieces.start as usize..pieces.end as usize] {
            let corners = scene.positions(&piece.vertices);
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            for p in std::iter::once(middle).chain(corners) {
                let height = receiver.normal.dot(p - origin);
                if height > 0.0 && height <= near {
                    spots.push(chart.to_chart(p));
                }
            }
        }
    }
    spots
}

/// Where corners of other faces touch a receiver, in no order that matters: irradiance has
/// no single value there, whether or not an edge of them lies on the receiver.
fn touched_points(scene: &Scene, face: FaceId, chart: &Chart) -> Vec<DVec2> {
    let receiver = scene.face(face);
    let radius = contact_radius(scene, face);
    let origin = scene.position(receiver.outline[0]);
    let mut bounds = Aabb::of(receiver.outline.iter().map(|&v| scene.position(v)));
    bounds.min -= DVec3::splat(radius);
    bounds.max += DVec3::splat(radius);
    let mut touching = Vec::new();
    scene.tree.visit(
        |b| b.meets(&bounds),
        |piece| {
            let piece = &scene.pieces[piece as usize];
            if scene.face(piece.face).plane != receiver.plane {
                let is_near = |p: DVec3| receiver.normal.dot(p - origin).abs() <= radius;
                let corners = piece.vertices.iter();
                touching.extend(corners.filter(|&&v| is_near(scene.position(v))));
            }
        },
    );
    touching.sort_unstable();
    touching.dedup();
    let mut own: Vec<_> = receiver.loops().flatten().copied().collect();
    own.sort_unstable();
    touching.retain(|v| own.binary_search(v).is_err());
    touching
        .into_iter()
        .map(|v| chart.to_chart(scene.position(v)))
        .collect()
}

/// The exitance of a curve's emitter per band; nothing for contacts of occluders.
fn exitance<'s>(scene: &'s Scene, curve: &CriticalCurve) -> &'s [f64] {
    curve
        .emitter
        .map_or(&[][..], |f| &scene.material(f).exitance)
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

/// A mesh, and how many curves there are for it.
type MeshWithOrders<'a> = (&'a TriMesh, usize);

/// Features closer than this to a receiver touch it; scene units.
///
/// Four pixels of its arrangement, which welds what is as near. Smaller, and the two sides
/// of the shadow of a gap would fall into one place (`contact/table` with its legs a hair
/// above the floor); larger, and gaps that the arrangement keeps open are closed to light:
/// nodes beside them have limits that no element can interpolate (two boxes 1e-8 apart took
/// 15,000 elements at twelve pixels, 1,000 at four).
pub(crate) fn contact_radius(scene: &Scene, face: FaceId) -> f64 {
    let chart = scene.chart(face);
    let corners = scene.loops_in_chart(face, &chart);
    let [min, max] = bounding_box(corners.iter().flatten().copied());
    4.0 * (max - min).max_element() * PIXEL
}

/// The share of the tolerance that refinement aims at.
const START: f64 = 0.45;

/// A pixel of the arrangement relative to its receiver.
const PIXEL: f64 = 1.0 / (1u64 << 28) as f64;
