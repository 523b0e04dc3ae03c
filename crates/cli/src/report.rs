//! The report of `mesh` and `solve`.

use crate::input::Loaded;
use crate::plan;
use crate::progress::peak_memory;
use antumbra::scene::FaceId;
use antumbra::{
    DirectSolution, Ended, EventCounts, EventKind, Improvement, Mesher, Phase, Plan, Progress,
    RadiositySolution, Reached, ReceiverCurves, Scene, Tolerance, order_key,
};
use serde_json::{Map, Value, json};

/// What is reported on.
pub(crate) struct Outcome<'a> {
    pub(crate) meshes: &'a DirectSolution,
    pub(crate) curves: &'a [ReceiverCurves],
    pub(crate) events: &'a EventCounts,
    pub(crate) plan: &'a Plan,
    pub(crate) improvements: &'a [Improvement],
    pub(crate) radiosity: Option<&'a RadiositySolution>,
}

/// What ended a run before its end.
pub(crate) struct Stop {
    pub(crate) why: &'static str,
    pub(crate) phase: Option<Phase>,
}

impl Outcome<'_> {
    /// Did the work end with what there was?
    pub(crate) fn is_stopped(&self) -> bool {
        self.meshes.ended == Ended::Stopped
            || self
                .radiosity
                .is_some_and(|r| r.reached != Reached::Finished)
    }
}

/// The document of `--json`.
pub(crate) fn document(
    loaded: &Loaded,
    options: &antumbra::Options,
    result: &Outcome<'_>,
    phases: &[(&'static str, f64)],
    total: f64,
    stop: Option<Stop>,
) -> Value {
    let scene = &loaded.scene;
    let meshes = result.meshes;
    let n_elements: usize = meshes.receivers.iter().map(|r| r.n_elements()).sum();
    let n_nodes: usize = meshes.receivers.iter().map(|r| r.nodes.len()).sum();
    let n_evaluations: u64 = meshes.receivers.iter().map(|r| r.exact_evaluations).sum();
    let unresolved: usize = meshes.receivers.iter().map(|r| r.unresolved.len()).sum();
    let mut seconds = Map::new();
    for (name, s) in phases {
        seconds.insert((*name).to_owned(), json!(s));
    }
    seconds.insert("total".to_owned(), json!(total));
    let (tolerance, is_relative) = match options.tolerance {
        Tolerance::Relative(t) => (t, true),
        Tolerance::Absolute(t) => (t, false),
    };
    let mut document = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "length_unit": scene.length_unit.symbol(),
        "quantity": scene.quantity.name(),
        "mesher": Mesher::Discontinuity.key(),
        "surfaces": scene.surfaces.len(),
        "emitters": scene.emitters().count(),
        "receivers": meshes.receivers.len(),
        "covered": covered(scene),
        "elements": n_elements,
        "nodes": n_nodes,
        "t_vertices": 0,
        "degree": degree(meshes, options),
        "exact_evaluations": n_evaluations,
        "tolerance": tolerance,
        "tolerance_is_relative": is_relative,
        "measured_max_error": measured(n_elements, meshes.measured_max_error),
        "measured_rms_error": measured(n_elements, meshes.measured_rms_error),
        "tolerance_reached": meshes.ended == Ended::ToleranceReached,
        "unresolved_elements": unresolved,
        "unresolved_area_fraction": unresolved_area(meshes),
        "peak_irradiance": bands(&meshes.peak),
        "events": {
            "candidates": counts(&result.events.candidates),
            "active": counts(&result.events.active),
            "inserted": counts(&result.events.inserted),
        },
        "effects": plan::effects(result.plan),
        "quality": antumbra::quality(scene, meshes),
        "after": result.improvements.iter().map(improvement).collect::<Vec<_>>(),
        "per_surface": per_surface(scene, result),
        "seconds": seconds,
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "warnings": loaded.warnings.iter().map(|w| w.message.clone()).chain(loaded.notes.iter().cloned()).collect::<Vec<_>>(),
    });
    if let Some(object) = document.as_object_mut() {
        let progress: Vec<Progress> = meshes.receivers.iter().map(|r| r.progress).collect();
        if let Some(stop) = stop {
            object.insert(
                "stopped".into(),
                stopped(&stop, &progress, result.radiosity),
            );
        }
        if let Some(radiosity) = result.radiosity {
            interreflection(object, scene, radiosity);
        }
    }
    document
}

