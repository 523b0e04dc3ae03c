//! Random triangulations come back as the polygons they were made of.

use super::*;
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, Scene, SceneInput};
use glam::{DQuat, dvec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const N: usize = 6;

fn part(triangles: Vec<[DVec3; 3]>) -> Part {
    let largest = |p: &DVec3| p.abs().max_element();
    Part {
        name: None,
        material: "m".to_owned(),
        magnitude: triangles.iter().flatten().map(largest).fold(0.0, f64::max),
        triangles,
    }
}

fn merge(triangles: Vec<[DVec3; 3]>) -> Merged {
    surfaces(&[part(triangles)], "m")
}

/// What the check of scenes says, or its errors.
fn check(merged: &Merged) -> Result<Vec<String>, Vec<String>> {
    let input = SceneInput {
        length_unit: LengthUnit::Metre,
        quantity: Quantity::None,
        materials: vec![MaterialInput {
            name: "m".to_owned(),
            reflectance: vec![0.5],
            exitance: vec![0.0],
            two_sided: false,
        }],
        surfaces: merged.surfaces.clone(),
        triangulate: false,
        notes: Vec::new(),
    };
    let said = |list: Vec<antumbra_scene::Problem>| list.into_iter().map(|p| p.message).collect();
    match Scene::build(&input) {
        Ok(built) => Ok(said(built.warnings)),
        Err(problems) => Err(said(problems)),
    }
}

/// The outline's area minus that of the holes, by their vector areas.
fn area(surface: &SurfaceInput) -> f64 {
    let outline = newell_normal(&surface.vertices);
    let normal = outline.normalize_or_zero();
    let holes: f64 = surface
        .holes
        .iter()
        .map(|hole| newell_normal(hole).dot(normal).abs())
        .sum();
    (outline.length() - holes) / 2.0
}

fn total(merged: &Merged) -> f64 {
    merged.surfaces.iter().map(area).sum()
}

fn n_corners(merged: &Merged) -> usize {
    let loops = |s: &SurfaceInput| s.vertices.len() + s.holes.iter().map(Vec::len).sum::<usize>();
    merged.surfaces.iter().map(loops).sum()
}

/// Cells of a lattice, one plane, and how they are cut into triangles.
#[derive(Clone, Debug)]
struct Pattern {
    is_filled: [[bool; N]; N],
    /// Of each cell: which diagonal, and does it join its right neighbour?
    cuts: [[(bool, bool); N]; N],
    /// Moves the lattice's vertices, so little that all triangles keep their front.
    jitter: Option<Vec<[f64; 2]>>,
    rotation: [f64; 4],
    offset: [f64; 3],
    order: u64,
}

fn pattern(with_jitter: bool) -> impl Strategy<Value = Pattern> {
    let jitter = if with_jitter {
        prop::collection::vec([-0.2..0.2, -0.2..0.2], (N + 1) * (N + 1))
            .prop_map(Some)
            .boxed()
    } else {
        Just(None).boxed()
    };
    (
        prop::array::uniform6(prop::array::uniform6(prop::bool::weighted(0.7))),
        prop::array::uniform6(prop::array::uniform6(any::<(bool, bool)>())),
        jitter,
        prop::array::uniform4(-1.0..1.0).prop_filter("a direction", |q| {
            glam::DVec4::from_array(*q).length() > 0.1
        }),
        prop::array::uniform3(-20.0..20.0),
        any::<u64>(),
    )
        .prop_map(
            |(is_filled, cuts, jitter, rotation, offset, order)| Pattern {
                is_filled,
                cuts,
                jitter,
                rotation,
                offset,
                order,
            },
        )
}

impl Pattern {
    fn filled(&self, x: i32, y: i32) -> bool {
        let inside = |k: i32| (0..N as i32).contains(&k);
        inside(x) && inside(y) && self.is_filled[y as usize][x as usize]
    }

    /// Rounded to single precision, as a file has it.
    fn vertex(&self, x: usize, y: usize) -> DVec3 {
        let [dx, dy] = self
            .jitter
            .as_ref()
            .map_or([0.0; 2], |j| j[y * (N + 1) + x]);
        let rotation = DQuat::from_array(self.rotation).normalize();
        let place = rotation * dvec3(x as f64 + dx, y as f64 + dy, 0.0);
        (place + DVec3::from_array(self.offset))
            .as_vec3()
            .as_dvec3()
    }

    fn triangles(&self) -> Vec<[DVec3; 3]> {
        let mut triangles = Vec::new();
        for y in 0..N {
            let mut x = 0;
            while x < N {
                let (diagonal, joins) = self.cuts[y][x];
                let at = x;
                x += 1;
                if !self.is_filled[y][at] {
                    continue;
                }
                // Two cells as one leave a T-vertex at their neighbours.
                if self.jitter.is_none() && joins && x < N && self.is_filled[y][x] {
                    x += 1;
                }
                let [a, b, c, d] =
                    [(at, y), (x, y), (x, y + 1), (at, y + 1)].map(|(x, y)| self.vertex(x, y));
                if diagonal {
                    triangles.extend([[a, b, c], [c, d, a]]);
                } else {
                    triangles.extend([[d, b, c], [b, d, a]]);
                }
            }
        }
        // Shuffled, and each from another corner.
        let mut state = self.order | 1;
        for i in (1..triangles.len()).rev() {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1);
            triangles.swap(i, (state >> 33) as usize % (i + 1));
            triangles[i].rotate_left((state >> 20) as usize % 3);
        }
        triangles
    }

    /// Regions of cells that share edges.
    fn n_regions(&self) -> usize {
        let mut is_open = self.is_filled;
        let mut n = 0;
        for y in 0..N {
            for x in 0..N {
                let mut stack = vec![(x, y)];
                let before = is_open[y][x];
                while let Some((x, y)) = stack.pop() {
                    if x < N && y < N && is_open[y][x] {
                        is_open[y][x] = false;
                        stack.extend([(x + 1, y), (x, y + 1)]);
                        stack.extend([(x.wrapping_sub(1), y), (x, y.wrapping_sub(1))]);
                    }
                }
                n += usize::from(before);
            }
        }
        n
    }

    /// Edges of the border, and corners where it turns.
    fn border(&self) -> (usize, usize) {
        let (mut n_edges, mut n_turns) = (0, 0);
        for y in 0..=N as i32 {
            for x in 0..=N as i32 {
                let [a, b, c, d] = [(x, y), (x - 1, y), (x - 1, y - 1), (x, y - 1)]
                    .map(|(x, y)| self.filled(x, y));
                n_edges += usize::from(a != b) + usize::from(a != d);
                let n = [a, b, c, d].into_iter().filter(|&f| f).count();
                n_turns += match n {
                    1 | 3 => 1,
                    2 if a == c => 2,
                    _ => 0,
                };
            }
        }
        (n_edges, n_turns)
    }
}

