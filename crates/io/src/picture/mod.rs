//! Pictures: the field in false colours, with a legend and isolux lines.
//!
//! ```no_run
//! # fn scene() -> antumbra_io::model::MeshedScene { Default::default() }
//! use antumbra_io::picture::{PictureOptions, render, write_png};
//!
//! let picture = render(&scene(), &PictureOptions::default());
//! let mut png = Vec::new();
//! write_png(&picture, &mut png)?;
//! # Ok::<(), std::io::Error>(())
//! ```

mod band;
mod canvas;
mod colormap;
mod drawing;
mod font;
mod raster;
mod view;

pub use band::Band;
pub(crate) use band::band_values;
pub use colormap::{ColorMap, Scale};
pub(crate) use drawing::Drawing;
pub(crate) use view::chart_axes;
pub use view::{PictureOptions, Side, View};

use std::io::{Error, Result, Write};

use antumbra_geom::{DVec2, DVec3, dvec2};

use crate::model::{MeshedScene, SurfaceMesh};
use crate::write::lattice::{Basis, QuadBasis};
use crate::write::{ORDERS, check, field_names, labels, one_line, order_number, strongest};
use canvas::{Canvas, Mask};
use colormap::rgb;
use font::{draw_text, text_width};
use raster::{DepthBuffer, Shader, clip_segment};
use view::{Camera, Frame, guess_up, right_and_front};

/// Samples per pixel, each way.
const N_SUB: usize = 2;
const BACKGROUND: u32 = 0x15181d;
const TEXT: u32 = 0xe8eaed;
const FAINT_TEXT: u32 = 0x9aa0a8;
const OUTLINE: u32 = 0xf2f4f7;
/// How far down one looks in the views chosen automatically, in degrees.
const ELEVATION_DEG: f64 = 24.0;

/// A picture: rows from the top, three bytes per pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Red, green and blue of every pixel, sRGB.
    pub rgb: Vec<u8>,
}

/// Why a picture cannot show what was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PictureProblem {
    /// The scene's meshes do not fit together.
    Mesh(String),
    /// No surface has this name or label.
    NoSurface(String),
    /// No surface has this field.
    NoField(String),
    /// The field has fewer bands.
    NoBand {
        /// The band asked for, counted from 0.
        band: usize,
        /// How many there are.
        n_bands: usize,
    },
}

impl std::fmt::Display for PictureProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Mesh(problem) => write!(f, "{problem}"),
            Self::NoSurface(name) => write!(f, "no surface is named {name}"),
            Self::NoField(name) => write!(f, "no surface has a field {name}"),
            Self::NoBand { band, n_bands } => write!(f, "no band {band} of {n_bands}"),
        }
    }
}

impl std::error::Error for PictureProblem {}

impl PictureOptions {
    /// Can the scene be shown like this?
    ///
    /// [`render`] does not fail: it writes the problem into the picture.
    ///
    /// # Errors
    ///
    /// The first [`PictureProblem`] found.
    pub fn check(&self, scene: &MeshedScene) -> std::result::Result<(), PictureProblem> {
        check(scene).map_err(|e| PictureProblem::Mesh(e.to_string()))?;
        if let View::Surface(name) = &self.view
            && shown_surfaces(scene, name).is_empty()
        {
            return Err(PictureProblem::NoSurface(name.clone()));
        }
        if let Some(field) = &self.field
            && !field_names(scene).contains(&field.as_str())
        {
            return Err(PictureProblem::NoField(field.clone()));
        }
        let n_bands = scene.n_bands;
        match self.band {
            Band::Index(band) if band >= n_bands => Err(PictureProblem::NoBand { band, n_bands }),
            _ => Ok(()),
        }
    }
}

