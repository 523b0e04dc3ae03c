//! Finished meshes of cells.

use super::{CellEnded, CellGoal, CellMeshes, Field, Other};
use crate::basis::{quad_values, values};
use crate::direct::{DirectSolution, Ended};
use crate::field::{Light, Progress, Sample};
use antumbra_geom::{Chart, Stop};
use antumbra_mesh::cells::{CellLocator, CellMesh};
use antumbra_scene::FaceId;
use glam::DVec2;

/// A receiver's mesh of cells with its values.
#[derive(Debug)]
pub struct CellReceiverMesh {
    /// Whose front it is.
    pub face: FaceId,
    /// How far it got.
    pub progress: Progress,
    /// Its frame.
    pub chart: Chart,
    /// Triangles and quadrilaterals.
    pub mesh: CellMesh,
    /// Degree of all elements.
    pub degree: u8,
    /// Where values are stored, in the chart.
    pub nodes: Vec<DVec2>,
    /// The direction in the chart from which a node's value is the limit; on the border.
    pub toward: Vec<Option<DVec2>>,
    /// Does a node's value follow from those of a larger element?
    pub is_constrained: Vec<bool>,
    /// Direct irradiance, `n_bands` values per node.
    pub direct: Vec<f64>,
    /// Irradiance with interreflection, `n_bands` values per node; empty if only direct
    /// light was asked for.
    pub irradiance: Vec<f64>,
    /// Where the nodes of every element begin in `element_nodes`, and where the last
    /// element's end.
    pub first_node: Vec<u32>,
    /// Nodes of every element, in the order of [`lattice`](crate::basis::lattice) for
    /// triangles and [`quad_lattice`](crate::basis::quad_lattice) for quadrilaterals.
    pub element_nodes: Vec<u32>,
    /// Measured error of every element, relative to the peak of the worst band.
    pub element_errors: Vec<f64>,
    /// Exact evaluations at places that are nodes, or were before elements were refined.
    pub node_evaluations: u64,
    /// Exact evaluations elsewhere: at check points, and those of estimators.
    pub check_evaluations: u64,
    /// Elements of the least size whose error is above the tolerance.
    pub unresolved: Vec<u32>,
    /// Is it thinner than a few pixels of an arrangement? Then all elements are unresolved,
    /// and their error does not count.
    pub is_thin: bool,
    /// Elements whose error is above the tolerance, the unresolved ones among them.
    pub n_above: usize,
    n_bands: usize,
    locator: CellLocator,
}

impl CellReceiverMesh {
    /// Number of elements.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        self.mesh.cells.len()
    }

    /// Exact evaluations in all.
    #[must_use]
    pub fn exact_evaluations(&self) -> u64 {
        self.node_evaluations + self.check_evaluations
    }

    /// The nodes of an element.
    #[must_use]
    pub fn nodes_of(&self, element: usize) -> &[u32] {
        let range = self.first_node[element] as usize..self.first_node[element + 1] as usize;
        &self.element_nodes[range]
    }

    /// Largest measured error, relative to the peak; unresolved elements too.
    #[must_use]
    pub fn max_error(&self) -> f64 {
        self.element_errors.iter().copied().fold(0.0, f64::max)
    }

    /// The element at a chart point, and its reference coordinates there
    /// ([`CellMesh::point`]).
    #[must_use]
    pub fn locate(&self, point: DVec2) -> Option<(usize, [f64; 2])> {
        self.locator.locate(&self.mesh, point)
    }

    /// Interpolated direct irradiance per band.
    #[must_use]
    pub fn direct_at(&self, element: usize, at: [f64; 2]) -> Vec<f64> {
        let mut values = self.interpolate(&self.direct, self.n_bands, element, at);
        // Polynomials overshoot a little where light ends; light does not.
        values.iter_mut().for_each(|v| *v = v.max(0.0));
        values
    }

    /// Interpolates any field on the nodes, `width` values per node.
    #[must_use]
    pub fn interpolate(
        &self,
        field: &[f64],
        width: usize,
        element: usize,
        at: [f64; 2],
    ) -> Vec<f64> {
        let mut result = vec![0.0f64; width];
        let mut add = |phi: &[f64]| {
            for (&node, phi) in self.nodes_of(element).iter().zip(phi) {
                let at = node as usize * width;
                for (r, v) in result.iter_mut().zip(&field[at..at + width]) {
                    *r += phi * v;
                }
            }
        };
        if self.mesh.cells[element].is_quadrilateral() {
            add(&quad_values(self.degree, at));
        } else {
            add(&values(self.degree, [1.0 - at[0] - at[1], at[0], at[1]]));
        }
        result
    }
}

/// All receivers' meshes of cells, and what was measured.
#[derive(Debug)]
pub struct CellSolution {
    /// One per receiver, in the order given.
    pub receivers: Vec<CellReceiverMesh>,
    /// Largest irradiance per band.
    pub peak: Vec<f64>,
    /// Largest error at a check point, relative to the peak.
    pub measured_max_error: f64,
    /// Root mean square over the area of the elements' largest errors, relative to the
    /// peak.
    pub measured_rms_error: f64,
    /// Why refinement ended.
    pub ended: CellEnded,
}

impl CellSolution {
    /// Vertices inside an edge of an element, on all receivers.
    #[must_use]
    pub fn n_t_vertices(&self) -> usize {
        self.receivers.iter().map(|r| r.mesh.n_t_vertices()).sum()
    }
}

