//! SVG: one drawing per surface, mesh and curves, seen from the front.
//!
//! Elements are thin grey lines. Curves have the colour of their order and the
//! dashes of their kind; their titles, shown on hovering, say what made them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{Error, ErrorKind, Result, Write};

use antumbra_geom::{DVec2, DVec3, dvec2};

use super::{KINDS, ORDERS, check, kind_number, labels, one_line, order_number, strongest, xml};
use crate::model::{Curve, MeshedScene, SurfaceMesh};

/// Stroke widths and dashes by position in [`KINDS`]; last, an unknown kind.
const DASHES: [(f64, &str); 8] = [
    (1.2, ""),
    (1.4, ""),
    (1.4, "7 3"),
    (1.4, "2.5 2.5"),
    (1.4, "9 3 2 3"),
    (1.4, "1 3.5"),
    (2.4, ""),
    (1.4, "4 1"),
];
const UNKNOWN_RGB: [u8; 3] = [0xcc, 0x79, 0xa7];
const STYLE: &str = "text{font:13px system-ui,sans-serif;fill:#222}\
    .title{font-size:17px;font-weight:600}.note{fill:#666}\
    path{fill:none;stroke-linecap:butt;stroke-linejoin:round}\
    .mesh{stroke:#b4b4b4;stroke-width:.5}\
    .outline{fill:#fbfbf9;stroke:#333;stroke-width:1.2}\
    .curve:hover{stroke-width:4}";

/// Largest extent of one surface's drawing, in pixels.
const DRAWING: f64 = 720.0;
/// The same on the sheet of all surfaces.
const PANEL: f64 = 400.0;
const MARGIN: f64 = 28.0;
const TITLE_HEIGHT: f64 = 48.0;
const SCALE_BAR_HEIGHT: f64 = 44.0;
const LEGEND_ROW: f64 = 20.0;

/// Writes the drawing of one surface of the scene.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together; otherwise what `out` reports.
pub fn write_surface(
    surface: &SurfaceMesh,
    scene: &MeshedScene,
    out: &mut impl Write,
) -> Result<()> {
    check(scene)?;
    let all_labels = labels(scene);
    let index = scene
        .surfaces
        .iter()
        .position(|s| std::ptr::eq(s, surface) || is_same(s, surface));
    let label = index.map_or(surface.name.as_str(), |i| &all_labels[i]);
    let drawing = Drawing::new(surface, label, DRAWING).ok_or_else(|| no_nodes(label))?;
    let width = (drawing.size.x + 2.0 * MARGIN).max(460.0);
    let legend = Legend::of(std::slice::from_ref(&surface));

    let mut svg = String::new();
    let legend_top = drawing.height();
    let height = legend_top + legend.height(width) + MARGIN;
    open(&mut svg, width, height, &scene.provenance, label);
    drawing.draw(&mut svg, DVec2::ZERO, &scene.length_unit);
    legend.draw(&mut svg, dvec2(MARGIN, legend_top), width);
    svg.push_str("</svg>\n");
    out.write_all(svg.as_bytes())
}

/// Writes one sheet with the drawings of all surfaces that have a mesh, each
/// at its own scale.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together; otherwise what `out` reports.
pub fn write_all(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    check(scene)?;
    let drawings: Vec<Drawing<'_>> = (scene.surfaces.iter().zip(labels(scene)))
        .filter_map(|(surface, label)| Drawing::new(surface, &label, PANEL))
        .collect();
    let surfaces: Vec<&SurfaceMesh> = drawings.iter().map(|d| d.surface).collect();
    let legend = Legend::of(&surfaces);

    // As many columns as rows, nearly; a row is as high as its highest drawing.
    let n_columns = (1..).find(|n| n * n >= drawings.len()).unwrap_or(1).max(1);
    let column_width = PANEL + 2.0 * MARGIN;
    let width = column_width * n_columns as f64;
    let rows: Vec<f64> = (drawings.chunks(n_columns))
        .map(|row| row.iter().map(Drawing::height).fold(0.0, f64::max))
        .collect();
    let legend_top = rows.iter().sum::<f64>() + MARGIN;

    let mut svg = String::new();
    let height = legend_top + legend.height(width) + MARGIN;
    open(&mut svg, width, height, &scene.provenance, "all surfaces");
    let mut top = 0.0;
    for (row, row_height) in drawings.chunks(n_columns).zip(&rows) {
        for (column, drawing) in row.iter().enumerate() {
            let corner = dvec2(column_width * column as f64, top);
            drawing.draw(&mut svg, corner, &scene.length_unit);
        }
        top += row_height;
    }
    legend.draw(&mut svg, dvec2(MARGIN, legend_top), width);
    svg.push_str("</svg>\n");
    out.write_all(svg.as_bytes())
}

