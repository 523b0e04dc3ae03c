//! Finished meshes with their values, whatever generated them.

use crate::basis::{n_nodes, quad_values, values};
use antumbra_geom::{Chart, DVec2};
use antumbra_mesh::cells::{CellLocator, CellMesh};
use antumbra_mesh::{Locator, Order, TriMesh, shape_quality};
use antumbra_scene::FaceId;

/// The elements of a receiver.
#[derive(Debug)]
pub enum Elements {
    /// Of the discontinuity mesh.
    Triangles(Triangles),
    /// Of the generators that know nothing of shadows.
    Cells(Cells),
}

/// Triangles along curves.
#[derive(Debug)]
pub struct Triangles {
    /// The triangulation.
    pub mesh: TriMesh,
    /// The order of every curve of the mesh, by curve id.
    pub orders: Vec<Order>,
    /// The area that is in no element or in unresolved ones because the receiver is
    /// thinner there than a few pixels of its arrangement.
    pub folded_area: f64,
    locator: Locator,
}

impl Triangles {
    pub(crate) fn new(mesh: TriMesh, orders: Vec<Order>, folded_area: f64) -> Self {
        Self {
            locator: Locator::new(&mesh),
            mesh,
            orders,
            folded_area,
        }
    }
}

/// Triangles and quadrilaterals, with T-vertices.
#[derive(Debug)]
pub struct Cells {
    /// The cells.
    pub mesh: CellMesh,
    /// Where the nodes of every element begin among the nodes of all, and where the last
    /// element's end.
    pub first_node: Vec<u32>,
    /// The direction in the chart from which a node's value is the limit; on the border.
    pub toward: Vec<Option<DVec2>>,
    /// Does a node's value follow from those of a larger element?
    pub is_constrained: Vec<bool>,
    /// Exact evaluations at places that are nodes, or were before elements were refined;
    /// the others were at check points, or those of estimators.
    pub node_evaluations: u64,
    locator: CellLocator,
}

impl Cells {
    pub(crate) fn new(
        mesh: CellMesh,
        first_node: Vec<u32>,
        toward: Vec<Option<DVec2>>,
        is_constrained: Vec<bool>,
        node_evaluations: u64,
    ) -> Self {
        Self {
            locator: CellLocator::new(&mesh),
            mesh,
            first_node,
            toward,
            is_constrained,
            node_evaluations,
        }
    }

    /// The place with these reference coordinates ([`CellMesh::point`]).
    #[must_use]
    pub fn spot(&self, element: usize, [s, t]: [f64; 2]) -> Spot {
        let at = if self.mesh.cells[element].is_quadrilateral() {
            [s, t, 0.0]
        } else {
            [1.0 - s - t, s, t]
        };
        Spot { element, at }
    }
}

/// A receiver's mesh with its values.
#[derive(Debug)]
pub struct ReceiverMesh {
    /// Whose front it is.
    pub face: FaceId,
    /// How far it got.
    pub progress: Progress,
    /// Its frame.
    pub chart: Chart,
    /// Triangles, or cells.
    pub elements: Elements,
    /// Degree of all elements.
    pub degree: u8,
    /// Where values are stored, in the chart; one position may occur several times, once
    /// per side of a contact.
    pub nodes: Vec<DVec2>,
    /// Direct irradiance, `n_bands` values per node.
    pub direct: Vec<f64>,
    /// Irradiance with interreflection, `n_bands` values per node; empty if only
    /// direct light was asked for.
    pub irradiance: Vec<f64>,
    /// Nodes of every element, in the order of [`lattice`](crate::basis::lattice) for
    /// triangles and [`quad_lattice`](crate::basis::quad_lattice) for quadrilaterals.
    pub element_nodes: Vec<u32>,
    /// Measured error of every element, relative to the peak of the worst band.
    pub element_errors: Vec<f64>,
    /// Exact evaluations spent: nodes and check points.
    pub exact_evaluations: u64,
    /// Elements at the resolution limit whose error is above the tolerance: at the ends of
    /// contacts, where irradiance has no single value, and those that are a few pixels of
    /// the arrangement long or wide; of cells, those of the least size.
    pub unresolved: Vec<u32>,
    /// Elements whose error is above the tolerance, the unresolved ones among them.
    pub n_above: usize,
    /// Is it thinner than a few pixels of an arrangement? Then all elements are unresolved.
    pub is_thin: bool,
    /// Bands of light.
    pub n_bands: usize,
}

/// A place in an element: barycentric coordinates in a triangle; in a quadrilateral the
/// two reference coordinates, and 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The element.
    pub element: usize,
    /// Its coordinates.
    pub at: [f64; 3],
}

