//! The command line.

use crate::failure::Failure;
use antumbra::cells::CellShape;
use antumbra::scene::LengthUnit;
use antumbra::{
    AfterStep, CellOptions, CellSize, CurveOptions, Estimator, EventKind, EventKinds, Events,
    Generator, MOST_STEPS, Mesher, Tolerance,
};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Discontinuity meshing for radiosity: shadow boundaries in the mesh before solving.
#[derive(Debug, Parser)]
#[command(name = "antumbra", version, max_term_width = 100)]
#[command(
    after_help = "Exit codes: 0 done, 1 internal error, 2 bad usage, 3 input unreadable, \
4 content not acceptable, 5 tolerance not reached (result written), 6 budget or memory reached \
(partial result written), 130 interrupted (partial result written)."
)]
pub(crate) struct Options {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Check a scene's geometry and materials: every finding with the surface's name.
    Check(Check),
    /// Decide which effects a scene calls for: what is left out, what that costs at
    /// most, and why.
    Plan(PlanArgs),
    /// Mesh a scene along its shadow boundaries, with exact direct irradiance.
    Mesh(Mesh),
    /// The same, and interreflection.
    Solve(Mesh),
    /// Values at points.
    Probe(Probe),
    /// The matrix of form factors between surfaces, with raw row sums and reciprocity.
    Factors(Factors),
    /// Error against time for every mesh generator and degree, with advice.
    Study(Study),
    /// Pictures: false colour with legend and isolux lines (PNG), per-surface maps (SVG).
    Render(Render),
    /// Shrink a scene that fails to the smallest one that still does: a fixture to keep.
    Reduce(Reduce),
    /// One try of reduce, in a process of its own.
    #[command(hide = true)]
    ReduceTry(ReduceTry),
}

impl Command {
    pub(crate) fn common(&self) -> &Common {
        match self {
            Self::Check(check) => &check.common,
            Self::Plan(plan) => &plan.common,
            Self::Mesh(mesh) | Self::Solve(mesh) => &mesh.common,
            Self::Probe(probe) => &probe.common,
            Self::Factors(factors) => &factors.common,
            Self::Study(study) => &study.common,
            Self::Render(render) => &render.common,
            Self::Reduce(reduce) => &reduce.common,
            Self::ReduceTry(reduce) => &reduce.common,
        }
    }

    /// When to end early. Where a child does the work, its parent ends it.
    pub(crate) fn limits(&self) -> Limits {
        match self {
            Self::Check(check) => check.limits,
            Self::Plan(plan) => plan.meshing.limits,
            Self::Mesh(mesh) | Self::Solve(mesh) => mesh.meshing.limits,
            Self::Probe(probe) => probe.meshing.limits,
            Self::Factors(factors) => factors.limits,
            Self::Study(study) => study.limits,
            Self::Render(render) => render.meshing.limits,
            // The budget of reduce is for its tries.
            Self::Reduce(_) | Self::ReduceTry(_) => Limits::default(),
        }
    }
}

