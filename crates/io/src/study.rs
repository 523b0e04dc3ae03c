//! A study of accuracy against time, ready to be written: what was run, what it cost, how
//! much it erred; as a page, a table, a document or a picture.

mod figure;
mod html;
mod table;

pub use figure::{Horizontal, Vertical, render, svg};
pub use html::write_html;
pub use table::{write_csv, write_json};

use serde::Serialize;

/// A study of one scene.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Study {
    /// What the scene is called.
    pub title: String,
    /// What has to be believed: the sentence at the top.
    pub advice: String,
    /// The largest error that the advice is for, relative to the peak.
    pub target: f64,
    /// The command that made it.
    pub command: String,
    /// Version of the program.
    pub version: String,
    /// Processor, cores, threads, system.
    pub machine: String,
    /// What is measured: `direct irradiance` or `irradiance with interreflection`.
    pub quantity: String,
    /// `W/m²`, `lx` or empty.
    pub unit: String,
    /// The largest value at a point of reference; errors are relative to it.
    pub peak: f64,
    /// Points of reference, spread over the receivers by area; no mesh used them.
    pub n_points: usize,
    /// Those of them from which some of the light is hidden.
    pub n_penumbra: usize,
    /// How far the values of reference may be off, relative to the peak: rounding for
    /// direct light.
    pub reference_uncertainty: f64,
    /// Seconds that one exact evaluation takes, all threads at work: who asks for fewer
    /// points than a mesh costs needs none.
    pub exact_seconds: f64,
    /// What was left out and why, one sentence each.
    pub notes: Vec<String>,
    /// Every mesh generator and degree.
    pub series: Vec<Series>,
    /// What error estimators say of the true error.
    pub estimators: Vec<Effectivity>,
    /// What steps after meshing do to the error.
    pub steps: Vec<Step>,
    /// Maps of the error, group by group.
    pub maps: Vec<MapGroup>,
}

/// One mesh generator at one degree, over a ladder of settings.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Series {
    /// The generator's key, as on the command line.
    pub mesher: String,
    /// Degree of the elements.
    pub degree: u8,
    /// The exponent of the mean size of elements that the rms error goes with: fitted over
    /// the finer half of the runs.
    pub order_rms: Option<f64>,
    /// The same for the largest error.
    pub order_max: Option<f64>,
    /// Why the ladder ended.
    pub ended: String,
    /// From coarse to fine.
    pub runs: Vec<Run>,
}

/// One mesh.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Run {
    /// What was asked for: `tolerance 1e-3`, `16 elements a side`.
    pub setting: String,
    /// Elements of all receivers.
    pub elements: usize,
    /// Nodes of all receivers.
    pub nodes: usize,
    /// Exact evaluations: nodes and check points.
    pub exact_evaluations: u64,
    /// Seconds from the scene to the finished mesh.
    pub seconds: Spread,
    /// Memory that the process gained by the run, bytes; 0 where it cannot be told.
    pub memory_bytes: u64,
    /// Errors relative to the peak.
    pub error: Errors,
    /// What the mesh itself says is its largest error.
    pub claimed_error: f64,
    /// Is no other run both faster and more accurate (rms)?
    pub on_front: bool,
    /// Shapes of the elements.
    pub quality: Quality,
}

/// Errors at the points of reference, relative to the peak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// The largest.
    pub max: f64,
    /// Root mean square over the area.
    pub rms: f64,
    /// The largest where some of the light is hidden.
    pub penumbra_max: f64,
    /// Root mean square there.
    pub penumbra_rms: f64,
}

/// A time that was measured several times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// The middle one.
    pub median: f64,
    /// The shortest.
    pub min: f64,
    /// The longest.
    pub max: f64,
    /// How many there were.
    pub n: usize,
}

impl Spread {
    /// Of measurements in any order; zeros if there are none.
    #[must_use]
    pub fn of(times: &[f64]) -> Self {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (Some(&min), Some(&max)) = (sorted.first(), sorted.last()) else {
            return Self::default();
        };
        let middle = sorted.len() / 2;
        let median = if sorted.len().is_multiple_of(2) {
            f64::midpoint(sorted[middle - 1], sorted[middle])
        } else {
            sorted[middle]
        };
        Self {
            median,
            min,
            max,
            n: sorted.len(),
        }
    }
}

/// How well elements are shaped.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Quality {
    /// The smallest ratio of inscribed to circumscribed radius, scaled to 1 for the
    /// equilateral triangle and the square.
    pub min: f64,
    /// The middle one.
    pub median: f64,
    /// How many elements have a ratio of 0 to 0.1, 0.1 to 0.2, … 0.9 to 1.
    pub histogram: [usize; 10],
    /// The smallest angle, degrees.
    pub smallest_angle: f64,
    /// Vertices inside an edge of a neighbour.
    pub t_vertices: usize,
    /// Elements per area of the receivers, in the scene's length unit.
    pub density: f64,
}

