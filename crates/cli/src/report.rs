//! The report of `mesh` and `solve`.

use crate::input::Loaded;
use crate::progress::peak_memory;
use antumbra::{
    Ended, EventKind, Generator, Improvement, Options, Outcome, Phase, Plan, Progress, Radiosity,
    Reached, Scene, SizeLimit, Solution, Tolerance, order_key,
};
use serde_json::{Map, Value, json};

/// What ended a run before its end.
pub(crate) struct Stop {
    pub(crate) why: &'static str,
    pub(crate) phase: Option<Phase>,
}

/// The document of `--json`; what only some generators have is there for them alone.
pub(crate) fn document(
    loaded: &Loaded,
    options: &Options,
    outcome: &Outcome,
    phases: &[(&'static str, f64)],
    total: f64,
    stop: Option<Stop>,
) -> Value {
    let scene = &loaded.scene;
    let mesh = &outcome.mesh;
    let n_elements = mesh.n_elements();
    let unresolved: usize = mesh.receivers.iter().map(|r| r.unresolved.len()).sum();
    let mut seconds = Map::new();
    for (name, s) in phases {
        seconds.insert((*name).to_owned(), json!(s));
    }
    seconds.insert("total".to_owned(), json!(total));
    let (tolerance, is_relative) = match options.kept_tolerance() {
        Some(Tolerance::Relative(t)) => (Some(t), Some(true)),
        Some(Tolerance::Absolute(t)) => (Some(t), Some(false)),
        None => (None, None),
    };
    let warnings = loaded.warnings.iter().map(|w| w.message.clone());
    let limit = outcome.limit.map(|limit| limit_message(scene, &limit));
    let mut document = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "length_unit": scene.length_unit.symbol(),
        "quantity": scene.quantity.name(),
        "mesher": options.mesher().key(),
        "surfaces": scene.surfaces.len(),
        "emitters": scene.emitters().count(),
        "receivers": mesh.receivers.len(),
        "covered": covered(scene),
        "elements": n_elements,
        "nodes": mesh.n_nodes(),
        "t_vertices": mesh.n_t_vertices(),
        "degree": degree(mesh, options),
        "exact_evaluations": mesh.exact_evaluations(),
        "tolerance": tolerance,
        "tolerance_is_relative": is_relative,
        "measured_max_error": measured(n_elements, mesh.measured_max_error),
        "measured_rms_error": measured(n_elements, mesh.measured_rms_error),
        "tolerance_reached": tolerance.map(|_| mesh.has_reached_goal()),
        "unresolved_elements": unresolved,
        "unresolved_area_fraction": unresolved_area(mesh),
        "peak_irradiance": bands(&mesh.peak),
        "quality": antumbra::quality(scene, mesh),
        "per_surface": per_surface(scene, outcome),
        "seconds": seconds,
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "warnings": warnings.chain(loaded.notes.iter().cloned()).chain(limit).collect::<Vec<_>>(),
    });
    if let Some(object) = document.as_object_mut() {
        if let Some(plan) = &outcome.plan {
            along_curves(object, outcome, plan);
        }
        if let Generator::Cells(cells) = options.generator {
            object.insert("estimator".into(), json!(cells.estimator.key()));
            of_cells(object, scene, mesh);
        }
        if let Some(stop) = stop {
            object.insert("stopped".into(), stopped(&stop, outcome));
        }
        if let Some(radiosity) = &outcome.radiosity {
            interreflection(object, scene, radiosity);
        }
    }
    document
}

/// What only meshes along curves have.
fn along_curves(object: &mut Map<String, Value>, outcome: &Outcome, plan: &Plan) {
    let events = json!({
        "candidates": counts(&outcome.events.candidates),
        "active": counts(&outcome.events.active),
        "inserted": counts(&outcome.events.inserted),
    });
    object.insert("events".into(), events);
    object.insert("effects".into(), json!(effects(plan)));
    let after = outcome.improvements.iter().map(improvement);
    object.insert("after".into(), after.collect());
}

/// The effects of a plan as reports have them.
pub(crate) fn effects(plan: &Plan) -> Vec<Value> {
    plan.effects
        .iter()
        .map(|e| {
            json!({
                "name": e.name,
                "decision": e.decision.words(),
                "bound": e.bound,
                "reason": e.reason,
            })
        })
        .collect()
}

