//! The mesh generators, and how those that know nothing of shadows are set up.

use crate::light::ExactLight;
use crate::pipeline::{
    Control, Error, Options, Phase, Solved, contact_radius, hot_spots, solve_on,
};
use antumbra_geom::{Chart, Stop, bounding_box, distance_to_segment, distance_to_segment_in_space};
use antumbra_mesh::cells::{CellForest, CellShape, Rule, graded, uniform};
use antumbra_mesh::{MeshError, cells_of_corners};
use antumbra_scene::{FaceId, Scene};
use antumbra_solver::cells::{
    CellDirectOptions, CellEnded, CellGoal, CellMeshes, CellReceiver, CellRefinement, CellSolution,
    Estimator, Other,
};
use antumbra_solver::{Gatherer, Light, RadiosityOptions, Sample, Tolerance};
use antumbra_visibility::{Approach, Evaluator, EventKind, EventKinds, critical_curves_until};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// How meshes are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mesher {
    /// Elements of one size everywhere; refined by halving the size of whole receivers.
    Uniform,
    /// Elements smaller near edges, contacts and emitters ([`CellOptions::grading`]);
    /// refined by halving all sizes of a receiver.
    Graded,
    /// A quadtree with any number of T-vertices, at which irradiance has cracks.
    Quadtree,
    /// A quadtree whose neighbours differ by one level at most; continuous.
    Restricted,
    /// The same with T-vertices resolved by triangles (Baum et al. 1991).
    TriQuadtree,
    /// Substructuring (Cohen et al. 1986): elements out of tolerance are split; after a
    /// solve, irradiance with interreflection is what is kept within it.
    Adaptive,
    /// Along the shadow boundaries: [`mesh`](crate::mesh()).
    Discontinuity,
}

impl Mesher {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Uniform,
        Self::Graded,
        Self::Quadtree,
        Self::Restricted,
        Self::TriQuadtree,
        Self::Adaptive,
        Self::Discontinuity,
    ];

    /// The name in options and reports.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Graded => "graded",
            Self::Quadtree => "quadtree",
            Self::Restricted => "restricted",
            Self::TriQuadtree => "tri-quadtree",
            Self::Adaptive => "adaptive",
            Self::Discontinuity => "discontinuity",
        }
    }

    /// The generator of this name.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.key() == key)
    }
}

impl std::fmt::Display for Mesher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.key())
    }
}

/// How fine meshes of cells become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellSize {
    /// As fine as the tolerance asks for.
    Tolerance(Tolerance),
    /// Elements of this size, in the unit of the file; graded meshes have it where they
    /// are coarsest. Meshes that follow the error get as many elements as the uniform one
    /// of this size has.
    Length(f64),
    /// About so many elements in all, on surfaces that light reaches.
    Elements(usize),
}

/// How to mesh with cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellOptions {
    /// The generator; not [`Mesher::Discontinuity`], which has
    /// [`Options`].
    pub mesher: Mesher,
    /// Triangles, quadrilaterals, or both. [`Mesher::TriQuadtree`] of quadrilaterals has
    /// triangles too, where sizes change.
    pub shape: CellShape,
    /// Degree of the elements, 1 to 4; `None` chooses by the tolerance.
    pub degree: Option<u8>,
    /// How fine.
    pub size: CellSize,
    /// What refinement follows.
    pub estimator: Estimator,
    /// Elements are not made smaller than this fraction of their receiver's diagonal.
    pub least_size: f64,
    /// No more elements than this.
    pub most_elements: usize,
    /// Of graded meshes, the finest size relative to the coarsest, from 0 to 1.
    ///
    /// The size wanted at a distance d from the nearest edge of the receiver's border,
    /// surface that touches it, or emitter, is `size · max(grading, min(1, d / r))`, with r
    /// a quarter of the receiver's diagonal.
    pub grading: f64,
}

impl Default for CellOptions {
    fn default() -> Self {
        Self {
            mesher: Mesher::Adaptive,
            shape: CellShape::Mixed,
            degree: None,
            size: CellSize::Tolerance(Tolerance::Relative(1e-3)),
            estimator: Estimator::Measured,
            least_size: 1.0 / 1024.0,
            most_elements: 1_000_000,
            grading: 0.125,
        }
    }
}

