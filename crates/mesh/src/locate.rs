//! Which triangle a point is in.

use antumbra_geom::bounding_box;
use glam::{DVec2, dvec2};

use crate::grid::Grid;
use crate::trimesh::TriMesh;

/// Finds the triangle of a mesh that a point of the chart is in.
///
/// Belongs to the mesh as it was when the locator was made; make a new one after
/// [`TriMesh::bisect`].
#[derive(Clone, Debug)]
pub struct Locator {
    grid: Grid,
    slack: f64,
}

impl Locator {
    /// A locator that takes a point outside for one inside if it is nearer than a
    /// billionth of the mesh's extent, or eight pixels of its arrangement.
    #[must_use]
    pub fn new(mesh: &TriMesh) -> Self {
        let [min, max] = bounding_box(mesh.vertices.iter().copied());
        let extent = (max - min).max_element().max(0.0);
        Self::with_slack(mesh, (8.0 * mesh.pixel()).max(1e-9 * extent))
    }

    /// A locator that takes a point outside for one inside if it is nearer than
    /// `slack`, in the chart's unit.
    #[must_use]
    pub fn with_slack(mesh: &TriMesh, slack: f64) -> Self {
        let corners = mesh.vertices.iter().copied();
        let n = mesh.triangles.len();
        let grid = Grid::new(corners, n, |grid, t, visit| {
            cells_of(grid, mesh.corners(t as u32), slack, visit);
        });
        Self { grid, slack }
    }

    /// The triangle a point is in, and its barycentric coordinates there.
    ///
    /// Of several triangles the one with the lowest index; outside all, the nearest
    /// if it is within the slack, with the coordinates of its nearest point.
    #[must_use]
    pub fn locate(&self, mesh: &TriMesh, point: DVec2) -> Option<(u32, [f64; 3])> {
        if !point.is_finite() {
            return None;
        }
        let candidates = self.grid.items(self.grid.cell_of(point));
        let inside = candidates.iter().find_map(|&t| {
            let weights = barycentric(mesh.corners(t), point)?;
            weights.iter().all(|&w| w >= 0.0).then_some((t, weights))
        });
        if inside.is_some() {
            return inside;
        }
        let mut nearest: Option<(f64, u32, [f64; 3])> = None;
        for &t in candidates {
            let (distance, weights) = nearest_on_border(mesh.corners(t), point);
            if distance <= self.slack && nearest.is_none_or(|best| distance < best.0) {
                nearest = Some((distance, t, weights));
            }
        }
        nearest.map(|(_, t, weights)| (t, weights))
    }
}

/// Visits the cells that a triangle, grown by `slack`, touches.
fn cells_of(grid: &Grid, corners: [DVec2; 3], slack: f64, visit: &mut dyn FnMut(usize)) {
    let [a, b, c] = corners;
    let slack = slack + 1e-12 * (a.abs().max(b.abs()).max(c.abs())).max_element();
    let (low, high) = (a.y.min(b.y).min(c.y) - slack, a.y.max(b.y).max(c.y) + slack);
    for row in grid.row(1, low)..=grid.row(1, high) {
        // How far the triangle reaches within this row, and a little around it.
        let bottom = grid.row_start(1, row) - slack;
        let top = grid.row_start(1, row + 1) + slack;
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = if p.y <= q.y { (p, q) } else { (q, p) };
            if q.y < bottom || p.y > top {
                continue;
            }
            let slope = if q.y > p.y {
                (q.x - p.x) / (q.y - p.y)
            } else {
                0.0
            };
            let ends = [
                if p.y < bottom {
                    p.x + slope * (bottom - p.y)
                } else {
                    p.x
                },
                if q.y > top {
                    q.x - slope * (q.y - top)
                } else {
                    q.x
                },
            ];
            from = from.min(ends[0]).min(ends[1]);
            to = to.max(ends[0]).max(ends[1]);
        }
        if from > to {
            continue;
        }
        for column in grid.row(0, from - slack)..=grid.row(0, to + slack) {
            visit(grid.cell(column, row));
        }
    }
}

/// The barycentric coordinates of a point; nothing in a triangle without area.
fn barycentric([a, b, c]: [DVec2; 3], p: DVec2) -> Option<[f64; 3]> {
    // Relative to the point: exact zeros on edges through it, small ones near them.
    let [a, b, c] = [a - p, b - p, c - p];
    let parts = [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)];
    let whole = parts[0] + parts[1] + parts[2];
    (whole > 0.0).then(|| parts.map(|w| w / whole))
}

/// The distance to a triangle's border, and barycentric coordinates of the nearest point.
fn nearest_on_border(corners: [DVec2; 3], p: DVec2) -> (f64, [f64; 3]) {
    let mut nearest = (f64::INFINITY, [1.0, 0.0, 0.0]);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let d = b - a;
        let t = if d == dvec2(0.0, 0.0) {
            0.0
        } else {
            d.dot(p - a) / d.length_squared()
        };
        let t = t.clamp(0.0, 1.0);
        let distance = (a + t * d).distance(p);
        if distance < nearest.0 {
            let mut weights = [0.0; 3];
            weights[k] = 1.0 - t;
            weights[(k + 1) % 3] = t;
            nearest = (distance, weights);
        }
    }
    nearest
}
