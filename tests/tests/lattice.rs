//! Random scenes on a lattice, where contacts, alignments and coplanar faces are the
//! rule: no panic, sound meshes, no value below 0 or above that without occluders.

use antumbra::scene::SceneInput;
use antumbra::{Control, Ended, Evaluator, EventKinds, Events, ExactLight, Options, Scene};
use antumbra_tests::motion::Motion;
use antumbra_tests::random::SplitMix;
use antumbra_tests::scenes::{Facing, add, add_box, add_horizontal, empty, unoccluded};
use glam::{DVec3, dvec3};

/// Scenes a run; `ANTUMBRA_SCENES` asks for more.
fn n_scenes() -> u64 {
    let asked = std::env::var("ANTUMBRA_SCENES").ok();
    asked.and_then(|n| n.parse().ok()).unwrap_or(40)
}

/// Up to five boxes and triangles with corners in multiples of 1/2, 1/4 or 1/8 under a
/// square lamp, over a floor; some touch or pierce it and each other.
fn lattice_scene(random: &mut SplitMix) -> SceneInput {
    let mut scene = empty();
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let lamp = ([-0.5, 0.5], [-0.5, 0.5], 3.0);
    add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Down);
    let q = [2.0, 4.0, 8.0][(random.bits() % 3) as usize];
    let mut steps = |from: f64, to: f64| {
        let n = ((to - from) * q) as u64 + 1;
        from + (random.bits() % n) as f64 / q
    };
    let n = 1 + steps(0.0, 4.0 / q) as usize + (steps(0.0, 1.0) * q) as usize % 4;
    for k in 0..n {
        let corner = |steps: &mut dyn FnMut(f64, f64) -> f64| {
            dvec3(steps(-1.0, 1.0), steps(-1.0, 1.0), steps(0.0, 2.0))
        };
        let a = corner(&mut steps);
        if steps(0.0, 1.0) < 0.6 {
            let one = 1.0 / q;
            let size = dvec3(steps(one, 1.0), steps(one, 1.0), steps(one, 1.0));
            add_box(&mut scene, &format!("box-{k}"), "grey", a, a + size);
        } else {
            let (b, c) = (corner(&mut steps), corner(&mut steps));
            if (b - a).cross(c - a).length() > 0.0 {
                add(&mut scene, &format!("triangle-{k}"), "grey", &[a, b, c]);
            }
        }
    }
    scene
}

#[test]
fn meshes_of_lattice_scenes_are_sound_plain_and_rotated() {
    let mut random = SplitMix::new(3);
    let mut n_meshed = 0;
    for i in 0..n_scenes() {
        let plain = lattice_scene(&mut random);
        let turned = Motion::rotation(dvec3(0.3, 0.5, 0.8), 0.7);
        let input = if i % 2 == 0 {
            plain
        } else {
            turned.scene(&plain)
        };
        // Overlaps that a person would be told of.
        let Ok(built) = Scene::build(&input) else {
            continue;
        };
        let scene = built.scene;
        let events = if i % 3 == 0 {
            Events::Kinds(EventKinds::ALL)
        } else {
            Events::OnDemand
        };
        let options = Options {
            events,
            ..Options::default()
        };
        let meshed = antumbra::mesh(&scene, &options, &Control::default())
            .unwrap_or_else(|e| panic!("scene {i}: {e}"));
        n_meshed += 1;
        assert!(
            matches!(
                meshed.direct.ended,
                Ended::ToleranceReached | Ended::ResolutionReached
            ),
            "scene {i}: {:?}",
            meshed.direct.ended
        );
        let open = open_light(&input);
        let evaluator = Evaluator::new(&open);
        let light = ExactLight::new(&evaluator);
        let mut scratch = antumbra::Scratch::default();
        for mesh in &meshed.direct.receivers {
            mesh.mesh
                .check()
                .unwrap_or_else(|e| panic!("scene {i}: {e}"));
            let name = &scene.surface_of(mesh.face).name;
            let face = open
                .surface_named(name)
                .map(|s| antumbra::scene::FaceId(open.surfaces[s.index()].faces.start));
            for (uv, &e) in mesh.nodes.iter().zip(&mesh.direct) {
                assert!(e >= 0.0 && e.is_finite(), "scene {i}: {e} on {name}");
                let x: DVec3 = mesh.chart.to_space(*uv);
                let x = open.frame.to_scene(scene.frame.to_file(x));
                if let Some(face) = face {
                    let most = light.at(face, x, &mut scratch)[0];
                    assert!(e <= most + 1e-9, "scene {i}: {e} of {most} on {name}");
                }
            }
        }
    }
    assert!(
        n_meshed * 10 >= n_scenes() * 9,
        "{n_meshed} scenes were accepted"
    );
}

/// The scene with the lamp and the floor alone.
fn open_light(input: &SceneInput) -> Scene {
    let open = unoccluded(input, &["floor"]);
    Scene::build(&open)
        .unwrap_or_else(|problems| panic!("{problems:?}"))
        .scene
}
