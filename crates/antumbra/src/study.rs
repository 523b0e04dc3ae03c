//! What accuracy costs in time: every mesh generator at every degree over a ladder of
//! settings, its error measured at points that no mesh used.
//!
//! The library reads no clock: who runs a study brings one ([`Meter`]).

mod maps;
mod rival;

use crate::light::ExactLight;
use crate::options::{Mesher, Options};
use crate::outcome::{Error, Outcome};
use crate::pipeline::{mesh, mesh_on, radiosity_on};
use crate::total_light::TotalLight;
use crate::values::{self, Place};
use antumbra_geom::{Control, Phase, Stop};
use antumbra_io::study::{
    Errors, Quality, Run, Series, Spread, Study, observed_order, pareto_front,
};
use antumbra_scene::Scene;
use antumbra_solver::{Light, Radiosity, RadiosityOptions, Sample, Solution};
use antumbra_visibility::{Evaluator, Scratch, Seen};
use rayon::prelude::*;

/// What a study is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyOptions {
    /// Degrees of the elements, 1 to 4.
    pub degrees: Vec<u8>,
    /// The keys of the mesh generators; see [`Mesher`].
    pub meshers: Vec<Mesher>,
    /// Tolerances of those that are driven by one, descending. A series ends when its
    /// largest error is below the last of them.
    pub tolerances: Vec<f64>,
    /// The error that the advice is for, relative to the peak.
    pub target: f64,
    /// Points of reference.
    pub n_points: u32,
    /// How often each run is repeated; long ones are run once.
    pub repeats: usize,
    /// Seconds for everything, about: meshes get two thirds of them.
    pub budget: f64,
    /// Pixels of an error map along its longer side.
    pub map_pixels: usize,
    /// Study irradiance with interreflection, not direct irradiance.
    pub interreflection: bool,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self {
            degrees: vec![1, 2, 3, 4],
            meshers: Mesher::ALL.to_vec(),
            tolerances: vec![
                1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6,
            ],
            target: 1e-3,
            n_points: 10_000,
            repeats: 3,
            budget: 180.0,
            map_pixels: 160,
            interreflection: false,
        }
    }
}

/// Who tells the time and the memory.
pub struct Meter<'a> {
    /// Seconds since any fixed moment.
    pub clock: &'a (dyn Fn() -> f64 + Sync),
    /// Bytes that this process takes now, and the most that it took since this was asked
    /// last; zeros where the system does not tell.
    pub memory: &'a (dyn Fn() -> [u64; 2] + Sync),
}

impl std::fmt::Debug for Meter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Meter")
    }
}

/// Exact values at places of reference.
#[derive(Debug)]
pub(crate) struct Reference {
    places: Vec<Place>,
    /// Bands of every place.
    values: Vec<f64>,
    /// Is some of the light hidden there, and some not?
    is_penumbra: Vec<bool>,
    /// Per band.
    peak: Vec<f64>,
    /// Seconds an evaluation, all threads at work.
    seconds: f64,
}

/// Light that is hidden to less than this share is not.
const HIDDEN: f64 = 1e-9;

impl Reference {
    /// Nothing if it was stopped.
    fn new(
        evaluator: &Evaluator<'_>,
        light: &ExactLight<'_, '_>,
        driver: &dyn Light,
        n: u32,
        meter: &Meter<'_>,
        stop: Stop<'_>,
    ) -> Option<Self> {
        let scene = evaluator.scene();
        let lit = |face| driver.reaches(face);
        let places = values::random_places(scene, n, &lit);
        let start = (meter.clock)();
        let n_emitters = evaluator.emitters().len();
        let values = all_values(driver, &places, stop)?;
        let seconds = ((meter.clock)() - start) / places.len().max(1) as f64;
        let is_penumbra: Vec<bool> = places
            .par_iter()
            .map_init(
                || (Scratch::default(), vec![Seen::default(); n_emitters]),
                |(scratch, seen), place| {
                    if stop.is_wanted() {
                        return None;
                    }
                    let view = light.view(place.face);
                    evaluator.factors(view, place.point, None, scratch, seen);
                    let Seen { factor, unoccluded } = seen.iter().copied().sum();
                    let hidden = HIDDEN * unoccluded;
                    Some(factor > hidden && factor < unoccluded - hidden)
                },
            )
            .collect::<Option<_>>()?;
        let n_bands = scene.n_bands;
        let mut peak = vec![0.0f64; n_bands];
        for bands in values.chunks_exact(n_bands.max(1)) {
            for (peak, &v) in peak.iter_mut().zip(bands) {
                *peak = peak.max(v);
            }
        }
        Some(Self {
            places,
            values,
            is_penumbra,
            peak,
            seconds,
        })
    }

