//! What a study runs: the ladders of all generators, estimators, steps after meshing.

use super::{MOST_ELEMENTS, Make, Reference, Runner, StudyOptions, Subject};
use crate::cell_meshes::cell_meshes_for;
use crate::options::{
    CellOptions, CellSize, CurveOptions, Events, Generator, MOST_STEPS, Mesher, Options,
};
use crate::outcome::Error;
use antumbra_geom::Control;
use antumbra_io::study::{Effectivity, Errors, Series, Step};
use antumbra_mesh::cells::CellShape;
use antumbra_scene::Scene;
use antumbra_solver::cells::Estimator;
use antumbra_solver::{AfterStep, Light, Tolerance};
use antumbra_visibility::{Evaluator, EventKinds};

/// All series, with their ladders.
pub(crate) fn runners<'a>(subject: &'a Subject<'a>, options: &'a StudyOptions) -> Vec<Runner<'a>> {
    let mut runners = Vec::new();
    for &mesher in &options.meshers {
        for &degree in &options.degrees {
            let ladder = ladder(subject, options, mesher, degree);
            runners.push(Runner {
                series: Series {
                    mesher: mesher.key().to_owned(),
                    degree,
                    ..Series::default()
                },
                ladder: ladder.into_iter(),
                spent: 0.0,
                maps: Vec::new(),
            });
        }
    }
    runners
}

/// Elements from step to step of a ladder of sizes.
const STEP: f64 = 1.6;

/// Elements of the coarsest mesh that is driven by a number of them.
const FEWEST: usize = 16;

fn ladder<'a>(
    subject: &'a Subject<'a>,
    options: &'a StudyOptions,
    mesher: Mesher,
    degree: u8,
) -> Vec<(String, Make<'a>)> {
    let tolerances = options.tolerances.iter().copied();
    match mesher {
        Mesher::Discontinuity => tolerances
            .map(|tolerance| {
                let make: Make<'a> = Box::new(move |control| {
                    let options = discontinuity(degree, tolerance, CurveOptions::default());
                    Ok(Some(subject.mesh(&options, control)?.mesh))
                });
                (format!("tolerance {tolerance:e}"), make)
            })
            .collect(),
        Mesher::Uniform | Mesher::Graded => (0..)
            .map(|k: i32| (FEWEST as f64 * STEP.powi(k)) as usize)
            .take_while(|n| *n < MOST_ELEMENTS)
            .map(|n| {
                let tolerance = Options::default().tolerance;
                let cells = cells(mesher, CellSize::Elements(n));
                let name = format!("{n} elements");
                cell_step(subject, name, cell_options(degree, tolerance, cells))
            })
            .collect(),
        Mesher::Quadtree | Mesher::Restricted | Mesher::TriQuadtree | Mesher::Adaptive => {
            tolerances
                .map(|t| {
                    let tolerance = Tolerance::Relative(t);
                    let cells = cells(mesher, CellSize::Tolerance);
                    let name = format!("tolerance {t:e}");
                    cell_step(subject, name, cell_options(degree, tolerance, cells))
                })
                .collect()
        }
    }
}

fn cell_step<'a>(subject: &'a Subject<'a>, name: String, options: Options) -> (String, Make<'a>) {
    let make: Make<'a> = Box::new(move |control| Ok(Some(subject.mesh(&options, control)?.mesh)));
    (name, make)
}

fn cells(mesher: Mesher, size: CellSize) -> CellOptions {
    CellOptions {
        mesher,
        size,
        // As it was published; the quadtrees follow the measured error, which is the best
        // that can be done for them.
        estimator: match mesher {
            Mesher::Adaptive => Estimator::Neighbours,
            _ => Estimator::Measured,
        },
        ..CellOptions::default()
    }
}

fn cell_options(degree: u8, tolerance: Tolerance, cells: CellOptions) -> Options {
    Options {
        tolerance,
        degree: Some(degree),
        most_elements: MOST_ELEMENTS,
        ..Options::with_cells(cells)
    }
}

fn discontinuity(degree: u8, tolerance: f64, curves: CurveOptions) -> Options {
    Options {
        tolerance: Tolerance::Relative(tolerance),
        degree: Some(degree),
        generator: Generator::Curves(curves),
        most_elements: MOST_ELEMENTS,
        ..Options::default()
    }
}

