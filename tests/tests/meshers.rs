//! The mesh generators that know nothing of shadows: what they promise.

use antumbra::cells::{Beyond, CellShape};
use antumbra::solver::cells::edge_nodes;
use antumbra::{
    CellEnded, CellOptions, CellReceiverMesh, CellSize, CellSolution, Control, DirectMesh,
    Estimator, Evaluator, ExactLight, Mesher, Scene, Scratch, Tolerance, cell_meshes, mesh_cells,
};
use antumbra_tests::cases::{build, fixture};
use glam::DVec2;

const CELL_MESHERS: [Mesher; 6] = [
    Mesher::Uniform,
    Mesher::Graded,
    Mesher::Quadtree,
    Mesher::Restricted,
    Mesher::TriQuadtree,
    Mesher::Adaptive,
];

const SHAPES: [CellShape; 3] = [
    CellShape::Triangles,
    CellShape::Quadrilaterals,
    CellShape::Mixed,
];

fn meshed(scene: &Scene, options: &CellOptions) -> CellSolution {
    let meshed = mesh_cells(scene, options, &Control::default());
    meshed
        .unwrap_or_else(|e| panic!("{:?}: {e}", options.mesher))
        .direct
}

/// The largest difference between the interpolants from both sides along all edges.
fn crack(mesh: &CellReceiverMesh) -> f64 {
    let mut worst = 0.0f64;
    for c in 0..mesh.n_elements() {
        for k in 0..mesh.mesh.cells[c].corners().len() {
            let (other, share): (usize, Box<dyn Fn(f64) -> f64>) = match mesh.mesh.beyond(c, k) {
                Beyond::Border | Beyond::Finer => continue,
                Beyond::Cell(d) => (d as usize, Box::new(|s| s)),
                Beyond::Coarser { cell, .. } => (cell as usize, Box::new(|s| s)),
            };
            for i in 0..=20 {
                let s = share(f64::from(i) / 20.0);
                let [a, b] = mesh.mesh.cells[c]
                    .edge(k)
                    .map(|v| mesh.mesh.vertices[v as usize]);
                let p = a + (b - a) * s;
                let values = [c, other]
                    .map(|c| mesh.interpolate(&mesh.direct, 1, c, mesh.mesh.reference(c, p))[0]);
                worst = worst.max((values[0] - values[1]).abs());
            }
        }
    }
    worst
}

#[test]
fn t_vertices_crack_a_plain_quadtree_and_no_other_mesh() {
    let scene = build(&fixture("alignment/rectangle-under-rectangle"));
    for mesher in CELL_MESHERS {
        for shape in SHAPES {
            for degree in 1..=4 {
                let options = CellOptions {
                    mesher,
                    shape,
                    degree: Some(degree),
                    size: CellSize::Elements(150),
                    ..CellOptions::default()
                };
                let solution = meshed(&scene, &options);
                let floor = &solution.receivers[0];
                floor
                    .mesh
                    .check()
                    .unwrap_or_else(|e| panic!("{mesher:?} {shape:?}: {e}"));
                let worst = crack(floor) / solution.peak[0];
                if mesher == Mesher::Quadtree {
                    assert!(floor.mesh.n_t_vertices() > 0, "{shape:?}");
                    assert!(
                        worst > 1e-4,
                        "{shape:?} {degree}: the crack is {worst:e} only"
                    );
                } else {
                    assert!(
                        worst < 1e-12,
                        "{mesher:?} {shape:?} {degree}: a crack of {worst:e}"
                    );
                }
                if mesher == Mesher::TriQuadtree {
                    assert_eq!(floor.mesh.n_t_vertices(), 0, "{shape:?}");
                }
            }
        }
    }
}

#[test]
fn restricted_quadtrees_are_restricted() {
    let scene = build(&fixture("basic/two-triangles"));
    for mesher in [Mesher::Restricted, Mesher::Adaptive, Mesher::TriQuadtree] {
        for shape in SHAPES {
            let options = CellOptions {
                mesher,
                shape,
                size: CellSize::Elements(800),
                ..CellOptions::default()
            };
            for receiver in &meshed(&scene, &options).receivers {
                for c in 0..receiver.n_elements() {
                    let cell = &receiver.mesh.cells[c];
                    for k in 0..cell.corners().len() {
                        let other = match receiver.mesh.beyond(c, k) {
                            Beyond::Cell(d) | Beyond::Coarser { cell: d, .. } => d,
                            Beyond::Border | Beyond::Finer => continue,
                        };
                        let other = receiver.mesh.cells[other as usize].level;
                        assert!(cell.level.abs_diff(other) <= 1, "{mesher:?} {shape:?}");
                    }
                }
            }
        }
    }
}

/// Root mean square and largest error over a lattice of points of the floor.
fn errors(scene: &Scene, solution: &CellSolution) -> [f64; 2] {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator);
    let mut scratch = Scratch::default();
    let floor = &solution.receivers[0];
    let (mut square, mut max, mut n) = (0.0, 0.0f64, 0.0);
    for i in 0..71 {
        for j in 0..71 {
            let at = |i: i32| (f64::from(i) + 0.4127) / 71.0 * 4.0 - 2.0;
            let point = glam::DVec3::new(at(i), at(j), 0.0);
            let place =
                antumbra::values::place(scene, "floor", point).expect("the point is on the floor");
            let exact = light.at(floor.face, place.point, &mut scratch)[0];
            let uv: DVec2 = floor.chart.to_chart(place.point);
            let value = solution.direct_at(0, uv).expect("the floor is meshed")[0];
            square += (value - exact) * (value - exact);
            max = max.max((value - exact).abs());
            n += 1.0;
        }
    }
    let peak = solution.peak[0];
    [f64::sqrt(square / n) / peak, max / peak]
}

