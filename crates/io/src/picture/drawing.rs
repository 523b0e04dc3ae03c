//! A white sheet to draw lines and words on.

use super::Picture;
use super::canvas::{Canvas, Mask};
use super::colormap::rgb;
use super::font::{draw_text, text_width};
use antumbra_geom::DVec2;

/// Length of a dash and of the gap after it, in line widths.
const DASH: [f64; 2] = [4.0, 3.0];

/// A sheet; what is drawn later covers what was drawn before.
#[derive(Debug)]
pub(crate) struct Drawing {
    canvas: Canvas,
    /// What was drawn in this colour and is not yet painted.
    pending: Option<(u32, Mask)>,
}

impl Drawing {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self {
            canvas: Canvas::new(width, height, [1.0; 3]),
            pending: None,
        }
    }

    fn mask(&mut self, color: u32) -> &mut Mask {
        if self.pending.as_ref().is_none_or(|(c, _)| *c != color) {
            self.flush();
        }
        let (width, height) = (self.canvas.width, self.canvas.height);
        &mut self
            .pending
            .get_or_insert_with(|| (color, Mask::new(width, height)))
            .1
    }

    fn flush(&mut self) {
        if let Some((color, mask)) = self.pending.take() {
            self.canvas.paint(&mask, rgb(color), 1.0);
        }
    }

    /// A line with round ends: a disc if both are one.
    pub(crate) fn line(&mut self, [a, b]: [DVec2; 2], width: f64, color: u32, dashes: bool) {
        let mask = self.mask(color);
        let length = a.distance(b);
        if !dashes || length <= DASH[0] * width {
            mask.line(a, b, width);
            return;
        }
        let along = (b - a) / length;
        let [dash, gap] = DASH.map(|d| d * width.max(1.5));
        let mut at = 0.0;
        while at < length {
            mask.line(a + along * at, a + along * (at + dash).min(length), width);
            at += dash + gap;
        }
    }

    /// Words on a baseline; a capital is `size` pixels high.
    ///
    /// * `back` — by which share of its length the text begins before `at`.
    pub(crate) fn text(&mut self, text: &str, at: DVec2, size: f64, color: u32, back: f64) {
        let start = at - DVec2::X * (back * text_width(text, size));
        draw_text(self.mask(color), text, start, size);
    }

    pub(crate) fn finish(mut self) -> Picture {
        self.flush();
        Picture {
            width: self.canvas.width,
            height: self.canvas.height,
            rgb: self.canvas.to_rgb(),
        }
    }
}