/// Halvings of the mesh of all curves, for the order of convergence: errors of the meshes.
///
/// Tolerances make elements smaller where errors are, at different places each time; the
/// order is that of a mesh whose elements all become smaller alike.
pub(crate) fn halvings(
    subject: &Subject<'_>,
    degree: u8,
    reference: &Reference,
    control: &Control<'_>,
) -> Result<Vec<(usize, Errors)>, Error> {
    let mut found = Vec::new();
    for k in 0..=MOST_STEPS {
        let curves = CurveOptions {
            events: Events::Kinds(EventKinds::ALL),
            after: std::array::from_fn(|i| (i < k).then_some(AfterStep::Halve)),
        };
        let options = discontinuity(degree, COARSE, curves);
        let mesh = subject.mesh(&options, control)?.mesh;
        if control.stop.is_wanted() {
            break;
        }
        let n = mesh.n_elements();
        // Where irradiance has no value, halving does not lower the error, and is taken back.
        if found.last().is_some_and(|&(before, _)| n < 3 * before) {
            break;
        }
        let Some(errors) = reference.summary_of(&mesh, control.stop) else {
            break;
        };
        found.push((n, errors));
        if n > MOST_HALVED {
            break;
        }
    }
    Ok(found)
}

/// So coarse that only the curves make elements.
const COARSE: f64 = 0.9;

/// Meshes with more elements are not halved again.
const MOST_HALVED: usize = 20_000;

/// Meshes that estimators are tried on: those of a middling size.
const ESTIMATED: [(Mesher, CellShape, u8); 6] = [
    (Mesher::Uniform, CellShape::Quadrilaterals, 1),
    (Mesher::Uniform, CellShape::Triangles, 1),
    (Mesher::Uniform, CellShape::Triangles, 2),
    (Mesher::Restricted, CellShape::Quadrilaterals, 1),
    (Mesher::Restricted, CellShape::Mixed, 2),
    (Mesher::Restricted, CellShape::Mixed, 3),
];

/// Their number of elements.
const ESTIMATED_ELEMENTS: usize = 600;

/// Points along a side of an element at which its true error is looked for.
const TRUE_POINTS: usize = 5;

/// What estimators say of the errors.
pub(crate) fn effectivities(
    scene: &Scene,
    driver: &dyn Light,
    evaluator: &Evaluator<'_>,
    control: &Control<'_>,
) -> Result<Vec<Effectivity>, Error> {
    let stop = control.stop;
    let mut rows = Vec::new();
    for (mesher, shape, degree) in ESTIMATED {
        if stop.is_wanted() {
            return Ok(rows);
        }
        let cells = CellOptions {
            shape,
            ..cells(mesher, CellSize::Elements(ESTIMATED_ELEMENTS))
        };
        let options = cell_options(degree, Options::default().tolerance, cells);
        let label = format!(
            "{mesher} {}, degree {degree}",
            match shape {
                CellShape::Triangles => "triangles",
                CellShape::Quadrilaterals => "quadrilaterals",
                CellShape::Mixed => "mixed",
            }
        );
        for estimator in Estimator::ALL {
            // Each on a mesh of its own, for points that are known cost nothing.
            let (mut meshes, _) = cell_meshes_for(evaluator, driver, &options, &cells, control)?;
            let Some(truth) = meshes.true_errors(TRUE_POINTS, driver, stop) else {
                break;
            };
            let before = meshes.check_evaluations();
            let Some(estimates) = meshes.estimates(estimator, driver, stop) else {
                break;
            };
            let evaluations = meshes.check_evaluations() - before;
            rows.push(effectivity(
                &label,
                estimator,
                &truth,
                &estimates,
                scene.n_bands,
                evaluations,
            ));
        }
    }
    Ok(rows)
}

