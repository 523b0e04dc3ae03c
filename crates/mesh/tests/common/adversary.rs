//! Sets of curves that are made to break an arrangement.

use std::f64::consts::TAU;

use antumbra_mesh::{Order, TaggedCurve};
use glam::{DVec2, DVec3, dvec2, dvec3};

use super::{Rng, curve, moved, outline, segment};

/// A set of curves and where it comes from.
pub struct Case {
    pub name: String,
    pub curves: Vec<TaggedCurve>,
    /// So many curves, the first, are the border.
    pub n_rings: usize,
    /// What it bounds.
    pub area: f64,
    /// How long the border is.
    pub perimeter: f64,
}

/// Sizes of noise, as parts of the receiver; 2^-28 is a pixel.
const NOISE: [f64; 9] = [0.0, 1e-16, 1e-15, 1e-13, 1e-11, 1e-9, 1e-8, 1e-6, 1e-4];

/// Some kinds of curves over some kind of border, perhaps moved, scaled, and doubled.
pub fn case(rng: &mut Rng) -> Case {
    let (border_name, mut curves) = border(rng);
    let rings: Vec<Vec<DVec2>> = curves.iter().map(|c| c.points.clone()).collect();
    let noise = NOISE[rng.below(NOISE.len())];
    let mut name = format!("{border_name}, noise {noise:e}");
    for _ in 0..1 + rng.below(2) {
        let kind = KINDS[rng.below(KINDS.len())];
        let most = [4, 12, 30][rng.below(3)];
        let n = 1 + rng.below(most);
        name += &format!(", {n} {}", kind.0);
        curves.extend((kind.1)(rng, n, noise, &rings));
    }
    if rng.below(4) == 0 {
        name += ", all twice";
        let lines = curves[rings.len()..].to_vec();
        curves.extend(lines);
    }
    let (mut area, mut perimeter) = (0.0, 0.0);
    for ring in &rings {
        let shoelace: f64 = ring.windows(2).map(|p| p[0].perp_dot(p[1])).sum();
        area += if area == 0.0 { 1.0 } else { -1.0 } * shoelace.abs() / 2.0;
        perimeter += ring.windows(2).map(|p| p[0].distance(p[1])).sum::<f64>();
    }

    let angle = [0.0, 0.0, 0.7, TAU / 8.0][rng.below(4)];
    let scale = [1.0, 1.0, 1e-6, 1e6][rng.below(4)];
    let offset = [0.0, 0.0, 3.0, 1e6][rng.below(4)];
    name += &format!(", turned by {angle}, times {scale}, moved by {offset} sizes");
    for p in curves.iter_mut().flat_map(|c| &mut c.points) {
        *p *= scale;
    }
    let offset = dvec2(offset, -0.37 * offset) * scale;
    Case {
        name,
        curves: moved(&curves, angle, offset),
        n_rings: rings.len(),
        area: area * scale * scale,
        perimeter: perimeter * scale,
    }
}

/// The outer ring first, then holes; within the square from -1 to 1.
fn border(rng: &mut Rng) -> (&'static str, Vec<TaggedCurve>) {
    let ring = |corners: &[(f64, f64)]| -> TaggedCurve {
        let points: Vec<DVec2> = corners.iter().map(|&(x, y)| dvec2(x, y)).collect();
        outline(&points)
    };
    let square = [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)];
    match rng.below(9) {
        0 => (
            "an L",
            vec![ring(&[
                (-1., -1.),
                (1., -1.),
                (1., 0.),
                (0., 0.),
                (0., 1.),
                (-1., 1.),
            ])],
        ),
        1 => {
            let n = 5 + rng.below(9);
            let corners: Vec<DVec2> = (0..n)
                .map(|k| {
                    let angle = (k as f64 + 0.4 * rng.signed()) / n as f64 * TAU;
                    DVec2::from_angle(angle) * (0.55 + 0.45 * rng.signed())
                })
                .collect();
            ("a star", vec![outline(&corners)])
        }
        2 => {
            let hole = [(-0.5, -0.5), (-0.5, 0.25), (0.25, 0.25), (0.25, -0.5)];
            ("a square with a hole", vec![ring(&square), ring(&hole)])
        }
        3 => {
            let mut rings = vec![ring(&square)];
            for k in 0..2 + rng.below(4) {
                let x = -0.9 + 0.3 * k as f64;
                let gap = [0.05, 1e-4, 1e-6][rng.below(3)];
                let (right, low) = (x + 0.3 - gap, 0.4 * rng.signed());
                rings.push(ring(&[(x, low), (right, low), (right, 0.7), (x, 0.9)]));
            }
            ("a square with holes side by side", rings)
        }
        4 => {
            let y = [1e-3, 1e-5, 1e-6][rng.below(3)];
            (
                "a sliver",
                vec![ring(&[(-1., -y), (1., -y), (1., y), (-1., y)])],
            )
        }
        5 => (
            "a needle",
            vec![ring(&[(-1., 0.), (1., -1e-6), (0.3, 1e-6)])],
        ),
        6 => (
            "a comb",
            vec![ring(&[
                (-1., -1.),
                (1., -1.),
                (1., 1.),
                (0.5, -0.9),
                (0.25, 1.),
                (0.25 - 1e-5, -0.9),
                (-0.5, 1.),
                (-0.5, -0.9),
                (-1., 1.),
            ])],
        ),
        _ => ("a square", vec![ring(&square)]),
    }
}

