//! Meshes of polygons that are thinner than the pixels of an arrangement.
//!
//! The arrangement of their border alone bounds no area: its sides fold onto each other.
//! What is left is a triangulation of their corners as they are, decided by exact
//! predicates on the chart's coordinates. It is good for having elements and an area;
//! nothing that crosses it is in it, and it is not refined.

use crate::arrange::{ArrangementOptions, Order, TaggedCurve, arrange};
use crate::cells::{Cell, CellMesh, Midpoints};
use crate::sets::CurveSets;
use crate::trimesh::{TriMesh, ascending};
use antumbra_geom::{Control, bounding_box, cdt};
use glam::DVec2;
use std::collections::HashMap;

/// The corners of a polygon and triangles between them.
#[derive(Default)]
struct Corners {
    points: Vec<DVec2>,
    /// Counter-clockwise, with areas above 0.
    triangles: Vec<[u32; 3]>,
    /// Edges of the border by ascending ends, and the loop they are of. For lookup only.
    border: HashMap<[u32; 2], u32>,
}

impl Corners {
    /// Of loops that need not repeat their first point. No triangles if rounding has made
    /// them cross, or left nothing between them.
    fn new(border: &[Vec<DVec2>]) -> Self {
        let mut points: Vec<DVec2> = border.iter().flatten().copied().collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        points.dedup();
        let id = |p: DVec2| points.partition_point(|q| (q.x, q.y) < (p.x, p.y)) as u32;
        let mut passes: HashMap<[u32; 2], (u32, u32)> = HashMap::new();
        for (l, corners) in border.iter().enumerate() {
            for (i, &p) in corners.iter().enumerate() {
                let (a, b) = (id(p), id(corners[(i + 1) % corners.len()]));
                if a != b {
                    let (n, _) = passes.entry(ascending(a, b)).or_insert((0, l as u32));
                    *n += 1;
                }
            }
        }
        // What is passed twice folds onto itself and bounds nothing.
        let border: HashMap<[u32; 2], u32> = passes
            .into_iter()
            .filter(|(_, (n, _))| n % 2 == 1)
            .map(|(ends, (_, l))| (ends, l))
            .collect();
        let mut edges: Vec<[u32; 2]> = border.keys().copied().collect();
        edges.sort_unstable();
        let Ok(cdt) = cdt::triangulate(&points, &edges) else {
            return Self::default();
        };
        let is_border = |a: u32, b: u32| border.contains_key(&ascending(a, b));
        let inside = cdt::inside_by_parity(&cdt.triangles, is_border);
        let has_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| points[v as usize]);
            (b - a).perp_dot(c - a) > 0.0
        };
        let triangles = cdt.triangles.iter().zip(inside).filter(|t| t.1);
        let triangles = triangles.map(|t| *t.0).filter(has_area).collect();
        Self {
            points,
            triangles,
            border,
        }
    }
}

impl TriMesh {
    /// The triangulation of a polygon's corners as they are, for polygons that are thinner
    /// than a pixel of their arrangement; empty if rounding has left nothing between them.
    ///
    /// * `border` — loops in the chart; the index of a loop is the id of its curve.
    #[must_use]
    pub fn of_corners(border: &[Vec<DVec2>]) -> Self {
        let corners = Corners::new(border);
        if corners.triangles.is_empty() {
            return Self::empty();
        }
        let mut sets = CurveSets::default();
        let sets_of_loops: Vec<_> = (0..border.len() as u32)
            .map(|l| sets.intern(&[l]))
            .collect();
        let edges = corners.border.iter();
        let [min, max] = bounding_box(corners.points.iter().copied());
        let pixels = f64::from(ArrangementOptions::default().bits).exp2();
        Self {
            neighbours: cdt::neighbours(&corners.triangles),
            edges: edges
                .map(|(&ends, &l)| (ends, sets_of_loops[l as usize]))
                .collect(),
            vertices: corners.points,
            triangles: corners.triangles,
            orders: vec![Order::Boundary; sets.len()],
            sets,
            pixel: (max - min).max_element() / pixels,
        }
    }
}

