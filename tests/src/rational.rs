//! Irradiance by cone subtraction in rational arithmetic.
//!
//! The visible parts of the emitters are exact, whatever is coplanar, touches or
//! passes through a corner. Only the final contour sum is rounded.

use antumbra::SceneInput;
use dashu::rational::RBig;
use glam::DVec3;
use std::f64::consts::TAU;

type Point = [RBig; 3];

/// A convex polygon relative to the point.
type Polygon = Vec<Point>;

/// `normal · x > offset`.
struct HalfSpace {
    normal: Point,
    offset: RBig,
}

/// Irradiance in the first band at a point; file units.
///
/// * `normal` — of the receiver, of any length.
///
/// Surfaces must be convex, exactly plane, and have no holes. Two-sided
/// materials emit from their fronts only.
///
/// # Panics
///
/// If a coordinate is not finite.
#[must_use]
pub fn irradiance(scene: &SceneInput, point: DVec3, normal: DVec3) -> f64 {
    let p = exact(point);
    let relative =
        |corners: &[DVec3]| -> Polygon { corners.iter().map(|&c| minus(&exact(c), &p)).collect() };
    let polygons: Vec<Polygon> = scene
        .surfaces
        .iter()
        .map(|s| relative(&s.vertices))
        .collect();
    let horizon = HalfSpace {
        normal: exact(normal),
        offset: RBig::ZERO,
    };
    let unit = normal / normal.length();
    let mut sum = 0.0;
    for (surface, polygon) in scene.surfaces.iter().zip(&polygons) {
        let exitance = scene
            .materials
            .iter()
            .find(|m| m.name == surface.material)
            .map_or(0.0, |m| m.exitance[0]);
        // Front faces the point: the point lies above the polygon's plane.
        if exitance <= 0.0 || dot(&normal_of(polygon), &polygon[0]) >= RBig::ZERO {
            continue;
        }
        let (lit, _) = split(polygon, &horizon);
        let mut visible: Vec<Polygon> = if lit.is_empty() {
            Vec::new()
        } else {
            vec![lit]
        };
        for occluder in &polygons {
            let cone = cone(occluder);
            if !cone.is_empty() {
                visible = visible
                    .into_iter()
                    .flat_map(|part| subtract(part, &cone))
                    .collect();
            }
        }
        sum += exitance
            * visible
                .iter()
                .map(|part| contour_sum(part, unit))
                .sum::<f64>();
    }
    sum
}

/// The half-spaces whose intersection an occluder hides; none if it is seen
/// edge-on.
fn cone(occluder: &Polygon) -> Vec<HalfSpace> {
    let mut normal = normal_of(occluder);
    let mut offset = dot(&normal, &occluder[0]);
    if offset == RBig::ZERO {
        return Vec::new();
    }
    let is_flipped = offset < RBig::ZERO;
    if is_flipped {
        normal = normal.map(|c| -c);
        offset = -offset;
    }
    let n = occluder.len();
    let sides = (0..n).map(|i| {
        let plane = cross(&occluder[i], &occluder[(i + 1) % n]);
        let plane = if is_flipped { plane.map(|c| -c) } else { plane };
        HalfSpace {
            normal: plane,
            offset: RBig::ZERO,
        }
    });
    let sides: Vec<HalfSpace> = sides.collect();
    std::iter::once(HalfSpace { normal, offset })
        .chain(sides)
        .collect()
}

/// What is left of a polygon outside of a convex cone.
fn subtract(polygon: Polygon, cone: &[HalfSpace]) -> Vec<Polygon> {
    let mut outside = Vec::new();
    let mut rest = polygon.clone();
    for half in cone {
        let (inside, cut_off) = split(&rest, half);
        if inside.is_empty() {
            return vec![polygon];
        }
        if !cut_off.is_empty() {
            outside.push(cut_off);
        }
        rest = inside;
    }
    outside
}

/// The parts of a convex polygon inside and outside of a half-space; a part
/// without area is empty.
fn split(polygon: &Polygon, half: &HalfSpace) -> (Polygon, Polygon) {
    let values: Vec<RBig> = polygon
        .iter()
        .map(|x| dot(&half.normal, x) - &half.offset)
        .collect();
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    let n = polygon.len();
    for i in 0..n {
        let j = (i + 1) % n;
        if values[i] >= RBig::ZERO {
            inside.push(polygon[i].clone());
        }
        if values[i] <= RBig::ZERO {
            outside.push(polygon[i].clone());
        }
        let crosses = (values[i] > RBig::ZERO && values[j] < RBig::ZERO)
            || (values[i] < RBig::ZERO && values[j] > RBig::ZERO);
        if crosses {
            let t = &values[i] / (&values[i] - &values[j]);
            let cut: Point =
                std::array::from_fn(|k| &polygon[i][k] + (&polygon[j][k] - &polygon[i][k]) * &t);
            inside.push(cut.clone());
            outside.push(cut);
        }
    }
    if !values.iter().any(|v| *v > RBig::ZERO) {
        inside.clear();
    }
    if !values.iter().any(|v| *v < RBig::ZERO) {
        outside.clear();
    }
    (inside, outside)
}

/// Lambert's sum over the edges of a polygon, counter-clockwise as seen from the
/// origin.
fn contour_sum(polygon: &Polygon, normal: DVec3) -> f64 {
    let corners: Vec<DVec3> = polygon.iter().map(rounded).collect();
    let edge = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
        // As seen from its front, the polygon runs clockwise for Lambert.
        let axis = b.cross(a);
        let sine = axis.length();
        if sine == 0.0 {
            0.0
        } else {
            sine.atan2(a.dot(b)) / sine * axis.dot(normal)
        }
    };
    (0..corners.len()).map(edge).sum::<f64>() / TAU
}

fn normal_of(polygon: &Polygon) -> Point {
    let n = polygon.len();
    (1..n - 1).fold([RBig::ZERO, RBig::ZERO, RBig::ZERO], |sum, k| {
        let doubled = cross(
            &minus(&polygon[k], &polygon[0]),
            &minus(&polygon[k + 1], &polygon[0]),
        );
        std::array::from_fn(|i| &sum[i] + &doubled[i])
    })
}

fn exact(p: DVec3) -> Point {
    p.to_array()
        .map(|c| RBig::try_from(c).expect("a finite number is rational"))
}

fn rounded(p: &Point) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|k| p[k].to_f64().value()))
}

fn minus(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn dot(a: &Point, b: &Point) -> RBig {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &Point, b: &Point) -> Point {
    let minor = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}
