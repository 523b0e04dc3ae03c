//! The matrix of form factors: sums, reciprocity, repair.

use crate::factors::Row;
use antumbra_scene::Scene;

/// Form factors between the surfaces of a scene, as computed: nothing is normalised.
#[derive(Clone, Debug, PartialEq)]
pub struct FormFactors {
    /// Names of the surfaces, in the order of the file.
    pub names: Vec<String>,
    /// Their areas, square file units; that of both sides for two-sided surfaces, 0
    /// for surfaces that were dropped with a warning.
    pub areas: Vec<f64>,
    /// The factors, row by row: the factor from `i` to `j` is at `i * n + j`.
    pub values: Vec<f64>,
    /// Their estimated errors, in the same order.
    pub errors: Vec<f64>,
    /// How well independent computations of both directions agree.
    pub reciprocity: Reciprocity,
    /// Exact evaluations, of all pairs.
    pub evaluations: u64,
    /// Pairs of faces that were left out when the work was stopped.
    pub left_out: usize,
    /// In the order of the values: is a part of this factor missing, so that its value
    /// says nothing? It is 0 then, and its error 1. Empty if nothing was left out.
    pub missing: Vec<bool>,
}

/// How well `A_i F_ij` and `A_j F_ji` agree where both were computed by integrals of
/// their own, one over each surface.
///
/// In the matrix they agree to rounding: one of the two is used for both.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reciprocity {
    /// The largest `|A_i F_ij − A_j F_ji|` over the smaller of both areas: a
    /// difference of form factors.
    pub worst: f64,
    /// The surfaces, if any pair was computed twice.
    pub between: Option<[usize; 2]>,
    /// Pairs of faces computed from both sides.
    pub pairs_checked: usize,
    /// Pairs of faces that face each other.
    pub pairs: usize,
}

/// What a repair did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repair {
    /// The largest change of a factor.
    pub largest_change: f64,
    /// From which surface to which.
    pub between: [usize; 2],
    /// The largest difference of a row sum from 1 that is left.
    pub closure: f64,
    /// Scalings of the whole matrix.
    pub steps: usize,
}

/// The matrix of a scene that is not closed cannot be repaired.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "surface '{surface}': its row sums up to {row_sum}; only closed scenes can be repaired \
     (allowed: 1 ± {REPAIRABLE})"
)]
pub struct NotClosed {
    /// The surface whose row is farthest from 1.
    pub surface: String,
    /// The sum of its row.
    pub row_sum: f64,
}

/// Row sums farther from 1 than this are no matter of numerical errors.
pub(crate) const REPAIRABLE: f64 = 0.01;

/// Scalings end here; they shrink what is missing by half or more each.
const MOST_STEPS: usize = 200;

impl FormFactors {
    pub(super) fn assemble(scene: &Scene, areas: &[f64], rows: &[Row]) -> Self {
        let n = areas.len();
        let entries = || rows.iter().flat_map(|row| &row.entries);
        let mut values = vec![0.0; n * n];
        let mut errors = vec![0.0; n * n];
        let mut reciprocity = Reciprocity {
            pairs: entries().count(),
            ..Reciprocity::default()
        };
        for entry in entries() {
            let [s, t] = entry.faces.map(|face| scene.face(face).surface.index());
            for (i, j) in [(s, t), (t, s)] {
                values[i * n + j] += entry.exchange.value / areas[i];
                errors[i * n + j] += entry.exchange.error / areas[i];
            }
            if let Some(back) = entry.back {
                let difference = (entry.exchange.value - back.value).abs();
                reciprocity.add(difference / areas[s].min(areas[t]), [s, t]);
            }
        }
        let left_out = rows.iter().map(|row| row.left_out.len()).sum();
        let mut missing = vec![false; if left_out > 0 { n * n } else { 0 }];
        for row in rows {
            for other in &row.left_out {
                let [s, t] = [row.face, *other].map(|face| scene.face(face).surface.index());
                for k in [s * n + t, t * n + s] {
                    missing[k] = true;
                    (values[k], errors[k]) = (0.0, 1.0);
                }
            }
        }
        let mut matrix = Self {
            names: scene.surfaces.iter().map(|s| s.name.clone()).collect(),
            areas: areas.iter().map(|&a| scene.frame.area_to_file(a)).collect(),
            values,
            errors,
            reciprocity,
            evaluations: entries().map(|e| e.exchange.evaluations).sum(),
            left_out,
            missing,
        };
        if scene.report().closed {
            let mut is_integrated = vec![false; n * n];
            for entry in entries().filter(|e| e.exchange.evaluations > 0) {
                let [s, t] = entry.faces.map(|face| scene.face(face).surface.index());
                is_integrated[s * n + t] = true;
                is_integrated[t * n + s] = true;
            }
            matrix.hear_row_sums(&is_integrated);
        }
        matrix
    }

