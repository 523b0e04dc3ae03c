//! Curves and scenes made of bytes: on small lattices, where everything coincides.

use antumbra::SceneInput;
use antumbra_mesh::{ArrangementOptions, Order, TaggedCurve};
use antumbra_tests::motion::Motion;
use antumbra_tests::scenes::{Facing, add, add_box, add_horizontal, empty};
use glam::{DVec2, DVec3, dvec2, dvec3};

use crate::Choices;

/// Pixels of the default arrangement of a square from -1 to 1.
const PIXEL: f64 = 1.0 / (1 << 27) as f64;

/// At most 40 curves of two to five points and a border, and how they are arranged.
#[must_use]
pub fn curves(choices: &mut Choices<'_>) -> (Vec<TaggedCurve>, ArrangementOptions) {
    let options = match choices.below(4) {
        0 => ArrangementOptions {
            bits: 8 + choices.below(24) as u32,
            sub_bits: choices.below(18) as u32,
            cluster: choices.of(&[4.0, 0.0, 1.0, 16.0]),
            weld: choices.of(&[4.0, 2.0, 16.0]),
            max_links: choices.of(&[50_000_000, 100]),
        },
        _ => ArrangementOptions::default(),
    };
    let noise = choices.of(&[0.0, 1e-16, 1e-14, 0.1 * PIXEL, PIXEL, 3.0 * PIXEL, 1e-6]);
    let step = choices.of(&[0.25, 0.125, 1.0 / 3.0, 2.0 * PIXEL, 0.5 * PIXEL]);
    let turn = DVec2::from_angle(choices.of(&[0.0, 0.0, 0.7, 0.785_398_163_397_448_3]));
    let offset = choices.of(&[0.0, 0.0, 10.0, 1e6]);

    let border: &[(f64, f64)] = choices.of(&[
        &[(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)] as &[_],
        &[
            (-1., -1.),
            (1., -1.),
            (1., 0.),
            (0., 0.),
            (0., 1.),
            (-1., 1.),
        ],
        &[(-1., -1e-6), (1., -1e-6), (1., 1e-6), (-1., 1e-6)],
        &[
            (-1., -1.),
            (1., -1.),
            (0., 1.),
            (-0.5, -0.875),
            (-0.75, 0.5),
        ],
    ]);
    let mut curves = vec![ring(border)];
    if choices.below(4) == 0 {
        curves.push(ring(&[(-0.5, -0.5), (-0.5, -0.25), (-0.25, -0.25)]));
    }
    while choices.are_left() && curves.len() < 40 {
        let order = choices.of(&[Order::D0, Order::D1, Order::D2, Order::Boundary]);
        let n = 2 + choices.below(4);
        let mut points: Vec<DVec2> = (0..n)
            .map(|_| {
                let at = choices.below(256);
                let lattice = dvec2((at % 16) as f64 - 8.0, (at / 16) as f64 - 8.0) * step;
                let nudge = choices.below(9);
                let nudge = dvec2((nudge % 3) as f64, (nudge / 3) as f64);
                lattice + noise * nudge
            })
            .collect();
        if order == Order::Boundary {
            // Another hole or island: it has to be closed to bound anything.
            points.push(points[0]);
        }
        curves.push(TaggedCurve { points, order });
    }
    for p in curves.iter_mut().flat_map(|c| &mut c.points) {
        *p = turn.rotate(*p) + DVec2::splat(offset);
    }
    (curves, options)
}

fn ring(corners: &[(f64, f64)]) -> TaggedCurve {
    let closed = corners.iter().chain(&corners[..1]);
    TaggedCurve {
        points: closed.map(|&(x, y)| dvec2(x, y)).collect(),
        order: Order::Boundary,
    }
}

/// At most six boxes and triangles with corners in multiples of 1/2, 1/4 or 1/8, or a
/// few roundings beside them, under a square lamp, over a floor; perhaps turned.
#[must_use]
pub fn scene(choices: &mut Choices<'_>) -> SceneInput {
    let mut scene = empty();
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let height = choices.of(&[3.0, 1.0, 2.0]);
    let lamp = ([-0.5, 0.5], [-0.5, 0.5], height);
    add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Down);

    let q = choices.of(&[2.0, 4.0, 8.0]);
    let ulps = choices.of(&[0, 0, 1, 4]);
    let angle = choices.of(&[0.0, 0.0, 0.7]);
    let mut n = 0;
    while choices.are_left() && n < 6 {
        n += 1;
        let steps = |choices: &mut Choices<'_>, from: f64, to: f64| {
            let x = from + choices.below(((to - from) * q) as usize + 1) as f64 / q;
            // Beside the lattice by some roundings of a number of size 1.
            let beside = [0.0, 1.0, -1.0][if ulps > 0 { choices.below(3) } else { 0 }];
            x + beside * f64::from(ulps) * f64::EPSILON
        };
        let corner = |choices: &mut Choices<'_>| {
            dvec3(
                steps(choices, -1.0, 1.0),
                steps(choices, -1.0, 1.0),
                steps(choices, 0.0, 2.0),
            )
        };
        if choices.below(2) == 0 {
            let a = corner(choices);
            let one = 1.0 / q;
            let mut side = || one + choices.below(q as usize) as f64 / q;
            let size = dvec3(side(), side(), side());
            add_box(&mut scene, &format!("box-{n}"), "grey", a, a + size);
        } else {
            let corners = [corner(choices), corner(choices), corner(choices)];
            let [a, b, c] = corners;
            if (b - a).cross(c - a).length() > 1e-3 {
                add(&mut scene, &format!("triangle-{n}"), "grey", &corners);
            }
        }
    }
    if angle == 0.0 {
        return scene;
    }
    Motion::rotation(DVec3::new(0.3, 0.5, 0.8), angle).scene(&scene)
}