impl ReceiverMesh {
    /// The triangulation; `None` for cells.
    #[must_use]
    pub fn triangles(&self) -> Option<&TriMesh> {
        match &self.elements {
            Elements::Triangles(triangles) => Some(&triangles.mesh),
            Elements::Cells(_) => None,
        }
    }

    /// The cells; `None` for triangles along curves.
    #[must_use]
    pub fn cells(&self) -> Option<&Cells> {
        match &self.elements {
            Elements::Triangles(_) => None,
            Elements::Cells(cells) => Some(cells),
        }
    }

    /// Number of elements.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        match &self.elements {
            Elements::Triangles(triangles) => triangles.mesh.triangles.len(),
            Elements::Cells(cells) => cells.mesh.cells.len(),
        }
    }

    /// The nodes of an element.
    #[must_use]
    pub fn nodes_of(&self, element: usize) -> &[u32] {
        let range = match &self.elements {
            Elements::Triangles(_) => {
                let n = n_nodes(self.degree);
                element * n..(element + 1) * n
            }
            Elements::Cells(cells) => {
                cells.first_node[element] as usize..cells.first_node[element + 1] as usize
            }
        };
        &self.element_nodes[range]
    }

    /// The corners of an element, counter-clockwise in the chart.
    #[must_use]
    pub fn corners(&self, element: usize) -> ([DVec2; 4], usize) {
        match &self.elements {
            Elements::Triangles(triangles) => {
                let [a, b, c] = triangles.mesh.corners(element as u32);
                ([a, b, c, c], 3)
            }
            Elements::Cells(cells) => {
                let n = cells.mesh.cells[element].corners().len();
                (cells.mesh.corner_positions(element), n)
            }
        }
    }

    /// Ratio of inscribed to circumscribed radius, relative to that of the best shape.
    #[must_use]
    pub fn shape_quality(&self, element: usize) -> f64 {
        match &self.elements {
            Elements::Triangles(t) => shape_quality(t.mesh.corners(element as u32)),
            Elements::Cells(cells) => cells.mesh.quality(element),
        }
    }

    /// The area of an element, scene units.
    #[must_use]
    pub fn element_area(&self, element: usize) -> f64 {
        match &self.elements {
            Elements::Triangles(triangles) => triangles.mesh.area(element as u32),
            Elements::Cells(cells) => cells.mesh.area(element),
        }
    }

    /// Vertices inside an edge of an element.
    #[must_use]
    pub fn n_t_vertices(&self) -> usize {
        self.cells().map_or(0, |cells| cells.mesh.n_t_vertices())
    }

    /// The area that is in no element, or in one as thin as a few pixels.
    fn folded_area(&self) -> f64 {
        match &self.elements {
            Elements::Triangles(triangles) => triangles.folded_area,
            Elements::Cells(_) => 0.0,
        }
    }

    /// Does all its area count as folded? Thin cells have their own area.
    fn is_folded(&self) -> bool {
        self.is_thin && self.triangles().is_some()
    }

    /// The area of unresolved elements, and that which is in no element.
    #[must_use]
    pub fn unresolved_area(&self) -> f64 {
        if self.is_folded() {
            return self.folded_area();
        }
        let unresolved = self.unresolved.iter();
        let areas = unresolved.map(|&t| self.element_area(t as usize));
        areas.sum::<f64>() + self.folded_area()
    }

    /// The area of the receiver: of all elements, and what is in none.
    #[must_use]
    pub fn area(&self) -> f64 {
        let of_elements = match &self.elements {
            _ if self.is_folded() => 0.0,
            Elements::Triangles(triangles) => triangles.mesh.total_area(),
            Elements::Cells(cells) => cells.mesh.total_area(),
        };
        of_elements + self.folded_area()
    }

    /// Largest measured error, relative to the peak.
    ///
    /// Unresolved triangles are left out: they lie where irradiance has no single value,
    /// and their area is told. Unresolved cells are in it: they are what the least size
    /// that was asked for costs.
    #[must_use]
    pub fn max_error(&self) -> f64 {
        let leaves_out = |t: usize| {
            self.triangles().is_some()
                && u32::try_from(t).is_ok_and(|t| self.unresolved.binary_search(&t).is_ok())
        };
        (0..self.n_elements())
            .filter(|&t| !leaves_out(t))
            .map(|t| self.element_errors[t])
            .fold(0.0, f64::max)
    }

    /// The place of a chart point in its element; `None` outside of the mesh.
    #[must_use]
    pub fn locate(&self, point: DVec2) -> Option<Spot> {
        match &self.elements {
            Elements::Triangles(triangles) => {
                let (t, at) = triangles.locator.locate(&triangles.mesh, point)?;
                let element = t as usize;
                Some(Spot { element, at })
            }
            Elements::Cells(cells) => {
                let (element, at) = cells.locator.locate(&cells.mesh, point)?;
                Some(cells.spot(element, at))
            }
        }
    }

    /// Interpolated direct irradiance per band.
    #[must_use]
    pub fn direct_at(&self, spot: Spot) -> Vec<f64> {
        let mut values = self.interpolate(&self.direct, self.n_bands, spot);
        // Polynomials overshoot a little where light ends; light does not.
        values.iter_mut().for_each(|v| *v = v.max(0.0));
        values
    }

    /// Interpolates any field on the nodes, `width` values per node.
    #[must_use]
    pub fn interpolate(&self, field: &[f64], width: usize, spot: Spot) -> Vec<f64> {
        let mut result = vec![0.0f64; width];
        let mut add = |phi: &[f64]| {
            for (&node, phi) in self.nodes_of(spot.element).iter().zip(phi) {
                let at = node as usize * width;
                for (r, v) in result.iter_mut().zip(&field[at..at + width]) {
                    *r += phi * v;
                }
            }
        };
        let [s, t, _] = spot.at;
        match &self.elements {
            Elements::Cells(cells) if cells.mesh.cells[spot.element].is_quadrilateral() => {
                add(&quad_values(self.degree, [s, t]));
            }
            _ => add(&values(self.degree, spot.at)),
        }
        result
    }
}

