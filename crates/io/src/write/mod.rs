//! Writers: a [`MeshedScene`] to text or bytes.
//!
//! Every writer looks at the whole scene before it writes the first byte: a
//! mesh whose parts do not fit together is an error, not half a file. The same
//! scene gives the same bytes. Text holds floats in the shortest form that
//! reads back to the same bits, and never `nan`: what has no value is empty,
//! `null` or grey.

pub mod csv;
pub mod factors;
pub mod json;
pub(crate) mod lattice;
pub mod obj;
pub mod ply;
pub mod svg;
pub mod vtu;

use std::collections::BTreeMap;
use std::io::{Error, ErrorKind, Result};

use crate::model::{Curve, CurveEdge, Field, MeshedScene, SurfaceMesh};

/// Kinds of curves; the position is the number written to VTU.
pub(crate) const KINDS: [&str; 7] = ["border", "ve", "ee", "eee", "facet", "horizon", "contact"];

/// An order of discontinuity, and how it is shown everywhere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrderStyle {
    pub(crate) order: &'static str,
    pub(crate) meaning: &'static str,
    /// From Okabe and Ito's palette, distinct under colour blindness.
    pub(crate) rgb: [u8; 3],
}

/// Orders, strongest first; the position is the number written to VTU.
pub(crate) const ORDERS: [OrderStyle; 4] = [
    OrderStyle {
        order: "d0",
        meaning: "value jumps",
        rgb: [0xd5, 0x5e, 0x00],
    },
    OrderStyle {
        order: "d1",
        meaning: "slope jumps",
        rgb: [0x00, 0x72, 0xb2],
    },
    OrderStyle {
        order: "d2",
        meaning: "curvature jumps",
        rgb: [0x00, 0x9e, 0x73],
    },
    OrderStyle {
        order: "border",
        meaning: "border",
        rgb: [0x50, 0x50, 0x50],
    },
];

/// Position in [`KINDS`]; one past its end for an unknown kind.
pub(crate) fn kind_number(kind: &str) -> usize {
    let position = KINDS.iter().position(|&k| k == kind);
    position.unwrap_or(KINDS.len())
}

/// Position in [`ORDERS`]; one past its end for an unknown order.
pub(crate) fn order_number(order: &str) -> usize {
    let position = ORDERS.iter().position(|o| o.order == order);
    position.unwrap_or(ORDERS.len())
}

/// The curve that decides how an edge is shown: the strongest order, then kind.
pub(crate) fn strongest<'a>(surface: &'a SurfaceMesh, edge: &CurveEdge) -> Option<&'a Curve> {
    (edge.curves.iter())
        .map(|&c| &surface.curves[c as usize])
        .min_by_key(|curve| (order_number(&curve.order), kind_number(&curve.kind)))
}

/// Names of the surfaces, told apart: `.part` where a surface was split,
/// `.back` for the back of a two-sided one.
pub(crate) fn labels(scene: &MeshedScene) -> Vec<String> {
    let mut last_part = BTreeMap::new();
    for surface in &scene.surfaces {
        let last = last_part.entry(surface.name.as_str()).or_insert(0);
        *last = surface.part.max(*last);
    }
    let label = |surface: &SurfaceMesh| {
        let mut label = surface.name.clone();
        if last_part[surface.name.as_str()] > 0 {
            label += &format!(".{}", surface.part);
        }
        if surface.is_back {
            label += ".back";
        }
        label
    };
    scene.surfaces.iter().map(label).collect()
}

/// Names of all fields of the scene, in the order they are met.
pub(crate) fn field_names(scene: &MeshedScene) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for field in scene.surfaces.iter().flat_map(|s| &s.fields) {
        if !names.contains(&field.name.as_str()) {
            names.push(&field.name);
        }
    }
    names
}

/// Names of the numbers a node has: `direct`, or `direct_0`, `direct_1`, ….
pub(crate) fn value_names(scene: &MeshedScene) -> Vec<String> {
    let n_bands = scene.n_bands;
    let of_field = |name: &str| -> Vec<String> {
        match n_bands {
            1 => vec![name.to_owned()],
            _ => (0..n_bands).map(|b| format!("{name}_{b}")).collect(),
        }
    };
    field_names(scene).into_iter().flat_map(of_field).collect()
}

/// The fields of `surface` in the order of `names`; `None` where it has none.
pub(crate) fn fields_in_order<'a>(
    surface: &'a SurfaceMesh,
    names: &[&str],
) -> Vec<Option<&'a Field>> {
    names.iter().map(|name| surface.field(name)).collect()
}

/// A comment or a name on one line: control characters become spaces.
pub(crate) fn one_line(text: &str) -> String {
    let clean = |c: char| if c.is_control() { ' ' } else { c };
    text.chars().map(clean).collect()
}

/// Text for XML content, attributes and comments alike.
pub(crate) fn xml(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(c),
        }
    }
    escaped
}

/// Do the parts of the scene fit together?
pub(crate) fn check(scene: &MeshedScene) -> Result<()> {
    for (i, surface) in scene.surfaces.iter().enumerate() {
        if let Some(problem) = problem_of(surface, scene.n_bands) {
            let name = &surface.name;
            let message = format!("mesh of surface {i} ({name}): {problem}");
            return Err(Error::new(ErrorKind::InvalidData, message));
        }
    }
    Ok(())
}

fn problem_of(surface: &SurfaceMesh, n_bands: usize) -> Option<String> {
    let n_nodes = surface.nodes.len();
    if surface.elements.is_empty() && surface.quads.is_empty() && surface.degree == 0 {
        // A face that was not meshed: nothing to interpolate.
    } else if !(1..=4).contains(&surface.degree) {
        return Some(format!("degree {} (allowed 1 to 4)", surface.degree));
    }
    let is_whole = surface
        .elements
        .len()
        .is_multiple_of(surface.nodes_per_element())
        && surface.quads.len().is_multiple_of(surface.nodes_per_quad());
    if !is_whole {
        return Some("the last element is not complete".to_owned());
    }
    let mut used = surface.elements.iter().chain(&surface.quads);
    if let Some(node) = used.find(|&&n| n as usize >= n_nodes) {
        return Some(format!("an element has node {node} of {n_nodes}"));
    }
    if surface.nodes_2d.len() != n_nodes {
        let n = surface.nodes_2d.len();
        return Some(format!("{n} positions in the plane for {n_nodes} nodes"));
    }
    let corners = surface.loops.iter().flatten();
    let is_finite = corners.chain(&surface.nodes).all(|p| p.is_finite())
        && surface.nodes_2d.iter().all(|p| p.is_finite())
        && surface.normal.is_finite();
    if !is_finite {
        return Some("a coordinate is not finite".to_owned());
    }
    for field in &surface.fields {
        let (found, expected) = (field.values.len(), n_nodes * n_bands);
        if found != expected {
            let name = &field.name;
            return Some(format!("{found} values of {name} (expected {expected})"));
        }
    }
    let n_elements = surface.n_elements();
    let n_errors = surface.element_errors.len();
    if n_errors != 0 && n_errors != n_elements {
        return Some(format!("{n_errors} errors for {n_elements} elements"));
    }
    for edge in &surface.curve_edges {
        if edge.ends.iter().any(|&n| n as usize >= n_nodes) {
            return Some(format!("edge {:?} of {n_nodes} nodes", edge.ends));
        }
        let n_curves = surface.curves.len();
        if edge.curves.iter().any(|&c| c as usize >= n_curves) {
            return Some(format!("curves {:?} of {n_curves}", edge.curves));
        }
    }
    None
}
