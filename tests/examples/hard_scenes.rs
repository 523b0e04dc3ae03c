//! Writes the scenes of `fixtures/hard`, always the same bytes.
//!
//! ```sh
//! cargo run -p antumbra-tests --example hard_scenes
//! ```

use antumbra::SceneInput;
use antumbra::io::scene_file;
use antumbra::scene::SurfaceInput;
use antumbra_tests::cases::fixtures;
use antumbra_tests::random::SplitMix;
use antumbra_tests::scenes::{Facing, add, add_box, add_horizontal, add_room, empty, material};
use glam::{DVec3, dvec3};

fn main() {
    let folder = fixtures().join("hard");
    std::fs::create_dir_all(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for (name, scene) in scenes() {
        let path = folder.join(format!("{name}.json"));
        std::fs::write(&path, scene_file::write(&scene))
            .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}

fn scenes() -> Vec<(&'static str, SceneInput)> {
    vec![
        ("aligned-grid", aligned_grid()),
        ("venetian-blind", venetian_blind()),
        ("stacked-boxes", stacked_boxes()),
        ("edge-under-lamp-edge", edge_under_lamp_edge()),
        ("vertex-under-vertex", vertex_under_vertex()),
        ("lamp-pierces-floor", lamp_pierces_floor()),
        ("plate-pierces-lamp", plate_pierces_lamp()),
        ("post-under-lamp", post_under_lamp()),
        ("almost-parallel", almost_parallel()),
        ("tiny-tilt-on-floor", tiny_tilt_on_floor()),
        ("needle", needle()),
        ("sliver-lamp", sliver_lamp()),
        ("sliver-floor", sliver_floor()),
        ("far-away", far_away()),
        ("minute-lamp", minute_lamp()),
        ("coplanar-overlap", coplanar_overlap()),
        ("duplicates", duplicates()),
        ("zero-area", zero_area()),
        ("t-junctions", t_junctions()),
        ("keyholed", keyholed()),
        ("hole-touches-outline", hole_touches_outline()),
        ("dirty-coordinates", dirty_coordinates()),
        ("measured-room", measured_room()),
        ("overhang", overhang()),
        ("cove", cove()),
        ("closed-corner", closed_corner()),
        ("thin-leg", thin_leg()),
        ("lamp-across-horizon", lamp_across_horizon()),
        ("lamp-at-wall", lamp_at_wall()),
        ("book", book()),
        ("small-gap", small_gap()),
        ("many-lamps", many_lamps()),
        ("comb", comb()),
        ("spiral", spiral()),
    ]
}

/// The floor and a lamp of 1 m × 1 m three metres above it.
fn lit() -> SceneInput {
    let mut scene = floor();
    add_lamp(&mut scene, "lamp", [0.0, 0.0, 3.0], [1.0, 1.0]);
    scene
}

fn floor() -> SceneInput {
    let mut scene = empty();
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    scene
}

fn add_lamp(scene: &mut SceneInput, name: &str, [x, y, z]: [f64; 3], [dx, dy]: [f64; 2]) {
    let sides = (
        [x - dx / 2.0, x + dx / 2.0],
        [y - dy / 2.0, y + dy / 2.0],
        z,
    );
    add_horizontal(scene, name, "lamp", sides, Facing::Down);
}

fn plate(scene: &mut SceneInput, name: &str, x: [f64; 2], y: [f64; 2], z: f64) {
    add_horizontal(scene, name, "grey", (x, y, z), Facing::Up);
}

/// 36 equal boxes in rows: hundreds of faces in a dozen planes, so that most curves
/// coincide.
fn aligned_grid() -> SceneInput {
    let mut scene = lit();
    for i in 0..6 {
        for j in 0..6 {
            let min = dvec3(f64::from(i) / 2.0 - 1.5, f64::from(j) / 2.0 - 1.5, 0.5);
            let name = format!("box-{i}-{j}");
            add_box(&mut scene, &name, "grey", min, min + DVec3::splat(0.25));
        }
    }
    scene
}

/// 24 slats over one another between the floor and the lamp, all tilted alike: their
/// edges are parallel to the lamp's, and so are all planes through them.
fn venetian_blind() -> SceneInput {
    let mut scene = floor();
    add(
        &mut scene,
        "lamp",
        "lamp",
        &[
            dvec3(-0.5, 2.0, 0.5),
            dvec3(-0.5, 2.0, 2.0),
            dvec3(0.5, 2.0, 2.0),
            dvec3(0.5, 2.0, 0.5),
        ]
        .map(|p| dvec3(-p.x, p.y, p.z)),
    );
    for k in 0..24 {
        let z = 0.25 + f64::from(k) / 12.0;
        let slat = [
            dvec3(-1.0, 1.0, z),
            dvec3(1.0, 1.0, z),
            dvec3(1.0, 1.0625, z + 0.03125),
            dvec3(-1.0, 1.0625, z + 0.03125),
        ];
        add(&mut scene, &format!("slat-{k}"), "grey", &slat);
    }
    scene
}

/// Four equal boxes, each on the one below it, the lowest on the floor.
fn stacked_boxes() -> SceneInput {
    let mut scene = lit();
    for k in 0..4 {
        let min = dvec3(-0.75, -0.25, f64::from(k) / 2.0);
        add_box(
            &mut scene,
            &format!("box-{k}"),
            "grey",
            min,
            min + DVec3::splat(0.5),
        );
    }
    scene
}

/// A plate of which one edge is exactly under the lamp's, another in its plane's
/// vertical continuation.
fn edge_under_lamp_edge() -> SceneInput {
    let mut scene = lit();
    plate(&mut scene, "plate", [-0.5, 0.25], [-0.25, 0.5], 1.0);
    scene
}

/// A triangle whose corner is exactly under the lamp's corner and exactly over that of
/// a plate which lies lower.
fn vertex_under_vertex() -> SceneInput {
    let mut scene = lit();
    let corner = |z: f64| dvec3(0.5, 0.5, z);
    add(
        &mut scene,
        "upper",
        "grey",
        &[
            corner(2.0),
            dvec3(-0.25, 0.625, 2.0),
            dvec3(0.125, -0.25, 1.75),
        ],
    );
    add(
        &mut scene,
        "lower",
        "grey",
        &[corner(1.0), dvec3(1.25, 0.5, 1.0), dvec3(0.5, 1.25, 1.125)],
    );
    scene
}

/// An upright lamp that passes through the floor: light above it only.
fn lamp_pierces_floor() -> SceneInput {
    let mut scene = floor();
    let lamp = [
        dvec3(-0.5, 0.25, -0.5),
        dvec3(0.5, -0.25, -0.5),
        dvec3(0.5, -0.25, 1.0),
        dvec3(-0.5, 0.25, 1.0),
    ];
    add(&mut scene, "lamp", "lamp", &lamp);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.25, -1.0, 0.0),
        dvec3(0.25, -0.75, 0.5),
    );
    scene
}