/// Draws the scene.
///
/// Never fails: what [`PictureOptions::check`] finds wrong is written into an
/// otherwise empty picture. The same scene and options give the same pixels.
/// Takes 48 bytes of memory per pixel.
#[must_use]
pub fn render(scene: &MeshedScene, options: &PictureOptions) -> Picture {
    let (width, height) = (options.width.max(1), options.height.max(1));
    let mut canvas = Canvas::new(width, height, rgb(BACKGROUND));
    let layout = Layout::new(width, height);
    match options.check(scene) {
        Ok(()) => Renderer::new(scene, options, layout).draw(&mut canvas),
        Err(problem) => {
            let at = dvec2(layout.margin, layout.margin + layout.font);
            layout.text(&mut canvas, &one_line(&problem.to_string()), at, 1.0, TEXT);
        }
    }
    Picture {
        width,
        height,
        rgb: canvas.to_rgb(),
    }
}

/// Writes a picture as PNG.
///
/// # Errors
///
/// What `out` reports; `InvalidInput` if the picture is empty or too large.
pub fn write_png(picture: &Picture, out: &mut impl Write) -> Result<()> {
    let invalid = |message: &str| Error::new(std::io::ErrorKind::InvalidInput, message);
    let size = |n: usize| u32::try_from(n).map_err(|_| invalid("the picture is too large"));
    let (width, height) = (size(picture.width)?, size(picture.height)?);
    let mut encoder = png::Encoder::new(&mut *out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.rgb)?;
    writer.finish()?;
    Ok(())
}

/// The surfaces of a map: by label, otherwise all fronts by this name.
fn shown_surfaces(scene: &MeshedScene, name: &str) -> Vec<usize> {
    let has_mesh = |i: &usize| scene.surfaces[*i].n_elements() > 0;
    let all = (0..scene.surfaces.len()).filter(has_mesh);
    let labels = labels(scene);
    let by_label: Vec<usize> = all.clone().filter(|&i| labels[i] == name).collect();
    if !by_label.is_empty() {
        return by_label;
    }
    let is_front = |&i: &usize| scene.surfaces[i].name == name && !scene.surfaces[i].is_back;
    all.filter(is_front).collect()
}

/// Sizes and places of what surrounds the scene.
#[derive(Clone, Copy, Debug)]
struct Layout {
    width: usize,
    height: usize,
    /// Height of a capital, in pixels.
    font: f64,
    margin: f64,
    /// Left end of the legend.
    legend_left: f64,
    scene: Frame,
}

impl Layout {
    fn new(width: usize, height: usize) -> Self {
        let (w, h) = (width as f64, height as f64);
        let font = (w.min(h * 1.6) / 125.0).clamp(6.0, 40.0);
        let margin = 2.5 * font;
        let legend_left = w - margin - 9.5 * font;
        let top = margin + 5.0 * font;
        let scene = Frame {
            min: dvec2(margin, top.min(h / 2.0)),
            max: dvec2(
                (legend_left - 2.0 * font).max(margin + 1.0),
                (h - margin).max(h / 2.0 + 1.0),
            ),
        };
        Self {
            width,
            height,
            font,
            margin,
            legend_left,
            scene,
        }
    }

    fn text(&self, canvas: &mut Canvas, text: &str, at: DVec2, size: f64, color: u32) {
        let mut mask = Mask::new(self.width, self.height);
        draw_text(&mut mask, text, at, self.font * size);
        canvas.paint(&mask, rgb(color), 1.0);
    }

    fn line_width(&self) -> f64 {
        (self.font / 9.0).max(0.8)
    }
}

struct Renderer<'a> {
    scene: &'a MeshedScene,
    options: &'a PictureOptions,
    layout: Layout,
    field: &'a str,
    /// Node values of every surface.
    values: Vec<Vec<f64>>,
    scale: Scale,
    /// By surface.
    is_shown: Vec<bool>,
}

