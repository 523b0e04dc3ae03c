//! Error against cost, both on logarithmic axes: as SVG, and as pixels.

use super::{Run, Series, Study, color_of};
use crate::picture::{Drawing, Picture};
use antumbra_geom::{DVec2, dvec2};
use std::fmt::Write as _;

/// What goes to the right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Horizontal {
    /// Seconds, the median of the repeats.
    #[default]
    Seconds,
    /// Elements.
    Elements,
    /// Exact evaluations.
    Evaluations,
}

impl Horizontal {
    fn of(self, run: &Run) -> f64 {
        match self {
            Self::Seconds => run.seconds.median,
            Self::Elements => run.elements as f64,
            Self::Evaluations => run.exact_evaluations as f64,
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Seconds => "seconds",
            Self::Elements => "elements",
            Self::Evaluations => "exact evaluations",
        }
    }
}

/// What goes upwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Vertical {
    /// Root mean square of the error.
    #[default]
    Rms,
    /// The largest error.
    Max,
    /// Root mean square of the error where some of the light is hidden.
    Penumbra,
}

impl Vertical {
    fn of(self, run: &Run) -> f64 {
        match self {
            Self::Rms => run.error.rms,
            Self::Max => run.error.max,
            Self::Penumbra => run.error.penumbra_rms,
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Rms => "rms error / peak",
            Self::Max => "largest error / peak",
            Self::Penumbra => "rms error in penumbras / peak",
        }
    }
}