    /// The error at every place, of the worst band, relative to its peak; nothing if it was
    /// stopped. A place in no element errs by all that it lacks.
    fn errors_of(&self, mesh: &Solution, stop: Stop<'_>) -> Option<Vec<f64>> {
        let n_bands = self.peak.len().max(1);
        self.places
            .par_iter()
            .zip(self.values.par_chunks(n_bands))
            .map(|(place, exact)| {
                if stop.is_wanted() {
                    return None;
                }
                let found = values::on_mesh(mesh, place);
                Some(worst_band(found.as_deref(), exact, &self.peak))
            })
            .collect()
    }

    /// The errors of a mesh at all places; nothing if it was stopped.
    fn summary_of(&self, mesh: &Solution, stop: Stop<'_>) -> Option<Errors> {
        Some(self.summarise(&self.errors_of(mesh, stop)?))
    }

    fn summarise(&self, errors: &[f64]) -> Errors {
        let sum = |is_wanted: &dyn Fn(usize) -> bool| {
            let (mut max, mut square, mut n) = (0.0f64, 0.0, 0usize);
            for (i, &e) in errors.iter().enumerate().filter(|(i, _)| is_wanted(*i)) {
                debug_assert!(e.is_finite(), "the error at place {i} is {e}");
                max = max.max(e);
                square += e * e;
                n += 1;
            }
            (max, (square / n.max(1) as f64).sqrt())
        };
        let (max, rms) = sum(&|_| true);
        let (penumbra_max, penumbra_rms) = sum(&|i| self.is_penumbra[i]);
        Errors {
            max,
            rms,
            penumbra_max,
            penumbra_rms,
        }
    }
}

/// The bands of a light at one place; nothing if it was stopped.
fn one_value(driver: &dyn Light, place: &Place, stop: Stop<'_>) -> Option<Vec<f64>> {
    if stop.is_wanted() {
        return None;
    }
    let sample = Sample {
        point: place.point,
        toward: None,
    };
    let found = driver.irradiance(place.face, &[sample], 0.0, stop)?;
    Some(found.values)
}

/// The bands of a light at all places; nothing if it was stopped.
fn all_values(driver: &dyn Light, places: &[Place], stop: Stop<'_>) -> Option<Vec<f64>> {
    let values: Option<Vec<Vec<f64>>> = places
        .par_chunks(PLACES)
        .map(|places| {
            let mut values = Vec::with_capacity(places.len() * driver.n_bands());
            for place in places {
                values.extend(one_value(driver, place, stop)?);
            }
            Some(values)
        })
        .collect();
    Some(values?.concat())
}

/// Places that are evaluated together: few, for gathering at one takes long.
const PLACES: usize = 4;

/// The difference of the worst band, relative to its peak.
fn worst_band(found: Option<&[f64]>, exact: &[f64], peak: &[f64]) -> f64 {
    exact
        .iter()
        .zip(peak)
        .enumerate()
        .filter(|(_, (_, peak))| **peak > 0.0)
        .map(|(band, (exact, peak))| {
            let value = found.map_or(0.0, |f| f[band]);
            (value - exact).abs() / peak
        })
        .fold(0.0, f64::max)
}

/// Makes a mesh, or nothing if the setting is out of its reach.
type Make<'a> = Box<dyn Fn(&Control<'_>) -> Result<Option<Solution>, Error> + 'a>;

/// A series under way.
struct Runner<'a> {
    series: Series,
    /// What is asked for, and who makes it; coarse first.
    ladder: std::vec::IntoIter<(String, Make<'a>)>,
    /// Seconds spent.
    spent: f64,
    /// The maps of its runs.
    maps: Vec<maps::RunMap>,
}

/// Elements that no run needs more of.
pub(crate) const MOST_ELEMENTS: usize = 2_000_000;

