//! What to show and from where: options, the guess of what is up, cameras.

use antumbra_geom::{DVec2, DVec3, dvec2};

use super::band::Band;
use super::colormap::ColorMap;
use crate::model::{MeshedScene, SurfaceMesh};

/// A side of the scene to look from.
///
/// With z up, the front is towards −y; with y up, towards +z. Right is +x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// From the front.
    Front,
    /// From behind.
    Back,
    /// From the left.
    Left,
    /// From the right.
    Right,
    /// From above.
    Top,
    /// From below.
    Bottom,
}

/// From where the scene is seen.
///
/// Surfaces whose back is turned to the viewer are not drawn, except for their
/// outlines: one looks into a room through its walls.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum View {
    /// From slightly above, in the direction that shows most of the light.
    #[default]
    Auto,
    /// The whole scene from one side.
    Named(Side),
    /// A perspective view, in file length units.
    Camera {
        /// Where the viewer is.
        eye: DVec3,
        /// The point in the middle of the picture.
        target: DVec3,
        /// What is up in the picture.
        up: DVec3,
        /// Angle between the upper and the lower edge, in degrees.
        fov_deg: f64,
    },
    /// A map of one surface, seen from its front, by its name or label.
    Surface(String),
}

/// What a picture shows, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureOptions {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Which field; without, the last field of the first surface.
    pub field: Option<String>,
    /// Which number of the field.
    pub band: Band,
    /// Values at both ends of the colours; without, from 0 to the largest
    /// value, rounded up (see [`Scale::of_field`](super::Scale::of_field)).
    pub scale: Option<(f64, f64)>,
    /// The colours.
    pub color_map: ColorMap,
    /// Draw lines of equal value at the legend's ticks.
    pub isolux: bool,
    /// Draw the elements' edges.
    pub mesh: bool,
    /// Draw the mesh edges on curves in the colour of their order.
    pub curves: bool,
    /// From where.
    pub view: View,
    /// What is up; without, a guess from the scene.
    pub up: Option<DVec3>,
    /// Heading; without, the field's name.
    pub title: Option<String>,
}

impl Default for PictureOptions {
    fn default() -> Self {
        Self {
            width: 1600,
            height: 1000,
            field: None,
            band: Band::Luminance,
            scale: None,
            color_map: ColorMap::Viridis,
            isolux: true,
            mesh: false,
            curves: false,
            view: View::Auto,
            up: None,
            title: None,
        }
    }
}

/// Directions in space of the two axes of `nodes_2d`, from the largest element.
pub(crate) fn chart_axes(surface: &SurfaceMesh) -> Option<[DVec3; 2]> {
    let edges = |element: &[u32]| {
        let [a, b, c] = [0, 1, 2].map(|k| element[k] as usize);
        let flat = [b, c].map(|n| surface.nodes_2d[n] - surface.nodes_2d[a]);
        let solid = [b, c].map(|n| surface.nodes[n] - surface.nodes[a]);
        (flat, solid)
    };
    let elements = surface.each_element().map(|e| e.0);
    let largest = elements.max_by(|a, b| {
        let area = |e: &[u32]| edges(e).0[0].perp_dot(edges(e).0[1]).abs();
        area(a).total_cmp(&area(b))
    })?;
    let ([p, q], [u, v]) = edges(largest);
    let area = p.perp_dot(q);
    let x_axis = ((u * q.y - v * p.y) / area).try_normalize()?;
    let y_axis = ((v * p.x - u * q.x) / area).try_normalize()?;
    Some([x_axis, y_axis])
}

/// What is probably up: the front of a floor by that name, otherwise the axis
/// that most of the scene's area is square to; in doubt z, then y.
pub(super) fn guess_up(scene: &MeshedScene) -> DVec3 {
    for surface in &scene.surfaces {
        let name = surface.name.to_lowercase();
        let is_floor = name.contains("floor") || name.contains("ground");
        let normal = surface.normal;
        if is_floor && !surface.is_back && normal.abs().max_element() > 0.99 {
            return main_axis(normal);
        }
    }
    let mut best = (DVec3::Z, 0.0);
    for axis in [DVec3::Z, DVec3::Y, DVec3::X] {
        let is_square = |s: &&SurfaceMesh| s.normal.dot(axis).abs() > 0.99;
        let area: f64 = scene.surfaces.iter().filter(is_square).map(area).sum();
        if area > best.1 * (1.0 + 1e-9) {
            best = (axis, area);
        }
    }
    best.0
}

fn main_axis(v: DVec3) -> DVec3 {
    let is_main = |axis: &DVec3| v.dot(*axis) > 0.9;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let axes = axes.into_iter().flat_map(|axis| [axis, -axis]);
    axes.into_iter().find(is_main).unwrap_or(v)
}

fn area(surface: &SurfaceMesh) -> f64 {
    let of_element = |(element, is_quad): (&[u32], bool)| {
        let last = if is_quad { 3 } else { 2 };
        let [a, b, c, d] = [0, 1, 2, last].map(|k| surface.nodes[element[k] as usize]);
        // Half the cross product of the diagonals; of a triangle, d is c.
        (c - a).cross(d - b).length() / 2.0
    };
    surface.each_element().map(of_element).sum()
}

