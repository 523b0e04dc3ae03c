//! A scene on a lattice is refused or meshed: meshes are sound, and no value is below
//! 0 or above that without occluders.
#![no_main]

use antumbra::{
    Control, Evaluator, EventKinds, Events, ExactLight, Options, Scene, Scratch, Tolerance,
};
use antumbra_fuzz::{Choices, adversary};
use antumbra_tests::scenes::unoccluded;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices::new(bytes);
    let events = match choices.below(3) {
        0 => Events::Kinds(EventKinds::ALL),
        _ => Events::OnDemand,
    };
    let input = adversary::scene(&mut choices);
    let Ok(built) = Scene::build(&input) else {
        return;
    };
    let scene = built.scene;
    let options = Options {
        tolerance: Tolerance::Relative(0.03),
        events,
        most_elements: 4000,
        ..Options::default()
    };
    // To be pasted into a file.
    let json = || antumbra_io::scene_file::write(&input);
    let meshed = antumbra::mesh(&scene, &options, &Control::NEVER)
        .unwrap_or_else(|e| panic!("{e}\n{}", json()));

    let open = Scene::build(&unoccluded(&input, &["floor"]))
        .unwrap_or_else(|problems| panic!("{problems:?}\n{}", json()))
        .scene;
    let evaluator = Evaluator::new(&open);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    for mesh in &meshed.mesh.receivers {
        mesh.mesh
            .check()
            .unwrap_or_else(|e| panic!("{e}\n{}", json()));
        let name = &scene.surface_of(mesh.face).name;
        let surface = open.surface_named(name);
        let face = surface.map(|s| antumbra::scene::FaceId(open.surfaces[s.index()].faces.start));
        for (uv, &e) in mesh.nodes.iter().zip(&mesh.direct) {
            assert!(e >= 0.0 && e.is_finite(), "{e} on {name}\n{}", json());
            if let Some(face) = face {
                let x = mesh.chart.to_space(*uv);
                let x = open.frame.to_scene(scene.frame.to_file(x));
                let most = light.at(face, x, &mut scratch)[0];
                // A node that touches something is moved onto it, by up to the contact
                // radius (6e-8 here): its value is that of a place as far away.
                assert!(e <= most + 1e-7, "{e} of {most} on {name}\n{}", json());
            }
        }
    }
});