/// An upright plate through the middle of the lamp.
fn plate_pierces_lamp() -> SceneInput {
    let mut scene = lit();
    let plate = [
        dvec3(-0.75, 0.125, 2.5),
        dvec3(0.25, -0.125, 2.5),
        dvec3(0.25, -0.125, 3.5),
        dvec3(-0.75, 0.125, 3.5),
    ];
    add(&mut scene, "plate", "grey", &plate);
    scene
}

/// A post from the floor to the lamp: contacts at both ends.
fn post_under_lamp() -> SceneInput {
    let mut scene = lit();
    add_box(
        &mut scene,
        "post",
        "grey",
        dvec3(-0.125, -0.125, 0.0),
        dvec3(0.125, 0.125, 3.0),
    );
    scene
}

/// A plate whose plane is 1e-9 rad off the lamp's and the floor's.
fn almost_parallel() -> SceneInput {
    let mut scene = lit();
    let tilt = 1e-9;
    let at = |x: f64, y: f64| dvec3(x, y, 1.0 + tilt * x);
    let plate = [at(-0.5, -0.5), at(0.25, -0.5), at(0.25, 0.5), at(-0.5, 0.5)];
    add(&mut scene, "plate", "grey", &plate);
    scene
}

/// A plate that lies on the floor with one edge, raised by 1e-9 rad.
fn tiny_tilt_on_floor() -> SceneInput {
    let mut scene = lit();
    let at = |x: f64, y: f64| dvec3(x, y, 1e-9 * (x + 0.5));
    let plate = [at(-0.5, -0.5), at(0.5, -0.5), at(0.5, 0.5), at(-0.5, 0.5)];
    add(&mut scene, "plate", "grey", &plate);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.25, 0.75, 0.0),
        dvec3(0.25, 1.0, 0.5),
    );
    scene
}