fn improvement(step: &Improvement) -> Value {
    json!({
        "step": step.step.key(),
        "surfaces_improved": step.n_improved,
        "surfaces_taken_back": step.n_taken_back,
        "max_error": step.max_error,
        "rms_error": step.rms_error,
        "reason": step.reason,
    })
}

/// What a solve adds to the report.
pub(crate) fn interreflection(
    object: &mut Map<String, Value>,
    scene: &Scene,
    radiosity: &RadiositySolution,
) {
    if !radiosity.reached.has_values() {
        for key in ["iterations", "residual", "measured_indirect_error", "power"] {
            object.insert(key.into(), Value::Null);
        }
        object.insert("converged".into(), json!(false));
        return;
    }
    object.insert("iterations".into(), json!(radiosity.iterations));
    object.insert("residual".into(), json!(radiosity.residual));
    object.insert("converged".into(), json!(radiosity.is_converged));
    object.insert(
        "measured_indirect_error".into(),
        json!(radiosity.measured_indirect_error),
    );
    object.insert(
        "indirect".into(),
        json!({
            "elements": radiosity.indirect_elements,
            "nodes": radiosity.indirect_nodes,
            "visible_parts": radiosity.visible_parts,
        }),
    );
    let power = &radiosity.power;
    let balance = if power.emitted.is_empty() {
        Value::Null
    } else {
        json!({
            "emitted": bands(&power.emitted),
            "absorbed": bands(&power.absorbed),
            "escaped": bands(&power.escaped),
            "imbalance": power.imbalance,
        })
    };
    object.insert("power".into(), balance);
    let sums: Vec<Value> = radiosity
        .row_sums
        .iter()
        .map(|r| {
            let surface = scene.surface_of(r.face);
            json!({
                "surface": surface.name,
                "part": r.face.0 - surface.faces.start,
                "back": scene.face(r.face).is_back,
                "min": r.min,
                "max": r.max,
                "mean": r.mean,
            })
        })
        .collect();
    object.insert("row_sums".into(), json!(sums));
}

/// The sides of surfaces that bodies standing on them cover, in part or wholly.
pub(crate) fn covered(scene: &Scene) -> Value {
    let sides = scene.covered_areas();
    let entries = sides.iter().map(|side| {
        json!({
            "surface": scene.surfaces[side.surface.index()].name,
            "back": side.is_back,
            "geometric_area": side.geometric_area,
            "covered_area": side.covered_area,
        })
    });
    entries.collect()
}

/// The highest degree of any receiver: steps after meshing raise it on some.
fn degree(meshes: &DirectSolution, options: &antumbra::Options) -> u8 {
    let degrees = meshes.receivers.iter().map(|r| r.degree);
    degrees.max().unwrap_or(options.chosen_degree())
}

/// An error that was measured, unless there was nothing to measure it on.
pub(crate) fn measured(n_elements: usize, error: f64) -> Value {
    if n_elements > 0 {
        json!(error)
    } else {
        Value::Null
    }
}

/// How far the work got until it was stopped.
pub(crate) fn stopped(
    stop: &Stop,
    receivers: &[Progress],
    radiosity: Option<&RadiositySolution>,
) -> Value {
    let mut object = Map::new();
    object.insert("by".into(), json!(stop.why));
    object.insert("phase".into(), json!(stop.phase.map(Phase::name)));
    let mut counts = Map::new();
    for progress in PROGRESSES {
        let n = receivers.iter().filter(|p| **p == progress).count();
        counts.insert(words(progress).into(), json!(n));
    }
    object.insert("receivers".into(), Value::Object(counts));
    if let Some(radiosity) = radiosity {
        let (words, bytes) = match radiosity.reached {
            Reached::Finished => ("solved", None),
            Reached::Unfinished => ("solved coarsely", None),
            Reached::Nothing => ("not solved", None),
            Reached::NoRoom(bytes) => ("no room", Some(bytes)),
        };
        object.insert("interreflection".into(), json!(words));
        if let Some(bytes) = bytes {
            object.insert("interreflection_needs_bytes".into(), json!(bytes));
        }
    }
    Value::Object(object)
}

const PROGRESSES: [Progress; 4] = [
    Progress::Finished,
    Progress::Unfinished,
    Progress::BorderOnly,
    Progress::Nothing,
];

pub(crate) fn words(progress: Progress) -> &'static str {
    match progress {
        Progress::Finished => "finished",
        Progress::Unfinished => "unfinished",
        Progress::BorderOnly => "border only",
        Progress::Nothing => "nothing",
    }
}

fn n_with(result: &Outcome<'_>, progress: Progress) -> usize {
    let meshes = &result.meshes.receivers;
    meshes.iter().filter(|m| m.progress == progress).count()
}