/// What every mesh with direct light can be asked, whatever generated it.
pub trait DirectMesh {
    /// Elements of all receivers.
    fn n_elements(&self) -> usize;
    /// Nodes of all receivers.
    fn n_nodes(&self) -> usize;
    /// Exact evaluations: at nodes, at check points, and those of estimators.
    fn exact_evaluations(&self) -> u64;
    /// Largest irradiance per band.
    fn peak(&self) -> &[f64];
    /// Largest error at a check point, relative to the peak.
    fn measured_max_error(&self) -> f64;
    /// Root mean square of the elements' largest errors, relative to the peak.
    fn measured_rms_error(&self) -> f64;
    /// Is the tolerance kept wherever the error was measured? If none was asked for: is the
    /// mesh as it was to be?
    fn has_reached_goal(&self) -> bool;
    /// Was the work stopped before its end?
    fn is_stopped(&self) -> bool;
    /// Interpolated direct irradiance per band at a chart point of a receiver, by its
    /// number; `None` outside of the mesh.
    fn direct_at(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>>;
    /// The frame of a receiver.
    fn chart(&self, receiver: usize) -> &Chart;
    /// How many receivers there are.
    fn n_receivers(&self) -> usize;
}

impl DirectMesh for CellSolution {
    fn n_elements(&self) -> usize {
        self.receivers.iter().map(|r| r.n_elements()).sum()
    }

    fn n_nodes(&self) -> usize {
        self.receivers.iter().map(|r| r.nodes.len()).sum()
    }

    fn exact_evaluations(&self) -> u64 {
        let each = self.receivers.iter();
        each.map(CellReceiverMesh::exact_evaluations).sum()
    }

    fn peak(&self) -> &[f64] {
        &self.peak
    }

    fn measured_max_error(&self) -> f64 {
        self.measured_max_error
    }

    fn measured_rms_error(&self) -> f64 {
        self.measured_rms_error
    }

    fn has_reached_goal(&self) -> bool {
        matches!(self.ended, CellEnded::ToleranceReached | CellEnded::AsAsked)
    }

    fn is_stopped(&self) -> bool {
        self.ended == CellEnded::Stopped
    }

    fn direct_at(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>> {
        let mesh = &self.receivers[receiver];
        let (element, at) = mesh.locate(uv)?;
        Some(mesh.direct_at(element, at))
    }

    fn chart(&self, receiver: usize) -> &Chart {
        &self.receivers[receiver].chart
    }

    fn n_receivers(&self) -> usize {
        self.receivers.len()
    }
}

impl DirectMesh for DirectSolution {
    fn n_elements(&self) -> usize {
        self.receivers.iter().map(|r| r.n_elements()).sum()
    }

    fn n_nodes(&self) -> usize {
        self.receivers.iter().map(|r| r.nodes.len()).sum()
    }

    fn exact_evaluations(&self) -> u64 {
        self.receivers.iter().map(|r| r.exact_evaluations).sum()
    }

    fn peak(&self) -> &[f64] {
        &self.peak
    }

    fn measured_max_error(&self) -> f64 {
        self.measured_max_error
    }

    fn measured_rms_error(&self) -> f64 {
        self.measured_rms_error
    }

    fn has_reached_goal(&self) -> bool {
        self.ended == Ended::ToleranceReached
    }

    fn is_stopped(&self) -> bool {
        self.ended == Ended::Stopped
    }

    fn direct_at(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>> {
        let mesh = &self.receivers[receiver];
        let (element, at) = mesh.locate(uv)?;
        Some(mesh.direct_at(element, at))
    }

    fn chart(&self, receiver: usize) -> &Chart {
        &self.receivers[receiver].chart
    }

    fn n_receivers(&self) -> usize {
        self.receivers.len()
    }
}

/// Packs the meshes and sums up what was measured.
pub(super) fn finish(meshes: CellMeshes, other: Option<Other<'_>>, stop: Stop<'_>) -> CellSolution {
    let (allowed, scale) = (meshes.allowed(), meshes.scale());
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
    let mut receivers: Vec<CellReceiverMesh> = meshes
        .fields
        .into_iter()
        .map(|f| pack(f, &allowed, &scale, has_tolerance, least))
        .collect();
    for (receiver, values) in receivers.iter_mut().zip(others) {
        match (other, values) {
            (None, _) => {}
            (Some(_), None) => ended = CellEnded::Stopped,
            (Some(Other::Total(_)), Some(total)) => receiver.irradiance = total,
            (Some(Other::Direct(_)), Some(direct)) => {
                receiver.irradiance = std::mem::replace(&mut receiver.direct, direct);
            }
        }
    }
    let (mut max, mut square, mut area) = (0.0f64, 0.0, 0.0);
    for receiver in &receivers {
        if !receiver.is_thin {
            max = max.max(receiver.max_error());
        }
        for (c, &error) in receiver.element_errors.iter().enumerate() {
            let a = receiver.mesh.area(c);
            square += error * error * a;
            area += a;
        }
    }
    CellSolution {
        receivers,
        peak: meshes.peak,
        measured_max_error: max,
        measured_rms_error: if area > 0.0 {
            (square / area).sqrt()
        } else {
            0.0
        },
        ended,
    }
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
            for (&n, found) in free.iter().zip(found.chunks_exact(self.n_bands.max(1))) {
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
) -> CellReceiverMesh {
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
    CellReceiverMesh {
        face: field.face,
        progress: field.progress,
        chart: field.chart,
        locator: CellLocator::new(&mesh),
        mesh,
        degree: field.degree,
        nodes: places.clone().map(|&p| field.places.position(p)).collect(),
        toward: places.map(|&p| field.places.toward(p)).collect(),
        is_constrained,
        direct,
        irradiance: Vec::new(),
        first_node,
        element_nodes,
        element_errors,
        node_evaluations,
        check_evaluations,
        n_above: above.len(),
        is_thin: field.is_thin,
        unresolved,
        n_bands: field.n_bands,
    }
}