/// An occluder a million times as long as it is wide, and one of a thousand.
fn needle() -> SceneInput {
    let mut scene = lit();
    let strip = |y: f64, width: f64| {
        [
            dvec3(-1.0, y, 1.5),
            dvec3(1.0, y + 0.25, 1.5),
            dvec3(1.0, y + 0.25 + width, 1.5),
            dvec3(-1.0, y + width, 1.5),
        ]
    };
    add(&mut scene, "needle", "grey", &strip(-0.25, 2e-6));
    add(&mut scene, "rod", "grey", &strip(0.25, 2e-3));
    scene
}

/// A lamp a million times as long as it is wide over a box.
fn sliver_lamp() -> SceneInput {
    let mut scene = floor();
    add_lamp(&mut scene, "lamp", [0.0, 0.0, 3.0], [2.0, 2e-6]);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.25, 0.25, 0.5),
        dvec3(0.5, 0.75, 1.0),
    );
    scene
}

/// A receiver a million times as long as it is wide, across the shadow of a box.
fn sliver_floor() -> SceneInput {
    let mut scene = empty();
    let strip = ([-2.0, 2.0], [0.0, 4e-6], 0.0);
    add_horizontal(&mut scene, "strip", "grey", strip, Facing::Up);
    add_lamp(&mut scene, "lamp", [0.0, 0.0, 3.0], [1.0, 1.0]);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.25, -0.375, 0.5),
        dvec3(0.5, 0.25, 1.0),
    );
    scene
}

/// A scene of centimetres a million metres from the origin: one unit in the last
/// place is 1e-8 of it.
fn far_away() -> SceneInput {
    let mut scene = empty();
    let at = dvec3(1e6, -1e6, 5e5);
    let size = 0.0078125;
    let corner = |x: f64, y: f64, z: f64| at + dvec3(x, y, z) * size;
    let flat = |x: [f64; 2], y: [f64; 2], z: f64| {
        [
            corner(x[0], y[0], z),
            corner(x[1], y[0], z),
            corner(x[1], y[1], z),
            corner(x[0], y[1], z),
        ]
    };
    add(
        &mut scene,
        "floor",
        "grey",
        &flat([-2.0, 2.0], [-2.0, 2.0], 0.0),
    );
    let mut lamp = flat([-0.5, 0.5], [-0.5, 0.5], 3.0);
    lamp.reverse();
    add(&mut scene, "lamp", "lamp", &lamp);
    let (min, max) = (corner(-0.25, 0.0, 0.0), corner(0.5, 0.5, 0.75));
    add_box(&mut scene, "box", "grey", min, max);
    scene
}

/// A lamp of a micrometre over a box: its penumbra is as narrow.
fn minute_lamp() -> SceneInput {
    let mut scene = floor();
    add_lamp(&mut scene, "lamp", [0.0, 0.0, 3.0], [1e-6, 1e-6]);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(0.25, -0.25, 0.5),
        dvec3(0.75, 0.5, 1.0),
    );
    scene
}

/// Two plates that overlap in one plane, and a rug on the floor that faces up like it.
fn coplanar_overlap() -> SceneInput {
    let mut scene = lit();
    plate(&mut scene, "plate-0", [-0.5, 0.25], [-0.5, 0.25], 1.0);
    plate(&mut scene, "plate-1", [-0.25, 0.75], [-0.125, 0.5], 1.0);
    plate(&mut scene, "rug", [-1.5, -0.25], [0.25, 1.5], 0.0);
    scene
}

/// A box of which every face is there three times, one of them turned over.
fn duplicates() -> SceneInput {
    let mut scene = lit();
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.25, 0.0, 0.5),
        dvec3(0.5, 0.5, 1.0),
    );
    let faces: Vec<SurfaceInput> = scene.surfaces[2..].to_vec();
    for face in faces {
        let mut over = face.clone();
        over.vertices.reverse();
        for (suffix, twin) in [("again", face), ("over", over)] {
            scene.surfaces.push(SurfaceInput {
                name: format!("{}-{suffix}", twin.name),
                ..twin
            });
        }
    }
    scene
}