type Make = fn(&mut Rng, usize, f64, &[Vec<DVec2>]) -> Vec<TaggedCurve>;

const KINDS: [(&str, Make); 13] = [
    ("pencil", pencil),
    ("star", star),
    ("lattice", lattice),
    ("fine lattice", fine_lattice),
    ("collinear", collinear),
    ("bundle", bundle),
    ("traces of boxes", traces),
    ("arcs", arcs),
    ("beside the border", beside_the_border),
    ("ends on the border", ends_on_the_border),
    ("slivers", slivers),
    ("zigzags", zigzags),
    ("any", any),
];

fn order(rng: &mut Rng) -> Order {
    [Order::D0, Order::D1, Order::D2][rng.below(3)]
}

fn line(rng: &mut Rng, a: DVec2, b: DVec2, noise: f64) -> TaggedCurve {
    let ends = [a + noise * rng.point(), b + noise * rng.point()];
    curve(&ends, order(rng))
}

/// All start in one point.
fn pencil(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let centre = rng.point() * 0.5;
    (0..n)
        .map(|_| {
            let end = rng.point();
            line(rng, centre, end, noise)
        })
        .collect()
}

/// All pass through one point.
fn star(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let centre = rng.point() * 0.5;
    (0..n)
        .map(|_| {
            let a = rng.point();
            let b = centre + (centre - a) * (rng.signed().abs() + 0.1);
            line(rng, a, b, noise)
        })
        .collect()
}

fn on_lattice(rng: &mut Rng, n: usize, noise: f64, steps: usize, size: f64) -> Vec<TaggedCurve> {
    let at = |rng: &mut Rng| {
        let mut x = || (rng.below(steps + 1) as f64 / steps as f64 - 0.5) * size;
        dvec2(x(), x())
    };
    (0..n)
        .map(|_| {
            let (a, b) = (at(rng), at(rng));
            line(rng, a, b, noise)
        })
        .collect()
}

fn lattice(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    on_lattice(rng, n, noise, 16, 2.0)
}

/// Steps of a few pixels.
fn fine_lattice(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let step = 2.0_f64.powi(-28 + rng.below(5) as i32);
    on_lattice(rng, n, noise.min(step), 12, 12.0 * step)
}

/// Overlap on one line.
fn collinear(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let (a, b) = (rng.point(), rng.point());
    (0..n)
        .map(|_| {
            let [s, t] = [0; 2].map(|_| rng.below(33) as f64 / 32.0);
            line(rng, a.lerp(b, s), a.lerp(b, t), noise)
        })
        .collect()
}

/// Parallel, some pixels apart.
fn bundle(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let (a, b) = (rng.point(), rng.point());
    let gap = (b - a).normalize_or_zero().perp() * 2.0_f64.powi(-29 + rng.below(6) as i32);
    (0..n)
        .map(|k| {
            let aside = gap * k as f64;
            line(rng, a + aside, b + aside, noise)
        })
        .collect()
}

/// Lines where the planes through corners of a lamp and edges of boxes that are turned
/// meet the floor.
fn traces(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let turn = DVec2::from_angle(0.7 * rng.below(2) as f64);
    let place = |p: DVec3| (turn.rotate(dvec2(p.x, p.y))).extend(p.z);
    let mut curves = Vec::new();
    for k in 0..n.div_ceil(6).min(4) {
        let low = dvec3(
            -0.5 + 0.25 * k as f64,
            0.25 * rng.below(3) as f64 - 0.25,
            0.5,
        );
        let size = 0.125;
        let corner = |i: usize| {
            let up = |axis: usize| ((i >> axis) & 1) as f64 * size;
            place(low + dvec3(up(0), up(1), up(2)))
        };
        for lamp in [(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)] {
            let lamp = place(dvec3(lamp.0, lamp.1, 2.0));
            let shadow = |p: DVec3| {
                let q = lamp + (p - lamp) * (lamp.z / (lamp.z - p.z));
                dvec2(q.x, q.y)
            };
            for i in 0..8 {
                for axis in (0..3).filter(|axis| (i >> axis) & 1 == 0) {
                    let (a, b) = (shadow(corner(i)), shadow(corner(i | 1 << axis)));
                    curves.push(line(rng, a, b, noise.min(1e-8)));
                }
            }
        }
    }
    curves
}

