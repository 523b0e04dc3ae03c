//! Interreflection: the radiosity equation by collocation, with exact visibility.
//!
//! Indirect light is smooth except at contacts, so it gets its own, coarser
//! layer of elements: cut along contacts only, refined where direct light varies
//! and where the measured error of the indirect light asks for it. The unknowns
//! are indirect irradiances at its nodes,
//!
//! ```text
//! E = E_direct + E_indirect ,   E_indirect,ᵢ = Σⱼ Kᵢⱼ ρⱼ (P E_direct + E_indirect)ⱼ ,
//! Kᵢⱼ = ∫ φⱼ k V dA
//! ```
//!
//! with the integral over the exactly visible part of every element, and `P` the
//! projection of the meshed direct light onto each element (so that no power of a
//! shadow's edge that runs through a coarse element is lost). The weights
//! of an element's nodes add up to its exact form factor from the point, so that
//! row sums are those of the geometry and nothing is ever normalised.
//!
//! # Source
//!
//! Collocation for the radiosity equation: Atkinson & Chien 2000 (AC00 in
//! `docs/references.md`).

use crate::basis::{n_nodes, quadrature};
use crate::direct::{DirectMeshes, DirectOptions};
use crate::field::{CHECK_POINTS, Field, Light, Receiver};
use crate::scale::Tolerance;
use crate::solution::Solution;
use antumbra_geom::{Control, Phase, Stop};
use antumbra_mesh::Locator;
use antumbra_scene::{FaceId, PlaneId, Scene};
use antumbra_visibility::{Approach, Evaluator, Place, Scratch, Source, contour_sum};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// How to solve for interreflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiosityOptions {
    /// Error of the indirect irradiance allowed at a check point, relative to the
    /// largest irradiance.
    pub tolerance: f64,
    /// The iteration ends when no irradiance changes by more than this, relative
    /// to the largest.
    pub residual: f64,
    /// No more nodes than this in the indirect layer: its matrix is dense, eight
    /// bytes for every pair.
    pub most_nodes: usize,
    /// No more sweeps than this; 0 leaves interreflection out altogether.
    pub most_sweeps: usize,
}

impl Default for RadiosityOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            residual: 1e-7,
            most_nodes: 6800,
            most_sweeps: 1000,
        }
    }
}

/// Where the power goes, per band; the scene's units times square file units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Power {
    /// Given off by the emitters.
    pub emitted: Vec<f64>,
    /// Absorbed by fronts.
    pub absorbed: Vec<f64>,
    /// Leaves the scene, or ends on the back of a one-sided surface.
    pub escaped: Vec<f64>,
    /// (emitted − absorbed − escaped) / emitted, of the worst band.
    pub imbalance: f64,
}

/// Raw sums of form factors from the nodes of a receiver to everything: 1 in a
/// closed scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSums {
    /// The face.
    pub face: FaceId,
    /// Smallest over its nodes.
    pub min: f64,
    /// Largest over its nodes.
    pub max: f64,
    /// Mean over its area.
    pub mean: f64,
}

/// How far interreflection got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// As far as it goes.
    Finished,
    /// Stopped: that of an earlier round, which is coarser, or not converged. The power
    /// balance may be missing.
    Unfinished,
    /// Stopped before the first round was solved: direct light only, the meshes have no
    /// `irradiance`.
    Nothing,
    /// There is no room for so many bytes, which the smallest system needs: direct light
    /// only.
    NoRoom(u64),
}

impl Reached {
    /// Is there any interreflection?
    #[must_use]
    pub fn has_values(self) -> bool {
        matches!(self, Self::Finished | Self::Unfinished)
    }
}

/// Interreflection, as it was solved for.
#[derive(Debug)]
pub struct Radiosity {
    /// How far it got.
    pub reached: Reached,
    /// Sweeps of the iteration.
    pub iterations: usize,
    /// Largest change of the last sweep, relative to the largest irradiance.
    pub residual: f64,
    /// Did the iteration reach its residual?
    pub is_converged: bool,
    /// Largest error of the indirect irradiance measured at check points,
    /// relative to the largest irradiance; infinite where it was not measured.
    pub measured_indirect_error: f64,
    /// Elements and nodes of the indirect layer.
    pub indirect_elements: usize,
    /// Nodes of the indirect layer.
    pub indirect_nodes: usize,
    /// Pairs of a point and an element whose visible part was computed.
    pub visible_parts: u64,
    /// Power balance; without bands where [`Reached`] says that it may be missing.
    pub power: Power,
    /// Raw row sums, one per receiver; none without interreflection.
    pub row_sums: Vec<RowSums>,
    layer: Layer,
}

impl Radiosity {
    /// Indirect irradiance per band at a point of a face: the layer interpolated; nothing
    /// without interreflection.
    #[must_use]
    pub fn indirect_at(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>> {
        if !self.reached.has_values() {
            return None;
        }
        self.layer.indirect_at(receiver, uv)
    }

    /// Indirect irradiance per band at points of faces, gathered from the layer
    /// with exact visibility instead of interpolated: one bounce more accurate,
    /// and as dear as a row of the system. `None` for points that were not reached when it
    /// was stopped, and for all without interreflection.
    ///
    /// * `points` — pairs of a receiver's position and a point in scene units.
    ///
    /// # Source
    ///
    /// The iterated solution (Sloan 1976), known in rendering as final gathering.
    #[must_use]
    pub fn gather(
        &self,
        evaluator: &Evaluator<'_>,
        points: &[(usize, DVec3)],
        control: &Control<'_>,
    ) -> Vec<Option<Vec<f64>>> {
        let stop = control.stop;
        let points: Vec<_> = points.iter().map(|&(r, p)| (r, p, None)).collect();
        match self.gatherer(evaluator, stop) {
            Some(gatherer) => gatherer.gather(&points, stop),
            None => vec![None; points.len()],
        }
    }

    /// Prepared to gather at points again and again; nothing without interreflection.
    ///
    /// If it was stopped, not all is known of which faces see each other, and what is
    /// gathered is of no use.
    #[must_use]
    pub fn gatherer<'a, 'e, 's>(
        &'a self,
        evaluator: &'e Evaluator<'s>,
        stop: Stop<'_>,
    ) -> Option<Gatherer<'a, 'e, 's>> {
        self.reached.has_values().then(|| Gatherer {
            layer: &self.layer,
            pairs: Pairs::new(evaluator, &self.layer.fields, stop),
        })
    }
}

