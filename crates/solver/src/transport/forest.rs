//! Elements in trees: a far receiver uses the large ones, a near one those below.

use super::basis::{N, NODES, in_parent, phi, tables};
use crate::basis::quadrature;
use crate::direct::Sampler;
use crate::field::Receiver;
use antumbra_geom::{Chart, DVec2, DVec3};
use antumbra_mesh::Order;
use antumbra_scene::{Aabb, BoxTree, FaceId, Scene};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// No element.
pub(crate) const NONE: u32 = u32::MAX;

/// A triangle of a face.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    /// The position of its face in [`Forest::sides`].
    pub(crate) side: u32,
    /// Its corners by number: neighbours share theirs.
    pub(crate) vertices: [u32; 3],
    /// Corners in the chart, counter-clockwise.
    pub(crate) uv: [DVec2; 3],
    /// The same in space.
    pub(crate) corners: [DVec3; 3],
    /// λ₀ = 1 + g₀·(x − corner 0); λ₁ = g₁·(x − corner 0); λ₂ = g₂·(x − corner 0).
    pub(crate) gradients: [DVec3; 3],
    /// Square scene units.
    pub(crate) area: f64,
    /// Longest edge.
    pub(crate) longest: f64,
    /// The first of its four quarters; [`NONE`] if it is whole.
    pub(crate) quarters: u32,
    /// Does it have rows of its own? Those below follow from it, those above from it.
    pub(crate) is_receiving: bool,
}

impl Element {
    /// A point in barycentric coordinates.
    pub(crate) fn point(&self, at: [f64; 3]) -> DVec3 {
        self.corners[0] * at[0] + self.corners[1] * at[1] + self.corners[2] * at[2]
    }

    /// Barycentric coordinates of a point of its plane.
    pub(crate) fn barycentric(&self, point: DVec3) -> [f64; 3] {
        let x = point - self.corners[0];
        let g = &self.gradients;
        [1.0 + g[0].dot(x), g[1].dot(x), g[2].dot(x)]
    }

    /// Is it divided?
    pub(crate) fn is_divided(&self) -> bool {
        self.quarters != NONE
    }
}

/// A face with its elements.
#[derive(Debug)]
pub(crate) struct Side {
    pub(crate) face: FaceId,
    pub(crate) chart: Chart,
    pub(crate) normal: DVec3,
    pub(crate) reflectance: Vec<f64>,
    /// Is nothing reflected in any band?
    pub(crate) is_black: bool,
    /// The undivided triangles it begins with.
    pub(crate) roots: std::ops::Range<u32>,
    tree: BoxTree,
}

/// All elements, and their values: `N` coefficients of `n_bands` bands each.
#[derive(Debug)]
pub(crate) struct Forest {
    pub(crate) sides: Vec<Side>,
    pub(crate) elements: Vec<Element>,
    /// Corners of all elements, and middles of edges.
    pub(crate) n_vertices: u32,
    /// The middle of an edge, by its ends.
    pub(crate) middles: HashMap<[u32; 2], u32>,
    /// Edges on contacts, across which light jumps.
    cut_edges: HashSet<[u32; 2]>,
    cut_vertices: HashSet<u32>,
    pub(crate) n_bands: usize,
    /// One over the largest irradiance of each band; 0 where there is none.
    pub(crate) scale: Vec<f64>,
    /// Direct irradiance, projected.
    pub(crate) direct: Vec<f64>,
    /// Indirect irradiance.
    pub(crate) indirect: Vec<f64>,
    /// What is reflected of both.
    pub(crate) reflected: Vec<f64>,
    /// The largest of it, relative to the peak.
    pub(crate) largest: Vec<f64>,
    /// What the element's polynomial misses of what those below it hold, and of direct
    /// light, relative to the peak.
    pub(crate) missed: Vec<f64>,
    /// The part of it that is direct light's.
    missed_direct: Vec<f64>,
    /// What is reflected of the measured error of indirect light, relative to the peak.
    doubt: Vec<f64>,
}

/// Direct light as an element holds it, and what that misses, relative to the peak.
type Projected = (Vec<f64>, f64);

/// Triangles smaller than this share of their face hold nothing.
const LEAST_AREA: f64 = 1e-14;

