//! From the engine's meshes to what the writers write.

use crate::outcome::{Outcome, ReceiverCurves};
use antumbra_geom::{Chart, distance_to_segment};
use antumbra_io::model::{Curve, CurveEdge, FactorTable, Field, MeshedScene, SurfaceMesh};
use antumbra_mesh::cells::Beyond;
use antumbra_mesh::{Order, TriMesh};
use antumbra_scene::{EdgeId, FaceId, Scene, Surface, VertexId};
use antumbra_solver::{Cells, Elements, FormFactors, ReceiverMesh};
use antumbra_visibility::{CriticalCurve, Discontinuity, Event};
use glam::DVec2;

/// The meshes in file units with names, for the writers of [`crate::io`].
///
/// Fields are `direct`, and after a solve `irradiance` and `radiosity`
/// (exitance plus reflectance times irradiance). The only curves of cells are borders.
#[must_use]
pub fn export(scene: &Scene, outcome: &Outcome, provenance: &str) -> MeshedScene {
    MeshedScene {
        length_unit: scene.length_unit.symbol().to_owned(),
        unit: scene.quantity.irradiance_unit().to_owned(),
        n_bands: scene.n_bands,
        surfaces: outcome
            .mesh
            .receivers
            .iter()
            .zip(&outcome.curves)
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
        missing: matrix.missing.clone(),
        is_repaired,
        is_closed: scene.report().closed,
        provenance: provenance.to_owned(),
    }
}

fn surface(scene: &Scene, mesh: &ReceiverMesh, curves: &ReceiverCurves) -> SurfaceMesh {
    let values = [mesh.direct.as_slice(), mesh.irradiance.as_slice()];
    let bare = SurfaceMesh {
        degree: mesh.degree,
        curves: curve_table(scene, mesh.face, &curves.critical),
        ..bare_surface(scene, mesh.face, &mesh.chart, &mesh.nodes, values)
    };
    let n_curves = (curves.n_border + curves.critical.len()) as u32;
    match &mesh.elements {
        Elements::Triangles(triangles) => SurfaceMesh {
            elements: mesh.element_nodes.clone(),
            element_errors: mesh.element_errors.clone(),
            curve_edges: curve_edges(mesh, &triangles.mesh, n_curves),
            ..bare
        },
        Elements::Cells(cells) => {
            let loops = scene.loops_in_chart(mesh.face, &mesh.chart);
            with_cells(bare, mesh, cells, &loops)
        }
    }
}

/// Triangles come first in the table of errors, then quadrilaterals.
fn with_cells(
    bare: SurfaceMesh,
    mesh: &ReceiverMesh,
    cells: &Cells,
    loops: &[Vec<DVec2>],
) -> SurfaceMesh {
    let (mut elements, mut quads) = (Vec::new(), Vec::new());
    let (mut errors, mut quad_errors) = (Vec::new(), Vec::new());
    let mut edges = Vec::new();
    for (c, cell) in cells.mesh.cells.iter().enumerate() {
        let nodes = mesh.nodes_of(c);
        let error = mesh.element_errors[c];
        if cell.is_quadrilateral() {
            quads.extend_from_slice(nodes);
            quad_errors.push(error);
        } else {
            elements.extend_from_slice(nodes);
            errors.push(error);
        }
        let n = cell.corners().len();
        for k in (0..n).filter(|&k| cells.mesh.beyond(c, k) == Beyond::Border) {
            let [p, q] = cell.edge(k).map(|v| cells.mesh.vertices[v as usize]);
            edges.push(CurveEdge {
                ends: [nodes[k], nodes[(k + 1) % n]],
                curves: vec![nearest_loop(loops, (p + q) / 2.0)],
            });
        }
    }
    errors.extend(quad_errors);
    SurfaceMesh {
        elements,
        quads,
        element_errors: errors,
        curve_edges: edges,
        ..bare
    }
}

/// The loop of a border that a point is on.
fn nearest_loop(loops: &[Vec<DVec2>], point: DVec2) -> u32 {
    let distance = |l: &Vec<DVec2>| {
        (0..l.len())
            .map(|i| distance_to_segment([l[i], l[(i + 1) % l.len()]], point))
            .fold(f64::INFINITY, f64::min)
    };
    let by_distance = |a: &usize, b: &usize| distance(&loops[*a]).total_cmp(&distance(&loops[*b]));
    (0..loops.len()).min_by(by_distance).unwrap_or(0) as u32
}

/// A face with its nodes and their values, without elements.
///
/// * `values` — direct irradiance, and irradiance with interreflection or nothing.
fn bare_surface(
    scene: &Scene,
    face_id: FaceId,
    chart: &Chart,
    nodes: &[DVec2],
    [direct, irradiance]: [&[f64]; 2],
) -> SurfaceMesh {
    let face = scene.face(face_id);
    let surface = scene.surface_of(face_id);
    let mut fields = vec![Field {
        name: "direct".into(),
        values: direct.to_vec(),
    }];
    if !irradiance.is_empty() {
        let material = scene.material(face_id);
        let radiosity = irradiance
            .iter()
            .enumerate()
            .map(|(i, e)| {
                let band = i % scene.n_bands;
                material.exitance[band] + material.reflectance[band] * e
            })
            .collect();
        fields.push(Field {
            name: "irradiance".into(),
            values: irradiance.to_vec(),
        });
        fields.push(Field {
            name: "radiosity".into(),
            values: radiosity,
        });
    }
    let in_file = |p| scene.frame.to_file(p);
    SurfaceMesh {
        name: surface.name.clone(),
        part: (face_id.0 - surface.faces.start) as usize,
        is_back: face.is_back,
        normal: face.normal,
        loops: face
            .loops()
            .map(|l| scene.positions(l).into_iter().map(in_file).collect())
            .collect(),
        nodes: nodes
            .iter()
            .map(|&uv| in_file(chart.to_space(uv)))
            .collect(),
        nodes_2d: nodes.iter().map(|&uv| uv / scene.frame.scale).collect(),
        fields,
        ..SurfaceMesh::default()
    }
}

/// Mesh edges on curves, by the corner nodes of the first element that has them.
fn curve_edges(mesh: &ReceiverMesh, triangles: &TriMesh, n_curves: u32) -> Vec<CurveEdge> {
    let mut edges = Vec::new();
    for (t, triangle) in triangles.triangles.iter().enumerate() {
        let nodes = mesh.nodes_of(t);
        for k in 0..3 {
            let next = (k + 1) % 3;
            let (a, b) = (triangle[k], triangle[next]);
            // Each edge once: from the element with the smaller index.
            if triangles
                .neighbour(t as u32, k)
                .is_some_and(|other| (other as usize) < t)
            {
                continue;
            }
            let set = triangles.edge_curves(a, b);
            let all = set.map_or(&[][..], |set| triangles.sets().get(set));
            // Lines for the sake of reflected light are no critical curves.
            let curves: Vec<u32> = all.iter().copied().filter(|&c| c < n_curves).collect();
            if !curves.is_empty() {
                edges.push(CurveEdge {
                    ends: [nodes[k], nodes[next]],
                    curves,
                });
            }
        }
    }
    edges
}

/// Arcs are drawn as chords this close to them, relative to their surface.
const DRAWN: f64 = 1e-4;

fn curve_table(scene: &Scene, face_id: FaceId, critical: &[CriticalCurve]) -> Vec<Curve> {
    let face = scene.face(face_id);
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
            generators: format!("border of {}", scene.surface_of(face_id).name),
            points,
        }
    });
    let critical = critical.iter().map(|curve| Curve {
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
