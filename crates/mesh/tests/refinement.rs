//! Bisection and point location on meshes of arrangements.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use antumbra_geom::Control;
use std::time::Instant;

use antumbra_mesh::{
    Arrangement, ArrangementOptions, Cut, Locator, Order, Split, TriMesh, arrange, shape_quality,
};
use common::{FAMILIES, Rng, family, outline, segment, square};
use glam::{DVec2, dvec2};

fn mesh_of(name: &str, n: usize, noise: f64, seed: u64) -> TriMesh {
    arranged_mesh_of(name, n, noise, seed).1
}

fn arranged_mesh_of(name: &str, n: usize, noise: f64, seed: u64) -> (Arrangement, TriMesh) {
    let curves = family(name, n, noise, &mut Rng::new(seed));
    let arrangement =
        arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
    let mesh = TriMesh::new(&arrangement, &curves).unwrap();
    (arrangement, mesh)
}

/// Curves and lines that run beside edges, in all triangles or some, between bisections.
#[test]
fn random_cuts_keep_all_promises_and_the_area() {
    for (seed, name) in (0..).zip(FAMILIES) {
        let (arrangement, mut mesh) = arranged_mesh_of(name, 8, 1e-9, seed);
        let mut rng = Rng::new(seed + 200);
        let area = mesh.total_area();
        for round in 0..8 {
            let n = mesh.triangles.len();
            let mut cut = || {
                let v = mesh.vertices[rng.below(mesh.vertices.len())];
                let from = [v, rng.point(), v + 1e-7 * rng.point()][rng.below(3)];
                let to = mesh.vertices[rng.below(mesh.vertices.len())];
                let cut = Cut {
                    ends: [from, [to, rng.point()][rng.below(2)]],
                    curve: 100 + round,
                    order: Order::D2,
                };
                let some = 1 + rng.below(3);
                let wanted = (0..n as u32).filter(|_| rng.below(some) == 0);
                (cut, wanted.collect::<Vec<u32>>())
            };
            let cuts = [cut(), cut()];
            let origins = mesh.cut(&cuts);
            assert_eq!(origins.len(), mesh.triangles.len());
            mesh.check_against(&arrangement)
                .unwrap_or_else(|e| panic!("{name}, {round}: {e}"));
            let error = (mesh.total_area() - area).abs();
            assert!(error < 1e-12, "{name}, {round}: {error}");
            mesh.bisect(&[0, (n / 2) as u32]);
            mesh.check_against(&arrangement).unwrap();
        }
    }
}

#[test]
fn random_bisections_keep_all_promises_and_the_area() {
    for (seed, name) in (0..).zip(FAMILIES) {
        for noise in [0.0, 1e-9] {
            let (arrangement, mut mesh) = arranged_mesh_of(name, 12, noise, seed);
            let mut rng = Rng::new(seed + 100);
            let area = mesh.total_area();
            for _ in 0..20 {
                let before = mesh.clone();
                let n = mesh.triangles.len();
                let marked: Vec<u32> = (0..1 + n / 20).map(|_| rng.below(n) as u32).collect();
                let parents = mesh.bisect(&marked);
                mesh.check_against(&arrangement).unwrap();
                assert!((mesh.total_area() - area).abs() < 1e-12);

                // Parts make up their parents; what is whole has not changed.
                let mut sums = vec![(0.0, 0); n];
                assert_eq!(parents.len(), mesh.triangles.len());
                for (t, &parent) in (0..).zip(&parents) {
                    sums[parent as usize].0 += mesh.area(t);
                    sums[parent as usize].1 += 1;
                }
                for (t, (sum, count)) in (0..).zip(sums) {
                    assert!((sum - before.area(t)).abs() < 1e-13);
                    if count == 1 {
                        assert_eq!(mesh.triangles[t as usize], before.triangles[t as usize]);
                    }
                }
                for &m in &marked {
                    let [a, b, c] = before.corners(m);
                    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    let is_tiny = longest < 4.0 * mesh.pixel();
                    assert_eq!(parents[n..].contains(&m), !is_tiny);
                }

                // The order of marks makes no difference.
                let mut again = before;
                let reversed: Vec<u32> = marked.iter().rev().copied().collect();
                again.bisect(&reversed);
                assert_eq!(again.triangles, mesh.triangles);
            }
        }
    }
}

/// Any edges, at any places, the shortest included.
#[test]
fn random_splits_keep_all_promises_and_the_area_and_make_nothing_below_pixels() {
    for (seed, name) in (0..).zip(FAMILIES) {
        let (arrangement, mut mesh) = arranged_mesh_of(name, 12, 1e-9, seed);
        let mut rng = Rng::new(seed + 300);
        let area = mesh.total_area();
        for _ in 0..20 {
            let n = mesh.triangles.len();
            let splits: Vec<Split> = (0..1 + n / 20)
                .map(|_| Split {
                    triangle: rng.below(n) as u32,
                    edge: rng.below(3),
                    at: [0.5, 0.08, 0.95][rng.below(3)],
                })
                .collect();
            let before = mesh.clone();
            let parents = mesh.split(&splits);
            mesh.check_against(&arrangement)
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!((mesh.total_area() - area).abs() < 1e-12);
            assert_eq!(parents.len(), mesh.triangles.len());
            for split in &splits {
                let corners = before.corners(split.triangle);
                let length = corners[split.edge].distance(corners[(split.edge + 1) % 3]);
                let is_tiny = length * split.at.min(1.0 - split.at) < 2.0 * mesh.pixel();
                let is_split = parents[n..].contains(&split.triangle);
                assert!(is_split || is_tiny, "{name}: {split:?}");
            }
        }
    }
}