/// So many random cases, always the same ones.
fn cases() -> ProptestConfig {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u32>().ok());
    ProptestConfig {
        cases: number("MERGE_CASES").unwrap_or(300),
        rng_seed: RngSeed::Fixed(u64::from(number("MERGE_SEED").unwrap_or(1))),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn lattice_regions_come_back_with_their_corners(pattern in pattern(false)) {
        let triangles = pattern.triangles();
        prop_assume!(!triangles.is_empty());
        let expected: f64 = pattern.is_filled.iter().flatten().filter(|f| **f).count() as f64;
        let merged = merge(triangles);
        prop_assert!((total(&merged) - expected).abs() < 1e-4, "{}", total(&merged));
        prop_assert_eq!(merged.surfaces.len(), pattern.n_regions());
        prop_assert_eq!(n_corners(&merged), pattern.border().1);
        let said = check(&merged);
        prop_assert!(matches!(&said, Ok(warnings) if warnings.len() == 1), "{:?}", said);
    }

    #[test]
    fn crooked_regions_come_back_with_their_edges(pattern in pattern(true)) {
        let triangles = pattern.triangles();
        prop_assume!(!triangles.is_empty());
        let expected: f64 = triangles.iter().map(|t| newell_normal(t).length() / 2.0).sum();
        let merged = merge(triangles);
        prop_assert!((total(&merged) - expected).abs() < 1e-4, "{} {expected}", total(&merged));
        prop_assert_eq!(merged.surfaces.len(), pattern.n_regions());
        // A jitter may put three vertices on a line by chance: not in 300 cases.
        prop_assert_eq!(n_corners(&merged), pattern.border().0);
        let said = check(&merged);
        prop_assert!(matches!(&said, Ok(warnings) if warnings.len() == 1), "{:?}", said);
    }

    #[test]
    fn triangles_at_random_keep_their_area_and_are_accepted(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0i32..3)), 1..30)
    ) {
        let triangles: Vec<[DVec3; 3]> = corners
            .iter()
            .map(|t| t.map(|[x, y, z]| dvec3(f64::from(x), f64::from(y), f64::from(z))))
            .collect();
        // Each once, whichever corner comes first.
        let mut seen: Vec<[[i32; 3]; 3]> = Vec::new();
        let mut expected = 0.0;
        for (&[a, b, c], positions) in corners.iter().zip(&triangles) {
            if ![[a, b, c], [b, c, a], [c, a, b]].iter().any(|t| seen.contains(t)) {
                seen.push([a, b, c]);
                expected += newell_normal(positions).length() / 2.0;
            }
        }
        let merged = merge(triangles);
        prop_assert!((total(&merged) - expected).abs() < 1e-9, "{} {expected}", total(&merged));
        if expected > 0.0 {
            let said = check(&merged);
            prop_assert!(said.is_ok(), "{said:?}");
        }
    }
}