impl CellOptions {
    /// The degree used: as for the discontinuity mesh.
    #[must_use]
    pub fn chosen_degree(&self) -> u8 {
        let tolerance = match self.size {
            CellSize::Tolerance(tolerance) => tolerance,
            CellSize::Length(_) | CellSize::Elements(_) => Tolerance::Relative(1e-3),
        };
        crate::Options {
            tolerance,
            degree: self.degree,
            ..crate::Options::default()
        }
        .chosen_degree()
    }

    fn refinement(&self) -> CellRefinement {
        match self.mesher {
            Mesher::Uniform | Mesher::Graded => CellRefinement::Whole,
            _ => CellRefinement::Marked,
        }
    }

    fn rule(&self) -> Rule {
        match self.mesher {
            Mesher::Quadtree => Rule::Plain,
            Mesher::TriQuadtree => Rule::Triangulated,
            _ => Rule::Restricted,
        }
    }
}

/// What kept elements from being as small, or as many, as was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeLimit {
    /// More elements than [`CellOptions::most_elements`]: only the mesh that refinement
    /// begins with was made.
    MostElements {
        /// Elements asked for, about.
        asked: usize,
        /// Elements allowed.
        most: usize,
    },
    /// Elements smaller than [`CellOptions::least_size`] on some receivers.
    LeastSize {
        /// The size that was asked for, or that as many elements have; file units.
        asked: f64,
        /// The largest size made instead; file units.
        made: f64,
        /// Receivers on which it is larger than was asked for.
        n_receivers: usize,
        /// Receivers that light reaches.
        n_lit: usize,
        /// Allowed, relative to a receiver's diagonal.
        least: f64,
    },
    /// More elements than there are when all that err are of [`CellOptions::least_size`].
    FewerElements {
        /// Elements asked for, about.
        asked: usize,
        /// Elements made.
        made: usize,
        /// Allowed, relative to a receiver's diagonal.
        least: f64,
    },
}

impl SizeLimit {
    /// One sentence; `unit` is the symbol of the file's unit of length.
    #[must_use]
    pub fn message(&self, unit: &str) -> String {
        match self {
            Self::MostElements { asked, most } => format!(
                "about {asked} elements are asked for and {most} are allowed: only the coarsest mesh was made"
            ),
            Self::LeastSize {
                asked,
                made,
                n_receivers,
                n_lit,
                least,
            } => format!(
                "what is asked for takes elements of {asked:.2e} {unit}, and on {n_receivers} of {n_lit} surfaces in the light they are larger, up to {made:.2e} {unit}: none is made smaller than {least} of its surface's diagonal"
            ),
            Self::FewerElements { asked, made, least } => format!(
                "about {asked} elements are asked for and {made} were made: none is made smaller than {least} of its surface's diagonal"
            ),
        }
    }
}

/// A scene meshed with cells.
#[derive(Debug)]
pub struct CellMeshed {
    /// One mesh per face of the scene, in their order.
    pub direct: CellSolution,
    /// The generator.
    pub mesher: Mesher,
    /// Why elements are not as small as was asked for.
    pub limit: Option<SizeLimit>,
}

/// Meshes a scene with cells, with exact direct irradiance at the nodes.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
///
/// # Panics
///
/// If the mesher is [`Mesher::Discontinuity`].
pub fn mesh_cells(
    scene: &Scene,
    options: &CellOptions,
    control: &Control<'_>,
) -> Result<CellMeshed, Error> {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new_until(&evaluator, control.stop());
    let (meshes, limit) = cell_meshes_for(&evaluator, &light, options, control)?;
    Ok(CellMeshed {
        direct: meshes.finish(),
        mesher: options.mesher,
        limit,
    })
}

/// A scene solved on meshes of cells.
#[derive(Debug)]
pub struct CellSolved {
    /// One mesh per face of the scene, in their order, with `irradiance` on the nodes
    /// unless there was no time for it.
    pub cells: CellSolution,
    /// The generator.
    pub mesher: Mesher,
    /// Why elements are not as small as was asked for.
    pub limit: Option<SizeLimit>,
    /// The radiosities of the patches that irradiance was gathered from, on a mesh of
    /// their own.
    pub patches: Solved,
}

