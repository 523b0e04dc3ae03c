//! Curves to test with.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part")]

pub mod adversary;

use antumbra_mesh::{Order, TaggedCurve};
use glam::{DVec2, dvec2};

/// A small generator of numbers; the tests depend on its stream.
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11
    }

    /// From -1 to 1.
    pub fn signed(&mut self) -> f64 {
        self.bits() as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub fn point(&mut self) -> DVec2 {
        dvec2(self.signed(), self.signed())
    }

    pub fn shuffled(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

pub fn curve(points: &[DVec2], order: Order) -> TaggedCurve {
    TaggedCurve {
        points: points.to_vec(),
        order,
    }
}

pub fn segment(a: DVec2, b: DVec2) -> TaggedCurve {
    curve(&[a, b], Order::D1)
}

/// A closed outline as one boundary curve.
pub fn outline(corners: &[DVec2]) -> TaggedCurve {
    let mut points = corners.to_vec();
    points.push(corners[0]);
    curve(&points, Order::Boundary)
}

pub fn square(half: f64) -> TaggedCurve {
    let h = half;
    outline(&[dvec2(-h, -h), dvec2(h, -h), dvec2(h, h), dvec2(-h, h)])
}

/// Rotates, then moves.
pub fn moved(curves: &[TaggedCurve], angle: f64, offset: DVec2) -> Vec<TaggedCurve> {
    let turn = DVec2::from_angle(angle);
    curves
        .iter()
        .map(|c| TaggedCurve {
            points: c.points.iter().map(|&p| turn.rotate(p) + offset).collect(),
            order: c.order,
        })
        .collect()
}

/// Families of curves that are hard for floating point.
pub const FAMILIES: [&str; 10] = [
    "random",
    "pencil",
    "star",
    "lattice",
    "rotated lattice",
    "overlap",
    "bundle",
    "polylines",
    "tiny lattice",
    "T-junctions",
];

/// Curves of a family in the square from -1 to 1, which is their first curve.
pub fn family(name: &str, n: usize, noise: f64, rng: &mut Rng) -> Vec<TaggedCurve> {
    let mut curves = vec![square(1.0)];
    let centre = rng.point() * 0.3;
    let line = [rng.point() * 0.9, rng.point() * 0.9];
    let mut ends: Vec<DVec2> = Vec::new();
    for _ in 0..n {
        let (a, b) = match name {
            "random" | "polylines" => (rng.point(), rng.point()),
            "pencil" => (centre, rng.point()),
            "star" => {
                let a = rng.point();
                (a, centre + (centre - a) * (rng.signed().abs() + 0.1))
            }
            "lattice" | "rotated lattice" | "tiny lattice" => {
                let k = if name == "tiny lattice" { 4 } else { 16 };
                let mut at = || (rng.below(k + 1) as f64 / k as f64 - 0.5) * 1.3;
                let (a, b) = (dvec2(at(), at()), dvec2(at(), at()));
                let angle = if name == "rotated lattice" { 0.7 } else { 0.0 };
                (
                    DVec2::from_angle(angle).rotate(a),
                    DVec2::from_angle(angle).rotate(b),
                )
            }
            "overlap" => {
                let (s, t) = (rng.signed().abs(), rng.signed().abs());
                (line[0].lerp(line[1], s), line[0].lerp(line[1], t))
            }
            "bundle" => (line[0], line[1]),
            "T-junctions" if ends.len() > 4 => {
                let k = 2 * rng.below(ends.len() / 2);
                (ends[k].lerp(ends[k + 1], rng.signed().abs()), rng.point())
            }
            "T-junctions" => (rng.point(), rng.point()),
            other => panic!("no family {other}"),
        };
        let (a, b) = (a + noise * rng.point(), b + noise * rng.point());
        ends.extend([a, b]);
        let order = [Order::D0, Order::D1, Order::D2][rng.below(3)];
        if name == "polylines" {
            let bend = DVec2::from_angle(rng.signed()).rotate(b - a) * 0.5;
            let middle =
                (0..9).map(|k| a + bend * (f64::from(k) / 8.0).powi(2) + noise * rng.point());
            curves.push(curve(&middle.chain([b]).collect::<Vec<_>>(), order));
        } else {
            curves.push(curve(&[a, b], order));
        }
    }
    curves
}