#[test]
fn halves_of_an_edge_inherit_its_curves() {
    let (a, b) = (dvec2(-0.6, -0.1), dvec2(0.5, 0.2));
    let curves = [square(1.0), segment(a, b)];
    let mut mesh = TriMesh::new(
        &arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default(),
        &curves,
    )
    .unwrap();
    for _ in 0..6 {
        let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        mesh.bisect(&all);
    }
    mesh.check().unwrap();
    let mut length = [0.0; 2];
    for triangle in &mesh.triangles {
        for k in 0..3 {
            let (i, j) = (triangle[k], triangle[(k + 1) % 3]);
            let [p, q] = [i, j].map(|v| mesh.vertices[v as usize]);
            match mesh.edge_order(i, j) {
                Some(Order::Boundary) => length[0] += p.distance(q),
                // Seen from both sides.
                Some(_) => length[1] += p.distance(q) / 2.0,
                None => {}
            }
        }
    }
    assert!((length[0] - 8.0).abs() < 1e-12 && (length[1] - a.distance(b)).abs() < 1e-12);
}

#[test]
fn repeated_bisection_of_a_sliver_ends_and_does_not_turn_it_over() {
    let mut curves = vec![square(1.0)];
    curves.push(segment(dvec2(-0.9, 0.1), dvec2(0.9, 0.100_000_000_4)));
    curves.push(segment(dvec2(-0.9, 0.100_000_07), dvec2(0.9, 0.100_000_04)));
    let mut mesh = TriMesh::new(
        &arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default(),
        &curves,
    )
    .unwrap();
    for _ in 0..12 {
        let smallest = (0..mesh.triangles.len() as u32)
            .min_by(|&s, &t| mesh.area(s).total_cmp(&mesh.area(t)))
            .unwrap();
        mesh.bisect(&[smallest]);
        mesh.check().unwrap();
    }
    assert!((mesh.total_area() - 4.0).abs() < 1e-12);
}

#[test]
fn triangles_too_small_to_halve_stay_whole() {
    let curves = [square(1.0)];
    let mut mesh = TriMesh::new(
        &arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default(),
        &curves,
    )
    .unwrap();
    for _ in 0..300 {
        mesh.bisect(&[0]);
    }
    let n = mesh.triangles.len();
    assert_eq!(mesh.bisect(&[0]).len(), n);
    assert!((mesh.total_area() - 4.0).abs() < 1e-12);
    mesh.check().unwrap();
}

#[test]
fn every_point_is_found_where_it_is() {
    for (seed, name) in (0..).zip(FAMILIES) {
        let mut mesh = mesh_of(name, 15, 1e-9, seed);
        mesh.bisect(&[0, 1, 2]);
        let locator = Locator::new(&mesh);
        let mut rng = Rng::new(seed);
        for k in 0..500 {
            let v = mesh.vertices[rng.below(mesh.vertices.len())];
            let p = match k % 3 {
                0 => rng.point(),
                1 => v,
                // On the border, and a little outside.
                _ => dvec2(rng.signed(), 1.0 + 1e-10),
            };
            let (t, weights) = locator.locate(&mesh, p).unwrap();
            let corners = mesh.corners(t);
            let found: DVec2 = (0..3).map(|k| weights[k] * corners[k]).sum();
            assert!(found.distance(p) < 1e-7, "{name}: {p} found at {found}");
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(weights.iter().all(|&w| w >= 0.0));
        }
        for p in [dvec2(1.1, 0.0), dvec2(-30.0, 2.0), dvec2(f64::NAN, 0.0)] {
            assert_eq!(locator.locate(&mesh, p), None);
        }
    }
}

#[test]
fn nothing_is_found_in_a_hole() {
    let hole = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)].map(|(x, y)| dvec2(x, y));
    let curves = [square(1.0), outline(&hole)];
    let mesh = TriMesh::new(
        &arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default(),
        &curves,
    )
    .unwrap();
    let locator = Locator::new(&mesh);
    assert_eq!(locator.locate(&mesh, DVec2::ZERO), None);
    assert!(locator.locate(&mesh, dvec2(0.7, 0.0)).is_some());
}

#[test]
fn equilateral_is_best() {
    let best = shape_quality([
        dvec2(0.0, 0.0),
        dvec2(1.0, 0.0),
        dvec2(0.5, 0.75_f64.sqrt()),
    ]);
    assert!((best - 1.0).abs() < 1e-12);
    let right = shape_quality([dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(0.0, 1.0)]);
    assert!((right - 0.828_427_124_746_19).abs() < 1e-12);
    assert_eq!(
        shape_quality([dvec2(0.0, 0.0), dvec2(1.0, 1.0), dvec2(2.0, 2.0)]),
        0.0
    );
    assert_eq!(shape_quality([DVec2::ZERO; 3]), 0.0);
}

#[test]
#[ignore = "prints times"]
#[allow(clippy::print_stderr, reason = "that is what it is for")]
fn times() {
    let mut mesh = mesh_of("random", 20, 0.0, 1);
    let mut rng = Rng::new(1);
    while mesh.triangles.len() < 300_000 {
        let n = mesh.triangles.len();
        let marked: Vec<u32> = (0..n / 10).map(|_| rng.below(n) as u32).collect();
        let start = Instant::now();
        mesh.bisect(&marked);
        let new = mesh.triangles.len() - n;
        let each = start.elapsed() / new as u32;
        eprintln!("{n} triangles: {new} new, {each:?} each");
    }
    let start = Instant::now();
    let locator = Locator::new(&mesh);
    eprintln!("locator {:?}", start.elapsed());
    let start = Instant::now();
    let found = (0..100_000)
        .filter(|_| locator.locate(&mesh, rng.point()).is_some())
        .count();
    eprintln!("{found} located, {:?} each", start.elapsed() / 100_000);
}