/// Meshes a scene with cells, with exact direct irradiance and gathered indirect
/// irradiance at the nodes.
///
/// The radiosity of patches is solved for first, as [`solve`](crate::solve) does. Then
/// every node gathers from the patches with exact visibility. [`Mesher::Adaptive`] splits
/// elements until irradiance *with* interreflection is within the tolerance, and what is
/// new gathers from the old radiosities; the others follow direct light.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
///
/// # Panics
///
/// If the mesher is [`Mesher::Discontinuity`].
///
/// # Source
///
/// Patches and elements: Cohen, Greenberg, Immel & Brock 1986.
pub fn solve_cells(
    scene: &Scene,
    options: &CellOptions,
    radiosity: &RadiosityOptions,
    control: &Control<'_>,
) -> Result<CellSolved, Error> {
    (control.progress)(Phase::Events, 0.0);
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new_until(&evaluator, control.stop());
    let patches = Options {
        tolerance: match options.size {
            CellSize::Tolerance(tolerance) => tolerance,
            CellSize::Length(_) | CellSize::Elements(_) => Options::default().tolerance,
        },
        radiosity: *radiosity,
        ..Options::default()
    };
    let patches = solve_on(&evaluator, &light, &patches, control)?;
    let gatherer = patches.radiosity.gatherer(&evaluator, control.stop());
    let total = TotalLight {
        direct: &light,
        gatherer,
    };
    let is_total = options.mesher == Mesher::Adaptive && total.gatherer.is_some();
    let driver: &dyn Light = if is_total { &total } else { &light };
    let (meshes, limit) = cell_meshes_for(&evaluator, driver, options, control)?;
    let other = if is_total {
        Other::Direct(&light)
    } else {
        Other::Total(&total)
    };
    let cells = if total.gatherer.is_some() {
        meshes.finish_solved(other, control.stop())
    } else {
        meshes.finish()
    };
    drop(total);
    Ok(CellSolved {
        cells,
        mesher: options.mesher,
        limit,
        patches,
    })
}

/// Direct light and what is gathered from a solution.
pub(crate) struct TotalLight<'a> {
    pub(crate) direct: &'a ExactLight<'a, 'a>,
    pub(crate) gatherer: Option<Gatherer<'a, 'a, 'a>>,
}

impl Light for TotalLight<'_> {
    fn n_bands(&self) -> usize {
        self.direct.n_bands()
    }

    fn irradiance(
        &self,
        receiver: FaceId,
        samples: &[Sample],
        radius: f64,
        stop: Stop<'_>,
    ) -> Option<Vec<f64>> {
        let mut values = self.direct.irradiance(receiver, samples, radius, stop)?;
        if let Some(gatherer) = &self.gatherer {
            let points: Vec<_> = samples
                .iter()
                .map(|sample| {
                    let approach = sample.toward.map(|toward| Approach { toward, radius });
                    (receiver.index(), sample.point, approach)
                })
                .collect();
            let indirect = gatherer.gather_until(&points, stop);
            for (values, indirect) in values.chunks_exact_mut(self.n_bands()).zip(indirect) {
                for (value, indirect) in values.iter_mut().zip(indirect?) {
                    *value += indirect;
                }
            }
        }
        Some(values)
    }

    fn reaches(&self, receiver: FaceId) -> bool {
        self.gatherer.is_some() || self.direct.reaches(receiver)
    }

    fn rounding(&self) -> f64 {
        self.direct.rounding()
    }
}

/// Meshes of cells with direct light, unfinished: to be asked for estimates and true errors of its elements.
///
/// # Errors
///
/// [`Error`] if a face cannot be meshed.
///
/// # Panics
///
/// If the mesher is [`Mesher::Discontinuity`].
pub fn cell_meshes(
    evaluator: &Evaluator<'_>,
    light: &ExactLight<'_, '_>,
    options: &CellOptions,
    control: &Control<'_>,
) -> Result<CellMeshes, Error> {
    Ok(cell_meshes_for(evaluator, light, options, control)?.0)
}

