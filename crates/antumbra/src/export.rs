//! From the engine's meshes to what the writers write.

use crate::pipeline::ReceiverCurves;
use antumbra_io::model::{Curve, CurveEdge, FactorTable, Field, MeshedScene, SurfaceMesh};
use antumbra_mesh::Order;
use antumbra_scene::{EdgeId, FaceId, Scene, Surface, VertexId};
use antumbra_solver::{DirectSolution, FormFactors, ReceiverMesh};
use antumbra_visibility::{CriticalCurve, Discontinuity, Event};

/// The meshes in file units with names, for the writers of [`crate::io`].
///
/// Fields are `direct`, and after a solve `irradiance` and `radiosity`
/// (exitance plus reflectance times irradiance).
#[must_use]
pub fn export(
    scene: &Scene,
    solution: &DirectSolution,
    curves: &[ReceiverCurves],
    provenance: &str,
) -> MeshedScene {
    MeshedScene {
        length_unit: scene.length_unit.symbol().to_owned(),
        unit: scene.quantity.irradiance_unit().to_owned(),
        n_bands: scene.n_bands,
        surfaces: solution
            .receivers
            .iter()
            .zip(curves)
            .map(|(mesh, curves)| surface(scene, mesh, curves))
            .collect(),
        provenance: provenance.to_owned(),
    }
}

/// Form factors as a table for the writers of [`crate::io`].
///
/// * `is_repaired` — were they scaled by [`FormFactors::repair`]?
#[must_use]
pub fn export_factors(
    scene: &Scene,
    matrix: &FormFactors,
    is_repaired: bool,
    provenance: &str,
) -> FactorTable {
    let emissivity = |surface: &Surface| {
        let reflectance = &scene.materials[surface.material.index()].reflectance;
        1.0 - reflectance.iter().sum::<f64>() / reflectance.len().max(1) as f64
    };
    FactorTable {
        length_unit: scene.length_unit.symbol().to_owned(),
        names: matrix.names.clone(),
        areas: matrix.areas.clone(),
        emissivities: scene.surfaces.iter().map(emissivity).collect(),
        values: matrix.values.clone(),
        errors: matrix.errors.clone(),
        is_repaired,
        is_closed: scene.report().closed,
        provenance: provenance.to_owned(),
    }
}

fn surface(scene: &Scene, mesh: &ReceiverMesh, curves: &ReceiverCurves) -> SurfaceMesh {
    let face = scene.face(mesh.face);
    let surface = scene.surface_of(mesh.face);
    let nodes: Vec<_> = mesh
        .nodes
        .iter()
        .map(|&uv| scene.frame.to_file(mesh.chart.to_space(uv)))
        .collect();
    let mut fields = vec![Field {
        name: "direct".into(),
        values: mesh.direct.clone(),
    }];
    if !mesh.irradiance.is_empty() {
        let material = scene.material(mesh.face);
        let radiosity = mesh
            .irradiance
            .iter()
            .enumerate()
            .map(|(i, e)| {
                let band = i % scene.n_bands;
                material.exitance[band] + material.reflectance[band] * e
            })
            .collect();
        fields.push(Field {
            name: "irradiance".into(),
            values: mesh.irradiance.clone(),
        });
        fields.push(Field {
            name: "radiosity".into(),
            values: radiosity,
        });
    }
    SurfaceMesh {
        name: surface.name.clone(),
        part: (mesh.face.0 - surface.faces.start) as usize,
        is_back: face.is_back,
        normal: face.normal,
        loops: face
            .loops()
            .map(|l| {
                scene
                    .positions(l)
                    .into_iter()
                    .map(|p| scene.frame.to_file(p))
                    .collect()
            })
            .collect(),
        degree: mesh.degree,
        nodes_2d: mesh
            .nodes
            .iter()
            .map(|&uv| uv / scene.frame.scale)
            .collect(),
        nodes,
        elements: mesh.element_nodes.clone(),
        fields,
        element_errors: mesh.element_errors.clone(),
        curve_edges: curve_edges(mesh),
        curves: curve_table(scene, mesh, curves),
    }
}

