//! Welding: positions become ids.

use super::frame;
use crate::input::SceneInput;
use crate::scene::Frame;
use glam::DVec3;
use std::collections::HashMap;

/// Vertices closer than this join; relative to the extent.
///
/// 2⁻⁴⁴: five hundred roundings of a coordinate, and a quarter of the plane
/// tolerance, so that welding never leaves a plane.
pub(super) const WELD_TOLERANCE: f64 = 1.0 / (1u64 << 44) as f64;

/// Vertices and the loops over them.
#[derive(Debug)]
pub(super) struct Welded {
    /// Scene units.
    pub(super) vertices: Vec<DVec3>,
    /// Per surface its outline and holes; empty for an unusable surface.
    pub(super) loops: Vec<Vec<Vec<u32>>>,
}

/// Gives every corner a vertex id, in the order of the file.
///
/// A corner joins the first vertex within the tolerance, whose coordinates stay:
/// no averaging (it would destroy exact coplanarity), no chains.
pub(super) fn weld(input: &SceneInput, usable: &[bool], frame: &Frame, extent: f64) -> Welded {
    let mut welder = Welder::new(extent * WELD_TOLERANCE);
    let loops = input
        .surfaces
        .iter()
        .zip(usable)
        .map(|(surface, &usable)| {
            if !usable {
                return Vec::new();
            }
            std::iter::once(&surface.vertices)
                .chain(&surface.holes)
                .map(|corners| {
                    corners
                        .iter()
                        .map(|&p| welder.id(frame::to_scene(frame, p, extent)))
                        .collect()
                })
                .collect()
        })
        .collect();
    Welded {
        vertices: welder.vertices,
        loops,
    }
}

/// Vertices in a grid of cells four tolerances wide, centred on dyadic numbers.
#[derive(Debug)]
struct Welder {
    tolerance: f64,
    vertices: Vec<DVec3>,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl Welder {
    fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            vertices: Vec::new(),
            cells: HashMap::new(),
        }
    }

    fn id(&mut self, point: DVec3) -> u32 {
        let width = 4.0 * self.tolerance;
        let cell = |p: DVec3| p.to_array().map(|x| (x / width).round() as i64);
        let (low, high) = (cell(point - self.tolerance), cell(point + self.tolerance));
        let mut first: Option<u32> = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let near = self.cells.get(&[x, y, z]).into_iter().flatten().copied();
                    for id in near {
                        let distance = self.vertices[id as usize].distance(point);
                        if distance <= self.tolerance && first.is_none_or(|f| id < f) {
                            first = Some(id);
                        }
                    }
                }
            }
        }
        first.unwrap_or_else(|| {
            let id = self.vertices.len() as u32;
            self.vertices.push(point);
            self.cells.entry(cell(point)).or_default().push(id);
            id
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn corners_within_the_tolerance_join_the_first_and_chains_do_not_grow() {
        let mut welder = Welder::new(WELD_TOLERANCE);
        let step = dvec3(0.75 * WELD_TOLERANCE, 0.0, 0.0);
        let at = dvec3(0.3, 0.7, 0.1);
        assert_eq!(welder.id(at), 0);
        assert_eq!(welder.id(at + step), 0);
        assert_eq!(welder.id(at + 2.0 * step), 1);
        assert_eq!(welder.id(at + step), 0);
        assert_eq!(welder.vertices[0], at);
    }
}
