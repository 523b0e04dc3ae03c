//! From what a file says to a valid [`Scene`]: one pass, all problems.
//!
//! The order matters: an exact change of coordinates, welding, outlines (repeats,
//! keyholes, holes, planarity), corners moved onto planes, plane classes, covered faces, edges,
//! overlaps. Each tolerance is
//! consulted once, here; what it decides is an id afterwards.

mod covered;
pub(crate) mod crooked;
mod flat;
mod frame;
mod loops;
mod materials;
mod near;
mod outline;
mod overlap;
mod planes;
mod settle;
mod weld;

use crate::bvh::{Aabb, BoxTree};
use crate::input::{LengthUnit, SceneInput};
use crate::problem::{Problem, Severity, named};
use crate::scene::{
    Edge, Face, FaceId, Frame, Material, MaterialId, Piece, PlaneId, Scene, Surface, SurfaceId,
    VertexId,
};
use antumbra_geom::Stop;
use covered::{Part, Sheet};
use glam::DVec3;
use outline::Polygon;
use std::collections::BTreeMap;

/// A scene, and what was done to it or is worth saying.
#[derive(Clone, Debug)]
pub struct Built {
    /// The scene.
    pub scene: Scene,
    /// All of [`Severity::Warning`], in the order of the surfaces.
    pub warnings: Vec<Problem>,
}

impl Scene {
    /// Checks a scene and makes it ready for enumeration.
    ///
    /// # Errors
    ///
    /// All problems, warnings included, in the order of the surfaces (materials
    /// first, the scene as a whole last), if at least one is an error.
    pub fn build(input: &SceneInput) -> Result<Built, Vec<Problem>> {
        Self::build_or_stop(input, Stop::NEVER)
    }

    /// What is found after a stop means nothing.
    fn build_or_stop(input: &SceneInput, stop: Stop<'_>) -> Result<Built, Vec<Problem>> {
        let mut findings = Findings::default();
        let mended = crooked::mended(input);
        let input = mended.as_ref().map_or(input, |mended| &mended.input);
        check_names(input, &mut findings);
        if let Some(mended) = &mended {
            findings.joined(mended, input.length_unit);
        }
        let (materials, n_bands) = materials::check(input, &mut findings);
        let usable = frame::finite_surfaces(input, &mut findings);
        let Some((frame, extent)) = frame::of(input, &usable, &mut findings) else {
            return Err(findings.into_sorted());
        };

        let welded = weld::weld(input, &usable, &frame, extent);
        let units = Units {
            frame,
            unit: input.length_unit,
        };
        let mut shaper = outline::Shaper {
            vertices: &welded.vertices,
            extent,
            units,
            triangulate: input.triangulate,
            findings: &mut findings,
        };
        let mut polygons: Vec<Vec<Polygon>> = input
            .surfaces
            .iter()
            .zip(&welded.loops)
            .enumerate()
            .take_while(|_| !stop.is_wanted())
            .map(|(s, (surface, loops))| shaper.polygons(s, &surface.name, loops))
            .collect();
        if stop.is_wanted() {
            return Err(Vec::new());
        }
        if findings.no_errors() && polygons.iter().all(Vec::is_empty) {
            findings.error(
                Findings::SCENE,
                "no-surfaces",
                Vec::new(),
                "the scene has no surface with an area (at least 1 is needed)".to_owned(),
            );
        }

        let mut vertices = keep_used(&welded.vertices, &mut polygons);
        if stop.is_wanted() {
            return Err(Vec::new());
        }
        for (s, off, n) in settle::onto_planes(&mut vertices, &mut polygons, extent) {
            let name = &input.surfaces[s].name;
            findings.warning(
                Findings::surface(s),
                "non-planar",
                vec![name.clone()],
                format!(
                    "surface '{name}': not planar: a vertex lies {} off its plane, and cannot be moved onto it, for other surfaces end there too; split into {n} parts",
                    units.length(off)
                ),
            );
        }
        let tolerance = extent * Self::PLANE_TOLERANCE;
        let (planes, class_of) = planes::classify(polygons.iter().flatten(), &vertices, tolerance);
        let material_ids = materials::ids(input);
        let list = sheets(polygons, class_of, |s| {
            let material = material_ids[s].and_then(|m| materials.get(m.index()));
            material.is_some_and(|m| m.two_sided)
        });
        let sheets = covered::Sheets {
            list,
            vertices: &mut vertices,
            planes: &planes,
            extent,
            stop,
        };
        let (parts, undivided) = sheets.parts(input.surfaces.len());
        if stop.is_wanted() {
            return Err(Vec::new());
        }
        for pair in undivided {
            findings.not_divided(pair.map(|s| input.surfaces[s].name.clone()));
        }
        let covered_material = Material {
            name: "covered".to_owned(),
            reflectance: vec![0.0; n_bands],
            exitance: vec![0.0; n_bands],
            two_sided: false,
        };
        let mut scene = Self {
            length_unit: input.length_unit,
            quantity: input.quantity,
            frame,
            n_bands,
            materials,
            covered_material,
            surfaces: Vec::with_capacity(input.surfaces.len()),
            vertices,
            faces: Vec::new(),
            pieces: Vec::new(),
            edges: Vec::new(),
            planes,
            tree: BoxTree::default(),
            extent,
        };
        for ((s, surface), parts) in input.surfaces.iter().enumerate().zip(parts) {
            let first = scene.faces.len() as u32;
            for part in &parts {
                scene.push_face(SurfaceId(s as u32), part);
            }
            scene.surfaces.push(Surface {
                name: surface.name.clone(),
                material: material_ids[s].unwrap_or(MaterialId(0)),
                faces: first..scene.faces.len() as u32,
            });
        }
        scene.edges = edges(&scene.faces);
        scene.tree = BoxTree::new(&scene.front_boxes());
        if scene.materials.len() == input.materials.len()
            && material_ids.iter().all(Option::is_some)
        {
            overlap::check(&scene, &mut findings, stop);
            if findings.no_errors() && scene.emitters().next().is_none() {
                findings.warning(
                    Findings::SCENE,
                    "no-emitter",
                    Vec::new(),
                    "no surface emits: the irradiance is zero everywhere".to_owned(),
                );
            }
        }

        if findings.no_errors() {
            Ok(Built {
                scene,
                warnings: findings.into_sorted(),
            })
        } else {
            Err(findings.into_sorted())
        }
    }