/// What every command takes.
#[derive(Args, Debug)]
pub(crate) struct Common {
    /// The scene: .json (scene file), .obj (with its .mtl), .gltf, .glb, .stl, .vs3
    /// (View3D) or .rad (Radiance).
    pub(crate) scene: PathBuf,
    /// Further .rad (or .mat) files of the same scene: materials first, then surfaces.
    #[arg(value_name = "MORE")]
    pub(crate) more: Vec<PathBuf>,
    /// Unit of the lengths in files that have none (.obj, .stl, .vs3, .rad), and of a
    /// glTF file's that are not metres: m, mm, cm, in or ft.
    #[arg(long, value_name = "UNIT", value_parser = length_unit, default_value = "m")]
    pub(crate) length_unit: LengthUnit,
    /// Make one of corners that are no farther from each other than this, in the file's
    /// unit of length; less than the shortest edge.
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    pub(crate) weld: Option<f64>,
    /// Split surfaces of a scene file into triangles, with a warning, however far they are
    /// from plane; those of other formats are split without being asked.
    #[arg(long)]
    pub(crate) triangulate: bool,
    /// Threads; the result does not depend on it.
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<usize>,
    /// One JSON document on standard output; messages go to standard error.
    #[arg(long)]
    pub(crate) json: bool,
    /// No messages but errors.
    #[arg(long, short)]
    pub(crate) quiet: bool,
    /// No progress.
    #[arg(long)]
    pub(crate) no_progress: bool,
    /// Colour in messages.
    #[arg(long, value_name = "WHEN", default_value = "auto")]
    pub(crate) color: Color,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Color {
    Auto,
    Always,
    Never,
}

/// How to mesh.
#[derive(Args, Debug)]
pub(crate) struct Meshing {
    /// Largest error of direct irradiance anywhere, relative to the scene's peak.
    #[arg(long, value_name = "REL", value_parser = positive, default_value = "1e-3")]
    pub(crate) tolerance: f64,
    /// The same in the scene's units; replaces --tolerance.
    #[arg(long, value_name = "ABS", value_parser = positive)]
    pub(crate) tolerance_abs: Option<f64>,
    /// Degree of the elements: 1, 2, 3, 4 or auto.
    #[arg(long, value_name = "P", value_parser = degree, default_value = "auto")]
    pub(crate) degree: Degree,
    /// Events whose curves are put into the mesh: all, auto, none, or a list of
    /// ve, ee, eee, facet, horizon, contact. Contacts always are.
    #[arg(long, value_name = "KINDS", value_parser = events, default_value = "auto")]
    pub(crate) events: Events,
    /// The mesh generator: discontinuity, or one that knows nothing of shadows: uniform,
    /// graded (smaller near edges and emitters), quadtree (with T-vertices, which crack),
    /// restricted (neighbours differ by one level), tri-quadtree (T-vertices resolved by
    /// triangles) or adaptive (elements out of tolerance are split).
    #[arg(long, value_name = "NAME", value_parser = mesher, default_value = "discontinuity")]
    pub(crate) mesher: Mesher,
    /// Steps after meshing, one after the other: a list of relocate (nodes move to where
    /// elements err most), split, elevate (the degree rises), halve (all elements). A step that
    /// does not lower the measured error on a surface is taken back there.
    #[arg(long, value_name = "STEPS", value_parser = steps, default_value = "", hide_default_value = true)]
    pub(crate) then: Steps,
    /// Elements of the other generators: triangles, quads or mixed (the default).
    #[arg(long, value_name = "SHAPE", value_parser = cell_shape, help_heading = "Other mesh generators")]
    pub(crate) cells: Option<CellShape>,
    /// What refinement of the other generators follows: measured (the default), neighbours,
    /// gradient, higher-order or residual.
    #[arg(long, value_name = "NAME", value_parser = estimator, help_heading = "Other mesh generators")]
    pub(crate) estimator: Option<Estimator>,
    /// Elements of this size instead of a tolerance, in the unit of the file; where
    /// refinement follows the error, as many as the uniform mesh of this size has.
    #[arg(long, value_name = "LENGTH", value_parser = positive, conflicts_with_all = ["elements", "tolerance_abs"], help_heading = "Other mesh generators")]
    pub(crate) element_size: Option<f64>,
    /// About so many elements on surfaces that light reaches, instead of a tolerance; more
    /// than a million are not made.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000_000), conflicts_with = "tolerance_abs", help_heading = "Other mesh generators")]
    pub(crate) elements: Option<u64>,
    /// Elements are not made smaller than this fraction of their surface's diagonal
    /// (default 1/1024).
    #[arg(long, value_name = "REL", value_parser = positive, help_heading = "Other mesh generators")]
    pub(crate) least_size: Option<f64>,
    #[command(flatten)]
    pub(crate) limits: Limits,
}

/// When to end early.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Limits {
    /// No more memory than this, such as 500MB or 2GB: then the result so far is written,
    /// at 70 % of it, for writing takes memory too.
    #[arg(long, value_name = "SIZE", value_parser = memory)]
    pub(crate) max_memory: Option<u64>,
    /// No more time than this, from the start on: then the result so far is written (what
    /// that is, see below), with coarse meshes where nothing is known yet. Up to a fifth of
    /// it, but no less than 0.8 and no more than 10 seconds, goes into those.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) budget: Option<f64>,
}