/// Repeated and collinear corners, a triangle without area and one that is a line.
fn zero_area() -> SceneInput {
    let mut scene = lit();
    let point = dvec3(0.25, 0.25, 1.0);
    add(&mut scene, "point", "grey", &[point, point, point]);
    let along = |t: f64| dvec3(t, 2.0 * t, 1.0 + t);
    add(
        &mut scene,
        "line",
        "grey",
        &[along(0.0), along(0.25), along(0.5)],
    );
    let plate = [
        dvec3(-0.5, -0.5, 1.0),
        dvec3(0.0, -0.5, 1.0),
        dvec3(0.5, -0.5, 1.0),
        dvec3(0.5, -0.5, 1.0),
        dvec3(0.5, 0.25, 1.0),
        dvec3(-0.5, 0.25, 1.0),
        dvec3(-0.5, -0.125, 1.0),
    ];
    add(&mut scene, "plate", "grey", &plate);
    scene
}

/// A box of which two sides are cut into strips that do not match those beside them,
/// in a floor that is cut otherwise again.
fn t_junctions() -> SceneInput {
    let mut scene = empty();
    for (k, x) in [[-2.0, -0.25], [-0.25, 0.5], [0.5, 2.0]]
        .into_iter()
        .enumerate()
    {
        plate(&mut scene, &format!("floor-{k}"), x, [-2.0, 2.0], 0.0);
    }
    add_lamp(&mut scene, "lamp", [0.0, 0.0, 3.0], [1.0, 1.0]);
    let (min, max) = (dvec3(-0.5, -0.25, 0.0), dvec3(0.5, 0.5, 0.75));
    add_box(&mut scene, "box", "grey", min, max);
    for name in ["box.y0", "box.z1"] {
        let Some(k) = scene.surfaces.iter().position(|s| s.name == name) else {
            continue;
        };
        let whole = scene.surfaces.remove(k);
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| whole.vertices[i]);
        let mut from = 0.0;
        for (i, to) in [0.25, 0.625, 1.0].into_iter().enumerate() {
            let part = [
                a.lerp(b, from),
                a.lerp(b, to),
                d.lerp(c, to),
                d.lerp(c, from),
            ];
            add(&mut scene, &format!("{name}-{i}"), "grey", &part);
            from = to;
        }
    }
    scene
}

/// A plate with two holes, both bridged to one corner of its outline.
fn keyholed() -> SceneInput {
    let mut scene = lit();
    let p = |x: f64, y: f64| dvec3(x, y, 1.0);
    let corner = p(-0.75, -0.75);
    let outline = [
        corner,
        p(0.75, -0.75),
        p(0.75, 0.75),
        p(-0.75, 0.75),
        corner,
        p(-0.5, -0.25),
        p(-0.5, 0.5),
        p(-0.25, 0.5),
        p(-0.25, -0.25),
        p(-0.5, -0.25),
        corner,
        p(0.0, -0.5),
        p(0.0, 0.25),
        p(0.5, 0.25),
        p(0.5, -0.5),
        p(0.0, -0.5),
    ];
    add(&mut scene, "plate", "grey", &outline);
    scene
}

/// A plate whose hole touches its outline in one corner.
fn hole_touches_outline() -> SceneInput {
    let mut scene = lit();
    plate(&mut scene, "plate", [-0.75, 0.75], [-0.75, 0.75], 1.0);
    let p = |x: f64, y: f64| dvec3(x, y, 1.0);
    let hole = vec![p(-0.75, 0.0), p(0.25, 0.5), p(0.25, -0.25)];
    if let Some(plate) = scene.surfaces.last_mut() {
        plate.holes.push(hole);
    }
    scene
}

/// A box on the floor with coordinates of 1e-16 where there should be 0, as programs
/// that rotate by 90° write them.
fn dirty_coordinates() -> SceneInput {
    let mut scene = lit();
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.5, 0.0, 0.0),
        dvec3(0.5, 0.5, 0.75),
    );
    let mut random = SplitMix::new(16);
    for surface in &mut scene.surfaces {
        for p in &mut surface.vertices {
            let mut dirt = || random.between(-2.5e-16, 2.5e-16);
            *p += dvec3(dirt(), dirt(), dirt());
        }
    }
    scene
}

