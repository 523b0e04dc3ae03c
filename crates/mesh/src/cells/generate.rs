//! Meshes of polygons at a given size.

use super::forest::{CellForest, Rule};
use super::strip::{Border, Region, RegionEdge};
use super::{Cell, CellMesh, Midpoints};
use crate::trimesh::{MeshError, ascending};
use antumbra_geom::bounding_box;
use glam::{DVec2, dvec2};
use std::collections::HashMap;

/// What cells a mesh is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellShape {
    /// Triangles, as equilateral as the border allows.
    Triangles,
    /// Quadrilaterals alone: squares, and in a strip along borders that are not parallel
    /// to the longest one, quadrilaterals that three of make a triangle.
    Quadrilaterals,
    /// Squares, and triangles in a strip along such borders.
    Mixed,
}

/// Cells nearer to the border than this many sizes are left to the strip of triangles.
const MARGIN: f64 = 0.4;

/// Coordinates of a rectilinear polygon nearer than this many sizes make cells too thin:
/// such polygons are meshed like others.
const THINNEST: f64 = 0.25;

/// Rectangles of a thin polygon are no longer than this many of its widths...
const LONGEST: f64 = 2.0;

/// ... unless there would be more than this many for that reason alone.
const MOST_IN_A_ROW: f64 = 64.0;

/// A mesh of a polygon whose cells have about the given size everywhere.
///
/// * `border` — the outline counter-clockwise and the holes, in the chart.
/// * `size` — the length of edges.
///
/// The grid is parallel to the longest edge of the border. Polygons whose edges are all
/// parallel or perpendicular to it (a rectangle, an L) become rectangles alone.
///
/// The mesh conforms: it has no T-vertices, and its border is the polygon's.
///
/// # Errors
///
/// [`MeshError`] if the polygon has no area, or its border cannot be triangulated.
pub fn uniform(border: &[Vec<DVec2>], size: f64, shape: CellShape) -> Result<CellMesh, MeshError> {
    let outline = Border::new(border)?;
    let frame = Frame::along(outline.base());
    if shape != CellShape::Triangles
        && let Some(mesh) = rectilinear(border, &frame, size)
    {
        return Ok(mesh);
    }
    match shape {
        CellShape::Triangles => triangles(&outline, size),
        CellShape::Mixed => mixed(&outline, size),
        // Every cell becomes quadrilaterals of about half its size.
        CellShape::Quadrilaterals => Ok(quadrilaterals(mixed(&outline, 2.0 * size)?)),
    }
}

/// A mesh of a polygon whose cells have about the size that is wanted where they are.
///
/// Starts with [`uniform`] at `size` and quarters cells that are larger than what is
/// wanted at their centre. Where sizes change, quadrilaterals have T-vertices
/// ([`Rule::Restricted`]); the other shapes have none ([`Rule::Triangulated`]).
///
/// * `size` — the largest cells.
/// * `size_at` — the length of edges wanted at a place of the chart.
/// * `most_levels` — cells are quartered no more often than this.
///
/// # Errors
///
/// As [`uniform`].
pub fn graded(
    border: &[Vec<DVec2>],
    size: f64,
    size_at: &dyn Fn(DVec2) -> f64,
    most_levels: u8,
    shape: CellShape,
) -> Result<CellForest, MeshError> {
    let rule = match shape {
        CellShape::Quadrilaterals => Rule::Restricted,
        CellShape::Triangles | CellShape::Mixed => Rule::Triangulated,
    };
    let mut forest = CellForest::new(uniform(border, size, shape)?, rule);
    for _ in 0..most_levels {
        let (mesh, leaves) = forest.mesh();
        let large: Vec<u32> = (0..mesh.cells.len())
            .filter(|&c| {
                // What is nominally of the size has edges up to a third longer.
                mesh.cells[c].level < most_levels
                    && mesh.area(c).sqrt() > 1.0 / 0.75 * size_at(mesh.centre(c)) * unit(&mesh, c)
            })
            .map(|c| leaves[c])
            .collect();
        if large.is_empty() {
            break;
        }
        forest.refine(&large);
    }
    Ok(forest)
}

/// The root of the area of a cell with edges of length 1.
fn unit(mesh: &CellMesh, c: usize) -> f64 {
    if mesh.cells[c].is_quadrilateral() {
        1.0
    } else {
        (3f64.sqrt() / 4.0).sqrt()
    }
}

