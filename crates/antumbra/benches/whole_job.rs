//! Events, mesh and the whole job on 1, 4 and 16 boxes under one light.
//!
//! The counts (candidates, curves, elements, exact evaluations) are printed once
//! beside the times: they are what scales, whatever the machine.

use antumbra::scene::{FaceId, MaterialInput, SurfaceInput};
use antumbra::visibility::critical_curves;
use antumbra::{Control, Evaluator, EventKinds, Options, Scene, SceneInput, mesh};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use glam::{DVec3, dvec3};

fn surface(name: String, material: &str, vertices: Vec<DVec3>) -> SurfaceInput {
    SurfaceInput {
        name,
        material: material.into(),
        vertices,
        holes: vec![],
    }
}

/// `n × n` turned boxes on a floor of 4 × 4 under a light of 1 × 1.
fn boxes(n: u32) -> Scene {
    let material = |name: &str, exitance| MaterialInput {
        name: name.into(),
        reflectance: vec![0.5],
        exitance: vec![exitance],
        two_sided: false,
    };
    let square = |h: f64, z: f64| {
        vec![
            dvec3(-h, -h, z),
            dvec3(h, -h, z),
            dvec3(h, h, z),
            dvec3(-h, h, z),
        ]
    };
    let mut lamp = square(0.5, 2.5);
    lamp.reverse();
    let mut surfaces = vec![
        surface("floor".into(), "grey", square(2.0, 0.0)),
        surface("lamp".into(), "lamp", lamp),
    ];
    for k in 0..n * n {
        let (i, j) = (f64::from(k % n), f64::from(k / n));
        let pitch = 3.0 / f64::from(n);
        let center = dvec3((i + 0.5) * pitch - 1.5, (j + 0.5) * pitch - 1.5, 0.2);
        let (half, turn) = (0.2 * pitch, 0.3 + 0.7 * f64::from(k));
        let (u, v) = (
            dvec3(turn.cos(), turn.sin(), 0.0) * half,
            dvec3(-turn.sin(), turn.cos(), 0.0) * half,
        );
        let w = DVec3::Z * half;
        for (s, (a, b, c)) in [(u, v, w), (v, w, u), (w, u, v)].into_iter().enumerate() {
            for (t, c) in [c, -c].into_iter().enumerate() {
                let mut corners = vec![
                    center + c - a - b,
                    center + c + a - b,
                    center + c + a + b,
                    center + c - a + b,
                ];
                if t == 1 {
                    corners.reverse();
                }
                surfaces.push(surface(format!("box{k}.{s}{t}"), "grey", corners));
            }
        }
    }
    let input = SceneInput {
        materials: vec![material("grey", 0.0), material("lamp", 1.0)],
        surfaces,
        ..SceneInput::default()
    };
    Scene::build(&input).expect("the scene is valid").scene
}

fn whole_job(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("whole_job");
    group.sample_size(10);
    for n in [1, 2, 4] {
        let scene = boxes(n);
        let name = format!("{} boxes", n * n);
        let evaluator = Evaluator::new(&scene);
        let found = critical_curves(
            &evaluator,
            FaceId(0),
            EventKinds::ALL,
            1e-7,
            &Control::NEVER,
        )
        .unwrap_or_default();
        let meshed = mesh(&scene, &Options::default(), &Control::NEVER).expect("meshes");
        let evaluations: u64 = meshed
            .mesh
            .receivers
            .iter()
            .map(|r| r.exact_evaluations)
            .sum();
        let elements: usize = meshed.mesh.receivers.iter().map(|r| r.n_elements()).sum();
        let counts = format!(
            "{} candidates, {} curves, {elements} elements, {evaluations} evaluations",
            found.candidates.iter().sum::<u64>(),
            found.active.iter().sum::<u64>(),
        );
        group.bench_function(BenchmarkId::new(format!("events, {name}"), &counts), |b| {
            b.iter(|| {
                critical_curves(
                    &evaluator,
                    FaceId(0),
                    EventKinds::ALL,
                    1e-7,
                    &Control::NEVER,
                )
                .unwrap_or_default()
            });
        });
        group.bench_function(BenchmarkId::new(format!("mesh, {name}"), &counts), |b| {
            b.iter(|| mesh(&scene, &Options::default(), &Control::NEVER));
        });
    }
    group.finish();
}

criterion_group!(benches, whole_job);
criterion_main!(benches);
