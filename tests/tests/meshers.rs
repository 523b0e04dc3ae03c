//! The mesh generators that know nothing of shadows: what they promise.

use antumbra::cells::{Beyond, CellForest, CellMesh, CellShape, Rule, uniform};
use antumbra::geom::{Chart, Stop};
use antumbra::scene::FaceId;
use antumbra::solver::cells::{
    CellDirectOptions, CellGoal, CellMeshes, CellReceiver, CellRefinement, edge_nodes,
};
use antumbra::solver::{Found, Light, Sample, Spot};
use antumbra::{
    CellOptions, CellSize, Control, Ended, Estimator, Evaluator, ExactLight, Mesher, Options,
    ReceiverMesh, Scene, Scratch, Solution, Tolerance, cell_meshes,
};
use antumbra_tests::bits::bits_of_meshes;
use antumbra_tests::cases::{build, fixture};
use antumbra_tests::meshes::gathered;
use glam::{DVec2, DVec3, dvec2};
use proptest::prelude::*;

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

/// Cells of a degree, to a relative tolerance.
fn asked(degree: Option<u8>, tolerance: f64, cells: CellOptions) -> Options {
    Options {
        tolerance: Tolerance::Relative(tolerance),
        degree,
        ..Options::with_cells(cells)
    }
}

fn meshed(scene: &Scene, options: &Options) -> Solution {
    let meshed = antumbra::mesh(scene, options, &Control::NEVER);
    meshed
        .unwrap_or_else(|e| panic!("{:?}: {e}", options.mesher()))
        .mesh
}

fn spot(mesh: &ReceiverMesh, element: usize, at: [f64; 2]) -> Spot {
    mesh.cells()
        .expect("cells were asked for")
        .spot(element, at)
}

/// The cells of a mesh.
fn cells_of(mesh: &ReceiverMesh) -> &CellMesh {
    &mesh.cells().expect("cells were asked for").mesh
}