#[test]
fn uniform_meshes_converge_with_the_order_of_the_degree_where_light_is_smooth() {
    let scene = build(&fixture("basic/unoccluded"));
    for shape in SHAPES {
        for degree in 1..=4u8 {
            let rms = [0.25, 0.125].map(|length| {
                let options = CellOptions {
                    mesher: Mesher::Uniform,
                    shape,
                    degree: Some(degree),
                    size: CellSize::Length(length),
                    ..CellOptions::default()
                };
                errors(&scene, &meshed(&scene, &options))[0]
            });
            let order = (rms[0] / rms[1]).log2();
            println!("{shape:?} degree {degree}: {rms:?}, order {order:.2}");
            assert!(
                (order - f64::from(degree) - 1.0).abs() < 0.35,
                "{shape:?} {degree}: {order}"
            );
        }
    }
}

#[test]
fn shadow_boundaries_hold_uniform_meshes_to_order_one_and_a_half() {
    let scene = build(&fixture("alignment/rectangle-under-rectangle"));
    for shape in [CellShape::Triangles, CellShape::Mixed] {
        for degree in 1..=4u8 {
            // Sizes that divide no distance of the scene: else edges fall on boundaries.
            let rms: Vec<f64> = [15.0, 31.0, 61.0]
                .iter()
                .map(|n| {
                    let options = CellOptions {
                        mesher: Mesher::Uniform,
                        shape,
                        degree: Some(degree),
                        size: CellSize::Length(4.0 / n),
                        ..CellOptions::default()
                    };
                    errors(&scene, &meshed(&scene, &options))[0]
                })
                .collect();
            let order = (rms[0] / rms[2]).ln() / (61.0f64 / 15.0).ln();
            println!("{shape:?} degree {degree}: {rms:?}, order {order:.2}");
            let most = if degree == 1 { 2.2 } else { 1.9 };
            assert!((1.15..most).contains(&order), "{shape:?} {degree}: {order}");
        }
    }
}

#[test]
fn tolerance_reached_is_true_at_other_points() {
    let scene = build(&fixture("basic/unoccluded"));
    for mesher in CELL_MESHERS {
        for shape in SHAPES {
            let options = CellOptions {
                mesher,
                shape,
                size: CellSize::Tolerance(Tolerance::Relative(1e-3)),
                ..CellOptions::default()
            };
            let solution = meshed(&scene, &options);
            assert_eq!(
                solution.ended,
                CellEnded::ToleranceReached,
                "{mesher:?} {shape:?}"
            );
            let [_, max] = errors(&scene, &solution);
            println!(
                "{mesher:?} {shape:?}: {} elements, {} + {} evaluations, {max:.1e}",
                solution.n_elements(),
                solution.receivers[0].node_evaluations,
                solution.receivers[0].check_evaluations
            );
            assert!(max <= 1e-3, "{mesher:?} {shape:?}: {max}");
        }
    }
}

#[test]
fn estimators_are_effective_where_light_is_smooth() {
    let scene = build(&fixture("basic/unoccluded"));
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator);
    for shape in SHAPES {
        for degree in 1..=4 {
            let options = CellOptions {
                mesher: Mesher::Uniform,
                shape,
                degree: Some(degree),
                size: CellSize::Length(0.25),
                ..CellOptions::default()
            };
            let mut meshes =
                cell_meshes(&evaluator, &light, &options, &Control::default()).unwrap();
            let truth = meshes
                .true_errors(12, &light, antumbra::geom::Stop::NEVER)
                .unwrap();
            for estimator in Estimator::ALL {
                let estimate = meshes
                    .estimates(estimator, &light, antumbra::geom::Stop::NEVER)
                    .unwrap();
                // Estimated over true, of elements that matter.
                let largest = truth[0].iter().copied().fold(0.0, f64::max);
                let ratios: Vec<f64> = estimate[0]
                    .iter()
                    .zip(&truth[0])
                    .filter(|e| *e.1 > 0.1 * largest)
                    .map(|(e, t)| e / t)
                    .collect();
                let low = ratios.iter().copied().fold(f64::INFINITY, f64::min);
                let high = ratios.iter().copied().fold(0.0, f64::max);
                println!(
                    "{shape:?} {degree} {}: {low:.2} to {high:.2}",
                    estimator.key()
                );
                match estimator {
                    // Tells contrast: no bound above.
                    Estimator::Neighbours => assert!(low > 0.5),
                    Estimator::Measured => assert!(low > 0.4 && high < 1.5),
                    _ => assert!(low > 0.2 && high < 3.0, "{shape:?} {degree} {estimator:?}"),
                }
            }
        }
    }
}

#[test]
fn edges_have_the_same_nodes_from_both_sides() {
    for is_quad in [false, true] {
        for degree in 1..=4 {
            let n = if is_quad { 4 } else { 3 };
            for k in 0..n {
                let nodes = edge_nodes(is_quad, degree, k);
                assert_eq!(nodes.len(), usize::from(degree) + 1);
                assert_eq!((nodes[0], nodes[usize::from(degree)]), (k, (k + 1) % n));
            }
        }
    }
}
