//! `antumbra factors`.

use crate::Ending;
use crate::args::Factors;
use crate::failure::Failure;
use crate::input::{self, Loaded, Purpose};
use crate::output::{self, Format};
use crate::progress::{Watch, peak_memory};
use crate::report::covered;
use crate::say::say;
use antumbra::io::model::FactorTable;
use antumbra::{FactorOptions, FormFactors, Repair};
use serde_json::{Value, json};

pub(crate) fn run(factors: &Factors) -> Result<Ending, Failure> {
    let common = &factors.common;
    if factors.output.is_empty() && !common.json {
        return Err(Failure::usage("nothing to write: give -o OUT or --json"));
    }
    let formats = output::formats(&factors.output, &output::FACTORS)?;
    let loaded = input::load_for(common, Purpose::Factors)?;
    input::spare(&factors.output)?;
    let watch = Watch::new(common);
    let n = loaded.scene.surfaces.len() as u64;
    let bytes = BYTES_PER_FACTOR * n * n;
    if !watch.run(|control| (control.has_room)(bytes)) {
        eprintln!(
            "antumbra: the form factors between {n} surfaces take {:.1} GB, for which there is no \
             memory: nothing is written",
            bytes as f64 / 1e9
        );
        return Ok(Ending::BudgetReached);
    }
    let options = FactorOptions {
        tolerance: factors.tolerance,
        ..FactorOptions::default()
    };
    let raw = watch.run(|control| antumbra::factors(&loaded.scene, &options, control));
    let (_, total) = watch.finish();
    let ending = ending(&watch, &raw, &options);

    let mut matrix = raw.clone();
    let repair = if raw.left_out > 0 {
        let why = watch.stopped().1;
        eprintln!(
            "antumbra: stopped by {why}: {} pairs of faces were left out",
            raw.left_out
        );
        if factors.repair {
            eprintln!("antumbra: --repair: not done, for factors are missing");
        }
        None
    } else if factors.repair {
        let repaired = matrix.repair();
        Some(repaired.map_err(|e| Failure::usage(format!("--repair: {e}")))?)
    } else {
        None
    };
    let generator = format!("antumbra {}", env!("CARGO_PKG_VERSION"));
    let table = antumbra::export_factors(&loaded.scene, &matrix, repair.is_some(), &generator);
    let mut written = Vec::new();
    for (path, format) in factors.output.iter().zip(formats) {
        // Zeros in the place of what is not known would be read as factors.
        if format == Format::Txt && raw.left_out > 0 {
            eprintln!(
                "antumbra: {}: not written: {} factors are missing, and the text of View3D has no \
                 word for that (.csv and .json have)",
                path.display(),
                table.n_missing()
            );
            continue;
        }
        output::write_factors(path, format, &table)?;
        written.push(path);
    }
    if common.json {
        let report = document(&loaded, &options, &raw, repair.as_ref(), &table, total);
        say!("{report:#}");
    } else if !common.quiet {
        say!("{}", summary(&options, &raw, repair.as_ref(), total));
        for path in written {
            say!("wrote {}", path.display());
        }
    }
    Ok(ending)
}

/// Memory for each pair of surfaces: factor, error and whether it is missing, as they are
/// computed and as they are written.
const BYTES_PER_FACTOR: u64 = 34;

fn ending(watch: &Watch, raw: &FormFactors, options: &FactorOptions) -> Ending {
    if watch.should_stop() {
        watch.stopped().0
    } else if raw.max_error() <= options.tolerance {
        Ending::Done
    } else {
        Ending::ToleranceNotReached
    }
}

/// The document of `--json`: sums, reciprocity and closure are those before any
/// repair, `factors` and their `row_sums` those that are written.
fn document(
    loaded: &Loaded,
    options: &FactorOptions,
    raw: &FormFactors,
    repair: Option<&Repair>,
    table: &FactorTable,
    total: f64,
) -> Value {
    let name = |i: usize| raw.names[i].as_str();
    let reciprocity = &raw.reciprocity;
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "length_unit": table.length_unit,
        "surfaces": raw.n(),
        "tolerance": options.tolerance,
        "estimated_max_error": raw.max_error(),
        "exact_evaluations": raw.evaluations,
        "pairs": reciprocity.pairs,
        "pairs_left_out": raw.left_out,
        "reciprocity": {
            "worst": reciprocity.worst,
            "between": reciprocity.between.map(|pair| pair.map(name)),
            "pairs_checked": reciprocity.pairs_checked,
        },
        "closure": raw.closure().map(|(i, sum)| json!({
            "worst": (sum - 1.0).abs(),
            "surface": name(i),
            "row_sum": sum,
        })),
        "closed": table.is_closed,
        "raw_row_sums": known_sums(raw),
        "repair": repair.map(|r| json!({
            "largest_change": r.largest_change,
            "between": r.between.map(name),
            "closure": r.closure,
            "steps": r.steps,
        })),
        "names": table.names,
        "areas": table.areas,
        "covered": covered(&loaded.scene),
        "row_sums": table.row_sums(),
        "factors": table.known_rows().collect::<Vec<_>>(),
        "seconds": { "total": total },
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "warnings": loaded.warnings.iter().map(|w| w.message.clone()).chain(loaded.notes.iter().cloned()).collect::<Vec<_>>(),
    })
}

/// The sums of the rows; nothing where factors are missing.
fn known_sums(raw: &FormFactors) -> Vec<Option<f64>> {
    let sums = raw.row_sums().into_iter().enumerate();
    sums.map(|(i, sum)| raw.is_complete(i).then_some(sum))
        .collect()
}

/// A few lines for people.
fn summary(
    options: &FactorOptions,
    raw: &FormFactors,
    repair: Option<&Repair>,
    total: f64,
) -> String {
    let sums = known_sums(raw);
    let (min, max) = sums
        .iter()
        .zip(&raw.areas)
        .filter(|(_, area)| **area > 0.0)
        .filter_map(|(sum, _)| *sum)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), s| {
            (min.min(s), max.max(s))
        });
    let rows = if min <= max {
        format!("{min:.9} to {max:.9}")
    } else {
        "none is complete".to_owned()
    };
    let mut text = format!(
        "{} surfaces, {} pairs of faces that face each other\n\
         error: at most {:.2e}, estimated (allowed {:e})\n\
         row sums, raw: {rows}\n\
         reciprocity: worst {:.1e}, of {} pairs computed from both sides\n\
         {} exact evaluations, {total:.3} s",
        raw.n(),
        raw.reciprocity.pairs,
        raw.max_error(),
        options.tolerance,
        raw.reciprocity.worst,
        raw.reciprocity.pairs_checked,
        raw.evaluations,
    );
    if raw.left_out > 0 {
        text.push_str(&format!(
            "\n{} pairs of faces were left out: their factors are missing",
            raw.left_out
        ));
    }
    if let Some(repair) = repair {
        text.push_str(&format!(
            "\nrepaired: no factor changed by more than {:.2e} ({} to {}), rows are 1 ± {:.0e}",
            repair.largest_change,
            raw.names[repair.between[0]],
            raw.names[repair.between[1]],
            repair.closure
        ));
    }
    text
}
