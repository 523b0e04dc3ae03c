//! A receiver's mesh with exact values at its nodes, while it grows and when it is done.

mod bends;
pub(crate) mod confirm;
pub(crate) mod posterior;
mod sides;

use crate::basis::{MOST_NODES, lattice, n_nodes, values};
use crate::scale::{Found, Scale};
use crate::solution::{Elements, Progress, ReceiverMesh, Triangles};
use antumbra_geom::{
    Chart, Control, Stop, bounding_box, coarse_order, distance_to_segment, exceeds,
};
use antumbra_mesh::{
    ArrangementOptions, Cut, Order, Origins, Split, TaggedCurve, TriMesh, arrange,
};
use antumbra_scene::FaceId;
use bends::VERIFIED;
use confirm::Look;
use glam::{DVec2, DVec3};
use sides::{NodeSide, OneSided, singular_points};
use smallvec::SmallVec;
use std::collections::HashMap;

/// A point of a receiver whose exact irradiance is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Scene units.
    pub point: DVec3,
    /// Unit direction in the receiver's plane from which the limit is taken, for
    /// nodes on the border and on contacts.
    pub toward: Option<DVec3>,
}

/// Whoever knows the exact irradiance: the engine, or a test's oracle.
pub trait Light: Sync {
    /// Bands of every value.
    fn n_bands(&self) -> usize;

    /// Irradiance at the samples, one after the other, `n_bands` values each; nothing if
    /// it was stopped before all of them were known.
    ///
    /// * `radius` — features within this distance of a sample with `toward` touch it.
    fn irradiance(
        &self,
        receiver: FaceId,
        samples: &[Sample],
        radius: f64,
        stop: Stop<'_>,
    ) -> Option<Found>;

    /// Can any light fall on this receiver at all?
    fn reaches(&self, receiver: FaceId) -> bool;
}

/// A receiver with its triangulated arrangement, before any value is known.
#[derive(Clone, Debug)]
pub struct Receiver {
    /// Whose front it is.
    pub face: FaceId,
    /// Its frame.
    pub chart: Chart,
    /// What touches it: contacts as polylines, as they are before the mesh rounds them.
    pub contacts: Vec<Vec<DVec2>>,
    /// Its border, loops that repeat their first point: the curves with the first ids,
    /// of which a mesh is made if the work is stopped before that of all curves has
    /// values.
    pub border: Vec<Vec<DVec2>>,
    /// Constrained Delaunay mesh of its curves; empty if the work was stopped before it
    /// was made.
    pub mesh: TriMesh,
    /// The order of every curve of the mesh, by curve id.
    pub orders: Vec<Order>,
    /// Distance within which features touch a node on the border or a contact.
    pub contact_radius: f64,
    /// Where corners of other surfaces touch it: there irradiance depends on the direction
    /// of approach.
    pub touched: Vec<DVec2>,
    /// Curves that are not in the mesh and are put there where they pay.
    pub postponed: Vec<Postponed>,
    /// Are all curves across which light bends in the mesh or postponed? Then
    /// elements without curves hide nothing, and fewer check points do.
    pub knows_all_curves: bool,
    /// Is its light reflected, too? That bends beside borders and contacts, more steeply
    /// than the points inside of elements tell.
    pub has_indirect_light: bool,
    /// Places under emitters so near that their light falls on little more than
    /// themselves: the error is measured there too, whatever the elements' size.
    pub hot_spots: Vec<DVec2>,
    /// The area of the face that its arrangement does not hold, being thinner than a few
    /// pixels: it counts as unresolved.
    pub folded_area: f64,
    /// Is nothing left of it in the arrangement? Then the mesh is one of its corners alone:
    /// it is not refined, and all of its elements count as unresolved.
    pub is_thin: bool,
}

/// A straight piece of a curve that waits until an element needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Postponed {
    /// Its ends in the chart.
    pub ends: [DVec2; 2],
    /// Its curve: an index into [`Receiver::orders`].
    pub curve: u32,
    /// The largest jump of the derivative across it, per band.
    pub jump: Vec<f64>,
}

/// Where the error of an element is measured, in barycentric coordinates: off
/// every symmetry line, so that no odd or even error hides.
pub(crate) const CHECK_POINTS: [[f64; 3]; 3] =
    [[0.60, 0.27, 0.13], [0.13, 0.60, 0.27], [0.27, 0.13, 0.60]];

/// Where the error is measured once more when all elements are within the
/// tolerance: an element that hides a kink from the first points rarely hides it
/// from these.
const SECOND_POINTS: [[f64; 3]; 2] = [[0.42, 0.50, 0.08], [0.50, 0.08, 0.42]];

/// Points at 2 % of an element's height beside each of its edges.
const BESIDE: [(usize, [f64; 3]); 3] = [
    (1, [0.02, 0.37, 0.61]),
    (2, [0.61, 0.02, 0.37]),
    (0, [0.37, 0.61, 0.02]),
];

/// Edges longer than this fraction of their receiver are checked at both ends: over
/// them irradiance is not yet like a polynomial of the next degree.
const SHORT_EDGE: f64 = 0.1;

/// Where the error is measured inside of elements if all curves are known, by degree:
/// in the middle between the nodes. Elements without inner nodes are seen less of.
const INNER_POINTS: [&[[f64; 3]]; 4] = [
    &[[0.38, 0.34, 0.28], [0.2, 0.18, 0.62]],
    &[[0.38, 0.34, 0.28], [0.2, 0.18, 0.62]],
    &[[0.55, 0.25, 0.20]],
    &[[0.38, 0.34, 0.28], [0.13, 0.74, 0.13]],
];

/// Elements longer than this fraction of their receiver are measured at
/// [`SECOND_POINTS`] too: there are few, and over them irradiance may be anything.
const LARGE: f64 = 0.3;

/// Where the error is measured on an edge that lies on a curve, by degree, from
/// both ends: the largest error of interpolation at equally spaced nodes.
const EDGE_CHECK: [f64; 4] = [0.5, 0.211, 0.127, 0.0892];

/// Elements whose measured error is above this fraction of the tolerance are
/// refined: the check points miss the largest error of an element by up to a
/// factor of two, rarely more (measured: `docs/accuracy.md`).
pub(crate) const SAFETY: f64 = 0.45;

/// The same if all curves are known: points on those left out see most of what they
/// cost.
const KINK_SAFETY: f64 = 0.6;

/// The same for elements in which nothing bends, or only little: curves that may cost
/// less than this share of the tolerance. Of smooth functions the check points find
/// most of the largest error.
const CALM_KINK: f64 = 0.1;
const CALM_SAFETY: f64 = 0.65;

/// What splitting an element costs, relative to the estimate of
/// [`Field::worth_cutting`]: cuts make slim triangles (measured on the box fixtures).
const SPLITTING: f64 = 0.3;

/// Elements at the end of a contact that are shorter than this fraction of their
/// receiver are not refined.
///
/// There irradiance depends on the direction of approach, so that no element size
/// is small enough. At 2⁻¹³ the elements left cover about 1e-8 of the receiver.
pub(crate) const RESOLUTION: f64 = 1.0 / 8192.0;

/// No element shorter than this fraction of its receiver is refined: 64 pixels of
/// its arrangement.
const SHORTEST: f64 = 1.0 / (1 << 22) as f64;

