//! Plane classes: which faces lie in one plane, declared once.

use super::outline::Polygon;
use crate::scene::PlaneId;
use antumbra_geom::Plane;
use glam::DVec3;
use std::collections::HashMap;

/// Widths of the cells in which planes are looked up. A polygon of width w knows
/// its plane to about τ/w, so narrow polygons look in wide cells.
const CELLS: [f64; 5] = [
    1.0 / (1u64 << 28) as f64,
    1.0 / (1u64 << 22) as f64,
    1.0 / (1u64 << 16) as f64,
    1.0 / (1u64 << 10) as f64,
    1.0 / (1u64 << 4) as f64,
];

/// The classes, and for each polygon its class and whether it faces along it.
///
/// Polygons come in the order of their area, the largest first; each joins the
/// first class whose plane has all its corners within the tolerance, or starts a
/// class with its own plane. (The converse, corners of the large one near the
/// plane of the small one, would ask a small polygon for digits it does not have.)
pub(super) fn classify<'a>(
    polygons: impl Iterator<Item = &'a Polygon>,
    vertices: &[DVec3],
    tolerance: f64,
) -> (Vec<Plane>, Vec<(PlaneId, bool)>) {
    let polygons: Vec<&Polygon> = polygons.collect();
    let mut order: Vec<usize> = (0..polygons.len()).collect();
    order.sort_by(|&a, &b| {
        polygons[b]
            .area
            .total_cmp(&polygons[a].area)
            .then(a.cmp(&b))
    });

    let mut finder = Finder::default();
    let mut class_of = vec![0; polygons.len()];
    for i in order {
        let polygon = polygons[i];
        let own = polygon.plane(vertices);
        let fits = |plane: &Plane| {
            polygon
                .corners()
                .all(|&v| plane.distance(vertices[v as usize]).abs() <= tolerance)
        };
        let spread = 8.0 * tolerance / polygon.width;
        class_of[i] = finder
            .find(&own, spread, fits)
            .unwrap_or_else(|| finder.add(own));
    }

    // Number the classes by their first polygon in the file.
    let mut new_id: Vec<Option<PlaneId>> = vec![None; finder.planes.len()];
    let mut planes = Vec::with_capacity(finder.planes.len());
    let classes = class_of
        .iter()
        .zip(&polygons)
        .map(|(&class, polygon)| {
            let plane = finder.planes[class];
            let id = *new_id[class].get_or_insert_with(|| {
                planes.push(plane);
                PlaneId(planes.len() as u32 - 1)
            });
            (id, plane.normal.dot(polygon.normal) > 0.0)
        })
        .collect();
    (planes, classes)
}

/// Planes by rounded normal and offset, in cells of several widths.
#[derive(Debug, Default)]
struct Finder {
    planes: Vec<Plane>,
    cells: HashMap<(usize, [i64; 4]), Vec<usize>>,
}

impl Finder {
    fn add(&mut self, plane: Plane) -> usize {
        let class = self.planes.len();
        self.planes.push(plane);
        for (level, &cell) in CELLS.iter().enumerate() {
            let key = coordinates(&plane).map(|x| (x / cell).round() as i64);
            self.cells.entry((level, key)).or_default().push(class);
        }
        class
    }

    /// The first class near `plane` that fits, of either direction.
    fn find(&self, plane: &Plane, spread: f64, fits: impl Fn(&Plane) -> bool) -> Option<usize> {
        // Coordinates are below 4: an offset moves by four times the turn.
        let reach = 4.0 * spread;
        let level = CELLS
            .iter()
            .position(|&c| reach < c / 2.0)
            .unwrap_or(CELLS.len() - 1);
        let cell = CELLS[level];
        let mut best: Option<usize> = None;
        for normal in [plane.normal, DVec3::ZERO - plane.normal] {
            let at = coordinates(&Plane {
                normal,
                point: plane.point,
            });
            let low = at.map(|x| ((x - reach.min(cell)) / cell).round() as i64);
            let high = at.map(|x| ((x + reach.min(cell)) / cell).round() as i64);
            let mut key = low;
            loop {
                let near = self.cells.get(&(level, key)).into_iter().flatten();
                for &class in near {
                    if best.is_none_or(|b| class < b) && fits(&self.planes[class]) {
                        best = Some(class);
                    }
                }
                // The next key, as an odometer.
                let Some(k) = (0..4).find(|&k| key[k] < high[k]) else {
                    break;
                };
                key[..k].copy_from_slice(&low[..k]);
                key[k] += 1;
            }
        }
        best
    }
}

fn coordinates(plane: &Plane) -> [f64; 4] {
    let n = plane.normal;
    [n.x, n.y, n.z, n.dot(plane.point)]
}
