//! VTU: VTK's unstructured grid, XML with inline base64.
//!
//! The first piece holds the elements at their true degree, the second the
//! mesh edges that lie on curves, as lines. Both have the same arrays, as VTK
//! demands of pieces: a line has degree 1 and error 0, an element has -1 for
//! the curve's kind and order. The numbers are explained in a comment at the
//! top of the file, since string arrays defeat some readers.

use std::collections::BTreeMap;
use std::io::{Result, Write};

use antumbra_geom::DVec3;

use super::{
    KINDS, ORDERS, check, field_names, fields_in_order, kind_number, labels, order_number,
    strongest, xml,
};
use crate::model::MeshedScene;

/// VTK's cell types.
const LINE: u8 = 3;
const TRIANGLE: u8 = 5;
const QUADRATIC_TRIANGLE: u8 = 22;
const LAGRANGE_TRIANGLE: u8 = 69;
const QUAD: u8 = 9;
const LAGRANGE_QUADRILATERAL: u8 = 70;

/// Writes the scene as VTU.
///
/// A field that a surface does not have is written as 0 there.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together; otherwise what `out` reports.
pub fn write(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    check(scene)?;
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
    write_legend(scene, out)?;
    writeln!(
        out,
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<UnstructuredGrid>"
    )?;
    elements(scene).write(scene, out)?;
    curve_edges(scene).write(scene, out)?;
    writeln!(out, "</UnstructuredGrid>\n</VTKFile>")
}

fn write_legend(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    // A comment must not hold two hyphens in a row.
    let text = |t: &str| xml(t).replace("--", "- -").replace("--", "- -");
    writeln!(out, "<!--\nantumbra mesh")?;
    writeln!(out, "{} ", text(&scene.provenance))?;
    writeln!(out, "length unit: {}", text(&scene.length_unit))?;
    writeln!(out, "unit: {}", text(&scene.unit))?;
    for (i, label) in labels(scene).iter().enumerate() {
        writeln!(out, "surface {i}: {} ", text(label))?;
    }
    for (i, kind) in KINDS.iter().enumerate() {
        writeln!(out, "curve_kind {i}: {kind}")?;
    }
    for (i, style) in ORDERS.iter().enumerate() {
        writeln!(out, "curve_order {i}: {} ({})", style.order, style.meaning)?;
    }
    writeln!(
        out,
        "curve_kind -1, curve_order -1: not a curve but an element"
    )?;
    writeln!(out, "element_error: relative to the peak, as measured\n-->")
}

/// One piece of the grid.
#[derive(Default)]
struct Piece {
    points: Vec<DVec3>,
    /// Field after field, point after point, bands together.
    fields: Vec<Vec<f64>>,
    connectivity: Vec<i64>,
    offsets: Vec<i64>,
    types: Vec<u8>,
    surface: Vec<i32>,
    degree: Vec<i32>,
    element_error: Vec<f64>,
    curve_kind: Vec<i32>,
    curve_order: Vec<i32>,
    curve_count: Vec<i32>,
}

fn elements(scene: &MeshedScene) -> Piece {
    let names = field_names(scene);
    let mut piece = Piece::with_fields(names.len());
    for (surface_id, surface) in scene.surfaces.iter().enumerate() {
        let first_point = piece.points.len() as i64;
        piece.points.extend(&surface.nodes);
        let n_values = surface.nodes.len() * scene.n_bands;
        for (field, values) in fields_in_order(surface, &names)
            .iter()
            .zip(&mut piece.fields)
        {
            match field {
                Some(field) => values.extend(&field.values),
                None => values.resize(values.len() + n_values, 0.0),
            }
        }
        let cell_types = match surface.degree {
            1 => [TRIANGLE, QUAD],
            2 => [QUADRATIC_TRIANGLE, LAGRANGE_QUADRILATERAL],
            _ => [LAGRANGE_TRIANGLE, LAGRANGE_QUADRILATERAL],
        };
        for (i, (nodes, is_quad)) in surface.each_element().enumerate() {
            let points = nodes.iter().map(|&n| first_point + i64::from(n));
            let cell_type = cell_types[usize::from(is_quad)];
            piece.push_cell(points, cell_type, surface_id, surface.degree);
            let error = surface.element_errors.get(i);
            piece.element_error.push(error.copied().unwrap_or_default());
            piece.push_curve(-1, -1, 0);
        }
    }
    piece
}

