//! Areas, shapes and promises of meshes of cells.

use super::*;
use glam::dvec2;

fn polygons() -> Vec<(&'static str, Vec<Vec<DVec2>>)> {
    let turned = |l: &[(f64, f64)], angle: f64| -> Vec<DVec2> {
        let turn = DVec2::from_angle(angle);
        l.iter().map(|&(x, y)| turn.rotate(dvec2(x, y))).collect()
    };
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let hole = [(0.3, 0.3), (0.3, 0.7), (0.7, 0.7), (0.7, 0.3)];
    let l = [
        (0.0, 0.0),
        (2.0, 0.0),
        (2.0, 0.7),
        (0.9, 0.7),
        (0.9, 1.3),
        (0.0, 1.3),
    ];
    let star: Vec<(f64, f64)> = (0..10)
        .map(|i| {
            let r = if i % 2 == 0 { 1.0 } else { 0.45 };
            let a = f64::from(i) * std::f64::consts::PI / 5.0 + 0.1;
            (r * a.cos(), r * a.sin())
        })
        .collect();
    let slim = [(0.0, 0.0), (3.0, 0.05), (3.0, 0.1), (0.0, 0.12)];
    let tilted = [(0.25, 0.4), (0.5, 0.75), (0.75, 0.5), (0.5, 0.3)];
    vec![
        ("square", vec![turned(&square, 0.0)]),
        ("square-turned", vec![turned(&square, 0.4)]),
        ("frame", vec![turned(&square, 1.0), turned(&hole, 1.0)]),
        (
            "tilted-hole",
            vec![turned(&square, 0.0), turned(&tilted, 0.0)],
        ),
        ("l", vec![turned(&l, -0.7)]),
        ("star", vec![turned(&star, 0.0)]),
        ("slim", vec![turned(&slim, 0.3)]),
        (
            "triangle",
            vec![turned(&[(0.0, 0.0), (1.0, 0.2), (0.3, 0.9)], 0.0)],
        ),
    ]
}

fn area(border: &[Vec<DVec2>]) -> f64 {
    border.iter().map(|l| antumbra_geom::signed_area(l)).sum()
}

const SHAPES: [CellShape; 3] = [
    CellShape::Triangles,
    CellShape::Quadrilaterals,
    CellShape::Mixed,
];

#[test]
fn uniform_meshes_fill_their_polygon_with_good_shapes() {
    for (name, border) in polygons() {
        for shape in SHAPES {
            for size in [0.5, 0.17, 0.06] {
                let mesh = uniform(&border, size, shape).unwrap();
                mesh.check()
                    .unwrap_or_else(|e| panic!("{name} {shape:?} {size}: {e}"));
                let whole = area(&border);
                assert!(
                    (mesh.total_area() - whole).abs() < 1e-12 * whole,
                    "{name} {shape:?}"
                );
                for c in 0..mesh.cells.len() {
                    let quality = mesh.quality(c);
                    assert!(quality > 0.35, "{name} {shape:?} {size}: {quality}");
                    let longest = mesh.longest_edge(c);
                    assert!(longest < 2.2 * size, "{name} {shape:?} {size}: {longest}");
                }
            }
        }
    }
}

#[test]
fn rectilinear_polygons_are_rectangles_alone() {
    for (name, border) in polygons() {
        let is_rectilinear = ["square", "square-turned", "frame", "l"].contains(&name);
        let mesh = uniform(&border, 0.1, CellShape::Mixed).unwrap();
        let all = mesh.cells.iter().all(Cell::is_quadrilateral);
        assert_eq!(all, is_rectilinear, "{name}");
    }
}

#[test]
fn reference_coordinates_are_found_again() {
    for (name, border) in polygons() {
        for shape in SHAPES {
            let mesh = uniform(&border, 0.2, shape).unwrap();
            let locator = CellLocator::new(&mesh);
            for c in 0..mesh.cells.len() {
                let at = [0.31, 0.22];
                let p = mesh.point(c, at);
                let (found, there) = locator.locate(&mesh, p).unwrap();
                assert_eq!(found, c, "{name} {shape:?}");
                let off = (there[0] - at[0]).abs().max((there[1] - at[1]).abs());
                assert!(off < 1e-10, "{name} {shape:?}: {off}");
            }
        }
    }
}

#[test]
fn rules_are_kept_wherever_it_is_refined() {
    for (name, border) in polygons() {
        for shape in SHAPES {
            for rule in [Rule::Plain, Rule::Restricted, Rule::Triangulated] {
                let mut forest = CellForest::new(uniform(&border, 0.5, shape).unwrap(), rule);
                // Towards a corner of the border, where levels differ most.
                for _ in 0..6 {
                    let (mesh, leaves) = forest.mesh();
                    let nearest = (0..mesh.cells.len()).min_by(|&a, &b| {
                        let d = |c| mesh.centre(c).distance(border[0][1]);
                        d(a).total_cmp(&d(b))
                    });
                    forest.refine(&[leaves[nearest.unwrap()]]);
                }
                let (mesh, _) = forest.mesh();
                mesh.check()
                    .unwrap_or_else(|e| panic!("{name} {shape:?} {rule:?}: {e}"));
                let whole = area(&border);
                assert!((mesh.total_area() - whole).abs() < 1e-12 * whole, "{name}");
                match rule {
                    Rule::Plain => assert!(mesh.n_t_vertices() > 0, "{name} {shape:?}"),
                    Rule::Restricted => assert!(mesh.n_t_vertices() > 0, "{name} {shape:?}"),
                    Rule::Triangulated => assert_eq!(mesh.n_t_vertices(), 0, "{name} {shape:?}"),
                }
                let mut largest = 0;
                for c in 0..mesh.cells.len() {
                    for k in 0..mesh.cells[c].corners().len() {
                        if let Beyond::Coarser { cell, .. } = mesh.beyond(c, k) {
                            let coarse = mesh.cells[cell as usize].level;
                            largest = largest.max(mesh.cells[c].level - coarse);
                        }
                    }
                }
                if rule != Rule::Plain {
                    assert!(largest <= 1, "{name} {shape:?} {rule:?}: {largest} levels");
                }
            }
        }
    }
}

#[test]
fn graded_meshes_are_as_fine_as_asked_for() {
    let border = &polygons()[0].1;
    for shape in SHAPES {
        let size_at = |p: DVec2| 0.2 * p.length().clamp(0.1, 1.0);
        let forest = graded(border, 0.2, &size_at, 4, shape).unwrap();
        let (mesh, _) = forest.mesh();
        mesh.check().unwrap();
        assert!((mesh.total_area() - 1.0).abs() < 1e-12);
        for c in 0..mesh.cells.len() {
            let (longest, wanted) = (mesh.longest_edge(c), size_at(mesh.centre(c)));
            assert!(longest < 2.5 * wanted, "{shape:?}: {longest} for {wanted}");
        }
        assert!(mesh.cells.len() < 1500, "{shape:?}: {}", mesh.cells.len());
    }
}