/// What a partial result is, of every command: after a limit of time or memory (exit code
/// 6) and after an interrupt or a request to end (SIGINT, SIGTERM; 130).
mod partial {
    pub(super) const CHECK: &str = "Partial result (exit codes 6, 130): the scene is accepted and \
counted, but whether rooms are closed and corners meet was not looked at; \"complete\" is false in \
--json. There is none before the scene is accepted.";
    pub(super) const PLAN: &str = "Partial result (exit codes 6, 130): none, for a plan of some of \
the receivers would be none of the scene.";
    pub(super) const MESH: &str = "Partial result (exit codes 6, 130): every surface has the last of \
its meshes that had all its values, else a coarse one, else none; interreflection is as far as it \
came, or left out. \"stopped\" in --json says how many surfaces there are of each kind.";
    pub(super) const PROBE: &str = "Partial result (exit codes 6, 130): points that were not computed \
have no value: empty in CSV, null in --json.";
    pub(super) const FACTORS: &str = "Partial result (exit codes 6, 130): factors of pairs that were \
not computed are missing, and so are the sums of their rows: empty in .csv, null in .json and \
--json; .txt has no word for that and is not written.";
    pub(super) const STUDY: &str = "Partial result (exit codes 6, 130): the runs that were completed; \
the page says which are missing.";
    pub(super) const RENDER: &str = "Partial result (exit codes 6, 130): a picture of the meshes so \
far; surfaces without values have the colour of those.";
}

impl Meshing {
    /// What is asked for, if the options of the generator make sense together.
    pub(crate) fn options(&self) -> Result<antumbra::Options, Failure> {
        let mesher = self.mesher.key();
        let common = antumbra::Options {
            tolerance: match self.tolerance_abs {
                Some(absolute) => Tolerance::Absolute(absolute),
                None => Tolerance::Relative(self.tolerance),
            },
            degree: self.degree.0,
            ..antumbra::Options::default()
        };
        if self.mesher == Mesher::Discontinuity {
            let given = [
                ("--cells", self.cells.is_some()),
                ("--estimator", self.estimator.is_some()),
                ("--element-size", self.element_size.is_some()),
                ("--elements", self.elements.is_some()),
                ("--least-size", self.least_size.is_some()),
            ];
            let curves = CurveOptions {
                events: self.events,
                after: self.then.0,
            };
            return match given.into_iter().find(|g| g.1) {
                Some((option, _)) => Err(Failure::usage(format!(
                    "{option} is for other mesh generators than {mesher}: give --mesher NAME"
                ))),
                None => Ok(antumbra::Options {
                    generator: Generator::Curves(curves),
                    ..common
                }),
            };
        }
        if self.events != Events::OnDemand {
            return Err(Failure::usage(format!(
                "--events is for --mesher discontinuity: {mesher} puts no curves into the mesh"
            )));
        }
        if self.then.0[0].is_some() {
            return Err(Failure::usage(format!(
                "--then is for --mesher discontinuity: {mesher} is refined as it is made"
            )));
        }
        Ok(antumbra::Options {
            tolerance: common.tolerance,
            degree: common.degree,
            ..antumbra::Options::with_cells(self.cells())
        })
    }

    fn cells(&self) -> CellOptions {
        let default = CellOptions::default();
        CellOptions {
            mesher: self.mesher,
            shape: self.cells.unwrap_or(default.shape),
            size: match (self.element_size, self.elements) {
                (Some(length), _) => CellSize::Length(length),
                (None, Some(n)) => CellSize::Elements(usize::try_from(n).unwrap_or(usize::MAX)),
                (None, None) => CellSize::Tolerance,
            },
            estimator: self.estimator.unwrap_or(default.estimator),
            least_size: self.least_size.unwrap_or(default.least_size),
            ..default
        }
    }

    /// The options of the discontinuity mesh, for commands that know no other.
    pub(crate) fn discontinuity(&self, command: &str) -> Result<antumbra::Options, Failure> {
        let options = self.options()?;
        match options.generator {
            Generator::Curves(_) => Ok(options),
            Generator::Cells(cells) => Err(Failure::usage(format!(
                "--mesher {}: {command} is for the discontinuity mesh alone",
                cells.mesher.key()
            ))),
        }
    }
}

/// Steps after meshing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Steps(pub(crate) [Option<AfterStep>; MOST_STEPS]);

/// `None` is auto.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Degree(pub(crate) Option<u8>);

#[derive(Args, Debug)]
#[command(after_help = partial::CHECK)]
pub(crate) struct Check {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) limits: Limits,
}

#[derive(Args, Debug)]
#[command(after_help = partial::PLAN)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) meshing: Meshing,
    /// Plan for direct light only, as mesh does.
    #[arg(long)]
    pub(crate) direct: bool,
}