impl Forest {
    /// Begins with the triangles of the receivers' meshes.
    ///
    /// * `direct` — meshes of direct light on the same faces in the same order.
    pub(crate) fn new(scene: &Scene, receivers: &[Receiver], direct: &Sampler<'_>) -> Self {
        let peak = direct.peak().iter();
        let mut forest = Self {
            sides: Vec::with_capacity(receivers.len()),
            elements: Vec::new(),
            n_vertices: 0,
            middles: HashMap::new(),
            cut_edges: HashSet::new(),
            cut_vertices: HashSet::new(),
            n_bands: scene.n_bands,
            scale: peak.map(|&p| if p > 0.0 { 1.0 / p } else { 0.0 }).collect(),
            direct: Vec::new(),
            indirect: Vec::new(),
            reflected: Vec::new(),
            largest: Vec::new(),
            missed: Vec::new(),
            missed_direct: Vec::new(),
            doubt: Vec::new(),
        };
        for (s, receiver) in receivers.iter().enumerate() {
            let face = scene.face(receiver.face);
            let reflectance = scene.material(receiver.face).reflectance.clone();
            let first = forest.elements.len() as u32;
            forest.sides.push(Side {
                face: receiver.face,
                chart: receiver.chart,
                normal: face.normal,
                is_black: reflectance.iter().all(|&r| r == 0.0),
                reflectance,
                roots: first..first,
                tree: BoxTree::default(),
            });
            for triangle in &receiver.mesh.triangles {
                let uv = triangle.map(|v| receiver.mesh.vertices[v as usize]);
                let vertices = triangle.map(|v| forest.n_vertices + v);
                let element = forest.element(s as u32, vertices, uv);
                if element.area > LEAST_AREA * face.area {
                    forest.elements.push(Element {
                        is_receiving: true,
                        ..element
                    });
                }
            }
            forest.note_contacts(receiver);
            forest.n_vertices += receiver.mesh.vertices.len() as u32;
            let roots = first..forest.elements.len() as u32;
            let boxes: Vec<(u32, Aabb)> = roots
                .clone()
                .map(|e| (e, Aabb::of(forest.elements[e as usize].corners)))
                .collect();
            forest.sides[s].tree = BoxTree::new(&boxes);
            forest.sides[s].roots = roots;
        }
        let of_direct: Vec<Projected> = forest
            .elements
            .par_iter()
            .map(|element| forest.project(element, direct))
            .collect();
        forest.take_in(of_direct);
        forest
    }

    /// Notes where contacts lie on a receiver whose vertices are the next ones.
    fn note_contacts(&mut self, receiver: &Receiver) {
        for triangle in &receiver.mesh.triangles {
            for k in 0..3 {
                let ends = [triangle[k], triangle[(k + 1) % 3]];
                let set = receiver.mesh.edge_curves(ends[0], ends[1]);
                let curves = set.map_or(&[][..], |set| receiver.mesh.sets().get(set));
                if curves
                    .iter()
                    .any(|&c| receiver.orders[c as usize] == Order::D0)
                {
                    let [a, b] = ends.map(|v| self.n_vertices + v);
                    self.cut_edges.insert(edge(a, b));
                    self.cut_vertices.extend([a, b]);
                }
            }
        }
    }

    /// The middle of an edge.
    pub(crate) fn middle_of(&mut self, a: u32, b: u32) -> u32 {
        let ends = edge(a, b);
        if let Some(&middle) = self.middles.get(&ends) {
            return middle;
        }
        let middle = self.n_vertices;
        self.n_vertices += 1;
        self.middles.insert(ends, middle);
        if self.cut_edges.contains(&ends) {
            self.cut_edges.insert(edge(a, middle));
            self.cut_edges.insert(edge(middle, b));
            self.cut_vertices.insert(middle);
        }
        middle
    }

    /// Does a contact run through a vertex?
    pub(crate) fn is_cut(&self, vertex: u32) -> bool {
        self.cut_vertices.contains(&vertex)
    }

