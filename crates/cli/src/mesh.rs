//! `antumbra mesh` and `antumbra solve`.

use crate::Ending;
use crate::args::{Common, Mesh, Meshing};
use crate::failure::Failure;
use crate::input::{self, Loaded};
use crate::output;
use crate::progress::{Watch, was_interrupted};
use crate::report::{self, Outcome};
use crate::say::say;
use antumbra::{Ended, Meshed, Solved};

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
}

impl Done {
    pub(crate) fn as_report(&self) -> Outcome<'_> {
        match self {
            Self::Meshed(m) => Outcome {
                meshes: &m.direct,
                curves: &m.curves,
                events: &m.events,
                plan: &m.plan,
                improvements: &m.improvements,
                radiosity: None,
            },
            Self::Solved(s) => Outcome {
                meshes: &s.radiosity.meshes,
                curves: &s.curves,
                events: &s.events,
                plan: &s.plan,
                improvements: &s.improvements,
                radiosity: Some(&s.radiosity),
            },
        }
    }
}

pub(crate) fn run(mesh: &Mesh, work: Work) -> Result<Ending, Failure> {
    let common = &mesh.common;
    if mesh.output.is_empty() && !common.json {
        return Err(Failure::usage("nothing to write: give -o OUT or --json"));
    }
    let formats = output::formats(&mesh.output, &output::MESHES)?;
    let loaded = input::load(common)?;
    output::check_look(&mesh.picture, &loaded.scene, work)?;
    let watch = Watch::new(common);
    let done = compute(&loaded, &mesh.meshing, &watch, work)?;
    let result = done.as_report();
    let exported = result.export(&loaded);
    let (phases, _) = watch.finish();
    output::write_all(&mesh.output, formats, &exported, &mesh.picture)?;
    let ending = ending(&watch, &result);
    let (_, total) = watch.finish();
    let stop = result.is_stopped().then(|| report::Stop {
        why: watch.stopped().1,
        phase: watch.phase(),
    });
    let report = report::document(&loaded, &mesh.meshing, &result, &phases, total, stop);
    show(common, &report, &result, &mesh.output);
    Ok(ending)
}

/// Meshes or solves.
pub(crate) fn compute(
    loaded: &Loaded,
    meshing: &Meshing,
    watch: &Watch,
    work: Work,
) -> Result<Done, Failure> {
    let options = meshing.options();
    let done = watch.run(|control| match work {
        Work::Mesh => {
            antumbra::mesh(&loaded.scene, &options, control).map(|m| Done::Meshed(Box::new(m)))
        }
        Work::Solve => {
            antumbra::solve(&loaded.scene, &options, control).map(|s| Done::Solved(Box::new(s)))
        }
    });
    done.map_err(|error| Failure::internal(error.to_string()))
}

/// How the run ended.
pub(crate) fn ending(watch: &Watch, result: &Outcome<'_>) -> Ending {
    if was_interrupted() {
        return Ending::Interrupted;
    }
    if result.is_stopped() {
        return watch.stopped().0;
    }
    let reached = match result.meshes.ended {
        Ended::ToleranceReached => true,
        Ended::ResolutionReached | Ended::TooManyElements | Ended::Stopped => false,
    };
    if reached && result.radiosity.is_none_or(|r| r.is_converged) {
        Ending::Done
    } else {
        Ending::ToleranceNotReached
    }
}

fn show(
    common: &Common,
    report: &serde_json::Value,
    result: &Outcome<'_>,
    outputs: &[std::path::PathBuf],
) {
    if common.json {
        say!("{report:#}");
    } else if !common.quiet {
        say!("{}", report::summary(report, result));
        for path in outputs {
            say!("wrote {}", path.display());
        }
    }
}