/// A piece of the figure, in pixels from the top left.
enum Shape {
    Line {
        ends: [DVec2; 2],
        width: f64,
        color: u32,
        dashes: bool,
    },
    /// Filled; a ring around it if `is_marked`.
    Dot {
        at: DVec2,
        radius: f64,
        color: u32,
        is_marked: bool,
        words: String,
    },
    Text {
        at: DVec2,
        size: f64,
        color: u32,
        words: String,
        anchor: Anchor,
    },
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Anchor {
    Start,
    Middle,
    End,
}

const INK: u32 = 0x333333;
const FAINT: u32 = 0xdddddd;

/// Decades from below the smallest to above the largest of some positive numbers.
fn decades(values: impl Iterator<Item = f64>) -> Option<(i32, i32)> {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    (low <= high).then(|| {
        let from = low.log10().floor() as i32;
        let to = (high.log10().ceil() as i32).max(from + 1);
        (from, to)
    })
}

/// A number for an axis.
fn tick(exponent: i32) -> String {
    match exponent {
        0..=3 => format!("{}", 10f64.powi(exponent)),
        _ => format!("1e{exponent}"),
    }
}

/// The figure's shapes; none if no run has a cost and an error.
fn shapes(
    study: &Study,
    [x_axis, y_axis]: [Axis; 2],
    size: DVec2,
    words: &[String; 2],
) -> Vec<Shape> {
    let unit = size.y / 60.0;
    let (left, top) = (7.0 * unit, 5.0 * unit);
    let (right, bottom) = (size.x - 17.0 * unit, size.y - 5.0 * unit);
    let mut shapes = Vec::new();
    let runs = || study.series.iter().flat_map(|s| &s.runs);
    let text = |at: DVec2, scale: f64, words: String, anchor: Anchor| Shape::Text {
        at,
        size: scale * unit,
        color: INK,
        words,
        anchor,
    };
    let title = text(
        dvec2(left, 2.0 * unit),
        1.1,
        words[1].clone(),
        Anchor::Start,
    );
    shapes.push(title);
    let (Some(x), Some(y)) = (
        decades(runs().map(|r| x_axis.of(r))),
        decades(runs().map(|r| y_axis.of(r))),
    ) else {
        shapes.push(text(
            dvec2(left, size.y / 2.0),
            1.1,
            "nothing was measured".into(),
            Anchor::Start,
        ));
        return shapes;
    };
    let place = move |run: &Run, x_axis: Axis, y_axis: Axis| -> Option<DVec2> {
        let (a, b) = (x_axis.of(run), y_axis.of(run));
        let share =
            |v: f64, (from, to): (i32, i32)| (v.log10() - f64::from(from)) / f64::from(to - from);
        (a > 0.0 && b > 0.0).then(|| {
            dvec2(
                left + (right - left) * share(a, x),
                bottom - (bottom - top) * share(b, y),
            )
        })
    };
    grid(
        &mut shapes,
        x,
        y,
        [dvec2(left, top), dvec2(right, bottom)],
        unit,
    );
    shapes.push(Shape::Text {
        at: dvec2((left + right) / 2.0, bottom + 4.0 * unit),
        size: unit,
        color: INK,
        words: x_axis.label().to_owned(),
        anchor: Anchor::Middle,
    });
    for series in &study.series {
        curve(&mut shapes, series, unit, &|run| place(run, x_axis, y_axis));
    }
    legend(&mut shapes, study, dvec2(right + 1.5 * unit, top), unit);
    shapes.push(Shape::Text {
        at: dvec2(left - 5.5 * unit, top - 1.2 * unit),
        size: unit,
        color: INK,
        words: words[0].clone(),
        anchor: Anchor::Start,
    });
    shapes
}

/// One of the two axes.
#[derive(Clone, Copy)]
enum Axis {
    X(Horizontal),
    Y(Vertical),
}

impl Axis {
    fn of(self, run: &Run) -> f64 {
        match self {
            Self::X(x) => x.of(run),
            Self::Y(y) => y.of(run),
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::X(x) => x.label(),
            Self::Y(y) => y.label(),
        }
    }
}

fn grid(shapes: &mut Vec<Shape>, x: (i32, i32), y: (i32, i32), [min, max]: [DVec2; 2], unit: f64) {
    let line = |ends: [DVec2; 2], color: u32| Shape::Line {
        ends,
        width: 0.08 * unit,
        color,
        dashes: false,
    };
    for k in x.0..=x.1 {
        let at = min.x + (max.x - min.x) * f64::from(k - x.0) / f64::from(x.1 - x.0);
        shapes.push(line([dvec2(at, min.y), dvec2(at, max.y)], FAINT));
        shapes.push(Shape::Text {
            at: dvec2(at, max.y + 1.8 * unit),
            size: 0.9 * unit,
            color: INK,
            words: tick(k),
            anchor: Anchor::Middle,
        });
    }
    for k in y.0..=y.1 {
        let at = max.y - (max.y - min.y) * f64::from(k - y.0) / f64::from(y.1 - y.0);
        shapes.push(line([dvec2(min.x, at), dvec2(max.x, at)], FAINT));
        shapes.push(Shape::Text {
            at: dvec2(min.x - 0.6 * unit, at + 0.45 * unit),
            size: 0.9 * unit,
            color: INK,
            words: tick(k),
            anchor: Anchor::End,
        });
    }
    shapes.push(line([dvec2(min.x, max.y), max], INK));
    shapes.push(line([min, dvec2(min.x, max.y)], INK));
}

fn curve(
    shapes: &mut Vec<Shape>,
    series: &Series,
    unit: f64,
    place: &dyn Fn(&Run) -> Option<DVec2>,
) {
    let color = color_of(&series.mesher);
    let is_ours = series.mesher.starts_with("discontinuity");
    let width = (if is_ours { 0.3 } else { 0.16 }) * unit;
    let places: Vec<(DVec2, &Run)> = series
        .runs
        .iter()
        .filter_map(|r| place(r).map(|p| (p, r)))
        .collect();
    for pair in places.windows(2) {
        shapes.push(Shape::Line {
            ends: [pair[0].0, pair[1].0],
            width,
            color,
            dashes: series.degree % 2 == 1,
        });
    }
    for (at, run) in places {
        shapes.push(Shape::Dot {
            at,
            radius: (0.25 + 0.09 * f64::from(series.degree)) * unit,
            color,
            is_marked: run.on_front,
            words: format!(
                "{} degree {}, {}: {} elements, {} evaluations, {:.4} s, rms {:.2e}, max {:.2e}",
                series.mesher,
                series.degree,
                run.setting,
                run.elements,
                run.exact_evaluations,
                run.seconds.median,
                run.error.rms,
                run.error.max,
            ),
        });
    }
}

fn legend(shapes: &mut Vec<Shape>, study: &Study, start: DVec2, unit: f64) {
    let mut seen: Vec<&str> = Vec::new();
    let mut at = start;
    let row = |at: DVec2, words: &str| Shape::Text {
        at: at + dvec2(3.0 * unit, 0.4 * unit),
        size: 0.9 * unit,
        color: INK,
        words: words.to_owned(),
        anchor: Anchor::Start,
    };
    for series in &study.series {
        if seen.contains(&series.mesher.as_str()) {
            continue;
        }
        seen.push(&series.mesher);
        shapes.push(Shape::Line {
            ends: [at, at + dvec2(2.2 * unit, 0.0)],
            width: 0.35 * unit,
            color: color_of(&series.mesher),
            dashes: false,
        });
        shapes.push(row(at, &series.mesher));
        at.y += 2.0 * unit;
    }
    at.y += unit;
    let mut degrees: Vec<u8> = study.series.iter().map(|s| s.degree).collect();
    degrees.sort_unstable();
    degrees.dedup();
    for degree in degrees {
        shapes.push(Shape::Dot {
            at: at + dvec2(1.1 * unit, 0.0),
            radius: (0.25 + 0.09 * f64::from(degree)) * unit,
            color: INK,
            is_marked: false,
            words: String::new(),
        });
        shapes.push(row(at, &format!("degree {degree}")));
        at.y += 1.8 * unit;
    }
    shapes.push(Shape::Dot {
        at: at + dvec2(1.1 * unit, 0.0),
        radius: 0.4 * unit,
        color: INK,
        is_marked: true,
        words: String::new(),
    });
    shapes.push(row(at, "not beaten"));
}

/// The figure as an SVG element of a page.
#[must_use]
pub fn svg(study: &Study, x: Horizontal, y: Vertical, size: DVec2) -> String {
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" role=\"img\">",
        size.x, size.y
    );
    let hex = |c: u32| format!("#{c:06x}");
    for shape in shapes(study, [Axis::X(x), Axis::Y(y)], size, &words(study, y)) {
        let _ = match shape {
            Shape::Line {
                ends: [a, b],
                width,
                color,
                dashes,
            } => write!(
                out,
                "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{}\" stroke-width=\"{width:.2}\"{}/>",
                a.x,
                a.y,
                b.x,
                b.y,
                hex(color),
                if dashes {
                    " stroke-dasharray=\"6 4\""
                } else {
                    ""
                },
            ),
            Shape::Dot {
                at,
                radius,
                color,
                is_marked,
                words,
            } => {
                if is_marked {
                    let _ = write!(
                        out,
                        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{:.2}\" fill=\"none\" stroke=\"#000\"/>",
                        at.x,
                        at.y,
                        radius * 1.9
                    );
                }
                write!(
                    out,
                    "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius:.2}\" fill=\"{}\"><title>{}</title></circle>",
                    at.x,
                    at.y,
                    hex(color),
                    crate::write::xml(&words)
                )
            }
            Shape::Text {
                at,
                size,
                color,
                words,
                anchor,
            } => write!(
                out,
                "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"{:.1}\" fill=\"{}\" text-anchor=\"{}\">{}</text>",
                at.x,
                at.y,
                // A capital is about 0.7 of the font's size.
                size / 0.7,
                hex(color),
                match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                },
                crate::write::xml(&words)
            ),
        };
    }
    out.push_str("</svg>");
    out
}