/// Gathers indirect irradiance from a solution, with exact visibility.
pub struct Gatherer<'a, 'e, 's> {
    layer: &'a Layer,
    pairs: Pairs<'e, 's>,
}

impl std::fmt::Debug for Gatherer<'_, '_, '_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Gatherer")
    }
}

impl Gatherer<'_, '_, '_> {
    /// Indirect irradiance per band at points of faces; `None` for points that were not
    /// reached when it was stopped.
    ///
    /// * `points` — a receiver's position, a point in scene units, and from where the
    ///   limit is taken at borders and contacts.
    #[must_use]
    pub fn gather(
        &self,
        points: &[(usize, DVec3, Option<Approach>)],
        stop: Stop<'_>,
    ) -> Vec<Option<Vec<f64>>> {
        let layer = self.layer;
        let scene = self.pairs.evaluator.scene();
        points
            .par_iter()
            .map_init(
                || {
                    let system = &layer.system;
                    (
                        Scratch::default(),
                        vec![0.0; system.n_nodes],
                        vec![0.0; scene.n_bands],
                    )
                },
                |(scratch, row, first), &(receiver, point, approach)| {
                    row.fill(0.0);
                    first.fill(0.0);
                    let mut gathered = Gathered { row, first };
                    let system = &layer.system;
                    self.pairs.gather(
                        &system.sources,
                        receiver,
                        point,
                        approach.as_ref(),
                        scratch,
                        &mut gathered,
                        stop,
                    );
                    let of_band = |band| {
                        system.gathered(&layer.fields, scene, &layer.solution, &gathered, band)
                    };
                    (!stop.is_wanted()).then(|| (0..scene.n_bands).map(of_band).collect())
                },
            )
            .collect()
    }
}

/// The finished layer of indirect light; empty without interreflection.
#[derive(Debug, Default)]
struct Layer {
    fields: Vec<Field>,
    locators: Vec<Locator>,
    /// Indirect irradiance on the nodes of every field.
    indirect: Vec<Vec<f64>>,
    /// The equation, without its rows.
    system: System,
    solution: Iterate,
}

impl Layer {
    /// Is an element of the mesh of direct light coarser than the layer there? A
    /// finer one could only follow the layer's own kinks.
    fn is_coarser(&self, receiver: usize, field: &Field, t: usize) -> bool {
        let own = &self.fields[receiver];
        let Some((element, _)) =
            self.locators[receiver].locate(&own.mesh, field.point(t, [1.0 / 3.0; 3]))
        else {
            return false;
        };
        field.longest_edge(t) > own.longest_edge(element as usize)
    }