#[derive(Args, Debug)]
#[command(after_help = partial::MESH)]
pub(crate) struct Mesh {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) meshing: Meshing,
    /// A file to write; its extension says what: .json .obj .ply .vtu .csv .svg .png.
    /// May be given several times.
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) picture: Picture,
}

#[derive(Args, Debug)]
#[command(after_help = partial::PROBE)]
pub(crate) struct Probe {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) meshing: Meshing,
    /// CSV with the header surface,x,y,z or surface,x,y,z,nx,ny,nz; a row with an
    /// empty surface is a free sensor with that normal. - reads standard input.
    #[arg(long, value_name = "CSV")]
    pub(crate) points: PathBuf,
    /// Exact direct irradiance; no mesh is made. The default.
    #[arg(long)]
    pub(crate) exact: bool,
    /// Direct irradiance interpolated on the mesh.
    #[arg(long)]
    pub(crate) mesh: bool,
    /// Irradiance with interreflection.
    #[arg(long)]
    pub(crate) solve: bool,
}

#[derive(Args, Debug)]
#[command(after_help = partial::FACTORS)]
pub(crate) struct Factors {
    #[command(flatten)]
    pub(crate) common: Common,
    /// Largest error of any form factor, absolute.
    #[arg(long, value_name = "F", value_parser = positive, default_value = "1e-6")]
    pub(crate) tolerance: f64,
    /// Scale the factors of a closed scene so that every row sums up to 1, keeping
    /// reciprocity; says what that changed.
    #[arg(long)]
    pub(crate) repair: bool,
    #[command(flatten)]
    pub(crate) limits: Limits,
    /// A file to write; its extension says what: .csv, .json, or .txt for the text of
    /// View3D. May be given several times.
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: Vec<PathBuf>,
}

#[derive(Args, Debug)]
#[command(
    long_about = "Run every mesh generator at every degree over a ladder of tolerances or sizes, and \
measure error against time, elements, exact evaluations and memory. Errors are those at random \
points that no mesh used, against exact values.",
    after_help = partial::STUDY
)]
pub(crate) struct Study {
    #[command(flatten)]
    pub(crate) common: Common,
    /// The largest error, relative to the peak, that the advice is for.
    #[arg(long, value_name = "REL", value_parser = positive, default_value = "1e-3")]
    pub(crate) tolerance: f64,
    /// The finest tolerance of the ladder: a series ends when its error is below it.
    #[arg(long, value_name = "REL", value_parser = positive, default_value = "1e-6")]
    pub(crate) finest: f64,
    /// Mesh generators: a list of uniform, graded, quadtree, restricted, tri-quadtree,
    /// adaptive, discontinuity.
    #[arg(long, value_name = "NAMES", value_parser = mesher, value_delimiter = ',', default_values_t = Mesher::ALL, hide_default_value = true)]
    pub(crate) meshers: Vec<Mesher>,
    /// Degrees of the elements: a list of 1, 2, 3, 4.
    #[arg(long, value_name = "LIST", value_parser = clap::value_parser!(u8).range(1..=4), value_delimiter = ',', default_value = "1,2,3,4")]
    pub(crate) degrees: Vec<u8>,
    /// Study irradiance with interreflection: every value is gathered from one solution,
    /// whose uncertainty is told.
    #[arg(long)]
    pub(crate) interreflection: bool,
    /// Points at which errors are measured; 10000, or with --interreflection 1000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    pub(crate) points: Option<u32>,
    /// How often short runs are repeated; the median counts.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=100), default_value = "3")]
    pub(crate) repeats: u8,
    #[command(flatten)]
    pub(crate) limits: Limits,
    /// A file to write; its extension says what: .html (a page that needs no network),
    /// .json, .csv, .png or .svg (error against time). May be given several times.
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: Vec<PathBuf>,
}

#[derive(Args, Debug)]
#[command(after_help = partial::RENDER)]
pub(crate) struct Render {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) meshing: Meshing,
    /// The picture: .png or .svg. May be given several times.
    #[arg(long, short, value_name = "OUT", required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Direct light only.
    #[arg(long)]
    pub(crate) direct: bool,
    #[command(flatten)]
    pub(crate) picture: Picture,
}