/// Two horizontal directions, to the right and to the front, for a given up.
pub(super) fn right_and_front(up: DVec3) -> (DVec3, DVec3) {
    let right = if up.x.abs() > 0.9 { DVec3::Y } else { DVec3::X };
    let front = right.cross(up).normalize_or(DVec3::Z);
    (up.cross(front), front)
}

/// The part of the picture that the scene may fill, in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) min: DVec2,
    pub(super) max: DVec2,
}

impl Frame {
    fn middle(self) -> DVec2 {
        (self.min + self.max) / 2.0
    }

    pub(super) fn size(self) -> DVec2 {
        self.max - self.min
    }
}

/// From space to pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    pub(super) eye: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    pub(super) forward: DVec3,
    pub(super) is_perspective: bool,
    /// Pixel on the line of sight.
    pub(super) middle: DVec2,
    /// Pixels per length unit: at distance 1, or everywhere without perspective.
    pub(super) zoom: f64,
    /// Nothing nearer is drawn.
    pub(super) near: f64,
}

impl Camera {
    /// Looks along `forward` so that all `points` just fit into the frame.
    pub(super) fn fitted(
        points: &[DVec3],
        forward: DVec3,
        up: DVec3,
        frame: Frame,
        is_perspective: bool,
    ) -> Self {
        let forward = forward.normalize_or(-DVec3::Z);
        let right =
            (forward.cross(up).try_normalize()).unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let local: Vec<DVec3> = (points.iter())
            .map(|p| DVec3::new(p.dot(right), p.dot(up), p.dot(forward)))
            .collect();
        let low = local
            .iter()
            .copied()
            .reduce(DVec3::min)
            .unwrap_or(DVec3::ZERO);
        let high = local
            .iter()
            .copied()
            .reduce(DVec3::max)
            .unwrap_or(DVec3::ONE);
        let size = (high - low).max_element().max(f64::MIN_POSITIVE);
        let camera = |x: f64, y: f64, z: f64, zoom: f64| Self {
            eye: right * x + up * y + forward * z,
            right,
            up,
            forward,
            is_perspective,
            middle: frame.middle(),
            zoom,
            near: size * 1e-4,
        };
        if !is_perspective {
            let zoom = frame.size() / (high - low).truncate().max(DVec2::splat(size * 1e-6));
            let middle = (low + high) / 2.0;
            return camera(middle.x, middle.y, low.z - size, zoom.min_element());
        }

        // In each direction, the narrowest wedge of the given opening around
        // all points; the eye stands where the wider of the two has its edge.
        let zoom = frame.size().y / (2.0 * f64::to_radians(17.0).tan());
        let slopes = frame.size() / 2.0 / zoom;
        let wedge = |slope: f64, coordinate: fn(&DVec3) -> f64| {
            let reach = |sign: f64| {
                let reaches = local.iter().map(|p| sign * coordinate(p) - slope * p.z);
                reaches.fold(f64::NEG_INFINITY, f64::max)
            };
            let (right, left) = (reach(1.0), reach(-1.0));
            ((right - left) / 2.0, (right + left) / (2.0 * slope))
        };
        let (x, back_x) = wedge(slopes.x, |p| p.x);
        let (y, back_y) = wedge(slopes.y, |p| p.y);
        let back = back_x.max(back_y);
        if !back.is_finite() {
            return camera(0.0, 0.0, 0.0, zoom);
        }
        camera(x, y, -back, zoom)
    }

    /// A perspective camera at a place.
    pub(super) fn at(eye: DVec3, target: DVec3, up: DVec3, fov_deg: f64, frame: Frame) -> Self {
        let forward = (target - eye).normalize_or(-DVec3::Z);
        let fitted = Self::fitted(&[eye, target], forward, up, frame, true);
        let half = (fov_deg.clamp(1.0, 170.0) / 2.0).to_radians();
        Self {
            eye,
            zoom: frame.size().y / (2.0 * half.tan()),
            near: (target - eye).length() * 1e-4,
            ..fitted
        }
    }

    /// Coordinates to the right, up and forward from the eye.
    pub(super) fn local(&self, p: DVec3) -> DVec3 {
        let d = p - self.eye;
        DVec3::new(d.dot(self.right), d.dot(self.up), d.dot(self.forward))
    }

    /// Pixel of a point given in local coordinates; with perspective it must
    /// lie in front of the eye.
    pub(super) fn pixel(&self, local: DVec3) -> DVec2 {
        let scale = if self.is_perspective {
            self.zoom / local.z
        } else {
            self.zoom
        };
        self.middle + dvec2(local.x * scale, -local.y * scale)
    }

    /// The line of sight through a pixel: a point and a direction.
    pub(super) fn sight(&self, pixel: DVec2) -> (DVec3, DVec3) {
        let offset = (pixel - self.middle) / self.zoom;
        let aside = self.right * offset.x - self.up * offset.y;
        if self.is_perspective {
            (self.eye, self.forward + aside)
        } else {
            (self.eye + aside, self.forward)
        }
    }

    /// Is the surface's front turned to the viewer?
    pub(super) fn sees_front(&self, surface: &SurfaceMesh) -> bool {
        let Some(&p) = surface.nodes.first() else {
            return false;
        };
        let to_viewer = if self.is_perspective {
            self.eye - p
        } else {
            -self.forward
        };
        surface.normal.dot(to_viewer) > 1e-9 * to_viewer.length()
    }
}