    fn indirect_at(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>> {
        let field = &self.fields[receiver];
        let (t, at) = self.locators[receiver].locate(&field.mesh, uv)?;
        Some(
            (0..field.n_bands)
                .map(|band| field.value(&self.indirect[receiver], t as usize, at, band))
                .collect(),
        )
    }
}

/// Rounds of refinement of the indirect layer.
const MOST_ROUNDS: usize = 4;

/// The layer is refined until its interpolated values are within this many
/// tolerances: larger, and what is gathered from it errs by more than 1e-3 next to
/// the edges of a bright empty box (`fixtures/validation/radiosity/R6.2`: 1.15e-3
/// at 1.5).
const GATHERED: f64 = 1.0;

/// The indirect layer starts with elements no longer than this fraction of their
/// receiver's diagonal.
const COARSEST: f64 = 0.36;

/// Direct light varies by no more than this over an element of the layer that is
/// not refined, relative to the peak and to what degree 2 can follow.
const DIRECT_TOLERANCE: f64 = 0.02;

/// What is kept of a round of the layer: all but the rows, which take most memory.
struct Round {
    fields: Vec<Field>,
    system: System,
    solution: Iterate,
    errors: Option<Errors>,
    row_sums: Vec<RowSums>,
}

/// Solves for interreflection.
///
/// * `direct` — the meshes of direct light, refined further where indirect light
///   asks for it.
/// * `receivers` — the same faces in the same order, cut along contacts only; `None` if
///   there is no time for them.
pub fn solve_radiosity(
    evaluator: &Evaluator<'_>,
    mut direct: DirectMeshes,
    receivers: Option<Vec<Receiver>>,
    light: &dyn Light,
    options: &RadiosityOptions,
    control: &Control<'_>,
) -> (Solution, Radiosity) {
    let solved = match receivers {
        Some(receivers) => rounds(evaluator, &direct, receivers, light, options, control),
        None => Err(Reached::Nothing),
    };
    let (round, power, reached) = match solved {
        Ok(solved) => solved,
        Err(reached) => {
            let layer = Layer::default();
            let nothing = Radiosity {
                reached,
                iterations: 0,
                residual: 0.0,
                is_converged: false,
                measured_indirect_error: f64::INFINITY,
                indirect_elements: 0,
                indirect_nodes: 0,
                visible_parts: 0,
                power: Power::default(),
                row_sums: Vec::new(),
                layer,
            };
            return (direct.finish(), nothing);
        }
    };
    let Round {
        fields,
        system,
        solution,
        errors,
        row_sums,
    } = round;
    let indirect: Vec<Vec<f64>> = fields
        .iter()
        .enumerate()
        .map(|(r, field)| {
            let from = system.first_node[r] * field.n_bands;
            solution.indirect[from..from + field.nodes.len() * field.n_bands].to_vec()
        })
        .collect();
    let locators = fields.iter().map(|f| Locator::new(&f.mesh)).collect();
    let n_elements = fields.iter().map(|f| f.mesh.triangles.len()).sum();
    let errors_parts = errors.as_ref().map_or(0, |e| e.visible_parts);
    let (n_nodes, visible_parts) = (system.n_nodes, system.visible_parts + errors_parts);
    let (iterations, residual) = (solution.sweeps, solution.residual);
    let layer = Layer {
        fields,
        locators,
        indirect,
        system,
        solution,
    };

    let (totals, is_carried) = carry_over(
        &mut direct,
        &layer,
        light,
        options.tolerance,
        &layer.solution.peak,
        control.stop,
    );
    (control.progress)(Phase::Radiosity, 1.0);
    let reached = if is_carried && !power.emitted.is_empty() {
        reached
    } else {
        Reached::Unfinished
    };
    let radiosity = Radiosity {
        reached,
        iterations,
        residual,
        is_converged: residual <= options.residual && reached == Reached::Finished,
        measured_indirect_error: errors.map_or(f64::INFINITY, |e| e.worst),
        indirect_elements: n_elements,
        indirect_nodes: n_nodes,
        visible_parts,
        power,
        row_sums,
        layer,
    };
    (direct.finish_with(Some(totals)), radiosity)
}

/// Bytes of a dense matrix, and of what is known of every pair of faces.
fn bytes_needed(n_nodes: usize, n_faces: usize) -> u64 {
    let square = |n: usize| (n as u64).saturating_mul(n as u64);
    let pair = size_of::<Option<Vec<u32>>>() as u64;
    square(n_nodes)
        .saturating_mul(size_of::<f64>() as u64)
        .saturating_add(square(n_faces).saturating_mul(pair))
}

/// A face has at least two elements of degree 2 if it has four corners, one if it has
/// three: no fewer nodes than this.
const LEAST_NODES_PER_FACE: usize = 6;

/// The rounds of the layer, until it is fine enough or the work is stopped: the last one
/// that was solved, and its power balance if there was time for it.
fn rounds(
    evaluator: &Evaluator<'_>,
    direct: &DirectMeshes,
    receivers: Vec<Receiver>,
    light: &dyn Light,
    options: &RadiosityOptions,
    control: &Control<'_>,
) -> Result<(Round, Power, Reached), Reached> {
    let scene = evaluator.scene();
    let stop = control.stop;
    let n_faces = receivers.len();
    let check_room = |n_nodes: usize| {
        let needed = bytes_needed(n_nodes, n_faces);
        if (control.has_room)(needed) {
            Ok(())
        } else {
            Err(Reached::NoRoom(needed))
        }
    };
    check_room(LEAST_NODES_PER_FACE * n_faces)?;
    let coarse = DirectOptions {
        tolerance: Tolerance::Relative(DIRECT_TOLERANCE),
        degree: 2,
        most_elements: options.most_nodes / 4,
        verify: false,
    };
    // A layer of which some receivers have no values is no layer.
    let without_rest = Control {
        at_once: stop,
        ..control.quiet()
    };
    let mut layer = DirectMeshes::solve(receivers, light, &coarse, &without_rest);
    for field in &mut layer.fields {
        field.coarsest(COARSEST, stop);
    }
    if !layer.evaluate(light, stop) || stop.is_wanted() {
        return Err(Reached::Nothing);
    }
    let n_nodes = |layer: &DirectMeshes| layer.fields.iter().map(|f| f.nodes.len()).sum();
    check_room(n_nodes(&layer))?;

    let pairs = Pairs::new(evaluator, &layer.fields, stop);
    let projected = DirectLayer::new(&direct.fields);
    let mut round = 0;
    let mut last: Option<Round> = None;
    loop {
        let report = |_, done: f64| {
            (control.progress)(Phase::Radiosity, (round as f64 + done) / MOST_ROUNDS as f64);
        };
        let report = Control {
            progress: &report,
            ..*control
        };
        let Some(system) = System::assemble(&pairs, &layer.fields, &projected, &report) else {
            break;
        };
        let rough = RadiosityOptions {
            residual: options.residual.max(0.1 * options.tolerance),
            ..*options
        };
        let solution = system.solve(scene, &layer.fields, &rough, stop);
        let errors = system.errors(&pairs, &layer.fields, scene, &solution, stop);
        round += 1;
        let Some(errors) = errors else {
            last = Some(Round {
                row_sums: system.row_sums(&layer.fields),
                fields: layer.fields,
                system: system.without_rows(),
                solution,
                errors: None,
            });
            break;
        };
        let allowed: Vec<f64> = solution
            .peak
            .iter()
            .map(|p| p * options.tolerance * GATHERED)
            .collect();
        let room = options.most_nodes.saturating_sub(system.n_nodes) / NODES_PER_BISECTION;
        let levels = worst_levels(&layer.fields, &errors.per_field, &allowed, room);
        let is_done = levels.iter().flatten().all(|&l| l == 0);
        // At most twice as many nodes; the rows of this round go before those of the next.
        let next_nodes = (2 * system.n_nodes).min(options.most_nodes.max(system.n_nodes));
        let more = bytes_needed(next_nodes, 0) - bytes_needed(system.n_nodes, 0);
        let is_last =
            is_done || round == MOST_ROUNDS || stop.is_wanted() || !(control.has_room)(more);
        if is_last {
            let solution = system.solve(scene, &layer.fields, options, stop);
            let power = system.power(&pairs, scene, &layer.fields, &solution, stop);
            let reached = if is_done || round == MOST_ROUNDS {
                Reached::Finished
            } else {
                Reached::Unfinished
            };
            let round = Round {
                row_sums: system.row_sums(&layer.fields),
                fields: layer.fields,
                system: system.without_rows(),
                solution,
                errors: Some(errors),
            };
            return Ok((round, power.unwrap_or_default(), reached));
        }
        last = Some(Round {
            row_sums: system.row_sums(&layer.fields),
            fields: layer.fields.clone(),
            system: system.without_rows(),
            solution,
            errors: Some(errors),
        });
        if !layer.refine(levels, light, stop) {
            break;
        }
    }
    match last {
        Some(round) => Ok((round, Power::default(), Reached::Unfinished)),
        None => Err(Reached::Nothing),
    }
}

/// How often the elements of the layer are to be bisected: those whose errors weigh
/// most, no more of them than there is room for.
///
/// An error weighs by the area it reaches over, a little less than in proportion:
/// narrow strips along edges and contacts matter to little but themselves.
fn worst_levels(
    fields: &[Field],
    errors: &[Vec<f64>],
    allowed: &[f64],
    room: usize,
) -> Vec<Vec<u8>> {
    let mut levels: Vec<Vec<u8>> = fields
        .iter()
        .zip(errors)
        .map(|(f, e)| {
            f.levels_for(e, allowed)
                .into_iter()
                .map(|l| l.min(2))
                .collect()
        })
        .collect();
    let mut marked: Vec<(f64, usize, usize)> = Vec::new();
    for (r, field) in fields.iter().enumerate() {
        for (t, &level) in levels[r].iter().enumerate() {
            if level > 0 {
                let error = allowed
                    .iter()
                    .enumerate()
                    .filter(|(_, a)| **a > 0.0)
                    .map(|(band, a)| errors[r][t * field.n_bands + band] / a)
                    .fold(0.0, f64::max);
                marked.push((error * field.mesh.area(t as u32).powf(0.75), r, t));
            }
        }
    }
    marked.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut spent = 0;
    for (_, r, t) in marked {
        spent += usize::from(levels[r][t]);
        if spent > room {
            levels[r][t] = 0;
        }
    }
    levels
}

/// Nodes a bisection adds on average, with those that keep the mesh conforming.
const NODES_PER_BISECTION: usize = 3;

/// Irradiance with interreflection on the meshes of direct light, refined where
/// their elements cannot follow the indirect layer; and whether there was time for it.
fn carry_over(
    direct: &mut DirectMeshes,
    layer: &Layer,
    light: &dyn Light,
    tolerance: f64,
    peak: &[f64],
    stop: Stop<'_>,
) -> (Vec<Vec<f64>>, bool) {
    let allowed: Vec<f64> = peak.iter().map(|p| p * tolerance).collect();
    for last in [false, false, false, false, false, true] {
        let indirect: Vec<Vec<f64>> = direct
            .fields
            .par_iter()
            .enumerate()
            .map(|(r, field)| indirect_on_nodes(field, layer, r))
            .collect();
        let levels: Vec<Vec<u8>> = direct
            .fields
            .par_iter()
            .enumerate()
            .map(|(r, field)| {
                let mut errors = vec![0.0f64; field.mesh.triangles.len() * field.n_bands];
                for t in 0..field.mesh.triangles.len() {
                    if !layer.is_coarser(r, field, t) {
                        continue;
                    }
                    for at in CHECK_POINTS {
                        let Some(wanted) = layer.indirect_at(r, field.point(t, at)) else {
                            continue;
                        };
                        for (band, wanted) in wanted.iter().enumerate() {
                            let error = (field.value(&indirect[r], t, at, band) - wanted).abs();
                            let worst = &mut errors[t * field.n_bands + band];
                            *worst = worst.max(error);
                        }
                    }
                }
                field.levels_for(&errors, &allowed)
            })
            .collect();
        let is_done = levels.iter().flatten().all(|&l| l == 0);
        let is_stopped = stop.is_wanted();
        if last || is_done || is_stopped {
            let totals = indirect
                .into_iter()
                .zip(&direct.fields)
                .map(|(i, f)| i.iter().zip(&f.direct).map(|(i, d)| i + d).collect())
                .collect();
            return (totals, last || is_done);
        }
        direct.refine(levels, light, stop);
    }
    unreachable!("the last round returns")
}

fn indirect_on_nodes(field: &Field, layer: &Layer, receiver: usize) -> Vec<f64> {
    let mut indirect = vec![f64::NAN; field.nodes.len() * field.n_bands];
    for t in 0..field.mesh.triangles.len() {
        let centroid = field.point(t, [1.0 / 3.0; 3]);
        for &node in &field.element_nodes[t][..n_nodes(field.degree)] {
            let at = node as usize * field.n_bands;
            if indirect[at].is_nan() {
                // A hair inside the element: on its side of a contact.
                let uv = field.nodes[node as usize];
                let inside = uv + (centroid - uv) * 1e-6;
                let values = layer.indirect_at(receiver, inside).unwrap_or_default();
                for band in 0..field.n_bands {
                    indirect[at + band] = values.get(band).copied().unwrap_or(0.0);
                }
            }
        }
    }
    for value in &mut indirect {
        if value.is_nan() {
            *value = 0.0; // A node no element uses any more.
        }
    }
    indirect
}

/// An element of the layer as a source.
#[derive(Debug)]
struct SourceElement {
    corners: [DVec3; 3],
    /// λ₀ = 1 + g₀·(x − corner 0); λ₁ = g₁·(x − corner 0); λ₂ = g₂·(x − corner 0).
    gradients: [DVec3; 3],
    /// Global node ids.
    nodes: [u32; 6],
    /// Direct irradiance projected onto the element: a coefficient per node and band.
    direct: Vec<f64>,
}

/// A face of the layer as a source.
#[derive(Debug)]
struct SourceFace {
    normal: DVec3,
    plane: PlaneId,
    reflectance: Vec<f64>,
    elements: Vec<SourceElement>,
}

/// What a point gathers.
struct Gathered<'a> {
    /// Weight of every node of the layer.
    row: &'a mut [f64],
    /// Reflected direct light, per band.
    first: &'a mut [f64],
}