#[derive(Args, Debug)]
#[command(
    long_about = "Shrink a scene that fails to the smallest one that still does: a fixture to keep.\n\n\
Surfaces, holes, corners and materials are removed, bands and units made plain, and \
coordinates rounded and moved to zero, as long as the failure stays; until no surface, hole or \
corner can be removed alone. Every try of a failure below meshes the scene in a process of its \
own, so that panics, aborts and hangs are survived. The result is a scene file, whatever the \
format of SCENE.",
    after_help = "Failures:
  panic             mesh panics, aborts or ends with an internal error (exit code 1)
  slow=SECONDS      mesh takes longer than this (its result depends on the machine)
  negative          a value of the mesh, or an exact one at random points, is below zero or no number
  above-unoccluded  an exact value at random points is above that without occluders
  above-tolerance   mesh says that it has reached the tolerance, and at a random point it differs
                    from the exact value by more
  check             a triangulation breaks a promise (overlaps, gaps, lost edges)
  command=COMMAND   a shell command ends with another exit code than 0; it gets the scene's path as
                    its last argument

Example: antumbra reduce room.json --while above-tolerance -o small.json -- --tolerance 1e-4

Exit codes: 0 the smallest scene is written, 4 the scene does not fail in the first place (nothing \
is written), 6 the budget is spent and 130 interrupted (the smallest scene so far is written)."
)]
pub(crate) struct Reduce {
    #[command(flatten)]
    pub(crate) common: Common,
    /// What is to stay: panic, slow=SECONDS, negative, above-unoccluded, above-tolerance,
    /// check or command=COMMAND.
    #[arg(long = "while", value_name = "FAILURE", value_parser = failure)]
    pub(crate) failure: FailureKind,
    /// The scene file to write, .json; without it, it goes to standard output.
    #[arg(long, short, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    /// A try that takes longer is ended, and counts as one that does not fail.
    #[arg(long, value_name = "SECONDS", value_parser = positive, default_value = "60")]
    pub(crate) timeout: f64,
    /// Random points at which values are compared; spread over all surfaces by area.
    #[arg(long, value_name = "N", default_value = "1000")]
    pub(crate) points: u32,
    /// No more time than this for all tries: then the smallest scene so far is written.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) budget: Option<f64>,
    /// How to mesh: options of mesh, such as --events all or --tolerance 1e-4.
    #[arg(last = true, value_name = "MESH OPTIONS")]
    pub(crate) meshing: Vec<String>,
}

/// What reduce is to keep.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum FailureKind {
    Panic,
    Slow(f64),
    Values(ValueFailure),
    Command(String),
}

/// Failures that show in values or meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ValueFailure {
    Negative,
    AboveUnoccluded,
    AboveTolerance,
    Check,
}

#[derive(Args, Debug)]
pub(crate) struct ReduceTry {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) meshing: Meshing,
    #[arg(long)]
    pub(crate) failure: ValueFailure,
    #[arg(long)]
    pub(crate) points: u32,
}

/// How pictures look.
#[derive(Args, Debug)]
pub(crate) struct Picture {
    /// Where to look from: auto, front, back, left, right, top, bottom, or
    /// surface:NAME for a map of one surface.
    #[arg(
        long,
        value_name = "VIEW",
        default_value = "auto",
        help_heading = "Pictures"
    )]
    pub(crate) view: String,
    /// Size in pixels.
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1200x900", help_heading = "Pictures")]
    pub(crate) size: (usize, usize),
    /// The field: direct, irradiance or radiosity. The default is irradiance after
    /// a solve, else direct.
    #[arg(long, value_name = "NAME", help_heading = "Pictures")]
    pub(crate) field: Option<String>,
    /// The colour scale, such as 0..500. The default is 0 to the largest value.
    #[arg(long, value_name = "FROM..TO", value_parser = scale, help_heading = "Pictures")]
    pub(crate) scale: Option<(f64, f64)>,
    /// Draw the elements.
    #[arg(long, help_heading = "Pictures")]
    pub(crate) draw_mesh: bool,
    /// Draw the critical curves, coloured by order.
    #[arg(long, help_heading = "Pictures")]
    pub(crate) draw_curves: bool,
    /// No isolux lines.
    #[arg(long, help_heading = "Pictures")]
    pub(crate) no_isolux: bool,
}

fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if (1..=1024).contains(&n) => Ok(n),
        _ => Err("a number from 1 to 1024 is needed".into()),
    }
}

fn length_unit(text: &str) -> Result<LengthUnit, String> {
    LengthUnit::from_symbol(text).ok_or_else(|| "one of m, mm, cm, in, ft is allowed".into())
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("a number above 0 is needed".into()),
    }
}

