//! Exact evaluations against the number of occluders, one thread.
//!
//! Each scene has a square light over a floor; what differs is what stands
//! between, and how much of it is in the way.

use antumbra_scene::{FaceId, MaterialInput, Scene, SceneInput, SurfaceInput};
use antumbra_visibility::{Evaluator, Scratch, Seen};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, dvec3};

/// A sequence of numbers in 0..1 that is the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn surface(name: String, material: &str, vertices: Vec<DVec3>) -> SurfaceInput {
    SurfaceInput {
        name,
        material: material.into(),
        vertices,
        holes: vec![],
    }
}

/// Floor 0, light 1, then the occluders.
fn scene(occluders: Vec<Vec<DVec3>>) -> Scene {
    let material = |name: &str, exitance| MaterialInput {
        name: name.into(),
        reflectance: vec![0.5],
        exitance: vec![exitance],
        two_sided: false,
    };
    let square = |h: f64, z: f64, up: bool| {
        let mut corners = vec![
            dvec3(-h, -h, z),
            dvec3(h, -h, z),
            dvec3(h, h, z),
            dvec3(-h, h, z),
        ];
        if !up {
            corners.reverse();
        }
        corners
    };
    let mut surfaces = vec![
        surface("floor".into(), "grey", square(2.0, 0.0, true)),
        surface("light".into(), "lamp", square(0.5, 2.0, false)),
    ];
    for (i, vertices) in occluders.into_iter().enumerate() {
        surfaces.push(surface(format!("occluder {i}"), "grey", vertices));
    }
    let input = SceneInput {
        materials: vec![material("grey", 0.0), material("lamp", 1.0)],
        surfaces,
        ..SceneInput::default()
    };
    Scene::build(&input).expect("the scene is valid").scene
}

fn quad(center: DVec3, half: f64, turn: f64) -> Vec<DVec3> {
    let (u, v) = (
        dvec3(turn.cos(), turn.sin(), 0.0),
        dvec3(-turn.sin(), turn.cos(), 0.0),
    );
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(a, b)| center + (u * a + v * b) * half)
        .to_vec()
}

fn triangle(random: &mut Random, center: DVec3, size: f64) -> Vec<DVec3> {
    (0..3)
        .map(|_| center + (dvec3(random.next(), random.next(), random.next()) - 0.5) * size)
        .collect()
}

/// The figures' scenes: name, occluders.
fn scenes() -> Vec<(String, Scene)> {
    let mut random = Random(1);
    let mut all = vec![
        ("no occluder".to_owned(), scene(vec![])),
        (
            "1 quad".to_owned(),
            scene(vec![quad(dvec3(0.1, 0.05, 1.0), 0.25, 0.5)]),
        ),
    ];
    let mut thirteen = vec![quad(dvec3(0.1, 0.05, 1.0), 0.25, 0.5)];
    for _ in 0..12 {
        let center = dvec3(
            random.next() - 0.5,
            random.next() - 0.5,
            0.6 + 0.8 * random.next(),
        );
        thirteen.push(triangle(&mut random, center, 0.3));
    }
    all.push(("1 quad and 12 triangles".to_owned(), scene(thirteen)));
    for n in [100, 1000, 10_000] {
        // All in front of the emitter as seen from the middle of the floor.
        let size = 1.2 / f64::from(n).sqrt();
        let occluders = (0..n)
            .map(|_| {
                let center = dvec3(
                    0.5 * (random.next() - 0.5),
                    0.5 * (random.next() - 0.5),
                    0.9 + 0.2 * random.next(),
                );
                triangle(&mut random, center, size)
            })
            .collect();
        all.push((format!("{n} small triangles in front"), scene(occluders)));
    }
    for n in [100, 1000, 10_000] {
        // Scattered in a room of 4 × 4 × 2: few are in the way.
        let occluders = (0..n)
            .map(|_| {
                let center = dvec3(
                    4.0 * (random.next() - 0.5),
                    4.0 * (random.next() - 0.5),
                    0.1 + 1.8 * random.next(),
                );
                triangle(&mut random, center, 0.05)
            })
            .collect();
        all.push((format!("{n} triangles scattered"), scene(occluders)));
    }
    all
}

fn exact_evaluation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("exact_evaluation");
    group.sample_size(20).throughput(Throughput::Elements(1));
    for (name, scene) in scenes() {
        let evaluator = Evaluator::new(&scene);
        let view = evaluator.view(FaceId(0));
        let mut scratch = Scratch::default();
        let mut random = Random(7);
        let scale = scene.frame.scale;
        let points: Vec<DVec3> = (0..64)
            .map(|_| {
                scene
                    .frame
                    .to_scene(dvec3(random.next() - 0.5, random.next() - 0.5, 0.0))
            })
            .collect();
        assert!(scale > 0.0, "scenes have a scale");
        // Cones cut against, per evaluation: the count beside the time.
        let mut seen = [Seen::default()];
        for &point in &points {
            evaluator.factors(&view, point, None, &mut scratch, &mut seen);
        }
        let cones = scratch.n_cones as f64 / points.len() as f64;
        let mut k = 0;
        group.bench_function(BenchmarkId::new(&name, format!("{cones:.1} cones")), |b| {
            b.iter(|| {
                k = (k + 1) % points.len();
                evaluator.factors(&view, points[k], None, &mut scratch, &mut seen);
                seen[0].factor
            });
        });
    }
    group.finish();
}

criterion_group!(benches, exact_evaluation);
criterion_main!(benches);