/// Circles as polylines that touch each other and the tangents of each other.
fn arcs(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    let touch = rng.point() * 0.5;
    let normal = DVec2::from_angle(rng.signed() * 3.0);
    let mut curves = vec![line(
        rng,
        touch - 0.4 * normal.perp(),
        touch + 0.4 * normal.perp(),
        noise,
    )];
    for _ in 0..n.min(6) {
        let radius = 0.4 * rng.signed();
        let centre = touch + normal * radius;
        let n_chords = 3 + rng.below(20);
        let turn = [TAU, 1.0, 0.01][rng.below(3)];
        let points: Vec<DVec2> = (0..=n_chords)
            .map(|k| {
                // One point is where all touch.
                let angle = (k as f64 / n_chords as f64 - 0.5) * turn;
                centre - DVec2::from_angle(angle).rotate(normal) * radius + noise * rng.point()
            })
            .collect();
        curves.push(curve(&points, order(rng)));
    }
    curves
}

/// Along sides of the border, a hair inside or outside, or on it.
fn beside_the_border(
    rng: &mut Rng,
    n: usize,
    noise: f64,
    rings: &[Vec<DVec2>],
) -> Vec<TaggedCurve> {
    (0..n)
        .map(|_| {
            let (a, b) = side(rng, rings);
            let hair = [0.0, 1e-16, 1e-10, 1e-9, 2e-9, 5e-9, 1e-8, 3e-8, 1e-7, 1e-5];
            let hair = hair[rng.below(hair.len())] * if rng.below(2) == 0 { 1.0 } else { -1.0 };
            let aside = (b - a).normalize_or_zero().perp() * hair;
            let [s, t] = [0; 2].map(|_| [0.0, 1.0, rng.signed(), 1.0 + 1e-9][rng.below(4)]);
            let slant = [0.0, 1e-9, 1e-7][rng.below(3)] * rng.signed();
            let slant = (b - a).perp() * slant;
            line(
                rng,
                a.lerp(b, s) + aside,
                a.lerp(b, t) + aside + slant,
                noise,
            )
        })
        .collect()
}

/// From somewhere to a corner of the border, to a side of it, or a hair beyond.
fn ends_on_the_border(
    rng: &mut Rng,
    n: usize,
    noise: f64,
    rings: &[Vec<DVec2>],
) -> Vec<TaggedCurve> {
    (0..n)
        .map(|_| {
            let (a, b) = side(rng, rings);
            let at = a.lerp(b, [0.0, 0.5, rng.signed().abs()][rng.below(3)]);
            let from = rng.point();
            let beyond = 1.0 + [0.0, 1e-9, -1e-9, 1e-8, -1e-8, 1e-3][rng.below(6)];
            line(rng, from, from.lerp(at, beyond), noise)
        })
        .collect()
}

fn side(rng: &mut Rng, rings: &[Vec<DVec2>]) -> (DVec2, DVec2) {
    let ring = &rings[rng.below(rings.len())];
    let k = rng.below(ring.len() - 1);
    (ring[k], ring[k + 1])
}

/// Triangles a million times longer than high.
fn slivers(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    (0..n)
        .map(|_| {
            let (a, b) = (rng.point(), rng.point());
            let apex = a.lerp(b, rng.signed().abs()) + (b - a).perp() * 1e-6 * rng.signed();
            let points = [a, b, apex, a].map(|p| p + noise * rng.point());
            curve(&points, order(rng))
        })
        .collect()
}

/// Polylines that turn back on themselves and repeat points.
fn zigzags(rng: &mut Rng, n: usize, noise: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    (0..n.min(10))
        .map(|_| {
            let spots: Vec<DVec2> = (0..3).map(|_| rng.point()).collect();
            let points: Vec<DVec2> = (0..2 + rng.below(8))
                .map(|_| spots[rng.below(3)] + noise * rng.point())
                .collect();
            curve(&points, order(rng))
        })
        .collect()
}

fn any(rng: &mut Rng, n: usize, _: f64, _: &[Vec<DVec2>]) -> Vec<TaggedCurve> {
    (0..n)
        .map(|_| segment(rng.point() * 1.2, rng.point()))
        .collect()
}

/// Leaves out curves, then points of curves, as long as it still fails.
pub fn reduced(curves: &[TaggedCurve], fails: impl Fn(&[TaggedCurve]) -> bool) -> Vec<TaggedCurve> {
    let mut curves = curves.to_vec();
    let mut at = 0;
    while at < curves.len() {
        let mut fewer = curves.clone();
        fewer.remove(at);
        if fails(&fewer) {
            curves = fewer;
        } else {
            at += 1;
        }
    }
    for c in 0..curves.len() {
        let mut at = 0;
        while at < curves[c].points.len() {
            let mut fewer = curves.clone();
            fewer[c].points.remove(at);
            if fails(&fewer) {
                curves = fewer;
            } else {
                at += 1;
            }
        }
    }
    curves
}