/// A frame along an edge.
struct Frame {
    origin: DVec2,
    along: DVec2,
}

impl Frame {
    fn along([a, b]: [DVec2; 2]) -> Self {
        Self {
            origin: a,
            along: (b - a).normalize_or(DVec2::X),
        }
    }

    fn to_frame(&self, p: DVec2) -> DVec2 {
        let d = p - self.origin;
        dvec2(self.along.dot(d), self.along.perp_dot(d))
    }

    fn to_chart(&self, p: DVec2) -> DVec2 {
        self.origin + self.along * p.x + self.along.perp() * p.y
    }
}

/// Rectangles, if the border runs along the frame's axes everywhere and no two of its
/// coordinates are too near each other.
fn rectilinear(border: &[Vec<DVec2>], frame: &Frame, size: f64) -> Option<CellMesh> {
    let local: Vec<Vec<DVec2>> = border
        .iter()
        .map(|l| l.iter().map(|&p| frame.to_frame(p)).collect())
        .collect();
    let corners = || local.iter().flatten().copied();
    let [min, max] = bounding_box(corners());
    let rounding = 1e-11 * (max - min).max_element();
    let is_along_axis = |l: &Vec<DVec2>| {
        (0..l.len()).all(|i| (l[(i + 1) % l.len()] - l[i]).abs().min_element() <= rounding)
    };
    if !local.iter().all(is_along_axis) {
        return None;
    }
    // A thin rectangle is cut across, so that its cells are no longer than twice as wide,
    // unless it is a sliver.
    let extent = max - min;
    let size = size
        .min(LONGEST * extent.min_element())
        .max(size.min(extent.max_element() / MOST_IN_A_ROW));
    let mut lines: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for (axis, lines) in lines.iter_mut().enumerate() {
        let mut values: Vec<f64> = corners().map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        values.dedup_by(|b, a| *b - *a <= rounding);
        let extent = max[axis] - min[axis];
        for pair in values.windows(2) {
            let gap = pair[1] - pair[0];
            // A whole side may be thin, for then the polygon is.
            if gap < THINNEST * size.min(extent) {
                return None;
            }
            let n = (gap / size - 1e-9).ceil().max(1.0);
            lines.extend((0..n as usize).map(|i| pair[0] + gap * (i as f64 / n)));
        }
        lines.extend(values.last());
    }
    let [xs, ys] = lines;
    let mut mesh = Vec::new();
    let mut vertices: Vec<DVec2> = Vec::new();
    let mut ids: HashMap<(usize, usize), u32> = HashMap::new();
    // Corners of the border are where the scene has them, to the last bit.
    let exact: Vec<(DVec2, DVec2)> = corners().zip(border.iter().flatten().copied()).collect();
    let mut vertex = |i: usize, j: usize, vertices: &mut Vec<DVec2>| {
        *ids.entry((i, j)).or_insert_with(|| {
            let p = dvec2(xs[i], ys[j]);
            let corner = exact
                .iter()
                .find(|c| (c.0 - p).abs().max_element() <= 2.0 * rounding);
            vertices.push(corner.map_or_else(|| frame.to_chart(p), |c| c.1));
            vertices.len() as u32 - 1
        })
    };
    for j in 0..ys.len() - 1 {
        for i in 0..xs.len() - 1 {
            let middle = dvec2(xs[i] + xs[i + 1], ys[j] + ys[j + 1]) / 2.0;
            if antumbra_geom::point_in_polygon(middle, local.iter().map(Vec::as_slice)) {
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let corners = corners.map(|(i, j)| vertex(i, j, &mut vertices));
                mesh.push(Cell::quadrilateral(corners, 0));
            }
        }
    }
    (!mesh.is_empty()).then(|| CellMesh::new(vertices, mesh, &Midpoints::new()))
}

/// The length of edges that divides the longest edge of the border evenly.
fn even(border: &Border, size: f64) -> f64 {
    let [a, b] = border.ends(border.longest());
    a.distance(b) / (a.distance(b) / size - 1e-9).ceil().max(1.0)
}

/// The box of the border in a frame.
fn extent(border: &Border, frame: &Frame) -> [DVec2; 2] {
    let used = border.edges.iter().flatten();
    bounding_box(used.map(|&v| frame.to_frame(border.points[v as usize])))
}

