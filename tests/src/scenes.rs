//! Small scenes written in a line or two, and exact values in them.

use crate::cases::build;
use antumbra::scene::{MaterialInput, SurfaceInput};
use antumbra::values::{self, Place};
use antumbra::{Control, Evaluator, ExactLight, SceneInput, Scratch};
use glam::{DVec3, dvec3};

/// A material of one band.
#[must_use]
pub fn material(name: &str, reflectance: f64, exitance: f64) -> MaterialInput {
    MaterialInput {
        name: name.to_owned(),
        reflectance: vec![reflectance],
        exitance: vec![exitance],
        two_sided: false,
    }
}

/// An empty scene with the materials `grey` (reflectance ½) and `lamp`
/// (exitance 1).
#[must_use]
pub fn empty() -> SceneInput {
    SceneInput {
        materials: vec![material("grey", 0.5, 0.0), material("lamp", 0.0, 1.0)],
        ..SceneInput::default()
    }
}

/// Adds a polygon.
pub fn add(scene: &mut SceneInput, name: &str, material: &str, corners: &[DVec3]) {
    scene.surfaces.push(SurfaceInput {
        name: name.to_owned(),
        material: material.to_owned(),
        vertices: corners.to_vec(),
        holes: Vec::new(),
    });
}

/// Adds a rectangle at height `z` with edges along x and y.
pub fn add_horizontal(
    scene: &mut SceneInput,
    name: &str,
    material: &str,
    ([x0, x1], [y0, y1], z): ([f64; 2], [f64; 2], f64),
    facing: Facing,
) {
    let mut corners = [
        dvec3(x0, y0, z),
        dvec3(x1, y0, z),
        dvec3(x1, y1, z),
        dvec3(x0, y1, z),
    ];
    if facing == Facing::Down {
        corners.reverse();
    }
    add(scene, name, material, &corners);
}

/// Where the front of a horizontal rectangle looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Facing {
    /// To +z.
    Up,
    /// To −z.
    Down,
}

/// Adds the six faces of an axis-parallel box, fronts outwards:
/// `name.x0`, `name.x1`, `name.y0`, … `name.z1`.
pub fn add_box(scene: &mut SceneInput, name: &str, material: &str, min: DVec3, max: DVec3) {
    for (side, corners) in box_faces(min, max) {
        add(scene, &format!("{name}.{side}"), material, &corners);
    }
}

/// Adds the six faces of an axis-parallel box, fronts inwards.
pub fn add_room(scene: &mut SceneInput, name: &str, material: &str, min: DVec3, max: DVec3) {
    for (side, mut corners) in box_faces(min, max) {
        corners.reverse();
        add(scene, &format!("{name}.{side}"), material, &corners);
    }
}

fn box_faces(min: DVec3, max: DVec3) -> [(&'static str, [DVec3; 4]); 6] {
    let p = |x: usize, y: usize, z: usize| {
        let pick = |k: usize, lo: f64, hi: f64| if k == 0 { lo } else { hi };
        dvec3(
            pick(x, min.x, max.x),
            pick(y, min.y, max.y),
            pick(z, min.z, max.z),
        )
    };
    [
        ("x0", [p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0)]),
        ("x1", [p(1, 0, 0), p(1, 1, 0), p(1, 1, 1), p(1, 0, 1)]),
        ("y0", [p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1)]),
        ("y1", [p(0, 1, 0), p(0, 1, 1), p(1, 1, 1), p(1, 1, 0)]),
        ("z0", [p(0, 0, 0), p(0, 1, 0), p(1, 1, 0), p(1, 0, 0)]),
        ("z1", [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)]),
    ]
}

/// The scene without its occluders: emitters and the named receivers only.
#[must_use]
pub fn unoccluded(scene: &SceneInput, receivers: &[&str]) -> SceneInput {
    let emits = |name: &str| {
        scene
            .materials
            .iter()
            .any(|m| m.name == name && m.exitance.iter().any(|&e| e > 0.0))
    };
    let mut bare = scene.clone();
    bare.surfaces
        .retain(|s| emits(&s.material) || receivers.contains(&s.name.as_str()));
    bare
}

/// Exact direct irradiance in the first band at points of a surface; file units.
///
/// # Panics
///
/// If the scene is refused or a point does not lie on the surface.
#[must_use]
pub fn exact(scene: &SceneInput, surface: &str, points: &[DVec3]) -> Vec<f64> {
    let scene = build(scene);
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    points
        .iter()
        .map(|&p| {
            let place = values::place(&scene, surface, p).unwrap_or_else(|e| panic!("{e}"));
            values::exact(&light, &place, &mut scratch)[0]
        })
        .collect()
}

/// Exact direct irradiance in the first band at free sensors.
///
/// # Panics
///
/// If the scene is refused.
#[must_use]
pub fn exact_free(scene: &SceneInput, sensors: &[(DVec3, DVec3)]) -> Vec<f64> {
    let scene = build(scene);
    let evaluator = Evaluator::new(&scene);
    let mut scratch = Scratch::default();
    sensors
        .iter()
        .map(|&(p, n)| {
            let bands = values::exact_free(&evaluator, p, n, &mut scratch);
            bands.unwrap_or_else(|e| panic!("{e}"))[0]
        })
        .collect()
}

/// Points of a parallelogram on a grid of cells, one a cell, off its lines:
/// the same ones in every run.
#[must_use]
pub fn points_on(origin: DVec3, u: DVec3, v: DVec3, n: usize) -> Vec<DVec3> {
    // The plastic number's low-discrepancy sequence.
    (1..=n)
        .map(|k| {
            let k = k as f64;
            let s = (0.5 + k * 0.754_877_666_246_692_7).fract();
            let t = (0.5 + k * 0.569_840_290_998_053_2).fract();
            origin + u * s + v * t
        })
        .collect()
}

/// The face of a surface that has one front only.
///
/// # Panics
///
/// If there is no such surface or it has no face.
#[must_use]
pub fn only_face(scene: &antumbra::Scene, surface: &str) -> antumbra::scene::FaceId {
    let id = scene
        .surface_named(surface)
        .unwrap_or_else(|| panic!("no surface '{surface}'"));
    let faces = &scene.surfaces[id.index()].faces;
    assert!(!faces.is_empty(), "surface '{surface}' was dropped");
    antumbra::scene::FaceId(faces.start)
}

/// The faces of a surface's front: several if something covers a part of it.
///
/// # Panics
///
/// If there is no such surface.
#[must_use]
pub fn front_faces(scene: &antumbra::Scene, surface: &str) -> Vec<antumbra::scene::FaceId> {
    let id = scene
        .surface_named(surface)
        .unwrap_or_else(|| panic!("no surface '{surface}'"));
    let faces = scene.surfaces[id.index()].faces.clone();
    let faces = faces.map(antumbra::scene::FaceId);
    faces.filter(|&f| !scene.face(f).is_back).collect()
}

/// A place on a named surface.
///
/// # Panics
///
/// If the point does not lie on the surface.
#[must_use]
pub fn place(scene: &antumbra::Scene, surface: &str, point: DVec3) -> Place {
    values::place(scene, surface, point).unwrap_or_else(|e| panic!("{e}"))
}
