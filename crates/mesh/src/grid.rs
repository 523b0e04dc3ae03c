//! A uniform bucket grid: which things are near a point or a segment.
//!
//! The grid only proposes candidates, so it may compute in floating point: it
//! visits at least the cells it has to.

use antumbra_geom::bounding_box;
use glam::DVec2;

/// Things (numbered from zero) in square cells.
#[derive(Clone, Debug)]
pub struct Grid {
    min: DVec2,
    cell: f64,
    size: [usize; 2],
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Grid {
    /// Lays out about `2 n` cells over the box; nothing is in them yet.
    fn empty(min: DVec2, max: DVec2, n: usize) -> Self {
        let extent = (max - min).max(DVec2::ZERO);
        let target = (2 * n).clamp(1, 1 << 22) as f64;
        let area_cell = (extent.x * extent.y / target).sqrt();
        let cell = area_cell.max(extent.max_element() / target);
        let cell = if cell > 0.0 { cell } else { 1.0 };
        let size = [extent.x, extent.y].map(|e| (e / cell) as usize + 1);
        Self {
            min,
            cell,
            size,
            starts: Vec::new(),
            items: Vec::new(),
        }
    }

    /// A grid over the box of `corners`, where `cells_of` tells for each of `n`
    /// things the cells it is in.
    pub(crate) fn new(
        corners: impl Iterator<Item = DVec2>,
        n: usize,
        cells_of: impl Fn(&Self, usize, &mut dyn FnMut(usize)),
    ) -> Self {
        let [mut min, mut max] = bounding_box(corners);
        if min.x > max.x {
            (min, max) = (DVec2::ZERO, DVec2::ZERO);
        }
        let mut grid = Self::empty(min, max, n);

        // Count, then fill: the cells' lists lie in one array.
        let mut starts = vec![0_u32; grid.size[0] * grid.size[1] + 1];
        for i in 0..n {
            cells_of(&grid, i, &mut |cell| starts[cell + 1] += 1);
        }
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut next = starts.clone();
        let mut items = vec![0; *starts.last().unwrap_or(&0) as usize];
        for i in 0..n {
            cells_of(&grid, i, &mut |cell| {
                items[next[cell] as usize] = i as u32;
                next[cell] += 1;
            });
        }
        grid.starts = starts;
        grid.items = items;
        grid
    }

    /// A grid of points.
    pub(crate) fn of_points(points: &[DVec2]) -> Self {
        Self::new(points.iter().copied(), points.len(), |grid, i, visit| {
            visit(grid.cell_of(points[i]));
        })
    }

    /// A grid of segments, each in all cells nearer than `margin`.
    #[must_use]
    pub fn of_segments(segments: &[[DVec2; 2]], margin: f64) -> Self {
        let corners = segments.iter().flatten().copied();
        Self::new(corners, segments.len(), |grid, i, visit| {
            grid.walk(segments[i][0], segments[i][1], margin, visit);
        })
    }

    /// How many cells there are.
    pub(crate) fn n_cells(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// What is in a cell, in ascending order.
    #[must_use]
    pub fn items(&self, cell: usize) -> &[u32] {
        &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// The cell of a point; of a point outside, the nearest cell at the border.
    #[must_use]
    pub fn cell_of(&self, p: DVec2) -> usize {
        self.row(1, p.y) * self.size[0] + self.row(0, p.x)
    }

    /// The row (axis 1) or column (axis 0) of a coordinate.
    pub(crate) fn row(&self, axis: usize, x: f64) -> usize {
        // The cast saturates: below the box is row zero.
        (((x - self.min[axis]) / self.cell) as usize).min(self.size[axis] - 1)
    }

    /// Where a row or column begins.
    pub(crate) fn row_start(&self, axis: usize, row: usize) -> f64 {
        self.min[axis] + row as f64 * self.cell
    }

    /// The cell in a column and a row.
    pub(crate) fn cell(&self, column: usize, row: usize) -> usize {
        row * self.size[0] + column
    }

    /// Visits all cells nearer to the segment than `margin`, and perhaps some more.
    pub(crate) fn walk(&self, a: DVec2, b: DVec2, margin: f64, visit: &mut dyn FnMut(usize)) {
        // Step along the longer axis; in each column the segment spans few rows.
        let d = b - a;
        let (major, minor) = if d.x.abs() >= d.y.abs() {
            (0, 1)
        } else {
            (1, 0)
        };
        let (a, b) = if d[major] >= 0.0 { (a, b) } else { (b, a) };
        let d = b - a;
        let slope = if d[major] > 0.0 {
            d[minor] / d[major]
        } else {
            0.0
        };
        // Rounding, of coordinates which are up to 2^53 times smaller than this.
        let margin = margin + 1e-12 * (self.cell + a.abs().max(b.abs()).max_element());
        let (first, last) = (
            self.row(major, a[major] - margin),
            self.row(major, b[major] + margin),
        );
        for column in first..=last {
            let from = (self.row_start(major, column) - margin).clamp(a[major], b[major]);
            let to = (self.row_start(major, column + 1) + margin).clamp(a[major], b[major]);
            let ends = [from, to].map(|x| a[minor] + slope * (x - a[major]));
            let low = self.row(minor, ends[0].min(ends[1]) - margin);
            let high = self.row(minor, ends[0].max(ends[1]) + margin);
            for row in low..=high {
                visit(if major == 0 {
                    self.cell(column, row)
                } else {
                    self.cell(row, column)
                });
            }
        }
    }
}
