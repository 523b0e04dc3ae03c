//! The depth buffer, and the exact field under every sample.
//!
//! First every element is entered into a depth buffer of 2 × 2 samples per
//! pixel. Then each sample's line of sight is cut with the element it sees,
//! and the element's own polynomial is evaluated there: the picture shows the
//! field as computed, not an interpolation of it between corners.

use antumbra_geom::{DVec2, DVec3, dvec2};

use super::colormap::{ColorMap, Scale};
use super::view::Camera;
use crate::model::{MeshedScene, SurfaceMesh};
use crate::write::lattice::{Basis, MAX_NODES, QuadBasis};

/// Nothing is seen here.
const NOTHING: u32 = u32::MAX;
/// Surfaces without values.
const NO_VALUE: [f64; 3] = [0.32, 0.33, 0.35];
/// Half the width of an isolux line, in pixels.
const ISOLUX_HALF_WIDTH: f64 = 0.6;

/// An element in the buffer.
#[derive(Clone, Copy, Debug)]
struct Entry {
    surface: u32,
    /// Where its nodes start in the surface's list: of triangles, or of quadrilaterals.
    start: u32,
    is_quad: bool,
}

/// What is seen in every sample.
#[derive(Debug)]
pub(super) struct DepthBuffer<'a> {
    scene: &'a MeshedScene,
    camera: Camera,
    /// Samples per pixel, each way.
    n_sub: usize,
    width: usize,
    height: usize,
    entries: Vec<Entry>,
    /// Greater is nearer: 1/distance, or minus the distance without perspective.
    nearness: Vec<f64>,
    seen: Vec<u32>,
}

impl<'a> DepthBuffer<'a> {
    /// Enters the fronts of all surfaces for which `is_shown`.
    pub(super) fn new(
        scene: &'a MeshedScene,
        camera: Camera,
        size: (usize, usize),
        n_sub: usize,
        is_shown: impl Fn(usize) -> bool,
    ) -> Self {
        let (width, height) = (size.0 * n_sub, size.1 * n_sub);
        let mut buffer = Self {
            scene,
            camera,
            n_sub,
            width,
            height,
            entries: Vec::new(),
            nearness: vec![f64::NEG_INFINITY; width * height],
            seen: vec![NOTHING; width * height],
        };
        for (i, surface) in scene.surfaces.iter().enumerate() {
            if is_shown(i) && camera.sees_front(surface) {
                buffer.enter(i, surface);
            }
        }
        buffer
    }

    fn enter(&mut self, index: usize, surface: &SurfaceMesh) {
        let mut starts = [0, 0];
        for (element, is_quad) in surface.each_element() {
            let n_corners = if is_quad { 4 } else { 3 };
            let corners: Vec<DVec3> = element[..n_corners]
                .iter()
                .map(|&n| surface.nodes[n as usize])
                .collect();
            let start = &mut starts[usize::from(is_quad)];
            let id = self.entries.len() as u32;
            self.entries.push(Entry {
                surface: index as u32,
                start: *start as u32,
                is_quad,
            });
            *start += element.len();
            self.fill(id, &corners, surface.normal);
        }
    }

    /// Row by row, the samples between the outline's left and right.
    fn fill(&mut self, id: u32, corners: &[DVec3], normal: DVec3) {
        let camera = self.camera;
        let local: Vec<DVec3> = corners.iter().map(|&p| camera.local(p)).collect();
        let polygon = clip_near(&local, &camera);
        let n_sub = self.n_sub as f64;
        let outline: Vec<DVec2> = polygon.iter().map(|&p| camera.pixel(p) * n_sub).collect();
        let Some(low) = outline.iter().copied().reduce(DVec2::min) else {
            return;
        };
        let high = outline.iter().copied().fold(low, DVec2::max);

        let height_over_plane = normal.dot(corners[0] - camera.eye);
        for row in centres(low.y, high.y, self.height) {
            let y = row as f64 + 0.5;
            let Some((left, right)) = span(&outline, y) else {
                continue;
            };
            for column in centres(left, right, self.width) {
                let pixel = dvec2(column as f64 + 0.5, y) / n_sub;
                let (from, along) = camera.sight(pixel);
                let nearness = if camera.is_perspective {
                    normal.dot(along) / height_over_plane
                } else {
                    -normal.dot(corners[0] - from) / normal.dot(along)
                };
                let sample = row * self.width + column;
                if nearness > self.nearness[sample] {
                    self.nearness[sample] = nearness;
                    self.seen[sample] = id;
                }
            }
        }
    }

