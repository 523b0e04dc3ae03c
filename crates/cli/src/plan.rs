//! `antumbra plan`.

use crate::Ending;
use crate::args::PlanArgs;
use crate::failure::Failure;
use crate::input::{self, Loaded};
use crate::progress::Watch;
use crate::report::{counts, effects};
use crate::say::say;
use antumbra::{Control, Effect, Evaluator, EventKind, ExactLight, Plan, Quantity, Scratch};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::time::Instant;

pub(crate) fn run(args: &PlanArgs) -> Result<Ending, Failure> {
    let common = &args.common;
    let options = args.meshing.discontinuity("plan")?;
    let loaded = input::load(common)?;
    let watch = Watch::new(common);
    let quantity = if args.direct {
        Quantity::Direct
    } else {
        Quantity::Total
    };
    let plan = watch.run(|control| antumbra::plan(&loaded.scene, &options, quantity, control));
    // A plan of some of the receivers would be none of the scene.
    if watch.should_stop() {
        let (ending, why) = watch.stopped();
        eprintln!("antumbra: stopped by {why} before the plan was complete: there is none");
        return Ok(ending);
    }
    let (_, planning) = watch.finish();
    let seconds = plan
        .expected
        .map(|e| planning + e.exact_evaluations * seconds_per_evaluation(&loaded));
    if common.json {
        say!("{:#}", document(&loaded, &plan, seconds));
    } else {
        say!("{}", table(&plan, seconds).trim_end());
    }
    Ok(Ending::Done)
}

/// Measured on points of the scene itself, for all threads together.
fn seconds_per_evaluation(loaded: &Loaded) -> f64 {
    let scene = &loaded.scene;
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    let start = Instant::now();
    let mut n = 0;
    for piece in scene.pieces.iter().cycle() {
        let corners = scene.positions(&piece.vertices);
        let middle = corners.iter().sum::<glam::DVec3>() / corners.len() as f64;
        let _ = light.at(piece.face, middle, &mut scratch);
        n += 1;
        if n >= 2000 || (n >= 20 && start.elapsed().as_secs_f64() > 0.05) {
            break;
        }
    }
    start.elapsed().as_secs_f64() / f64::from(n) / rayon::current_num_threads() as f64
}

fn document(loaded: &Loaded, plan: &Plan, seconds: Option<f64>) -> Value {
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "surfaces": loaded.scene.surfaces.len(),
        "emitters": loaded.scene.emitters().count(),
        "receivers": loaded.scene.faces.len(),
        "degree": plan.degree,
        "tolerance": plan.relative_tolerance,
        "bounces": plan.bounces,
        "events": {
            "candidates": counts(&plan.candidates),
            "active": counts(&plan.curves),
            "lines": counts(&plan.lines),
        },
        "effects": effects(plan),
        "expected": plan.expected.map(|e| json!({
            "elements": e.elements.round(),
            "exact_evaluations": e.exact_evaluations.round(),
            "memory_bytes": e.memory_bytes.round(),
            "seconds_of_direct_light": seconds,
        })),
        "warnings": loaded.warnings.iter().map(|w| w.message.clone()).chain(loaded.notes.iter().cloned()).collect::<Vec<_>>(),
    })
}

/// Columns for people: effect, decision, bound, reason.
fn table(plan: &Plan, seconds: Option<f64>) -> String {
    let mut text = format!(
        "{:<18} {:<10} {:>9}  {}\n",
        "effect", "decision", "bound", "reason"
    );
    for Effect {
        name,
        decision,
        bound,
        reason,
    } in &plan.effects
    {
        let bound = if *bound == 0.0 {
            "0".to_owned()
        } else {
            format!("{bound:.1e}")
        };
        let _ = writeln!(
            text,
            "{name:<18} {:<10} {bound:>9}  {reason}",
            decision.words()
        );
    }
    let _ = writeln!(
        text,
        "\nThe bound is what leaving an effect out changes any value by at most, relative to the \
         peak of direct irradiance."
    );
    let sum = |by_kind: &[u64; 6]| {
        EventKind::ALL
            .iter()
            .map(|&k| by_kind[k as usize])
            .sum::<u64>()
    };
    let _ = writeln!(
        text,
        "curves: {} of {} candidates, {} of them lines from the start",
        sum(&plan.curves),
        sum(&plan.candidates),
        sum(&plan.lines),
    );
    if let (Some(e), Some(seconds)) = (plan.expected, seconds) {
        let _ = writeln!(
            text,
            "expected, within a factor of about two: {:.0} elements, {:.0} exact evaluations, \
             {:.1} MB, {seconds:.2} s for direct light",
            e.elements,
            e.exact_evaluations,
            e.memory_bytes / 1e6,
        );
    }
    text
}