    fn push_face(&mut self, surface: SurfaceId, part: &Part) {
        let (polygon, is_back) = (&part.polygon, part.is_back);
        let turned = |corners: &[u32]| -> Vec<VertexId> {
            let ids = corners.iter().map(|&v| VertexId(v));
            if is_back {
                ids.rev().collect()
            } else {
                ids.collect()
            }
        };
        let face = FaceId(self.faces.len() as u32);
        let first = self.pieces.len() as u32;
        self.pieces.extend(polygon.pieces.iter().map(|piece| Piece {
            face,
            n_faces: 1,
            hides: !is_back && !part.is_divided,
            vertices: turned(piece),
        }));
        let end = self.pieces.len() as u32;
        if let Some(hiding) = &part.hiding {
            self.pieces.extend(hiding.pieces.iter().map(|piece| Piece {
                face,
                n_faces: hiding.n_parts,
                hides: true,
                vertices: turned(piece),
            }));
        }
        let along_plane = part.along != is_back;
        let normal = self.planes[part.plane.index()].normal;
        self.faces.push(Face {
            surface,
            is_back,
            is_covered: part.is_covered,
            outline: turned(&polygon.outline),
            holes: polygon.holes.iter().map(|hole| turned(hole)).collect(),
            plane: part.plane,
            normal: if along_plane {
                normal
            } else {
                DVec3::ZERO - normal
            },
            along_plane,
            pieces: first..end,
            area: polygon.area,
        });
    }

    fn front_boxes(&self) -> Vec<(u32, Aabb)> {
        self.pieces
            .iter()
            .enumerate()
            .filter(|(_, piece)| piece.hides)
            .map(|(i, piece)| {
                (
                    i as u32,
                    Aabb::of(piece.vertices.iter().map(|&v| self.position(v))),
                )
            })
            .collect()
    }
}

