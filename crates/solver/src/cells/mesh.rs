//! From growing meshes of cells to finished ones.

use super::{CellGoal, CellMeshes, Field, Other};
use crate::field::{Light, Sample};
use crate::solution::{Cells, Elements, Ended, ReceiverMesh, Solution};
use antumbra_geom::Stop;
use antumbra_mesh::cells::CellMesh;

/// Packs the meshes and sums up what was measured.
pub(super) fn finish(meshes: CellMeshes, other: Option<Other<'_>>, stop: Stop<'_>) -> Solution {
    let (allowed, scale) = (meshes.allowed(), meshes.scale.per_band());
    let has_tolerance = matches!(meshes.options.goal, CellGoal::Tolerance(_));
    let least = meshes.options.least_size;
    let mut ended = meshes.ended;
    let others: Vec<Option<Vec<f64>>> = meshes
        .fields
        .iter()
        .map(|field| match other {
            Some(Other::Total(light) | Other::Direct(light)) => field.at_nodes(light, stop),
            None => None,
        })
        .collect();
    let mut receivers: Vec<ReceiverMesh> = meshes
        .fields
        .into_iter()
        .map(|f| pack(f, &allowed, &scale, has_tolerance, least))
        .collect();
    for (receiver, values) in receivers.iter_mut().zip(others) {
        match (other, values) {
            (None, _) => {}
            (Some(_), None) => ended = Ended::Stopped,
            (Some(Other::Total(_)), Some(total)) => receiver.irradiance = total,
            (Some(Other::Direct(_)), Some(direct)) => {
                receiver.irradiance = std::mem::replace(&mut receiver.direct, direct);
            }
        }
    }
    Solution::new(receivers, meshes.scale.peak, ended)
}

impl Field {
    /// Values of another light at all nodes; nothing if it was stopped.
    fn at_nodes(&self, light: &dyn Light, stop: Stop<'_>) -> Option<Vec<f64>> {
        let Some(current) = &self.current else {
            return Some(Vec::new());
        };
        let layout = &current.layout;
        let free: Vec<usize> = (0..layout.places.len())
            .filter(|&n| !layout.is_constrained[n])
            .collect();
        let samples: Vec<Sample> = free
            .iter()
            .map(|&n| self.places.sample(layout.places[n], &self.chart))
            .collect();
        let mut values = vec![0.0; layout.places.len() * self.n_bands];
        if light.reaches(self.face) {
            let found = light.irradiance(self.face, &samples, self.contact_radius, stop)?;
            for (&n, found) in free
                .iter()
                .zip(found.values.chunks_exact(self.n_bands.max(1)))
            {
                values[n * self.n_bands..(n + 1) * self.n_bands].copy_from_slice(found);
            }
        }
        layout.complete(&mut values, self.n_bands);
        Some(values)
    }
}

fn pack(
    mut field: Field,
    allowed: &[f64],
    scale: &[f64],
    has_tolerance: bool,
    least: f64,
) -> ReceiverMesh {
    let [node_evaluations, check_evaluations] = if field.is_dark {
        [0, 0]
    } else {
        field.places.n_evaluations()
    };
    let n_elements = field.n_elements();
    let element_errors = (0..n_elements).map(|c| field.excess(c, scale)).collect();
    let above: Vec<u32> = (0..n_elements)
        .filter(|&c| field.is_thin || (has_tolerance && field.excess(c, allowed) > 1.0))
        .map(|c| c as u32)
        .collect();
    let unresolved = above
        .iter()
        .copied()
        .filter(|&c| field.is_at_least_size(c as usize, least))
        .collect();
    let (layout, direct) = match field.current.take() {
        Some(current) => (Some(current.layout), current.direct),
        None => (None, Vec::new()),
    };
    let (mesh, places, is_constrained, first_node, element_nodes) = match layout {
        Some(layout) => (
            layout.mesh,
            layout.places,
            layout.is_constrained,
            layout.first,
            layout.cell_nodes,
        ),
        None => (
            CellMesh::default(),
            Vec::new(),
            Vec::new(),
            vec![0],
            Vec::new(),
        ),
    };
    let places = places.iter();
    let toward = places.clone().map(|&p| field.places.toward(p)).collect();
    ReceiverMesh {
        face: field.face,
        progress: field.progress,
        chart: field.chart,
        elements: Elements::Cells(Cells::new(
            mesh,
            first_node,
            toward,
            is_constrained,
            node_evaluations,
        )),
        degree: field.degree,
        nodes: places.map(|&p| field.places.position(p)).collect(),
        direct,
        irradiance: Vec::new(),
        element_nodes,
        element_errors,
        exact_evaluations: node_evaluations + check_evaluations,
        n_above: above.len(),
        is_thin: field.is_thin,
        unresolved,
        n_bands: field.n_bands,
    }
}