fn is_same(a: &SurfaceMesh, b: &SurfaceMesh) -> bool {
    a.name == b.name && a.part == b.part && a.is_back == b.is_back
}

fn no_nodes(label: &str) -> Error {
    let label = one_line(label);
    Error::new(
        ErrorKind::InvalidData,
        format!("surface {label} has no mesh to draw"),
    )
}

fn open(svg: &mut String, width: f64, height: f64, provenance: &str, title: &str) {
    let (w, h) = (width.ceil(), height.ceil());
    let _ = write!(
        svg,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" \
         viewBox=\"0 0 {w} {h}\">\n<title>{}</title>\n<desc>{}</desc>\n<style>{STYLE}</style>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
        xml(title),
        xml(provenance)
    );
}

/// One surface, fitted into a square of given size.
struct Drawing<'a> {
    surface: &'a SurfaceMesh,
    label: String,
    /// Lower left corner, in the face's frame.
    min: DVec2,
    /// Pixels per length unit.
    scale: f64,
    /// In pixels.
    size: DVec2,
}

impl<'a> Drawing<'a> {
    fn new(surface: &'a SurfaceMesh, label: &str, largest: f64) -> Option<Self> {
        let first = *surface.nodes_2d.first()?;
        let min = surface.nodes_2d.iter().fold(first, |m, &p| m.min(p));
        let max = surface.nodes_2d.iter().fold(first, |m, &p| m.max(p));
        let extent = (max - min).max_element();
        let scale = if extent > 0.0 { largest / extent } else { 1.0 };
        Some(Self {
            surface,
            label: label.to_owned(),
            min,
            scale,
            size: (max - min) * scale,
        })
    }

    fn height(&self) -> f64 {
        TITLE_HEIGHT + self.size.y + SCALE_BAR_HEIGHT
    }

    fn draw(&self, svg: &mut String, corner: DVec2, length_unit: &str) {
        let surface = self.surface;
        let (x, y) = (number(corner.x + MARGIN), number(corner.y + TITLE_HEIGHT));
        let n_elements = surface.n_elements();
        let _ = writeln!(
            svg,
            "<g transform=\"translate({x} {y})\">\n<text class=\"title\" y=\"-20\">{}</text>\n\
             <text class=\"note\" y=\"-5\">{n_elements} elements of degree {}, {} nodes</text>",
            xml(&self.label),
            surface.degree,
            surface.nodes.len()
        );
        self.draw_outline(svg);
        self.draw_mesh(svg);
        self.draw_curves(svg);
        self.draw_scale_bar(svg, length_unit);
        svg.push_str("</g>\n");
    }

    fn draw_outline(&self, svg: &mut String) {
        let Some(frame) = Frame::of(self.surface) else {
            return;
        };
        svg.push_str("<path class=\"outline\" fill-rule=\"evenodd\" d=\"");
        for corners in &self.surface.loops {
            self.polyline(svg, corners.iter().map(|&p| frame.in_plane(p)));
            svg.push('Z');
        }
        svg.push_str("\"/>\n");
    }