    /// In a closed scene a row whose sum is off from 1 by more than all its errors shows
    /// that one of them is too small. Which one it does not say: each factor of the row
    /// that was integrated, both ways, may be off by that as well.
    ///
    /// Rows that are farther off than any error are those of surfaces outside.
    fn hear_row_sums(&mut self, is_integrated: &[bool]) {
        let n = self.n();
        let mut raised: Vec<(usize, f64)> = Vec::new();
        for (i, sum) in self.row_sums().into_iter().enumerate() {
            let off = (sum - 1.0).abs();
            let claimed: f64 = self.errors[i * n..(i + 1) * n].iter().sum();
            if !self.is_complete(i) || off <= claimed || off > REPAIRABLE {
                continue;
            }
            let row = i * n..(i + 1) * n;
            for k in row.filter(|&k| is_integrated[k]) {
                let j = k - i * n;
                raised.push((k, off));
                raised.push((j * n + i, off * self.areas[i] / self.areas[j]));
            }
        }
        for (k, off) in raised {
            self.errors[k] += off;
        }
    }

    /// Is every factor from this surface known? None is missing unless the work was
    /// stopped.
    ///
    /// # Panics
    ///
    /// If there is no such surface.
    #[must_use]
    pub fn is_complete(&self, from: usize) -> bool {
        let n = self.n();
        assert!(from < n, "surface {from} of {n}");
        self.missing.is_empty() || !self.missing[from * n..(from + 1) * n].contains(&true)
    }

    /// How many surfaces there are.
    #[must_use]
    pub fn n(&self) -> usize {
        self.names.len()
    }

    /// The form factor from one surface to another: the fraction of what leaves the
    /// first that arrives at the second, 0 to 1 up to its error.
    ///
    /// # Panics
    ///
    /// If there is no such surface.
    #[must_use]
    pub fn factor(&self, from: usize, to: usize) -> f64 {
        self.row(from)[to]
    }

    /// The factors from one surface to all.
    ///
    /// # Panics
    ///
    /// If there is no such surface.
    #[must_use]
    pub fn row(&self, from: usize) -> &[f64] {
        &self.values[from * self.n()..(from + 1) * self.n()]
    }

    /// The sum of every row, as it is: 1 in a closed scene, up to errors, if it is
    /// [complete](Self::is_complete).
    #[must_use]
    pub fn row_sums(&self) -> Vec<f64> {
        (0..self.n()).map(|i| self.row(i).iter().sum()).collect()
    }

    /// The row sum farthest from 1: of which surface, and the sum. Surfaces that see
    /// nothing, such as the bottom of a box on the floor, are passed over, and rows of
    /// which factors are missing; `None` if all are such.
    #[must_use]
    pub fn closure(&self) -> Option<(usize, f64)> {
        let sums = self.row_sums().into_iter().enumerate();
        sums.filter(|&(i, sum)| sum > 0.0 && self.is_complete(i))
            .max_by(|a, b| (a.1 - 1.0).abs().total_cmp(&(b.1 - 1.0).abs()))
    }

    /// The largest estimated error of a factor.
    #[must_use]
    pub fn max_error(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }

    /// Scales the factors of a closed scene so that every row sums up to 1, and tells
    /// what that changed.
    ///
    /// `A_i F_ij` is multiplied by `r_i r_j`: reciprocity is kept, zeros stay zeros,
    /// and nothing turns negative. The factors `r` come from iterative proportional
    /// fitting of the symmetric matrix. The estimated errors stay what they were.
    ///
    /// # Errors
    ///
    /// [`NotClosed`] if a row is farther from 1 than 0.01, or factors of it are missing;
    /// nothing is changed then.
    ///
    /// # Source
    ///
    /// Sinkhorn & Knopp 1967, symmetric: each step takes the square root of what a
    /// row lacks (Knight, Ruiz & Uçar 2014).
    pub fn repair(&mut self) -> Result<Repair, NotClosed> {
        let sums = self.row_sums();
        let incomplete = (0..self.n()).find(|&i| !self.is_complete(i));
        let farthest = || {
            self.closure()
                .filter(|(_, sum)| (sum - 1.0).abs() > REPAIRABLE)
        };
        if let Some((worst, row_sum)) = incomplete.map(|i| (i, sums[i])).or_else(farthest) {
            return Err(NotClosed {
                surface: self.names[worst].clone(),
                row_sum,
            });
        }
        let n = self.n();
        let before = self.values.clone();
        let mut steps = 0;
        while steps < MOST_STEPS && self.missing() > 4.0 * f64::EPSILON {
            let scale: Vec<f64> = self
                .row_sums()
                .into_iter()
                .map(|sum| if sum > 0.0 { sum.sqrt().recip() } else { 1.0 })
                .collect();
            for (k, value) in self.values.iter_mut().enumerate() {
                *value *= scale[k / n] * scale[k % n];
            }
            steps += 1;
        }
        let (mut largest_change, mut between) = (0.0, [0, 0]);
        for (k, (new, old)) in self.values.iter().zip(&before).enumerate() {
            if (new - old).abs() > largest_change {
                largest_change = (new - old).abs();
                between = [k / n, k % n];
            }
        }
        Ok(Repair {
            largest_change,
            between,
            closure: self.missing(),
            steps,
        })
    }

    /// The largest difference of a row sum from 1.
    fn missing(&self) -> f64 {
        self.closure().map_or(0.0, |(_, sum)| (sum - 1.0).abs())
    }
}

impl Reciprocity {
    fn add(&mut self, difference: f64, between: [usize; 2]) {
        self.pairs_checked += 1;
        if self.between.is_none() || difference > self.worst {
            self.worst = difference;
            self.between = Some(between);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three surfaces with a symmetric exchange whose rows are off by 0.1 %.
    fn nearly_closed() -> FormFactors {
        let areas = vec![1.0, 2.0, 2.0];
        let exchange = [
            [0.0, 0.5003, 0.4999],
            [0.5003, 0.3, 1.1995],
            [0.4999, 1.1995, 0.3],
        ];
        FormFactors {
            names: ["a", "b", "c"].map(str::to_owned).to_vec(),
            values: (0..9)
                .map(|k| exchange[k / 3][k % 3] / areas[k / 3])
                .collect(),
            errors: vec![0.0; 9],
            areas,
            reciprocity: Reciprocity::default(),
            evaluations: 0,
            left_out: 0,
            missing: Vec::new(),
        }
    }

    #[test]
    fn a_row_that_is_off_by_more_than_it_claims_raises_the_claims() {
        let mut matrix = nearly_closed();
        matrix.errors = vec![1e-3; 9];
        let before = matrix.errors.clone();
        matrix.hear_row_sums(&[true; 9]);
        assert_eq!(matrix.errors, before, "the claims hold what is missing");
        matrix.errors = vec![1e-9; 9];
        let mut is_integrated = [false; 9];
        (is_integrated[1], is_integrated[3]) = (true, true);
        let off: Vec<f64> = matrix.row_sums().iter().map(|s| (s - 1.0).abs()).collect();
        matrix.hear_row_sums(&is_integrated);
        assert!(matrix.errors[1] >= off[0] && matrix.errors[3] >= off[1]);
        // Both ways, and only what was integrated.
        let both = [1, 3].map(|k: usize| matrix.areas[k / 3] * matrix.errors[k]);
        assert!((both[0] - both[1]).abs() < 1e-8, "{both:?}");
        assert_eq!(matrix.errors[2], 1e-9);
    }

    #[test]
    fn a_repair_closes_rows_and_keeps_reciprocity() {
        let mut matrix = nearly_closed();
        let repair = matrix.repair().unwrap();
        assert!(repair.closure < 1e-15, "{repair:?}");
        assert!(repair.largest_change > 1e-5 && repair.largest_change < 1e-3);
        assert_eq!(matrix.factor(0, 0), 0.0);
        for i in 0..3 {
            for j in 0..3 {
                let there = matrix.areas[i] * matrix.factor(i, j);
                let back = matrix.areas[j] * matrix.factor(j, i);
                assert!((there - back).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn an_open_scene_is_not_repaired() {
        let mut matrix = nearly_closed();
        matrix.values[1] = 0.3;
        let before = matrix.clone();
        let refused = matrix.repair().unwrap_err();
        assert_eq!(refused.surface, "a");
        assert!(refused.to_string().contains("only closed scenes"));
        assert_eq!(matrix, before);
    }
}
