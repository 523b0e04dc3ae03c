//! Direct light on meshes of cells: the generators that know nothing of shadows.
//!
//! Everything is as for the discontinuity mesh except for the mesh: Lagrange elements of
//! degree 1 to 4, exact values at the nodes, errors that are measured where no node is.
//! Where large elements meet small ones the nodes of the small ones take the value of the
//! large one's edge, so that irradiance is continuous; except on a plain quadtree, which
//! leaves cracks there.

mod estimate;
mod layout;
mod mesh;
mod places;

pub use estimate::Estimator;
pub use layout::{edge_nodes, nodes_of_cell};

use crate::field::{Light, SAFETY};
use crate::scale::{Found, Scale, Tolerance};
use crate::solution::{Ended, Progress, Solution};
use antumbra_geom::{Chart, Control, Phase, Stop, bounding_box};
use antumbra_mesh::cells::{CellForest, Rule};
use antumbra_scene::FaceId;
use estimate::Points;
use glam::DVec2;
use layout::Layout;
use places::Places;
use rayon::prelude::*;

/// A receiver with its mesh, before any value is known.
#[derive(Debug)]
pub struct CellReceiver {
    /// Whose front it is.
    pub face: FaceId,
    /// Its frame.
    pub chart: Chart,
    /// Its cells, and how they may be refined. [`Rule::Plain`] leaves cracks.
    pub forest: CellForest,
    /// Is it thinner than a few pixels of an arrangement? Then its cells are made of its
    /// corners alone, are not refined, and count as unresolved.
    pub is_thin: bool,
    /// Distance within which features touch a node on the border.
    pub contact_radius: f64,
    /// Places under emitters so near that their light falls on little more than
    /// themselves: the error is measured there too, whatever the elements' size.
    pub hot_spots: Vec<DVec2>,
}

/// When to stop refining.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellGoal {
    /// At once: the meshes are as they are to be.
    AsGiven,
    /// With so many elements of all receivers that light reaches, or a few more.
    Elements(usize),
    /// When the error is within the tolerance.
    Tolerance(Tolerance),
}

/// What is refined where an error is too large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellRefinement {
    /// All elements of the receiver: its size is halved.
    Whole,
    /// The elements whose error it is.
    Marked,
}

/// How to refine meshes of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellDirectOptions {
    /// Degree of the elements, 1 to 4.
    pub degree: u8,
    /// When to stop.
    pub goal: CellGoal,
    /// What is refined.
    pub refinement: CellRefinement,
    /// What refinement follows. Whatever it is, the error is measured in the end.
    pub estimator: Estimator,
    /// Elements whose longest edge is at most this fraction of their receiver's diagonal
    /// stay whole.
    pub least_size: f64,
    /// No more elements than this.
    pub most_elements: usize,
}

/// The light that meshes were not made for.
#[derive(Clone, Copy)]
pub enum Other<'a> {
    /// They were made for direct light: this is all light.
    Total(&'a dyn Light),
    /// They were made for all light: this is direct light.
    Direct(&'a dyn Light),
}

impl std::fmt::Debug for Other<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Total(_) => "Total",
            Self::Direct(_) => "Direct",
        })
    }
}

/// Memory that a node takes with what belongs to it, about.
const BYTES_PER_NODE: u64 = 200;

/// Receivers with fewer new nodes are evaluated without asking for room.
const MANY_NODES: usize = 4096;

/// Of the largest error, elements above this share are refined together if a number of
/// elements is the goal.
const WORST: f64 = 0.4;

/// A receiver's mesh while it grows.
#[derive(Debug)]
pub(crate) struct Field {
    pub(crate) face: FaceId,
    pub(crate) chart: Chart,
    forest: CellForest,
    is_thin: bool,
    contact_radius: f64,
    hot_spots: Vec<DVec2>,
    pub(crate) is_dark: bool,
    degree: u8,
    pub(crate) n_bands: usize,
    places: Places,
    current: Option<Current>,
    progress: Progress,
    scale: Scale,
    size: f64,
    /// The largest error relative to what is allowed, before the last refinement.
    before: f64,
    /// Refinements in a row that have not lowered it.
    n_stalled: u8,
}

/// Receivers that are refined as a whole are given up after so many halvings of their size
/// that have not brought the largest error below this share of what it was. Kinks of slope
/// gain 0.5 by one; at a jump of the value there is nothing to be gained.
const MOST_STALLED: u8 = 3;
const PROGRESS: f64 = 0.8;