/// Which faces see which, and what may stand between.
struct Pairs<'e, 's> {
    evaluator: &'e Evaluator<'s>,
    faces: Vec<FaceId>,
    /// Per receiver and source: `None` if they cannot see each other.
    between: Vec<Option<Vec<u32>>>,
}

/// Longer lists of occluders are replaced by a query of the box tree.
const LONGEST_LIST: usize = 24;

impl<'e, 's> Pairs<'e, 's> {
    /// If it was stopped, not all pairs are known and it is of no use.
    fn new(evaluator: &'e Evaluator<'s>, fields: &[Field], stop: Stop<'_>) -> Self {
        let scene = evaluator.scene();
        let faces: Vec<FaceId> = fields.iter().map(|f| f.face).collect();
        let outlines: Vec<Vec<DVec3>> = faces
            .iter()
            .map(|&f| scene.positions(&scene.face(f).outline))
            .collect();
        let n = faces.len();
        let between = (0..n * n)
            .into_par_iter()
            .map(|k| {
                let (r, s) = (k / n, k % n);
                let (a, b) = (scene.face(faces[r]), scene.face(faces[s]));
                let is_covered = a.is_covered || b.is_covered;
                if r == s || a.plane == b.plane || is_covered || stop.is_wanted() {
                    return None;
                }
                evaluator.between(
                    &outlines[r],
                    (a.normal, a.plane),
                    &outlines[s],
                    (b.normal, b.plane),
                )
            })
            .collect();
        Self {
            evaluator,
            faces,
            between,
        }
    }