/// Mesh edges on curves, by the corner nodes of the first element that has them.
fn curve_edges(mesh: &ReceiverMesh) -> Vec<CurveEdge> {
    let mut edges = Vec::new();
    for (t, triangle) in mesh.mesh.triangles.iter().enumerate() {
        let nodes = mesh.nodes_of(t);
        for k in 0..3 {
            let next = (k + 1) % 3;
            let (a, b) = (triangle[k], triangle[next]);
            // Each edge once: from the element with the smaller index.
            if mesh
                .mesh
                .neighbour(t as u32, k)
                .is_some_and(|other| (other as usize) < t)
            {
                continue;
            }
            if let Some(set) = mesh.mesh.edge_curves(a, b) {
                edges.push(CurveEdge {
                    ends: [nodes[k], nodes[next]],
                    curves: mesh.mesh.sets().get(set).to_vec(),
                });
            }
        }
    }
    edges
}

/// Arcs are drawn as chords this close to them, relative to their surface.
const DRAWN: f64 = 1e-4;

fn curve_table(scene: &Scene, mesh: &ReceiverMesh, curves: &ReceiverCurves) -> Vec<Curve> {
    let face = scene.face(mesh.face);
    let border = face.loops().map(|l| {
        let mut points: Vec<_> = scene
            .positions(l)
            .into_iter()
            .map(|p| scene.frame.to_file(p))
            .collect();
        points.extend(points.first().copied());
        Curve {
            kind: "border".into(),
            order: "border".into(),
            emitter: None,
            generators: format!("border of {}", scene.surface_of(mesh.face).name),
            points,
        }
    });
    let critical = curves.critical.iter().map(|curve| Curve {
        kind: curve.kind().key().into(),
        order: order_key(curve.kind().discontinuity()).into(),
        emitter: curve.emitter.map(|f| scene.surface_of(f).name.clone()),
        generators: generators(scene, curve),
        points: curve
            .shape
            .polyline(DRAWN * face.area.sqrt())
            .into_iter()
            .map(|p| scene.frame.to_file(p))
            .collect(),
    });
    border.chain(critical).collect()
}

/// `d0`, `d1` or `d2`.
#[must_use]
pub fn order_key(order: Discontinuity) -> &'static str {
    match order {
        Discontinuity::D0 => "d0",
        Discontinuity::D1 => "d1",
        Discontinuity::D2 => "d2",
    }
}

/// The key of a mesh edge's order: `border`, `d0`, `d1` or `d2`.
#[must_use]
pub fn mesh_order_key(order: Order) -> &'static str {
    match order {
        Order::Boundary => "border",
        Order::D0 => "d0",
        Order::D1 => "d1",
        Order::D2 => "d2",
    }
}

/// The generators of a curve in words: features by the surfaces they belong to.
#[must_use]
pub fn generators(scene: &Scene, curve: &CriticalCurve) -> String {
    let face = |id: FaceId| scene.surface_of(id).name.clone();
    let edge = |id: EdgeId| {
        let faces = &scene.edges[id.index()].faces;
        let names: Vec<String> = faces.iter().map(|&f| face(f)).collect();
        format!("edge {}({})", id.0, names.join("|"))
    };
    let vertex = |id: VertexId| {
        let p = scene.frame.to_file(scene.position(id));
        format!("vertex {}({} {} {})", id.0, p.x, p.y, p.z)
    };
    match curve.event {
        Event::EmitterVertex { vertex: v, edge: e } => {
            format!("emitter {} × {}", vertex(v), edge(e))
        }
        Event::EmitterEdge { edge: e, vertex: v } => format!("emitter {} × {}", edge(e), vertex(v)),
        Event::VertexEdge { vertex: v, edge: e } => format!("{} × {}", vertex(v), edge(e)),
        Event::CoplanarEdges { emitter, occluder } => {
            format!("emitter {} ∥ {}", edge(emitter), edge(occluder))
        }
        Event::OccluderEdges([e, f]) => format!("{} ∥ {}", edge(e), edge(f)),
        Event::EmitterTriple {
            emitter,
            occluders: [e, f],
        } => format!("emitter {} × {} × {}", edge(emitter), edge(e), edge(f)),
        Event::Triple([e, f, g]) => format!("{} × {} × {}", edge(e), edge(f), edge(g)),
        Event::FacetPlane(f) => format!("plane of {}", face(f)),
        Event::EmitterPlane(f) => format!("plane of emitter {}", face(f)),
        Event::Contact(f) => format!("contact with {}", face(f)),
    }
}
