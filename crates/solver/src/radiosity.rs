//! Interreflection: the radiosity equation by collocation, with exact visibility.
//!
//! Indirect light is smooth except at contacts, so it gets its own, coarser
//! layer of elements: cut along contacts only, refined where direct light varies
//! and where the measured error of the indirect light asks for it. The unknowns
//! are irradiances at its nodes,
//!
//! ```text
//! Eᵢ = E_direct,ᵢ + Σⱼ Kᵢⱼ ρⱼ Eⱼ ,   Kᵢⱼ = ∫ φⱼ k V dA
//! ```
//!
//! with the integral over the exactly visible part of every element. The weights
//! of an element's nodes add up to its exact form factor from the point, so that
//! row sums are those of the geometry and nothing is ever normalised.
//!
//! # Source
//!
//! Collocation for the radiosity equation: Atkinson & Chien 2000 (AC00 in
//! `docs/references.md`).

use crate::basis::{n_nodes, quadrature, values};
use crate::direct::{DirectMeshes, DirectOptions, DirectSolution, Tolerance};
use crate::field::{CHECK_POINTS, Field, Light, Receiver};
use antumbra_mesh::Locator;
use antumbra_scene::{FaceId, PlaneId, Scene};
use antumbra_visibility::{Approach, Evaluator, Scratch, Source, contour_sum};
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
    /// No more sweeps than this.
    pub most_sweeps: usize,
}