/// A room whose walls were measured: corners off by up to 1.5 mm, so that no wall is
/// plane.
fn measured_room() -> SceneInput {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "grey",
        dvec3(-2.0, -2.0, 0.0),
        dvec3(2.0, 2.0, 3.0),
    );
    add_lamp(&mut scene, "lamp", [0.25, 0.0, 2.9375], [1.0, 0.75]);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-0.75, 0.25, 0.0),
        dvec3(-0.25, 1.0, 1.25),
    );
    // One displacement for each corner of the room: its walls stay joined.
    let mut random = SplitMix::new(15);
    let mut moved: Vec<(DVec3, DVec3)> = Vec::new();
    for surface in scene
        .surfaces
        .iter_mut()
        .filter(|s| s.name.starts_with("room"))
    {
        for p in &mut surface.vertices {
            let known = moved.iter().find(|(from, _)| from == p).map(|m| m.1);
            let to = known.unwrap_or_else(|| {
                let mut off = || (random.between(-12.0, 12.0)).round() / 8192.0;
                *p + dvec3(off(), off(), off())
            });
            if known.is_none() {
                moved.push((*p, to));
            }
            *p = to;
        }
    }
    scene
}

/// A plate whose edge lies in the floor's plane, and one whose edge ends there: shadows
/// under an overhang.
fn overhang() -> SceneInput {
    let mut scene = lit();
    let lean = [
        dvec3(-0.5, 0.25, 0.0),
        dvec3(0.5, 0.25, 0.0),
        dvec3(0.5, -0.5, 0.75),
        dvec3(-0.5, -0.5, 0.75),
    ];
    add(&mut scene, "lean-to", "grey", &lean);
    add(
        &mut scene,
        "prop",
        "grey",
        &[
            dvec3(0.75, 0.25, 0.0),
            dvec3(1.25, 0.5, 1.0),
            dvec3(0.5, 0.75, 1.0),
        ],
    );
    scene
}

/// A lamp hidden in a cove along a wall: the lower wall behind its lip is dark.
fn cove() -> SceneInput {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "grey",
        dvec3(-2.0, -2.0, 0.0),
        dvec3(2.0, 2.0, 3.0),
    );
    add_box(
        &mut scene,
        "shelf",
        "grey",
        dvec3(-2.0, 1.5, 2.0),
        dvec3(2.0, 2.0, 2.125),
    );
    add_box(
        &mut scene,
        "lip",
        "grey",
        dvec3(-2.0, 1.5, 2.125),
        dvec3(2.0, 1.5625, 2.5),
    );
    let lamp = ([-1.75, 1.75], [1.625, 1.9375], 2.1875);
    add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Up);
    scene
}

/// Three plates that meet in a corner of the room, with the lamp outside of them.
fn closed_corner() -> SceneInput {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "grey",
        dvec3(0.0, 0.0, 0.0),
        dvec3(4.0, 4.0, 3.0),
    );
    add_lamp(&mut scene, "lamp", [2.5, 2.5, 2.75], [1.0, 1.0]);
    let size = dvec3(1.0, 0.75, 1.25);
    let plate = |scene: &mut SceneInput, name: &str, corners: [[f64; 3]; 4]| {
        add(
            scene,
            name,
            "grey",
            &corners.map(|c| DVec3::from_array(c) * size),
        );
    };
    plate(
        &mut scene,
        "lid",
        [
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.0, 1.0, 1.0],
        ],
    );
    plate(
        &mut scene,
        "side-x",
        [
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [1.0, 1.0, 1.0],
            [1.0, 0.0, 1.0],
        ],
    );
    plate(
        &mut scene,
        "side-y",
        [
            [0.0, 1.0, 0.0],
            [0.0, 1.0, 1.0],
            [1.0, 1.0, 1.0],
            [1.0, 1.0, 0.0],
        ],
    );
    scene
}

/// A table of which one leg is a thousandth of the floor wide.
fn thin_leg() -> SceneInput {
    let mut scene = lit();
    add_box(
        &mut scene,
        "top",
        "grey",
        dvec3(-0.5, -0.25, 0.75),
        dvec3(0.5, 0.25, 0.8125),
    );
    let thin = 1.0 / 256.0;
    add_box(
        &mut scene,
        "thin",
        "grey",
        dvec3(-0.5, -0.25, 0.0),
        dvec3(thin - 0.5, thin - 0.25, 0.75),
    );
    add_box(
        &mut scene,
        "leg",
        "grey",
        dvec3(0.4375, 0.1875, 0.0),
        dvec3(0.5, 0.25, 0.75),
    );
    scene
}