/// All polygons, by surface, with their planes.
///
/// * `class_of` — of every polygon its plane, and whether it faces along it.
fn sheets(
    polygons: Vec<Vec<Polygon>>,
    class_of: Vec<(PlaneId, bool)>,
    is_two_sided: impl Fn(usize) -> bool,
) -> Vec<Sheet> {
    let of_surface = |(surface, polygons): (usize, Vec<Polygon>)| {
        let with_surface = move |polygon| (surface, polygon);
        polygons.into_iter().map(with_surface)
    };
    let polygons = polygons.into_iter().enumerate().flat_map(of_surface);
    polygons
        .zip(class_of)
        .map(|((surface, polygon), (plane, along))| Sheet {
            polygon,
            surface,
            is_two_sided: is_two_sided(surface),
            plane,
            along,
        })
        .collect()
}

/// Forgets vertices that no polygon uses; the order of the others stays.
fn keep_used(vertices: &[DVec3], polygons: &mut [Vec<Polygon>]) -> Vec<DVec3> {
    let mut new_id = vec![u32::MAX; vertices.len()];
    for polygon in polygons.iter().flatten() {
        for &v in polygon.corners() {
            new_id[v as usize] = 0;
        }
    }
    let mut kept = Vec::with_capacity(vertices.len());
    for (id, &position) in new_id.iter_mut().zip(vertices) {
        if *id == 0 {
            *id = kept.len() as u32;
            kept.push(position);
        }
    }
    for polygon in polygons.iter_mut().flatten() {
        polygon.renumber(|v| new_id[v as usize]);
    }
    kept
}

/// The edges of all fronts, sorted by their ends.
fn edges(faces: &[Face]) -> Vec<Edge> {
    let mut sides: Vec<([VertexId; 2], FaceId)> = Vec::new();
    for (f, face) in faces.iter().enumerate().filter(|(_, face)| !face.is_back) {
        for corners in face.loops() {
            for (i, &a) in corners.iter().enumerate() {
                let b = corners[(i + 1) % corners.len()];
                sides.push(([a.min(b), a.max(b)], FaceId(f as u32)));
            }
        }
    }
    sides.sort_unstable();
    sides.dedup();
    sides
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| Edge {
            ends: same[0].0,
            faces: same.iter().map(|side| side.1).collect(),
        })
        .collect()
}

fn check_names(input: &SceneInput, findings: &mut Findings) {
    if input.surfaces.is_empty() {
        findings.error(
            Findings::SCENE,
            "no-surfaces",
            Vec::new(),
            "the scene has no surfaces (at least 1 is needed)".to_owned(),
        );
    }
    let mut surfaces: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (s, surface) in input.surfaces.iter().enumerate() {
        surfaces.entry(&surface.name).or_default().push(s);
    }
    for (name, at) in surfaces.into_iter().filter(|(_, at)| at.len() > 1) {
        findings.push(
            Findings::surface(at[0]),
            Problem {
                severity: Severity::Error,
                kind: "duplicate-name",
                names: vec![name.to_owned()],
                found: Some(at.len() as f64),
                allowed: Some(1.0),
                message: format!(
                    "surface '{name}': {} surfaces have this name (allowed 1)",
                    at.len()
                ),
            },
        );
    }
    let mut materials: BTreeMap<&str, usize> = BTreeMap::new();
    for material in &input.materials {
        *materials.entry(&material.name).or_default() += 1;
    }
    for (name, &n) in materials.iter().filter(|(_, n)| **n > 1) {
        findings.error(
            Findings::MATERIAL,
            "duplicate-name",
            vec![(*name).to_owned()],
            format!("material '{name}': {n} materials have this name (allowed 1)"),
        );
    }
    for (s, surface) in input.surfaces.iter().enumerate() {
        if !materials.contains_key(surface.material.as_str()) {
            findings.error(
                Findings::surface(s),
                "unknown-material",
                vec![surface.name.clone(), surface.material.clone()],
                format!(
                    "surface '{}': material '{}' is not among the materials of the scene",
                    surface.name, surface.material
                ),
            );
        }
    }
}