/// Elements whose error has not fallen to [`PROGRESS`] of what it was for so many rounds
/// are given up, if all curves are known: thin ones, and others. Smooth functions and
/// kinks gain more by a bisection (a D1 kink 0.7). At the ends of contacts
/// [`RESOLUTION`] decides.
///
/// The curves of thin ones are off by a few pixels where irradiance is so steep that it
/// matters, as in the penumbra of a slit; refinement would go on along the whole curve.
/// Others go through as many rounds as it takes to find a layer of a few pixels, and no
/// place is known where they do not find it: if there is one, the result says that the
/// tolerance was not reached.
const MOST_STALLED: [u8; 2] = [3, 16];
const PROGRESS: f64 = 0.8;

/// Light is taken to change at one end of an edge only if this share of its variation
/// lies within [`ONE_END`] of it. Then the edge is split where half of it does.
///
/// A step that the first check point and the first node of degree 3 enclose has all of
/// its variation within 1/6. With a share of 0.5, penumbras that end in an element pass
/// for layers (`basic/two-triangles` at 1e-2 takes a third more evaluations); with 0.75,
/// layers whose light decays slowly are bisected (a gap of 1e-5 under a lamp takes a half
/// more).
const AT_END: f64 = 0.6;
const ONE_END: f64 = 0.167;

/// Elements at singular points whose longest edge is this many times their height are
/// bisected without regard to their neighbours' shapes: those lie along a layer too.
const ELONGATED: f64 = 8.0;

/// Thin elements: thinner than this fraction of their receiver, 256 pixels.
const THIN: f64 = 4.0 * SHORTEST;

/// Where the error is measured on edges if all curves are known, by degree, from both
/// ends: places that are nodes of the halves, so that a bisection loses nothing.
const NESTED_CHECK: [f64; 4] = [0.5, 0.25, 1.0 / 6.0, 0.125];

/// Positions nearer than this fraction of the receiver are one node: the same place
/// computed from an edge and from its half.
const SAME_NODE: f64 = 1.0 / (1u64 << 40) as f64;

/// What ignoring a kink across the middle of an element costs: the largest error per
/// jump and size (D1) or size squared (D2), by degree.
///
/// # Source
///
/// Best approximation of a kink by polynomials; the table in `docs/design.md`.
pub const KINK_D1: [f64; 4] = [0.125, 0.045, 0.031, 0.021];
/// The same for D2.
pub const KINK_D2: [f64; 4] = [0.062, 0.0107, 0.0029, 0.0017];

/// An element is cut if a kink may explain its error this many times over: near the
/// bound, splitting is cheaper.
const EXPLAINS: f64 = 3.0;

/// What makes a node: its position, and the side it is approached from.
type NodeKey = [u64; 4];

/// A receiver's mesh while it grows.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub(crate) face: FaceId,
    pub(crate) chart: Chart,
    pub(crate) mesh: TriMesh,
    pub(crate) orders: Vec<Order>,
    /// Until there are values; then empty.
    border: Vec<Vec<DVec2>>,
    pub(crate) progress: Progress,
    contact_radius: f64,
    touched: Vec<DVec2>,
    sides: OneSided,
    /// Where irradiance has no single value, sorted by u.
    singular: Vec<DVec2>,
    postponed: Vec<Postponed>,
    hot_spots: Vec<DVec2>,
    folded_area: f64,
    is_thin: bool,
    /// The postponed curves that run through each element.
    crossing: Vec<Vec<u32>>,
    knows_all_curves: bool,
    has_indirect_light: bool,
    pub(crate) degree: u8,
    pub(crate) n_bands: usize,
    pub(crate) is_dark: bool,
    pub(crate) nodes: Vec<DVec2>,
    /// From where each node's value is the limit, if it is one-sided.
    pub(crate) toward: Vec<Option<DVec3>>,
    /// Direct irradiance, `n_bands` values per node.
    pub(crate) direct: Vec<f64>,
    ids: HashMap<NodeKey, u32>,
    /// Nodes and errors (per band) of evaluated elements; `u32::MAX` in the first
    /// node marks an element not evaluated yet.
    pub(crate) element_nodes: Vec<[u32; MOST_NODES]>,
    pub(crate) errors: Vec<f64>,
    /// What was measured along the edges of evaluated elements.
    edges: Vec<[EdgeError; 3]>,
    /// Does the element touch a place where irradiance has no single value?
    pub(crate) is_singular: Vec<bool>,
    /// Was the error measured at the second points too?
    is_verified: Vec<bool>,
    looks: Vec<Look>,
    history: Vec<History>,
    pub(crate) scale: Scale,
    pub(crate) n_evaluations: u64,
    pub(crate) size: f64,
}

/// What was measured along an edge of an element.
#[derive(Clone, Copy, Debug, Default)]
struct EdgeError {
    /// The largest error, and its band.
    error: f64,
    band: usize,
    /// Where light changes, if it does at one end only, as a share of the edge.
    layer: Option<f64>,
}

impl EdgeError {
    /// Relative to what is allowed.
    fn excess(&self, allowed: &[f64]) -> f64 {
        match allowed.get(self.band) {
            Some(&allowed) if allowed > 0.0 => self.error / allowed,
            _ => 0.0,
        }
    }
}

/// Whether refinement gets anywhere.
#[derive(Clone, Copy, Debug)]
struct History {
    /// The largest error, over bands, of what an element was made of; infinite at first.
    before: f64,
    /// Rounds in a row without progress.
    n_stalled: u8,
}

/// A field's mesh before a round of refinement.
pub(crate) struct Snapshot {
    mesh: TriMesh,
    crossing: Vec<Vec<u32>>,
    element_nodes: Vec<[u32; MOST_NODES]>,
    errors: Vec<f64>,
    edges: Vec<[EdgeError; 3]>,
    is_singular: Vec<bool>,
    is_verified: Vec<bool>,
    looks: Vec<Look>,
    history: Vec<History>,
}

impl Field {
    /// If it was stopped, curves left out are not assigned to elements: such a field
    /// has no use but [`Field::fall_back`].
    pub(crate) fn new(receiver: Receiver, light: &dyn Light, degree: u8, stop: Stop<'_>) -> Self {
        let n_triangles = receiver.mesh.triangles.len();
        let [min, max] = bounding_box(receiver.mesh.vertices.iter().copied());
        let n_bands = light.n_bands();
        let all: Vec<u32> = (0..receiver.postponed.len() as u32).collect();
        let crossing = (0..n_triangles)
            .map(|t| {
                if stop.is_wanted() {
                    return Vec::new();
                }
                crossing(&receiver.mesh, t, &receiver.postponed, &all)
            })
            .collect();
        let sides = OneSided::new(
            &receiver.border,
            &receiver.contacts,
            receiver.contact_radius,
        );
        let singular = singular_points(
            &receiver.mesh,
            &receiver.orders,
            receiver.contact_radius,
            &receiver.touched,
        );
        Self {
            border: receiver.border,
            progress: Progress::Unfinished,
            touched: receiver.touched,
            sides,
            singular,
            postponed: receiver.postponed,
            hot_spots: receiver.hot_spots,
            folded_area: receiver.folded_area,
            is_thin: receiver.is_thin,
            crossing,
            knows_all_curves: receiver.knows_all_curves,
            has_indirect_light: receiver.has_indirect_light,
            is_dark: !light.reaches(receiver.face),
            face: receiver.face,
            chart: receiver.chart,
            mesh: receiver.mesh,
            orders: receiver.orders,
            contact_radius: receiver.contact_radius,
            degree,
            n_bands,
            nodes: Vec::new(),
            toward: Vec::new(),
            direct: Vec::new(),
            ids: HashMap::new(),
            element_nodes: vec![[u32::MAX; MOST_NODES]; n_triangles],
            errors: vec![0.0; n_triangles * n_bands],
            edges: vec![[EdgeError::default(); 3]; n_triangles],
            is_singular: vec![false; n_triangles],
            is_verified: vec![false; n_triangles],
            looks: vec![Look::Wanted; n_triangles],
            history: vec![
                History {
                    before: f64::INFINITY,
                    n_stalled: 0,
                };
                n_triangles
            ],
            scale: Scale::new(n_bands),
            n_evaluations: 0,
            size: if n_triangles > 0 {
                (max - min).length()
            } else {
                0.0
            },
        }
    }