    fn element(&self, side: u32, vertices: [u32; 3], uv: [DVec2; 3]) -> Element {
        let of = &self.sides[side as usize];
        let corners = uv.map(|p| of.chart.to_space(p));
        let [a, b, c] = corners;
        let twice_area = (b - a).cross(c - a).dot(of.normal);
        let gradient = |edge: DVec3| of.normal.cross(edge) / twice_area;
        Element {
            side,
            vertices,
            uv,
            corners,
            gradients: [gradient(c - b), gradient(a - c), gradient(b - a)],
            area: twice_area.abs() / 2.0,
            longest: (b - a).length().max((c - b).length()).max((a - c).length()),
            quarters: NONE,
            is_receiving: false,
        }
    }

    /// Direct light projected onto an element, and what that misses, relative to the peak:
    /// what differs is orthogonal to the basis, so that every element keeps its power.
    fn project(&self, element: &Element, direct: &Sampler<'_>) -> Projected {
        let n_bands = self.n_bands;
        let side = &self.sides[element.side as usize];
        let mut coefficients = vec![0.0; N * n_bands];
        let receiver = element.side as usize;
        if side.is_black || direct.is_dark(receiver) {
            return (coefficients, 0.0);
        }
        // The rule on each of the four quarters: shadows' edges run through.
        let mut samples = Vec::with_capacity(64);
        for quarter in 0..4 {
            for (at, weight) in quadrature() {
                let at = in_parent(quarter, at);
                let uv = element.uv[0] * at[0] + element.uv[1] * at[1] + element.uv[2] * at[2];
                let values = direct.at(receiver, uv);
                let phi = phi(at);
                for (i, (_, of_node)) in NODES.into_iter().enumerate() {
                    for (band, value) in values.iter().enumerate() {
                        coefficients[i * n_bands + band] +=
                            0.25 * weight * phi[i] * value / of_node;
                    }
                }
                samples.push((phi, values));
            }
        }
        let mut missed = 0.0f64;
        for (phi, values) in &samples {
            for (band, value) in values.iter().enumerate() {
                let found: f64 = (0..N)
                    .map(|i| phi[i] * coefficients[i * n_bands + band])
                    .sum();
                let weight = self.scale[band] * side.reflectance[band];
                missed = missed.max(weight * (found - value).abs());
            }
        }
        (coefficients, missed)
    }

    /// Values of the elements that were added last.
    fn take_in(&mut self, of_direct: Vec<Projected>) {
        for (coefficients, missed) in of_direct {
            self.direct.extend(coefficients);
            self.missed_direct.push(missed);
        }
        let n = self.elements.len();
        self.indirect.resize(n * N * self.n_bands, 0.0);
        self.reflected.resize(n * N * self.n_bands, 0.0);
        self.largest.resize(n, 0.0);
        self.missed.resize(n, 0.0);
        self.doubt.resize(n, 0.0);
    }

