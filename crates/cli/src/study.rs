//! `antumbra study`.

use crate::Ending;
use crate::args::Study as Arguments;
use crate::failure::Failure;
use crate::input;
use crate::output;
use crate::progress::{Watch, most_memory_since};
use crate::say::say;
use antumbra::io::study::Study;
use antumbra::{Meter, StudyOptions};
use std::time::Instant;

/// Seconds without `--budget`: with pictures and comparisons it stays below five minutes.
const USUAL_BUDGET: f64 = 180.0;

/// The share of the time that a study plans with: a run that takes longer than expected
/// does not make it a partial result.
const PLANNED: f64 = 0.85;

pub(crate) fn run(args: &Arguments) -> Result<Ending, Failure> {
    let common = &args.common;
    if args.output.is_empty() && !common.json {
        return Err(Failure::usage("nothing to write: give -o OUT or --json"));
    }
    let formats = output::formats(&args.output, &output::STUDIES)?;
    let loaded = input::load(common)?;
    input::spare(&args.output)?;
    let watch = Watch::new(common);
    let options = StudyOptions {
        degrees: once(&args.degrees),
        meshers: once(&args.meshers),
        tolerances: tolerances(args.finest.min(args.tolerance)),
        target: args.tolerance,
        n_points: args
            .points
            .unwrap_or(if args.interreflection { 1_000 } else { 10_000 }),
        map_pixels: if args.interreflection { 64 } else { 160 },
        interreflection: args.interreflection,
        repeats: usize::from(args.repeats),
        budget: PLANNED * args.limits.budget.unwrap_or(USUAL_BUDGET),
    };
    let started = Instant::now();
    let meter = Meter {
        clock: &|| started.elapsed().as_secs_f64(),
        memory: &most_memory_since,
    };
    let found = watch.run(|control| antumbra::study(&loaded.scene, &options, &meter, control));
    let ending = if watch.should_stop() {
        watch.stopped().0
    } else {
        Ending::Done
    };
    let mut study = found.map_err(|error| Failure::internal(error.to_string()))?;
    watch.finish();
    study.title = title(args);
    study.command = command();
    study.machine = machine();
    for note in &loaded.notes {
        study.notes.push(note.clone());
    }
    output::each(&args.output, formats, |path, format| {
        output::write_study(path, format, &study)
    })?;
    if common.json {
        let mut document = Vec::new();
        antumbra::io::study::write_json(&study, &mut document)
            .map_err(|e| Failure::internal(e.to_string()))?;
        say!("{}", String::from_utf8_lossy(&document).trim_end());
    } else if !common.quiet {
        say!("{}", summary(&study));
        for path in &args.output {
            say!("wrote {}", path.display());
        }
    }
    Ok(ending)
}

/// 1e-1, 3e-2, 1e-2, … down to the finest.
fn tolerances(finest: f64) -> Vec<f64> {
    let steps = (1..).flat_map(|k| [format!("1e-{k}"), format!("3e-{}", k + 1)]);
    let mut tolerances: Vec<f64> = steps
        .filter_map(|t| t.parse().ok())
        .take_while(|t| *t > 1.001 * finest)
        .collect();
    tolerances.push(finest);
    tolerances
}

/// The same without repetitions.
fn once<T: Clone + PartialEq>(list: &[T]) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for item in list {
        if !kept.contains(item) {
            kept.push(item.clone());
        }
    }
    kept
}

fn title(args: &Arguments) -> String {
    let stem = args.common.scene.file_stem();
    stem.map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}

/// The command as it was given, without the folder of the program.
fn command() -> String {
    let arguments = std::env::args_os();
    let mut words: Vec<String> = arguments
        .map(|a| a.to_string_lossy().into_owned())
        .collect();
    if let Some(first) = words.first_mut() {
        "antumbra".clone_into(first);
    }
    let quoted = words.into_iter().map(|w| {
        if w.contains([' ', '\'', '"', '$', '*', '|', '&', ';', '(', ')']) {
            format!("'{}'", w.replace('\'', "'\\''"))
        } else {
            w
        }
    });
    quoted.collect::<Vec<_>>().join(" ")
}

/// Processor, cores and system, as far as the system tells.
fn machine() -> String {
    let table = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = table
        .lines()
        .find_map(|l| l.strip_prefix("model name"))
        .and_then(|l| l.split_once(':'))
        .map_or("unknown processor", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!(
        "{model}, {cores} processors, {} threads, {} {}",
        rayon::current_num_threads(),
        std::env::consts::OS,
        std::env::consts::ARCH
    )
}

/// The advice, and the best run of every series.
fn summary(study: &Study) -> String {
    let mut text = format!("{}\n\n", study.advice);
    text.push_str(
        "mesher         degree   order  cheapest within the target: elements  evaluations   seconds\n",
    );
    for series in &study.series {
        let order = series
            .order_rms
            .map_or_else(|| "–".to_owned(), |o| format!("{o:.2}"));
        let good = series.runs.iter().filter(|r| r.error.max <= study.target);
        let cheapest = good.min_by(|a, b| a.seconds.median.total_cmp(&b.seconds.median));
        let cost = match cheapest {
            Some(r) => format!(
                "{:>36} {:>12} {:>9.4}",
                r.elements, r.exact_evaluations, r.seconds.median
            ),
            None => {
                let errors = series.runs.iter().map(|r| r.error.max);
                match errors.min_by(f64::total_cmp) {
                    Some(best) => format!("none, at best {best:.1e}"),
                    None => "not run".into(),
                }
            }
        };
        text.push_str(&format!(
            "{:<14} {:>6} {order:>7}  {cost}\n",
            series.mesher, series.degree
        ));
    }
    text.trim_end().to_owned()
}