/// Triangles: border points at the spacing, inside a lattice of equilateral triangles.
fn triangles(border: &Border, size: f64) -> Result<CellMesh, MeshError> {
    let size = even(border, size);
    let frame = Frame::along(border.base());
    let mut region = border.divided(size);
    let [min, max] = extent(border, &frame);
    let row = size * 3f64.sqrt() / 2.0;
    for j in (min.y / row).floor() as i64..=(max.y / row).ceil() as i64 {
        let shift = if j.rem_euclid(2) == 1 { 0.5 } else { 0.0 };
        for i in (min.x / size).floor() as i64 - 1..=(max.x / size).ceil() as i64 {
            let p = frame.to_chart(dvec2((i as f64 + shift) * size, j as f64 * row));
            if border.contains(p) && border.distance(p) >= 0.5 * size {
                region.points.push(p);
            }
        }
    }
    let triangles = region.filled(&|p| border.contains(p))?;
    let cells = triangles
        .into_iter()
        .map(|t| Cell::triangle(t, 0))
        .collect();
    compact(region.points, cells)
}

/// Squares inside, triangles between them and the border.
fn mixed(border: &Border, size: f64) -> Result<CellMesh, MeshError> {
    let size = even(border, size);
    let longest = border.longest();
    let frame = Frame::along(border.base());
    let mut region = border.divided(size);
    let n_border = region.points.len();
    let [min, max] = extent(border, &frame);
    let local: Vec<[DVec2; 2]> = (0..border.edges.len())
        .map(|e| border.ends(e).map(|p| frame.to_frame(p)))
        .collect();
    let length = local[longest][0].x.max(local[longest][1].x);
    // A square may stand on the longest edge, whose parts are as long as its sides, if
    // no narrow place has divided them.
    let n_parts = (length / size).round() as usize;
    let on_longest = (0..region.edges.len())
        .filter(|&e| {
            let ends = region.edges[e].ends;
            let ends = ends.map(|v| frame.to_frame(region.points[v as usize]));
            ends.iter().all(|p| {
                p.y.abs() <= 1e-9 * size && p.x >= -1e-9 * size && p.x <= length * (1.0 + 1e-9)
            })
        })
        .count();
    let is_even = on_longest == n_parts;
    let keeps = |i: i64, j: i64| {
        let low = dvec2(i as f64, j as f64) * size;
        let high = low + size;
        let stands = is_even && j == 0 && i >= 0 && (i as usize) < n_parts;
        border.contains(frame.to_chart((low + high) / 2.0))
            && local.iter().enumerate().all(|(e, &ends)| {
                (e == longest && stands) || !passes_near(ends, low, high, MARGIN * size)
            })
    };
    let mut squares: Vec<(i64, i64)> = Vec::new();
    for j in (min.y / size).floor() as i64..=(max.y / size).ceil() as i64 {
        for i in (min.x / size).floor() as i64..=(max.x / size).ceil() as i64 {
            if keeps(i, j) {
                squares.push((i, j));
            }
        }
    }
    // Their corners; on the border those that are there already.
    let mut ids: HashMap<(i64, i64), u32> = HashMap::new();
    for v in 0..n_border {
        let p = frame.to_frame(region.points[v]) / size;
        let place = p.round();
        if is_even && place.y == 0.0 && (p - place).abs().max_element() <= 1e-7 {
            ids.insert((place.x as i64, 0), v as u32);
        }
    }
    let mut cells = Vec::new();
    let mut sides: Vec<[u32; 2]> = Vec::new();
    for &(i, j) in &squares {
        let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| {
            *ids.entry((i, j)).or_insert_with(|| {
                let p = dvec2(i as f64, j as f64) * size;
                region.points.push(frame.to_chart(p));
                region.points.len() as u32 - 1
            })
        });
        let cell = Cell::quadrilateral(corners, 0);
        sides.extend((0..4).map(|k| {
            let [a, b] = cell.edge(k);
            ascending(a, b)
        }));
        cells.push(cell);
    }
    bound(&mut region, &mut sides);
    if !region.edges.is_empty() {
        let kept: std::collections::HashSet<(i64, i64)> = squares.into_iter().collect();
        let is_free = |p: DVec2| {
            let at = (frame.to_frame(p) / size).floor();
            border.contains(p) && !kept.contains(&(at.x as i64, at.y as i64))
        };
        let triangles = region.filled(&is_free)?;
        cells.extend(triangles.into_iter().map(|t| Cell::triangle(t, 0)));
    }
    compact(region.points, cells)
}