/// A mesh with all its values.
#[derive(Clone, Debug)]
struct Current {
    layout: Layout,
    /// `n_bands` values per node.
    direct: Vec<f64>,
    /// As refinement sees them: per element and band.
    errors: Vec<f64>,
}

impl Field {
    fn new(receiver: CellReceiver, light: &dyn Light, degree: u8) -> Self {
        let n_bands = light.n_bands();
        let (mesh, _) = receiver.forest.mesh();
        let [min, max] = bounding_box(mesh.vertices.iter().copied());
        let size = if mesh.vertices.is_empty() {
            0.0
        } else {
            (max - min).length()
        };
        Self {
            is_dark: !light.reaches(receiver.face),
            face: receiver.face,
            chart: receiver.chart,
            forest: receiver.forest,
            is_thin: receiver.is_thin,
            contact_radius: receiver.contact_radius,
            hot_spots: receiver.hot_spots,
            degree,
            n_bands,
            places: Places::new(size, n_bands),
            current: None,
            progress: Progress::Unfinished,
            scale: Scale::new(n_bands),
            size,
            before: f64::INFINITY,
            n_stalled: 0,
        }
    }

    /// Notes whether the last refinement has lowered the error.
    fn note_progress(&mut self, allowed: &[f64]) {
        let worst = (0..self.n_elements())
            .map(|c| self.excess(c, allowed))
            .fold(0.0, f64::max);
        self.n_stalled = if worst > PROGRESS * self.before {
            self.n_stalled + 1
        } else {
            0
        };
        self.before = worst;
    }

    fn n_elements(&self) -> usize {
        self.current
            .as_ref()
            .map_or(0, |current| current.layout.mesh.cells.len())
    }

    /// Exact values at places that have none. Returns whether all have one.
    fn evaluate_places(&mut self, wanted: &[u32], light: &dyn Light, stop: Stop<'_>) -> bool {
        let missing = self.places.missing(wanted);
        let light = (!self.is_dark).then_some(light);
        let samples = self.places.samples(&missing, &self.chart);
        let found = match light {
            _ if missing.is_empty() => return true,
            Some(light) => light.irradiance(self.face, &samples, self.contact_radius, stop),
            None => Some(Found {
                values: vec![0.0; samples.len() * self.n_bands],
                rounding: 0.0,
            }),
        };
        let Some(found) = found else {
            return false;
        };
        self.scale.take(&found);
        self.places.tell(&missing, &found.values);
        true
    }

    /// Puts values on a forest's mesh, which then is the field's. Returns whether it has:
    /// if it was stopped or there is no room, the field is as before.
    fn adopt(
        &mut self,
        forest: CellForest,
        light: &dyn Light,
        control: &Control<'_>,
        stop: Stop<'_>,
    ) -> bool {
        let (mesh, leaves) = forest.mesh();
        let is_continuous = forest.rule() != Rule::Plain;
        let before = self.places.len();
        let layout = Layout::new(mesh, leaves, self.degree, is_continuous, &mut self.places);
        let n_new = self.places.len() - before;
        if n_new > MANY_NODES && !(control.has_room)(n_new as u64 * BYTES_PER_NODE) {
            return false;
        }
        if !self.evaluate_places(&layout.free_places(), light, stop) {
            return false;
        }
        self.places.count_as_nodes(&layout.free_places());
        let mut direct = Vec::with_capacity(layout.places.len() * self.n_bands);
        for &p in &layout.places {
            direct.extend_from_slice(self.places.values(p));
        }
        layout.complete(&mut direct, self.n_bands);
        self.current = Some(Current {
            errors: vec![0.0; layout.mesh.cells.len() * self.n_bands],
            layout,
            direct,
        });
        self.forest = forest;
        true
    }

    /// The error of an element relative to what is allowed, in the worst band.
    fn excess(&self, c: usize, allowed: &[f64]) -> f64 {
        let Some(current) = &self.current else {
            return 0.0;
        };
        let errors = &current.errors[c * self.n_bands..(c + 1) * self.n_bands];
        let allowed = errors.iter().zip(allowed).filter(|e| *e.1 > 0.0);
        allowed.map(|(e, a)| e / a).fold(0.0, f64::max)
    }