fn words(study: &Study, y: Vertical) -> [String; 2] {
    [
        y.label().to_owned(),
        format!("{}: {}", study.title, study.quantity),
    ]
}

/// The figure as a picture.
#[must_use]
pub fn render(study: &Study, x: Horizontal, y: Vertical, width: usize, height: usize) -> Picture {
    let mut drawing = Drawing::new(width, height);
    let size = dvec2(width as f64, height as f64);
    for shape in shapes(study, [Axis::X(x), Axis::Y(y)], size, &words(study, y)) {
        match shape {
            Shape::Line {
                ends,
                width,
                color,
                dashes,
            } => drawing.line(ends, width.max(1.0), color, dashes),
            Shape::Dot {
                at,
                radius,
                color,
                is_marked,
                ..
            } => {
                if is_marked {
                    drawing.line([at; 2], radius * 3.8 + 2.0, 0x000000, false);
                    drawing.line([at; 2], radius * 3.8, 0xffffff, false);
                }
                drawing.line([at; 2], 2.0 * radius, color, false);
            }
            Shape::Text {
                at,
                size,
                color,
                words,
                anchor,
            } => {
                let back = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => 0.5,
                    Anchor::End => 1.0,
                };
                drawing.text(&words, at, size, color, back);
            }
        }
    }
    drawing.finish()
}