/// Takes the squares out of a region: sides that two of them share are inside, one that
/// is on the border bounds nothing any more, and the others become bounds.
fn bound(region: &mut Region, sides: &mut [[u32; 2]]) {
    sides.sort_unstable();
    let single: Vec<[u32; 2]> = sides
        .chunk_by(|a, b| a == b)
        .filter(|same| same.len() == 1)
        .map(|same| same[0])
        .collect();
    let is_single = |[a, b]: [u32; 2]| single.binary_search(&ascending(a, b)).is_ok();
    let mut on_border: Vec<[u32; 2]> = region
        .edges
        .iter()
        .map(|e| ascending(e.ends[0], e.ends[1]))
        .collect();
    on_border.sort_unstable();
    region.edges.retain(|e| !is_single(e.ends));
    region.edges.extend(
        single
            .iter()
            .filter(|side| on_border.binary_search(side).is_err())
            .map(|&ends| RegionEdge {
                ends,
                is_fixed: true,
            }),
    );
}

/// Does a segment come nearer to a box than `margin`? Conservative at its corners.
fn passes_near([p, q]: [DVec2; 2], low: DVec2, high: DVec2, margin: f64) -> bool {
    let (low, high) = (low - margin, high + margin);
    // The part of the segment in the larger box.
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let (a, d) = (p[axis], q[axis] - p[axis]);
        if d.abs() < f64::MIN_POSITIVE {
            if a <= low[axis] || a >= high[axis] {
                return false;
            }
            continue;
        }
        let (s, t) = ((low[axis] - a) / d, (high[axis] - a) / d);
        from = from.max(s.min(t));
        to = to.min(s.max(t));
    }
    from < to
}

/// Three quadrilaterals of every triangle and four of every quadrilateral: corners, the
/// middles of edges, and the centre.
fn quadrilaterals(mesh: CellMesh) -> CellMesh {
    let mut vertices = mesh.vertices;
    let mut midpoints: HashMap<[u32; 2], u32> = HashMap::new();
    let mut cells = Vec::with_capacity(4 * mesh.cells.len());
    for cell in &mesh.cells {
        let n = cell.corners().len();
        let positions = cell.corners().iter().map(|&v| vertices[v as usize]);
        let centre = positions.sum::<DVec2>() / n as f64;
        let m = vertices.len() as u32;
        vertices.push(centre);
        let middles: Vec<u32> = (0..n)
            .map(|k| {
                let [a, b] = cell.edge(k);
                *midpoints.entry(ascending(a, b)).or_insert_with(|| {
                    let p = (vertices[a as usize] + vertices[b as usize]) / 2.0;
                    vertices.push(p);
                    vertices.len() as u32 - 1
                })
            })
            .collect();
        for k in 0..n {
            let corners = [cell.corners()[k], middles[k], m, middles[(k + n - 1) % n]];
            cells.push(Cell::quadrilateral(corners, 0));
        }
    }
    CellMesh::new(vertices, cells, &Midpoints::new())
}

/// A mesh of the vertices that cells have.
fn compact(points: Vec<DVec2>, cells: Vec<Cell>) -> Result<CellMesh, MeshError> {
    if cells.is_empty() {
        return Err(MeshError::NoArea { n_edges: 0 });
    }
    let mut ids = vec![u32::MAX; points.len()];
    for &v in cells.iter().flat_map(Cell::corners) {
        ids[v as usize] = 0;
    }
    let mut vertices = Vec::new();
    for (id, p) in ids.iter_mut().zip(points) {
        if *id == 0 {
            *id = vertices.len() as u32;
            vertices.push(p);
        }
    }
    let cells = cells
        .into_iter()
        .map(|mut cell| {
            let n = cell.corners().len();
            for v in &mut cell.corners[..n] {
                *v = ids[*v as usize];
            }
            cell
        })
        .collect();
    Ok(CellMesh::new(vertices, cells, &Midpoints::new()))
}