    /// Divides elements that are whole into four; those that are divided stay.
    pub(crate) fn divide(&mut self, which: &[u32], direct: &Sampler<'_>) {
        let whole = |&e: &u32| !self.elements[e as usize].is_divided();
        let which: Vec<u32> = which.iter().copied().filter(whole).collect();
        let corners: Vec<[[u32; 3]; 4]> = which
            .iter()
            .map(|&e| {
                let [a, b, c] = self.elements[e as usize].vertices;
                let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| self.middle_of(p, q));
                // As `in_parent` has them: the last is the middle one.
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
            })
            .collect();
        let made: Vec<[(Element, Projected); 4]> = which
            .par_iter()
            .zip(&corners)
            .map(|(&e, corners)| {
                let of = &self.elements[e as usize];
                [0, 1, 2, 3].map(|k| {
                    let uv = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|corner| {
                        let at = in_parent(k, corner);
                        of.uv[0] * at[0] + of.uv[1] * at[1] + of.uv[2] * at[2]
                    });
                    let quarter = self.element(of.side, corners[k], uv);
                    let of_direct = self.project(&quarter, direct);
                    (quarter, of_direct)
                })
            })
            .collect();
        for (e, quarters) in which.into_iter().zip(made) {
            self.elements[e as usize].quarters = self.elements.len() as u32;
            for (quarter, of_direct) in quarters {
                self.elements.push(quarter);
                self.take_in(vec![of_direct]);
            }
        }
        self.gather_direct();
    }

    /// Direct light of divided elements is that of their quarters.
    fn gather_direct(&mut self) {
        let width = N * self.n_bands;
        for e in (0..self.elements.len()).rev() {
            if self.elements[e].is_divided() {
                let first = self.elements[e].quarters as usize;
                let (above, below) = self.direct.split_at_mut(first * width);
                go_up(&mut above[e * width..(e + 1) * width], below, self.n_bands);
            }
        }
    }

    /// Brings all values up to date with the indirect irradiance of receiving elements:
    /// those below them and above them follow, and everything is reflected.
    pub(crate) fn spread(&mut self) {
        let (width, n_bands) = (N * self.n_bands, self.n_bands);
        let mut follows = vec![false; self.elements.len()];
        for e in 0..self.elements.len() {
            let element = &self.elements[e];
            if !element.is_divided() || !(element.is_receiving || follows[e]) {
                continue;
            }
            let first = element.quarters as usize;
            follows[first..first + 4].fill(true);
            let (above, below) = self.indirect.split_at_mut(first * width);
            go_down(&above[e * width..(e + 1) * width], below, n_bands);
        }
        for e in (0..self.elements.len()).rev() {
            let element = &self.elements[e];
            if element.is_divided() && !element.is_receiving && !follows[e] {
                let first = element.quarters as usize;
                let (above, below) = self.indirect.split_at_mut(first * width);
                go_up(&mut above[e * width..(e + 1) * width], below, n_bands);
            }
        }
        for (e, element) in self.elements.iter().enumerate() {
            let reflectance = &self.sides[element.side as usize].reflectance;
            for at in e * width..(e + 1) * width {
                let band = at % n_bands;
                self.reflected[at] = reflectance[band] * (self.direct[at] + self.indirect[at]);
            }
        }
    }

    /// Takes in what was measured of the errors of indirect light in receiving elements,
    /// relative to the peak; those below them share it.
    pub(crate) fn doubt(&mut self, measured: impl Fn(u32) -> f64) {
        let mut inherited = vec![None; self.elements.len()];
        for e in 0..self.elements.len() {
            let element = &self.elements[e];
            let own = element.is_receiving.then(|| {
                let reflectance = self.sides[element.side as usize].reflectance.iter();
                reflectance.copied().fold(0.0, f64::max) * measured(e as u32)
            });
            let doubt = own.or(inherited[e]);
            if element.is_divided() {
                let first = element.quarters as usize;
                inherited[first..first + 4].fill(doubt);
            }
            self.doubt[e] = doubt.unwrap_or(0.0);
        }
    }

    /// Is it indirect light that an element may err by?
    pub(crate) fn errs_indirectly(&self, e: u32) -> bool {
        self.doubt[e as usize] > self.missed_direct[e as usize]
    }

    /// Measures how large the elements' values are, and what their polynomials miss.
    pub(crate) fn measure(&mut self) {
        let (width, n_bands) = (N * self.n_bands, self.n_bands);
        let scale = &self.scale;
        let relative = |at: usize, value: f64| scale[at % n_bands] * value.abs();
        let mut guess = vec![0.0; 4 * width];
        for e in (0..self.elements.len()).rev() {
            let own = &self.reflected[e * width..(e + 1) * width];
            let values = own.iter().enumerate().map(|(at, &v)| relative(at, v));
            self.largest[e] = values.fold(0.0, f64::max);
            self.missed[e] = self.missed_direct[e] + self.doubt[e];
            let element = &self.elements[e];
            if !element.is_divided() {
                continue;
            }
            let first = element.quarters as usize;
            go_down(own, &mut guess, n_bands);
            let mut missed = 0.0f64;
            for k in 0..4 {
                let quarter = first + k;
                let held = &self.reflected[quarter * width..(quarter + 1) * width];
                let apart = guess[k * width..(k + 1) * width].iter().zip(held);
                let apart = apart
                    .enumerate()
                    .map(|(at, (guess, held))| relative(at, guess - held))
                    .fold(0.0, f64::max);
                missed = missed.max(apart + self.missed[quarter]);
                self.largest[e] = self.largest[e].max(self.largest[quarter]);
            }
            self.missed[e] = missed;
        }
    }

    /// The roots of a side whose boxes meet a box.
    pub(crate) fn roots_in(&self, side: usize, bounds: &Aabb, mut found: impl FnMut(u32)) {
        self.sides[side].tree.visit(|b| b.meets(bounds), &mut found);
    }

    /// The root of a side at a point of its plane, or the nearest one that is not farther
    /// than rounding.
    pub(crate) fn root_at(&self, side: usize, point: DVec3) -> Option<u32> {
        let mut best: Option<(f64, u32)> = None;
        self.roots_in(side, &Aabb::of([point]), |root| {
            let at = self.elements[root as usize].barycentric(point);
            let outside = -at.into_iter().fold(f64::INFINITY, f64::min);
            let is_better = best.is_none_or(|(o, r)| (outside, root) < (o, r));
            if outside < BESIDE && is_better {
                best = Some((outside, root));
            }
        });
        best.map(|(_, root)| root)
    }

    /// The receiving element at a point of a side, and the place in it.
    pub(crate) fn find(&self, side: usize, point: DVec3) -> Option<(u32, [f64; 3])> {
        let mut e = self.root_at(side, point)?;
        while !self.elements[e as usize].is_receiving && self.elements[e as usize].is_divided() {
            let first = self.elements[e as usize].quarters;
            let inside = |e: u32| {
                let at = self.elements[e as usize].barycentric(point);
                at.into_iter().fold(f64::INFINITY, f64::min)
            };
            e = (first..first + 4)
                .max_by(|&a, &b| inside(a).total_cmp(&inside(b)))
                .unwrap_or(first);
        }
        Some((e, self.elements[e as usize].barycentric(point)))
    }

    /// The elements with rows of their own, ascending.
    pub(crate) fn receiving(&self) -> Vec<u32> {
        let all = (0..self.elements.len() as u32).zip(&self.elements);
        all.filter(|(_, e)| e.is_receiving)
            .map(|(e, _)| e)
            .collect()
    }

    /// Of an element: `N` coefficients of every band.
    pub(crate) fn coefficients<'a>(&self, values: &'a [f64], element: u32) -> &'a [f64] {
        let width = N * self.n_bands;
        &values[element as usize * width..(element as usize + 1) * width]
    }

    /// A field of the elements at a place of one, in one band.
    pub(crate) fn value(&self, values: &[f64], element: u32, at: [f64; 3], band: usize) -> f64 {
        let coefficients = self.coefficients(values, element);
        let phi = phi(at);
        (0..N)
            .map(|i| phi[i] * coefficients[i * self.n_bands + band])
            .sum()
    }

    /// The largest reflected irradiance, relative to the peak.
    pub(crate) fn brightest(&self) -> f64 {
        let roots = self.sides.iter().flat_map(|side| side.roots.clone());
        roots.map(|e| self.largest[e as usize]).fold(0.0, f64::max)
    }
}

