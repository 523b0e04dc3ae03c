//! Random scenes of five families, a function of their number: what people draw and what
//! programs write, none of it on a lattice.

use crate::motion::Motion;
use crate::random::SplitMix;
use crate::scenes::{Facing, add, add_box, add_horizontal, add_room, empty};
use antumbra::SceneInput;
use glam::{DMat3, DVec3, dvec3};

/// Families there are.
pub const NAMES: [&str; 5] = ["soup", "furnished", "on-edges", "piercing", "dirty"];

/// The scene of a number; its family is the number modulo five.
#[must_use]
pub fn family_scene(number: u64) -> (&'static str, SceneInput) {
    let mut random = SplitMix::new(number.wrapping_mul(0x9e6c_63d0_876a_3f35) ^ 0xfa11);
    let family = (number % 5) as usize;
    let scene = match family {
        0 => soup(&mut random),
        1 => turned(&furnished(&mut random), &mut random),
        2 => on_edges(&mut random),
        3 => piercing(&mut random),
        _ => dirty(&mut random),
    };
    (NAMES[family], scene)
}

fn floor_and_lamp(random: &mut SplitMix) -> SceneInput {
    let mut scene = empty();
    add_horizontal(
        &mut scene,
        "floor",
        "grey",
        ([-2.0, 2.0], [-2.0, 2.0], 0.0),
        Facing::Up,
    );
    let (x, y) = (random.between(-1.0, 0.5), random.between(-1.0, 0.5));
    let (a, b) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
    let z = random.between(1.5, 3.0);
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([x, x + a], [y, y + b], z),
        Facing::Down,
    );
    scene
}

/// Triangles anywhere between floor and lamp.
fn soup(random: &mut SplitMix) -> SceneInput {
    let mut scene = floor_and_lamp(random);
    for i in 0..4 + random.bits() % 12 {
        let middle = random.in_box(dvec3(-1.5, -1.5, 0.3), dvec3(1.5, 1.5, 1.3));
        let size = random.between(0.1, 0.6);
        let corners: [DVec3; 3] = std::array::from_fn(|_| {
            let off = random.in_box(DVec3::splat(-1.0), DVec3::ONE) * size;
            dvec3(
                middle.x + off.x,
                middle.y + off.y,
                (middle.z + off.z).max(0.05),
            )
        });
        add(&mut scene, &format!("triangle-{i}"), "grey", &corners);
    }
    scene
}

/// A closed room with boxes, a table and a lamp below the ceiling.
fn furnished(random: &mut SplitMix) -> SceneInput {
    let mut scene = empty();
    let size = dvec3(4.0, random.between(2.5, 4.0), random.between(2.2, 2.8));
    add_room(&mut scene, "room", "grey", DVec3::ZERO, size);
    let (x, y) = (random.between(0.5, 2.5), random.between(0.5, 1.5));
    let (a, b) = (random.between(0.3, 1.0), random.between(0.3, 0.8));
    let z = size.z - random.between(0.02, 0.3);
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([x, x + a], [y, y + b], z),
        Facing::Down,
    );
    for i in 0..1 + random.bits() % 3 {
        let at = random.in_box(DVec3::splat(0.2), dvec3(3.0, 1.6, 0.2));
        let extent = random.in_box(DVec3::splat(0.2), dvec3(0.8, 0.7, 1.2));
        let gap = if random.bits().is_multiple_of(2) {
            0.0
        } else {
            random.between(0.01, 0.3)
        };
        let min = dvec3(at.x, at.y, gap);
        let turned = random.between(0.0, 1.0);
        let before = scene.surfaces.len();
        add_box(&mut scene, &format!("box-{i}"), "grey", min, min + extent);
        let rotation = DMat3::from_rotation_z(turned);
        for surface in &mut scene.surfaces[before..] {
            surface
                .vertices
                .iter_mut()
                .for_each(|p| *p = rotation * (*p - min) + min);
        }
    }
    scene
}

fn turned(scene: &SceneInput, random: &mut SplitMix) -> SceneInput {
    let motion = Motion {
        rotation: random.rotation(),
        ..Motion::IDENTITY
    };
    motion.scene(scene)
}

/// Boxes that stand on an edge or a corner, and plates that lean.
fn on_edges(random: &mut SplitMix) -> SceneInput {
    let mut scene = floor_and_lamp(random);
    for i in 0..1 + random.bits() % 3 {
        let (angle, about) = (random.between(0.2, 1.3), random.between(0.0, 6.0));
        let mut rotation = DMat3::from_rotation_z(about) * DMat3::from_rotation_x(angle);
        if random.bits().is_multiple_of(3) {
            rotation *= DMat3::from_rotation_y(random.between(0.2, 1.0));
        }
        let extent = random.in_box(DVec3::splat(0.1), DVec3::splat(0.7));
        let at = random.in_box(dvec3(-1.4, -1.4, 0.0), dvec3(1.0, 1.0, 0.0));
        let before = scene.surfaces.len();
        add_box(&mut scene, &format!("box-{i}"), "grey", DVec3::ZERO, extent);
        let new = &mut scene.surfaces[before..];
        let corners = new.iter_mut().flat_map(|s| s.vertices.iter_mut());
        let corners: Vec<&mut DVec3> = corners
            .map(|p| {
                *p = rotation * *p;
                p
            })
            .collect();
        let lowest = corners.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        for p in corners {
            let z = p.z - lowest;
            *p = dvec3(p.x + at.x, p.y + at.y, if z < 1e-12 { 0.0 } else { z });
        }
    }
    scene
}

/// Plates and boxes through the floor and through each other.
fn piercing(random: &mut SplitMix) -> SceneInput {
    let mut scene = floor_and_lamp(random);
    for i in 0..2 + random.bits() % 3 {
        let rotation = random.rotation();
        let extent = random.in_box(DVec3::splat(0.1), DVec3::splat(0.6));
        let at = random.in_box(dvec3(-1.0, -1.0, -0.1), dvec3(1.0, 1.0, 0.5));
        let before = scene.surfaces.len();
        add_box(
            &mut scene,
            &format!("box-{i}"),
            "grey",
            -extent / 2.0,
            extent / 2.0,
        );
        for surface in &mut scene.surfaces[before..] {
            surface
                .vertices
                .iter_mut()
                .for_each(|p| *p = rotation * *p + at);
        }
    }
    scene
}

/// A turned room of furniture whose corners are off by 1e-6 to 1e-12, each surface's on
/// their own.
fn dirty(random: &mut SplitMix) -> SceneInput {
    let clean = furnished(random);
    let mut scene = turned(&clean, random);
    let dirt = 10f64.powi(-6 - (random.bits() % 7) as i32);
    for p in scene
        .surfaces
        .iter_mut()
        .flat_map(|s| s.vertices.iter_mut())
    {
        *p += random.in_box(DVec3::splat(-dirt), DVec3::splat(dirt));
    }
    scene
}
