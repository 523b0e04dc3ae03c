//! Maps of the error on the surface where it is most interesting.

use super::{Reference, one_value, worst_band};
use crate::options::Mesher;
use crate::values::{self, Place};
use antumbra_geom::{Chart, DVec2, Stop, bounding_box, dvec2, point_in_polygon};
use antumbra_io::study::{ErrorMap, MapGroup, Run, Series, Study};
use antumbra_scene::{FaceId, Scene};
use antumbra_solver::{Light, Solution};
use rayon::prelude::*;

/// Where errors are mapped: pixels of one face with their exact values.
#[derive(Debug)]
pub(crate) struct Canvas {
    face: FaceId,
    surface: String,
    width: usize,
    height: usize,
    /// The corner of the first pixel in the chart: left, top.
    corner: DVec2,
    /// The side of a pixel.
    side: f64,
    /// Pixels inside of the face, by index, with their place and bands.
    inside: Vec<(usize, Place, Vec<f64>)>,
    peak: Vec<f64>,
}

/// The map of a run.
#[derive(Debug, Default)]
pub(crate) struct RunMap {
    errors: Vec<f32>,
    edges: Vec<[[f32; 2]; 2]>,
}

/// More edges are not drawn: a page would grow beyond what a browser likes.
const MOST_EDGES: usize = 12_000;

impl Canvas {
    /// The face with most places in penumbras, or with most places; nothing if it was
    /// stopped.
    pub(crate) fn new(
        driver: &dyn Light,
        scene: &Scene,
        reference: &Reference,
        pixels: usize,
        stop: Stop<'_>,
    ) -> Option<Self> {
        let mut counts = vec![(0usize, 0usize); scene.face_ids().count()];
        for (place, &is_penumbra) in reference.places.iter().zip(&reference.is_penumbra) {
            let count = &mut counts[place.face.index()];
            count.0 += usize::from(is_penumbra);
            count.1 += 1;
        }
        let best = scene
            .face_ids()
            .max_by_key(|f| (counts[f.index()], std::cmp::Reverse(f.0)));
        let Some(face) = best.filter(|_| pixels > 0) else {
            return Some(Self::empty());
        };
        let chart = scene.chart(face);
        let loops = scene.loops_in_chart(face, &chart);
        let [min, max] = bounding_box(loops.iter().flatten().copied());
        let side = (max - min).max_element() / pixels as f64;
        let count = |length: f64| ((length / side).round() as usize).clamp(1, pixels);
        let (width, height) = (count(max.x - min.x), count(max.y - min.y));
        let corner = dvec2(min.x, max.y);
        let is_inside = |p: DVec2| point_in_polygon(p, loops.iter().map(Vec::as_slice));
        let place = |i: usize, chart: &Chart| -> Option<(usize, Place)> {
            let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let uv = corner + dvec2(x, -y) * side;
            is_inside(uv).then(|| {
                let point = chart.to_space(uv);
                (i, Place { face, point })
            })
        };
        let inside = (0..width * height)
            .into_par_iter()
            .filter_map(|i| place(i, &chart))
            .map(|(i, place)| {
                let bands = one_value(driver, &place, stop)?;
                Some((i, place, bands))
            })
            .collect::<Option<_>>()?;
        Some(Self {
            face,
            surface: scene.surface_of(face).name.clone(),
            width,
            height,
            corner,
            side,
            inside,
            peak: reference.peak.clone(),
        })
    }

    fn empty() -> Self {
        Self {
            face: FaceId(0),
            surface: String::new(),
            width: 0,
            height: 0,
            corner: DVec2::ZERO,
            side: 1.0,
            inside: Vec::new(),
            peak: Vec::new(),
        }
    }