/// Barycentric coordinates may be this far below 0 for a place of an element.
const BESIDE: f64 = 1e-6;

/// An edge by its ends, whichever way it is walked.
pub(crate) fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Values of the four quarters from those of their element.
fn go_down(element: &[f64], quarters: &mut [f64], n_bands: usize) {
    let width = N * n_bands;
    for (k, table) in tables().down.iter().enumerate() {
        for (j, row) in table.iter().enumerate() {
            for band in 0..n_bands {
                let values = (0..N).map(|i| row[i] * element[i * n_bands + band]);
                quarters[k * width + j * n_bands + band] = values.sum();
            }
        }
    }
}

/// Values of an element from those of its four quarters.
fn go_up(element: &mut [f64], quarters: &[f64], n_bands: usize) {
    let width = N * n_bands;
    element.fill(0.0);
    for (k, table) in tables().up.iter().enumerate() {
        for (i, row) in table.iter().enumerate() {
            for band in 0..n_bands {
                let values = (0..N).map(|j| row[j] * quarters[k * width + j * n_bands + band]);
                element[i * n_bands + band] += values.sum::<f64>();
            }
        }
    }
}

impl Forest {
    /// No elements.
    pub(crate) fn empty() -> Self {
        Self {
            sides: Vec::new(),
            elements: Vec::new(),
            n_vertices: 0,
            middles: HashMap::new(),
            cut_edges: HashSet::new(),
            cut_vertices: HashSet::new(),
            n_bands: 0,
            scale: Vec::new(),
            direct: Vec::new(),
            indirect: Vec::new(),
            reflected: Vec::new(),
            largest: Vec::new(),
            missed: Vec::new(),
            missed_direct: Vec::new(),
            doubt: Vec::new(),
        }
    }
}