/// The largest difference between the interpolants from both sides along all edges.
fn crack(mesh: &ReceiverMesh) -> f64 {
    let mut worst = 0.0f64;
    for c in 0..mesh.n_elements() {
        for k in 0..cells_of(mesh).cells[c].corners().len() {
            let other = match cells_of(mesh).beyond(c, k) {
                Beyond::Border | Beyond::Finer => continue,
                Beyond::Cell(d) | Beyond::Coarser { cell: d, .. } => d as usize,
            };
            for i in 0..=20 {
                let s = f64::from(i) / 20.0;
                let [a, b] = cells_of(mesh).cells[c]
                    .edge(k)
                    .map(|v| cells_of(mesh).vertices[v as usize]);
                let p = a + (b - a) * s;
                let values = [c, other].map(|c| {
                    mesh.interpolate(
                        &mesh.direct,
                        1,
                        spot(mesh, c, cells_of(mesh).reference(c, p)),
                    )[0]
                });
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
                let cells = CellOptions {
                    mesher,
                    shape,
                    size: CellSize::Elements(150),
                    ..CellOptions::default()
                };
                let options = asked(Some(degree), 1e-3, cells);
                let solution = meshed(&scene, &options);
                let floor = &solution.receivers[0];
                cells_of(floor)
                    .check()
                    .unwrap_or_else(|e| panic!("{mesher:?} {shape:?}: {e}"));
                let worst = crack(floor) / solution.peak[0];
                if mesher == Mesher::Quadtree {
                    assert!(cells_of(floor).n_t_vertices() > 0, "{shape:?}");
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
                    assert_eq!(cells_of(floor).n_t_vertices(), 0, "{shape:?}");
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
            let cells = CellOptions {
                mesher,
                shape,
                size: CellSize::Elements(800),
                ..CellOptions::default()
            };
            let options = asked(None, 1e-3, cells);
            for receiver in &meshed(&scene, &options).receivers {
                for c in 0..receiver.n_elements() {
                    let cell = &cells_of(receiver).cells[c];
                    for k in 0..cell.corners().len() {
                        let other = match cells_of(receiver).beyond(c, k) {
                            Beyond::Cell(d) | Beyond::Coarser { cell: d, .. } => d,
                            Beyond::Border | Beyond::Finer => continue,
                        };
                        let other = cells_of(receiver).cells[other as usize].level;
                        assert!(cell.level.abs_diff(other) <= 1, "{mesher:?} {shape:?}");
                    }
                }
            }
        }
    }
}

/// Root mean square and largest error over a lattice of points of the floor.
fn errors(scene: &Scene, solution: &Solution) -> [f64; 2] {
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    let floor = &solution.receivers[0];
    let (mut square, mut max, mut n) = (0.0, 0.0f64, 0.0);
    for i in 0..71 {
        for j in 0..71 {
            let at = |i: i32| (f64::from(i) + 0.4127) / 71.0 * 4.0 - 2.0;
            let point = glam::DVec3::new(at(i), at(j), 0.0);
            let place = antumbra::values::place(scene, "floor", point).expect("on the floor");
            let exact = light.at(floor.face, place.point, &mut scratch)[0];
            let uv: DVec2 = floor.chart.to_chart(place.point);
            let value = floor.direct_at(floor.locate(uv).expect("on the mesh"))[0];
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
                let cells = CellOptions {
                    mesher: Mesher::Uniform,
                    shape,
                    size: CellSize::Length(length),
                    ..CellOptions::default()
                };
                let options = asked(Some(degree), 1e-3, cells);
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
            // Many sizes: how far an edge is from a boundary is a matter of luck.
            let sizes = [15.0, 19.0, 23.0, 29.0, 37.0, 47.0, 59.0, 73.0, 91.0];
            let points: Vec<[f64; 2]> = sizes
                .iter()
                .map(|n: &f64| {
                    let cells = CellOptions {
                        mesher: Mesher::Uniform,
                        shape,
                        size: CellSize::Length(4.0 / n),
                        ..CellOptions::default()
                    };
                    let options = asked(Some(degree), 1e-3, cells);
                    [-n.ln(), errors(&scene, &meshed(&scene, &options))[0].ln()]
                })
                .collect();
            // The slope of the line of least squares.
            let n = points.len() as f64;
            let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
            let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
                points
                    .iter()
                    .map(|p| f(p[0] - mean[0], p[1] - mean[1]))
                    .sum()
            };
            let order = sum(&|x, y| x * y) / sum(&|x, _| x * x);
            println!("{shape:?} degree {degree}: order {order:.2}");
            // At degree 1 what is smooth, of order 2, is not yet negligible.
            let most = if degree == 1 { 1.85 } else { 1.75 };
            assert!((1.3..most).contains(&order), "{shape:?} {degree}: {order}");
        }
    }
}

#[test]
fn tolerance_reached_is_true_at_other_points() {
    let scene = build(&fixture("basic/unoccluded"));
    for mesher in CELL_MESHERS {
        for shape in SHAPES {
            let cells = CellOptions {
                mesher,
                shape,
                size: CellSize::Tolerance,
                ..CellOptions::default()
            };
            let options = asked(None, 1e-3, cells);
            let solution = meshed(&scene, &options);
            assert_eq!(
                solution.ended,
                Ended::ToleranceReached,
                "{mesher:?} {shape:?}"
            );
            let [_, max] = errors(&scene, &solution);
            println!(
                "{mesher:?} {shape:?}: {} elements, {} evaluations, {max:.1e}",
                solution.n_elements(),
                solution.receivers[0].exact_evaluations
            );
            assert!(max <= 1e-3, "{mesher:?} {shape:?}: {max}");
        }
    }
}

#[test]
fn estimators_are_effective_where_light_is_smooth() {
    let scene = build(&fixture("basic/unoccluded"));
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    for shape in SHAPES {
        for degree in 1..=4 {
            let cells = CellOptions {
                mesher: Mesher::Uniform,
                shape,
                size: CellSize::Length(0.25),
                ..CellOptions::default()
            };
            let options = asked(Some(degree), 1e-3, cells);
            let mut meshes =
                cell_meshes(&evaluator, &light, &options, &cells, &Control::NEVER).unwrap();
            let truth = meshes.true_errors(30, &light, Stop::NEVER).unwrap();
            for estimator in Estimator::ALL {
                let estimate = meshes.estimates(estimator, &light, Stop::NEVER).unwrap();
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
                    // Slopes at its corners tell little of the inside of a quartic.
                    Estimator::Gradient if degree == 4 => {
                        assert!(low > 0.03 && high < 1.8, "{shape:?}: {low} to {high}");
                    }
                    _ => assert!(
                        low > 0.2 && high < 1.8,
                        "{shape:?} {degree} {estimator:?}: {low} to {high}"
                    ),
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

/// A polynomial as light.
struct Polynomial(u8);

impl Polynomial {
    fn at(&self, p: DVec2) -> f64 {
        (0..=self.0)
            .flat_map(|i| (0..=self.0 - i).map(move |j| (i, j)))
            .map(|(i, j)| {
                let factor = 1.0 + f64::from(i) - 0.5 * f64::from(j);
                factor * p.x.powi(i.into()) * p.y.powi(j.into())
            })
            .sum()
    }
}

impl Light for Polynomial {
    fn n_bands(&self) -> usize {
        1
    }

    fn irradiance(&self, _: FaceId, samples: &[Sample], _: f64, _: Stop<'_>) -> Option<Found> {
        let values = samples.iter().map(|s| self.at(s.point.truncate()));
        Some(Found {
            values: values.collect(),
            rounding: 0.0,
        })
    }

    fn reaches(&self, _: FaceId) -> bool {
        true
    }
}

/// A mesh of one polygon, refined by contrast.
fn polygon_mesh(
    border: &[Vec<DVec2>],
    shape: CellShape,
    rule: Rule,
    light: &Polynomial,
    degree: u8,
) -> Solution {
    let receiver = CellReceiver {
        is_thin: false,
        face: FaceId(0),
        chart: Chart {
            origin: DVec3::ZERO,
            u: DVec3::X,
            v: DVec3::Y,
            normal: DVec3::Z,
        },
        forest: CellForest::new(uniform(border, 0.4, shape).expect("an area"), rule),
        contact_radius: 1e-9,
        hot_spots: Vec::new(),
    };
    let options = CellDirectOptions {
        degree,
        goal: CellGoal::Elements(150),
        refinement: CellRefinement::Marked,
        estimator: Estimator::Neighbours,
        least_size: 1e-4,
        most_elements: 100_000,
    };
    CellMeshes::solve(vec![receiver], light, &options, &Control::NEVER).finish()
}

#[test]
fn polynomials_of_the_degree_are_reproduced() {
    let border = [vec![
        dvec2(0.0, 0.0),
        dvec2(1.0, 0.1),
        dvec2(1.2, 0.9),
        dvec2(0.6, 0.5),
        dvec2(0.1, 1.0),
    ]];
    for shape in SHAPES {
        for rule in [Rule::Plain, Rule::Restricted, Rule::Triangulated] {
            for degree in 1..=4 {
                let light = Polynomial(degree);
                let solution = polygon_mesh(&border, shape, rule, &light, degree);
                let mesh = &solution.receivers[0];
                assert!(mesh.n_elements() >= 150, "{shape:?} {rule:?}");
                for c in 0..mesh.n_elements() {
                    for at in [[0.2, 0.3], [0.61, 0.17], [0.05, 0.9]] {
                        let value = mesh.interpolate(&mesh.direct, 1, spot(mesh, c, at))[0];
                        let exact = light.at(cells_of(mesh).point(c, at));
                        assert!((value - exact).abs() < 1e-11, "{shape:?} {rule:?} {degree}");
                    }
                }
                assert!(solution.measured_max_error < 1e-12);
                assert!(crack(mesh) < 1e-11, "{shape:?} {rule:?} {degree}");
            }
        }
    }
}

fn star(radii: &[f64], scale: f64, turn: f64) -> Vec<DVec2> {
    let n = radii.len() as f64;
    let corner = |(i, r): (usize, &f64)| {
        DVec2::from_angle(turn + i as f64 / n * std::f64::consts::TAU) * *r * scale
    };
    radii.iter().enumerate().map(corner).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_polygons_are_filled(
        radii in prop::collection::vec(0.2..1.0f64, 3..12),
        hole in prop::collection::vec(0.3..1.0f64, 3..8),
        has_hole: bool,
        turn in 0.0..6.0f64,
        size in 0.05..0.8f64,
        marks in prop::collection::vec(0usize..1000, 0..40),
    ) {
        let mut border = vec![star(&radii, 1.0, turn)];
        // A ring of two sectors may leave the hole outside: radii of three are enough.
        if has_hole && radii.len() > 5 {
            let mut inner = star(&hole, 0.1, -turn);
            inner.reverse();
            border.push(inner);
        }
        let whole: f64 = border.iter().map(|l| antumbra::geom::signed_area(l)).sum();
        for shape in SHAPES {
            let base = uniform(&border, size, shape).map_err(|e| TestCaseError::fail(e.to_string()))?;
            prop_assert!(base.check().is_ok(), "{:?}", base.check());
            prop_assert!((base.total_area() - whole).abs() < 1e-11, "{} {whole}", base.total_area());
            prop_assert_eq!(base.n_t_vertices(), 0);
            for rule in [Rule::Plain, Rule::Restricted, Rule::Triangulated] {
                let mut forest = CellForest::new(base.clone(), rule);
                for chunk in marks.chunks(8) {
                    let (mesh, leaves) = forest.mesh();
                    let marked: Vec<u32> =
                        chunk.iter().map(|m| leaves[m % mesh.cells.len()]).collect();
                    forest.refine(&marked);
                }
                let (mesh, _) = forest.mesh();
                prop_assert!(mesh.check().is_ok(), "{:?}", mesh.check());
                prop_assert!((mesh.total_area() - whole).abs() < 1e-11);
                if rule == Rule::Triangulated {
                    prop_assert_eq!(mesh.n_t_vertices(), 0);
                }
            }
        }
    }
}

#[test]
fn meshes_are_bit_identical_for_any_number_of_threads() {
    let scene = build(&fixture("contact/table"));
    for mesher in CELL_MESHERS {
        let cells = CellOptions {
            mesher,
            size: CellSize::Elements(600),
            ..CellOptions::default()
        };
        let options = asked(None, 1e-3, cells);
        let [one, three] = [1, 3].map(|n| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap();
            pool.install(|| bits_of_meshes(&meshed(&scene, &options)))
        });
        assert!(one == three, "{mesher:?}");
    }
}

#[test]
fn substructuring_ends_at_the_least_size() {
    let scene = build(&fixture("contact/box-on-floor"));
    let least_size = 1.0 / 64.0;
    let cells = CellOptions {
        mesher: Mesher::Adaptive,
        size: CellSize::Tolerance,
        least_size,
        ..CellOptions::default()
    };
    let options = asked(Some(2), 1e-3, cells);
    let solution = meshed(&scene, &options);
    assert_eq!(solution.ended, Ended::ResolutionReached);
    let floor = &solution.receivers[0];
    assert!(!floor.unresolved.is_empty());
    let diagonal = floor
        .nodes
        .iter()
        .fold(0.0, |d: f64, p| d.max(p.distance(floor.nodes[0])));
    for c in 0..floor.n_elements() {
        assert!(cells_of(floor).longest_edge(c) > 0.49 * least_size * diagonal);
    }
}

#[test]
fn estimators_that_are_fooled_do_not_claim_the_tolerance() {
    let scene = build(&fixture("basic/two-triangles"));
    for estimator in Estimator::ALL {
        let cells = CellOptions {
            mesher: Mesher::Restricted,
            size: CellSize::Tolerance,
            estimator,
            ..CellOptions::default()
        };
        let options = Options {
            most_elements: 200_000,
            ..asked(Some(2), 1e-2, cells)
        };
        let solution = meshed(&scene, &options);
        println!(
            "{}: {} elements, {:.1e}, {:?}",
            estimator.key(),
            solution.n_elements(),
            solution.measured_max_error,
            solution.ended
        );
        let is_within = solution.measured_max_error <= 1e-2;
        assert_eq!(solution.ended == Ended::ToleranceReached, is_within);
        if estimator == Estimator::Measured {
            assert!(is_within);
        }
    }
}

#[test]
fn interreflection_on_cells_is_that_of_the_solution() {
    let scene = build(&fixture("basic/floating-box"));
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    for mesher in [Mesher::Uniform, Mesher::TriQuadtree, Mesher::Adaptive] {
        let tolerance = 2e-2;
        let cells = CellOptions {
            mesher,
            size: CellSize::Tolerance,
            ..CellOptions::default()
        };
        let options = asked(None, tolerance, cells);
        let solved = antumbra::solve(&scene, &options, &Control::NEVER).unwrap();
        let mut worst = 0.0f64;
        for (f, mesh) in solved.mesh.receivers.iter().enumerate() {
            assert_eq!(mesh.irradiance.len(), mesh.direct.len());
            for (k, &uv) in mesh.nodes.iter().enumerate().step_by(17) {
                assert!(mesh.irradiance[k] >= mesh.direct[k] - 1e-9);
                // In the middle of elements, where no node is.
                let Some(Spot { element: c, .. }) = mesh.locate(uv) else {
                    continue;
                };
                let at = [0.37, 0.41];
                let point = mesh.chart.to_space(cells_of(mesh).point(c, at));
                let place = antumbra::values::Place {
                    face: mesh.face,
                    point,
                };
                let found = gathered(&light, &evaluator, &solved, &[place]);
                let exact = found[0][0];
                let value = mesh.interpolate(&mesh.irradiance, 1, spot(mesh, c, at))[0];
                assert_eq!(f, mesh.face.index());
                worst = worst.max((value - exact).abs());
            }
        }
        let relative = worst / solved.mesh.peak[0];
        println!(
            "{mesher:?}: {relative:.1e}, {} elements",
            solved.mesh.n_elements()
        );
        if mesher == Mesher::Adaptive {
            assert!(relative <= tolerance, "{relative}");
        }
    }
}

#[test]
fn uniform_meshes_are_given_up_where_no_size_helps() {
    let scene = build(&fixture("contact/box-on-floor"));
    let cells = CellOptions {
        mesher: Mesher::Uniform,
        size: CellSize::Tolerance,
        ..CellOptions::default()
    };
    let options = asked(Some(1), 1e-2, cells);
    let solution = meshed(&scene, &options);
    assert_eq!(solution.ended, Ended::Stalled);
    assert!(solution.n_elements() < 100_000);
}