impl<'a> Renderer<'a> {
    fn new(scene: &'a MeshedScene, options: &'a PictureOptions, layout: Layout) -> Self {
        let last_field = || {
            let fields = scene.surfaces.first().map_or(&[][..], |s| &s.fields);
            fields.last().map_or("", |field| field.name.as_str())
        };
        let field = options.field.as_deref().unwrap_or_else(last_field);
        let values = (scene.surfaces.iter())
            .map(|surface| band_values(scene, surface, field, options.band))
            .collect();
        let scale = match options.scale {
            Some((min, max)) => Scale::new(min, max),
            None => Scale::of_field(scene, field, options.band),
        };
        let mut is_shown = vec![true; scene.surfaces.len()];
        if let View::Surface(name) = &options.view {
            let shown = shown_surfaces(scene, name);
            for (i, is_shown) in is_shown.iter_mut().enumerate() {
                *is_shown = shown.contains(&i);
            }
        }
        Self {
            scene,
            options,
            layout,
            field,
            values,
            scale,
            is_shown,
        }
    }

    fn draw(&self, canvas: &mut Canvas) {
        let camera = self.camera();
        let size = (canvas.width, canvas.height);
        let buffer = DepthBuffer::new(self.scene, camera, size, N_SUB, |i| self.is_shown[i]);

        // The field.
        let shader = Shader {
            values: &self.values,
            bases: [1, 2, 3, 4].map(Basis::new),
            quad_bases: [1, 2, 3, 4].map(QuadBasis::new),
            scale: self.scale,
            color_map: self.options.color_map,
            isolux: self.options.isolux,
        };
        let background = rgb(BACKGROUND);
        let n_samples = (N_SUB * N_SUB) as f64;
        for y in 0..size.1 {
            for x in 0..size.0 {
                let mut sum = [0.0; 3];
                for sample in buffer.pixel_samples(x, y) {
                    let color = buffer.color(sample, &shader).unwrap_or(background);
                    sum = [0, 1, 2].map(|k| sum[k] + color[k]);
                }
                canvas.pixels[y * size.0 + x] = sum.map(|c| (c / n_samples) as f32);
            }
        }

        // Lines over it.
        if self.options.mesh {
            self.draw_mesh(canvas, &buffer, &camera);
        }
        self.draw_outlines(canvas, &buffer, &camera);
        if self.options.curves {
            self.draw_curves(canvas, &buffer, &camera);
        }

        // Words around it.
        self.clear_margins(canvas);
        self.draw_heading(canvas);
        self.draw_legend(canvas);
        if matches!(self.options.view, View::Surface(_)) {
            self.draw_scale_bar(canvas, &camera);
        }
    }

    fn camera(&self) -> Camera {
        let frame = self.layout.scene;
        let up = self.options.up.and_then(DVec3::try_normalize);
        let up = up.unwrap_or_else(|| guess_up(self.scene));
        let (right, front) = right_and_front(up);
        match &self.options.view {
            View::Auto => self.best_camera(up),
            View::Camera {
                eye,
                target,
                up,
                fov_deg,
            } => Camera::at(*eye, *target, *up, *fov_deg, frame),
            View::Named(side) => {
                let (forward, up) = match side {
                    Side::Front => (-front, up),
                    Side::Back => (front, up),
                    Side::Left => (right, up),
                    Side::Right => (-right, up),
                    Side::Top => (-up, -front),
                    Side::Bottom => (up, front),
                };
                self.fitted(forward, up, frame)
            }
            View::Surface(_) => {
                let shown = (0..self.is_shown.len()).find(|&i| self.is_shown[i]);
                let surface = shown.map(|i| &self.scene.surfaces[i]);
                let normal = surface.map_or(up, |s| s.normal);
                let chart_up = surface.and_then(chart_axes).map_or(front, |axes| axes[1]);
                let is_level = normal.cross(up).length() < 0.1;
                let points = self.points(|_| true);
                let up = if is_level { chart_up } else { up };
                let below = Frame {
                    max: frame.max - dvec2(0.0, 3.0 * self.layout.font),
                    ..frame
                };
                Camera::fitted(&points, -normal, up, below, false)
            }
        }
    }