    /// Is a point at this distance in front of the eye hidden at a pixel? Not
    /// if it is on, or next to the edge of, what is seen there.
    pub(super) fn hides(&self, x: usize, y: usize, distance: f64) -> bool {
        let point = if self.camera.is_perspective {
            1.0 / distance
        } else {
            -distance
        };
        let slack = point.abs() * 2e-3;
        let n = self.n_sub;
        let rows = (y * n).saturating_sub(n)..((y + 2) * n).min(self.height);
        rows.flat_map(|row| {
            let columns = (x * n).saturating_sub(n)..((x + 2) * n).min(self.width);
            columns.map(move |column| row * self.width + column)
        })
        .all(|sample| self.nearness[sample] > point + slack)
    }

    /// The surface seen in a sample.
    pub(super) fn surface_at(&self, sample: usize) -> Option<usize> {
        let entry = self.entries.get(self.seen[sample] as usize)?;
        Some(entry.surface as usize)
    }

    pub(super) fn n_samples(&self) -> usize {
        self.seen.len()
    }

    /// The samples of pixel `(x, y)`.
    pub(super) fn pixel_samples(&self, x: usize, y: usize) -> impl Iterator<Item = usize> + '_ {
        let n = self.n_sub;
        let row_samples =
            move |row| (x * n..(x + 1) * n).map(move |column| row * self.width + column);
        (y * n..(y + 1) * n).flat_map(row_samples)
    }

    /// Value in a sample, and how much it changes per pixel to the right and down.
    pub(super) fn value(&self, sample: usize, shader: &Shader<'_>) -> Option<(f64, DVec2)> {
        let entry = self.entries.get(self.seen[sample] as usize)?;
        let surface = &self.scene.surfaces[entry.surface as usize];
        let values = &shader.values[entry.surface as usize];
        if values.is_empty() {
            return None;
        }
        let degree = usize::from(surface.degree) - 1;
        let (basis, quad_basis) = (&shader.bases[degree], &shader.quad_bases[degree]);
        let start = entry.start as usize;
        let element = if entry.is_quad {
            &surface.quads[start..start + quad_basis.n_nodes()]
        } else {
            &surface.elements[start..start + basis.n_nodes()]
        };
        let mut of_nodes = [0.0; MAX_NODES];
        for (value, &node) in of_nodes.iter_mut().zip(element) {
            *value = values[node as usize];
        }
        let of_nodes = &of_nodes[..element.len()];

        // The point that is seen, and its neighbours one pixel on.
        let corners = [0, 1, 2].map(|k| surface.nodes[element[k] as usize]);
        let normal = surface.normal;
        let column = (sample % self.width) as f64 + 0.5;
        let row = (sample / self.width) as f64 + 0.5;
        let pixel = dvec2(column, row) / self.n_sub as f64;
        let point_at = |pixel: DVec2| {
            let (from, along) = self.camera.sight(pixel);
            from + along * (normal.dot(corners[0] - from) / normal.dot(along))
        };
        let half = 0.5;
        let (value, gradient) = if entry.is_quad {
            let corners = [0, 1, 2, 3].map(|k| surface.nodes[element[k] as usize]);
            let at = |pixel| in_square(corners, normal, point_at(pixel));
            let (value, derivative) = quad_basis.evaluate(at(pixel), of_nodes);
            let slope = |step: DVec2| {
                let (ahead, behind) = (at(pixel + step * half), at(pixel - step * half));
                (0..2).map(|k| derivative[k] * (ahead[k] - behind[k])).sum()
            };
            (value, dvec2(slope(DVec2::X), slope(DVec2::Y)))
        } else {
            let at = |pixel| barycentric(corners, normal, point_at(pixel));
            let (value, derivative) = basis.evaluate(at(pixel), of_nodes);
            let slope = |step: DVec2| {
                let (ahead, behind) = (at(pixel + step * half), at(pixel - step * half));
                (0..3).map(|k| derivative[k] * (ahead[k] - behind[k])).sum()
            };
            (value, dvec2(slope(DVec2::X), slope(DVec2::Y)))
        };
        value.is_finite().then_some((value, gradient))
    }

    /// Colour of a sample; `None` where nothing is seen.
    pub(super) fn color(&self, sample: usize, shader: &Shader<'_>) -> Option<[f64; 3]> {
        if self.seen[sample] == NOTHING {
            return None;
        }
        let Some((value, gradient)) = self.value(sample, shader) else {
            return Some(NO_VALUE);
        };
        let fraction = shader.scale.fraction(value);
        let mut color = shader.color_map.rgb(fraction);
        if shader.isolux {
            let opacity = isolux(shader.scale, value, gradient.length(), self.n_sub as f64);
            // Light on dark and dark on light.
            let (line, strength) = if is_light(color) {
                (0.05, 0.6)
            } else {
                (1.0, 0.7)
            };
            color = color.map(|c| c + (line - c) * opacity * strength);
        }
        Some(color)
    }
}