    /// Adds what is seen from a point to `gathered`; returns how many visible parts
    /// were computed. Not all is seen if it was stopped.
    fn gather(
        &self,
        sources: &[SourceFace],
        receiver: usize,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
        gathered: &mut Gathered<'_>,
        stop: Stop<'_>,
    ) -> u64 {
        let scene = self.evaluator.scene();
        let face = scene.face(self.faces[receiver]);
        let place = Place {
            point,
            normal: face.normal,
            plane: Some(face.plane),
            approach: approach.copied(),
        };
        let mut n_parts = 0;
        for (s, source) in sources.iter().enumerate() {
            let Some(list) = &self.between[receiver * sources.len() + s] else {
                continue;
            };
            let list = (list.len() <= LONGEST_LIST).then_some(list.as_slice());
            // The whole face first: most faces are seen in full or not at all, and
            // then their elements need no occluders.
            let list = match self.face_visibility(receiver, s, list, point, approach, scratch) {
                FaceVisibility::None => continue,
                FaceVisibility::Full => Some(&[][..]),
                FaceVisibility::Part => list,
            };
            if stop.is_wanted() {
                break;
            }
            for element in &source.elements {
                n_parts += 1;
                self.evaluator.see_parts(
                    &place,
                    &element.corners,
                    (source.plane, source.normal),
                    list,
                    scratch,
                    |fragment, factor| {
                        let seen = Seen {
                            element,
                            source,
                            point,
                            normal: face.normal,
                        };
                        if factor > 0.0 {
                            seen.add_fragment(fragment, factor, gathered);
                        }
                    },
                );
            }
        }
        n_parts
    }
}

/// How much of a face a point sees.
enum FaceVisibility {
    None,
    Part,
    Full,
}

impl Pairs<'_, '_> {
    /// Does a point see a face in full, in part or not at all?
    fn face_visibility(
        &self,
        receiver: usize,
        source: usize,
        list: Option<&[u32]>,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
    ) -> FaceVisibility {
        if list.is_some_and(<[u32]>::is_empty) {
            return FaceVisibility::Full;
        }
        let seen = self.face_factor(receiver, source, list, point, approach, scratch);
        let whole = self.face_factor(receiver, source, Some(&[]), point, approach, scratch);
        // Equal to the bit where no occluder cut anything.
        if seen == 0.0 {
            FaceVisibility::None
        } else if seen == whole {
            FaceVisibility::Full
        } else {
            FaceVisibility::Part
        }
    }

    /// The form factor from a point to a face, behind the occluders of `list`.
    fn face_factor(
        &self,
        receiver: usize,
        source: usize,
        list: Option<&[u32]>,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
    ) -> f64 {
        let scene = self.evaluator.scene();
        let face = scene.face(self.faces[receiver]);
        let place = Place {
            point,
            normal: face.normal,
            plane: Some(face.plane),
            approach: approach.copied(),
        };
        let source = Source::of(scene, self.faces[source]);
        self.evaluator.see(&place, &source, list, scratch).factor
    }

    /// The form factor from a point to all fronts of the scene: what of its
    /// radiosity does not escape. Whole faces, hence cheap.
    fn row_sum(&self, receiver: usize, point: DVec3, scratch: &mut Scratch) -> f64 {
        let n = self.faces.len();
        let mut sum = 0.0;
        for source in 0..n {
            if let Some(list) = &self.between[receiver * n + source] {
                let list = (list.len() <= LONGEST_LIST).then_some(list.as_slice());
                sum += self.face_factor(receiver, source, list, point, None, scratch);
            }
        }
        sum
    }
}

/// A visible part of an element from a point.
struct Seen<'a> {
    element: &'a SourceElement,
    source: &'a SourceFace,
    point: DVec3,
    normal: DVec3,
}

/// A part this small, relative to its distance, is integrated by one rule.
const NEAR: f64 = 0.9;

/// Parts at the point itself are not cut any further than this.
const DEEPEST: u32 = 4;

impl Seen<'_> {
    fn add_fragment(&self, fragment: &[DVec3], factor: f64, gathered: &mut Gathered<'_>) {
        if fragment.len() == 3 {
            self.add_triangle([fragment[0], fragment[1], fragment[2]], factor, 0, gathered);
            return;
        }
        // A fan around the corner nearest to the point: where the element touches
        // the point, other fans have triangles that span half of the sky.
        let n = fragment.len();
        let apex = (0..n)
            .min_by(|&i, &j| {
                fragment[i]
                    .length_squared()
                    .total_cmp(&fragment[j].length_squared())
            })
            .unwrap_or(0);
        for k in 1..n - 1 {
            let triangle = [
                fragment[apex],
                fragment[(apex + k) % n],
                fragment[(apex + k + 1) % n],
            ];
            let factor = contour_sum(&triangle, self.normal);
            self.add_triangle(triangle, factor, 0, gathered);
        }
    }

    /// Distributes the factor of a triangle (corners relative to the point) over
    /// the element's nodes.
    fn add_triangle(
        &self,
        [a, b, c]: [DVec3; 3],
        factor: f64,
        depth: u32,
        gathered: &mut Gathered<'_>,
    ) {
        if factor <= 0.0 {
            return;
        }
        let size_sq = (b - a)
            .length_squared()
            .max((c - b).length_squared())
            .max((a - c).length_squared());
        let middle = (a + b + c) / 3.0;
        if size_sq > NEAR * NEAR * middle.length_squared() && depth < DEEPEST {
            let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
            for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                let factor = contour_sum(&part, self.normal);
                self.add_triangle(part, factor, depth + 1, gathered);
            }
            return;
        }
        // φ weighted by the kernel; the sum of the weights is set to the factor.
        let mut sum = 0.0;
        let mut weights = [0.0; 6];
        for (at, w) in RULE {
            let y = a * at[0] + b * at[1] + c * at[2];
            let r_sq = y.length_squared();
            let k = w * self.normal.dot(y) * -self.source.normal.dot(y) / (r_sq * r_sq);
            if k > 0.0 {
                sum += k;
                let phi = quadratic(self.barycentric(y));
                for (weight, phi) in weights.iter_mut().zip(phi) {
                    *weight += k * phi;
                }
            }
        }
        let scale = if sum > 0.0 {
            factor / sum
        } else {
            weights = quadratic(self.barycentric(middle));
            factor
        };
        let n_bands = gathered.first.len();
        for (k, (&node, weight)) in self.element.nodes.iter().zip(weights).enumerate() {
            gathered.row[node as usize] += weight * scale;
            for (band, first) in gathered.first.iter_mut().enumerate() {
                *first += weight
                    * scale
                    * self.source.reflectance[band]
                    * self.element.direct[k * n_bands + band];
            }
        }
    }

    fn barycentric(&self, y: DVec3) -> [f64; 3] {
        let x = y + (self.point - self.element.corners[0]);
        let g = &self.element.gradients;
        [1.0 + g[0].dot(x), g[1].dot(x), g[2].dot(x)]
    }
}