    pub(crate) fn longest_edge(&self, t: usize) -> f64 {
        let [a, b, c] = self.mesh.triangles[t].map(|v| self.mesh.vertices[v as usize]);
        (b - a).length().max((c - b).length()).max((a - c).length())
    }

    pub(crate) fn knows_all_curves(&self) -> bool {
        self.knows_all_curves
    }

    /// Bisects until no element is longer than this fraction of the receiver, or until it
    /// is stopped.
    pub(crate) fn coarsest(&mut self, fraction: f64, stop: Stop<'_>) {
        if self.is_thin {
            return;
        }
        for _ in 0..64 {
            if stop.is_wanted() {
                return;
            }
            let marked: Vec<u32> = (0..self.mesh.triangles.len())
                .filter(|&t| exceeds(self.longest_edge(t), fraction * self.size))
                .map(|t| t as u32)
                .collect();
            if marked.is_empty() {
                break;
            }
            self.bisect(&marked);
        }
    }

    /// Makes a mesh of the border alone, without values: that of the curves is too much
    /// for the time that is left.
    pub(crate) fn fall_back(&mut self) {
        self.sides = OneSided::new(&self.border, &[], self.contact_radius);
        self.progress = Progress::BorderOnly;
        if self.is_thin {
            // It is made of nothing else.
            return;
        }
        let curves: Vec<TaggedCurve> = std::mem::take(&mut self.border)
            .into_iter()
            .map(|points| TaggedCurve {
                points,
                order: Order::Boundary,
            })
            .collect();
        let arrangement =
            arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        match TriMesh::new(&arrangement, &curves) {
            Ok(mesh) => self.replace_mesh(mesh),
            // With its curves it could be triangulated, so this does not happen; and if it
            // does, no element is better than an end without a result.
            Err(_) => self.clear(),
        }
    }

    /// Leaves no elements.
    pub(crate) fn clear(&mut self) {
        self.replace_mesh(TriMesh::empty());
        self.progress = Progress::Nothing;
    }

