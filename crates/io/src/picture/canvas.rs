//! Pixels that are painted on: coverage masks and colours over each other.

use antumbra_geom::{DVec2, dvec2};

/// How much of each pixel is covered, 0 to 1. Lines that overlap do not add up.
#[derive(Clone, Debug)]
pub(super) struct Mask {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) coverage: Vec<f32>,
}

impl Mask {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            coverage: vec![0.0; width * height],
        }
    }

    /// A line with round ends.
    pub(super) fn line(&mut self, a: DVec2, b: DVec2, width: f64) {
        self.line_where(a, b, width, |_, _, _| true);
    }

    /// A line, painted where `is_visible(x, y, t)` says so, at fraction `t` of
    /// its length.
    pub(super) fn line_where(
        &mut self,
        a: DVec2,
        b: DVec2,
        width: f64,
        mut is_visible: impl FnMut(usize, usize, f64) -> bool,
    ) {
        let Some((a, b, t_of)) = self.clip(a, b, width) else {
            return;
        };
        let reach = width / 2.0 + 1.0;
        let along = b - a;
        let length_sq = along.length_squared();
        // Walk along the longer axis, and across by the reach.
        let is_steep = along.y.abs() > along.x.abs();
        let (from, to) = if is_steep { (a.y, b.y) } else { (a.x, b.x) };
        let n_along = if is_steep { self.height } else { self.width };
        let n_across = if is_steep { self.width } else { self.height };
        let across_reach = reach * std::f64::consts::SQRT_2;
        for i in pixels(from.min(to) - reach, from.max(to) + reach, n_along) {
            let middle = i as f64 + 0.5;
            let t = if to == from {
                0.0
            } else {
                ((middle - from) / (to - from)).clamp(0.0, 1.0)
            };
            let across = if is_steep {
                a.x + t * along.x
            } else {
                a.y + t * along.y
            };
            for j in pixels(across - across_reach, across + across_reach, n_across) {
                let (x, y) = if is_steep { (j, i) } else { (i, j) };
                let p = dvec2(x as f64 + 0.5, y as f64 + 0.5);
                let t = match length_sq > 0.0 {
                    true => ((p - a).dot(along) / length_sq).clamp(0.0, 1.0),
                    false => 0.0,
                };
                let distance = p.distance(a + t * along);
                let coverage = (width / 2.0 - distance + 0.5).clamp(0.0, 1.0) * width.min(1.0);
                let old = &mut self.coverage[y * self.width + x];
                if coverage as f32 > *old && is_visible(x, y, t_of.0 + t * t_of.1) {
                    *old = coverage as f32;
                }
            }
        }
    }

    /// The part of a line near the picture; its start and length as fractions.
    fn clip(&self, a: DVec2, b: DVec2, width: f64) -> Option<(DVec2, DVec2, (f64, f64))> {
        if !(a.is_finite() && b.is_finite()) {
            return None;
        }
        let margin = DVec2::splat(width + 2.0);
        let (low, high) = (
            -margin,
            dvec2(self.width as f64, self.height as f64) + margin,
        );
        let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let (start, step) = (a[axis], b[axis] - a[axis]);
            if step == 0.0 {
                if start < low[axis] || start > high[axis] {
                    return None;
                }
                continue;
            }
            let (enter, leave) = ((low[axis] - start) / step, (high[axis] - start) / step);
            t0 = t0.max(enter.min(leave));
            t1 = t1.min(enter.max(leave));
        }
        (t0 <= t1).then(|| (a + (b - a) * t0, a + (b - a) * t1, (t0, t1 - t0)))
    }
}

/// Pixels whose squares meet the interval.
fn pixels(from: f64, to: f64, n: usize) -> std::ops::Range<usize> {
    let clamp = |x: f64| x.clamp(0.0, n as f64) as usize;
    clamp(from.floor())..clamp(to.ceil())
}

/// Colours, sRGB 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<[f32; 3]>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize, color: [f64; 3]) -> Self {
        Self {
            width,
            height,
            pixels: vec![color.map(|c| c as f32); width * height],
        }
    }

    /// Paints `color` where the mask covers.
    pub(super) fn paint(&mut self, mask: &Mask, color: [f64; 3], opacity: f64) {
        for (pixel, &coverage) in self.pixels.iter_mut().zip(&mask.coverage) {
            if coverage > 0.0 {
                blend(pixel, color, opacity * f64::from(coverage));
            }
        }
    }

    /// Fills a rectangle whose edges fall on pixels.
    pub(super) fn rectangle(&mut self, min: DVec2, max: DVec2, color: impl Fn(f64) -> [f64; 3]) {
        for y in pixels(min.y.round(), max.y.round(), self.height) {
            let color = color(y as f64 + 0.5);
            for x in pixels(min.x.round(), max.x.round(), self.width) {
                self.pixels[y * self.width + x] = color.map(|c| c as f32);
            }
        }
    }

    /// Bytes, row by row from the top.
    pub(super) fn to_rgb(&self) -> Vec<u8> {
        let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
        self.pixels.iter().flatten().map(|&c| byte(c)).collect()
    }
}

pub(super) fn blend(pixel: &mut [f32; 3], color: [f64; 3], opacity: f64) {
    for (old, new) in pixel.iter_mut().zip(color) {
        *old += (new as f32 - *old) * opacity as f32;
    }
}