/// A tilted lamp of which a part lies below the floor's horizon, and one that touches
/// it with a corner.
fn lamp_across_horizon() -> SceneInput {
    let mut scene = floor();
    let across = [
        dvec3(2.5, -0.5, -0.5),
        dvec3(3.0, -0.5, 1.5),
        dvec3(3.0, 0.5, 1.5),
        dvec3(2.5, 0.5, -0.5),
    ];
    add(&mut scene, "across", "lamp", &across);
    let corner = [
        dvec3(0.0, 2.5, 0.0),
        dvec3(0.5, 2.5, 0.75),
        dvec3(-0.5, 2.5, 0.75),
    ];
    add(&mut scene, "corner", "lamp", &corner);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(0.25, 0.0, 0.0),
        dvec3(0.75, 0.5, 0.5),
    );
    scene
}

/// A lamp that shares an edge with the wall and the ceiling of a room: the kernel is
/// singular along it.
fn lamp_at_wall() -> SceneInput {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "grey",
        dvec3(-2.0, -2.0, 0.0),
        dvec3(2.0, 2.0, 3.0),
    );
    let lamp = ([-2.0, -1.0], [-1.0, 1.0], 3.0);
    add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Down);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(-2.0, -0.25, 1.0),
        dvec3(-1.5, 0.25, 1.5),
    );
    scene
}

/// Two leaves that share an edge, 1/512 rad apart.
fn book() -> SceneInput {
    let mut scene = lit();
    let open = 1.0 / 512.0;
    for (name, rise) in [("upper", open), ("lower", 0.0)] {
        let leaf = [
            dvec3(-0.5, -0.5, 1.0),
            dvec3(0.5, -0.5, 1.0),
            dvec3(0.5, 0.5, 1.0 + rise),
            dvec3(-0.5, 0.5, 1.0 + rise),
        ];
        add(&mut scene, name, "grey", &leaf);
    }
    scene
}

/// A plate 1/4096 m above a table: light gets under it by as much.
fn small_gap() -> SceneInput {
    let mut scene = floor();
    add_lamp(&mut scene, "lamp", [1.0, 0.0, 2.0], [0.5, 0.5]);
    let gap = 1.0 / 4096.0;
    plate(&mut scene, "plate", [-1.0, 0.0], [-0.5, 0.5], gap);
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(0.25, -0.25, gap),
        dvec3(0.5, 0.5, 0.5),
    );
    scene
}

/// 16 lamps over four boxes: every lamp brings curves of its own.
fn many_lamps() -> SceneInput {
    let mut scene = floor();
    for i in 0..4 {
        for j in 0..4 {
            let at = [f64::from(i) - 1.5, f64::from(j) - 1.5, 3.0];
            add_lamp(&mut scene, &format!("lamp-{i}-{j}"), at, [0.25, 0.25]);
        }
    }
    for (k, (x, y)) in [(-1.0, -0.75), (0.5, -1.0), (-0.75, 0.5), (0.75, 0.75)]
        .into_iter()
        .enumerate()
    {
        let min = dvec3(x, y, 0.25 * k as f64);
        add_box(
            &mut scene,
            &format!("box-{k}"),
            "grey",
            min,
            min + DVec3::splat(0.5),
        );
    }
    scene
}

/// One outline with 16 teeth: many reflex corners, all edges parallel or perpendicular.
fn comb() -> SceneInput {
    let mut scene = lit();
    let mut outline = vec![dvec3(-1.0, -0.5, 1.0), dvec3(1.0, -0.5, 1.0)];
    for k in (0..16).rev() {
        let x = f64::from(k) / 8.0 - 1.0;
        for (dx, y) in [(0.125, 0.5), (0.0625, 0.5), (0.0625, -0.25), (0.0, -0.25)] {
            outline.push(dvec3(x + dx, y, 1.0));
        }
    }
    add(&mut scene, "comb", "grey", &outline);
    scene
}

/// A wall in the shape of a square spiral on the floor, one plate thick.
fn spiral() -> SceneInput {
    let mut scene = lit();
    let mut at = dvec3(0.0, 0.0, 0.0);
    for k in 0..8 {
        let step = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y][k % 4];
        let to = at + step * (0.25 * (1 + k / 2) as f64);
        let up = DVec3::Z * 0.5;
        add(
            &mut scene,
            &format!("wall-{k}"),
            "sheet",
            &[at, to, to + up, at + up],
        );
        at = to;
    }
    let mut sheet = material("sheet", 0.5, 0.0);
    sheet.two_sided = true;
    scene.materials.push(sheet);
    scene
}
