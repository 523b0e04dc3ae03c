//! Form factors of thin, far and near rectangles: errors that are claimed hold, and all end.

use antumbra::{Control, FactorOptions, FormFactors, Scene, SceneInput, factors};
use antumbra_tests::cases::{build, fixture, fixtures};
use antumbra_tests::motion::Motion;
use antumbra_tests::scenes::{add, empty};
use glam::{DVec3, dvec3};
use serde::Deserialize;

/// `fixtures/factors/rectangles-of-extreme-proportions.json`, which says where the
/// values are from.
#[derive(Deserialize)]
struct File {
    cases: Vec<Rectangles>,
}

/// Ranges along x and y; of a wall, along y and z.
#[derive(Deserialize)]
#[serde(tag = "kind")]
enum Shape {
    #[serde(rename = "opposed")]
    Opposed {
        lower: [[f64; 2]; 2],
        upper: [[f64; 2]; 2],
        distance: f64,
    },
    #[serde(rename = "at a right angle")]
    AtARightAngle {
        floor: [[f64; 2]; 2],
        wall: [[f64; 2]; 2],
    },
}

#[derive(Deserialize)]
struct Rectangles {
    #[serde(flatten)]
    shape: Shape,
    /// Area times form factor.
    exchange: f64,
}

impl Rectangles {
    fn scene(&self) -> SceneInput {
        let mut scene = empty();
        let flat = |[[x1, x2], [y1, y2]]: [[f64; 2]; 2], z: f64| {
            [
                dvec3(x1, y1, z),
                dvec3(x2, y1, z),
                dvec3(x2, y2, z),
                dvec3(x1, y2, z),
            ]
        };
        let [a, b] = match self.shape {
            Shape::Opposed {
                lower,
                upper,
                distance,
            } => {
                let mut upper = flat(upper, distance);
                upper.reverse();
                [flat(lower, 0.0), upper]
            }
            // (y, z, 0) becomes (0, y, z): to the side of the floor.
            Shape::AtARightAngle { floor, wall } => {
                let upright = |p: DVec3| dvec3(0.0, p.x, p.y);
                [flat(floor, 0.0), flat(wall, 0.0).map(upright)]
            }
        };
        add(&mut scene, "a", "grey", &a);
        add(&mut scene, "b", "grey", &b);
        scene
    }

    fn areas(&self) -> [f64; 2] {
        let area = |[[x1, x2], [y1, y2]]: [[f64; 2]; 2]| (x2 - x1) * (y2 - y1);
        match self.shape {
            Shape::Opposed { lower, upper, .. } => [lower, upper].map(area),
            Shape::AtARightAngle { floor, wall } => [floor, wall].map(area),
        }
    }
}

fn matrix(scene: &Scene, tolerance: f64) -> FormFactors {
    let options = FactorOptions {
        tolerance,
        ..FactorOptions::default()
    };
    factors(scene, &options, &Control::NEVER)
}

#[test]
fn claimed_errors_hold_at_extreme_proportions() {
    let path = fixtures().join("factors/rectangles-of-extreme-proportions.json");
    let text = std::fs::read_to_string(path).expect("the fixture is there");
    let file: File = serde_json::from_str(&text).expect("the fixture is read");
    assert!(file.cases.len() > 100);
    for (k, case) in file.cases.iter().enumerate() {
        let input = case.scene();
        for motion in [Motion::IDENTITY, Motion::skew()] {
            let matrix = matrix(&build(&motion.scene(&input)), 1e-6);
            for (i, area) in case.areas().into_iter().enumerate() {
                let off = (matrix.factor(i, 1 - i) - case.exchange / area).abs();
                let claimed = matrix.errors[i * 2 + 1 - i];
                assert!(
                    off <= claimed,
                    "case {k} from {i}: off by {off:e} of {claimed:e}"
                );
            }
        }
    }
}

/// Of a strip of 1.5 × 0.00125, 300 below a plate of 3 × 73. The integrals were halved
/// for ever; without singularities there are few evaluations to make.
#[test]
fn a_strip_far_below_a_plate_has_a_factor() {
    let scene = build(&fixture("factors/strip-far-below-a-tall-plate"));
    let matrix = matrix(&scene, 1e-6);
    // Both are small against the distance, so nearly the product of the areas over π r².
    let about = 7.46e-4;
    assert!(
        (matrix.factor(0, 1) - about).abs() < 1e-5,
        "{}",
        matrix.factor(0, 1)
    );
    assert!(matrix.max_error() < 1e-9, "{:e}", matrix.max_error());
}

/// One integral was off by 4.5 times what it claimed, and its row said so.
#[test]
fn rows_of_a_closed_room_are_no_farther_from_one_than_their_errors() {
    let scene = build(&fixture("factors/furnished-room-whose-row-misses-one"));
    let matrix = matrix(&scene, 1e-9);
    let n = matrix.n();
    for (i, sum) in matrix.row_sums().into_iter().enumerate() {
        let claimed: f64 = matrix.errors[i * n..(i + 1) * n].iter().sum();
        let off = (sum - 1.0).abs();
        assert!(
            off <= claimed,
            "{}: {off:e} of {claimed:e}",
            matrix.names[i]
        );
    }
}