impl Default for RadiosityOptions {
    fn default() -> Self {
        Self { tolerance: 1e-3, residual: 1e-7, most_nodes: 7000, most_sweeps: 1000 }
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

/// Direct light and interreflection.
#[derive(Debug)]
pub struct RadiositySolution {
    /// The meshes, with `irradiance` on every node.
    pub meshes: DirectSolution,
    /// Sweeps of the iteration.
    pub iterations: usize,
    /// Largest change of the last sweep, relative to the largest irradiance.
    pub residual: f64,
    /// Did the iteration reach its residual?
    pub is_converged: bool,
    /// Largest error of the indirect irradiance measured at check points,
    /// relative to the largest irradiance.
    pub measured_indirect_error: f64,
    /// Elements and nodes of the indirect layer.
    pub indirect_elements: usize,
    /// Nodes of the indirect layer.
    pub indirect_nodes: usize,
    /// Pairs of a point and an element whose visible part was computed.
    pub visible_parts: u64,
    /// Power balance.
    pub power: Power,
    /// Raw row sums, one per receiver.
    pub row_sums: Vec<RowSums>,
    layer: Layer,
}

impl RadiositySolution {
    /// Indirect irradiance per band at a point of a face: the layer interpolated.
    #[must_use]
    pub fn indirect_at(&self, receiver: usize, uv: DVec2) -> Option<Vec<f64>> {
        self.layer.indirect_at(receiver, uv)
    }
}

/// The finished layer of indirect light.
#[derive(Debug)]
struct Layer {
    fields: Vec<Field>,
    locators: Vec<Locator>,
    /// Indirect irradiance on the nodes of every field.
    indirect: Vec<Vec<f64>>,
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

/// The indirect layer starts with elements no longer than this fraction of their
/// receiver's diagonal.
const COARSEST: f64 = 0.36;

/// Direct light varies by no more than this over an element of the layer that is
/// not refined, relative to the peak and to what degree 2 can follow.
const DIRECT_TOLERANCE: f64 = 0.02;

/// Solves for interreflection.
///
/// * `direct` — the meshes of direct light, refined further where indirect light
///   asks for it.
/// * `receivers` — the same faces in the same order, cut along contacts only.
///
/// `progress` is told what is done, from 0 to 1.
pub fn solve_radiosity(
    evaluator: &Evaluator<'_>,
    mut direct: DirectMeshes,
    receivers: Vec<Receiver>,
    light: &dyn Light,
    options: &RadiosityOptions,
    should_stop: &(dyn Fn() -> bool + Sync),
    progress: &(dyn Fn(f64) + Sync),
) -> RadiositySolution {
    let scene = evaluator.scene();
    let coarse = DirectOptions {
        tolerance: Tolerance::Relative(DIRECT_TOLERANCE),
        degree: 2,
        most_elements: options.most_nodes / 3,
    };
    let mut layer = DirectMeshes::solve(receivers, light, &coarse, should_stop, &|_, _| {});
    for field in &mut layer.fields {
        field.coarsest(COARSEST);
    }
    layer.evaluate(light);

    let pairs = Pairs::new(evaluator, &layer.fields);
    let mut round = 0;
    let (system, solution, errors) = loop {
        let report = |done: f64| progress((round as f64 + done) / MOST_ROUNDS as f64);
        let system = System::assemble(&pairs, &layer.fields, &report);
        let solution = system.solve(scene, &layer.fields, options);
        let errors = system.errors(&pairs, &layer.fields, scene, &solution);
        round += 1;
        let allowed: Vec<f64> = solution.peak.iter().map(|p| p * options.tolerance).collect();
        let levels: Vec<Vec<u8>> = layer
            .fields
            .iter()
            .zip(&errors.per_field)
            .map(|(f, e)| f.levels_for(e, &allowed).into_iter().map(|l| l.min(2)).collect())
            .collect();
        let n_marked = levels.iter().flatten().filter(|&&l| l > 0).count();
        let too_large = system.n_nodes + 6 * n_marked > options.most_nodes;
        if n_marked == 0 || round == MOST_ROUNDS || too_large || should_stop() {
            break (system, solution, errors);
        }
        layer.refine(levels);
        layer.evaluate(light);
    };

    let power = system.power(scene, &layer.fields, &solution);
    let row_sums = system.row_sums(&layer.fields);
    let indirect: Vec<Vec<f64>> = layer
        .fields
        .iter()
        .enumerate()
        .map(|(r, field)| {
            let from = system.first_node[r] * field.n_bands;
            (0..field.nodes.len() * field.n_bands)
                .map(|i| solution.irradiance[from + i] - field.direct[i])
                .collect()
        })
        .collect();
    let locators = layer.fields.iter().map(|f| Locator::new(&f.mesh)).collect();
    let n_elements = layer.n_elements();
    let layer = Layer { fields: layer.fields, locators, indirect };

    let totals = carry_over(&mut direct, &layer, light, options.tolerance, &solution.peak);
    progress(1.0);
    RadiositySolution {
        meshes: direct.finish_with(Some(totals)),
        iterations: solution.sweeps,
        residual: solution.residual,
        is_converged: solution.residual <= options.residual,
        measured_indirect_error: errors.worst,
        indirect_elements: n_elements,
        indirect_nodes: system.n_nodes,
        visible_parts: system.visible_parts + errors.visible_parts,
        power,
        row_sums,
        layer,
    }
}

/// Irradiance with interreflection on the meshes of direct light, refined where
/// their elements cannot follow the indirect layer.
fn carry_over(
    direct: &mut DirectMeshes,
    layer: &Layer,
    light: &dyn Light,
    tolerance: f64,
    peak: &[f64],
) -> Vec<Vec<f64>> {
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
                        let Some(wanted) = layer.indirect_at(r, field.point(t, at)) else { continue };
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
        if last || levels.iter().flatten().all(|&l| l == 0) {
            return indirect
                .into_iter()
                .zip(&direct.fields)
                .map(|(i, f)| i.iter().zip(&f.direct).map(|(i, d)| i + d).collect())
                .collect();
        }
        direct.refine(levels);
        direct.evaluate(light);
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
struct SourceElement {
    corners: [DVec3; 3],
    /// λ₀ = 1 + g₀·(x − corner 0); λ₁ = g₁·(x − corner 0); λ₂ = g₂·(x − corner 0).
    gradients: [DVec3; 3],
    /// Global node ids.
    nodes: [u32; 6],
}

/// A face of the layer as a source.
struct SourceFace {
    normal: DVec3,
    plane: PlaneId,
    elements: Vec<SourceElement>,
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
    fn new(evaluator: &'e Evaluator<'s>, fields: &[Field]) -> Self {
        let scene = evaluator.scene();
        let faces: Vec<FaceId> = fields.iter().map(|f| f.face).collect();
        let outlines: Vec<Vec<DVec3>> =
            faces.iter().map(|&f| scene.positions(&scene.face(f).outline)).collect();
        let n = faces.len();
        let between = (0..n * n)
            .into_par_iter()
            .map(|k| {
                let (r, s) = (k / n, k % n);
                let (a, b) = (scene.face(faces[r]), scene.face(faces[s]));
                if r == s || a.plane == b.plane {
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
        Self { evaluator, faces, between }
    }

    /// Adds the weights of all nodes seen from a point to `row`; returns how many
    /// visible parts were computed.
    fn gather(
        &self,
        sources: &[SourceFace],
        receiver: usize,
        point: DVec3,
        approach: Option<&Approach>,
        scratch: &mut Scratch,
        row: &mut [f64],
    ) -> u64 {
        let scene = self.evaluator.scene();
        let face = scene.face(self.faces[receiver]);
        let mut n_parts = 0;
        for (s, source) in sources.iter().enumerate() {
            let Some(list) = &self.between[receiver * sources.len() + s] else { continue };
            let list = (list.len() <= LONGEST_LIST).then_some(list.as_slice());
            for element in &source.elements {
                let polygon =
                    Source { corners: &element.corners, normal: source.normal, plane: source.plane };
                n_parts += 1;
                self.evaluator.visible_parts(
                    (face.normal, Some(face.plane)),
                    &polygon,
                    list,
                    point,
                    approach,
                    scratch,
                    |fragment, factor| {
                        let seen = Seen { element, point, normal: face.normal, source: source.normal };
                        if factor > 0.0 {
                            seen.add_fragment(fragment, factor, row);
                        }
                    },
                );
            }
        }
        n_parts
    }
}

/// A visible part of an element from a point.
struct Seen<'a> {
    element: &'a SourceElement,
    point: DVec3,
    normal: DVec3,
    source: DVec3,
}

/// A part this small, relative to its distance, is integrated by one rule.
const NEAR: f64 = 0.6;

/// Parts at the point itself are not cut any further than this.
const DEEPEST: u32 = 6;

impl Seen<'_> {
    fn add_fragment(&self, fragment: &[DVec3], factor: f64, row: &mut [f64]) {
        if fragment.len() == 3 {
            self.add_triangle([fragment[0], fragment[1], fragment[2]], factor, 0, row);
            return;
        }
        // A fan around the corner nearest to the point: where the element touches
        // the point, other fans have triangles that span half of the sky.
        let n = fragment.len();
        let apex = (0..n)
            .min_by(|&i, &j| fragment[i].length_squared().total_cmp(&fragment[j].length_squared()))
            .unwrap_or(0);
        for k in 1..n - 1 {
            let triangle = [fragment[apex], fragment[(apex + k) % n], fragment[(apex + k + 1) % n]];
            let factor = contour_sum(&triangle, self.normal);
            self.add_triangle(triangle, factor, 0, row);
        }
    }

    /// Distributes the factor of a triangle (corners relative to the point) over
    /// the element's nodes.
    fn add_triangle(&self, [a, b, c]: [DVec3; 3], factor: f64, depth: u32, row: &mut [f64]) {
        if factor <= 0.0 {
            return;
        }
        let size_sq =
            (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let middle = (a + b + c) / 3.0;
        if size_sq > NEAR * NEAR * middle.length_squared() && depth < DEEPEST {
            let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
            for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                let factor = contour_sum(&part, self.normal);
                self.add_triangle(part, factor, depth + 1, row);
            }
            return;
        }
        // φ weighted by the kernel; the sum of the weights is set to the factor.
        let mut sum = 0.0;
        let mut weights = [0.0; 6];
        for (at, w) in RULE {
            let y = a * at[0] + b * at[1] + c * at[2];
            let r_sq = y.length_squared();
            let k = w * self.normal.dot(y) * -self.source.dot(y) / (r_sq * r_sq);
            if k > 0.0 {
                sum += k;
                let phi = values(2, self.barycentric(y));
                for (weight, phi) in weights.iter_mut().zip(phi) {
                    *weight += k * phi;
                }
            }
        }
        let scale = if sum > 0.0 {
            factor / sum
        } else {
            let phi = values(2, self.barycentric(middle));
            weights.copy_from_slice(&phi[..6]);
            factor
        };
        for (&node, weight) in self.element.nodes.iter().zip(weights) {
            row[node as usize] += weight * scale;
        }
    }

    fn barycentric(&self, y: DVec3) -> [f64; 3] {
        let x = y + (self.point - self.element.corners[0]);
        let g = &self.element.gradients;
        [1.0 + g[0].dot(x), g[1].dot(x), g[2].dot(x)]
    }
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
struct System {
    n_nodes: usize,
    /// Where the nodes of every field start.
    first_node: Vec<usize>,
    sources: Vec<SourceFace>,
    /// Rows of weights, dense; rows of nodes no element uses are empty.
    rows: Vec<Vec<f64>>,
    visible_parts: u64,
}

/// The solution at the nodes.
struct Solution {
    /// `n_bands` values per node.
    irradiance: Vec<f64>,
    /// Largest irradiance per band.
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
    fn assemble(pairs: &Pairs<'_, '_>, fields: &[Field], progress: &(dyn Fn(f64) + Sync)) -> Self {
        let scene = pairs.evaluator.scene();
        let mut first_node = Vec::with_capacity(fields.len());
        let mut n_nodes = 0;
        for field in fields {
            first_node.push(n_nodes);
            n_nodes += field.nodes.len();
        }
        let sources: Vec<SourceFace> = fields
            .iter()
            .zip(&first_node)
            .map(|(field, &first)| source_face(scene, field, first))
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
        let rows: Vec<(Vec<f64>, u64)> = owners
            .par_iter()
            .enumerate()
            .map_init(Scratch::default, |scratch, (node, &(r, i))| {
                if !is_used[node] {
                    return (Vec::new(), 0);
                }
                let field = &fields[r];
                let mut row = vec![0.0; n_nodes];
                let approach = field.toward[i]
                    .map(|toward| Approach { toward, radius: field.contact_radius() });
                let point = field.chart.to_space(field.nodes[i]);
                let n =
                    pairs.gather(&sources, r, point, approach.as_ref(), scratch, &mut row);
                let done = n_done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if done % 64 == 0 {
                    progress(done as f64 / n_nodes as f64);
                }
                (row, n)
            })
            .collect();
        let visible_parts = rows.iter().map(|(_, n)| n).sum();
        let rows = rows.into_iter().map(|(row, _)| row).collect();
        Self { n_nodes, first_node, sources, rows, visible_parts }
    }

    /// Gauss–Seidel sweeps until nothing changes by more than the residual.
    fn solve(&self, scene: &Scene, fields: &[Field], options: &RadiosityOptions) -> Solution {
        let n_bands = scene.n_bands;
        let direct: Vec<f64> = fields.iter().flat_map(|f| f.direct.iter().copied()).collect();
        let reflectance: Vec<&[f64]> = fields
            .iter()
            .flat_map(|f| {
                std::iter::repeat_n(scene.material(f.face).reflectance.as_slice(), f.nodes.len())
            })
            .collect();
        let mut irradiance = direct.clone();
        // Reflected radiosity, band after band: ρE of every node.
        let mut reflected: Vec<f64> = Vec::with_capacity(self.n_nodes * n_bands);
        for node in 0..self.n_nodes {
            for band in 0..n_bands {
                reflected.push(reflectance[node][band] * direct[node * n_bands + band]);
            }
        }
        let (mut sweeps, mut residual) = (0, 0.0f64);
        while sweeps < options.most_sweeps {
            sweeps += 1;
            let mut change = 0.0f64;
            let mut peak = 0.0f64;
            let mut sums = vec![0.0; n_bands];
            for (node, row) in self.rows.iter().enumerate() {
                if row.is_empty() {
                    continue;
                }
                sums.fill(0.0);
                for (j, &w) in row.iter().enumerate() {
                    if w != 0.0 {
                        for (sum, b) in sums.iter_mut().zip(&reflected[j * n_bands..]) {
                            *sum += w * b;
                        }
                    }
                }
                for band in 0..n_bands {
                    let at = node * n_bands + band;
                    let new = direct[at] + sums[band];
                    change = change.max((new - irradiance[at]).abs());
                    peak = peak.max(new.abs());
                    irradiance[at] = new;
                    reflected[at] = reflectance[node][band] * new;
                }
            }
            residual = if peak > 0.0 { change / peak } else { 0.0 };
            if residual <= options.residual {
                break;
            }
        }
        let mut peak = vec![0.0f64; n_bands];
        for (node, row) in self.rows.iter().enumerate() {
            if !row.is_empty() {
                for band in 0..n_bands {
                    peak[band] = peak[band].max(irradiance[node * n_bands + band]);
                }
            }
        }
        Solution { irradiance, peak, sweeps, residual }
    }

    /// Indirect irradiance gathered exactly at one point of every element against
    /// the interpolated one.
    fn errors(
        &self,
        pairs: &Pairs<'_, '_>,
        fields: &[Field],
        scene: &Scene,
        solution: &Solution,
    ) -> Errors {
        let n_bands = scene.n_bands;
        let per_field: Vec<(Vec<f64>, u64)> = fields
            .iter()
            .enumerate()
            .map(|(r, field)| {
                let first = self.first_node[r] * n_bands;
                let own = &solution.irradiance[first..first + field.nodes.len() * n_bands];
                let indirect: Vec<f64> =
                    own.iter().zip(&field.direct).map(|(e, d)| e - d).collect();
                let found: Vec<(Vec<f64>, u64)> = (0..field.mesh.triangles.len())
                    .into_par_iter()
                    .map_init(
                        || (Scratch::default(), vec![0.0; self.n_nodes]),
                        |(scratch, row), t| {
                            row.fill(0.0);
                            let at = CHECK_POINTS[0];
                            let point = field.chart.to_space(field.point(t, at));
                            let n = pairs.gather(&self.sources, r, point, None, scratch, row);
                            let errors = (0..n_bands)
                                .map(|band| {
                                    let exact = self.reflected_sum(fields, scene, solution, row, band);
                                    (field.value(&indirect, t, at, band) - exact).abs()
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
        Errors { per_field, worst, visible_parts }
    }

    fn reflected_sum(
        &self,
        fields: &[Field],
        scene: &Scene,
        solution: &Solution,
        row: &[f64],
        band: usize,
    ) -> f64 {
        let n_bands = scene.n_bands;
        let mut sum = 0.0;
        for (r, field) in fields.iter().enumerate() {
            let rho = scene.material(field.face).reflectance[band];
            if rho == 0.0 {
                continue;
            }
            let first = self.first_node[r];
            let part: f64 = (first..first + field.nodes.len())
                .map(|j| row[j] * solution.irradiance[j * n_bands + band])
                .sum();
            sum += rho * part;
        }
        sum
    }

    /// The power balance, integrated over the layer.
    fn power(&self, scene: &Scene, fields: &[Field], solution: &Solution) -> Power {
        let n_bands = scene.n_bands;
        let mut power = Power {
            emitted: vec![0.0; n_bands],
            absorbed: vec![0.0; n_bands],
            escaped: vec![0.0; n_bands],
            imbalance: 0.0,
        };
        let row_sum: Vec<f64> = self.rows.iter().map(|row| row.iter().sum()).collect();
        let rule = quadrature();
        for (r, field) in fields.iter().enumerate() {
            let material = scene.material(field.face);
            let first = self.first_node[r];
            for t in 0..field.mesh.triangles.len() {
                let area = scene.frame.area_to_file(field.mesh.area(t as u32));
                for (at, w) in rule {
                    let phi = values(2, at);
                    let nodes = &field.element_nodes[t][..6];
                    let seen: f64 =
                        nodes.iter().zip(phi).map(|(&i, p)| p * row_sum[first + i as usize]).sum();
                    for band in 0..n_bands {
                        let e: f64 = nodes
                            .iter()
                            .zip(phi)
                            .map(|(&i, p)| {
                                p * solution.irradiance[(first + i as usize) * n_bands + band]
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
        power
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
                RowSums { face: field.face, min, max, mean: mean / area }
            })
            .collect()
    }
}

fn source_face(scene: &Scene, field: &Field, first: usize) -> SourceFace {
    let face = scene.face(field.face);
    let elements = (0..field.mesh.triangles.len())
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
            }
        })
        .collect();
    SourceFace { normal: face.normal, plane: face.plane, elements }
}