/// What the samples' colours depend on.
#[derive(Debug)]
pub(super) struct Shader<'a> {
    /// Node values of every surface.
    pub(super) values: &'a [Vec<f64>],
    pub(super) bases: [Basis; 4],
    pub(super) quad_bases: [QuadBasis; 4],
    pub(super) scale: Scale,
    pub(super) color_map: ColorMap,
    pub(super) isolux: bool,
}

/// Would a dark line show better on this colour than a light one?
pub(super) fn is_light(color: [f64; 3]) -> bool {
    0.3 * color[0] + 0.6 * color[1] + 0.1 * color[2] > 0.55
}

/// How much of a sample the nearest isolux line covers, `slope` being the
/// value's change per pixel.
fn isolux(scale: Scale, value: f64, slope: f64, n_sub: f64) -> f64 {
    // On a plateau every point is as near to the level as any other: no line.
    if slope < 1e-4 * scale.step {
        return 0.0;
    }
    let level = (value / scale.step).round() * scale.step;
    let slack = 1e-6 * scale.step;
    if level <= scale.min + slack || level > scale.max + slack {
        return 0.0;
    }
    let distance = (value - level).abs() / slope;
    let coverage = ((ISOLUX_HALF_WIDTH - distance) * n_sub + 0.5).clamp(0.0, 1.0);
    // Where lines crowd together they give way to the colours.
    let spacing = scale.step / slope;
    coverage * ((spacing - 1.5) / 3.0).clamp(0.0, 1.0)
}

fn barycentric([a, b, c]: [DVec3; 3], normal: DVec3, p: DVec3) -> [f64; 3] {
    let area = (b - a).cross(c - a).dot(normal);
    let at_b = (p - a).cross(c - a).dot(normal) / area;
    let at_c = (b - a).cross(p - a).dot(normal) / area;
    [1.0 - at_b - at_c, at_b, at_c]
}

/// Where a point is in the unit square that a bilinear map takes to a quadrilateral.
fn in_square([a, b, c, d]: [DVec3; 4], normal: DVec3, p: DVec3) -> [f64; 2] {
    let cross = |u: DVec3, v: DVec3| u.cross(v).dot(normal);
    let (u, v, w) = (b - a, d - a, a - b + c - d);
    let (mut s, mut t) = (0.5, 0.5);
    // Newton's iteration; of a parallelogram one step is exact.
    for _ in 0..8 {
        let rest = p - (a + u * s + v * t + w * (s * t));
        let (along_s, along_t) = (u + w * t, v + w * s);
        let determinant = cross(along_s, along_t);
        s = (s + cross(rest, along_t) / determinant).clamp(-2.0, 3.0);
        t = (t + cross(along_s, rest) / determinant).clamp(-2.0, 3.0);
    }
    [s, t]
}

/// The part of a polygon, in local coordinates, that is not too near.
fn clip_near(polygon: &[DVec3], camera: &Camera) -> Vec<DVec3> {
    let near = camera.near;
    if !camera.is_perspective || polygon.iter().all(|p| p.z >= near) {
        return polygon.to_vec();
    }
    let mut clipped = Vec::new();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        if p.z >= near {
            clipped.push(p);
        }
        if (p.z >= near) != (q.z >= near) {
            clipped.push(p.lerp(q, (near - p.z) / (q.z - p.z)));
        }
    }
    clipped
}

/// The ends of a segment, in local coordinates, cut to what is not too near,
/// each with its fraction of the length.
pub(super) fn clip_segment(a: DVec3, b: DVec3, camera: &Camera) -> Option<[DVec3; 2]> {
    let near = camera.near;
    if !camera.is_perspective || (a.z >= near && b.z >= near) {
        return Some([a, b]);
    }
    if a.z < near && b.z < near {
        return None;
    }
    let cut = a.lerp(b, (near - a.z) / (b.z - a.z));
    Some(if a.z < near { [cut, b] } else { [a, cut] })
}

/// Rows or columns whose centres lie between, a hair's breadth more so that
/// neighbours leave no gap.
fn centres(from: f64, to: f64, n: usize) -> std::ops::Range<usize> {
    let hair = 1e-6;
    let clamp = |x: f64| x.clamp(0.0, n as f64) as usize;
    clamp((from - 0.5 - hair).ceil())..clamp((to - 0.5 + hair).floor() + 1.0)
}

/// Where a convex outline crosses a row.
fn span(outline: &[DVec2], y: f64) -> Option<(f64, f64)> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for (i, &p) in outline.iter().enumerate() {
        let q = outline[(i + 1) % outline.len()];
        let (low, high) = (p.y.min(q.y), p.y.max(q.y));
        if y < low - 1e-6 || y > high + 1e-6 {
            continue;
        }
        let t = if q.y == p.y {
            0.0
        } else {
            ((y - p.y) / (q.y - p.y)).clamp(0.0, 1.0)
        };
        let x = p.x + t * (q.x - p.x);
        left = left.min(x);
        right = right.max(x);
    }
    (left <= right).then_some((left, right))
}
