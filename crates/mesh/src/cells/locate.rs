//! Which cell a point is in.

use super::CellMesh;
use crate::grid::Grid;
use antumbra_geom::bounding_box;
use glam::DVec2;

/// Finds the cell of a mesh that a point of the chart is in.
#[derive(Clone, Debug)]
pub struct CellLocator {
    grid: Grid,
    slack: f64,
}

impl CellLocator {
    /// A locator that takes a point outside for one inside if it is nearer than a
    /// billionth of the mesh's extent.
    #[must_use]
    pub fn new(mesh: &CellMesh) -> Self {
        let used = || {
            let corners = mesh.cells.iter().flat_map(super::Cell::corners);
            corners.map(|&v| mesh.vertices[v as usize])
        };
        let [min, max] = bounding_box(used());
        let slack = 1e-9 * (max - min).max_element().max(0.0);
        let grid = Grid::new(used(), mesh.cells.len(), |grid, c, visit| {
            let corners = mesh.corner_positions(c);
            let [min, max] = [
                corners.into_iter().fold(DVec2::INFINITY, DVec2::min) - slack,
                corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max) + slack,
            ];
            for row in grid.row(1, min.y)..=grid.row(1, max.y) {
                for column in grid.row(0, min.x)..=grid.row(0, max.x) {
                    visit(grid.cell(column, row));
                }
            }
        });
        Self { grid, slack }
    }

    /// The cell a point is in, and its reference coordinates there
    /// ([`CellMesh::point`]).
    ///
    /// Of several cells the one with the lowest index; outside all, the nearest if it is
    /// within the slack, with the coordinates of its nearest point.
    #[must_use]
    pub fn locate(&self, mesh: &CellMesh, point: DVec2) -> Option<(usize, [f64; 2])> {
        if !point.is_finite() || mesh.cells.is_empty() {
            return None;
        }
        let candidates = self.grid.items(self.grid.cell_of(point));
        let inside = candidates.iter().map(|&c| c as usize).find(|&c| {
            let corners = mesh.corner_positions(c);
            (0..4).all(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                (a - point).perp_dot(b - point) >= 0.0
            })
        });
        if let Some(c) = inside {
            return Some((c, clamped(mesh, c, mesh.reference(c, point))));
        }
        let mut nearest: Option<(f64, usize, DVec2)> = None;
        for &c in candidates {
            let corners = mesh.corner_positions(c as usize);
            for k in 0..4 {
                let (a, d) = (corners[k], corners[(k + 1) % 4] - corners[k]);
                let length_sq = d.length_squared();
                if length_sq > 0.0 {
                    let foot = a + d * (d.dot(point - a) / length_sq).clamp(0.0, 1.0);
                    let distance = foot.distance(point);
                    if distance <= self.slack && nearest.is_none_or(|n| distance < n.0) {
                        nearest = Some((distance, c as usize, foot));
                    }
                }
            }
        }
        nearest.map(|(_, c, foot)| (c, clamped(mesh, c, mesh.reference(c, foot))))
    }
}

/// Reference coordinates moved into the reference cell, from where rounding has put them.
fn clamped(mesh: &CellMesh, c: usize, [s, t]: [f64; 2]) -> [f64; 2] {
    let [s, t] = [s.clamp(0.0, 1.0), t.clamp(0.0, 1.0)];
    let most = if mesh.cells[c].is_quadrilateral() {
        1.0
    } else {
        1.0 - s
    };
    [s, t.min(most)]
}
