//! The report of `mesh` and `solve` for mesh generators that know nothing of shadows.

use crate::input::Loaded;
use crate::progress::peak_memory;
use crate::report::{
    Stop, SurfaceRow, bands, interreflection, interreflection_summary, measured, stopped,
    unresolved_share,
};
use antumbra::{
    CellEnded, CellOptions, CellSize, CellSolution, DirectMesh, Mesher, Progress,
    RadiositySolution, Reached, Scene, SizeLimit, Tolerance,
};
use serde_json::{Map, Value, json};

/// What is reported on.
pub(crate) struct CellOutcome<'a> {
    pub(crate) meshes: &'a CellSolution,
    pub(crate) mesher: Mesher,
    pub(crate) limit: Option<&'a SizeLimit>,
    pub(crate) radiosity: Option<&'a RadiositySolution>,
}

impl CellOutcome<'_> {
    /// Did the work end with what there was?
    pub(crate) fn is_stopped(&self) -> bool {
        self.meshes.ended == CellEnded::Stopped
            || self
                .radiosity
                .is_some_and(|r| r.reached != Reached::Finished)
    }
}

/// The document of `--json`: the keys of the discontinuity mesh as far as they make sense.
pub(crate) fn document(
    loaded: &Loaded,
    options: &CellOptions,
    result: &CellOutcome<'_>,
    phases: &[(&'static str, f64)],
    total: f64,
    stop: Option<Stop>,
) -> Value {
    let scene = &loaded.scene;
    let meshes = result.meshes;
    let n_elements = meshes.n_elements();
    let receivers = &meshes.receivers;
    let mut seconds = Map::new();
    for (name, s) in phases {
        seconds.insert((*name).to_owned(), json!(s));
    }
    seconds.insert("total".to_owned(), json!(total));
    let (tolerance, is_relative) = match options.size {
        CellSize::Tolerance(Tolerance::Relative(t)) => (Some(t), Some(true)),
        CellSize::Tolerance(Tolerance::Absolute(t)) => (Some(t), Some(false)),
        CellSize::Length(_) | CellSize::Elements(_) => (None, None),
    };
    let is_quad = |r: &&antumbra::CellReceiverMesh| {
        let cells = r.mesh.cells.iter();
        cells.filter(|c| c.is_quadrilateral()).count()
    };
    let warnings = loaded.warnings.iter().map(|w| w.message.clone());
    let limit = result.limit.map(|limit| limit_message(scene, limit));
    let quality = antumbra::quality(scene, meshes);
    // Rounding may call a square better than the best; where nothing is, nothing is bad.
    let worst_quality = if n_elements > 0 {
        quality.min.min(1.0)
    } else {
        1.0
    };
    let n_quads: usize = receivers.iter().map(|r| is_quad(&r)).sum();
    let node_evaluations: u64 = receivers.iter().map(|r| r.node_evaluations).sum();
    let mut document = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "length_unit": scene.length_unit.symbol(),
        "quantity": scene.quantity.name(),
        "mesher": result.mesher.key(),
        "estimator": options.estimator.key(),
        "surfaces": scene.surfaces.len(),
        "emitters": scene.emitters().count(),
        "covered": crate::report::covered(scene),
        "receivers": receivers.len(),
        "elements": n_elements,
        "triangles": n_elements - n_quads,
        "quadrilaterals": n_quads,
        "nodes": meshes.n_nodes(),
        "t_vertices": meshes.n_t_vertices(),
        "degree": options.chosen_degree(),
        "exact_evaluations": meshes.exact_evaluations(),
        "node_evaluations": node_evaluations,
        "check_evaluations": meshes.exact_evaluations() - node_evaluations,
        "tolerance": tolerance,
        "tolerance_is_relative": is_relative,
        "measured_max_error": measured(n_elements, meshes.measured_max_error),
        "measured_rms_error": measured(n_elements, meshes.measured_rms_error),
        "tolerance_reached": tolerance.map(|_| meshes.has_reached_goal()),
        "ended": ended(meshes.ended),
        "elements_above_tolerance": receivers.iter().map(|r| r.n_above).sum::<usize>(),
        "unresolved_elements": receivers.iter().map(|r| r.unresolved.len()).sum::<usize>(),
        "unresolved_area_fraction": unresolved_area(meshes),
        "worst_shape_quality": worst_quality,
        "quality": quality,
        "peak_irradiance": bands(&meshes.peak),
        "per_surface": per_surface(scene, meshes),
        "seconds": seconds,
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "warnings": warnings.chain(loaded.notes.iter().cloned()).chain(limit).collect::<Vec<_>>(),
    });
    if let Some(object) = document.as_object_mut() {
        let progress: Vec<Progress> = receivers.iter().map(|r| r.progress).collect();
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

/// Why elements are not as small as was asked for, and the option that can change it.
fn limit_message(scene: &Scene, limit: &SizeLimit) -> String {
    let option = match limit {
        SizeLimit::MostElements { .. } => "",
        SizeLimit::LeastSize { .. } | SizeLimit::FewerElements { .. } => " (--least-size)",
    };
    format!("{}{option}", limit.message(scene.length_unit.symbol()))
}

fn ended(ended: CellEnded) -> &'static str {
    match ended {
        CellEnded::ToleranceReached => "tolerance reached",
        CellEnded::EstimateReached => "estimate within the tolerance, measured error above it",
        CellEnded::LeastSizeReached => "elements of the least size are above the tolerance",
        CellEnded::Stalled => "smaller elements do not lower the error any more",
        CellEnded::TooManyElements => "limit on elements reached",
        CellEnded::AsAsked => "as many elements as asked for",
        CellEnded::Stopped => "stopped",
    }
}

fn unresolved_area(meshes: &CellSolution) -> f64 {
    unresolved_share(meshes.receivers.iter().map(|receiver| {
        let unresolved = receiver.unresolved.iter();
        let areas = unresolved.map(|&c| receiver.mesh.area(c as usize));
        [areas.sum(), receiver.mesh.total_area()]
    }))
}

fn per_surface(scene: &Scene, meshes: &CellSolution) -> Value {
    let rows = meshes.receivers.iter();
    rows.map(|mesh| {
        let row = SurfaceRow {
            face: mesh.face,
            elements: mesh.n_elements(),
            nodes: mesh.nodes.len(),
            exact_evaluations: mesh.exact_evaluations(),
            max_error: mesh.max_error(),
            unresolved_elements: mesh.unresolved.len(),
            progress: mesh.progress,
        };
        row.with(scene, "t_vertices", mesh.mesh.n_t_vertices())
    })
    .collect()
}

/// A few lines for people.
pub(crate) fn summary(scene: &Scene, report: &Value, result: &CellOutcome<'_>) -> String {
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
        result.mesher.key(),
        report["triangles"],
        report["quadrilaterals"],
        report["degree"],
        report["nodes"],
        report["t_vertices"],
        result.meshes.measured_max_error,
        result.meshes.measured_rms_error,
        ended(result.meshes.ended),
        report["node_evaluations"],
        report["check_evaluations"],
        report["seconds"]["total"].as_f64().unwrap_or(0.0),
    );
    if let Some(limit) = result.limit {
        text.push_str(&format!("\nwarning: {}", limit_message(scene, limit)));
    }
    if let Some(by) = report["stopped"]["by"].as_str() {
        text.push_str(&format!("\nstopped by {by}: the result is partial"));
    }
    if let Some(radiosity) = result.radiosity {
        text.push_str(&interreflection_summary(report, radiosity));
    }
    text
}