    fn replace_mesh(&mut self, mesh: TriMesh) {
        let n_triangles = mesh.triangles.len();
        self.singular = singular_points(&mesh, &self.orders, self.contact_radius, &self.touched);
        self.mesh = mesh;
        self.postponed = Vec::new();
        self.crossing = vec![Vec::new(); n_triangles];
        self.knows_all_curves = false;
        self.ids.clear();
        self.nodes.clear();
        self.toward.clear();
        self.direct.clear();
        self.element_nodes = vec![[u32::MAX; MOST_NODES]; n_triangles];
        self.errors = vec![0.0; n_triangles * self.n_bands];
        self.edges = vec![[EdgeError::default(); 3]; n_triangles];
        self.is_singular = vec![false; n_triangles];
        self.is_verified = vec![false; n_triangles];
        self.looks = vec![Look::Wanted; n_triangles];
    }

    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot {
            mesh: self.mesh.clone(),
            crossing: self.crossing.clone(),
            element_nodes: self.element_nodes.clone(),
            errors: self.errors.clone(),
            edges: self.edges.clone(),
            is_singular: self.is_singular.clone(),
            is_verified: self.is_verified.clone(),
            looks: self.looks.clone(),
            history: self.history.clone(),
        }
    }

    /// Back to the mesh of a snapshot. Nodes stay: they have got none since that have
    /// no values.
    pub(crate) fn restore(&mut self, before: Snapshot) {
        self.mesh = before.mesh;
        self.crossing = before.crossing;
        self.element_nodes = before.element_nodes;
        self.errors = before.errors;
        self.edges = before.edges;
        self.is_singular = before.is_singular;
        self.is_verified = before.is_verified;
        self.looks = before.looks;
        self.history = before.history;
    }

    /// Was the error of all elements measured at the second points?
    pub(crate) fn is_verified(&self) -> bool {
        self.is_dark || self.is_verified.iter().all(|&v| v)
    }

    /// Features within this distance of a node touch it.
    pub(crate) fn contact_radius(&self) -> f64 {
        self.contact_radius
    }

    /// Values of another light at all nodes; nothing if it was stopped.
    pub(crate) fn at_nodes(&self, light: &dyn Light, stop: Stop<'_>) -> Option<Vec<f64>> {
        if !light.reaches(self.face) {
            return Some(vec![0.0; self.nodes.len() * self.n_bands]);
        }
        let places = self.nodes.iter().zip(&self.toward);
        let samples: Vec<Sample> = places
            .map(|(&uv, &toward)| Sample {
                point: self.chart.to_space(uv),
                toward,
            })
            .collect();
        let found = light.irradiance(self.face, &samples, self.contact_radius, stop)?;
        Some(found.values)
    }

    /// Direct light at the nodes and what is known elsewhere of indirect light.
    pub(crate) fn with_indirect(&self, indirect: impl Fn(DVec2) -> Option<Vec<f64>>) -> Vec<f64> {
        let mut total = self.direct.clone();
        let mut is_done = vec![false; self.nodes.len()];
        for (t, nodes) in self.element_nodes.iter().enumerate() {
            let middle = self.point(t, [1.0 / 3.0; 3]);
            for &node in &nodes[..n_nodes(self.degree)] {
                let node = node as usize;
                if !std::mem::replace(&mut is_done[node], true) {
                    // A hair inside the element: on its side of a contact.
                    let uv = self.nodes[node];
                    let values = indirect(uv + (middle - uv) * 1e-6).unwrap_or_default();
                    let first = node * self.n_bands;
                    for (total, value) in total[first..].iter_mut().zip(values) {
                        *total += value;
                    }
                }
            }
        }
        total
    }

    /// Evaluates nodes and check points of all elements that are new. Returns whether
    /// they have values now: if it was stopped, nothing has changed. Where no light
    /// falls, there is nothing to wait for.
    pub(crate) fn evaluate(&mut self, light: &dyn Light, stop: Stop<'_>) -> bool {
        let new: Vec<usize> = (0..self.mesh.triangles.len())
            .filter(|&t| self.element_nodes[t][0] == u32::MAX)
            .collect();
        if new.is_empty() {
            return true;
        }
        if stop.is_wanted() && !self.is_dark {
            return false;
        }
        let n_nodes_before = self.nodes.len();
        let mut samples: Vec<Sample> = Vec::new();
        // Check points on curves are shared by the elements at them, like nodes.
        let mut edge_checks: Vec<Vec<([f64; 3], u32)>> = Vec::with_capacity(new.len());
        for &t in &new {
            if stop.is_wanted() && !self.is_dark {
                self.forget(&new, n_nodes_before);
                return false;
            }
            self.element_nodes[t] = self.nodes_for(t, &mut samples);
            edge_checks.push(self.edge_checks_for(t, &mut samples));
            self.is_singular[t] = self.touches(t);
        }
        let n_new_nodes = samples.len();
        let inner_points: &[[f64; 3]] = if self.knows_all_curves {
            &[]
        } else {
            &CHECK_POINTS
        };
        for &t in &new {
            for &at in inner_points {
                samples.push(self.sample_at(t, at));
            }
        }
        let found = if self.is_dark {
            Some(Found {
                values: vec![0.0; samples.len() * self.n_bands],
                rounding: 0.0,
            })
        } else {
            light.irradiance(self.face, &samples, self.contact_radius, stop)
        };
        let Some(found) = found else {
            self.forget(&new, n_nodes_before);
            return false;
        };
        if !self.is_dark {
            self.n_evaluations += samples.len() as u64;
        }
        self.scale.take(&found);
        let found = found.values;
        self.direct
            .extend_from_slice(&found[..n_new_nodes * self.n_bands]);
        let inner = &found[n_new_nodes * self.n_bands..];
        for (k, &t) in new.iter().enumerate() {
            for band in 0..self.n_bands {
                let mut worst = 0.0f64;
                for (c, &at) in inner_points.iter().enumerate() {
                    let exact = inner[(k * inner_points.len() + c) * self.n_bands + band];
                    worst = worst.max((self.value(&self.direct, t, at, band) - exact).abs());
                }
                for &(at, id) in &edge_checks[k] {
                    let exact = self.direct[id as usize * self.n_bands + band];
                    worst = worst.max((self.value(&self.direct, t, at, band) - exact).abs());
                }
                self.errors[t * self.n_bands + band] = worst;
            }
            if self.knows_all_curves {
                self.edges[t] =
                    std::array::from_fn(|edge| self.edge_error(t, edge, &edge_checks[k]));
            }
        }
        self.border = Vec::new();
        true
    }

    /// Takes back the nodes of elements whose evaluation was stopped.
    fn forget(&mut self, new: &[usize], n_nodes: usize) {
        self.nodes.truncate(n_nodes);
        self.toward.truncate(n_nodes);
        self.ids.retain(|_, &mut id| (id as usize) < n_nodes);
        for &t in new {
            self.element_nodes[t] = [u32::MAX; MOST_NODES];
        }
    }

    /// Over bands.
    fn largest_error(&self, t: usize) -> f64 {
        let bands = &self.errors[t * self.n_bands..(t + 1) * self.n_bands];
        bands.iter().copied().fold(0.0, f64::max)
    }

    /// Where to measure the error of an element once more. If all curves are known: at
    /// a point or two, and in the middle of curves left out, where their kinks cost most.
    fn second_points(&self, t: usize, allowed: &[f64]) -> SmallVec<[[f64; 3]; 4]> {
        let corners = self.mesh.corners(t as u32);
        // Not on edges: there may be contacts, where there is no single value.
        let inside = |at: &[f64; 3]| at.iter().all(|&x| x > 1e-6);
        let spots = self.hot_spots.iter();
        let spots = spots.map(|&p| barycentric(corners, p)).filter(inside);
        if !self.knows_all_curves {
            let mut points = SmallVec::from_slice(&SECOND_POINTS);
            points.extend(spots);
            points.extend(self.points_beside(t));
            return points;
        }
        let mut points = SmallVec::from_slice(INNER_POINTS[usize::from(self.degree) - 1]);
        points.extend(spots);
        if exceeds(self.longest_edge(t), LARGE * self.size) {
            points.extend(SECOND_POINTS);
        }
        points.extend(self.bent_places(t, VERIFIED, allowed));
        points.extend(self.points_beside(t));
        points
    }

    /// With reflected light, points close beside the border and curves of an element.
    fn points_beside(&self, t: usize) -> SmallVec<[[f64; 3]; 3]> {
        let triangle = self.mesh.triangles[t];
        let is_curve = |k: usize| {
            let ends = [triangle[k], triangle[(k + 1) % 3]];
            self.mesh.edge_curves(ends[0], ends[1]).is_some()
        };
        let beside = BESIDE.into_iter();
        beside
            .filter(|&(k, _)| self.has_indirect_light && is_curve(k))
            .map(|(_, at)| at)
            .collect()
    }

    /// Measures the error of every element once more, at other points. Returns whether
    /// all are measured: if it was stopped, nothing has changed.
    pub(crate) fn verify(&mut self, light: &dyn Light, allowed: &[f64], stop: Stop<'_>) -> bool {
        if self.is_dark {
            return true;
        }
        let mut new: Vec<usize> = Vec::new();
        let mut places: Vec<(usize, [f64; 3])> = Vec::new();
        for t in 0..self.mesh.triangles.len() {
            if self.is_verified[t] {
                continue;
            }
            new.push(t);
            places.extend(self.second_points(t, allowed).into_iter().map(|at| (t, at)));
        }
        if !self.measure_at(&places, light, stop) {
            return false;
        }
        for t in new {
            self.is_verified[t] = true;
        }
        true
    }

    /// Measures the errors at places of elements. Returns whether it was done: if it was
    /// stopped, nothing has changed.
    fn measure_at(
        &mut self,
        places: &[(usize, [f64; 3])],
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> bool {
        if places.is_empty() {
            return true;
        }
        let samples = places.iter().map(|&(t, at)| self.sample_at(t, at));
        let samples: Vec<Sample> = samples.collect();
        let Some(found) = light.irradiance(self.face, &samples, self.contact_radius, stop) else {
            return false;
        };
        self.n_evaluations += samples.len() as u64;
        self.scale.take(&found);
        self.add_errors(places, &found.values);
        true
    }

    /// Errors at places of elements where the exact values were found.
    fn add_errors(&mut self, places: &[(usize, [f64; 3])], found: &[f64]) {
        for (&(t, at), exact) in places.iter().zip(found.chunks_exact(self.n_bands.max(1))) {
            for (band, &exact) in exact.iter().enumerate() {
                let error = (self.value(&self.direct, t, at, band) - exact).abs();
                let worst = &mut self.errors[t * self.n_bands + band];
                *worst = worst.max(error);
            }
        }
    }

    /// What leaving a postponed curve out of an element can cost, relative to what is
    /// allowed.
    ///
    /// The width of the element across the curve counts, and a curve that only cuts
    /// off a corner costs no more than the corner's bend.
    fn kink(&self, t: usize, curve: u32, allowed: &[f64]) -> f64 {
        let postponed = &self.postponed[curve as usize];
        let [a, b] = postponed.ends;
        let Some(across) = (b - a).try_normalize().map(DVec2::perp) else {
            return 0.0;
        };
        let (mut lo, mut hi) = (0.0f64, 0.0f64);
        for v in self.mesh.triangles[t] {
            let d = across.dot(self.mesh.vertices[v as usize] - a);
            (lo, hi) = (lo.min(d), hi.max(d));
        }
        let (width, corner) = (hi - lo, hi.min(-lo));
        // Along an edge it is no kink, however strong: beside a contact jumps in the
        // gradient have no bound.
        if corner <= self.contact_radius {
            return 0.0;
        }
        let p = usize::from(self.degree) - 1;
        let size = match self.orders[postponed.curve as usize] {
            Order::D1 => (KINK_D1[p] * width).min(0.25 * corner),
            _ => (KINK_D2[p] * width * width).min(0.125 * corner * corner),
        };
        let mut worst = 0.0f64;
        for (jump, &allowed) in postponed.jump.iter().zip(allowed) {
            if allowed > 0.0 {
                worst = worst.max(jump * size / allowed);
            }
        }
        worst
    }

    /// The postponed curves through an element with a [`Field::kink`] above `least`,
    /// the strongest first.
    fn kinks_above(&self, least: f64, t: usize, allowed: &[f64]) -> SmallVec<[(f64, u32); 8]> {
        let mut kinks: SmallVec<[(f64, u32); 8]> = self.crossing[t]
            .iter()
            .map(|&c| (self.kink(t, c, allowed), c))
            .filter(|k| k.0 > least)
            .collect();
        kinks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        kinks
    }

    /// The largest [`Field::kink`] of the curves through an element.
    fn worst_kink(&self, t: usize, allowed: &[f64]) -> f64 {
        self.crossing[t]
            .iter()
            .map(|&c| self.kink(t, c, allowed))
            .fold(0.0, f64::max)
    }

    /// How many of the strongest curves through an element are cheaper to put there
    /// than to refine away; `kinks` are costs relative to what is allowed, descending.
    ///
    /// Refining to the size h at which a kink is within the tolerance takes about
    /// 4 w/h elements along it (w the width of the element), and never more than
    /// 2 (w/h)² all over. Cutting takes three a curve, and more where curves cross.
    fn worth_cutting(&self, kinks: &[(f64, u32)]) -> usize {
        let steps = |&(kink, c): &(f64, u32)| match self.orders
            [self.postponed[c as usize].curve as usize]
        {
            Order::D1 => kink,
            _ => kink.sqrt(),
        };
        let mut along: f64 = kinks.iter().map(|k| 4.0 * steps(k)).sum();
        let (mut best, mut least) = (0, f64::INFINITY);
        for n in 0..=kinks.len() {
            let all_over = kinks[n..].iter().map(steps).fold(0.0, f64::max).powi(2) * 2.0;
            let k = n as f64;
            let cost = 1.0 + 3.0 * k + 0.6 * k * (k - 1.0) + SPLITTING * along.min(all_over);
            if cost < least {
                (best, least) = (n, cost);
            }
            if let Some(kink) = kinks.get(n) {
                along -= 4.0 * steps(kink);
            }
        }
        best
    }

    /// Puts postponed curves into the elements whose error they explain; `levels`
    /// become 0 there. Returns whether anything was cut.
    ///
    /// An element whose error no curve explains is smooth so far: it is split.
    pub(crate) fn cut(&mut self, levels: &mut Vec<u8>, allowed: &[f64]) -> bool {
        let mut wanted: Vec<Vec<u32>> = vec![Vec::new(); self.postponed.len()];
        for (t, level) in levels.iter_mut().enumerate() {
            if *level == 0 || self.crossing[t].is_empty() {
                continue;
            }
            // Relative to the tolerance itself: where a curve matters, refinement aims
            // at this share of it.
            let error = self.excess(t, &self.errors, allowed) * KINK_SAFETY;
            let kinks = self.kinks_above(1.0, t, allowed);
            let Some(strongest) = kinks.first() else {
                continue;
            };
            if strongest.0 < EXPLAINS * error {
                continue;
            }
            let n = self.worth_cutting(&kinks);
            for &(_, c) in &kinks[..n] {
                wanted[c as usize].push(t as u32);
            }
            if n > 0 {
                *level = 0;
            }
        }
        let cuts: Vec<(Cut, Vec<u32>)> = wanted
            .into_iter()
            .enumerate()
            .filter(|(_, wanted)| !wanted.is_empty())
            .map(|(c, wanted)| {
                let postponed = &self.postponed[c];
                let cut = Cut {
                    ends: postponed.ends,
                    curve: postponed.curve,
                    order: self.orders[postponed.curve as usize],
                };
                (cut, wanted)
            })
            .collect();
        if cuts.is_empty() {
            return false;
        }
        // A curve that is an edge now (or too short to be one) is no kink any more.
        for (cut, wanted) in &cuts {
            for &t in wanted {
                self.crossing[t as usize].retain(|&c| self.postponed[c as usize].ends != cut.ends);
            }
        }
        let before = self.mesh.triangles.clone();
        let origins = self.mesh.cut(&cuts);
        self.inherit(&before, &origins);
        // What changed is evaluated before it is split.
        levels.resize(self.mesh.triangles.len(), 0);
        for (t, level) in levels.iter_mut().enumerate() {
            if before.get(t) != Some(&self.mesh.triangles[t]) {
                *level = 0;
            }
        }
        true
    }

    /// A field on the nodes (`n_bands` values each) at barycentric coordinates of
    /// an element.
    pub(crate) fn value(&self, field: &[f64], t: usize, at: [f64; 3], band: usize) -> f64 {
        let phi = values(self.degree, at);
        (0..n_nodes(self.degree))
            .map(|i| phi[i] * field[self.element_nodes[t][i] as usize * self.n_bands + band])
            .sum()
    }

    /// Is the element thinner than what counts as touching?
    fn is_sliver(&self, t: usize) -> bool {
        let area = 2.0 * self.mesh.area(t as u32);
        !exceeds(area, self.contact_radius * self.longest_edge(t))
    }

    /// Is the element thinner than [`THIN`]?
    fn is_thin(&self, t: usize) -> bool {
        let area = 2.0 * self.mesh.area(t as u32);
        !exceeds(area, THIN * self.size * self.longest_edge(t))
    }

    /// Rounds in a row in which an element and what it was made of did not get better.
    fn n_stalled(&self, t: usize) -> u8 {
        let History { before, n_stalled } = self.history[t];
        if self.largest_error(t) > PROGRESS * before {
            n_stalled.saturating_add(1)
        } else {
            0
        }
    }

    /// Is there nothing to be gained from refining an element?
    fn is_given_up(&self, t: usize, allowed: &[f64]) -> bool {
        self.is_at_resolution(t, allowed)
            || (self.knows_all_curves
                && !self.is_singular[t]
                && self.n_stalled(t) >= MOST_STALLED[1])
    }

    /// Is an element so small, or so thin, that it cannot be expected to get better?
    pub(crate) fn is_at_resolution(&self, t: usize, allowed: &[f64]) -> bool {
        if self.is_thin {
            return true;
        }
        let is_too_short = |split: Split| {
            let corners = self.mesh.corners(t as u32);
            let length = corners[split.edge].distance(corners[(split.edge + 1) % 3]);
            !exceeds(length, SHORTEST * self.size)
        };
        let resolution = if self.is_singular[t] {
            RESOLUTION
        } else {
            SHORTEST
        };
        !exceeds(self.longest_edge(t), resolution * self.size)
            || self.is_sliver(t)
            || self.is_flat(t)
            || self.split_of_layer(t, allowed).is_some_and(is_too_short)
            || (self.knows_all_curves
                && !self.is_singular[t]
                && self.is_thin(t)
                && self.n_stalled(t) >= MOST_STALLED[0])
    }

    /// Is an element no higher than the shortest edge, however long it is?
    ///
    /// A gap below the contact radius counts as closed, and nodes on the contact have the
    /// limit of a closed one; light that comes through it in truth falls within this
    /// height. Splitting along the contact would go on over all its length.
    fn is_flat(&self, t: usize) -> bool {
        let height = 2.0 * self.mesh.area(t as u32) / self.longest_edge(t);
        !exceeds(height, SHORTEST * self.size)
    }

    /// Is there a singular point in the element, or within a few pixels of it? Several
    /// curves end at a contact's end, up to rounding, and no curve need end where a corner
    /// touches.
    fn touches(&self, t: usize) -> bool {
        let radius = 32.0 * self.contact_radius;
        let corners = self.mesh.corners(t as u32);
        let min = corners[0].min(corners[1]).min(corners[2]) - radius;
        let max = corners[0].max(corners[1]).max(corners[2]) + radius;
        let is_near = |s: DVec2| {
            let is_inside = barycentric(corners, s).iter().all(|&x| x >= 0.0);
            is_inside
                || (0..3)
                    .any(|k| distance_to_segment([corners[k], corners[(k + 1) % 3]], s) <= radius)
        };
        let from = self.singular.partition_point(|s| s.x < min.x);
        self.singular[from..]
            .iter()
            .take_while(|s| s.x <= max.x)
            .any(|&s| s.y >= min.y && s.y <= max.y && is_near(s))
    }

    /// The nodes of an element: known ones, and new ones with their samples.
    fn nodes_for(&mut self, t: usize, samples: &mut Vec<Sample>) -> [u32; MOST_NODES] {
        let p = f64::from(self.degree);
        let mut ids = [u32::MAX; MOST_NODES];
        for (id, node) in ids.iter_mut().zip(lattice(self.degree)) {
            let triangle = self.mesh.triangles[t];
            let uv = match node.map(|m| m > 0) {
                [true, false, false] => self.mesh.vertices[triangle[0] as usize],
                [false, true, false] => self.mesh.vertices[triangle[1] as usize],
                [false, false, true] => self.mesh.vertices[triangle[2] as usize],
                [true, true, false] => self.on_edge(t, 0, f64::from(node[1]) / p),
                [false, true, true] => self.on_edge(t, 1, f64::from(node[2]) / p),
                [true, false, true] => self.on_edge(t, 2, f64::from(node[0]) / p),
                _ => self.point(t, node.map(|m| f64::from(m) / p)),
            };
            *id = self.node(uv, t, samples);
        }
        ids
    }

    /// Check points on the edges of an element that lie on curves, or on all if all
    /// curves are known: where interpolation along the edge errs most.
    fn edge_checks_for(&mut self, t: usize, samples: &mut Vec<Sample>) -> Vec<([f64; 3], u32)> {
        let triangle = self.mesh.triangles[t];
        let mut checks = Vec::new();
        for k in 0..3 {
            let next = (k + 1) % 3;
            let checks_all = self.knows_all_curves;
            if !checks_all && self.mesh.edge_curves(triangle[k], triangle[next]).is_none() {
                continue;
            }
            let places = if checks_all {
                &NESTED_CHECK
            } else {
                &EDGE_CHECK
            };
            let off = places[usize::from(self.degree) - 1];
            let order = if checks_all && triangle[k] > triangle[next] {
                [1.0 - off, off]
            } else {
                [off, 1.0 - off]
            };
            for at in order {
                let uv = self.on_edge(t, k, at);
                let mut barycentric = [0.0; 3];
                barycentric[k] = 1.0 - at;
                barycentric[next] = at;
                checks.push((barycentric, self.node(uv, t, samples)));
                // One place an edge, the same from both sides, if all curves are known
                // and the edge is short: the error is then as large at its other end.
                let [p, q] = [triangle[k], triangle[next]].map(|v| self.mesh.vertices[v as usize]);
                let is_short = !exceeds(p.distance(q), SHORT_EDGE * self.size);
                if off == 0.5 || (checks_all && self.degree > 2 && is_short) {
                    break;
                }
            }
        }
        checks
    }

    /// The point at `at` along edge `k` of an element, from corner k to k + 1; the
    /// same bits from both elements at the edge.
    fn on_edge(&self, t: usize, k: usize, at: f64) -> DVec2 {
        let triangle = self.mesh.triangles[t];
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        // From the vertex with the smaller id.
        let (from, to, at) = if a < b { (a, b, at) } else { (b, a, 1.0 - at) };
        let (p, q) = (
            self.mesh.vertices[from as usize],
            self.mesh.vertices[to as usize],
        );
        p + (q - p) * at
    }

    /// The id of the node of an element at a position; a new one gets a sample.
    fn node(&mut self, uv: DVec2, t: usize, samples: &mut Vec<Sample>) -> u32 {
        let side = self.sides.side(uv, self.mesh.corners(t as u32));
        let place = (uv / (SAME_NODE * self.size)).round();
        let tag = side.key();
        let key = [
            (place.x as i64).cast_unsigned(),
            (place.y as i64).cast_unsigned(),
            tag[0],
            tag[1],
        ];
        if let Some(&id) = self.ids.get(&key) {
            return id;
        }
        let id = self.nodes.len() as u32;
        self.ids.insert(key, id);
        let sample = self.sample(uv, side);
        self.toward.push(sample.toward);
        samples.push(sample);
        self.nodes.push(uv);
        id
    }

    /// What is asked of the light at a place of an element.
    fn sample_at(&self, t: usize, at: [f64; 3]) -> Sample {
        let uv = self.point(t, at);
        self.sample(uv, self.sides.side(uv, self.mesh.corners(t as u32)))
    }

    fn sample(&self, uv: DVec2, side: NodeSide) -> Sample {
        Sample {
            point: self.chart.to_space(uv),
            toward: side
                .toward()
                .map(|toward| self.chart.direction(toward).normalize_or_zero()),
        }
    }

    /// How often each element is to be bisected for its direct light.
    pub(crate) fn levels(&self, allowed: &[f64]) -> Vec<u8> {
        self.levels_for(&self.errors, allowed)
    }

    /// How often each element is to be bisected, from errors per element and band.
    pub(crate) fn levels_for(&self, errors: &[f64], allowed: &[f64]) -> Vec<u8> {
        let order = f64::from(self.degree) + 1.0;
        (0..self.mesh.triangles.len())
            .map(|t| {
                let excess = self.excess(t, errors, allowed);
                if excess <= 1.0 || self.is_given_up(t, allowed) {
                    return 0;
                }
                // Two bisections halve the length and divide the error of a smooth
                // function by 2^order.
                let wanted = (2.0 * excess.log2() / order).ceil();
                // Where few elements are known, the order is not yet seen.
                let most = if self.knows_all_curves { 2.0 } else { 4.0 };
                wanted.clamp(1.0, most) as u8
            })
            .collect()
    }

    fn safety(&self, t: usize, allowed: &[f64]) -> f64 {
        if !self.knows_all_curves {
            SAFETY
        } else if self.looks[t] == Look::Done {
            confirm::SAFETY
        } else if self.worst_kink(t, allowed) < CALM_KINK {
            CALM_SAFETY
        } else {
            KINK_SAFETY
        }
    }

    /// An element's error relative to what it is refined for.
    fn excess(&self, t: usize, errors: &[f64], allowed: &[f64]) -> f64 {
        let mut excess = 0.0f64;
        for (band, &a) in allowed.iter().enumerate() {
            if a > 0.0 {
                excess =
                    excess.max(errors[t * self.n_bands + band] / (self.safety(t, allowed) * a));
            }
        }
        excess
    }

    /// The error along an edge of an element, of the band in which it is largest.
    fn edge_error(&self, t: usize, edge: usize, checks: &[([f64; 3], u32)]) -> EdgeError {
        let (next, opposite) = ((edge + 1) % 3, (edge + 2) % 3);
        let degree = f64::from(self.degree);
        let nodes = lattice(self.degree)
            .iter()
            .zip(self.element_nodes[t])
            .filter(|(node, _)| node[opposite] == 0)
            .map(|(node, id)| (f64::from(node[next]) / degree, id));
        let places = checks.iter().filter(|(at, _)| at[opposite] == 0.0);
        let mut places: SmallVec<[(f64, u32); 8]> = nodes
            .chain(places.map(|&(at, id)| (at[next], id)))
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut worst = EdgeError::default();
        for band in 0..self.n_bands {
            let value = |id: u32| self.direct[id as usize * self.n_bands + band];
            let errors = checks.iter().filter(|(at, _)| at[opposite] == 0.0);
            let error = errors
                .map(|&(at, id)| (self.value(&self.direct, t, at, band) - value(id)).abs())
                .fold(0.0, f64::max);
            if error > worst.error {
                let values: SmallVec<[(f64, f64); 8]> =
                    places.iter().map(|&(s, id)| (s, value(id))).collect();
                worst = EdgeError {
                    error,
                    band,
                    layer: end_of_variation(&values),
                };
            }
        }
        worst
    }

    /// Where to split an element whose light falls in a layer thinner than itself: across
    /// the edge along which interpolation errs most.
    ///
    /// Nothing is gained by splitting the longest edge if interpolation along it is as
    /// good as it should be. And if light changes at one end of an edge only, halves of it
    /// are no better: every bisection finds the layer in the half that is left, and all
    /// elements at that end with it.
    ///
    /// At singular points the error along an edge tells of the direction of approach, and
    /// elements that are narrower still are no better: they have to become shorter.
    fn split_of_layer(&self, t: usize, allowed: &[f64]) -> Option<Split> {
        if !self.knows_all_curves || self.element_nodes[t][0] == u32::MAX {
            return None;
        }
        let corners = self.mesh.corners(t as u32);
        let lengths: [f64; 3] = std::array::from_fn(|k| corners[k].distance(corners[(k + 1) % 3]));
        let split = |edge: usize, at: f64| {
            // No part is shorter than half of the shortest edge that is split.
            let least = (0.5 * SHORTEST * self.size / lengths[edge]).min(0.5);
            Split {
                triangle: t as u32,
                edge,
                at: at.clamp(least, 1.0 - least),
            }
        };
        let longest = largest(lengths);
        if self.is_singular[t] {
            let height = 2.0 * self.mesh.area(t as u32) / lengths[longest];
            return exceeds(lengths[longest], ELONGATED * height).then_some(split(longest, 0.5));
        }
        let edges = self.edges[t];
        let worst = largest(edges.map(|e| e.excess(allowed)));
        let aim = self.safety(t, allowed);
        if edges[worst].excess(allowed) <= aim {
            return None;
        }
        if let Some(at) = edges[worst].layer {
            return Some(split(worst, at));
        }
        let is_across = worst != longest && edges[longest].excess(allowed) <= aim;
        is_across.then_some(split(worst, 0.5))
    }

    /// Bisects elements as often as `levels` say, or until it is stopped; those in layers
    /// once, across the layer.
    pub(crate) fn refine(&mut self, mut levels: Vec<u8>, allowed: &[f64], stop: Stop<'_>) {
        let splits: Vec<Split> = (0..levels.len())
            .filter(|&t| levels[t] > 0)
            .filter_map(|t| self.split_of_layer(t, allowed))
            .collect();
        if !splits.is_empty() {
            // What they become is evaluated before it is split again.
            for split in &splits {
                levels[split.triangle as usize] = 0;
            }
            let before = self.mesh.triangles.clone();
            let parents = self.mesh.split(&splits);
            let origins: Vec<Origins> =
                parents.iter().map(|&p| Origins::from_slice(&[p])).collect();
            self.inherit(&before, &origins);
            levels = parents
                .iter()
                .enumerate()
                .map(|(t, &parent)| {
                    let is_same = before.get(t) == Some(&self.mesh.triangles[t]);
                    if is_same { levels[parent as usize] } else { 0 }
                })
                .collect();
        }
        while levels.iter().any(|&l| l > 0) && !stop.is_wanted() {
            let marked: Vec<u32> = (0..levels.len())
                .filter(|&t| levels[t] > 0)
                .map(|t| t as u32)
                .collect();
            let before = self.mesh.triangles.clone();
            let parents = self.bisect(&marked);
            levels = parents
                .iter()
                .enumerate()
                .map(|(t, &parent)| {
                    let is_same = before.get(t) == Some(&self.mesh.triangles[t]);
                    let level = levels[parent as usize];
                    if is_same {
                        level
                    } else {
                        level.saturating_sub(1)
                    }
                })
                .collect();
        }
    }

    /// Bisects and forgets what was known of the elements that changed.
    pub(crate) fn bisect(&mut self, marked: &[u32]) -> Vec<u32> {
        let before = self.mesh.triangles.clone();
        let parents = self.mesh.bisect(marked);
        let origins: Vec<Origins> = parents.iter().map(|&p| Origins::from_slice(&[p])).collect();
        self.inherit(&before, &origins);
        parents
    }

    /// Splits every element into four. Returns whether that was possible.
    pub(crate) fn halve(&mut self) -> bool {
        let before = self.mesh.triangles.clone();
        let Some(parents) = self.mesh.halve() else {
            return false;
        };
        let origins: Vec<Origins> = parents.iter().map(|&p| Origins::from_slice(&[p])).collect();
        self.inherit(&before, &origins);
        true
    }

    /// After a change of the mesh: forgets what was known of elements that changed.
    fn inherit(&mut self, before: &[[u32; 3]], origins: &[Origins]) {
        let n = self.mesh.triangles.len();
        self.element_nodes.resize(n, [u32::MAX; MOST_NODES]);
        self.errors.resize(n * self.n_bands, 0.0);
        self.edges.resize(n, [EdgeError::default(); 3]);
        self.is_singular.resize(n, false);
        self.is_verified.resize(n, false);
        self.looks.resize(n, Look::Wanted);
        let changed: Vec<usize> = (0..n)
            .filter(|&t| before.get(t) != Some(&self.mesh.triangles[t]))
            .collect();
        // All that is new before anything old is replaced: parts share their origins.
        let history: Vec<History> = changed
            .iter()
            .map(|&t| {
                let of = |o: u32| match self.element_nodes[o as usize][0] {
                    u32::MAX => self.history[o as usize],
                    _ => History {
                        before: self.largest_error(o as usize),
                        n_stalled: self.n_stalled(o as usize),
                    },
                };
                origins[t].iter().map(|&o| of(o)).fold(
                    History {
                        before: 0.0,
                        n_stalled: 0,
                    },
                    |a, b| History {
                        before: a.before.max(b.before),
                        n_stalled: a.n_stalled.max(b.n_stalled),
                    },
                )
            })
            .collect();
        let lists: Vec<Vec<u32>> = changed
            .iter()
            .map(|&t| {
                let mut candidates: Vec<u32> = origins[t]
                    .iter()
                    .flat_map(|&o| self.crossing[o as usize].iter().copied())
                    .collect();
                if origins[t].len() > 1 {
                    candidates.sort_unstable();
                    candidates.dedup();
                }
                crossing(&self.mesh, t, &self.postponed, &candidates)
            })
            .collect();
        self.crossing.resize(n, Vec::new());
        self.history.resize(
            n,
            History {
                before: f64::INFINITY,
                n_stalled: 0,
            },
        );
        for ((t, list), history) in changed.into_iter().zip(lists).zip(history) {
            self.history[t] = history;
            self.is_verified[t] = false;
            self.looks[t] = Look::Wanted;
            self.element_nodes[t] = [u32::MAX; MOST_NODES];
            self.crossing[t] = list;
        }
    }

    /// Chart coordinates of a point of an element.
    pub(crate) fn point(&self, t: usize, [l, m, n]: [f64; 3]) -> DVec2 {
        let [a, b, c] = self.mesh.triangles[t].map(|v| self.mesh.vertices[v as usize]);
        a * l + b * m + c * n
    }

    /// Drops unused nodes and packs the result.
    ///
    /// * `allowed`, `peak` — per band.
    /// * `total` — irradiance with interreflection on the nodes, if there is any.
    pub(crate) fn finish(
        self,
        allowed: &[f64],
        peak: &[f64],
        total: Option<&[f64]>,
    ) -> ReceiverMesh {
        let n = n_nodes(self.degree);
        let mut new_id = vec![u32::MAX; self.nodes.len()];
        let (mut nodes, mut direct, mut irradiance) = (Vec::new(), Vec::new(), Vec::new());
        let mut element_nodes = Vec::with_capacity(self.element_nodes.len() * n);
        for ids in &self.element_nodes {
            for &id in &ids[..n] {
                let id = id as usize;
                if new_id[id] == u32::MAX {
                    new_id[id] = nodes.len() as u32;
                    nodes.push(self.nodes[id]);
                    let values = id * self.n_bands..(id + 1) * self.n_bands;
                    direct.extend_from_slice(&self.direct[values.clone()]);
                    if let Some(total) = total {
                        irradiance.extend_from_slice(&total[values]);
                    }
                }
                element_nodes.push(new_id[id]);
            }
        }
        let mut element_errors = Vec::with_capacity(self.mesh.triangles.len());
        let (mut unresolved, mut n_above) = (Vec::new(), 0);
        for t in 0..self.mesh.triangles.len() {
            let (mut error, mut is_above) = (0.0f64, false);
            for band in 0..self.n_bands {
                let e = self.errors[t * self.n_bands + band];
                if peak[band] > 0.0 {
                    error = error.max(e / peak[band]);
                }
                is_above |= e > allowed[band];
            }
            is_above |= self.is_thin;
            element_errors.push(error);
            n_above += usize::from(is_above);
            if is_above && self.is_at_resolution(t, allowed) {
                unresolved.push(t as u32);
            }
        }
        let triangles = Triangles::new(self.mesh, self.orders, self.folded_area);
        ReceiverMesh {
            face: self.face,
            progress: self.progress,
            chart: self.chart,
            elements: Elements::Triangles(triangles),
            degree: self.degree,
            nodes,
            direct,
            irradiance,
            element_nodes,
            element_errors,
            exact_evaluations: self.n_evaluations,
            unresolved,
            n_above,
            is_thin: self.is_thin,
            n_bands: self.n_bands,
        }
    }
}