fn flat(corners: &[[f64; 2]]) -> Vec<DVec3> {
    corners.iter().map(|&[x, y]| dvec3(x, y, 0.0)).collect()
}

fn fan(corners: &[[f64; 2]]) -> Vec<[DVec3; 3]> {
    let p = flat(corners);
    (2..p.len()).map(|i| [p[0], p[i - 1], p[i]]).collect()
}

#[test]
fn square_is_one_polygon_from_its_first_corner() {
    let merged = merge(fan(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]));
    assert_eq!(merged.surfaces[0].name, "surface.1");
    assert_eq!(
        merged.surfaces[0].vertices,
        flat(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]])
    );
    assert_eq!(merged.notes, ["2 triangles merged into 1 polygon"]);
}

#[test]
fn fold_and_back_stay_apart() {
    // A wall, a floor, and the floor's back under it.
    let mut triangles = fan(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
    let back: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let wall = fan(&[[0., 0.], [0., 1.], [1., 1.], [1., 0.]])
        .into_iter()
        .map(|t| t.map(|p| dvec3(p.x, 0.0, p.y)));
    triangles.extend(back);
    triangles.extend(wall);
    let merged = merge(triangles);
    assert_eq!(merged.surfaces.len(), 3);
    assert!(merged.surfaces.iter().all(|s| s.vertices.len() == 4));
}

#[test]
fn fin_on_a_floor_does_not_divide_it() {
    let mut triangles = fan(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
    let [a, c] = [dvec3(0., 0., 0.), dvec3(1., 1., 0.)];
    triangles.push([a, c, dvec3(0., 0., 1.)]);
    let merged = merge(triangles);
    let n: Vec<usize> = merged.surfaces.iter().map(|s| s.vertices.len()).collect();
    assert_eq!(n, [4, 3]);
}

#[test]
fn repeated_and_flat_triangles_are_counted() {
    let mut triangles = fan(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
    let [a, b, c] = triangles[0];
    triangles.push([b, c, a]);
    triangles.push([a, a, c]);
    // As thin as rounding: its neighbours meet across it.
    triangles.push([a, c, dvec3(0.5, 0.5 + 1e-7, 0.0)]);
    let merged = merge(triangles);
    assert_eq!(merged.surfaces.len(), 1);
    assert_eq!(
        merged.notes,
        [
            "2 triangles merged into 1 polygon",
            "2 triangles without area dropped",
            "1 triangle dropped that is there twice"
        ]
    );
}

#[test]
fn spiral_that_lies_over_itself_stays_triangles() {
    // Nine quarters of a ring in one plane.
    let corner = |i: usize, r: f64| {
        let [x, y] = [[1., 0.], [0., 1.], [-1., 0.], [0., -1.]][i % 4];
        // Turns apart so that they do not weld.
        let r = r + 0.01 * i as f64;
        dvec3(x * r, y * r, 0.0)
    };
    let triangles: Vec<[DVec3; 3]> = (0..9)
        .flat_map(|i| {
            let [a, b] = [i, i + 1].map(|i| corner(i, 1.0));
            let [d, c] = [i, i + 1].map(|i| corner(i, 2.0));
            [[a, d, c], [c, b, a]]
        })
        .collect();
    let expected: f64 = triangles
        .iter()
        .map(|t| newell_normal(t).length() / 2.0)
        .sum();
    let merged = merge(triangles);
    assert_eq!(merged.surfaces.len(), 18);
    assert!((total(&merged) - expected).abs() < 1e-12);
    assert!(
        merged.notes[0].starts_with("1 flat patch with an outline"),
        "{:?}",
        merged.notes
    );
}

#[test]
fn finely_cut_disc_stays_round() {
    // Each corner is within the tolerance of the line through its neighbours.
    let n = 20_000;
    let corners: Vec<[f64; 2]> = (0..n)
        .map(|i| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            [angle.cos(), angle.sin()]
        })
        .collect();
    let merged = merge(fan(&corners));
    let kept = merged.surfaces[0].vertices.len();
    // Chords that bulge by 2⁻²¹: sagitta θ²/8, so θ = 2 ms.
    assert!((2500..4500).contains(&kept), "{kept}");
    assert!((total(&merged) - std::f64::consts::PI).abs() < 1e-5);
}

#[test]
fn coplanar_parts_lie_in_one_plane_afterwards() {
    // Two halves of a tilted wall as two parts, each rounded by itself.
    let rotation = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, -0.2);
    let rounded =
        |t: [DVec3; 3]| t.map(|p| (rotation * p + DVec3::splat(3.1)).as_vec3().as_dvec3());
    let halves = [
        fan(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]),
        fan(&[[1., 0.], [2.3, 0.], [2.1, 1.], [1., 1.]]),
    ];
    let parts: Vec<Part> = halves
        .into_iter()
        .map(|half| part(half.into_iter().map(rounded).collect()))
        .collect();
    let merged = surfaces(&parts, "m");
    assert_eq!(merged.surfaces.len(), 2);
    let all: Vec<DVec3> = merged
        .surfaces
        .iter()
        .flat_map(|s| s.vertices.clone())
        .collect();
    let normal = newell_normal(&merged.surfaces[1].vertices).normalize_or_zero();
    let height = |p: &DVec3| (*p - all[0]).dot(normal).abs();
    assert!(all.iter().map(height).fold(0.0, f64::max) < 1e-14);
    assert_eq!(
        check(&merged),
        Ok(vec![
            "no surface emits: the irradiance is zero everywhere".to_owned()
        ])
    );
}