/// One band as a number, several as an array.
pub(crate) fn bands(values: &[f64]) -> Value {
    match values {
        [one] => json!(one),
        several => json!(several),
    }
}

fn unresolved_area(meshes: &DirectSolution) -> f64 {
    unresolved_share(
        meshes
            .receivers
            .iter()
            .map(|receiver| [receiver.unresolved_area(), receiver.area()]),
    )
}

/// The share of the area whose elements are unresolved; of every receiver theirs, and all.
pub(crate) fn unresolved_share(areas: impl Iterator<Item = [f64; 2]>) -> f64 {
    let [unresolved, total] = areas.fold([0.0, 0.0], |[u, t], [unresolved, total]| {
        [u + unresolved, t + total]
    });
    if total > 0.0 { unresolved / total } else { 0.0 }
}

pub(crate) fn counts(by_kind: &[u64; 6]) -> Value {
    let mut object = Map::new();
    let mut orders = [("d0", 0), ("d1", 0), ("d2", 0)];
    for kind in EventKind::ALL {
        let n = by_kind[kind as usize];
        object.insert(kind.key().to_owned(), json!(n));
        for (key, sum) in &mut orders {
            if *key == order_key(kind.discontinuity()) {
                *sum += n;
            }
        }
    }
    for (key, sum) in orders {
        object.insert(key.to_owned(), json!(sum));
    }
    Value::Object(object)
}

fn per_surface(scene: &Scene, result: &Outcome<'_>) -> Value {
    let rows = result.meshes.receivers.iter().zip(result.curves);
    rows.map(|(mesh, curves)| {
        let row = SurfaceRow {
            face: mesh.face,
            elements: mesh.n_elements(),
            nodes: mesh.nodes.len(),
            exact_evaluations: mesh.exact_evaluations,
            max_error: mesh.max_error(),
            unresolved_elements: mesh.unresolved.len(),
            progress: mesh.progress,
        };
        row.with(scene, "curves", curves.critical.len())
    })
    .collect()
}

/// What is told of the mesh of a surface, whatever generated it.
pub(crate) struct SurfaceRow {
    pub(crate) face: FaceId,
    pub(crate) elements: usize,
    pub(crate) nodes: usize,
    pub(crate) exact_evaluations: u64,
    pub(crate) max_error: f64,
    pub(crate) unresolved_elements: usize,
    pub(crate) progress: Progress,
}

impl SurfaceRow {
    /// The row with a number that only its generator has.
    pub(crate) fn with(&self, scene: &Scene, key: &str, number: usize) -> Value {
        let surface = scene.surface_of(self.face);
        let mut row = json!({
            "surface": surface.name,
            "part": self.face.0 - surface.faces.start,
            "back": scene.face(self.face).is_back,
            "elements": self.elements,
            "nodes": self.nodes,
            "exact_evaluations": self.exact_evaluations,
            "max_error": self.max_error,
            "unresolved_elements": self.unresolved_elements,
            key: number,
        });
        if let (true, Some(object)) = (self.progress != Progress::Finished, row.as_object_mut()) {
            object.insert("progress".into(), json!(words(self.progress)));
        }
        row
    }
}

/// A few lines for people.
pub(crate) fn summary(report: &Value, result: &Outcome<'_>) -> String {
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
        result.events.active.iter().sum::<u64>(),
        result.events.candidates.iter().sum::<u64>(),
        result.meshes.measured_max_error,
        result.meshes.measured_rms_error,
        report["tolerance"],
        report["exact_evaluations"],
        report["seconds"]["total"].as_f64().unwrap_or(0.0),
    );
    for step in result.improvements {
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
    if result.is_stopped() {
        let [finished, unfinished, border, nothing] = PROGRESSES.map(|p| n_with(result, p));
        text.push_str(&format!(
            "\nstopped by {} in phase {}: of {} receivers {finished} are finished, {unfinished} are \
             less fine than asked for, {border} have coarse meshes without shadow boundaries, \
             {nothing} have no values",
            report["stopped"]["by"].as_str().unwrap_or("?"),
            report["stopped"]["phase"].as_str().unwrap_or("?"),
            result.meshes.receivers.len(),
        ));
    }
    if let Some(radiosity) = result.radiosity {
        text.push_str(&interreflection_summary(report, radiosity));
    }
    text
}

/// What a solve adds to the summary.
pub(crate) fn interreflection_summary(report: &Value, radiosity: &RadiositySolution) -> String {
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
