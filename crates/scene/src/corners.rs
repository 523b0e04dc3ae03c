//! Corners of a file, and what moves them to each other.

use crate::input::{SceneInput, SurfaceInput};
use glam::DVec3;
use std::collections::HashMap;

/// Corners nearer than this, relative to the extent, are one without being asked for, and
/// edges shorter than this are none ([`Scene::build`](crate::Scene::build)).
const ROUNDING: f64 = 1.0 / (1u64 << 44) as f64;

/// What welding did.
#[derive(Clone, Debug, PartialEq)]
pub struct Welded {
    /// How many corners were moved.
    pub n_moved: usize,
    /// The largest distance by which one was; file units.
    pub farthest: f64,
    /// The surfaces they are corners of, in their order.
    pub surfaces: Vec<String>,
}

/// The outline and the holes of a surface.
pub(crate) fn loops(surface: &SurfaceInput) -> impl Iterator<Item = &Vec<DVec3>> {
    std::iter::once(&surface.vertices).chain(&surface.holes)
}

/// The longest side of the box around all finite corners.
pub(crate) fn extent(input: &SceneInput) -> f64 {
    let corners = input.surfaces.iter().flat_map(loops).flatten();
    let (min, max) = corners
        .filter(|p| p.is_finite())
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| {
            (min.min(p), max.max(p))
        });
    (max - min).max_element().max(0.0)
}

/// The shortest edge that is one, and its surface.
pub(crate) fn shortest_edge(input: &SceneInput) -> Option<(&SurfaceInput, [DVec3; 2])> {
    let least = ROUNDING * extent(input);
    let mut shortest: Option<(&SurfaceInput, [DVec3; 2])> = None;
    for surface in &input.surfaces {
        for corners in loops(surface) {
            for (k, &p) in corners.iter().enumerate() {
                let q = corners[(k + 1) % corners.len()];
                let length = p.distance(q);
                if length > least && shortest.is_none_or(|(_, [a, b])| length < a.distance(b)) {
                    shortest = Some((surface, [p, q]));
                }
            }
        }
    }
    shortest
}

/// Places of corners, and what was moved to them.
pub(crate) struct Mover {
    pub(crate) welded: Welded,
    length: f64,
    rounding: f64,
    /// As wide as the length, so that what is near lies in the cell or beside it. Places
    /// are numbered.
    cells: HashMap<[i64; 3], Vec<(u32, DVec3)>>,
    n_places: u32,
}

impl Mover {
    /// * `length` — by how much corners are moved at most; file units.
    pub(crate) fn new(extent: f64, length: f64) -> Self {
        Self {
            welded: Welded {
                n_moved: 0,
                farthest: 0.0,
                surfaces: Vec::new(),
            },
            length,
            rounding: ROUNDING * extent,
            cells: HashMap::new(),
            n_places: 0,
        }
    }

    /// Moves the corners of a surface to the first places that are near; others, and all
    /// if they may not move, become places.
    pub(crate) fn surface(&mut self, surface: &mut SurfaceInput, may_move: bool) {
        if !(self.length > self.rounding && self.length.is_finite()) {
            return;
        }
        let n_before = self.welded.n_moved;
        let corners = std::iter::once(&mut surface.vertices).chain(&mut surface.holes);
        for corner in corners.flatten().filter(|p| p.is_finite()) {
            match self.place_near(*corner, may_move) {
                None => self.add_place(*corner),
                Some(place) => self.move_to(corner, place),
            }
        }
        if self.welded.n_moved > n_before {
            self.welded.surfaces.push(surface.name.clone());
        }
    }

    fn cell(&self, p: DVec3) -> [i64; 3] {
        p.to_array().map(|x| (x / self.length).floor() as i64)
    }

    /// The first place within the length, or of a corner that may not move its own.
    fn place_near(&self, corner: DVec3, may_move: bool) -> Option<DVec3> {
        let reach = if may_move { self.length } else { 0.0 };
        let cell = self.cell(corner);
        let mut first: Option<(u32, DVec3)> = None;
        for offset in 0..27i64 {
            let offsets = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
            let beside: [i64; 3] = std::array::from_fn(|i| cell[i].saturating_add(offsets[i]));
            for &(id, place) in self.cells.get(&beside).into_iter().flatten() {
                if place.distance(corner) <= reach && first.is_none_or(|f| id < f.0) {
                    first = Some((id, place));
                }
            }
        }
        first.map(|(_, place)| place)
    }

    fn add_place(&mut self, corner: DVec3) {
        let cell = self.cell(corner);
        self.cells
            .entry(cell)
            .or_default()
            .push((self.n_places, corner));
        self.n_places += 1;
    }

    fn move_to(&mut self, corner: &mut DVec3, place: DVec3) {
        let distance = place.distance(*corner);
        if distance > self.rounding {
            self.welded.n_moved += 1;
            self.welded.farthest = self.welded.farthest.max(distance);
        }
        *corner = place;
    }
}