    /// Corners and nodes of the surfaces that are shown and wanted.
    fn points(&self, is_wanted: impl Fn(&SurfaceMesh) -> bool) -> Vec<DVec3> {
        let mut points = Vec::new();
        for (surface, is_shown) in self.scene.surfaces.iter().zip(&self.is_shown) {
            if *is_shown && is_wanted(surface) {
                let corners = surface.loops.iter().flatten();
                points.extend(corners);
                // Without an outline, what is drawn itself.
                if surface.loops.is_empty() {
                    points.extend(&surface.nodes);
                }
            }
        }
        points
    }

    /// Fits what is turned to the viewer, which depends on where the viewer is.
    fn fitted(&self, forward: DVec3, up: DVec3, frame: Frame) -> Camera {
        let all = self.points(|_| true);
        let camera = Camera::fitted(&all, forward, up, frame, true);
        let seen = self.points(|surface| camera.sees_front(surface));
        if seen.is_empty() {
            return camera;
        }
        Camera::fitted(&seen, forward, up, frame, true)
    }

    /// Of eight directions around the scene from above and four level ones,
    /// the one that shows most, and most that is not even.
    fn best_camera(&self, up: DVec3) -> Camera {
        const TRIAL: (usize, usize) = (96, 72);
        let (right, front) = right_and_front(up);
        let trial_frame = Frame {
            min: DVec2::ZERO,
            max: dvec2(TRIAL.0 as f64, TRIAL.1 as f64),
        };
        let unevenness: Vec<f64> = self.values.iter().map(|v| self.unevenness(v)).collect();
        let mut best = (f64::NEG_INFINITY, -front);
        let level = [0, 2, 4, 6].map(|eighth| (eighth, 6.0));
        // Corners first: of equal views, the first is taken.
        let raised = [1, 7, 3, 5, 0, 2, 6, 4].map(|eighth| (eighth, ELEVATION_DEG));
        for (eighth, elevation_deg) in raised.into_iter().chain(level) {
            let azimuth = f64::from(eighth) * std::f64::consts::FRAC_PI_4;
            let elevation = f64::to_radians(elevation_deg);
            let outwards = (front * azimuth.cos() + right * azimuth.sin()) * elevation.cos();
            let forward = -(outwards + up * elevation.sin());
            let camera = self.fitted(forward, up, trial_frame);
            let buffer = DepthBuffer::new(self.scene, camera, TRIAL, 1, |i| self.is_shown[i]);
            let seen = (0..buffer.n_samples()).filter_map(|sample| buffer.surface_at(sample));
            let score: f64 = seen.map(|i| 0.25 + unevenness[i]).sum();
            // Corners show depth, and from above one sees what lies on the floor.
            let is_corner = eighth % 2 == 1;
            let is_level = elevation_deg < ELEVATION_DEG;
            let score = match (is_corner, is_level) {
                (true, _) => score * 1.15,
                (_, true) => score * 0.8,
                _ => score,
            };
            if score > best.0 * (1.0 + 1e-6) {
                best = (score, forward);
            }
        }
        self.fitted(best.1, up, self.layout.scene)
    }

    /// How much the values on a surface differ, as a fraction of the scale.
    fn unevenness(&self, values: &[f64]) -> f64 {
        let fractions = values
            .iter()
            .map(|&v| self.scale.fraction(v).clamp(0.0, 1.0));
        let fractions: Vec<f64> = fractions.filter(|f| f.is_finite()).collect();
        let n = fractions.len().max(1) as f64;
        let mean = fractions.iter().sum::<f64>() / n;
        let variance = fractions.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / n;
        variance.sqrt()
    }

    fn segment(
        mask: &mut Mask,
        camera: &Camera,
        ends: [DVec3; 2],
        width: f64,
        hidden_by: Option<&DepthBuffer<'_>>,
    ) {
        let [a, b] = ends.map(|p| camera.local(p));
        let Some([a, b]) = clip_segment(a, b, camera) else {
            return;
        };
        mask.line_where(camera.pixel(a), camera.pixel(b), width, |x, y, t| {
            // Along a line of the picture, not z but its reciprocal is even.
            let distance = if camera.is_perspective {
                1.0 / ((1.0 - t) / a.z + t / b.z)
            } else {
                a.z + t * (b.z - a.z)
            };
            hidden_by.is_none_or(|buffer| !buffer.hides(x, y, distance))
        });
    }