    /// The error of a mesh, and its edges.
    pub(crate) fn map(&self, mesh: &Solution) -> RunMap {
        let mut errors = vec![f32::NAN; self.width * self.height];
        let found: Vec<f32> = self
            .inside
            .par_iter()
            .map(|(_, place, exact)| {
                worst_band(values::on_mesh(mesh, place).as_deref(), exact, &self.peak) as f32
            })
            .collect();
        for ((i, ..), error) in self.inside.iter().zip(found) {
            errors[*i] = error;
        }
        let mut edges: Vec<[[f32; 2]; 2]> = Vec::new();
        let to_pixels = |p: DVec2| {
            let q = (p - self.corner) / self.side;
            [q.x as f32, -q.y as f32]
        };
        let receivers = mesh.receivers.iter().filter(|r| r.face == self.face);
        for (receiver, element) in receivers.flat_map(|r| (0..r.n_elements()).map(move |e| (r, e)))
        {
            let (corners, n) = receiver.corners(element);
            for k in 0..n {
                let [a, b] = [corners[k], corners[(k + 1) % n]].map(to_pixels);
                // Once: neighbours have it the other way round.
                if a < b {
                    edges.push([a, b]);
                } else {
                    edges.push([b, a]);
                }
            }
        }
        edges.sort_by(|a, b| {
            a.as_flattened()
                .partial_cmp(b.as_flattened())
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        edges.dedup();
        if edges.len() > MOST_EDGES {
            edges.clear();
        }
        RunMap { errors, edges }
    }

    /// Runs of all generators side by side: at the time, and at the number of elements, of
    /// the cheapest discontinuity mesh that is good enough, or else of the best mesh.
    pub(crate) fn groups(&self, study: &Study, maps: &[Vec<RunMap>]) -> Vec<MapGroup> {
        if self.inside.is_empty() {
            return Vec::new();
        }
        let is_ours = |s: &&Series| s.mesher == Mesher::Discontinuity.key();
        let ours: Vec<&Run> = study
            .series
            .iter()
            .filter(is_ours)
            .flat_map(|s| &s.runs)
            .collect();
        let good = ours.iter().filter(|r| r.error.max <= study.target);
        let cheapest = good.min_by(|a, b| a.seconds.median.total_cmp(&b.seconds.median));
        // If none is good enough, or ours were not asked for: the most accurate there is.
        let all = study.series.iter().flat_map(|s| &s.runs);
        let closest = all.min_by(|a, b| a.error.max.total_cmp(&b.error.max));
        let Some(pivot) = cheapest.copied().or(closest) else {
            return Vec::new();
        };
        let seconds = pivot.seconds.median;
        let caption = format!("Equal time, about {}", super::duration(seconds));
        let elements = pivot.elements as f64;
        vec![
            self.group(study, maps, caption, |r| r.seconds.median / seconds),
            self.group(
                study,
                maps,
                format!("Equal elements, about {elements}"),
                |r| r.elements as f64 / elements,
            ),
        ]
    }

    /// The most accurate run of each generator whose cost is not far above the pivot's.
    fn group(
        &self,
        study: &Study,
        maps: &[Vec<RunMap>],
        caption: String,
        cost: impl Fn(&Run) -> f64,
    ) -> MapGroup {
        let mut meshers: Vec<&str> = Vec::new();
        for series in &study.series {
            if !meshers.contains(&series.mesher.as_str()) {
                meshers.push(&series.mesher);
            }
        }
        let maps = meshers
            .into_iter()
            .filter_map(|mesher| {
                let runs = study
                    .series
                    .iter()
                    .zip(maps)
                    .filter(|(s, _)| s.mesher == mesher)
                    .flat_map(|(s, maps)| s.runs.iter().zip(maps).map(move |(r, m)| (s, r, m)));
                runs.filter(|(_, r, _)| cost(r) <= EQUAL)
                    .min_by(|a, b| a.1.error.rms.total_cmp(&b.1.error.rms))
                    .map(|(s, r, m)| self.error_map(s, r, m))
            })
            .collect();
        MapGroup {
            caption,
            surface: self.surface.clone(),
            maps,
        }
    }

    fn error_map(&self, series: &Series, run: &Run, map: &RunMap) -> ErrorMap {
        ErrorMap {
            label: format!("{}, degree {}", series.mesher, series.degree),
            elements: run.elements,
            seconds: run.seconds.median,
            rms: run.error.rms,
            width: self.width,
            height: self.height,
            errors: map.errors.clone(),
            edges: map.edges.clone(),
        }
    }
}

/// Runs count as equally dear up to this ratio: ladders have steps.
const EQUAL: f64 = 1.25;
