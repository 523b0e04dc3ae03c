//! Visibility maps in streets, one thread: time, and counts of the work beside it.
//!
//! A street is a square of buildings, each of four walls and a roof in some tiles, on a
//! ground of tiles; points are on the ground and on walls.

#![expect(
    clippy::print_stdout,
    reason = "the counts of the work stand beside the times"
)]

use antumbra_scene::{FaceId, MaterialInput, Scene, SceneInput, SurfaceInput};
use antumbra_visibility::{Evaluator, MapScratch, MapTotals, Place};
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

/// A street of `n × n` buildings, 2 m apart, with every side in `tiles × tiles` faces, on a
/// ground of `4 n²` tiles.
fn street(n: usize, tiles: usize) -> Scene {
    let mut random = Random(12345);
    let mut surfaces = Vec::new();
    let mut add = |origin: DVec3, u: DVec3, v: DVec3, tiles: usize| {
        let at = |i: usize, j: usize| {
            let of = |k: usize| k as f64 / tiles as f64;
            origin + u * of(i) + v * of(j)
        };
        for i in 0..tiles {
            for j in 0..tiles {
                surfaces.push(SurfaceInput {
                    name: format!("{}", surfaces.len()),
                    material: "grey".into(),
                    vertices: vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                    holes: vec![],
                });
            }
        }
    };
    for i in 0..n {
        for j in 0..n {
            let corner = dvec3(2.0 * i as f64, 2.0 * j as f64, 0.0)
                + dvec3(random.next(), random.next(), 0.0) * 0.1;
            let x = DVec3::X * (0.9 + 0.3 * random.next());
            let y = DVec3::Y * (0.9 + 0.3 * random.next());
            let z = DVec3::Z * (0.5 + 2.5 * random.next());
            add(corner, x, z, tiles);
            add(corner + x + y, -x, z, tiles);
            add(corner + y, -y, z, tiles);
            add(corner + x, y, z, tiles);
            add(corner + z, x, y, tiles);
        }
    }
    let side = 2.0 * n as f64;
    add(DVec3::ZERO, DVec3::X * side, DVec3::Y * side, 2 * n);
    let grey = MaterialInput {
        name: "grey".into(),
        reflectance: vec![0.5],
        exitance: vec![0.0],
        two_sided: false,
    };
    let input = SceneInput {
        materials: vec![grey],
        surfaces,
        ..SceneInput::default()
    };
    Scene::build(&input).expect("the scene is valid").scene
}

/// Places in the middle of faces, spread over the scene; roofs see little but the sky.
fn places(scene: &Scene, n: usize) -> Vec<Place> {
    let mut random = Random(7);
    let mut places = Vec::new();
    while places.len() < n {
        let face = FaceId((random.next() * scene.faces.len() as f64) as u32);
        let of = scene.face(face);
        let corners = scene.positions(&of.outline);
        let point = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let is_roof = of.normal.z > 0.5 && scene.frame.to_file(point).z > 0.1;
        if of.is_covered || is_roof {
            continue;
        }
        places.push(Place {
            point,
            normal: of.normal,
            plane: Some(of.plane),
            approach: None,
        });
    }
    places
}

fn visibility_map(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("visibility_map");
    group.sample_size(10).throughput(Throughput::Elements(1));
    for (n, tiles) in [(5, 1), (10, 1), (40, 1), (21, 7)] {
        let scene = street(n, tiles);
        let evaluator = Evaluator::new(&scene);
        let places = places(&scene, 200);
        let mut scratch = MapScratch::default();
        for epsilon in [0.0, 1e-5] {
            let mut all = MapTotals::default();
            let mut n_parts = 0;
            for place in &places {
                let t = evaluator.visible_faces(place, epsilon, &mut scratch, |_| n_parts += 1);
                all.n_cones += t.n_cones;
                all.n_boxes += t.n_boxes;
                all.n_halves += t.n_halves;
                all.n_looks += t.n_looks;
                all.ended += t.ended;
            }
            let mean = |count: u64| count / places.len() as u64;
            println!(
                "{} faces, ended at {epsilon}: {} cones, {} parts, {} boxes, {} half-spaces, \
                 {} polygons looked at, {:.1e} ended",
                scene.faces.len(),
                mean(all.n_cones),
                mean(n_parts),
                mean(all.n_boxes),
                mean(all.n_halves),
                mean(all.n_looks),
                all.ended / places.len() as f64,
            );
            let mut k = 0;
            let id = BenchmarkId::new(format!("{} faces", scene.faces.len()), epsilon);
            group.bench_function(id, |b| {
                b.iter(|| {
                    k = (k + 1) % places.len();
                    evaluator.visible_faces(&places[k], epsilon, &mut scratch, |_| {})
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, visibility_map);
criterion_main!(benches);