/// Runs that err by less have reached what coordinates can carry.
const FLOOR: f64 = 1e-11;

/// Runs that take longer than this share of the budget are not repeated.
const SHORT: f64 = 1.0 / 200.0;

/// A run takes about so many times as long as the one before it, at least.
const GROWTH: f64 = 2.0;

impl Runner<'_> {
    /// The next run; whether there may be another.
    fn step(
        &mut self,
        study: &Setting<'_>,
        share: f64,
        control: &Control<'_>,
    ) -> Result<bool, Error> {
        let Some((setting, make)) = self.ladder.next() else {
            "the ladder has no further step".clone_into(&mut self.series.ended);
            return Ok(false);
        };
        let meter = study.meter;
        let mut times = Vec::new();
        let mut mesh = None;
        let mut memory = 0;
        for repeat in 0..study.options.repeats.max(1) {
            // Freed before it is made again, so that memory counts one.
            drop(mesh.take());
            let [before, _] = (meter.memory)();
            let start = (meter.clock)();
            mesh = make(control)?;
            let took = (meter.clock)() - start;
            let [_, most] = (meter.memory)();
            times.push(took);
            if repeat == 0 {
                memory = most.saturating_sub(before);
            }
            if took > SHORT * study.options.budget || control.stop.is_wanted() {
                break;
            }
        }
        self.spent += times.iter().sum::<f64>();
        let Some(mesh) = mesh else {
            "finer settings are out of its reach".clone_into(&mut self.series.ended);
            return Ok(false);
        };
        if mesh.is_stopped() && !control.stop.is_wanted() {
            "there is no room for finer meshes".clone_into(&mut self.series.ended);
            return Ok(false);
        }
        if control.stop.is_wanted() {
            "the study was stopped".clone_into(&mut self.series.ended);
            return Ok(false);
        }
        let stop = control.stop;
        let Some(error) = study.reference.summary_of(&mesh, stop) else {
            "the study was stopped".clone_into(&mut self.series.ended);
            return Ok(false);
        };
        self.maps.push(study.canvas.map(&mesh));
        let last = times.iter().copied().fold(f64::INFINITY, f64::min);
        self.series.runs.push(Run {
            setting,
            elements: mesh.n_elements(),
            nodes: mesh.n_nodes(),
            exact_evaluations: mesh.exact_evaluations(),
            seconds: Spread::of(&times),
            memory_bytes: memory,
            error,
            claimed_error: finite(mesh.measured_max_error),
            on_front: false,
            quality: quality(study.scene, &mesh),
        });
        let expected = GROWTH * last;
        self.series.ended = if error.max <= FLOOR {
            "the error is that of rounding".into()
        } else if error.max <= study.options.tolerances.last().copied().unwrap_or(0.0) {
            "the finest error asked for is reached".into()
        } else if mesh.n_elements() > MOST_ELEMENTS / 2 {
            format!("{} elements are enough", mesh.n_elements())
        } else if self.spent + expected > share {
            format!("the next step would take more than its share of the time ({share:.1} s)")
        } else {
            return Ok(true);
        };
        Ok(false)
    }
}

fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

/// What is studied: a scene, and its light.
pub(crate) struct Subject<'a> {
    pub(crate) scene: &'a Scene,
    /// With interreflection: what is prepared already, and the light that is meshed.
    pub(crate) total: Option<&'a Total<'a>>,
}

/// Light with interreflection.
pub(crate) struct Total<'a> {
    evaluator: &'a Evaluator<'a>,
    light: &'a ExactLight<'a, 'a>,
    driver: TotalLight<'a>,
}

impl Subject<'_> {
    pub(crate) fn mesh(&self, options: &Options, control: &Control<'_>) -> Result<Outcome, Error> {
        match self.total {
            None => mesh(self.scene, options, control),
            Some(t) => mesh_on(t.evaluator, t.light, &t.driver, options, control),
        }
    }
}

/// What all runs of a study share.
struct Setting<'a> {
    scene: &'a Scene,
    options: &'a StudyOptions,
    reference: &'a Reference,
    canvas: &'a maps::Canvas,
    meter: &'a Meter<'a>,
}