    fn draw_mesh(&self, svg: &mut String) {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for (element, is_quad) in self.surface.each_element() {
            let n = if is_quad { 4 } else { 3 };
            for k in 0..n {
                let (a, b) = (element[k], element[(k + 1) % n]);
                edges.push([a.min(b), a.max(b)]);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        svg.push_str("<path class=\"mesh\" d=\"");
        for edge in edges {
            self.polyline(svg, edge.into_iter().map(|n| self.node(n)));
        }
        svg.push_str("\"/>\n");
    }

    /// Edges of the same curves are one path; strong orders are drawn last.
    fn draw_curves(&self, svg: &mut String) {
        let mut edges_of: BTreeMap<_, Vec<[u32; 2]>> = BTreeMap::new();
        for edge in &self.surface.curve_edges {
            if let Some(curve) = strongest(self.surface, edge) {
                let order = std::cmp::Reverse(order_number(&curve.order));
                let key = (order, kind_number(&curve.kind), edge.curves.as_slice());
                edges_of.entry(key).or_default().push(edge.ends);
            }
        }
        for ((order, kind, curves), edges) in edges_of {
            let style = stroke(kind, order.0);
            let _ = write!(svg, "<path class=\"curve\" {style} d=\"");
            for chain in chains(&edges) {
                self.polyline(svg, chain.into_iter().map(|n| self.node(n)));
            }
            svg.push_str("\"><title>");
            for (i, &c) in curves.iter().enumerate() {
                let separator = if i == 0 { "" } else { "\n" };
                let _ = write!(
                    svg,
                    "{separator}{}",
                    xml(&in_words(&self.surface.curves[c as usize]))
                );
            }
            svg.push_str("</title></path>\n");
        }
    }

    fn draw_scale_bar(&self, svg: &mut String, length_unit: &str) {
        let length = nice_below(self.size.x.max(80.0) / 3.0 / self.scale);
        let (y, end) = (number(self.size.y + 16.0), number(length * self.scale));
        let middle = number(self.size.y + 20.0);
        let _ = writeln!(
            svg,
            "<path d=\"M0 {y}v-5v5H{end}v-5\" stroke=\"#222\" stroke-width=\"1.2\"/>\n\
             <text x=\"{}\" y=\"{middle}\">{length} {}</text>",
            number(length * self.scale + 7.0),
            xml(length_unit)
        );
    }

    fn node(&self, node: u32) -> DVec2 {
        self.surface.nodes_2d[node as usize]
    }

    fn polyline(&self, svg: &mut String, points: impl Iterator<Item = DVec2>) {
        for (i, p) in points.enumerate() {
            let p = (p - self.min) * self.scale;
            let command = if i == 0 { 'M' } else { 'L' };
            let _ = write!(
                svg,
                "{command}{} {}",
                number(p.x),
                number(self.size.y - p.y)
            );
        }
    }
}

/// The plane's frame, found from an element: the map from space to `nodes_2d`.
struct Frame {
    origin: DVec3,
    origin_2d: DVec2,
    axes: [DVec3; 2],
}

impl Frame {
    fn of(surface: &SurfaceMesh) -> Option<Self> {
        let axes = crate::picture::chart_axes(surface)?;
        Some(Self {
            origin: *surface.nodes.first()?,
            origin_2d: *surface.nodes_2d.first()?,
            axes,
        })
    }

    fn in_plane(&self, p: DVec3) -> DVec2 {
        let d = p - self.origin;
        self.origin_2d + dvec2(d.dot(self.axes[0]), d.dot(self.axes[1]))
    }
}

/// What the dashes and colours mean, as far as they occur.
struct Legend {
    /// Position in `KINDS` and `ORDERS`, stroke and words.
    rows: Vec<(String, String)>,
}

impl Legend {
    const ROW_WIDTH: f64 = 210.0;

    fn of(surfaces: &[&SurfaceMesh]) -> Self {
        let mut styles: Vec<(usize, usize)> = Vec::new();
        for surface in surfaces {
            for edge in &surface.curve_edges {
                if let Some(curve) = strongest(surface, edge) {
                    styles.push((order_number(&curve.order), kind_number(&curve.kind)));
                }
            }
        }
        styles.sort_unstable();
        styles.dedup();
        let row = |(order, kind): (usize, usize)| {
            let kind_name = KINDS.get(kind).copied().unwrap_or("other");
            let words = match ORDERS.get(order) {
                Some(style) if style.order == kind_name => kind_name.to_owned(),
                Some(style) => format!("{kind_name}, {}: {}", style.order, style.meaning),
                None => format!("{kind_name}, other"),
            };
            (stroke(kind, order), words)
        };
        Self {
            rows: styles.into_iter().map(row).collect(),
        }
    }

    fn columns(width: f64) -> usize {
        (((width - 2.0 * MARGIN) / Self::ROW_WIDTH) as usize).max(1)
    }

    fn height(&self, width: f64) -> f64 {
        LEGEND_ROW * self.rows.len().div_ceil(Self::columns(width)) as f64
    }

    fn draw(&self, svg: &mut String, corner: DVec2, width: f64) {
        let n_columns = Self::columns(width);
        for (i, (style, words)) in self.rows.iter().enumerate() {
            let x = corner.x + Self::ROW_WIDTH * (i % n_columns) as f64;
            let y = corner.y + LEGEND_ROW * (i / n_columns) as f64 + 4.0;
            let (x0, text_x, text_y) = (number(x), number(x + 44.0), number(y + 4.5));
            let _ = writeln!(
                svg,
                "<path {style} d=\"M{x0} {}h36\"/>\n<text x=\"{text_x}\" y=\"{text_y}\">{}</text>",
                number(y),
                xml(words)
            );
        }
    }
}

fn stroke(kind: usize, order: usize) -> String {
    let [r, g, b] = ORDERS.get(order).map_or(UNKNOWN_RGB, |o| o.rgb);
    let (width, dashes) = DASHES[kind.min(DASHES.len() - 1)];
    let dashes = match dashes {
        "" => String::new(),
        _ => format!(" stroke-dasharray=\"{dashes}\""),
    };
    format!("stroke=\"#{r:02x}{g:02x}{b:02x}\" stroke-width=\"{width}\"{dashes}")
}

fn in_words(curve: &Curve) -> String {
    let mut words = format!("{} {}", curve.kind, curve.order);
    if !curve.generators.is_empty() {
        words += &format!(": {}", curve.generators);
    }
    if let Some(emitter) = &curve.emitter {
        words += &format!(" (emitter {emitter})");
    }
    words
}

/// Joins edges end to end, so that dashes run on through the nodes.
fn chains(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut edges_at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, [a, b]) in edges.iter().enumerate() {
        edges_at.entry(*a).or_default().push(i);
        edges_at.entry(*b).or_default().push(i);
    }
    let mut is_used = vec![false; edges.len()];
    let mut chains = Vec::new();
    // Open chains from their ends first; what is left then are rings.
    let ends = edges_at
        .iter()
        .filter(|(_, at)| at.len() != 2)
        .map(|(&n, _)| n);
    let starts: Vec<u32> = ends.chain(edges_at.keys().copied()).collect();
    for start in starts {
        loop {
            let mut chain = vec![start];
            let mut node = start;
            while let Some(&i) = edges_at[&node].iter().find(|&&i| !is_used[i]) {
                is_used[i] = true;
                let [a, b] = edges[i];
                node = if a == node { b } else { a };
                chain.push(node);
                if edges_at[&node].len() != 2 {
                    break;
                }
            }
            if chain.len() == 1 {
                break;
            }
            chains.push(chain);
        }
    }
    chains
}

/// Pixels to a hundredth, without a negative zero.
fn number(x: f64) -> f64 {
    (x * 100.0).round() / 100.0 + 0.0
}

/// The largest of 1, 2, 5 times a power of ten that is not above `x`.
fn nice_below(x: f64) -> f64 {
    let power = 10_f64.powi(x.log10().floor() as i32);
    let fits = |m: &f64| m * power <= x * (1.0 + 1e-9);
    [5.0, 2.0, 1.0].into_iter().find(fits).unwrap_or(1.0) * power
}