/// The six basis functions of degree 2, in the order of
/// [`lattice`](crate::basis::lattice).
fn quadratic([a, b, c]: [f64; 3]) -> [f64; 6] {
    [
        a * (2.0 * a - 1.0),
        b * (2.0 * b - 1.0),
        c * (2.0 * c - 1.0),
        4.0 * a * b,
        4.0 * b * c,
        4.0 * c * a,
    ]
}

/// Seven points, exact for degree 5: Radon's rule (Dunavant 1985).
const RULE: [([f64; 3], f64); 7] = {
    const A: f64 = 0.470_142_064_105_115;
    const B: f64 = 0.101_286_507_323_456;
    const WA: f64 = 0.132_394_152_788_506;
    const WB: f64 = 0.125_939_180_544_827;
    const T: f64 = 1.0 / 3.0;
    [
        ([T, T, T], 0.225),
        ([A, A, 1.0 - 2.0 * A], WA),
        ([A, 1.0 - 2.0 * A, A], WA),
        ([1.0 - 2.0 * A, A, A], WA),
        ([B, B, 1.0 - 2.0 * B], WB),
        ([B, 1.0 - 2.0 * B, B], WB),
        ([1.0 - 2.0 * B, B, B], WB),
    ]
};

/// The discrete radiosity equation of one state of the layer.
#[derive(Debug, Default)]
struct System {
    n_nodes: usize,
    /// Where the nodes of every field start.
    first_node: Vec<usize>,
    sources: Vec<SourceFace>,
    /// Rows of weights, dense; rows of nodes no element uses are empty.
    rows: Vec<Vec<f64>>,
    /// Reflected direct light at every node, per band.
    first: Vec<f64>,
    visible_parts: u64,
}

/// The solution at the nodes.
#[derive(Debug, Default)]
struct Iterate {
    /// Indirect irradiance, `n_bands` values per node.
    indirect: Vec<f64>,
    /// Largest irradiance per band, direct light included.
    peak: Vec<f64>,
    sweeps: usize,
    residual: f64,
}

/// Measured errors of the indirect layer.
struct Errors {
    /// Per field: per element and band.
    per_field: Vec<Vec<f64>>,
    /// Relative to the peak.
    worst: f64,
    visible_parts: u64,
}

impl System {
    /// The system of a layer; nothing if it was stopped.
    fn assemble(
        pairs: &Pairs<'_, '_>,
        fields: &[Field],
        direct: &DirectLayer<'_>,
        control: &Control<'_>,
    ) -> Option<Self> {
        let (scene, stop) = (pairs.evaluator.scene(), control.stop);
        let mut first_node = Vec::with_capacity(fields.len());
        let mut n_nodes = 0;
        for field in fields {
            first_node.push(n_nodes);
            n_nodes += field.nodes.len();
        }
        let sources: Vec<SourceFace> = fields
            .iter()
            .zip(&first_node)
            .enumerate()
            .map(|(r, (field, &first))| source_face(scene, field, first, direct, r))
            .collect();
        let mut is_used = vec![false; n_nodes];
        for element in sources.iter().flat_map(|s| &s.elements) {
            for &node in &element.nodes {
                is_used[node as usize] = true;
            }
        }
        // (field, node) of every row.
        let owners: Vec<(usize, usize)> = fields
            .iter()
            .enumerate()
            .flat_map(|(r, f)| (0..f.nodes.len()).map(move |i| (r, i)))
            .collect();
        let n_done = std::sync::atomic::AtomicUsize::new(0);
        let n_bands = scene.n_bands;
        let rows: Vec<(Vec<f64>, Vec<f64>, u64)> = owners
            .par_iter()
            .enumerate()
            .map_init(Scratch::default, |scratch, (node, &(r, i))| {
                if !is_used[node] || stop.is_wanted() {
                    return (Vec::new(), vec![0.0; n_bands], 0);
                }
                let field = &fields[r];
                let mut row = vec![0.0; n_nodes];
                let mut first = vec![0.0; n_bands];
                let mut gathered = Gathered {
                    row: &mut row,
                    first: &mut first,
                };
                let approach = field.toward[i].map(|toward| Approach {
                    toward,
                    radius: field.contact_radius(),
                });
                let point = field.chart.to_space(field.nodes[i]);
                let n = pairs.gather(
                    &sources,
                    r,
                    point,
                    approach.as_ref(),
                    scratch,
                    &mut gathered,
                    stop,
                );
                let done = n_done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if done.is_multiple_of(64) {
                    (control.progress)(Phase::Radiosity, done as f64 / n_nodes as f64);
                }
                (row, first, n)
            })
            .collect();
        if stop.is_wanted() {
            return None;
        }
        let visible_parts = rows.iter().map(|(_, _, n)| n).sum();
        let first = rows
            .iter()
            .flat_map(|(_, first, _)| first.iter().copied())
            .collect();
        let rows = rows.into_iter().map(|(row, _, _)| row).collect();
        Some(Self {
            n_nodes,
            first_node,
            sources,
            rows,
            first,
            visible_parts,
        })
    }

    /// What is left of it when it is solved.
    fn without_rows(self) -> Self {
        Self {
            rows: Vec::new(),
            ..self
        }
    }

    /// Gauss–Seidel sweeps until nothing changes by more than the residual, or until it
    /// is stopped.
    fn solve(
        &self,
        scene: &Scene,
        fields: &[Field],
        options: &RadiosityOptions,
        stop: Stop<'_>,
    ) -> Iterate {
        let n_bands = scene.n_bands;
        let direct: Vec<f64> = fields
            .iter()
            .flat_map(|f| f.direct.iter().copied())
            .collect();
        let reflectance: Vec<&[f64]> = fields
            .iter()
            .flat_map(|f| {
                std::iter::repeat_n(scene.material(f.face).reflectance.as_slice(), f.nodes.len())
            })
            .collect();
        let mut indirect = if options.most_sweeps > 0 {
            self.first.clone()
        } else {
            vec![0.0; self.first.len()]
        };
        // Reflected indirect light of every node, one vector per band.
        let mut reflected: Vec<Vec<f64>> = (0..n_bands)
            .map(|band| {
                (0..self.n_nodes)
                    .map(|node| reflectance[node][band] * indirect[node * n_bands + band])
                    .collect()
            })
            .collect();
        let (mut sweeps, mut residual) = (0, 0.0f64);
        while sweeps < options.most_sweeps {
            sweeps += 1;
            let mut change = 0.0f64;
            let mut peak = 0.0f64;
            for (node, row) in self.rows.iter().enumerate() {
                if row.is_empty() {
                    continue;
                }
                for (band, reflected) in reflected.iter_mut().enumerate() {
                    let at = node * n_bands + band;
                    let sum = self.first[at] + dot(row, reflected);
                    change = change.max((sum - indirect[at]).abs());
                    peak = peak.max((direct[at] + sum).abs());
                    indirect[at] = sum;
                    reflected[node] = reflectance[node][band] * sum;
                }
            }
            residual = if peak > 0.0 { change / peak } else { 0.0 };
            if residual <= options.residual || stop.is_wanted() {
                break;
            }
        }
        let mut peak = vec![0.0f64; n_bands];
        for (node, row) in self.rows.iter().enumerate() {
            if !row.is_empty() {
                let values = direct[node * n_bands..]
                    .iter()
                    .zip(&indirect[node * n_bands..]);
                for (peak, (d, i)) in peak.iter_mut().zip(values) {
                    *peak = peak.max(d + i);
                }
            }
        }
        Iterate {
            indirect,
            peak,
            sweeps,
            residual,
        }
    }