    fn is_at_least_size(&self, c: usize, least: f64) -> bool {
        self.is_thin
            || self
                .current
                .as_ref()
                .is_none_or(|current| current.layout.mesh.longest_edge(c) <= least * self.size)
    }
}

/// Is it true of all fields? Looks at every one.
fn all(done: impl ParallelIterator<Item = bool>) -> bool {
    done.reduce(|| true, |a, b| a && b)
}

/// Meshes of cells with direct light that may still be refined.
#[derive(Debug)]
pub struct CellMeshes {
    pub(crate) fields: Vec<Field>,
    pub(crate) scale: Scale,
    options: CellDirectOptions,
    ended: Ended,
}

impl CellMeshes {
    /// Values on all receivers, refined until the goal is reached.
    ///
    /// Progress is the share of elements that need no refinement.
    pub fn solve(
        receivers: Vec<CellReceiver>,
        light: &dyn Light,
        options: &CellDirectOptions,
        control: &Control<'_>,
    ) -> Self {
        let fields: Vec<Field> = receivers
            .into_par_iter()
            .map(|r| Field::new(r, light, options.degree))
            .collect();
        let mut meshes = Self {
            scale: Scale::new(light.n_bands()),
            fields,
            options: *options,
            ended: Ended::AsAsked,
        };
        let start = |field: &mut Field, stop| {
            let forest = field.forest.clone();
            field.adopt(forest, light, control, stop)
        };
        let is_done = all(meshes.fields.par_iter_mut().map(|f| start(f, control.stop)));
        if !is_done {
            // The meshes that there is still time for.
            meshes.fields.par_iter_mut().for_each(|field| {
                if field.current.is_none() {
                    field.progress = if start(field, control.at_once) {
                        Progress::BorderOnly
                    } else {
                        Progress::Nothing
                    };
                }
            });
        }
        meshes.gather_peak();
        meshes.ended = if is_done {
            meshes.refine(light, control)
        } else {
            Ended::Stopped
        };
        meshes.measure(light, control);
        for field in &mut meshes.fields {
            if field.progress == Progress::Unfinished && meshes.ended != Ended::Stopped {
                field.progress = Progress::Finished;
            }
        }
        meshes
    }

    /// The loop of Cohen et al. 1986: estimate, refine, evaluate what is new.
    fn refine(&mut self, light: &dyn Light, control: &Control<'_>) -> Ended {
        let CellDirectOptions {
            goal,
            estimator,
            most_elements,
            ..
        } = self.options;
        if goal == CellGoal::AsGiven {
            (control.progress)(Phase::Irradiance, 1.0);
            return Ended::AsAsked;
        }
        if matches!(goal, CellGoal::Elements(wanted) if wanted > most_elements) {
            return Ended::TooManyElements;
        }
        let mut points = (estimator == Estimator::Measured).then_some(Points::Nested);
        loop {
            if control.stop.is_wanted() || !self.estimate(points, light, control.stop) {
                return Ended::Stopped;
            }
            if self.options.refinement == CellRefinement::Whole
                && goal_is_tolerance(goal)
                && points != Some(Points::NestedAndOthers)
            {
                let allowed = self.allowed();
                let fields = self.fields.par_iter_mut();
                fields.for_each(|field| field.note_progress(&allowed));
            }
            let n_elements = self.n_elements();
            let marked = match goal {
                CellGoal::AsGiven => Vec::new(),
                CellGoal::Tolerance(_) => self.out_of_tolerance(),
                CellGoal::Elements(wanted) if n_elements >= wanted => return Ended::AsAsked,
                CellGoal::Elements(wanted) => self.worst(wanted - n_elements),
            };
            let n_marked: usize = marked.iter().map(Vec::len).sum();
            (control.progress)(
                Phase::Irradiance,
                1.0 - n_marked as f64 / n_elements.max(1) as f64,
            );
            if n_marked == 0 {
                if points == Some(Points::Nested) && goal_is_tolerance(goal) {
                    // All within the tolerance at the first points: then at others.
                    points = Some(Points::NestedAndOthers);
                    continue;
                }
                return match goal {
                    // Nothing left to refine: that is all there can be.
                    CellGoal::Elements(_) => Ended::ResolutionReached,
                    _ => Ended::ToleranceReached,
                };
            }
            if points.is_some() {
                points = Some(Points::Nested);
            }
            if n_elements + 3 * n_marked > most_elements {
                return Ended::TooManyElements;
            }
            let is_done = all(self.fields.par_iter_mut().zip(&marked).map(|(f, marked)| {
                let Some(current) = f.current.as_ref().filter(|_| !marked.is_empty()) else {
                    return true;
                };
                let leaves: Vec<u32> = marked
                    .iter()
                    .map(|&c| current.layout.leaves[c as usize])
                    .collect();
                let mut forest = f.forest.clone();
                forest.refine(&leaves);
                f.adopt(forest, light, control, control.stop)
            }));
            self.gather_peak();
            if !is_done {
                return Ended::Stopped;
            }
        }
    }

