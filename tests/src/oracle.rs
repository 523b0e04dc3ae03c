//! Irradiance by sampling the emitters: slow, and obviously right.
//!
//! No polygon is clipped and no contour summed: every emitter is cut into equal
//! triangles, and a straight line decides for each whether it is seen.

use antumbra::SceneInput;
use antumbra::scene::SurfaceInput;
use glam::DVec3;

/// An estimate and how far it may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampled {
    /// Irradiance in the first band.
    pub irradiance: f64,
    /// What the cells add that are seen in part: the most that visibility can
    /// be wrong by, if no cell hides a whole gap.
    pub undecided: f64,
}

/// Irradiance at a point by the midpoint rule.
///
/// * `n` — every triangle of an emitter is cut into `n²` cells.
///
/// Surfaces must be convex and have no holes. Two-sided materials emit from
/// their fronts only.
#[must_use]
pub fn sampled(scene: &SceneInput, point: DVec3, normal: DVec3, n: usize) -> Sampled {
    let mut sum = Sampled {
        irradiance: 0.0,
        undecided: 0.0,
    };
    for emitter in &scene.surfaces {
        let exitance = scene
            .materials
            .iter()
            .find(|m| m.name == emitter.material)
            .map_or(0.0, |m| m.exitance[0]);
        if exitance > 0.0 {
            for k in 1..emitter.vertices.len() - 1 {
                let v = &emitter.vertices;
                let part = triangle(scene, [v[0], v[k], v[k + 1]], point, normal, n);
                sum.irradiance += exitance * part.irradiance;
                sum.undecided += exitance * part.undecided;
            }
        }
    }
    sum
}

fn triangle(
    scene: &SceneInput,
    [a, b, c]: [DVec3; 3],
    point: DVec3,
    normal: DVec3,
    n: usize,
) -> Sampled {
    let (u, v) = ((b - a) / n as f64, (c - a) / n as f64);
    let doubled = u.cross(v);
    let area = doubled.length() / 2.0;
    let front = doubled / doubled.length();
    let corner = |i: usize, j: usize| a + u * i as f64 + v * j as f64;
    let is_seen: Vec<bool> = (0..=n)
        .flat_map(|i| (0..=n - i).map(move |j| (i, j)))
        .map(|(i, j)| is_visible(scene, point, corner(i, j)))
        .collect();
    // Row i starts after the rows of n + 1, n, … corners before it.
    let seen = |i: usize, j: usize| is_seen[i * (n + 1) - i * i.saturating_sub(1) / 2 + j];
    let mut sum = Sampled {
        irradiance: 0.0,
        undecided: 0.0,
    };
    let mut cell = |corners: [(usize, usize); 3]| {
        let [p, q, r] = corners.map(|(i, j)| corner(i, j));
        let middle = (p + q + r) / 3.0;
        let to = middle - point;
        let d_sq = to.length_squared();
        let (here, there) = (normal.dot(to), -front.dot(to));
        if here <= 0.0 || there <= 0.0 {
            return;
        }
        let power = here * there / (std::f64::consts::PI * d_sq * d_sq) * area;
        let of_middle = is_visible(scene, point, middle);
        if of_middle {
            sum.irradiance += power;
        }
        if corners.iter().any(|&(i, j)| seen(i, j) != of_middle) {
            sum.undecided += power;
        }
    };
    for i in 0..n {
        for j in 0..n - i {
            cell([(i, j), (i + 1, j), (i, j + 1)]);
            if i + j + 2 <= n {
                cell([(i + 1, j), (i + 1, j + 1), (i, j + 1)]);
            }
        }
    }
    sum
}

/// Does no surface cut the line between two points?
fn is_visible(scene: &SceneInput, from: DVec3, to: DVec3) -> bool {
    !scene.surfaces.iter().any(|s| cuts(s, from, to))
}

/// Does a convex surface cut the open line between two points? One that ends on
/// its plane is not cut.
fn cuts(surface: &SurfaceInput, from: DVec3, to: DVec3) -> bool {
    let v = &surface.vertices;
    let normal: DVec3 = (0..v.len())
        .map(|i| (v[i] - v[0]).cross(v[(i + 1) % v.len()] - v[0]))
        .sum();
    let (p, q) = (normal.dot(from - v[0]), normal.dot(to - v[0]));
    let rounding = 1e-12 * normal.length() * (to - from).length();
    if p.abs() <= rounding || q.abs() <= rounding || (p > 0.0) == (q > 0.0) {
        return false;
    }
    let hit = from + (to - from) * (p / (p - q));
    // Of one turn around the hit.
    let mut turns =
        (0..v.len()).map(|i| normal.dot((v[i] - hit).cross(v[(i + 1) % v.len()] - hit)));
    turns.all(|turn| turn >= 0.0)
}