fn curve_edges(scene: &MeshedScene) -> Piece {
    let names = field_names(scene);
    let mut piece = Piece::with_fields(names.len());
    for (surface_id, surface) in scene.surfaces.iter().enumerate() {
        let fields = fields_in_order(surface, &names);
        let mut point_of_node = BTreeMap::new();
        for edge in &surface.curve_edges {
            let ends = edge.ends.map(|node| {
                *point_of_node.entry(node).or_insert_with(|| {
                    let node = node as usize;
                    piece.points.push(surface.nodes[node]);
                    for (field, values) in fields.iter().zip(&mut piece.fields) {
                        let of_node = node * scene.n_bands..(node + 1) * scene.n_bands;
                        match field {
                            Some(field) => values.extend(&field.values[of_node]),
                            None => values.resize(values.len() + scene.n_bands, 0.0),
                        }
                    }
                    piece.points.len() as i64 - 1
                })
            });
            piece.push_cell(ends.into_iter(), LINE, surface_id, 1);
            piece.element_error.push(0.0);
            let curve = strongest(surface, edge);
            let kind = curve.map_or(-1, |c| kind_number(&c.kind) as i32);
            let order = curve.map_or(-1, |c| order_number(&c.order) as i32);
            piece.push_curve(kind, order, edge.curves.len() as i32);
        }
    }
    piece
}

impl Piece {
    fn with_fields(n_fields: usize) -> Self {
        Self {
            fields: vec![Vec::new(); n_fields],
            ..Self::default()
        }
    }

    fn push_cell(
        &mut self,
        points: impl Iterator<Item = i64>,
        cell_type: u8,
        surface: usize,
        degree: u8,
    ) {
        self.connectivity.extend(points);
        self.offsets.push(self.connectivity.len() as i64);
        self.types.push(cell_type);
        self.surface.push(surface as i32);
        self.degree.push(i32::from(degree));
    }

    fn push_curve(&mut self, kind: i32, order: i32, count: i32) {
        self.curve_kind.push(kind);
        self.curve_order.push(order);
        self.curve_count.push(count);
    }

    fn write(&self, scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
        let (n_points, n_cells) = (self.points.len(), self.types.len());
        writeln!(
            out,
            "<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">"
        )?;

        writeln!(out, "<PointData>")?;
        for (name, values) in field_names(scene).iter().zip(&self.fields) {
            let bytes = values.iter().flat_map(|v| v.to_le_bytes());
            write_array(out, "Float64", &xml(name), scene.n_bands, bytes)?;
        }
        writeln!(out, "</PointData>\n<CellData>")?;
        let ints = |v: &[i32]| v.iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<u8>>();
        write_array(out, "Int32", "surface", 1, ints(&self.surface))?;
        write_array(out, "Int32", "degree", 1, ints(&self.degree))?;
        let errors = self.element_error.iter().flat_map(|v| v.to_le_bytes());
        write_array(out, "Float64", "element_error", 1, errors)?;
        write_array(out, "Int32", "curve_kind", 1, ints(&self.curve_kind))?;
        write_array(out, "Int32", "curve_order", 1, ints(&self.curve_order))?;
        write_array(out, "Int32", "curve_count", 1, ints(&self.curve_count))?;
        writeln!(out, "</CellData>\n<Points>")?;
        let coordinates = self.points.iter().flat_map(|p| p.to_array());
        let bytes = coordinates.flat_map(f64::to_le_bytes);
        write_array(out, "Float64", "Points", 3, bytes)?;
        writeln!(out, "</Points>\n<Cells>")?;
        let longs = |v: &[i64]| v.iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<u8>>();
        write_array(out, "Int64", "connectivity", 1, longs(&self.connectivity))?;
        write_array(out, "Int64", "offsets", 1, longs(&self.offsets))?;
        write_array(out, "UInt8", "types", 1, self.types.iter().copied())?;
        writeln!(out, "</Cells>\n</Piece>")
    }
}

/// One inline array: its length in bytes as UInt64, then the bytes, in one
/// base64 text.
fn write_array(
    out: &mut impl Write,
    number: &str,
    name: &str,
    n_components: usize,
    bytes: impl IntoIterator<Item = u8>,
) -> Result<()> {
    let bytes: Vec<u8> = bytes.into_iter().collect();
    let length = (bytes.len() as u64).to_le_bytes();
    writeln!(
        out,
        "<DataArray type=\"{number}\" Name=\"{name}\" NumberOfComponents=\"{n_components}\" \
         format=\"binary\">"
    )?;
    out.write_all(&base64(length.into_iter().chain(bytes)))?;
    writeln!(out, "\n</DataArray>")
}

fn base64(bytes: impl Iterator<Item = u8>) -> Vec<u8> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = Vec::new();
    let mut bytes = bytes.fuse();
    while let Some(first) = bytes.next() {
        let (second, third) = (bytes.next(), bytes.next());
        let [b, c] = [second, third].map(Option::unwrap_or_default);
        let word = u32::from_be_bytes([0, first, b, c]);
        let digit = |shift: u32| DIGITS[(word >> shift & 63) as usize];
        text.push(digit(18));
        text.push(digit(12));
        text.push(if second.is_some() { digit(6) } else { b'=' });
        text.push(if third.is_some() { digit(0) } else { b'=' });
    }
    text
}

#[cfg(test)]
mod tests {
    use super::base64;

    #[test]
    fn base64_gives_the_examples_of_rfc_4648() {
        let examples = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (bytes, text) in examples {
            assert_eq!(base64(bytes.bytes()), text.as_bytes());
        }
    }
}
