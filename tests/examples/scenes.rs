//! Writes the scenes of `fixtures/eee`, always the same bytes.
//!
//! ```sh
//! cargo run -p antumbra-tests --example scenes
//! ```
//!
//! With a number, prints as many boxes over a floor that grows with them, one lamp over
//! its middle: for measuring growth (`docs/benchmarks.md`).
//!
//! ```sh
//! cargo run -p antumbra-tests --example scenes -- 512 > boxes-512.json
//! ```
//!
//! With two numbers, prints as many boxes that stand on a floor, and as many lamps: for
//! testing that limits of time and memory hold.
//!
//! ```sh
//! cargo run -p antumbra-tests --example scenes -- 5000 9 > hall-5000.json
//! ```

use antumbra::SceneInput;
use antumbra::io::scene_file;
use antumbra_tests::cases::fixtures;
use antumbra_tests::random::SplitMix;
use antumbra_tests::scenes::{Facing, add, add_horizontal, empty};
use glam::{DMat3, DVec3, dvec3};

#[expect(clippy::print_stdout, reason = "the scene is printed")]
fn main() {
    let numbers: Vec<u32> = std::env::args()
        .skip(1)
        .map(|n| {
            n.parse()
                .unwrap_or_else(|e| panic!("{n}: a number is needed: {e}"))
        })
        .collect();
    let scale = |n: u32| (f64::from(n) / 8.0).sqrt();
    match numbers[..] {
        [] => {}
        [n] => {
            let scene = boxes_over(n, [0.2, 0.5], scale(n));
            println!("{}", scene_file::write(&scene));
            return;
        }
        [n, lamps, ..] => {
            println!("{}", scene_file::write(&hall(n, lamps, scale(n))));
            return;
        }
    }
    let folder = fixtures().join("eee");
    std::fs::create_dir_all(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for (name, scene) in scenes() {
        let path = folder.join(format!("{name}.json"));
        std::fs::write(&path, scene_file::write(&scene))
            .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}

fn scenes() -> Vec<(&'static str, SceneInput)> {
    vec![
        ("eee-only", eee_only()),
        ("eee-non-emitter", eee_non_emitter()),
        ("ve-non-emitter", ve_non_emitter()),
        ("ee-non-emitter", ee_non_emitter()),
        ("facet-at-horizon", facet_at_horizon()),
        ("folded-sheet", folded_sheet()),
        ("ee-at-horizon", ee_at_horizon()),
        ("facet-beside-upright-lamp", facet_beside_upright_lamp()),
        ("stacked-triangles", stacked_triangles()),
        ("grating", grating()),
        ("boxes-4", boxes(4, [0.2, 0.5])),
        ("boxes-8", boxes(8, [0.2, 0.5])),
        ("boxes-16", boxes(16, [0.2, 0.5])),
        ("boxes-64", boxes(64, [0.1, 0.25])),
        ("table-and-chairs", table_and_chairs()),
    ]
}

/// A floor of four metres, and a lamp in the middle three metres above it.
fn lit_from_above(lamp: [f64; 2]) -> SceneInput {
    lit_floor(4.0, lamp)
}

/// A square floor, and a lamp in the middle three metres above it.
fn lit_floor(width: f64, lamp: [f64; 2]) -> SceneInput {
    let mut scene = empty();
    let half = width / 2.0;
    let floor = ([-half, half], [-half, half], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let [x, y] = lamp.map(|width| width / 2.0);
    let lamp = [
        dvec3(-x, y, 3.0),
        dvec3(x, y, 3.0),
        dvec3(x, -y, 3.0),
        dvec3(-x, -y, 3.0),
    ];
    add(&mut scene, "lamp", "lamp", &lamp);
    scene
}

/// A parallelogram about its middle.
fn add_strip(
    scene: &mut SceneInput,
    name: &str,
    middle: [f64; 3],
    along: [f64; 3],
    across: [f64; 3],
) {
    let [m, u, v] = [middle, along, across].map(DVec3::from_array);
    let (u, v) = (u / 2.0, v / 2.0);
    add(
        scene,
        name,
        "grey",
        &[m - u - v, m + u - v, m + u + v, m - u + v],
    );
}

/// Two strips that cross. Their ends are so far out that no line from the floor to
/// the lamp comes near.
fn eee_only() -> SceneInput {
    let mut scene = lit_from_above([1.0, 1.0]);
    add_strip(
        &mut scene,
        "lower",
        [0.0625, 0.0, 1.0],
        [6.0, 0.5, 0.375],
        [-0.03125, 0.375, 0.0625],
    );
    add_strip(
        &mut scene,
        "upper",
        [0.0, 0.03125, 1.75],
        [0.75, 6.0, -0.5],
        [0.3125, -0.0625, 0.03125],
    );
    scene
}

/// Three strips across one another, in front of a lamp that is larger than the
/// triangle their edges make.
fn eee_non_emitter() -> SceneInput {
    let mut scene = lit_from_above([2.0, 2.0]);
    add_strip(
        &mut scene,
        "lower",
        [0.0, 0.0, 0.75],
        [8.0, 1.5, 0.25],
        [-0.0625, 0.25, 0.03125],
    );
    add_strip(
        &mut scene,
        "middle",
        [0.125, 0.0, 1.25],
        [3.0, 8.0, -0.375],
        [0.25, -0.09375, 0.0625],
    );
    add_strip(
        &mut scene,
        "upper",
        [-0.125, 0.0625, 1.875],
        [-6.0, 6.5, 0.5],
        [0.21875, 0.1875, -0.03125],
    );
    scene
}

/// The tip of a wedge below the edge of a plate; the other corners of both are far
/// out.
fn ve_non_emitter() -> SceneInput {
    let mut scene = lit_from_above([2.0, 2.0]);
    let wedge = [
        dvec3(0.125, 0.0625, 1.0),
        dvec3(-4.0, 2.25, 1.125),
        dvec3(-4.0, -2.5, 1.25),
    ];
    add(&mut scene, "wedge", "grey", &wedge);
    add_strip(
        &mut scene,
        "plate",
        [3.125, 0.0, 1.875],
        [1.0, 8.0, 0.25],
        [6.0, -0.5, 0.125],
    );
    scene
}

/// Two plates with a slit between them that is bounded by parallel edges: from the
/// points of one line of the floor it is closed.
fn ee_non_emitter() -> SceneInput {
    let mut scene = lit_from_above([2.0, 2.0]);
    add_strip(
        &mut scene,
        "lower",
        [-2.9375, 0.0, 1.0],
        [0.5, 8.0, 0.125],
        [6.0, -0.25, 0.0625],
    );
    add_strip(
        &mut scene,
        "upper",
        [3.0625, 0.0625, 1.875],
        [0.5, 8.0, 0.125],
        [6.0, 0.375, 0.125],
    );
    scene
}

/// Two leaves of a sheet: the edges at either end of the fold lie in one plane, but
/// in no face of it.
fn folded_sheet() -> SceneInput {
    let mut scene = lit_from_above([1.0, 1.0]);
    let (fold, rise, drop) = (
        [dvec3(-0.375, 0.0625, 1.25), dvec3(0.375, 0.0, 1.25)],
        dvec3(0.03125, 0.375, 0.375),
        dvec3(0.0625, 0.125, -0.5),
    );
    let [a, b] = fold;
    add(&mut scene, "upper", "grey", &[a, b, b + rise, a + rise]);
    add(&mut scene, "lower", "grey", &[b, a, a + drop, b + drop]);
    scene
}

/// A floor, a lamp above it, and a wall behind whose horizon half of the lamp is.
fn wall_under_lamp() -> SceneInput {
    let mut scene = lit_from_above([1.0, 1.0]);
    let wall = [
        dvec3(0.0625, -2.0, 0.0),
        dvec3(0.0625, 2.0, 0.0),
        dvec3(0.0625, 2.0, 2.0),
        dvec3(0.0625, -2.0, 2.0),
    ];
    add(&mut scene, "wall", "grey", &wall);
    scene
}

/// The plane of a panel cuts the lamp on both sides of the wall's horizon.
fn facet_at_horizon() -> SceneInput {
    let mut scene = wall_under_lamp();
    let panel = [
        dvec3(0.09375, 0.0, 1.75),
        dvec3(0.1875, 0.03125, 1.6875),
        dvec3(0.15625, 0.0625, 2.0),
    ];
    add(&mut scene, "panel", "grey", &panel);
    scene
}

/// A panel's edge is parallel to an edge of the lamp that goes through the wall's
/// horizon.
fn ee_at_horizon() -> SceneInput {
    let mut scene = wall_under_lamp();
    let panel = [
        dvec3(0.09375, -0.25, 2.0),
        dvec3(0.1875, -0.25, 2.0),
        dvec3(0.125, 0.125, 1.9375),
    ];
    add(&mut scene, "panel", "grey", &panel);
    scene
}

/// An upright lamp, and beside it a panel whose plane cuts it: higher than the
/// lower end of the cut.
fn facet_beside_upright_lamp() -> SceneInput {
    let mut scene = empty();
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let lamp = [
        dvec3(1.0, -0.5, 0.5),
        dvec3(1.0, -0.5, 2.0),
        dvec3(1.0, 0.5, 2.0),
        dvec3(1.0, 0.5, 0.5),
    ];
    add(&mut scene, "lamp", "lamp", &lamp);
    let panel = [
        dvec3(0.25, -0.0625, 0.75),
        dvec3(0.6875, 0.0625, 0.8125),
        dvec3(0.5, 0.0, 1.25),
    ];
    add(&mut scene, "panel", "grey", &panel);
    scene
}

fn stacked_triangles() -> SceneInput {
    let mut scene = lit_from_above([1.0, 1.0]);
    let triangles = [
        [
            [-0.5, -0.3125, 0.6875],
            [0.5, -0.25, 0.75],
            [-0.0625, 0.5625, 0.8125],
        ],
        [
            [-0.1875, -0.5, 1.0625],
            [0.625, 0.0625, 1.125],
            [-0.375, 0.4375, 1.1875],
        ],
        [
            [0.1875, -0.5625, 1.5],
            [0.4375, 0.4375, 1.4375],
            [-0.5625, 0.125, 1.5625],
        ],
        [
            [0.4375, -0.375, 1.9375],
            [0.125, 0.5, 1.875],
            [-0.5, -0.1875, 2.0],
        ],
    ];
    for (k, corners) in triangles.into_iter().enumerate() {
        let corners = corners.map(DVec3::from_array);
        add(&mut scene, &format!("triangle-{k}"), "grey", &corners);
    }
    scene
}

/// Bars a sixteenth wide with gaps of an eighth: a quarter of the lamp's shadow.
fn grating() -> SceneInput {
    let mut scene = lit_from_above([1.0, 1.0]);
    let turn = about_z(1.0 / 16.0);
    for k in 0..8 {
        let middle = dvec3((f64::from(k) - 3.5) * 0.1875, 0.0, 1.015625);
        let bar = Brick {
            middle: turn * middle,
            half: dvec3(0.03125, 1.0, 0.015625),
            rotation: turn,
        };
        bar.add(&mut scene, &format!("bar-{k}"));
    }
    scene
}

/// Random boxes that float between floor and lamp; the seed is their number.
fn boxes(n: u32, sizes: [f64; 2]) -> SceneInput {
    boxes_over(n, sizes, 1.0)
}

/// The same over a floor that is larger by `scale`; heights and lamp stay.
fn boxes_over(n: u32, [shortest, longest]: [f64; 2], scale: f64) -> SceneInput {
    let mut scene = lit_floor(4.0 * scale, [1.0, 1.0]);
    let mut random = SplitMix::new(u64::from(n));
    let mut placed: Vec<Brick> = Vec::new();
    while placed.len() < n as usize {
        let brick = Brick {
            middle: random.in_box(dvec3(-scale, -scale, 0.5), dvec3(scale, scale, 2.4)),
            half: random.in_box(DVec3::splat(shortest), DVec3::splat(longest)) / 2.0,
            rotation: random.rotation(),
        };
        // Their circumscribed spheres do not meet.
        let is_free = |other: &Brick| {
            let gap = brick.middle.distance(other.middle);
            gap > brick.half.length() + other.half.length()
        };
        if placed.iter().all(is_free) {
            placed.push(brick);
        }
    }
    for (k, brick) in placed.iter().enumerate() {
        brick.add(&mut scene, &format!("box-{k}"));
    }
    scene
}

/// Random boxes that stand on a floor of `4 scale` metres, turned about the vertical,
/// under lamps in a square grid; the seed is the number of boxes.
fn hall(n: u32, lamps: u32, scale: f64) -> SceneInput {
    let mut scene = empty();
    let half = 2.0 * scale;
    let floor = ([-half, half], [-half, half], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    let side = f64::from(lamps).sqrt().ceil().max(1.0) as u32;
    for k in 0..lamps {
        let place = |i: u32| 2.0 * half * ((f64::from(i) + 0.5) / f64::from(side) - 0.5);
        let (x, y) = (place(k % side), place(k / side));
        let corners = ([x - 0.5, x + 0.5], [y - 0.5, y + 0.5], 3.0);
        add_horizontal(
            &mut scene,
            &format!("lamp-{k}"),
            "lamp",
            corners,
            Facing::Down,
        );
    }
    let mut random = SplitMix::new(u64::from(n));
    let mut placed: Vec<Brick> = Vec::new();
    while placed.len() < n as usize {
        let reach = half - 0.5;
        let size = random.in_box(DVec3::splat(0.2), dvec3(0.5, 0.5, 1.2)) / 2.0;
        let at = random.in_box(dvec3(-reach, -reach, 0.0), dvec3(reach, reach, 1.0));
        let brick = Brick {
            middle: dvec3(at.x, at.y, size.z),
            half: size,
            rotation: about_z(2.0 * at.z - 1.0),
        };
        let flat = |b: &Brick| (b.middle.truncate(), b.half.truncate().length());
        let is_free = |other: &Brick| {
            let ((a, r), (b, s)) = (flat(&brick), flat(other));
            a.distance(b) > r + s
        };
        if placed.iter().all(is_free) {
            placed.push(brick);
        }
    }
    for (k, brick) in placed.iter().enumerate() {
        brick.add(&mut scene, &format!("box-{k}"));
    }
    scene
}

fn table_and_chairs() -> SceneInput {
    let mut scene = lit_from_above([1.5, 0.5]);
    let table = Place {
        origin: dvec3(0.0, 0.0, 0.0),
        rotation: about_z(1.0 / 32.0),
    };
    table.add(
        &mut scene,
        "table-plate",
        [-0.75, -0.4375, 0.6875],
        [0.75, 0.4375, 0.71875],
    );
    table.add_legs(&mut scene, "table-leg", [0.6875, 0.375], 0.046875, 0.6875);

    // Half-angle tangents: turned to the table and a bit aside.
    let chairs = [
        (dvec3(-0.34375, -0.6875, 0.0), 1.0 / 16.0),
        (dvec3(0.375, -0.71875, 0.0), -3.0 / 64.0),
        (dvec3(-0.40625, 0.75, 0.0), 24.0),
        (dvec3(0.3125, 0.6875, 0.0), -16.0),
    ];
    for (k, (origin, t)) in chairs.into_iter().enumerate() {
        let chair = Place {
            origin,
            rotation: about_z(t),
        };
        let name = |part: &str| format!("chair-{k}-{part}");
        chair.add(
            &mut scene,
            &name("seat"),
            [-0.203125, -0.203125, 0.4375],
            [0.203125, 0.203125, 0.46875],
        );
        // The back stands on the seat, a finger from its border.
        chair.add(
            &mut scene,
            &name("back"),
            [-0.1875, -0.1875, 0.46875],
            [0.1875, -0.15625, 0.90625],
        );
        chair.add_legs(
            &mut scene,
            &name("leg"),
            [0.171875, 0.171875],
            0.03125,
            0.4375,
        );
    }
    scene
}

/// A piece of furniture's own coordinates.
#[derive(Clone, Copy, Debug)]
struct Place {
    origin: DVec3,
    rotation: DMat3,
}

impl Place {
    fn add(&self, scene: &mut SceneInput, name: &str, min: [f64; 3], max: [f64; 3]) {
        let [min, max] = [min, max].map(DVec3::from_array);
        let brick = Brick {
            middle: self.origin + self.rotation * ((min + max) / 2.0),
            half: (max - min) / 2.0,
            rotation: self.rotation,
        };
        brick.add(scene, name);
    }

    /// Four square legs about (±x, ±y), from the floor up.
    fn add_legs(
        &self,
        scene: &mut SceneInput,
        name: &str,
        [x, y]: [f64; 2],
        width: f64,
        height: f64,
    ) {
        for (k, (x, y)) in [(-x, -y), (x, -y), (x, y), (-x, y)].into_iter().enumerate() {
            let half = width / 2.0;
            self.add(
                scene,
                &format!("{name}-{k}"),
                [x - half, y - half, 0.0],
                [x + half, y + half, height],
            );
        }
    }
}

/// A box about its middle.
#[derive(Clone, Copy, Debug)]
struct Brick {
    middle: DVec3,
    half: DVec3,
    rotation: DMat3,
}

impl Brick {
    /// Adds its six faces, fronts outwards.
    fn add(&self, scene: &mut SceneInput, name: &str) {
        let p = |x: f64, y: f64, z: f64| self.middle + self.rotation * (dvec3(x, y, z) * self.half);
        let (o, i) = (-1.0, 1.0);
        let faces = [
            ("bottom", [p(o, o, o), p(o, i, o), p(i, i, o), p(i, o, o)]),
            ("top", [p(o, o, i), p(i, o, i), p(i, i, i), p(o, i, i)]),
            ("front", [p(o, o, o), p(i, o, o), p(i, o, i), p(o, o, i)]),
            ("back", [p(o, i, o), p(o, i, i), p(i, i, i), p(i, i, o)]),
            ("left", [p(o, o, o), p(o, o, i), p(o, i, i), p(o, i, o)]),
            ("right", [p(i, o, o), p(i, i, o), p(i, i, i), p(i, o, i)]),
        ];
        for (side, corners) in faces {
            add(scene, &format!("{name}-{side}"), "grey", &corners);
        }
    }
}

/// A turn about the z axis by twice the angle with the tangent `t`.
fn about_z(t: f64) -> DMat3 {
    let (cos, sin) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
    DMat3::from_cols(dvec3(cos, sin, 0.0), dvec3(-sin, cos, 0.0), DVec3::Z)
}