    /// Indirect irradiance gathered exactly at one point of every element against
    /// the interpolated one; nothing if it was stopped.
    fn errors(
        &self,
        pairs: &Pairs<'_, '_>,
        fields: &[Field],
        scene: &Scene,
        solution: &Iterate,
        stop: Stop<'_>,
    ) -> Option<Errors> {
        let n_bands = scene.n_bands;
        let per_field: Vec<(Vec<f64>, u64)> = fields
            .iter()
            .enumerate()
            .map(|(r, field)| {
                let first = self.first_node[r] * n_bands;
                let indirect = &solution.indirect[first..first + field.nodes.len() * n_bands];
                let found: Vec<(Vec<f64>, u64)> = (0..field.mesh.triangles.len())
                    .into_par_iter()
                    .map_init(
                        || {
                            (
                                Scratch::default(),
                                vec![0.0; self.n_nodes],
                                vec![0.0; n_bands],
                            )
                        },
                        |(scratch, row, reflected), t| {
                            if stop.is_wanted() {
                                return (Vec::new(), 0);
                            }
                            row.fill(0.0);
                            reflected.fill(0.0);
                            let mut gathered = Gathered {
                                row,
                                first: reflected,
                            };
                            let at = CHECK_POINTS[0];
                            let point = field.chart.to_space(field.point(t, at));
                            let n = pairs.gather(
                                &self.sources,
                                r,
                                point,
                                None,
                                scratch,
                                &mut gathered,
                                stop,
                            );
                            let errors = (0..n_bands)
                                .map(|band| {
                                    let exact =
                                        self.gathered(fields, scene, solution, &gathered, band);
                                    (field.value(indirect, t, at, band) - exact).abs()
                                })
                                .collect();
                            (errors, n)
                        },
                    )
                    .collect();
                let n = found.iter().map(|(_, n)| n).sum();
                (found.into_iter().flat_map(|(e, _)| e).collect(), n)
            })
            .collect();
        if stop.is_wanted() {
            return None;
        }
        let visible_parts = per_field.iter().map(|(_, n)| n).sum();
        let per_field: Vec<Vec<f64>> = per_field.into_iter().map(|(e, _)| e).collect();
        let mut worst = 0.0f64;
        for errors in &per_field {
            for (i, e) in errors.iter().enumerate() {
                let peak = solution.peak[i % n_bands];
                if peak > 0.0 {
                    worst = worst.max(e / peak);
                }
            }
        }
        Some(Errors {
            per_field,
            worst,
            visible_parts,
        })
    }

    /// Indirect irradiance of what was gathered.
    fn gathered(
        &self,
        fields: &[Field],
        scene: &Scene,
        solution: &Iterate,
        gathered: &Gathered<'_>,
        band: usize,
    ) -> f64 {
        let n_bands = scene.n_bands;
        let mut sum = gathered.first[band];
        for (r, field) in fields.iter().enumerate() {
            let rho = scene.material(field.face).reflectance[band];
            if rho == 0.0 {
                continue;
            }
            let first = self.first_node[r];
            let part: f64 = (first..first + field.nodes.len())
                .map(|j| gathered.row[j] * solution.indirect[j * n_bands + band])
                .sum();
            sum += rho * part;
        }
        sum
    }

    /// The power balance, integrated over the layer; what escapes is weighed by
    /// exact row sums at the points of the rule. Nothing if it was stopped.
    fn power(
        &self,
        pairs: &Pairs<'_, '_>,
        scene: &Scene,
        fields: &[Field],
        solution: &Iterate,
        stop: Stop<'_>,
    ) -> Option<Power> {
        let n_bands = scene.n_bands;
        let mut power = Power {
            emitted: vec![0.0; n_bands],
            absorbed: vec![0.0; n_bands],
            escaped: vec![0.0; n_bands],
            imbalance: 0.0,
        };
        for (r, field) in fields.iter().enumerate() {
            let material = scene.material(field.face);
            let first = self.first_node[r];
            let seen: Vec<[f64; RULE.len()]> = (0..field.mesh.triangles.len())
                .into_par_iter()
                .map_init(Scratch::default, |scratch, t| {
                    RULE.map(|(at, _)| {
                        if stop.is_wanted() {
                            return 0.0;
                        }
                        let point = field.chart.to_space(field.point(t, at));
                        pairs.row_sum(r, point, scratch)
                    })
                })
                .collect();
            for (t, seen) in seen.iter().enumerate() {
                let area = scene.frame.area_to_file(field.mesh.area(t as u32));
                let direct = &self.sources[r].elements[t].direct;
                for ((at, w), seen) in RULE.into_iter().zip(seen) {
                    let phi = quadratic(at);
                    for band in 0..n_bands {
                        let e: f64 = (0..6)
                            .map(|k| {
                                let node = first + field.element_nodes[t][k] as usize;
                                let indirect = solution.indirect[node * n_bands + band];
                                phi[k] * (direct[k * n_bands + band] + indirect)
                            })
                            .sum();
                        let (rho, m) = (material.reflectance[band], material.exitance[band]);
                        power.emitted[band] += w * area * m;
                        power.absorbed[band] += w * area * (1.0 - rho) * e;
                        power.escaped[band] += w * area * (m + rho * e) * (1.0 - seen);
                    }
                }
            }
        }
        for band in 0..n_bands {
            if power.emitted[band] > 0.0 {
                let rest = power.emitted[band] - power.absorbed[band] - power.escaped[band];
                power.imbalance = power.imbalance.max((rest / power.emitted[band]).abs());
            }
        }
        (!stop.is_wanted()).then_some(power)
    }