fn steps(text: &str) -> Result<Steps, String> {
    let mut steps = Steps::default();
    let words: Vec<&str> = text
        .split(',')
        .map(str::trim)
        .filter(|w| !w.is_empty())
        .collect();
    if words.len() > MOST_STEPS {
        return Err(format!(
            "{} steps: at most {MOST_STEPS} are allowed",
            words.len()
        ));
    }
    for (place, word) in steps.0.iter_mut().zip(words) {
        *place = Some(AfterStep::from_key(word).ok_or_else(|| {
            let keys = AfterStep::ALL.map(AfterStep::key);
            format!("'{word}' is no step: {}", keys.join(", "))
        })?);
    }
    Ok(steps)
}

fn degree(text: &str) -> Result<Degree, String> {
    match text {
        "auto" => Ok(Degree(None)),
        "1" | "2" | "3" | "4" => Ok(Degree(text.parse().ok())),
        _ => Err("1, 2, 3, 4 or auto is allowed".into()),
    }
}

fn mesher(text: &str) -> Result<Mesher, String> {
    let keys = || Mesher::ALL.map(Mesher::key).join(", ");
    Mesher::from_key(text).ok_or_else(|| format!("one of {} is allowed", keys()))
}

fn cell_shape(text: &str) -> Result<CellShape, String> {
    match text {
        "triangles" => Ok(CellShape::Triangles),
        "quads" => Ok(CellShape::Quadrilaterals),
        "mixed" => Ok(CellShape::Mixed),
        _ => Err("triangles, quads or mixed is allowed".into()),
    }
}

fn estimator(text: &str) -> Result<Estimator, String> {
    let keys = || Estimator::ALL.map(Estimator::key).join(", ");
    Estimator::from_key(text).ok_or_else(|| format!("one of {} is allowed", keys()))
}

fn events(text: &str) -> Result<Events, String> {
    match text {
        "auto" => Ok(Events::OnDemand),
        "all" => Ok(Events::Kinds(EventKinds::ALL)),
        "none" => Ok(Events::Kinds(EventKinds::NONE)),
        list => list
            .split(',')
            .try_fold(EventKinds::NONE, |kinds, key| {
                EventKind::from_key(key.trim())
                    .map(|kind| kinds.with(kind))
                    .ok_or_else(|| {
                        format!(
                            "'{key}' is no kind of event: all, auto, none, or a list of ve, ee, eee, facet, horizon, contact"
                        )
                    })
            })
            .map(Events::Kinds),
    }
}

fn memory(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_uppercase().as_str() {
        "" | "B" => 1.0,
        "K" | "KB" | "KIB" => 1024.0,
        "M" | "MB" | "MIB" => 1024.0 * 1024.0,
        "G" | "GB" | "GIB" => 1024.0 * 1024.0 * 1024.0,
        other => return Err(format!("'{other}' is no unit of memory: B, KB, MB, GB")),
    };
    positive(digits).map(|n| (n * unit) as u64)
}

fn failure(text: &str) -> Result<FailureKind, String> {
    match text.split_once('=') {
        Some(("slow", seconds)) => positive(seconds).map(FailureKind::Slow),
        Some(("command", command)) if !command.trim().is_empty() => {
            Ok(FailureKind::Command(command.to_owned()))
        }
        None if text == "panic" => Ok(FailureKind::Panic),
        None => ValueFailure::from_str(text, false)
            .map(FailureKind::Values)
            .map_err(|_| FAILURES.to_owned()),
        Some(_) => Err(FAILURES.to_owned()),
    }
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    Mesh,
    Solve,
}

const FAILURES: &str = "one of panic, slow=SECONDS, negative, above-unoccluded, above-tolerance, \
check, command=COMMAND is allowed";

fn size(text: &str) -> Result<(usize, usize), String> {
    let parsed = text
        .split_once('x')
        .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((w, h)) if (64..=16384).contains(&w) && (64..=16384).contains(&h) => Ok((w, h)),
        _ => Err("WIDTHxHEIGHT with 64 to 16384 pixels each is needed".into()),
    }
}

fn scale(text: &str) -> Result<(f64, f64), String> {
    let parsed = text
        .split_once("..")
        .and_then(|(a, b)| Some((a.parse::<f64>().ok()?, b.parse::<f64>().ok()?)));
    match parsed {
        Some((a, b)) if a.is_finite() && b.is_finite() && a < b => Ok((a, b)),
        _ => Err("FROM..TO with FROM below TO is needed".into()),
    }
}