/// Runs a study.
///
/// Every generator and degree gets the same share of the time; what it does not need goes
/// to no other, so that series compare. Fields of the result that the library cannot know
/// are empty: title, command, machine.
///
/// # Errors
///
/// [`Error`] if a face cannot be triangulated.
pub fn study(
    scene: &Scene,
    options: &StudyOptions,
    meter: &Meter<'_>,
    control: &Control<'_>,
) -> Result<Study, Error> {
    (control.progress)(Phase::Study, 0.0);
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, control);
    if !options.interreflection {
        let subject = Subject { scene, total: None };
        let known = Known::default();
        return study_of(
            &subject, &evaluator, &light, &light, &known, options, meter, control,
        );
    }
    let begun = (meter.clock)();
    let solutions = solutions(&evaluator, &light, &control.quiet())?;
    let stop = control.stop;
    let [fine, coarse] = &solutions;
    let [of_fine, of_coarse] = [fine, coarse].map(|solved| TotalLight {
        direct: &light,
        gatherer: solved.gatherer(&evaluator, stop),
    });
    if of_fine.gatherer.is_none() || of_coarse.gatherer.is_none() {
        return Ok(nothing(
            TOTAL,
            options,
            if control.stop.is_wanted() {
                "The study was stopped before interreflection was solved: nothing was measured."
            } else {
                "There is no room to solve for interreflection: nothing was measured."
            },
        ));
    }
    let notes = solutions_notes(&solutions);
    let Some(known) = uncertainty(scene, [&of_fine, &of_coarse], notes, stop) else {
        return Ok(nothing(TOTAL, options, NO_REFERENCE));
    };
    let total = Total {
        evaluator: &evaluator,
        light: &light,
        driver: of_fine,
    };
    // What the solutions took is gone.
    let rest = StudyOptions {
        budget: (options.budget - ((meter.clock)() - begun)).max(0.1 * options.budget),
        ..options.clone()
    };
    let subject = Subject {
        scene,
        total: Some(&total),
    };
    study_of(
        &subject,
        &evaluator,
        &light,
        &total.driver,
        &known,
        &rest,
        meter,
        control,
    )
}

/// A study without any run.
fn nothing(quantity: &str, options: &StudyOptions, why: &str) -> Study {
    Study {
        quantity: quantity.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        target: options.target,
        advice: why.into(),
        ..Study::default()
    }
}

/// Why there is none.
const NO_REFERENCE: &str =
    "The study was stopped before the values of reference were known: nothing was measured.";

/// What is known of the values of reference.
#[derive(Debug, Default)]
struct Known {
    uncertainty: Option<f64>,
    notes: Vec<String>,
}

/// Nodes of the layers that indirect light is gathered from, and that its uncertainty is
/// told by. More would make every evaluation dearer, and say no more about meshes.
const LAYERS: [usize; 2] = [2500, 900];

/// The scene solved twice: as well as it can be, and with fewer nodes.
fn solutions(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    control: &Control<'_>,
) -> Result<[Radiosity; 2], Error> {
    let options = |most_nodes| Options {
        radiosity: RadiosityOptions {
            most_nodes,
            ..RadiosityOptions::default()
        },
        ..Options::default()
    };
    let [fine, coarse] = LAYERS.map(options);
    let fine = radiosity_on(evaluator, light, &fine, control)?;
    let coarse = radiosity_on(evaluator, light, &coarse, control)?;
    Ok([fine, coarse])
}

fn solutions_notes([fine, coarse]: &[Radiosity; 2]) -> Vec<String> {
    vec![
        format!(
            "Values of reference are exact direct irradiance and indirect irradiance gathered with exact visibility from one solution with {} nodes; nodes of all meshes hold such values, so errors are those of the meshes. The solution took part in no time.",
            fine.indirect_nodes
        ),
        format!(
            "The uncertainty is the largest difference to what is gathered from a solution with {} nodes, at 200 places.",
            coarse.indirect_nodes
        ),
        "Evaluations are those of direct light and of gathering, together.".into(),
    ]
}

