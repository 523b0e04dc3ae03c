//! The equation: what every node of a receiving element gathers, as a sparse row.

use super::basis::{N, NODES};
use super::deal::Portion;
use super::forest::Forest;
use super::gather::{GatherScratch, Gathering};
use antumbra_geom::Stop;
use antumbra_scene::Scene;
use antumbra_visibility::Place;
use rayon::prelude::*;

/// One element in a row, with its weights in single precision: they are good to 1e-7 of a
/// form factor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    element: u32,
    weights: [f32; N],
}

/// What one node gathers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    links: Vec<Link>,
    /// Form factor of all fronts.
    pub(crate) seen: f64,
}

/// The rows of an element's nodes.
pub(crate) type Rows = [Row; N];

/// The rows that are known, by element.
#[derive(Debug, Default)]
pub(crate) struct Table {
    rows: Vec<Option<Box<Rows>>>,
}

/// What came of making rows.
#[derive(Debug, Default)]
pub(crate) struct Made {
    /// Elements that were too coarse for a point, ascending.
    pub(crate) too_coarse: Vec<u32>,
    /// Rows that were made.
    pub(crate) n_rows: u64,
}

/// Rows are made again when their links err by more than this many times what they may.
const STALE: f64 = 4.0;

impl Table {
    /// Makes the rows that elements lack, and those whose links have become too coarse;
    /// nothing if it was stopped.
    pub(crate) fn complete(
        &mut self,
        gathering: &Gathering<'_, '_>,
        receiving: &[u32],
        stop: Stop<'_>,
    ) -> Option<Made> {
        let forest = gathering.forest;
        self.rows.resize_with(forest.elements.len(), || None);
        let link = gathering.demands.link;
        let todo: Vec<u32> = receiving
            .iter()
            .copied()
            .filter(|&e| match &self.rows[e as usize] {
                None => true,
                Some(rows) => rows.iter().any(|row| row.is_stale(forest, link)),
            })
            .collect();
        let made: Vec<Option<(Box<Rows>, Vec<u32>)>> = todo
            .par_iter()
            .map_init(GatherScratch::default, |scratch, &e| {
                if stop.is_wanted() {
                    return None;
                }
                scratch.too_coarse.clear();
                let rows = NODES.map(|(at, _)| {
                    let place = place_of(gathering.evaluator.scene(), forest, e, at);
                    let told = gathering.at(&place, scratch);
                    Row::new(&mut scratch.portions, told.seen)
                });
                Some((Box::new(rows), scratch.too_coarse.clone()))
            })
            .collect();
        let mut result = Made {
            n_rows: (N * todo.len()) as u64,
            ..Made::default()
        };
        for (e, made) in todo.into_iter().zip(made) {
            let (rows, too_coarse) = made?;
            self.rows[e as usize] = Some(rows);
            result.too_coarse.extend(too_coarse);
        }
        result.too_coarse.sort_unstable();
        result.too_coarse.dedup();
        Some(result)
    }

    /// Forgets the rows of elements that do not receive any more.
    pub(crate) fn forget(&mut self, forest: &Forest) {
        for (rows, element) in self.rows.iter_mut().zip(&forest.elements) {
            if !element.is_receiving {
                *rows = None;
            }
        }
    }

    /// Indirect irradiance of the nodes of receiving elements, from what is reflected now.
    pub(crate) fn gathered(&self, forest: &Forest, receiving: &[u32]) -> Vec<Vec<f64>> {
        receiving
            .par_iter()
            .map(|&e| {
                let mut values = vec![0.0; N * forest.n_bands];
                if let Some(rows) = &self.rows[e as usize] {
                    for (row, sums) in rows.iter().zip(values.chunks_exact_mut(forest.n_bands)) {
                        row.gather(forest, sums);
                    }
                }
                values
            })
            .collect()
    }

    /// The rows of an element.
    pub(crate) fn of(&self, element: u32) -> Option<&Rows> {
        self.rows[element as usize].as_deref()
    }

    /// Links of all rows.
    pub(crate) fn n_links(&self) -> usize {
        let rows = self.rows.iter().flatten().flat_map(|rows| rows.iter());
        rows.map(|row| row.links.len()).sum()
    }
}

impl Row {
    /// Portions of the same element become one link; in the order of the elements.
    fn new(portions: &mut [Portion], seen: f64) -> Self {
        portions.sort_by_key(|portion| portion.element);
        let mut links: Vec<Link> = Vec::new();
        for of_one in portions.chunk_by(|a, b| a.element == b.element) {
            let mut weights = [0.0; N];
            for portion in of_one {
                for (sum, weight) in weights.iter_mut().zip(portion.weights) {
                    *sum += weight;
                }
            }
            links.push(Link {
                element: of_one[0].element,
                weights: weights.map(|w| w as f32),
            });
        }
        links.shrink_to_fit();
        Self { links, seen }
    }

    fn gather(&self, forest: &Forest, sums: &mut [f64]) {
        for link in &self.links {
            let values = forest.coefficients(&forest.reflected, link.element);
            for (weight, values) in link.weights.iter().zip(values.chunks_exact(sums.len())) {
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += f64::from(*weight) * value;
                }
            }
        }
    }

    fn is_stale(&self, forest: &Forest, link: f64) -> bool {
        self.links.iter().any(|l| {
            let element = &forest.elements[l.element as usize];
            let factor: f32 = l.weights.iter().map(|w| w.abs()).sum();
            element.is_divided()
                && f64::from(factor) * forest.missed[l.element as usize] > STALE * link
        })
    }
}

/// A place of an element, in barycentric coordinates.
pub(crate) fn place_of(scene: &Scene, forest: &Forest, element: u32, at: [f64; 3]) -> Place {
    let of = &forest.elements[element as usize];
    let face = scene.face(forest.sides[of.side as usize].face);
    Place {
        point: of.point(at),
        normal: face.normal,
        plane: Some(face.plane),
        approach: None,
    }
}