    /// Estimates the errors of all elements: at these points, or with the estimator.
    fn estimate(&mut self, points: Option<Points>, light: &dyn Light, stop: Stop<'_>) -> bool {
        let estimator = self.options.estimator;
        let is_done = all(self.fields.par_iter_mut().map(|field| {
            let errors = match points {
                Some(points) => field.errors_at(points, light, stop),
                None => field.estimate(estimator, light, stop),
            };
            match (errors, &mut field.current) {
                (Some(errors), Some(current)) => current.errors = errors,
                (Some(_), None) => {}
                (None, _) => return false,
            }
            true
        }));
        self.gather_peak();
        is_done
    }

    /// Measures the errors of all elements, and says whether a tolerance is kept.
    fn measure(&mut self, light: &dyn Light, control: &Control<'_>) {
        let is_measured = self.estimate(Some(Points::NestedAndOthers), light, control.at_once);
        if !is_measured {
            self.ended = Ended::Stopped;
        }
        if self.ended == Ended::ToleranceReached {
            let allowed = self.allowed();
            let least = self.options.least_size;
            for field in self.fields.iter().filter(|f| !f.is_thin) {
                for c in 0..field.n_elements() {
                    if field.excess(c, &allowed) > 1.0 {
                        if field.n_stalled >= MOST_STALLED {
                            self.ended = Ended::Stalled;
                            return;
                        }
                        if field.is_at_least_size(c, least) {
                            self.ended = Ended::ResolutionReached;
                            return;
                        }
                        self.ended = Ended::EstimateReached;
                    }
                }
            }
        }
    }

    /// Elements that are to be refined for the tolerance.
    fn out_of_tolerance(&self) -> Vec<Vec<u32>> {
        // What is measured misses the largest error by up to a factor of two; estimators
        // are taken at their word.
        let aim = match self.options.estimator {
            Estimator::Measured => SAFETY,
            _ => 1.0,
        };
        let allowed: Vec<f64> = self.allowed().iter().map(|a| aim * a).collect();
        let least = self.options.least_size;
        self.fields
            .par_iter()
            .map(|field| {
                if field.n_stalled >= MOST_STALLED {
                    return Vec::new();
                }
                if field.is_thin {
                    return Vec::new();
                }
                let out: Vec<u32> = (0..field.n_elements())
                    .filter(|&c| field.excess(c, &allowed) > 1.0)
                    .filter(|&c| !field.is_at_least_size(c, least))
                    .map(|c| c as u32)
                    .collect();
                match self.options.refinement {
                    CellRefinement::Whole if !out.is_empty() => {
                        (0..field.n_elements() as u32).collect()
                    }
                    _ => out,
                }
            })
            .collect()
    }

    /// The elements with the largest errors, at most as many as bring `missing` more.
    fn worst(&self, missing: usize) -> Vec<Vec<u32>> {
        let scale = self.scale.per_band();
        let least = self.options.least_size;
        let mut all: Vec<(f64, usize, u32)> = Vec::new();
        for (f, field) in self.fields.iter().enumerate() {
            for c in 0..field.n_elements() {
                let error = field.excess(c, &scale);
                if error > 0.0 && !field.is_at_least_size(c, least) {
                    all.push((error, f, c as u32));
                }
            }
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut marked = vec![Vec::new(); self.fields.len()];
        if self.options.refinement == CellRefinement::Whole {
            for (f, marked) in marked.iter_mut().enumerate() {
                if !self.fields[f].is_dark && !self.fields[f].is_thin {
                    *marked = (0..self.fields[f].n_elements() as u32).collect();
                }
            }
            return marked;
        }
        let largest = all.first().map_or(0.0, |w| w.0);
        // Every one brings three more.
        for &(error, f, c) in all.iter().take(missing.div_ceil(3)) {
            if error >= WORST * largest {
                marked[f].push(c);
            }
        }
        marked
    }

    fn gather_peak(&mut self) {
        self.scale
            .gather(self.fields.iter().map(|field| &field.scale));
    }

    /// The error allowed in each band; without a tolerance, none is.
    fn allowed(&self) -> Vec<f64> {
        match self.options.goal {
            CellGoal::Tolerance(tolerance) => self.scale.allowed(tolerance),
            _ => vec![0.0; self.scale.peak.len()],
        }
    }

    /// Why refinement ended.
    #[must_use]
    pub fn ended(&self) -> Ended {
        self.ended
    }

    /// Elements of all receivers that light reaches.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        let lit = self.fields.iter().filter(|f| !f.is_dark);
        lit.map(Field::n_elements).sum()
    }