/// The same as cells; none if rounding has left nothing between the corners.
#[must_use]
pub fn cells_of_corners(border: &[Vec<DVec2>]) -> CellMesh {
    let corners = Corners::new(border);
    let cells = corners.triangles.iter();
    let cells = cells.map(|&t| Cell::triangle(t, 0)).collect();
    CellMesh::new(corners.points, cells, &Midpoints::new())
}

/// How much of a polygon the arrangement of its border does not hold, because the border
/// folds onto itself there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Folded {
    /// Nothing.
    None,
    /// Parts that are no wider than a few pixels, of this area in all.
    Parts(f64),
    /// All of it.
    All,
}

/// How much of a polygon folds.
///
/// * `border` — loops in the chart, counter-clockwise and holes clockwise.
#[must_use]
pub fn folded(border: &[Vec<DVec2>]) -> Folded {
    let curves: Vec<TaggedCurve> = border
        .iter()
        .map(|corners| TaggedCurve {
            points: corners.iter().chain(corners.first()).copied().collect(),
            order: Order::Boundary,
        })
        .collect();
    let arrangement =
        arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
    if arrangement.edges.iter().all(|e| e.separates) && !arrangement.edges.is_empty() {
        return Folded::None;
    }
    let Ok(mesh) = TriMesh::new(&arrangement, &curves) else {
        return Folded::All;
    };
    let area: f64 = border.iter().map(|corners| signed_area(corners)).sum();
    let folded = area - mesh.total_area();
    // A slit that closes folds too, and takes nothing away.
    if folded > 0.0 {
        Folded::Parts(folded)
    } else {
        Folded::None
    }
}

fn signed_area(corners: &[DVec2]) -> f64 {
    let Some(&origin) = corners.first() else {
        return 0.0;
    };
    let twice = corners.windows(2);
    twice
        .map(|w| (w[0] - origin).perp_dot(w[1] - origin))
        .sum::<f64>()
        / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    /// Two long; a pixel is 7e-9.
    fn strip(height: f64) -> Vec<Vec<DVec2>> {
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, height), (0.0, height)];
        vec![corners.map(|(x, y)| dvec2(x, y)).to_vec()]
    }

    #[test]
    fn a_strip_below_the_pixels_is_folded_and_has_triangles_of_its_area() {
        for height in [2e-8, 1e-10, 1e-14] {
            let border = strip(height);
            let area = 2.0 * height;
            assert_eq!(folded(&border), Folded::All);
            let mesh = TriMesh::of_corners(&border);
            assert_eq!(mesh.triangles.len(), 2);
            assert!((mesh.total_area() - area).abs() <= 1e-12 * area);
            assert_eq!(mesh.edge_order(0, 1), Some(Order::Boundary));
            assert_eq!(cells_of_corners(&border).cells.len(), 2);
        }
        assert_eq!(folded(&strip(1e-6)), Folded::None);
    }

    #[test]
    fn of_a_body_with_a_thin_arm_the_arm_is_folded() {
        let corners = [
            (0.0, 0.0),
            (1.0, 0.0),
            (2.0, 0.0),
            (2.0, 1e-9),
            (1.0, 1e-9),
            (1.0, 1.0),
            (0.0, 1.0),
        ];
        let border = vec![corners.map(|(x, y)| dvec2(x, y)).to_vec()];
        let Folded::Parts(area) = folded(&border) else {
            panic!("it has a body");
        };
        assert!((area - 1e-9).abs() < 1e-14);
    }

    #[test]
    fn corners_on_one_line_are_no_mesh() {
        let border = vec![[0.0, 1.0, 2.0].map(|x| dvec2(x, x)).to_vec()];
        assert!(TriMesh::of_corners(&border).triangles.is_empty());
        assert!(cells_of_corners(&border).cells.is_empty());
    }
}