    fn visible_surfaces(&self, camera: &Camera) -> Vec<&'a SurfaceMesh> {
        let surfaces = self.scene.surfaces.iter().zip(&self.is_shown);
        surfaces
            .filter(|(surface, is_shown)| **is_shown && camera.sees_front(surface))
            .map(|(surface, _)| surface)
            .collect()
    }

    /// A camera inside the scene sees more than the frame holds.
    fn clear_margins(&self, canvas: &mut Canvas) {
        let Frame { min, max } = self.layout.scene;
        let slack = DVec2::splat(2.0 * self.layout.line_width());
        let (min, max) = (min - slack, max + slack);
        let end = dvec2(canvas.width as f64, canvas.height as f64);
        let background = |_| rgb(BACKGROUND);
        canvas.rectangle(DVec2::ZERO, dvec2(end.x, min.y), background);
        canvas.rectangle(DVec2::ZERO, dvec2(min.x, end.y), background);
        canvas.rectangle(dvec2(max.x, 0.0), end, background);
        canvas.rectangle(dvec2(0.0, max.y), end, background);
    }

    fn mask(&self) -> Mask {
        Mask::new(self.layout.width, self.layout.height)
    }

    fn draw_mesh(&self, canvas: &mut Canvas, buffer: &DepthBuffer<'_>, camera: &Camera) {
        let mut mask = self.mask();
        let width = 0.7 * self.layout.line_width();
        for surface in self.visible_surfaces(camera) {
            for (element, is_quad) in surface.each_element() {
                let n = if is_quad { 4 } else { 3 };
                for k in 0..n {
                    let ends = [element[k], element[(k + 1) % n]];
                    let ends = ends.map(|node| surface.nodes[node as usize]);
                    Self::segment(&mut mask, camera, ends, width, Some(buffer));
                }
            }
        }
        canvas.paint(&mask, [0.0; 3], 0.45);
    }

    /// Outlines of what is seen, and faintly of what one looks through.
    fn draw_outlines(&self, canvas: &mut Canvas, buffer: &DepthBuffer<'_>, camera: &Camera) {
        let width = self.layout.line_width();
        let (mut seen, mut unseen) = (self.mask(), self.mask());
        for (surface, is_shown) in self.scene.surfaces.iter().zip(&self.is_shown) {
            if !is_shown || surface.is_back && !camera.sees_front(surface) {
                continue;
            }
            let is_seen = camera.sees_front(surface);
            for corners in &surface.loops {
                for (i, &a) in corners.iter().enumerate() {
                    let ends = [a, corners[(i + 1) % corners.len()]];
                    if is_seen {
                        Self::segment(&mut seen, camera, ends, width, Some(buffer));
                    } else {
                        Self::segment(&mut unseen, camera, ends, 0.7 * width, None);
                    }
                }
            }
        }
        canvas.paint(&unseen, rgb(OUTLINE), 0.16);
        canvas.paint(&seen, rgb(OUTLINE), 0.75);
    }

    /// Weak orders first, so that strong ones stay on top.
    fn draw_curves(&self, canvas: &mut Canvas, buffer: &DepthBuffer<'_>, camera: &Camera) {
        let width = 1.5 * self.layout.line_width();
        for (order, style) in ORDERS.iter().enumerate().rev() {
            if style.order == "border" {
                continue;
            }
            let mut mask = self.mask();
            for surface in self.visible_surfaces(camera) {
                for edge in &surface.curve_edges {
                    let curve = strongest(surface, edge);
                    if curve.is_some_and(|c| order_number(&c.order) == order) {
                        let ends = edge.ends.map(|n| surface.nodes[n as usize]);
                        Self::segment(&mut mask, camera, ends, width, Some(buffer));
                    }
                }
            }
            canvas.paint(&mask, curve_rgb(style.rgb), 1.0);
        }
    }

    fn draw_heading(&self, canvas: &mut Canvas) {
        let layout = &self.layout;
        let title = self.options.title.as_deref().unwrap_or(self.field);
        let room = layout.width as f64 - 2.0 * layout.margin;
        let mut at = dvec2(layout.margin, layout.margin + 1.3 * layout.font);
        let title = fitting(&one_line(title), room, 1.45 * layout.font);
        layout.text(canvas, &title, at, 1.45, TEXT);

        let mut notes: Vec<String> = Vec::new();
        if self.options.title.is_some() {
            notes.push(self.field.to_owned());
        }
        if let View::Surface(name) = &self.options.view {
            notes.push(name.clone());
        }
        match self.options.band {
            Band::Index(band) => notes.push(format!("band {band}")),
            Band::Luminance if self.scene.n_bands > 1 => {
                notes.push(format!("mean of {} bands", self.scene.n_bands));
            }
            Band::Luminance => {}
        }
        if !self.scene.provenance.is_empty() {
            notes.push(self.scene.provenance.clone());
        }
        at.y += 2.1 * layout.font;
        let notes = fitting(&one_line(&notes.join("  ·  ")), room, 0.85 * layout.font);
        layout.text(canvas, &notes, at, 0.85, FAINT_TEXT);
    }

    fn draw_legend(&self, canvas: &mut Canvas) {
        let layout = &self.layout;
        let font = layout.font;
        let left = layout.legend_left.round();
        let bar = Frame {
            min: dvec2(left, (layout.scene.min.y + 2.6 * font).round()),
            max: dvec2(left + 1.8 * font, (layout.scene.max.y - 1.5 * font).round()),
        };
        let bar = if self.options.curves {
            Frame {
                max: bar.max - dvec2(0.0, 7.5 * font),
                ..bar
            }
        } else {
            bar
        };
        if bar.size().y < 2.0 * font {
            return;
        }
        let unit = one_line(&self.scene.unit);
        layout.text(canvas, &unit, bar.min - dvec2(0.0, 1.9 * font), 1.0, TEXT);

        let fraction_at = |y: f64| (bar.max.y - y) / bar.size().y;
        let color_map = self.options.color_map;
        canvas.rectangle(bar.min, bar.max, |y| color_map.rgb(fraction_at(y)));
        self.draw_ends(canvas, bar);

        let mut ticks = self.mask();
        let mut labels = self.mask();
        let mut last_y = f64::INFINITY;
        for tick in self.scale.ticks() {
            let fraction = self.scale.fraction(tick);
            let y = bar.max.y - fraction * bar.size().y;
            let right = bar.max.x + 0.35 * font;
            ticks.line(dvec2(bar.max.x, y), dvec2(right, y), layout.line_width());
            if last_y - y > 1.7 * font {
                let at = dvec2(right + 0.6 * font, y + 0.5 * font);
                draw_text(&mut labels, &self.scale.label(tick), at, font);
                last_y = y;
            }
            // The isolux lines, as they look on the surfaces.
            let is_inside = fraction > 1e-6 && fraction < 1.0 - 1e-6;
            if self.options.isolux && is_inside {
                let color = color_map.rgb(fraction);
                let is_light = raster::is_light(color);
                let (line, opacity) = if is_light { (0.05, 0.6) } else { (1.0, 0.7) };
                let mut mask = self.mask();
                mask.line(
                    dvec2(bar.min.x + 1.0, y),
                    dvec2(bar.max.x - 1.0, y),
                    layout.line_width(),
                );
                canvas.paint(&mask, [line; 3], opacity);
            }
        }
        canvas.paint(&ticks, rgb(FAINT_TEXT), 1.0);
        canvas.paint(&labels, rgb(TEXT), 1.0);

        if self.options.curves {
            self.draw_curve_legend(canvas, bar.max.y + 3.2 * font);
        }
    }

    /// Arrow heads at the ends of the bar where values go beyond the scale.
    fn draw_ends(&self, canvas: &mut Canvas, bar: Frame) {
        let slack = 1e-3;
        let values = || self.values.iter().flatten().filter(|v| v.is_finite());
        let is_above = values().any(|&v| self.scale.fraction(v) > 1.0 + slack);
        let is_below = values().any(|&v| self.scale.fraction(v) < -slack);
        let ends = [
            (is_above, bar.min.y, -1.0, 1.0),
            (is_below, bar.max.y, 1.0, 0.0),
        ];
        for (is_beyond, y, direction, fraction) in ends {
            if !is_beyond {
                continue;
            }
            let mut mask = self.mask();
            let middle = (bar.min.x + bar.max.x) / 2.0;
            let half = bar.size().x / 2.0;
            let height = (0.9 * half).round();
            for k in 0..height as usize {
                let k = k as f64 + 0.5;
                let reach = half * (1.0 - k / height) - 0.5;
                let y = y + direction * (k + 1.0);
                mask.line(dvec2(middle - reach, y), dvec2(middle + reach, y), 1.0);
            }
            canvas.paint(&mask, self.options.color_map.rgb(fraction), 1.0);
        }
    }

    fn draw_curve_legend(&self, canvas: &mut Canvas, top: f64) {
        let layout = &self.layout;
        let font = layout.font;
        for (i, style) in ORDERS[..3].iter().enumerate() {
            let y = top + 2.0 * font * i as f64;
            let left = layout.legend_left;
            let mut mask = self.mask();
            mask.line(
                dvec2(left, y),
                dvec2(left + 1.8 * font, y),
                1.5 * layout.line_width(),
            );
            canvas.paint(&mask, curve_rgb(style.rgb), 1.0);
            let at = dvec2(left + 2.7 * font, y + 0.4 * font);
            let words = style.meaning.trim_end_matches(" jumps");
            layout.text(canvas, words, at, 0.8, TEXT);
        }
    }

    fn draw_scale_bar(&self, canvas: &mut Canvas, camera: &Camera) {
        let layout = &self.layout;
        let font = layout.font;
        let room = layout.scene.size().x / 4.0 / camera.zoom;
        let power = 10_f64.powi(room.log10().floor() as i32);
        let length = [5.0, 2.0]
            .map(|m| m * power)
            .into_iter()
            .find(|&l| l <= room);
        let length = length.unwrap_or(power);
        let (x, y) = (layout.scene.min.x, layout.scene.max.y - 0.5 * font);
        let end = x + length * camera.zoom;
        let mut mask = self.mask();
        mask.line(dvec2(x, y), dvec2(end, y), layout.line_width());
        for x in [x, end] {
            mask.line(
                dvec2(x, y - 0.4 * font),
                dvec2(x, y + 0.4 * font),
                layout.line_width(),
            );
        }
        canvas.paint(&mask, rgb(TEXT), 1.0);
        let label = format!("{length} {}", one_line(&self.scene.length_unit));
        layout.text(
            canvas,
            &label,
            dvec2(end + 0.9 * font, y + 0.45 * font),
            0.9,
            TEXT,
        );
    }
}

/// The colour of an order, lighter than on paper, for a dark ground.
fn curve_rgb(color: [u8; 3]) -> [f64; 3] {
    color.map(|c| 0.2 + 0.8 * f64::from(c) / 255.0)
}

/// As much of the text as fits, with dots if that is not all.
fn fitting(text: &str, room: f64, size: f64) -> String {
    if text_width(text, size) <= room {
        return text.to_owned();
    }
    let mut shorter: Vec<char> = text.chars().collect();
    loop {
        shorter.pop();
        let candidate: String = shorter.iter().chain(&['.', '.', '.']).collect();
        if shorter.is_empty() || text_width(&candidate, size) <= room {
            return candidate;
        }
    }
}