/// The meshes, and what kept their elements from being as small as was asked for.
///
/// * `driver` — the light that is meshed for.
pub(crate) fn cell_meshes_for(
    evaluator: &Evaluator<'_>,
    driver: &dyn Light,
    options: &CellOptions,
    control: &Control<'_>,
) -> Result<(CellMeshes, Option<SizeLimit>), Error> {
    assert!(
        options.mesher != Mesher::Discontinuity,
        "the discontinuity mesh has no cells"
    );
    (control.progress)(Phase::Arrangement, 0.0);
    let scene = evaluator.scene();
    let (mut size, mut goal) = start(scene, driver, options);
    let asked = n_asked(evaluator, driver, size, goal, options, control)?;
    if asked > options.most_elements {
        // Known before anything is made: there is no use in as many as are allowed.
        (size, goal) = (StartSize::Share(COARSEST), CellGoal::Elements(asked));
    }
    let mut receivers = receivers(evaluator, driver, size, options, control)?;
    if let (Mesher::Graded, CellSize::Elements(wanted), StartSize::Length(length)) =
        (options.mesher, options.size, &mut size)
    {
        // How many elements grading adds is seen when they are there.
        for _ in 0..MOST_TRIES {
            let lit = receivers.iter().filter(|r| driver.reaches(r.face));
            let n: usize = lit.map(|r| r.forest.mesh().0.cells.len()).sum();
            let ratio = n as f64 / wanted.max(1) as f64;
            if (0.8..=1.25).contains(&ratio) || control.stop().is_wanted() {
                break;
            }
            *length *= ratio.sqrt();
            receivers = self::receivers(
                evaluator,
                driver,
                StartSize::Length(*length),
                options,
                control,
            )?;
        }
    }
    (control.progress)(Phase::Irradiance, 0.0);
    let direct = CellDirectOptions {
        degree: options.chosen_degree(),
        goal,
        refinement: options.refinement(),
        estimator: options.estimator,
        least_size: options.least_size,
        most_elements: options.most_elements,
    };
    let meshes = CellMeshes::solve(receivers, driver, &direct, &control.limits(), &|_, done| {
        (control.progress)(Phase::Irradiance, done);
    });
    let limit = match (size, goal) {
        _ if asked > options.most_elements => Some(SizeLimit::MostElements {
            asked,
            most: options.most_elements,
        }),
        (StartSize::Length(length), _) => least_size_limit(scene, driver, length, options),
        (_, CellGoal::Elements(_)) if meshes.ended() == CellEnded::LeastSizeReached => {
            Some(SizeLimit::FewerElements {
                asked,
                made: meshes.n_elements(),
                least: options.least_size,
            })
        }
        _ => None,
    };
    Ok((meshes, limit))
}

/// Is the size that is asked for below the least one somewhere?
fn least_size_limit(
    scene: &Scene,
    light: &dyn Light,
    length: f64,
    options: &CellOptions,
) -> Option<SizeLimit> {
    let lit = scene.face_ids().filter(|&f| light.reaches(f));
    let least: Vec<f64> = lit
        .map(|f| options.least_size * diagonal(&scene.loops_in_chart(f, &scene.chart(f))))
        .collect();
    let larger = least.iter().copied().filter(|&l| l > length);
    let n_receivers = larger.clone().count();
    (n_receivers > 0).then(|| SizeLimit::LeastSize {
        asked: scene.frame.length_to_file(length),
        made: scene.frame.length_to_file(larger.fold(0.0, f64::max)),
        n_receivers,
        n_lit: least.len(),
        least: options.least_size,
    })
}

/// Tries at a size for which a graded mesh has the number of elements that is wanted.
const MOST_TRIES: usize = 6;

/// All receivers with the cells they begin with.
fn receivers(
    evaluator: &Evaluator<'_>,
    driver: &dyn Light,
    size: StartSize,
    options: &CellOptions,
    control: &Control<'_>,
) -> Result<Vec<CellReceiver>, Error> {
    let scene = evaluator.scene();
    let faces: Vec<FaceId> = scene.face_ids().collect();
    faces
        .par_iter()
        .map(|&face| {
            let chart = scene.chart(face);
            let forest = forest(
                evaluator,
                driver,
                face,
                &chart,
                size,
                options,
                control.stop(),
            );
            let is_thin = matches!(forest, Err(MeshError::NoArea { .. }));
            let forest = match forest {
                Err(MeshError::NoArea { .. }) => {
                    let border = scene.loops_in_chart(face, &chart);
                    Ok(CellForest::new(cells_of_corners(&border), options.rule()))
                }
                other => other,
            };
            Ok(CellReceiver {
                face,
                forest: forest.map_err(|error| Error {
                    surface: scene.surface_of(face).name.clone(),
                    error,
                })?,
                is_thin,
                contact_radius: contact_radius(scene, face),
                hot_spots: hot_spots(evaluator, face, &chart),
                chart,
            })
        })
        .collect()
}

