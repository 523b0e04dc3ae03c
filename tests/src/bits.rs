//! Everything that meshes say, bit by bit: two that are equal here are the same.

use antumbra::Solution;
use glam::DVec2;

/// All that meshes say.
#[must_use]
pub fn bits_of_meshes(solution: &Solution) -> Vec<u64> {
    let mut all = Vec::new();
    for mesh in &solution.receivers {
        let values = [&mesh.direct, &mesh.irradiance, &mesh.element_errors];
        push_mesh(&mut all, &mesh.element_nodes, &mesh.nodes, values);
        all.push(mesh.exact_evaluations);
        all.extend(mesh.cells().map(|cells| cells.node_evaluations));
    }
    push_measures(
        &mut all,
        &solution.peak,
        [solution.measured_max_error, solution.measured_rms_error],
    );
    all
}

fn push_mesh(all: &mut Vec<u64>, element_nodes: &[u32], nodes: &[DVec2], values: [&Vec<f64>; 3]) {
    all.extend(element_nodes.iter().map(|&n| u64::from(n)));
    let coordinates = nodes.iter().flat_map(|p| p.to_array());
    let values = values.into_iter().flatten().copied();
    all.extend(coordinates.chain(values).map(f64::to_bits));
}

fn push_measures(all: &mut Vec<u64>, peak: &[f64], errors: [f64; 2]) {
    all.extend(peak.iter().copied().chain(errors).map(f64::to_bits));
}
