//! `antumbra check`.

use crate::Ending;
use crate::args::Check;
use crate::failure::Failure;
use crate::report::covered;
use crate::say::say;
use crate::{input, progress};
use antumbra::{Problem, Scene, Severity, thin_surfaces};
use serde_json::{Value, json};

pub(crate) fn run(check: &Check) -> Result<Ending, Failure> {
    let common = &check.common;
    let mut input = input::read_file(common)?;
    let built = input::weld(&mut input, common).and_then(|()| Scene::build(&input));
    match built {
        Ok(built) => {
            let report = built.scene.report();
            let mut warnings = built.warnings;
            warnings.extend(thin_surfaces(&built.scene));
            let doubts = input::doubts(&built.scene, &input);
            let is_complete = doubts.is_some();
            warnings.extend(doubts.into_iter().flatten());
            let ending = if is_complete {
                Ending::Done
            } else {
                let (ending, why) = progress::stopped_by();
                eprintln!(
                    "antumbra: stopped by {why}: whether rooms are closed and corners meet was not \
                     looked at"
                );
                ending
            };
            progress::keep_going();
            if common.json {
                let document = json!({
                    "version": env!("CARGO_PKG_VERSION"),
                    "accepted": true,
                    "complete": is_complete,
                    "surfaces": report.surfaces,
                    "faces": report.faces,
                    "vertices": report.vertices,
                    "edges": report.edges,
                    "planes": report.planes,
                    "emitters": report.emitters,
                    "open_edges": report.open_edges,
                    "t_vertices": report.t_vertices,
                    "closed": report.closed,
                    "extent": report.extent.to_array(),
                    "extent_metres": report.extent_metres.to_array(),
                    "area": report.area,
                    "geometric_area": report.geometric_area,
                    "covered_area": report.covered_area,
                    "covered": covered(&built.scene),
                    "length_unit": built.scene.length_unit.symbol(),
                    "quantity": built.scene.quantity.name(),
                    "notes": input.notes,
                    "problems": problems(&warnings),
                });
                say!("{document:#}");
                return Ok(ending);
            }
            for note in &input.notes {
                say!("note: {note}");
            }
            for warning in &warnings {
                say!("warning: {}", warning.message);
            }
            let unit = built.scene.length_unit.symbol();
            say!(
                "{}: accepted, {} warnings\n\
                 {} surfaces ({} emitters), {} faces, {} planes, {} vertices, {} edges\n\
                 extent {} × {} × {} {unit} ({:.3} × {:.3} × {:.3} m), area {} {unit}²\n\
                 {}: {} open edges, {} T-vertices",
                common.scene.display(),
                warnings.len(),
                report.surfaces,
                report.emitters,
                report.faces,
                report.planes,
                report.vertices,
                report.edges,
                tidy(report.extent.x),
                tidy(report.extent.y),
                tidy(report.extent.z),
                report.extent_metres.x,
                report.extent_metres.y,
                report.extent_metres.z,
                tidy(report.area),
                if report.closed { "closed" } else { "open" },
                report.open_edges,
                report.t_vertices,
            );
            if report.covered_area > 0.0 {
                say!(
                    "covered by what stands there: {} {unit}² of {} surfaces, not in the area",
                    tidy(report.covered_area),
                    built.scene.covered_areas().len(),
                );
            }
            Ok(ending)
        }
        Err(found) => {
            if common.json {
                let document = json!({
                    "version": env!("CARGO_PKG_VERSION"),
                    "accepted": false,
                    "notes": input.notes,
                    "problems": problems(&found),
                });
                say!("{document:#}");
            }
            Err(Failure::not_acceptable(input::refusal(
                &common.scene,
                &found,
                common,
            )))
        }
    }
}

fn problems(problems: &[Problem]) -> Vec<Value> {
    problems
        .iter()
        .map(|p| {
            json!({
                "severity": match p.severity {
                    Severity::Error => "error",
                    Severity::Warning => "warning",
                },
                "kind": p.kind,
                "names": p.names,
                "found": p.found,
                "allowed": p.allowed,
                "message": p.message,
            })
        })
        .collect()
}

/// A number without the last digits of its rounding: 2.03, not 2.0300000000000002.
fn tidy(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}
