//! `antumbra mesh` and `antumbra solve`.

use crate::Ending;
use crate::args::{Common, Generator, Mesh};
use crate::cell_report::{self, CellOutcome};
use crate::failure::Failure;
use crate::input::{self, Loaded, Purpose};
use crate::output;
use crate::progress::{Watch, was_interrupted};
use crate::report::{self, Outcome};
use crate::say::say;
use antumbra::io::model::MeshedScene;
use antumbra::{CellMeshed, CellSolved, DirectMesh, Meshed, RadiositySolution, Solved};

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    Mesh,
    Solve,
}

/// What was done.
pub(crate) enum Done {
    Meshed(Box<Meshed>),
    Solved(Box<Solved>),
    CellsMeshed(Box<CellMeshed>),
    CellsSolved(Box<CellSolved>),
}

/// What is reported on.
enum Report<'a> {
    Lines(Outcome<'a>),
    Cells(CellOutcome<'a>),
}

impl Done {
    fn as_report(&self) -> Report<'_> {
        match self {
            Self::Meshed(m) => Report::Lines(Outcome {
                meshes: &m.direct,
                curves: &m.curves,
                events: &m.events,
                plan: &m.plan,
                improvements: &m.improvements,
                radiosity: None,
            }),
            Self::Solved(s) => Report::Lines(Outcome {
                meshes: &s.radiosity.meshes,
                curves: &s.curves,
                events: &s.events,
                plan: &s.plan,
                improvements: &s.improvements,
                radiosity: Some(&s.radiosity),
            }),
            Self::CellsMeshed(m) => Report::Cells(CellOutcome {
                meshes: &m.direct,
                mesher: m.mesher,
                limit: m.limit.as_ref(),
                radiosity: None,
            }),
            Self::CellsSolved(s) => Report::Cells(CellOutcome {
                meshes: &s.cells,
                mesher: s.mesher,
                limit: s.limit.as_ref(),
                radiosity: Some(&s.patches.radiosity),
            }),
        }
    }

    /// The mesh, whatever made it.
    pub(crate) fn mesh(&self) -> &dyn DirectMesh {
        match self {
            Self::Meshed(m) => &m.direct,
            Self::Solved(s) => &s.radiosity.meshes,
            Self::CellsMeshed(m) => &m.direct,
            Self::CellsSolved(s) => &s.cells,
        }
    }

    /// Interreflection, if it was asked for.
    pub(crate) fn radiosity(&self) -> Option<&RadiositySolution> {
        match self {
            Self::Meshed(_) | Self::CellsMeshed(_) => None,
            Self::Solved(s) => Some(&s.radiosity),
            Self::CellsSolved(s) => Some(&s.patches.radiosity),
        }
    }

    /// What files are written from.
    pub(crate) fn export(&self, loaded: &Loaded) -> MeshedScene {
        let generator = format!("antumbra {}", env!("CARGO_PKG_VERSION"));
        match self.as_report() {
            Report::Lines(r) => antumbra::export(&loaded.scene, r.meshes, r.curves, &generator),
            Report::Cells(r) => antumbra::export_cells(&loaded.scene, r.meshes, &generator),
        }
    }

    fn is_stopped(&self) -> bool {
        match self.as_report() {
            Report::Lines(r) => r.is_stopped(),
            Report::Cells(r) => r.is_stopped(),
        }
    }
}

pub(crate) fn run(mesh: &Mesh, work: Work) -> Result<Ending, Failure> {
    let common = &mesh.common;
    if mesh.output.is_empty() && !common.json {
        return Err(Failure::usage("nothing to write: give -o OUT or --json"));
    }
    let generator = mesh.meshing.generator()?;
    let formats = output::formats(&mesh.output, &output::MESHES)?;
    let purpose = match work {
        Work::Mesh => Purpose::Direct,
        Work::Solve => Purpose::Interreflection,
    };
    let loaded = input::load_for(common, purpose)?;
    input::spare(&mesh.output)?;
    output::check_look(&mesh.picture, &loaded.scene, work)?;
    let watch = Watch::new(common);
    let done = compute(&loaded, &generator, &watch, work)?;
    let exported = done.export(&loaded);
    let (phases, _) = watch.finish();
    output::write_all(&mesh.output, formats, &exported, &mesh.picture)?;
    let ending = ending(&watch, &done);
    let (_, total) = watch.finish();
    let stop = done.is_stopped().then(|| report::Stop {
        why: watch.stopped().1,
        phase: watch.phase(),
    });
    let (document, summary) = match (done.as_report(), &generator) {
        (Report::Lines(result), Generator::Discontinuity(options)) => {
            let document = report::document(&loaded, options, &result, &phases, total, stop);
            let summary = report::summary(&document, &result);
            (document, summary)
        }
        (Report::Cells(result), Generator::Cells(options)) => {
            let document = cell_report::document(&loaded, options, &result, &phases, total, stop);
            let summary = cell_report::summary(&loaded.scene, &document, &result);
            (document, summary)
        }
        _ => return Err(Failure::internal("the report is of another mesh generator")),
    };
    show(common, &document, &summary, &mesh.output);
    Ok(ending)
}

/// Meshes or solves.
pub(crate) fn compute(
    loaded: &Loaded,
    generator: &Generator,
    watch: &Watch,
    work: Work,
) -> Result<Done, Failure> {
    let scene = &loaded.scene;
    let radiosity = antumbra::RadiosityOptions::default();
    let done = watch.run(|control| match (work, generator) {
        (Work::Mesh, Generator::Discontinuity(options)) => {
            antumbra::mesh(scene, options, control).map(|m| Done::Meshed(Box::new(m)))
        }
        (Work::Solve, Generator::Discontinuity(options)) => {
            antumbra::solve(scene, options, control).map(|s| Done::Solved(Box::new(s)))
        }
        (Work::Mesh, Generator::Cells(options)) => {
            antumbra::mesh_cells(scene, options, control).map(|m| Done::CellsMeshed(Box::new(m)))
        }
        (Work::Solve, Generator::Cells(options)) => {
            antumbra::solve_cells(scene, options, &radiosity, control)
                .map(|s| Done::CellsSolved(Box::new(s)))
        }
    });
    done.map_err(|error| Failure::internal(error.to_string()))
}

/// How the run ended.
pub(crate) fn ending(watch: &Watch, done: &Done) -> Ending {
    if was_interrupted() {
        return Ending::Interrupted;
    }
    if done.is_stopped() {
        return watch.stopped().0;
    }
    if done.mesh().has_reached_goal() && done.radiosity().is_none_or(|r| r.is_converged) {
        Ending::Done
    } else {
        Ending::ToleranceNotReached
    }
}

fn show(
    common: &Common,
    document: &serde_json::Value,
    summary: &str,
    outputs: &[std::path::PathBuf],
) {
    if common.json {
        say!("{document:#}");
    } else if !common.quiet {
        say!("{summary}");
        for path in outputs {
            say!("wrote {}", path.display());
        }
    }
}
