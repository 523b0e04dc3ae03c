//! Where the power goes, and how much of everything the points see.

use super::basis::{N, NODES};
use super::forest::Forest;
use super::rows::Table;
use crate::radiosity::{Power, RowSums};
use antumbra_scene::Scene;

/// The power balance over the receiving elements.
pub(crate) fn power(scene: &Scene, forest: &Forest, table: &Table) -> Power {
    let n_bands = forest.n_bands;
    let mut power = Power {
        emitted: vec![0.0; n_bands],
        absorbed: vec![0.0; n_bands],
        escaped: vec![0.0; n_bands],
        imbalance: 0.0,
    };
    for e in forest.receiving() {
        let element = &forest.elements[e as usize];
        let side = &forest.sides[element.side as usize];
        let material = scene.material(side.face);
        let area = scene.frame.area_to_file(element.area);
        let direct = forest.coefficients(&forest.direct, e);
        let indirect = forest.coefficients(&forest.indirect, e);
        let Some(rows) = table.of(e) else { continue };
        for (i, (row, (_, weight))) in rows.iter().zip(NODES).enumerate() {
            for band in 0..n_bands {
                let at = i * n_bands + band;
                let irradiance = direct[at] + indirect[at];
                let (rho, exitance) = (material.reflectance[band], material.exitance[band]);
                power.emitted[band] += weight * area * exitance;
                power.absorbed[band] += weight * area * (1.0 - rho) * irradiance;
                let leaves = exitance + rho * irradiance;
                power.escaped[band] += weight * area * leaves * (1.0 - row.seen);
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

/// Row sums of every side, in their order.
pub(crate) fn row_sums(forest: &Forest, table: &Table) -> Vec<RowSums> {
    let mut sums: Vec<RowSums> = forest
        .sides
        .iter()
        .map(|side| RowSums {
            face: side.face,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            mean: 0.0,
        })
        .collect();
    let mut areas = vec![0.0; sums.len()];
    for e in forest.receiving() {
        let element = &forest.elements[e as usize];
        let (Some(rows), side) = (table.of(e), element.side as usize) else {
            continue;
        };
        areas[side] += element.area;
        let sum = &mut sums[side];
        for i in 0..N {
            sum.min = sum.min.min(rows[i].seen);
            sum.max = sum.max.max(rows[i].seen);
            sum.mean += element.area * NODES[i].1 * rows[i].seen;
        }
    }
    for (sum, area) in sums.iter_mut().zip(areas) {
        sum.mean /= area;
    }
    sums
}