/// The size that refinement starts with, relative to the receiver's diagonal: no feature
/// of light hides in one element, or hardly.
const COARSEST: f64 = 0.25;

/// The size of elements to begin with.
#[derive(Clone, Copy, Debug)]
enum StartSize {
    /// Scene units.
    Length(f64),
    /// Of the receiver's diagonal.
    Share(f64),
}

/// With what size elements begin, and when refinement ends.
fn start(scene: &Scene, light: &dyn Light, options: &CellOptions) -> (StartSize, CellGoal) {
    let lit = scene.face_ids().filter(|&f| light.reaches(f));
    let area: f64 = lit.map(|f| scene.face(f).area).sum();
    let triangle = unit_area(options.shape);
    let is_whole = options.refinement() == CellRefinement::Whole;
    match options.size {
        CellSize::Tolerance(tolerance) => {
            (StartSize::Share(COARSEST), CellGoal::Tolerance(tolerance))
        }
        CellSize::Length(length) => {
            let length = length / scene.frame.length_to_file(1.0);
            if is_whole {
                (StartSize::Length(length), CellGoal::AsGiven)
            } else {
                let n = (area / (triangle * length * length)).ceil().max(1.0);
                (StartSize::Share(COARSEST), CellGoal::Elements(n as usize))
            }
        }
        CellSize::Elements(n) if is_whole => {
            let length = (area / (triangle * n.max(1) as f64)).sqrt();
            (StartSize::Length(length), CellGoal::AsGiven)
        }
        CellSize::Elements(n) => (StartSize::Share(COARSEST), CellGoal::Elements(n)),
    }
}

/// The area of an element with edges of length 1.
fn unit_area(shape: CellShape) -> f64 {
    match shape {
        CellShape::Triangles => 3f64.sqrt() / 4.0,
        CellShape::Quadrilaterals | CellShape::Mixed => 1.0,
    }
}

/// How many elements are asked for on receivers that light reaches, about; 0 if a tolerance
/// is.
fn n_asked(
    evaluator: &Evaluator<'_>,
    driver: &dyn Light,
    size: StartSize,
    goal: CellGoal,
    options: &CellOptions,
    control: &Control<'_>,
) -> Result<usize, Error> {
    let length = match (options.size, goal, size) {
        (CellSize::Elements(n), ..) | (_, CellGoal::Elements(n), _) => return Ok(n),
        (CellSize::Length(_), _, StartSize::Length(length)) => length,
        _ => return Ok(0),
    };
    let n_uniform = n_of_size(evaluator.scene(), driver, length, options);
    let most = options.most_elements as f64;
    if options.mesher != Mesher::Graded
        || n_uniform > most
        || n_uniform * options.grading.powi(-2) <= most
    {
        return Ok(n_uniform as usize);
    }
    // How many elements grading adds is seen on a coarse mesh of the same grading.
    let coarse = length * (n_uniform / COARSE_ELEMENTS).sqrt().max(1.0);
    let size = StartSize::Length(coarse);
    let receivers = receivers(evaluator, driver, size, options, control)?;
    let lit = receivers.iter().filter(|r| driver.reaches(r.face));
    let n: usize = lit.map(|r| r.forest.mesh().0.cells.len()).sum();
    let finer = n_uniform / n_of_size(evaluator.scene(), driver, coarse, options);
    Ok((n as f64 * finer) as usize)
}

/// Elements of the uniform mesh on which those of graded meshes are counted beforehand.
const COARSE_ELEMENTS: f64 = 1000.0;

/// How many elements of a size receivers that light reaches have, about; where the least
/// size is larger, of that.
fn n_of_size(scene: &Scene, light: &dyn Light, length: f64, options: &CellOptions) -> f64 {
    let lit = scene.face_ids().filter(|&f| light.reaches(f));
    lit.map(|f| {
        let least = options.least_size * diagonal(&scene.loops_in_chart(f, &scene.chart(f)));
        let length = length.max(least);
        scene.face(f).area / (unit_area(options.shape) * length * length)
    })
    .sum()
}