#[test]
fn rounded_box_keeps_shared_corners_and_plane_faces() {
    let rotation = DQuat::from_euler(glam::EulerRot::XYZ, 1.1, 0.4, 2.2);
    let corner = |i: usize| {
        let p = dvec3(
            (i & 1) as f64,
            (i >> 1 & 1) as f64 * 2.0,
            (i >> 2) as f64 * 3.0,
        );
        (rotation * p + dvec3(10.0, -7.0, 5.0)).as_vec3().as_dvec3()
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [c, d, a]])
        .map(|t| t.map(corner))
        .collect();
    let merged = merge(triangles);
    assert_eq!(merged.surfaces.len(), 6);
    assert!(merged.notes[1].contains("vertices moved onto the planes"));
    let input = check(&merged).unwrap();
    assert_eq!(input.len(), 1, "{input:?}");
    let mut corners: Vec<[u64; 3]> = merged
        .surfaces
        .iter()
        .flat_map(|s| s.vertices.iter().map(|p| p.to_array().map(f64::to_bits)))
        .collect();
    corners.sort_unstable();
    corners.dedup();
    assert_eq!(corners.len(), 8);
}

#[test]
fn tessellated_torus_is_plane_whatever_is_merged() {
    // Four quadrilaterals meet in each corner, plane but for rounding.
    let (n, m) = (48, 20);
    let corner = |i: usize, j: usize| {
        let turn = |k: usize, n: usize| std::f64::consts::TAU * (k % n) as f64 / n as f64;
        let (a, b) = (turn(i, n), turn(j, m));
        let p = dvec3(
            (3.0 + b.cos()) * a.cos(),
            (3.0 + b.cos()) * a.sin(),
            b.sin(),
        );
        p.as_vec3().as_dvec3()
    };
    let triangles: Vec<[DVec3; 3]> = (0..n)
        .flat_map(|i| (0..m).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] =
                [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| corner(i, j));
            [[a, b, c], [c, d, a]]
        })
        .collect();
    let expected: f64 = triangles
        .iter()
        .map(|t| newell_normal(t).length() / 2.0)
        .sum();
    let merged = merge(triangles);
    assert!(
        (total(&merged) - expected).abs() < 1e-5,
        "{}",
        total(&merged)
    );
    assert!(
        merged.notes[1].contains("kept as triangles, for more planes meet"),
        "{:?}",
        merged.notes
    );
    let said = check(&merged).unwrap();
    assert_eq!(said.len(), 1, "{said:?}");
}
