//! JSON: everything there is.
//!
//! Fields are written node by node, one array of bands each. Where the field
//! jumps, at a contact, a position occurs as two nodes, one per side; so the
//! values of an element's nodes are the values of its side. A value that is
//! not finite is `null`.

use std::io::{Result, Write};

use serde::Serialize;
use serde::ser::{SerializeMap, SerializeSeq, Serializer};

use super::{check, labels};
use crate::model::{Curve, CurveEdge, Field, MeshedScene, SurfaceMesh};
use antumbra_geom::{DVec2, DVec3};

/// Version of the layout, the value of `antumbra_mesh`.
pub const VERSION: u32 = 1;

/// Writes the scene as JSON.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together; otherwise what `out` reports.
pub fn write(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    check(scene)?;
    let labels = labels(scene);
    let surfaces = scene.surfaces.iter().zip(&labels);
    let document = Document {
        antumbra_mesh: VERSION,
        provenance: &scene.provenance,
        length_unit: &scene.length_unit,
        unit: &scene.unit,
        n_bands: scene.n_bands,
        surfaces: surfaces
            .map(|(surface, label)| Surface::new(surface, label, scene.n_bands))
            .collect(),
    };
    serde_json::to_writer(&mut *out, &document)?;
    writeln!(out)
}

#[derive(Serialize)]
struct Document<'a> {
    antumbra_mesh: u32,
    provenance: &'a str,
    length_unit: &'a str,
    unit: &'a str,
    n_bands: usize,
    surfaces: Vec<Surface<'a>>,
}

#[derive(Serialize)]
struct Surface<'a> {
    name: &'a str,
    label: &'a str,
    part: usize,
    is_back: bool,
    normal: Point,
    loops: Vec<Points<'a>>,
    degree: u8,
    nodes: Points<'a>,
    nodes_2d: Points2d<'a>,
    fields: Fields<'a>,
    elements: Elements<'a>,
    constraint_edges: Vec<Edge<'a>>,
    curves: Vec<CurveOut<'a>>,
}

impl<'a> Surface<'a> {
    fn new(surface: &'a SurfaceMesh, label: &'a str, n_bands: usize) -> Self {
        Self {
            name: &surface.name,
            label,
            part: surface.part,
            is_back: surface.is_back,
            normal: surface.normal.to_array(),
            loops: surface.loops.iter().map(|l| Points(l)).collect(),
            degree: surface.degree,
            nodes: Points(&surface.nodes),
            nodes_2d: Points2d(&surface.nodes_2d),
            fields: Fields(&surface.fields, n_bands),
            elements: Elements(surface),
            constraint_edges: surface.curve_edges.iter().map(Edge::new).collect(),
            curves: surface.curves.iter().map(CurveOut::new).collect(),
        }
    }
}

#[derive(Serialize)]
struct Element<'a> {
    degree: u8,
    /// Only of quadrilaterals: all others are triangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    shape: Option<&'static str>,
    nodes: &'a [u32],
    error: Option<f64>,
}

#[derive(Serialize)]
struct Edge<'a> {
    ends: [u32; 2],
    curves: &'a [u32],
}

impl<'a> Edge<'a> {
    fn new(edge: &'a CurveEdge) -> Self {
        Self {
            ends: edge.ends,
            curves: &edge.curves,
        }
    }
}

#[derive(Serialize)]
struct CurveOut<'a> {
    kind: &'a str,
    order: &'a str,
    emitter: Option<&'a str>,
    generators: &'a str,
    points: Points<'a>,
}

impl<'a> CurveOut<'a> {
    fn new(curve: &'a Curve) -> Self {
        Self {
            kind: &curve.kind,
            order: &curve.order,
            emitter: curve.emitter.as_deref(),
            generators: &curve.generators,
            points: Points(&curve.points),
        }
    }
}

type Point = [f64; 3];
struct Points<'a>(&'a [DVec3]);
struct Points2d<'a>(&'a [DVec2]);
struct Elements<'a>(&'a SurfaceMesh);
struct Fields<'a>(&'a [Field], usize);
struct Bands<'a>(&'a [f64], usize);

impl Serialize for Points<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.collect_seq(self.0.iter().map(DVec3::to_array))
    }
}

impl Serialize for Points2d<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.collect_seq(self.0.iter().map(DVec2::to_array))
    }
}

impl Serialize for Elements<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        let mut sequence = to.serialize_seq(None)?;
        for (i, (nodes, is_quad)) in self.0.each_element().enumerate() {
            sequence.serialize_element(&Element {
                degree: self.0.degree,
                shape: is_quad.then_some("quadrilateral"),
                nodes,
                error: self.0.element_errors.get(i).copied(),
            })?;
        }
        sequence.end()
    }
}

impl Serialize for Fields<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(self.0.len()))?;
        for field in self.0 {
            map.serialize_entry(&field.name, &Bands(&field.values, self.1))?;
        }
        map.end()
    }
}

impl Serialize for Bands<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.collect_seq(self.0.chunks_exact(self.1.max(1)))
    }
}
