//! Floors with many things on them: the work for each thing is that of what is near it.

use antumbra::visibility::critical_curves;
use antumbra::{Control, Evaluator, EventKind, EventKinds, Scene, SceneInput};
use antumbra_tests::cases::build;
use antumbra_tests::scenes::{Facing, add_box, add_horizontal, empty, material};
use glam::dvec3;

/// n × n boxes that stand on one floor of 10 m under a lamp of 1 m.
fn crowd(n: usize) -> SceneInput {
    let mut scene = empty();
    scene.materials = vec![material("grey", 0.5, 0.0), material("lamp", 0.0, 1.0)];
    add_horizontal(
        &mut scene,
        "floor",
        "grey",
        ([0.0, 10.0], [0.0, 10.0], 0.0),
        Facing::Up,
    );
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([4.5, 5.5], [4.5, 5.5], 3.0),
        Facing::Down,
    );
    let pitch = 10.0 / n as f64;
    for i in 0..n {
        for j in 0..n {
            let at = |x: f64, y: f64, z: f64| dvec3(i as f64 + x, j as f64 + y, z) * pitch;
            let (min, max) = (at(0.3, 0.3, 0.0), at(0.7, 0.7, 0.3));
            add_box(&mut scene, &format!("box {i} {j}"), "grey", min, max);
        }
    }
    scene
}

/// Of all receivers: generators that were looked at, and contacts found.
fn work(scene: &Scene) -> (u64, u64) {
    let evaluator = Evaluator::new(scene);
    let radius = 1e-9 * scene.extent;
    let all = scene.face_ids().map(|face| {
        let found = critical_curves(&evaluator, face, EventKinds::ALL, radius, &Control::NEVER)
            .expect("nothing stops it");
        let contacts = found.active[EventKind::Contact as usize];
        (found.candidates.iter().sum::<u64>(), contacts)
    });
    all.fold((0, 0), |sum, x| (sum.0 + x.0, sum.1 + x.1))
}

#[test]
fn four_times_the_boxes_on_a_floor_ask_for_four_times_the_events() {
    let [few, many] = [10, 20].map(|n| work(&build(&crowd(n))));
    // Four sides on the floor, and the floor at four sides.
    assert_eq!((few.1, many.1), (8 * 100, 8 * 400));
    let ratio = many.0 as f64 / few.0 as f64;
    assert!(ratio < 4.6, "{} and {} candidates", few.0, many.0);
}

#[test]
fn floor_looked_up_by_its_tree_has_the_curves_of_one_looked_through() {
    // Three boxes in a row: with 7 of 16 edges and parts all is looked through; the others
    // stand so far away that no line of these three passes them.
    let near = |input: &mut SceneInput| {
        for (k, x) in [1.0, 2.0, 3.0].into_iter().enumerate() {
            let (min, max) = (dvec3(x, 1.0, 0.0), dvec3(x + 0.5, 1.5, 0.5));
            add_box(input, &format!("box {k}"), "grey", min, max);
        }
    };
    let mut few = empty();
    few.materials = vec![material("grey", 0.5, 0.0), material("lamp", 0.0, 1.0)];
    add_horizontal(
        &mut few,
        "floor",
        "grey",
        ([0.0, 100.0], [0.0, 5.0], 0.0),
        Facing::Up,
    );
    add_horizontal(
        &mut few,
        "lamp",
        "lamp",
        ([1.5, 2.5], [2.0, 3.0], 3.0),
        Facing::Down,
    );
    near(&mut few);
    let mut many = few.clone();
    for k in 0..50 {
        let x = 40.0 + f64::from(k);
        let (min, max) = (dvec3(x, 1.0, 0.0), dvec3(x + 0.5, 1.5, 0.25));
        add_box(&mut many, &format!("far {k}"), "grey", min, max);
    }
    let curves = |input: &SceneInput| {
        let scene = build(input);
        let evaluator = Evaluator::new(&scene);
        let mut ends = Vec::new();
        for face in scene.face_ids() {
            let found = critical_curves(&evaluator, face, EventKinds::ALL, 1e-9, &Control::NEVER)
                .expect("nothing stops it");
            for curve in found.curves {
                let kind = curve.kind();
                let points = curve.shape.ends().map(|p| scene.frame.to_file(p));
                if points.iter().all(|p| p.x < 6.0) {
                    let millionths = |x: f64| (x * 1e6).round() as i64;
                    let mut flat = points.map(|p| p.to_array().map(millionths));
                    flat.sort_unstable();
                    ends.push((kind, flat));
                }
            }
        }
        ends.sort_unstable();
        ends
    };
    let (few, many) = (curves(&few), curves(&many));
    assert!(few.len() > 60, "{}", few.len());
    assert_eq!(few, many);
}