    fn row_sums(&self, fields: &[Field]) -> Vec<RowSums> {
        fields
            .iter()
            .enumerate()
            .map(|(r, field)| {
                let first = self.first_node[r];
                let sum = |i: usize| self.rows[first + i].iter().sum::<f64>();
                let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
                for i in 0..field.nodes.len() {
                    if !self.rows[first + i].is_empty() {
                        min = min.min(sum(i));
                        max = max.max(sum(i));
                    }
                }
                let (mut mean, mut area) = (0.0, 0.0);
                for t in 0..field.mesh.triangles.len() {
                    // Degree 2: the mean is that of the middles of the edges.
                    let a = field.mesh.area(t as u32);
                    let nodes = &field.element_nodes[t][3..6];
                    mean += a * nodes.iter().map(|&i| sum(i as usize)).sum::<f64>() / 3.0;
                    area += a;
                }
                RowSums {
                    face: field.face,
                    min,
                    max,
                    mean: mean / area,
                }
            })
            .collect()
    }
}

/// The meshed direct light, to be projected onto the layer.
struct DirectLayer<'a> {
    fields: &'a [Field],
    locators: Vec<Locator>,
}

impl<'a> DirectLayer<'a> {
    fn new(fields: &'a [Field]) -> Self {
        Self {
            fields,
            locators: fields.par_iter().map(|f| Locator::new(&f.mesh)).collect(),
        }
    }

    /// The coefficients of the projection onto an element of degree 2 with these
    /// corners, per node and band: what differs is orthogonal to the basis, so
    /// that every element keeps the power that falls on it.
    fn project(&self, receiver: usize, [a, b, c]: [DVec2; 3], n_bands: usize) -> Vec<f64> {
        let field = &self.fields[receiver];
        let mut result = vec![0.0; 6 * n_bands];
        if field.is_dark {
            return result;
        }
        let mut moments = vec![[0.0; 6]; n_bands];
        // The rule on each of the four quarters: shadows' edges run through.
        for quarter in 0..4 {
            for (at, w) in quadrature() {
                let at = match quarter {
                    0..3 => {
                        let mut at = at.map(|l| l / 2.0);
                        at[quarter] += 0.5;
                        at
                    }
                    _ => at.map(|l| 0.5 - l / 2.0),
                };
                let uv = a * at[0] + b * at[1] + c * at[2];
                let Some((t, inside)) = self.locators[receiver].locate(&field.mesh, uv) else {
                    continue;
                };
                let phi = quadratic(at);
                for (band, moments) in moments.iter_mut().enumerate() {
                    let e = field.value(&field.direct, t as usize, inside, band);
                    for (moment, phi) in moments.iter_mut().zip(phi) {
                        *moment += w / 4.0 * phi * e;
                    }
                }
            }
        }
        for (band, moments) in moments.iter().enumerate() {
            for (k, coefficient) in solve_mass(*moments).into_iter().enumerate() {
                result[k * n_bands + band] = coefficient;
            }
        }
        result
    }
}

/// A dot product in four interleaved sums: a fixed order that the processor's
/// vector units can keep up with.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (quads_a, quads_b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = quads_a
        .remainder()
        .iter()
        .zip(quads_b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in quads_a.zip(quads_b) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Solves `M c = moments` with the mass matrix of degree 2 on a triangle of area 1.
fn solve_mass(mut moments: [f64; 6]) -> [f64; 6] {
    let mut m = [
        [6.0, -1.0, -1.0, 0.0, -4.0, 0.0],
        [-1.0, 6.0, -1.0, 0.0, 0.0, -4.0],
        [-1.0, -1.0, 6.0, -4.0, 0.0, 0.0],
        [0.0, 0.0, -4.0, 32.0, 16.0, 16.0],
        [-4.0, 0.0, 0.0, 16.0, 32.0, 16.0],
        [0.0, -4.0, 0.0, 16.0, 16.0, 32.0],
    ];
    for moment in &mut moments {
        *moment *= 180.0;
    }
    // Positive definite: elimination needs no pivots.
    for i in 0..6 {
        for j in i + 1..6 {
            let f = m[j][i] / m[i][i];
            let pivot = m[i];
            for (x, p) in m[j].iter_mut().zip(pivot) {
                *x -= f * p;
            }
            moments[j] -= f * moments[i];
        }
    }
    let mut c = [0.0; 6];
    for i in (0..6).rev() {
        let sum: f64 = (i + 1..6).map(|j| m[i][j] * c[j]).sum();
        c[i] = (moments[i] - sum) / m[i][i];
    }
    c
}

fn source_face(
    scene: &Scene,
    field: &Field,
    first: usize,
    direct: &DirectLayer<'_>,
    receiver: usize,
) -> SourceFace {
    let face = scene.face(field.face);
    let elements = (0..field.mesh.triangles.len())
        .into_par_iter()
        .map(|t| {
            let corners = field.mesh.triangles[t]
                .map(|v| field.chart.to_space(field.mesh.vertices[v as usize]));
            let [a, b, c] = corners;
            let twice_area = (b - a).cross(c - a).dot(field.chart.normal);
            let gradient = |e: DVec3| field.chart.normal.cross(e) / twice_area;
            let mut nodes = [0; 6];
            for (node, &id) in nodes.iter_mut().zip(&field.element_nodes[t]) {
                *node = first as u32 + id;
            }
            SourceElement {
                corners,
                gradients: [gradient(c - b), gradient(a - c), gradient(b - a)],
                nodes,
                direct: direct.project(
                    receiver,
                    field.mesh.triangles[t].map(|v| field.mesh.vertices[v as usize]),
                    scene.n_bands,
                ),
            }
        })
        .collect();
    SourceFace {
        normal: face.normal,
        plane: face.plane,
        reflectance: scene.material(field.face).reflectance.clone(),
        elements,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_reproduces_the_basis() {
        // The moments of φ₄ are the fifth column of the mass matrix.
        let moments = [-4.0, 0.0, 0.0, 16.0, 32.0, 16.0].map(|m| m / 180.0);
        for (k, c) in solve_mass(moments).into_iter().enumerate() {
            assert!((c - f64::from(u8::from(k == 4))).abs() < 1e-14);
        }
    }
}