/// How far two solutions are apart, relative to the peak; nothing if it was stopped.
fn uncertainty(
    scene: &Scene,
    [fine, coarse]: [&TotalLight<'_>; 2],
    notes: Vec<String>,
    stop: Stop<'_>,
) -> Option<Known> {
    let places = values::random_places(scene, 200, &|_| true);
    let a = all_values(fine, &places, stop)?;
    let b = all_values(coarse, &places, stop)?;
    let peak = a.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
    Some(Known {
        uncertainty: Some(apart.fold(0.0, f64::max) / peak),
        notes,
    })
}

/// Studies a light: `driver` is what is meshed, `light` its direct part.
fn study_of(
    subject: &Subject<'_>,
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    driver: &dyn Light,
    known: &Known,
    options: &StudyOptions,
    meter: &Meter<'_>,
    control: &Control<'_>,
) -> Result<Study, Error> {
    let scene = subject.scene;
    let quantity = if subject.total.is_some() {
        TOTAL
    } else {
        DIRECT
    };
    let stop = control.stop;
    let n = options.n_points;
    let reference = Reference::new(evaluator, light, driver, n, meter, stop);
    let found = reference.and_then(|reference| {
        let canvas = maps::Canvas::new(driver, scene, &reference, options.map_pixels, stop)?;
        Some((reference, canvas))
    });
    let Some((reference, canvas)) = found else {
        return Ok(nothing(quantity, options, NO_REFERENCE));
    };
    let setting = Setting {
        scene,
        options,
        reference: &reference,
        canvas: &canvas,
        meter,
    };
    let mut runners = rival::runners(subject, options);
    let start = (meter.clock)();
    let share = MESHING * options.budget / runners.len().max(1) as f64;
    let mut is_going = vec![true; runners.len()];
    // All coarse runs before all finer ones: a study that is stopped has all series.
    while is_going.iter().any(|&g| g) && !control.stop.is_wanted() {
        for (k, runner) in runners.iter_mut().enumerate() {
            if !is_going[k] || control.stop.is_wanted() {
                continue;
            }
            is_going[k] = runner.step(&setting, share, &control.quiet())?;
            let done = runners_done(&is_going);
            let spent = ((meter.clock)() - start) / (MESHING * options.budget);
            (control.progress)(Phase::Study, done.max(spent.min(1.0)) * MESHING);
        }
    }
    let runs_seconds = (meter.clock)() - start;
    let mut study = Study {
        target: options.target,
        quantity: quantity.into(),
        unit: scene.quantity.irradiance_unit().into(),
        version: env!("CARGO_PKG_VERSION").into(),
        peak: reference.peak.iter().copied().fold(0.0, f64::max),
        n_points: reference.places.len(),
        n_penumbra: reference.is_penumbra.iter().filter(|&&p| p).count(),
        reference_uncertainty: known.uncertainty.unwrap_or(ROUNDING),
        exact_seconds: reference.seconds,
        ..Study::default()
    };
    let maps: Vec<Vec<maps::RunMap>> = runners
        .iter_mut()
        .map(|r| std::mem::take(&mut r.maps))
        .collect();
    study.series = runners.into_iter().map(|r| r.series).collect();
    // What comes after is left out where it would take too long, and the notes say so.
    let is_late = |share: f64| (meter.clock)() - start > share * options.budget;
    let mut left_out = Vec::new();
    let [by_estimators, by_orders, by_steps] =
        [0.8, 0.9, 1.0].map(|share| move || is_late(share) || control.stop.is_wanted());
    let until = |is_late| Control {
        stop: Stop::new(is_late),
        ..control.quiet()
    };
    study.estimators = rival::effectivities(scene, driver, evaluator, &until(&by_estimators))?;
    if by_estimators() {
        left_out.push("some estimators");
    }
    (control.progress)(Phase::Study, 0.8);
    mark_front(&mut study);
    for series in &mut study.series {
        let of = |error: fn(&Run) -> f64| -> Vec<(usize, f64)> {
            series.runs.iter().map(|r| (r.elements, error(r))).collect()
        };
        series.order_rms = observed_order(&of(|r| r.error.rms), FLOOR);
        series.order_max = observed_order(&of(|r| r.error.max), FLOOR);
        if series.mesher == Mesher::Discontinuity.key() {
            let found = rival::halvings(subject, series.degree, &reference, &until(&by_orders))?;
            let of = |error: fn(&Errors) -> f64| -> Vec<(usize, f64)> {
                found.iter().map(|(n, e)| (*n, error(e))).collect()
            };
            let (rms, max) = (
                observed_order(&of(|e| e.rms), FLOOR),
                observed_order(&of(|e| e.max), FLOOR),
            );
            series.order_rms = rms.or(series.order_rms);
            series.order_max = max.or(series.order_max);
        }
    }
    if by_orders() {
        left_out.push("some orders of the discontinuity mesh, which are those of its runs then");
    }
    (control.progress)(Phase::Study, 0.9);
    study.steps = rival::steps(subject, &reference, &until(&by_steps))?;
    if by_steps() {
        left_out.push("some steps after meshing");
    }
    study.maps = canvas.groups(&study, &maps);
    study.advice = advice(&study);
    study.notes = notes(
        &study,
        options,
        share,
        runs_seconds,
        control.stop.is_wanted(),
    );
    study.notes.extend_from_slice(&known.notes);
    if !left_out.is_empty() {
        let words = left_out.join("; ");
        study
            .notes
            .push(format!("Left out for want of time: {words}."));
    }
    (control.progress)(Phase::Study, 1.0);
    Ok(study)
}

/// What is studied by default.
const DIRECT: &str = "direct irradiance";

/// What is studied with `--interreflection`.
const TOTAL: &str = "irradiance with interreflection";

/// What exact values may be off by, relative to the peak (`docs/numerics.md`).
const ROUNDING: f64 = 1e-13;

/// The share of a study's time that making meshes has.
const MESHING: f64 = 0.67;

fn runners_done(is_going: &[bool]) -> f64 {
    let n_done = is_going.iter().filter(|g| !**g).count();
    n_done as f64 / is_going.len().max(1) as f64
}

fn mark_front(study: &mut Study) {
    let all: Vec<(f64, f64)> = study
        .series
        .iter()
        .flat_map(|s| &s.runs)
        .map(|r| (r.seconds.median, r.error.rms))
        .collect();
    let front = pareto_front(&all);
    let runs = study.series.iter_mut().flat_map(|s| &mut s.runs);
    for (run, on_front) in runs.zip(front) {
        run.on_front = on_front;
    }
}

/// Shapes of all elements of a mesh: ratios of inscribed to circumscribed radius (1 for an
/// equilateral triangle and a square), the smallest angle in degrees, T-vertices, elements
/// per area in the square of the file's length unit. Without elements all are 0.
#[must_use]
pub fn quality(scene: &Scene, mesh: &Solution) -> Quality {
    let mut ratios = Vec::new();
    let mut quality = Quality {
        smallest_angle: 180.0,
        t_vertices: mesh.n_t_vertices(),
        ..Quality::default()
    };
    let elements = mesh.receivers.iter();
    let elements = elements.flat_map(|r| (0..r.n_elements()).map(move |e| (r, e)));
    for (receiver, element) in elements {
        let (corners, n) = receiver.corners(element);
        let ratio = receiver.shape_quality(element);
        ratios.push(ratio);
        for k in 0..n {
            let [a, b, c] = [corners[(k + n - 1) % n], corners[k], corners[(k + 1) % n]];
            let (p, q) = (c - b, a - b);
            let angle = p.perp_dot(q).atan2(p.dot(q)).to_degrees();
            quality.smallest_angle = quality.smallest_angle.min(angle);
        }
        quality.histogram[((10.0 * ratio) as usize).min(9)] += 1;
    }
    if ratios.is_empty() {
        quality.smallest_angle = 0.0;
    }
    ratios.sort_by(f64::total_cmp);
    quality.min = ratios.first().copied().unwrap_or(0.0);
    quality.median = ratios.get(ratios.len() / 2).copied().unwrap_or(0.0);
    let area: f64 = scene.face_ids().map(|f| scene.face(f).area).sum();
    if area > 0.0 {
        quality.density = ratios.len() as f64 / scene.frame.area_to_file(area);
    }
    quality
}

/// What to choose, and how much the next best costs.
fn advice(study: &Study) -> String {
    let target = study.target;
    if study.peak <= 0.0 {
        return "No light reaches any surface of this scene: every mesh is exact.".into();
    }
    // The cheapest run of every series that is good enough.
    let mut best: Vec<(&Series, &Run)> = study
        .series
        .iter()
        .filter_map(|s| {
            s.runs
                .iter()
                .filter(|r| r.error.max <= target)
                .min_by(|a, b| a.seconds.median.total_cmp(&b.seconds.median))
                .map(|r| (s, r))
        })
        .collect();
    best.sort_by(|a, b| a.1.seconds.median.total_cmp(&b.1.seconds.median));
    let Some(&(series, run)) = best.first() else {
        let closest = study
            .series
            .iter()
            .flat_map(|s| s.runs.iter().map(move |r| (s, r)))
            .min_by(|a, b| a.1.error.max.total_cmp(&b.1.error.max));
        return match closest {
            Some((s, r)) => format!(
                "Within the time of this study nothing came within {target:e} of the peak \
                 everywhere; `--mesher {} --degree {}` came closest, with {:.1e} ({}).",
                s.mesher, s.degree, r.error.max, r.setting
            ),
            None => "Nothing was measured.".into(),
        };
    };
    let mut words = format!(
        "For errors of at most {target:e} of the peak take `--mesher {} --degree {}` ({}): \
         {} elements, {} exact evaluations, {}",
        series.mesher,
        series.degree,
        run.setting,
        run.elements,
        run.exact_evaluations,
        duration(run.seconds.median),
    );
    let other = best.iter().find(|(s, _)| s.mesher != series.mesher);
    match other {
        Some((s, r)) => {
            words.push_str(&format!(
                "; the best other generator, {} at degree {}, takes {:.1} times as long and {:.1} times the evaluations.",
                s.mesher,
                s.degree,
                r.seconds.median / run.seconds.median,
                r.exact_evaluations as f64 / run.exact_evaluations.max(1) as f64
            ));
        }
        None => words.push_str("; no other generator came that close in its time and with elements down to 1/1024 of their receivers."),
    }
    let ours = best.iter().find(|(s, _)| s.mesher == "discontinuity");
    if series.mesher != "discontinuity" {
        match ours {
            Some((s, r)) => words.push_str(&format!(
                " The discontinuity mesh (degree {}) takes {:.1} times as long here: {}.",
                s.degree,
                r.seconds.median / run.seconds.median,
                if r.exact_evaluations < run.exact_evaluations {
                    "it saves evaluations, but finding the curves takes longer than they do"
                } else {
                    "its lines cost more elements than they save at this tolerance"
                }
            )),
            None => words.push_str(" The discontinuity mesh did not come that close."),
        }
    }
    let alone = run.seconds.median / study.exact_seconds.max(1e-300);
    let probe = if study.quantity == DIRECT {
        "`probe --exact`"
    } else {
        "`probe --solve`"
    };
    words.push_str(&format!(
        " Who needs the values at fewer than {} points needs no mesh: {probe} is faster.",
        round_to_two(alone)
    ));
    words
}

fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        format!("{:.1} ms", 1e3 * seconds)
    } else {
        format!("{seconds:.2} s")
    }
}