/// What an estimator says, divided by the true error.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Effectivity {
    /// Whose error is estimated: mesher and degree.
    pub mesh: String,
    /// The estimator.
    pub estimator: String,
    /// Elements of that mesh.
    pub elements: usize,
    /// Estimate over true error, of the whole mesh (largest errors).
    pub of_max: f64,
    /// The middle one of the elements'.
    pub median: f64,
    /// A tenth of the elements have a smaller one.
    pub low: f64,
    /// A tenth of the elements have a larger one.
    pub high: f64,
    /// The share of the elements that err by more than the estimate.
    pub below: f64,
    /// Rank correlation of estimate and true error over elements (Spearman).
    pub correlation: f64,
    /// Exact evaluations that it took on top of the mesh and its check points.
    pub evaluations: u64,
}

/// A step after meshing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Step {
    /// The mesh it was applied to.
    pub mesh: String,
    /// What was done.
    pub step: String,
    /// Errors before it.
    pub before: Errors,
    /// Errors after it.
    pub after: Errors,
    /// Elements before and after.
    pub elements: [usize; 2],
    /// Exact evaluations before and after.
    pub evaluations: [u64; 2],
    /// Why it changed nothing, if so.
    pub reason: Option<String>,
}

/// Maps of the error on one surface, side by side.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MapGroup {
    /// What they have in common: `equal time: 12 ms`.
    pub caption: String,
    /// The surface.
    pub surface: String,
    /// One per mesher.
    pub maps: Vec<ErrorMap>,
}

/// A map of the error of one mesh on one surface.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ErrorMap {
    /// Mesher and degree.
    pub label: String,
    /// Elements of all receivers.
    pub elements: usize,
    /// Seconds, the median.
    pub seconds: f64,
    /// Root mean square of the run.
    pub rms: f64,
    /// Pixels in a row.
    pub width: usize,
    /// Rows, from the top of the surface's chart.
    pub height: usize,
    /// Error relative to the peak, row by row; NaN outside of the surface.
    #[serde(skip)]
    pub errors: Vec<f32>,
    /// Edges of the elements: two points each, in pixels.
    #[serde(skip)]
    pub edges: Vec<[[f32; 2]; 2]>,
}

/// All runs that no other run beats in both time and error.
///
/// * `cost`, `error` — of every run, in one order.
///
/// Returns for every run whether it is on the front. Of equal ones all are.
#[must_use]
pub fn pareto_front(runs: &[(f64, f64)]) -> Vec<bool> {
    runs.iter()
        .map(|&(cost, error)| {
            !runs
                .iter()
                .any(|&(c, e)| c <= cost && e <= error && (c < cost || e < error))
        })
        .collect()
}

/// The exponent `p` of `error ∝ elements^(−p/2)`, fitted over the finer half of the runs
/// (at least three of them that err by more than `floor`); nothing if there are too few.
#[must_use]
pub fn observed_order(runs: &[(usize, f64)], floor: f64) -> Option<f64> {
    let mut usable: Vec<(f64, f64)> = runs
        .iter()
        .filter(|(n, e)| *n > 0 && *e > floor && e.is_finite())
        .map(|&(n, e)| (-0.5 * (n as f64).ln(), e.ln()))
        .collect();
    usable.sort_by(|a, b| b.0.total_cmp(&a.0));
    usable.dedup_by(|a, b| a.0.to_bits() == b.0.to_bits());
    let finer = usable.len().div_ceil(2).max(3);
    let points = usable.get(usable.len().checked_sub(finer)?..)?;
    let n = points.len() as f64;
    let (sx, sy) = points
        .iter()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    let (mx, my) = (sx / n, sy / n);
    let (xx, xy) = points.iter().fold((0.0, 0.0), |s, p| {
        let d = p.0 - mx;
        (s.0 + d * d, s.1 + d * (p.1 - my))
    });
    (xx > 1e-6).then(|| xy / xx)
}

/// Colours of the generators, told apart also by the colour-blind (Okabe & Ito).
fn color_of(mesher: &str) -> u32 {
    match mesher {
        "discontinuity" => 0x0072b2,
        "uniform" => 0x8a8a8a,
        "graded" => 0xe69f00,
        "quadtree" => 0xd55e00,
        "restricted" => 0xcc79a7,
        "tri-quadtree" => 0x8c6d31,
        "adaptive" => 0x009e73,
        "exact" => 0x000000,
        _ => 0x56b4e9,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_has_what_nothing_beats() {
        let runs = [(1.0, 1.0), (2.0, 0.5), (2.0, 0.7), (3.0, 0.5), (4.0, 0.1)];
        assert_eq!(pareto_front(&runs), [true, true, false, false, true]);
    }

    #[test]
    fn the_order_of_a_power_is_its_exponent() {
        let runs: Vec<(usize, f64)> = (2..12)
            .map(|k| (1 << k, 0.5f64.powi(k).powf(1.25)))
            .collect();
        let order = observed_order(&runs, 1e-12).unwrap_or(0.0);
        assert!((order - 2.5).abs() < 1e-9, "{order}");
        assert_eq!(observed_order(&runs[..2], 1e-12), None);
    }

    #[test]
    fn a_spread_has_the_middle_time() {
        assert_eq!(Spread::of(&[3.0, 1.0, 2.0]).median, 2.0);
        assert_eq!(Spread::of(&[4.0, 1.0]).median, 2.5);
        assert_eq!(Spread::of(&[]).n, 0);
    }
}