/// What only meshes of cells have.
fn of_cells(object: &mut Map<String, Value>, scene: &Scene, mesh: &Solution) {
    let receivers = || mesh.receivers.iter();
    let cells = || receivers().filter_map(antumbra::ReceiverMesh::cells);
    let each = cells().flat_map(|c| &c.mesh.cells);
    let n_quads = each.filter(|c| c.is_quadrilateral()).count();
    let node_evaluations: u64 = cells().map(|c| c.node_evaluations).sum();
    let n_above: usize = receivers().map(|r| r.n_above).sum();
    // Rounding may call a square better than the best; where nothing is, nothing is bad.
    let worst_quality = match mesh.n_elements() {
        0 => 1.0,
        _ => antumbra::quality(scene, mesh).min.min(1.0),
    };
    for (key, value) in [
        ("triangles", json!(mesh.n_elements() - n_quads)),
        ("quadrilaterals", json!(n_quads)),
        ("node_evaluations", json!(node_evaluations)),
        (
            "check_evaluations",
            json!(mesh.exact_evaluations() - node_evaluations),
        ),
        ("ended", json!(ended(mesh.ended))),
        ("elements_above_tolerance", json!(n_above)),
        ("worst_shape_quality", json!(worst_quality)),
    ] {
        object.insert(key.into(), value);
    }
}

/// Why cells are not as small as was asked for, and the option that can change it.
pub(crate) fn limit_message(scene: &Scene, limit: &SizeLimit) -> String {
    let option = match limit {
        SizeLimit::MostElements { .. } => "",
        SizeLimit::LeastSize { .. } | SizeLimit::FewerElements { .. } => " (--least-size)",
    };
    format!("{}{option}", limit.message(scene.length_unit.symbol()))
}

/// Why refinement of cells ended.
pub(crate) fn ended(ended: Ended) -> &'static str {
    match ended {
        Ended::ToleranceReached => "tolerance reached",
        Ended::EstimateReached => "estimate within the tolerance, measured error above it",
        Ended::ResolutionReached => "elements of the least size are above the tolerance",
        Ended::Stalled => "smaller elements do not lower the error any more",
        Ended::TooManyElements => "limit on elements reached",
        Ended::AsAsked => "as many elements as asked for",
        Ended::Stopped => "stopped",
    }
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
fn interreflection(object: &mut Map<String, Value>, scene: &Scene, radiosity: &Radiosity) {
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
fn degree(mesh: &Solution, options: &Options) -> u8 {
    let degrees = mesh.receivers.iter().map(|r| r.degree);
    degrees.max().unwrap_or(options.chosen_degree())
}

/// An error that was measured, unless there was nothing to measure it on.
fn measured(n_elements: usize, error: f64) -> Value {
    if n_elements > 0 {
        json!(error)
    } else {
        Value::Null
    }
}

/// How far the work got until it was stopped.
fn stopped(stop: &Stop, outcome: &Outcome) -> Value {
    let mut object = Map::new();
    object.insert("by".into(), json!(stop.why));
    object.insert("phase".into(), json!(stop.phase.map(Phase::name)));
    let mut counts = Map::new();
    for progress in PROGRESSES {
        counts.insert(words(progress).into(), json!(n_with(outcome, progress)));
    }
    object.insert("receivers".into(), Value::Object(counts));
    if let Some(radiosity) = &outcome.radiosity {
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

pub(crate) const PROGRESSES: [Progress; 4] = [
    Progress::Finished,
    Progress::Unfinished,
    Progress::BorderOnly,
    Progress::Nothing,
];

fn words(progress: Progress) -> &'static str {
    match progress {
        Progress::Finished => "finished",
        Progress::Unfinished => "unfinished",
        Progress::BorderOnly => "border only",
        Progress::Nothing => "nothing",
    }
}

/// How many receivers got that far.
pub(crate) fn n_with(outcome: &Outcome, progress: Progress) -> usize {
    let receivers = outcome.mesh.receivers.iter();
    receivers.filter(|m| m.progress == progress).count()
}

/// One band as a number, several as an array.
pub(crate) fn bands(values: &[f64]) -> Value {
    match values {
        [one] => json!(one),
        several => json!(several),
    }
}

/// The share of the area whose elements are unresolved.
fn unresolved_area(mesh: &Solution) -> f64 {
    let areas = mesh.receivers.iter();
    let [unresolved, total] = areas
        .map(|receiver| [receiver.unresolved_area(), receiver.area()])
        .fold([0.0, 0.0], |[u, t], [unresolved, total]| {
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

fn per_surface(scene: &Scene, outcome: &Outcome) -> Value {
    let rows = outcome.mesh.receivers.iter().zip(&outcome.curves);
    rows.map(|(mesh, curves)| {
        let (key, number) = match mesh.cells() {
            Some(_) => ("t_vertices", mesh.n_t_vertices()),
            None => ("curves", curves.critical.len()),
        };
        let surface = scene.surface_of(mesh.face);
        let mut row = json!({
            "surface": surface.name,
            "part": mesh.face.0 - surface.faces.start,
            "back": scene.face(mesh.face).is_back,
            "elements": mesh.n_elements(),
            "nodes": mesh.nodes.len(),
            "exact_evaluations": mesh.exact_evaluations,
            "max_error": mesh.max_error(),
            "unresolved_elements": mesh.unresolved.len(),
            key: number,
        });
        if let (true, Some(object)) = (mesh.progress != Progress::Finished, row.as_object_mut()) {
            object.insert("progress".into(), json!(words(mesh.progress)));
        }
        row
    })
    .collect()
}