/// The index of the largest of three.
fn largest(of: [f64; 3]) -> usize {
    // Up to rounding, so that images of a mesh are split alike.
    let unit = of[0].max(of[1]).max(of[2]);
    let of = of.map(|x| coarse_order(x, unit));
    (1..3).fold(0, |a, b| if of[b] > of[a] { b } else { a })
}

/// The place before which this share of a function's variation lies, from its values at
/// places in ascending order; it is taken to be linear in between.
fn place_of_variation(values: &[(f64, f64)], share: f64) -> f64 {
    let change = |w: &[(f64, f64)]| (w[1].1 - w[0].1).abs();
    let wanted = share * values.windows(2).map(change).sum::<f64>();
    let mut sum = 0.0;
    for w in values.windows(2) {
        let change = change(w);
        if change > 0.0 && sum + change >= wanted {
            return w[0].0 + (w[1].0 - w[0].0) * (wanted - sum) / change;
        }
        sum += change;
    }
    0.5
}

/// Where half of the variation along an edge lies, if it lies at one end of it.
fn end_of_variation(values: &[(f64, f64)]) -> Option<f64> {
    let is_at_start = place_of_variation(values, AT_END) <= ONE_END;
    let is_at_end = place_of_variation(values, 1.0 - AT_END) >= 1.0 - ONE_END;
    (is_at_start || is_at_end).then(|| place_of_variation(values, 0.5))
}

