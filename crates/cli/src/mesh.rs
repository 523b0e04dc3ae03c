//! `antumbra mesh` and `antumbra solve`.

use crate::Ending;
use crate::args::{Common, Mesh, Work};
use crate::failure::Failure;
use crate::input::{self, Loaded, Purpose};
use crate::output;
use crate::progress::{Watch, was_interrupted};
use crate::report;
use crate::say::say;
use crate::summary::summary;
use antumbra::io::model::MeshedScene;
use antumbra::{Options, Outcome};

pub(crate) fn run(mesh: &Mesh, work: Work) -> Result<Ending, Failure> {
    let common = &mesh.common;
    if mesh.output.is_empty() && !common.json {
        return Err(Failure::usage("nothing to write: give -o OUT or --json"));
    }
    let options = mesh.meshing.options()?;
    let formats = output::formats(&mesh.output, &output::MESHES)?;
    let purpose = match work {
        Work::Mesh => Purpose::Direct,
        Work::Solve => Purpose::Interreflection,
    };
    let loaded = input::load_for(common, purpose)?;
    input::spare(&mesh.output)?;
    output::check_look(&mesh.picture, &loaded.scene, work)?;
    let watch = Watch::new(common);
    let outcome = compute(&loaded, &options, &watch, work)?;
    let exported = export(&loaded, &outcome);
    let (phases, _) = watch.finish();
    output::write_all(&mesh.output, formats, &exported, &mesh.picture)?;
    let ending = ending(&watch, &outcome);
    let (_, total) = watch.finish();
    let stop = outcome.is_stopped().then(|| report::Stop {
        why: watch.stopped().1,
        phase: watch.phase(),
    });
    let document = report::document(&loaded, &options, &outcome, &phases, total, stop);
    let summary = summary(&loaded.scene, &options, &document, &outcome);
    show(common, &document, &summary, &mesh.output);
    Ok(ending)
}

/// What files are written from.
pub(crate) fn export(loaded: &Loaded, outcome: &Outcome) -> MeshedScene {
    let provenance = format!("antumbra {}", env!("CARGO_PKG_VERSION"));
    antumbra::export(&loaded.scene, outcome, &provenance)
}

/// Meshes or solves.
pub(crate) fn compute(
    loaded: &Loaded,
    options: &Options,
    watch: &Watch,
    work: Work,
) -> Result<Outcome, Failure> {
    let outcome = watch.run(|control| match work {
        Work::Mesh => antumbra::mesh(&loaded.scene, options, control),
        Work::Solve => antumbra::solve(&loaded.scene, options, control),
    });
    outcome.map_err(|error| Failure::internal(error.to_string()))
}

/// How the run ended.
pub(crate) fn ending(watch: &Watch, outcome: &Outcome) -> Ending {
    if was_interrupted() {
        return Ending::Interrupted;
    }
    if outcome.is_stopped() {
        return watch.stopped().0;
    }
    if outcome.has_reached_goal() {
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
