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
                let worst = (0..mesh.cells.len())
                    .map(|c| mesh.quality(c))
                    .fold(1.0, f64::min);
                let n = mesh.cells.len();
                let longest = (0..n).map(|c| mesh.longest_edge(c)).fold(0.0, f64::max);
                println!(
                    "{name} {shape:?} {size}: {n} cells, worst {worst:.3}, longest {:.2}",
                    longest / size
                );
            }
        }
    }
}
