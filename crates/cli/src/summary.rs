//! What `mesh` and `solve` tell people: a few lines.

use crate::report::{PROGRESSES, ended, limit_message, n_with};
use antumbra::{Generator, Options, Outcome, Radiosity, Reached, Scene};
use serde_json::Value;

/// A few lines for people, from the report.
pub(crate) fn summary(
    scene: &Scene,
    options: &Options,
    report: &Value,
    outcome: &Outcome,
) -> String {
    let mut text = match options.generator {
        Generator::Curves(_) => of_curves(report, outcome),
        Generator::Cells(_) => of_cells(scene, options, report, outcome),
    };
    if let Some(radiosity) = &outcome.radiosity {
        text.push_str(&interreflection(report, radiosity));
    }
    text
}

/// Along curves.
fn of_curves(report: &Value, outcome: &Outcome) -> String {
    let inserted = &report["events"]["inserted"];
    let mut text = format!(
        "{} surfaces, {} emitters: {} elements of degree {}, {} nodes\n\
         curves: {} contact, {} VE, {} EE, {} EEE, {} facet, {} horizon, of {} ({} candidates)\n\
         error: at most {:.2e} of the peak, rms {:.2e} (allowed {})\n\
         {} exact evaluations, {:.3} s",
        report["surfaces"],
        report["emitters"],
        report["elements"],
        report["degree"],
        report["nodes"],
        inserted["contact"],
        inserted["ve"],
        inserted["ee"],
        inserted["eee"],
        inserted["facet"],
        inserted["horizon"],
        outcome.events.active.iter().sum::<u64>(),
        outcome.events.candidates.iter().sum::<u64>(),
        outcome.mesh.measured_max_error,
        outcome.mesh.measured_rms_error,
        report["tolerance"],
        report["exact_evaluations"],
        report["seconds"]["total"].as_f64().unwrap_or(0.0),
    );
    for step in &outcome.improvements {
        text.push_str(&match step.reason {
            Some(reason) => format!("\n{}: nothing changed, {reason}", step.step.key()),
            None => format!(
                "\n{}: better on {} surfaces, taken back on {}; rms {:.2e} to {:.2e}",
                step.step.key(),
                step.n_improved,
                step.n_taken_back,
                step.rms_error[0],
                step.rms_error[1]
            ),
        });
    }
    let unresolved = report["unresolved_elements"].as_u64().unwrap_or(0);
    if unresolved > 0 {
        text.push_str(&format!(
            "\n{unresolved} elements ({:.1e} of the area) are at the resolution limit",
            report["unresolved_area_fraction"].as_f64().unwrap_or(0.0),
        ));
    }
    if outcome.is_stopped() {
        let [finished, unfinished, border, nothing] = PROGRESSES.map(|p| n_with(outcome, p));
        text.push_str(&format!(
            "\nstopped by {} in phase {}: of {} receivers {finished} are finished, {unfinished} are \
             less fine than asked for, {border} have coarse meshes without shadow boundaries, \
             {nothing} have no values",
            report["stopped"]["by"].as_str().unwrap_or("?"),
            report["stopped"]["phase"].as_str().unwrap_or("?"),
            outcome.mesh.receivers.len(),
        ));
    }
    text
}

/// Of cells.
fn of_cells(scene: &Scene, options: &Options, report: &Value, outcome: &Outcome) -> String {
    let allowed = match report["tolerance"].as_f64() {
        Some(t) => format!("allowed {t}"),
        None => "no tolerance was asked for".to_owned(),
    };
    let mut text = format!(
        "{} surfaces, {} emitters: {} mesh of {} triangles and {} quadrilaterals of degree {}, {} nodes, \
         {} T-vertices\n\
         error: at most {:.2e} of the peak, rms {:.2e} ({allowed}): {}\n\
         {} exact evaluations at nodes, {} elsewhere, {:.3} s",
        report["surfaces"],
        report["emitters"],
        options.mesher().key(),
        report["triangles"],
        report["quadrilaterals"],
        report["degree"],
        report["nodes"],
        report["t_vertices"],
        outcome.mesh.measured_max_error,
        outcome.mesh.measured_rms_error,
        ended(outcome.mesh.ended),
        report["node_evaluations"],
        report["check_evaluations"],
        report["seconds"]["total"].as_f64().unwrap_or(0.0),
    );
    if let Some(limit) = &outcome.limit {
        text.push_str(&format!("\nwarning: {}", limit_message(scene, limit)));
    }
    if let Some(by) = report["stopped"]["by"].as_str() {
        text.push_str(&format!("\nstopped by {by}: the result is partial"));
    }
    text
}

/// What a solve adds to the summary.
fn interreflection(report: &Value, radiosity: &Radiosity) -> String {
    let mut text = String::new();
    match radiosity.reached {
        Reached::Finished | Reached::Unfinished => {}
        Reached::Nothing => {
            text.push_str("\ninterreflection: not solved; the values are direct light only");
            return text;
        }
        Reached::NoRoom(bytes) => {
            text.push_str(&format!(
                "\ninterreflection: not solved, it needs {:.0} MB at least; the values are \
                     direct light only",
                bytes as f64 / 1e6
            ));
            return text;
        }
    }
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in &radiosity.row_sums {
        (min, max) = (min.min(row.min), max.max(row.max));
    }
    text.push_str(&format!(
        "\ninterreflection: {} iterations, residual {:.1e}, error at most {:.2e}\n\
             power: emitted {}, absorbed {}, escaped {}, imbalance {:.1e}\n\
             row sums, raw: {min:.6} to {max:.6}{}",
        radiosity.iterations,
        radiosity.residual,
        radiosity.measured_indirect_error,
        report["power"]["emitted"],
        report["power"]["absorbed"],
        report["power"]["escaped"],
        radiosity.power.imbalance,
        if report["tolerance"]
            .as_f64()
            .is_some_and(|t| radiosity.measured_indirect_error > t)
        {
            "\nindirect light is above the tolerance where it bends sharply; that tolerance is \
                 promised for direct light only"
        } else {
            ""
        },
    ));
    text
}