/// Two digits are all that is known.
fn round_to_two(x: f64) -> f64 {
    if x < 1.0 {
        return 1.0;
    }
    let unit = 10f64.powi((x.log10().floor() as i32 - 1).max(0));
    (x / unit).round() * unit
}

fn notes(
    study: &Study,
    options: &StudyOptions,
    share: f64,
    seconds: f64,
    is_stopped: bool,
) -> Vec<String> {
    let mut notes = vec![
        format!(
            "Every generator and degree had {share:.1} s; all runs together took {seconds:.0} s. Runs of more than {:.2} s were made once, the others {} times.",
            SHORT * options.budget,
            options.repeats
        ),
        "Times are those of the whole job from the scene: preparation, events, mesh, exact values, check points. They do not include the comparison.".into(),
        "Memory is what the process took at most during the first run of a setting, above what it had before; what the allocator kept from earlier runs is not counted again.".into(),
        "Orders of the discontinuity mesh are those of the mesh of all curves, whose elements are split into four again and again; of the others, those of their runs.".into(),
        "Quadtrees follow the measured error; the adaptive mesh follows the difference of neighbours, as published (Cohen et al. 1986). All of them measure their error before they end, and that is in their times.".into(),
        "Places on no element err by their whole value.".into(),
    ];
    if study.n_penumbra == 0 {
        notes.push(
            "At no point of reference is light hidden in part: errors in penumbras are 0.".into(),
        );
    }
    if is_stopped {
        notes.push("The study was stopped before its end.".into());
    }
    notes
}
