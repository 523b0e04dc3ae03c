//! The jumps that are predicted are those that irradiance has.

use antumbra::scene::FaceId;
use antumbra::visibility::{Seen, View, critical_curves};
use antumbra::{
    Control, CriticalCurve, Discontinuity, Evaluator, EventKind, EventKinds, Scene, Scratch,
};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use glam::DVec3;
use std::collections::BTreeMap;

/// Factors of one emitter along a line on a receiver.
struct Probe<'e, 's> {
    evaluator: &'e Evaluator<'s>,
    view: View,
    emitter: usize,
}

impl Probe<'_, '_> {
    fn at(&self, x: DVec3) -> f64 {
        let mut seen = vec![Seen::default(); self.evaluator.emitters().len()];
        self.evaluator
            .factors(&self.view, x, None, &mut Scratch::default(), &mut seen);
        seen[self.emitter].factor
    }

    /// First and second derivative at x, from the side of `step`, whose length is the
    /// spacing; third-order differences.
    fn one_sided(&self, x: DVec3, step: DVec3) -> [f64; 2] {
        let f: [f64; 5] = std::array::from_fn(|k| self.at(x + step * k as f64));
        let h = step.length();
        [
            (-25.0 * f[0] + 48.0 * f[1] - 36.0 * f[2] + 16.0 * f[3] - 3.0 * f[4]) / (12.0 * h),
            (35.0 * f[0] - 104.0 * f[1] + 114.0 * f[2] - 56.0 * f[3] + 11.0 * f[4])
                / (12.0 * h * h),
        ]
    }
}

/// The distance of a point from a curve, as a polyline.
fn distance(curve: &CriticalCurve, x: DVec3) -> f64 {
    let line = curve.shape.polyline(1e-7);
    line.windows(2)
        .map(|w| {
            let along = w[1] - w[0];
            let t = ((x - w[0]).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            (w[0] + along * t - x).length()
        })
        .fold(f64::INFINITY, f64::min)
}

fn border_distance(scene: &Scene, face: FaceId, x: DVec3) -> f64 {
    let mut least = f64::INFINITY;
    for corners in scene.face(face).loops() {
        for i in 0..corners.len() {
            let (a, b) = (
                scene.position(corners[i]),
                scene.position(corners[(i + 1) % corners.len()]),
            );
            let along = b - a;
            let t = ((x - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            least = least.min((a + along * t - x).length());
        }
    }
    least
}

/// Measured over predicted jump of every curve that runs alone somewhere.
fn ratios(name: &str) -> Vec<(EventKind, f64, String)> {
    let scene = build(&fixture(name));
    let evaluator = Evaluator::new(&scene);
    let emitters: Vec<FaceId> = evaluator.emitters().collect();
    let mut found = Vec::new();
    for face in scene.face_ids() {
        let curves = critical_curves(
            &evaluator,
            face,
            EventKinds::ALL,
            2f64.powi(-24),
            &Control::NEVER,
        )
        .unwrap_or_default()
        .curves;
        for (i, curve) in curves.iter().enumerate() {
            if curve.kind() == EventKind::Contact {
                continue;
            }
            let emitter = curve
                .emitter
                .and_then(|e| emitters.iter().position(|&f| f == e));
            let Some(emitter) = emitter else { continue };
            let probe = Probe {
                evaluator: &evaluator,
                view: evaluator.view(face),
                emitter,
            };
            // The place with most room.
            let room = |t: f64| {
                let x = curve.shape.at(t);
                let others = curves
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| *j != i)
                    .map(|(_, other)| distance(other, x))
                    .fold(f64::INFINITY, f64::min);
                others.min(border_distance(&scene, face, x))
            };
            let places = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];
            let Some(&t) = places.iter().max_by(|a, b| room(**a).total_cmp(&room(**b))) else {
                continue;
            };
            let room = room(t);
            if room < 2e-3 {
                continue;
            }
            let x = curve.shape.at(t);
            let along = curve.shape.at(t + 1e-4) - curve.shape.at(t - 1e-4);
            let across = along.cross(scene.face(face).normal).normalize_or_zero();
            let Some(predicted) = antumbra::visibility::jump_at(&evaluator, face, curve, x) else {
                continue;
            };
            let measure = |length: f64| {
                let step = across * length;
                let (plus, minus) = (probe.one_sided(x, step), probe.one_sided(x, -step));
                match curve.kind().discontinuity() {
                    // Derivatives on either side point away from the curve.
                    Discontinuity::D1 => (plus[0] + minus[0]).abs(),
                    _ => (plus[1] - minus[1]).abs(),
                }
            };
            // Where two spacings disagree, differences do not tell.
            let spacing = (room / 8.0).min(2e-3);
            let (rough, measured) = (measure(spacing), measure(spacing / 2.0));
            if (rough - measured).abs() > 0.003 * measured {
                continue;
            }
            // Below, differences see rounding.
            let floor = if curve.kind().discontinuity() == Discontinuity::D1 {
                1e-7
            } else {
                1e-5
            };
            if measured < floor && predicted < floor {
                continue;
            }
            let row = format!(
                "{name} {} {:?} t={t} room={room:.1e} predicted={predicted:.6e} measured={measured:.6e}",
                scene.surface_of(face).name,
                curve.event
            );
            found.push((curve.kind(), measured / predicted, row));
        }
    }
    found
}

#[test]
fn predicted_jumps_are_measured_within_one_percent_on_every_kind() {
    let mut by_kind: BTreeMap<EventKind, (usize, usize)> = BTreeMap::new();
    let mut wrong = Vec::new();
    for folder in ["basic", "alignment", "eee"] {
        for path in json_files(&fixtures().join(folder)) {
            let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
            // The largest scenes take long and have no other events.
            let is_small = |s: &String| !["16", "64", "table"].iter().any(|t| s.contains(t));
            let Some(stem) = stem.filter(is_small) else {
                continue;
            };
            for (kind, ratio, row) in ratios(&format!("{folder}/{stem}")) {
                let counts = by_kind.entry(kind).or_default();
                counts.0 += 1;
                if (ratio - 1.0).abs() > 0.01 {
                    counts.1 += 1;
                    wrong.push(row);
                }
            }
        }
    }
    for kind in [
        EventKind::Ve,
        EventKind::Ee,
        EventKind::Eee,
        EventKind::Facet,
        EventKind::Horizon,
    ] {
        assert!(
            by_kind.contains_key(&kind),
            "no curve of kind {kind:?} was measured"
        );
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