/// How far the mesh of a receiver got. All values that it has are exact, whatever it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// As far as it goes.
    Finished,
    /// Stopped while it was refined, or before its error was measured a second time.
    Unfinished,
    /// Stopped before the mesh of its curves had values: a mesh of its border alone.
    BorderOnly,
    /// Stopped before any value was known: there are no elements.
    Nothing,
}

/// Why refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The measured error is within the tolerance.
    ToleranceReached,
    /// Elements reached the resolution of the mesh first, or the least size asked for.
    ResolutionReached,
    /// The limit on elements was reached first, or more than it allows were asked for.
    TooManyElements,
    /// Of cells: the estimated error is within the tolerance, and the measured one is not.
    EstimateReached,
    /// Of cells: halving the size of whole receivers did not lower their error any more,
    /// as where something stands on them: there is no size for the tolerance.
    Stalled,
    /// Of cells: no tolerance was asked for.
    AsAsked,
    /// Asked to stop: budget, memory or interruption.
    Stopped,
}

/// All receivers' meshes, and what was measured.
#[derive(Debug)]
pub struct Solution {
    /// One per receiver, in the order given.
    pub receivers: Vec<ReceiverMesh>,
    /// Largest irradiance per band.
    pub peak: Vec<f64>,
    /// Largest error at a check point, relative to the peak
    /// ([`ReceiverMesh::max_error`]).
    pub measured_max_error: f64,
    /// Root mean square over the area of the elements' largest errors, relative to the
    /// peak.
    pub measured_rms_error: f64,
    /// Why refinement ended.
    pub ended: Ended,
}

impl Solution {
    /// Sums up what was measured.
    pub(crate) fn new(receivers: Vec<ReceiverMesh>, peak: Vec<f64>, ended: Ended) -> Self {
        let (mut max, mut square, mut area) = (0.0f64, 0.0, 0.0);
        for receiver in &receivers {
            // A receiver without resolved elements has no error that could be measured.
            if !receiver.is_thin {
                max = max.max(receiver.max_error());
            }
            for (e, &error) in receiver.element_errors.iter().enumerate() {
                let a = receiver.element_area(e);
                square += error * error * a;
                area += a;
            }
        }
        Self {
            receivers,
            peak,
            measured_max_error: max,
            measured_rms_error: if area > 0.0 {
                (square / area).sqrt()
            } else {
                0.0
            },
            ended,
        }
    }

    /// Elements of all receivers.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        self.receivers.iter().map(ReceiverMesh::n_elements).sum()
    }

    /// Nodes of all receivers.
    #[must_use]
    pub fn n_nodes(&self) -> usize {
        self.receivers.iter().map(|r| r.nodes.len()).sum()
    }

    /// Exact evaluations: at nodes, at check points, and those of estimators.
    #[must_use]
    pub fn exact_evaluations(&self) -> u64 {
        self.receivers.iter().map(|r| r.exact_evaluations).sum()
    }

    /// Vertices inside an edge of an element, on all receivers.
    #[must_use]
    pub fn n_t_vertices(&self) -> usize {
        self.receivers.iter().map(ReceiverMesh::n_t_vertices).sum()
    }

    /// Is the tolerance kept wherever the error was measured? If none was asked for: is the
    /// mesh as it was to be?
    #[must_use]
    pub fn has_reached_goal(&self) -> bool {
        matches!(self.ended, Ended::ToleranceReached | Ended::AsAsked)
    }

    /// Was the work stopped before its end?
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.ended == Ended::Stopped
    }
}