/// Of the box around loops.
fn diagonal(loops: &[Vec<DVec2>]) -> f64 {
    let [min, max] = bounding_box(loops.iter().flatten().copied());
    (max - min).length()
}

/// The cells of a receiver to begin with.
fn forest(
    evaluator: &Evaluator<'_>,
    light: &dyn Light,
    face: FaceId,
    chart: &Chart,
    size: StartSize,
    options: &CellOptions,
    stop: Stop<'_>,
) -> Result<CellForest, MeshError> {
    let scene = evaluator.scene();
    let border = scene.loops_in_chart(face, chart);
    let diagonal = diagonal(&border);
    let is_lit = light.reaches(face);
    let size = match size {
        // Where no light falls, one size is as good as any other.
        _ if !is_lit => COARSEST * diagonal,
        StartSize::Share(share) => share * diagonal,
        StartSize::Length(length) => length.max(options.least_size * diagonal),
    };
    if options.mesher != Mesher::Graded || !is_lit {
        return Ok(CellForest::new(
            uniform(&border, size, options.shape)?,
            options.rule(),
        ));
    }
    let near = Near::new(evaluator, face, chart, &border, stop);
    let reach = 0.25 * diagonal;
    let grading = options.grading.clamp(1e-3, 1.0);
    let size_at = |p: DVec2| size * grading.max((near.distance(p) / reach).min(1.0));
    let most_levels = grading.recip().log2().ceil() as u8;
    graded(&border, size, &size_at, most_levels, options.shape)
}

/// What grading goes by.
struct Near {
    chart: Chart,
    /// Of the border and of what touches the receiver, in the chart.
    segments: Vec<[DVec2; 2]>,
    /// The convex pieces of emitters, corners in space.
    emitters: Vec<Vec<DVec3>>,
}

impl Near {
    fn new(
        evaluator: &Evaluator<'_>,
        face: FaceId,
        chart: &Chart,
        border: &[Vec<DVec2>],
        stop: Stop<'_>,
    ) -> Self {
        let scene = evaluator.scene();
        let mut segments: Vec<[DVec2; 2]> = border
            .iter()
            .flat_map(|l| (0..l.len()).map(|i| [l[i], l[(i + 1) % l.len()]]))
            .collect();
        let contacts = EventKinds::NONE.with(EventKind::Contact);
        let radius = contact_radius(scene, face);
        let found = critical_curves_until(evaluator, face, contacts, radius, stop);
        for curve in found.map_or(Vec::new(), |found| found.curves) {
            segments.push(curve.shape.ends().map(|p| chart.to_chart(p)));
        }
        let emitters = evaluator.emitters().filter(|&e| e != face).flat_map(|e| {
            let pieces = &scene.face(e).pieces;
            let pieces = &scene.pieces[pieces.start as usize..pieces.end as usize];
            pieces.iter().map(|piece| scene.positions(&piece.vertices))
        });
        Self {
            chart: *chart,
            segments,
            emitters: emitters.collect(),
        }
    }

    /// From a point of the receiver to the nearest of all.
    fn distance(&self, uv: DVec2) -> f64 {
        let segments = self.segments.iter();
        let to_segments = segments.map(|&ends| distance_to_segment(ends, uv));
        let point = self.chart.to_space(uv);
        let to_emitters = self.emitters.iter().map(|e| distance_to_convex(e, point));
        to_segments.chain(to_emitters).fold(f64::INFINITY, f64::min)
    }
}

/// The distance of a point to a plane convex polygon in space.
fn distance_to_convex(corners: &[DVec3], point: DVec3) -> f64 {
    let normal = antumbra_geom::newell_normal(corners).normalize_or_zero();
    let n = corners.len();
    let is_above = (0..n).all(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        (b - a).cross(point - a).dot(normal) >= 0.0
    });
    if is_above && n > 0 {
        return normal.dot(point - corners[0]).abs();
    }
    (0..n)
        .map(|i| distance_to_segment_in_space([corners[i], corners[(i + 1) % n]], point))
        .fold(f64::INFINITY, f64::min)
}