/// Compares estimates with true errors: of every receiver, bands of every element.
fn effectivity(
    mesh: &str,
    estimator: Estimator,
    truth: &[Vec<f64>],
    estimates: &[Vec<f64>],
    n_bands: usize,
    evaluations: u64,
) -> Effectivity {
    // The worst band of every element in the light, both of the same band.
    let pairs: Vec<(f64, f64)> = truth
        .iter()
        .zip(estimates)
        .flat_map(|(t, e)| t.chunks_exact(n_bands).zip(e.chunks_exact(n_bands)))
        .filter_map(|(t, e)| {
            let worst = |a: &(usize, &f64), b: &(usize, &f64)| a.1.total_cmp(b.1);
            let (band, &error) = t.iter().enumerate().max_by(worst)?;
            Some((error, e[band]))
        })
        .collect();
    let most = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).fold(0.0, f64::max);
    let (largest, estimated) = (most(|p| p.0), most(|p| p.1));
    // Where there is no error to speak of, a ratio means nothing.
    let counted: Vec<(f64, f64)> = pairs
        .iter()
        .copied()
        .filter(|p| p.0 > NEGLIGIBLE * largest)
        .collect();
    let mut ratios: Vec<f64> = counted.iter().map(|(t, e)| e / t).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let last = ratios.len().saturating_sub(1);
        ratios
            .get((share * last as f64).round() as usize)
            .copied()
            .unwrap_or(0.0)
    };
    let n_below = counted.iter().filter(|(t, e)| t > e).count();
    Effectivity {
        mesh: mesh.to_owned(),
        estimator: estimator.key().to_owned(),
        elements: pairs.len(),
        of_max: if largest > 0.0 {
            estimated / largest
        } else {
            0.0
        },
        median: at(0.5),
        low: at(0.1),
        high: at(0.9),
        below: n_below as f64 / counted.len().max(1) as f64,
        correlation: rank_correlation(&counted),
        evaluations,
    }
}

/// Errors below this share of the largest are not estimated, but nothing.
const NEGLIGIBLE: f64 = 1e-3;

/// Spearman's: the correlation of the places in both orders.
fn rank_correlation(pairs: &[(f64, f64)]) -> f64 {
    let ranks = |of: fn(&(f64, f64)) -> f64| {
        let mut order: Vec<usize> = (0..pairs.len()).collect();
        order.sort_by(|&a, &b| of(&pairs[a]).total_cmp(&of(&pairs[b])));
        let mut ranks = vec![0.0; pairs.len()];
        for (rank, i) in order.into_iter().enumerate() {
            ranks[i] = rank as f64;
        }
        ranks
    };
    let (a, b) = (ranks(|p| p.0), ranks(|p| p.1));
    let middle = (pairs.len().max(1) - 1) as f64 / 2.0;
    let product: f64 = a
        .iter()
        .zip(&b)
        .map(|(a, b)| (a - middle) * (b - middle))
        .sum();
    let square: f64 = a.iter().map(|a| (a - middle).powi(2)).sum();
    if square > 0.0 { product / square } else { 0.0 }
}

/// Tolerances of the meshes that steps are applied to.
const STEPPED: [f64; 2] = [2e-2, 2e-3];

/// What steps after meshing do.
pub(crate) fn steps(
    subject: &Subject<'_>,
    reference: &Reference,
    control: &Control<'_>,
) -> Result<Vec<Step>, Error> {
    let stop = control.stop;
    let mut rows = Vec::new();
    let contacts = Events::Kinds(EventKinds::NONE);
    for (events, name) in [
        (Events::OnDemand, "discontinuity"),
        (contacts, "contacts and refinement alone"),
    ] {
        for tolerance in STEPPED {
            let mut curves = CurveOptions {
                events,
                ..CurveOptions::default()
            };
            let options = discontinuity(2, tolerance, curves);
            let before = subject.mesh(&options, control)?.mesh;
            let Some(errors) = reference.summary_of(&before, stop) else {
                return Ok(rows);
            };
            for step in [AfterStep::Relocate, AfterStep::Split, AfterStep::Elevate] {
                if stop.is_wanted() {
                    return Ok(rows);
                }
                curves.after[0] = Some(step);
                let options = discontinuity(2, tolerance, curves);
                let meshed = subject.mesh(&options, control)?;
                if stop.is_wanted() {
                    return Ok(rows);
                }
                let after = &meshed.mesh;
                let Some(errors_after) = reference.summary_of(after, stop) else {
                    return Ok(rows);
                };
                rows.push(Step {
                    mesh: format!("{name}, degree 2, tolerance {tolerance:e}"),
                    step: step.key().to_owned(),
                    before: errors,
                    after: errors_after,
                    elements: [before.n_elements(), after.n_elements()],
                    evaluations: [before.exact_evaluations(), after.exact_evaluations()],
                    reason: meshed
                        .improvements
                        .first()
                        .and_then(|i| i.reason)
                        .map(str::to_owned),
                });
            }
        }
    }
    Ok(rows)
}