/// Numbers in messages are in the file's units.
#[derive(Clone, Copy, Debug)]
struct Units {
    frame: Frame,
    unit: LengthUnit,
}

impl Units {
    fn length(&self, length: f64) -> String {
        format!(
            "{} {}",
            short(self.frame.length_to_file(length)),
            self.unit.symbol()
        )
    }

    fn area(&self, area: f64) -> String {
        format!(
            "{} {}²",
            short(self.frame.area_to_file(area)),
            self.unit.symbol()
        )
    }

    fn point(&self, point: DVec3) -> String {
        let p = self.frame.to_file(point);
        format!("({}, {}, {})", short(p.x), short(p.y), short(p.z))
    }
}

/// A number with four significant digits at least and no needless zeros.
pub(crate) fn short(x: f64) -> String {
    let a = x.abs();
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    if !(1e-4..1e7).contains(&a) {
        return format!("{x:.3e}").replace(".000e", "e");
    }
    let decimals = (3 - a.log10().floor() as i32).max(0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Up to four names, and how many more there are.
pub(crate) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 4;
    let mut text = names
        .iter()
        .take(SHOWN)
        .map(|name| format!("'{name}'"))
        .collect::<Vec<_>>()
        .join(", ");
    if names.len() > SHOWN {
        text += &format!(" and {} more", names.len() - SHOWN);
    }
    text
}

/// Problems as they are found, each with its place in the report.
#[derive(Debug, Default)]
struct Findings {
    list: Vec<(usize, Problem)>,
}

impl Findings {
    const MATERIAL: usize = 0;
    const SCENE: usize = usize::MAX;

    /// The place of the surface with this index.
    fn surface(index: usize) -> usize {
        index + 1
    }

    fn push(&mut self, place: usize, problem: Problem) {
        self.list.push((place, problem));
    }

    fn error(&mut self, place: usize, kind: &'static str, names: Vec<String>, message: String) {
        let severity = Severity::Error;
        self.push(
            place,
            Problem {
                severity,
                kind,
                names,
                found: None,
                allowed: None,
                message,
            },
        );
    }

    fn warning(&mut self, place: usize, kind: &'static str, names: Vec<String>, message: String) {
        let severity = Severity::Warning;
        self.push(
            place,
            Problem {
                severity,
                kind,
                names,
                found: None,
                allowed: None,
                message,
            },
        );
    }

    /// Two surfaces cover each other, and where is not known.
    fn not_divided(&mut self, [a, b]: [String; 2]) {
        let message = format!(
            "surfaces '{a}' and '{b}' cover each other, but where their borders meet is not known well enough to tell what is covered: taken for a thin plate"
        );
        self.warning(Self::SCENE, "not-divided", vec![a, b], message);
    }

    /// Corners of crooked surfaces were joined.
    fn joined(&mut self, mended: &crooked::Mended, unit: LengthUnit) {
        let message = format!(
            "{} corners of {} joined with their neighbours, by at most {:.2e} {unit}: surfaces there are off their planes by {:.2e} {unit}, and slits no wider than {} times that mean nothing",
            mended.n_moved,
            named(&mended.surfaces),
            mended.farthest,
            mended.allowed / crooked::REACH,
            crooked::REACH,
            unit = unit.symbol(),
        );
        let names = mended.surfaces.clone();
        self.warning(Self::SCENE, "joined", names, message);
        self.with_numbers(mended.farthest, mended.allowed);
    }

    /// Adds the numbers to the last finding.
    fn with_numbers(&mut self, found: f64, allowed: f64) {
        if let Some((_, problem)) = self.list.last_mut() {
            problem.found = Some(found);
            problem.allowed = Some(allowed);
        }
    }

    fn no_errors(&self) -> bool {
        self.list.iter().all(|(_, p)| p.severity != Severity::Error)
    }

    fn into_sorted(mut self) -> Vec<Problem> {
        self.list.sort_by_key(|(place, _)| *place);
        self.list.into_iter().map(|(_, problem)| problem).collect()
    }
}