/// Barycentric coordinates of a point; not finite if the triangle has no area.
fn barycentric([a, b, c]: [DVec2; 3], p: DVec2) -> [f64; 3] {
    let area = (b - a).perp_dot(c - a);
    let v = (p - a).perp_dot(c - a) / area;
    let w = (b - a).perp_dot(p - a) / area;
    [1.0 - v - w, v, w]
}

/// Which of `candidates` run through an element.
fn crossing(mesh: &TriMesh, t: usize, postponed: &[Postponed], candidates: &[u32]) -> Vec<u32> {
    let corners = mesh.corners(t as u32);
    let (min, max) = (
        corners[0].min(corners[1]).min(corners[2]),
        corners[0].max(corners[1]).max(corners[2]),
    );
    let least = 1e-3 * (max - min).max_element();
    let passes = |c: &u32| {
        let [p, q] = postponed[*c as usize].ends;
        if p.min(q).cmpgt(max).any() || p.max(q).cmplt(min).any() {
            return false;
        }
        part_inside(corners, [p, q]).is_some_and(|(from, to)| (to - from) * p.distance(q) > least)
    };
    candidates.iter().copied().filter(passes).collect()
}

/// The part of a segment inside a triangle, by its parameter.
fn part_inside(corners: [DVec2; 3], [p, q]: [DVec2; 2]) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let inward = (b - a).perp();
        let (hp, hq) = (inward.dot(p - a), inward.dot(q - a));
        if hp <= 0.0 && hq <= 0.0 {
            return None;
        }
        if hp < 0.0 {
            from = from.max(hp / (hp - hq));
        } else if hq < 0.0 {
            to = to.min(hp / (hp - hq));
        }
    }
    (from < to).then_some((from, to))
}
