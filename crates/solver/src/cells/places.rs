//! Places of a receiver and their exact values, each evaluated once.

use crate::field::Sample;
use antumbra_geom::Chart;
use glam::DVec2;
use std::collections::HashMap;

/// Positions nearer than this fraction of the receiver are one place: the same one
/// computed from an edge and from its half.
const SAME_PLACE: f64 = 1.0 / (1u64 << 40) as f64;

/// Places that were asked for, with values as far as they are known.
#[derive(Clone, Debug)]
pub(super) struct Places {
    quantum: f64,
    /// For lookup only.
    ids: HashMap<[i64; 2], u32>,
    uv: Vec<DVec2>,
    /// The direction in the chart from which the value is the limit, at the border.
    toward: Vec<Option<DVec2>>,
    /// `n_bands` a place.
    values: Vec<f64>,
    is_known: Vec<bool>,
    was_node: Vec<bool>,
    n_bands: usize,
}

impl Places {
    pub(super) fn new(size: f64, n_bands: usize) -> Self {
        Self {
            quantum: SAME_PLACE * size,
            ids: HashMap::new(),
            uv: Vec::new(),
            toward: Vec::new(),
            values: Vec::new(),
            is_known: Vec::new(),
            was_node: Vec::new(),
            n_bands,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.uv.len()
    }

    /// The place at a position; a new one if there is none yet.
    pub(super) fn at(&mut self, uv: DVec2, toward: Option<DVec2>) -> u32 {
        let scaled = uv / self.quantum;
        let key = |d: DVec2| {
            let p = (scaled + d).round();
            [p.x as i64, p.y as i64]
        };
        // A position beside the limit of two cells of the lattice, computed in another
        // way, may be in the other cell.
        let near = [-0.125, 0.125];
        for dx in near {
            for dy in near {
                if let Some(&id) = self.ids.get(&key(DVec2::new(dx, dy))) {
                    return id;
                }
            }
        }
        let id = self.uv.len() as u32;
        self.ids.insert(key(DVec2::ZERO), id);
        self.uv.push(uv);
        self.toward.push(toward);
        self.values.extend(std::iter::repeat_n(0.0, self.n_bands));
        self.is_known.push(false);
        self.was_node.push(false);
        id
    }

    pub(super) fn position(&self, place: u32) -> DVec2 {
        self.uv[place as usize]
    }

    pub(super) fn toward(&self, place: u32) -> Option<DVec2> {
        self.toward[place as usize]
    }

    /// A place as it is asked for.
    pub(super) fn sample(&self, place: u32, chart: &Chart) -> Sample {
        Sample {
            point: chart.to_space(self.uv[place as usize]),
            toward: self.toward[place as usize]
                .map(|toward| chart.direction(toward).normalize_or_zero()),
        }
    }

    /// The exact values at a place that was evaluated.
    pub(super) fn values(&self, place: u32) -> &[f64] {
        let at = place as usize * self.n_bands;
        &self.values[at..at + self.n_bands]
    }

    /// Those of `wanted` that have no value yet, each once.
    pub(super) fn missing(&self, wanted: &[u32]) -> Vec<u32> {
        let mut missing: Vec<u32> = wanted
            .iter()
            .copied()
            .filter(|&p| !self.is_known[p as usize])
            .collect();
        missing.sort_unstable();
        missing.dedup();
        missing
    }

    /// The samples at some places.
    pub(super) fn samples(&self, places: &[u32], chart: &Chart) -> Vec<Sample> {
        places.iter().map(|&p| self.sample(p, chart)).collect()
    }

    /// Gives exact values to places without one.
    pub(super) fn tell(&mut self, missing: &[u32], found: &[f64]) {
        for (&p, values) in missing.iter().zip(found.chunks_exact(self.n_bands.max(1))) {
            let at = p as usize * self.n_bands;
            self.values[at..at + self.n_bands].copy_from_slice(values);
            self.is_known[p as usize] = true;
        }
    }

    /// Remembers which places are or were nodes.
    pub(super) fn count_as_nodes(&mut self, places: &[u32]) {
        for &p in places {
            self.was_node[p as usize] = true;
        }
    }

    /// Exact evaluations of places that are or were nodes, and of all others.
    pub(super) fn n_evaluations(&self) -> [u64; 2] {
        let known = self.is_known.iter().zip(&self.was_node).filter(|p| *p.0);
        let (nodes, others): (Vec<bool>, Vec<bool>) = known.map(|p| *p.1).partition(|&n| n);
        [nodes.len() as u64, others.len() as u64]
    }
}