    /// Exact evaluations so far that were not at nodes.
    #[must_use]
    pub fn check_evaluations(&self) -> u64 {
        let lit = self.fields.iter().filter(|f| !f.is_dark);
        lit.map(|f| f.places.n_evaluations()[1]).sum()
    }

    /// What an estimator says of every element: per receiver, `n_bands` values an element,
    /// in the unit of irradiance. Nothing if it was stopped.
    ///
    /// Its exact evaluations count as evaluations of check points.
    pub fn estimates(
        &mut self,
        estimator: Estimator,
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        self.fields
            .par_iter_mut()
            .map(|field| field.estimate(estimator, light, stop))
            .collect()
    }

    /// The largest error of every element at `n` × `n` points spread over it, none of them
    /// on its edges: per receiver, `n_bands` values an element, in the unit of irradiance.
    /// Nothing if it was stopped.
    ///
    /// For studies: its evaluations are not counted.
    #[must_use]
    pub fn true_errors(
        &self,
        n: usize,
        light: &dyn Light,
        stop: Stop<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        self.fields
            .par_iter()
            .map(|field| field.true_errors(n, light, stop))
            .collect()
    }

    /// Packs the meshes and sums up what was measured.
    #[must_use]
    pub fn finish(self) -> Solution {
        mesh::finish(self, None, Stop::NEVER)
    }

    /// The same after a solve, with direct light and irradiance with interreflection.
    ///
    /// What is not known yet of the two is evaluated at the nodes. If it is stopped, some
    /// receivers have no `irradiance`.
    #[must_use]
    pub fn finish_solved(self, other: Other<'_>, stop: Stop<'_>) -> Solution {
        mesh::finish(self, Some(other), stop)
    }
}

fn goal_is_tolerance(goal: CellGoal) -> bool {
    matches!(goal, CellGoal::Tolerance(_))
}

impl Field {
    fn true_errors(&self, n: usize, light: &dyn Light, stop: Stop<'_>) -> Option<Vec<f64>> {
        let Some(current) = &self.current else {
            return Some(Vec::new());
        };
        let mesh = &current.layout.mesh;
        let mut errors = vec![0.0f64; mesh.cells.len() * self.n_bands];
        if self.is_dark {
            return Some(errors);
        }
        // Offsets that are no fractions: never on a node's row.
        let share = |i: usize| (i as f64 + 0.512_3) / (n as f64 + 0.03);
        let mut spots = Vec::new();
        for c in 0..mesh.cells.len() {
            let is_quad = mesh.cells[c].is_quadrilateral();
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let (s, t) = (share(i), share(j));
                if is_quad || s + t < 1.0 {
                    spots.push((c, [s, t]));
                }
            }
        }
        let samples: Vec<crate::field::Sample> = spots
            .iter()
            .map(|&(c, at)| crate::field::Sample {
                point: self.chart.to_space(mesh.point(c, at)),
                toward: None,
            })
            .collect();
        let found = light.irradiance(self.face, &samples, self.contact_radius, stop)?;
        for (&(c, at), exact) in spots
            .iter()
            .zip(found.values.chunks_exact(self.n_bands.max(1)))
        {
            for (band, exact) in exact.iter().enumerate() {
                let value = current
                    .layout
                    .value(&current.direct, self.n_bands, c, at, band);
                let worst = &mut errors[c * self.n_bands + band];
                *worst = worst.max((value - exact).abs());
            }
        }
        Some(errors)
    }
}
