//! Where no light can get, there is none.
//!
//! At points of an axis-parallel scene that is exactly 0. A turned scene has
//! corners that are rounded: a shell that touches another surface is then open by
//! 1e-16 of its size, and so is a node on a contact, which stands on a pixel.

use antumbra::scene::FaceId;
use antumbra::visibility::{Approach, MapScratch, Place as MapPlace};
use antumbra::{Control, Ended, Evaluator, ExactLight, Options, SceneInput, Scratch, Tolerance};
use antumbra_tests::cases::{build, fixture};
use antumbra_tests::motion::Motion;
use antumbra_tests::random::SplitMix;
use antumbra_tests::scenes::{
    Facing, add, add_box, add_horizontal, add_room, empty, exact, front_faces, place, points_on,
};
use glam::{DVec3, dvec3};

/// The scene as it stands, and turned so that no coordinate survives.
fn poses() -> [Motion; 2] {
    [Motion::IDENTITY, Motion::skew()]
}

/// What rounding lets through, of an exitance of 1: a slit of 1e-16, some hundred times.
const ROUNDING: f64 = 1e-13;

/// A parallelogram of a surface that must be dark.
struct Dark {
    surface: String,
    origin: DVec3,
    u: DVec3,
    v: DVec3,
}

fn dark(surface: &str, origin: DVec3, u: DVec3, v: DVec3) -> Dark {
    Dark {
        surface: surface.to_owned(),
        origin,
        u,
        v,
    }
}

/// Exact values at `n` points of every region are 0.
fn is_dark_at_points(scene: &SceneInput, regions: &[Dark], n: usize) {
    for (motion, allowed) in poses().into_iter().zip([0.0, ROUNDING]) {
        let scene = motion.scene(scene);
        for region in regions {
            let points: Vec<DVec3> = points_on(region.origin, region.u, region.v, n)
                .into_iter()
                .map(|p| motion.point(p))
                .collect();
            for (p, e) in points.iter().zip(exact(&scene, &region.surface, &points)) {
                assert!(e <= allowed, "{e:e} leaks onto {} at {p}", region.surface);
            }
        }
    }
}

/// So that a mesh that never ends fails, and does not fill the memory.
fn limited() -> Options {
    let tolerance = Tolerance::Relative(1e-2);
    Options {
        tolerance,
        most_elements: 50_000,
        ..Options::default()
    }
}

/// Every node of a surface's mesh is 0.
fn is_dark_in_mesh(scene: &SceneInput, surfaces: &[&str]) {
    for (motion, allowed) in poses().into_iter().zip([0.0, ROUNDING]) {
        let scene = build(&motion.scene(scene));
        let meshed =
            antumbra::mesh(&scene, &limited(), &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
        for name in surfaces {
            let meshes = front_faces(&scene, name);
            let meshes = meshes.iter().map(|f| &meshed.mesh.receivers[f.index()]);
            let nodes = meshes.flat_map(|mesh| {
                let places = mesh.nodes.iter().map(|&uv| mesh.chart.to_space(uv));
                places.zip(&mesh.direct)
            });
            for (p, &e) in nodes {
                let p = motion.inverse().point(scene.frame.to_file(p));
                assert!(e <= allowed, "{e:e} leaks onto {name} at the node {p}");
            }
        }
    }
}

/// Every element of a surface's mesh whose middle lies in the region is 0 at all
/// of its nodes, also at those that it shares with its lit neighbours.
fn is_dark_in_elements(scene: &SceneInput, region: &Dark, allowed: f64) {
    for motion in poses() {
        let scene = build(&motion.scene(scene));
        let meshed =
            antumbra::mesh(&scene, &limited(), &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(meshed.mesh.ended, Ended::ToleranceReached);
        let middle = region.origin + 0.5 * (region.u + region.v);
        let face = place(&scene, &region.surface, motion.point(middle)).face;
        let mesh = &meshed.mesh.receivers[face.index()];
        let (u_sq, v_sq) = (region.u.length_squared(), region.v.length_squared());
        let back = motion.inverse();
        let mut n_inside = 0;
        for t in 0..mesh.n_elements() {
            let nodes = mesh.nodes_of(t);
            let corner = |k: usize| mesh.chart.to_space(mesh.nodes[nodes[k] as usize]);
            let middle = (corner(0) + corner(1) + corner(2)) / 3.0;
            let p = back.point(scene.frame.to_file(middle)) - region.origin;
            let (s, t) = (p.dot(region.u) / u_sq, p.dot(region.v) / v_sq);
            if !(s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0) {
                continue;
            }
            n_inside += 1;
            for &node in nodes {
                let e = mesh.direct[node as usize];
                let p = scene
                    .frame
                    .to_file(mesh.chart.to_space(mesh.nodes[node as usize]));
                let p = back.point(p);
                assert!(
                    e <= allowed,
                    "{e:e} leaks onto {} at the node {p}",
                    region.surface
                );
            }
        }
        assert!(
            n_inside > 0,
            "no element of {} lies in the dark region",
            region.surface
        );
    }
}

fn sides(name: &str, min: DVec3, max: DVec3) -> Vec<Dark> {
    let (x, y, z) = (
        DVec3::X * (max.x - min.x),
        DVec3::Y * (max.y - min.y),
        DVec3::Z * (max.z - min.z),
    );
    vec![
        dark(&format!("{name}.x0"), min, y, z),
        dark(&format!("{name}.x1"), min + x, y, z),
        dark(&format!("{name}.y0"), min, x, z),
        dark(&format!("{name}.y1"), min + y, x, z),
        dark(&format!("{name}.z0"), min, x, y),
        dark(&format!("{name}.z1"), min + z, x, y),
    ]
}

#[test]
fn closed_box_lit_from_outside_is_dark_inside() {
    let scene = fixture("contact/closed-box-lit-from-outside");
    let inside = sides("in", dvec3(-0.5, -0.5, 0.5), dvec3(0.5, 0.5, 1.5));
    is_dark_at_points(&scene, &inside, 1000);
    let names: Vec<&str> = inside.iter().map(|d| d.surface.as_str()).collect();
    is_dark_in_mesh(&scene, &names);
}

#[test]
fn room_with_a_single_sheet_of_walls_is_dark_inside() {
    // One-sided faces that look inwards, lit from behind: nothing else hides the
    // lamp.
    let mut scene = empty();
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([-2.0, 2.0], [-2.0, 2.0], 3.0),
        Facing::Down,
    );
    let (min, max) = (dvec3(-0.375, -0.625, 0.25), dvec3(0.5, 0.25, 1.375));
    add_room(&mut scene, "in", "grey", min, max);
    let inside = sides("in", min, max);
    is_dark_at_points(&scene, &inside, 500);
    let names: Vec<&str> = inside.iter().map(|d| d.surface.as_str()).collect();
    is_dark_in_mesh(&scene, &names);
}

#[test]
fn floor_under_a_box_that_stands_on_it_is_dark() {
    for name in [
        "contact/box-on-floor",
        "contact/box-without-bottom-on-floor",
    ] {
        let under = dark("floor", dvec3(-0.5, -0.25, 0.0), DVec3::X, DVec3::Y * 0.625);
        let scene = fixture(name);
        is_dark_at_points(&scene, std::slice::from_ref(&under), 1000);
        is_dark_in_elements(&scene, &under, ROUNDING);
    }
}

#[test]
fn floor_inside_a_box_that_goes_through_it_is_dark() {
    let scene = fixture("penetration/box-through-floor");
    let inside = dark(
        "floor",
        dvec3(-0.375, -0.25, 0.0),
        DVec3::X * 0.875,
        DVec3::Y * 0.5625,
    );
    is_dark_at_points(&scene, std::slice::from_ref(&inside), 1000);
    is_dark_in_elements(&scene, &inside, ROUNDING);
}

#[test]
fn wall_behind_a_panel_is_dark() {
    let scene = fixture("contact/panel-on-wall");
    let behind = dark("wall", dvec3(-0.75, 2.0, 1.0), DVec3::X * 1.25, DVec3::Z);
    is_dark_at_points(&scene, std::slice::from_ref(&behind), 1000);
    is_dark_in_elements(&scene, &behind, ROUNDING);
}

#[test]
fn floor_beyond_a_thick_wall_is_dark_and_so_is_the_floor_under_it() {
    let scene = fixture("contact/thick-wall");
    let beyond = dark(
        "floor",
        dvec3(-0.125, -1.0, 0.0),
        DVec3::X * 2.125,
        DVec3::Y * 2.0,
    );
    is_dark_at_points(&scene, std::slice::from_ref(&beyond), 1000);
    is_dark_in_elements(&scene, &beyond, ROUNDING);
    is_dark_in_mesh(&scene, &["wall.x1"]);
}

#[test]
fn second_of_two_rooms_with_one_floor_is_dark() {
    let scene = fixture("contact/two-rooms-one-floor");
    let room = [
        dark(
            "floor",
            dvec3(0.0, -1.0, 0.0),
            DVec3::X * 2.0,
            DVec3::Y * 2.0,
        ),
        dark(
            "ceiling",
            dvec3(0.0, -1.0, 2.0),
            DVec3::X * 2.0,
            DVec3::Y * 2.0,
        ),
        dark("y0", dvec3(0.0, -1.0, 0.0), DVec3::X * 2.0, DVec3::Z * 2.0),
        dark("y1", dvec3(0.0, 1.0, 0.0), DVec3::X * 2.0, DVec3::Z * 2.0),
        dark("x1", dvec3(2.0, -1.0, 0.0), DVec3::Y * 2.0, DVec3::Z * 2.0),
    ];
    is_dark_at_points(&scene, &room, 500);
    room.iter()
        .for_each(|region| is_dark_in_elements(&scene, region, ROUNDING));
    is_dark_in_mesh(&scene, &["x1"]);
}

#[test]
fn floor_under_a_table_leg_is_dark() {
    let scene = fixture("contact/table");
    let under = dark(
        "floor",
        dvec3(-0.75, -0.5, 0.0),
        DVec3::X / 32.0,
        DVec3::Y / 32.0,
    );
    is_dark_at_points(&scene, std::slice::from_ref(&under), 1000);
    is_dark_in_elements(&scene, &under, ROUNDING);
}

#[test]
fn floor_under_a_leg_of_a_thousandth_is_dark() {
    let mut scene = empty();
    add_horizontal(
        &mut scene,
        "floor",
        "grey",
        ([-2.0, 2.0], [-2.0, 2.0], 0.0),
        Facing::Up,
    );
    add_horizontal(
        &mut scene,
        "lamp",
        "lamp",
        ([-1.0, 1.0], [-1.0, 1.0], 3.0),
        Facing::Down,
    );
    let (width, height) = (1.0 / 512.0, 0.75);
    add_box(
        &mut scene,
        "leg",
        "grey",
        dvec3(0.25, 0.375, 0.0),
        dvec3(0.25 + width, 0.375 + width, height),
    );
    let under = dark(
        "floor",
        dvec3(0.25, 0.375, 0.0),
        DVec3::X * width,
        DVec3::Y * width,
    );
    is_dark_at_points(&scene, std::slice::from_ref(&under), 1000);
    is_dark_in_elements(&scene, &under, ROUNDING);
}

#[test]
fn floor_behind_a_lamp_that_stands_on_it_gets_no_light() {
    let scene = fixture("contact/lamp-standing-on-floor");
    // The lamp looks to −x from x = ¼. Its plane's trace runs from pixel to pixel
    // of 2⁻²⁷, where light is faint but not out.
    let behind = dark(
        "floor",
        dvec3(0.25, -2.0, 0.0),
        DVec3::X * 1.75,
        DVec3::Y * 4.0,
    );
    is_dark_at_points(&scene, std::slice::from_ref(&behind), 1000);
    is_dark_in_elements(&scene, &behind, 1e-8);
}

/// The wall below two windows of one height has its edges under both sills on one line:
/// through a point of it and the other edge there is no plane.
#[test]
fn nodes_below_sills_of_one_height_see_nothing_beyond_the_wall() {
    for motion in poses() {
        let scene = build(&motion.scene(&fixture("contact/two-sills")));
        let options = Options {
            tolerance: Tolerance::Relative(1e-3),
            ..limited()
        };
        let meshed =
            antumbra::mesh(&scene, &options, &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(meshed.mesh.ended, Ended::ToleranceReached);
        let sill = scene.surface_named("left sill").expect("a sill");
        let mut n_lit = 0;
        for mesh in &meshed.mesh.receivers {
            if scene.face(mesh.face).surface != sill {
                continue;
            }
            assert!(mesh.unresolved.is_empty(), "{:?}", mesh.unresolved);
            for &e in &mesh.direct {
                // Beyond the wall it would be a half, before it the cavity is narrow.
                assert!(e < 0.25, "{e} at a node");
                n_lit += usize::from(e > 0.0);
            }
        }
        assert!(n_lit > 0, "the sill is lit from below");
    }
}

/// Lamps below and above a room, larger than it, that face it.
fn add_lamps_outside(scene: &mut SceneInput) {
    let sides = ([-9.0, 9.0], [-9.0, 9.0]);
    for (name, height, facing) in [
        ("lamp below", -1.0, Facing::Up),
        ("lamp above", 4.0, Facing::Down),
    ] {
        add_horizontal(scene, name, "lamp", (sides.0, sides.1, height), facing);
    }
}

/// A closed room whose walls miss its floor and ceiling by a hundredth of a millimetre.
fn ragged_room() -> SceneInput {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "grey",
        dvec3(-1.5, -1.0, 0.0),
        dvec3(1.5, 1.0, 2.5),
    );
    // Floor and ceiling come first, so that the walls are plane when they are welded.
    scene.surfaces.rotate_right(2);
    let mut random = SplitMix::new(7);
    let gap = DVec3::splat(1e-5);
    for corner in scene.surfaces[2..].iter_mut().flat_map(|s| &mut s.vertices) {
        *corner += random.in_box(-gap, gap);
    }
    add_lamps_outside(&mut scene);
    scene
}

#[test]
fn welded_room_is_closed_and_no_corner_moves_farther_than_asked_for() {
    let ragged = ragged_room();
    let length = 5e-5;
    let mut welded = ragged.clone();
    let report = welded
        .weld(length)
        .unwrap_or_else(|p| panic!("{}", p.message));
    assert_eq!(report.n_moved, 16, "{report:?}");
    for (before, after) in ragged.surfaces.iter().zip(&welded.surfaces) {
        for (p, q) in before.vertices.iter().zip(&after.vertices) {
            assert!(p.distance(*q) <= length, "{p} moved to {q}");
        }
    }
    let brightest = |input: &SceneInput| {
        let scene = build(input);
        let meshed =
            antumbra::mesh(&scene, &limited(), &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
        let inside = meshed.mesh.receivers.iter().filter(|mesh| {
            let name = &scene.surface_of(mesh.face).name;
            name.starts_with("room")
        });
        inside
            .flat_map(|mesh| mesh.direct.iter().copied())
            .fold(0.0, f64::max)
    };
    assert!(brightest(&ragged) > 1e-3, "light comes through its gaps");
    assert!(brightest(&welded) <= ROUNDING, "{:e}", brightest(&welded));
}

/// A closed room, every corner off by up to `amount` along each axis: no wall of it is
/// plane.
fn warped_room(amount: f64, seed: u64) -> SceneInput {
    let mut scene = empty();
    let (min, max) = (dvec3(-1.5, -1.0, 0.0), dvec3(1.5, 1.0, 2.5));
    add_room(&mut scene, "room", "grey", min, max);
    let mut random = SplitMix::new(seed);
    let moves: Vec<DVec3> = (0..8)
        .map(|_| {
            let step = random.in_box(-DVec3::ONE, DVec3::ONE);
            // Every other room by exactly the amount: walls that are parallel again.
            let step = if seed.is_multiple_of(2) {
                step.signum()
            } else {
                step
            };
            step * amount
        })
        .collect();
    for corner in scene.surfaces.iter_mut().flat_map(|s| &mut s.vertices) {
        let is_high = |k: usize| usize::from(corner[k] > (min[k] + max[k]) / 2.0);
        let id = is_high(0) + 2 * is_high(1) + 4 * is_high(2);
        *corner += moves[id];
    }
    scene
}

/// The same with one wall of two parts, so that its neighbours have five corners.
fn with_a_divided_wall(mut scene: SceneInput, amount: f64, seed: u64) -> SceneInput {
    let mut random = SplitMix::new(1000 + seed);
    let wall = scene.surfaces.remove(0);
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| wall.vertices[k]);
    let mut middle =
        |p: DVec3, q: DVec3| p.midpoint(q) + random.in_box(-DVec3::ONE, DVec3::ONE) * amount;
    let (m, n) = (middle(a, b), middle(c, d));
    for surface in &mut scene.surfaces {
        let corners = &mut surface.vertices;
        for ((p, q), between) in [((a, b), m), ((c, d), n)] {
            let n_corners = corners.len();
            let edge =
                (0..n_corners).find(|&i| corners[i] == q && corners[(i + 1) % n_corners] == p);
            if let Some(i) = edge {
                corners.insert(i + 1, between);
            }
        }
    }
    for (name, part) in [("lower", [a, m, n, d]), ("upper", [m, b, c, n])] {
        add(&mut scene, &format!("{} {name}", wall.name), "grey", &part);
    }
    scene
}

/// By how much walls are warped: from what a turned scene at a great distance loses to
/// what is seen with the eye.
const WARPS: [f64; 9] = [1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];

/// As they stand, turned, and turned a million metres away, where coordinates have ten
/// digits less than their size.
fn poses_of_rooms() -> [Motion; 3] {
    let far = Motion {
        shift: dvec3(1e6, -2e6, 5e5),
        ..Motion::skew()
    };
    let [here, turned] = poses();
    [here, turned, far]
}

/// Meshes a scene and visits the nodes of its room: surface, place in the scene as it
/// stands, face, and value.
fn at_nodes_of_the_room(scene: &antumbra::Scene, mut visit: impl FnMut(FaceId, DVec3, f64)) {
    let meshed =
        antumbra::mesh(scene, &limited(), &Control::NEVER).unwrap_or_else(|e| panic!("{e}"));
    for mesh in &meshed.mesh.receivers {
        if !scene.surface_of(mesh.face).name.starts_with("room") {
            continue;
        }
        for (uv, &e) in mesh.nodes.iter().zip(&mesh.direct) {
            visit(mesh.face, mesh.chart.to_space(*uv), e);
        }
    }
}

/// Walls that are not plane are split into triangles that almost are: nodes lie in slivers
/// along the border, and looked at flatly a wall is a line.
#[test]
fn closed_rooms_with_warped_walls_are_dark() {
    for amount in WARPS {
        for seed in 0..12 {
            nothing_comes_into(warped_room(amount, seed), amount, seed, ROUNDING);
        }
    }
}

/// Where the corner of a wall meets a divided one, several triangles meet that are almost in
/// one plane. Nodes within touching distance of such a corner have limits as if all of them
/// went through it, up to what their folds let through (docs/numerics.md).
#[test]
fn closed_rooms_with_a_divided_warped_wall_are_all_but_dark() {
    for amount in WARPS {
        for seed in 12..48 {
            let room = with_a_divided_wall(warped_room(amount, seed), amount, seed);
            nothing_comes_into(room, amount, seed, 2e-5);
        }
    }
}

fn nothing_comes_into(mut room: SceneInput, amount: f64, seed: u64, allowed: f64) {
    add_lamps_outside(&mut room);
    let pose = poses_of_rooms()[seed as usize % 3];
    let scene = build(&pose.scene(&room));
    at_nodes_of_the_room(&scene, |face, p, e| {
        let name = &scene.surface_of(face).name;
        let p = pose.inverse().point(scene.frame.to_file(p));
        assert!(
            e <= allowed,
            "warped by {amount:e}, seed {seed}: {e:e} on {name} at {p}"
        );
    });
}

/// Points at any distance from the border, down to rounding.
#[test]
fn points_of_closed_rooms_with_warped_walls_are_dark() {
    for amount in WARPS {
        for seed in 0..12 {
            let mut room = warped_room(amount, seed);
            add_lamps_outside(&mut room);
            let pose = poses_of_rooms()[seed as usize % 3];
            let scene = build(&pose.scene(&room));
            let evaluator = Evaluator::new(&scene);
            let light = ExactLight::new(&evaluator, &Control::NEVER);
            let mut scratch = Scratch::default();
            let mut random = SplitMix::new(seed);
            for face in scene.face_ids() {
                if !scene.surface_of(face).name.starts_with("room") {
                    continue;
                }
                let corners = scene.positions(&scene.face(face).outline);
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                for k in 0..200 {
                    let i = k % corners.len();
                    let on_border =
                        corners[i].lerp(corners[(i + 1) % corners.len()], random.unit());
                    let p = on_border.lerp(middle, 10f64.powf(-10.0 * random.unit()));
                    let e = light.at(face, p, &mut scratch)[0];
                    let d = p.distance(on_border);
                    // A plane as near as rounding is seen edge-on and hides nothing; that
                    // far from a fold it is inclined by no more than this.
                    let fold = 1e-14 / d;
                    assert!(
                        e <= ROUNDING + fold * fold,
                        "warped by {amount:e}, seed {seed}: {e:e} at {d:e} from the border"
                    );
                }
            }
        }
    }
}

/// All that a visibility map shows in a closed room is the room: not the sky, nor any face
/// beyond it, at points and limits at any distance from the border.
#[test]
fn maps_of_closed_rooms_show_nothing_else() {
    for amount in WARPS.into_iter().chain([0.0]) {
        for seed in 0..12 {
            let mut room = warped_room(amount, seed);
            add_lamps_outside(&mut room);
            let pose = poses_of_rooms()[seed as usize % 3];
            let scene = build(&pose.scene(&room));
            let evaluator = Evaluator::new(&scene);
            let mut scratch = MapScratch::default();
            let mut random = SplitMix::new(seed);
            let is_room = |face| scene.surface_of(face).name.starts_with("room");
            for face in scene.face_ids().filter(|&face| is_room(face)) {
                let corners = scene.positions(&scene.face(face).outline);
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                for k in 0..60 {
                    let i = k % corners.len();
                    let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                    let on_border = a.lerp(b, random.unit());
                    let is_limit = k % 3 == 0;
                    let away = 10f64.powf(-10.0 * random.unit());
                    let approach = is_limit.then(|| Approach {
                        toward: scene.face(face).normal.cross(b - a).normalize_or_zero(),
                        radius: 1e-8 * scene.extent,
                    });
                    let map_place = MapPlace {
                        point: on_border.lerp(middle, if is_limit { 0.0 } else { away }),
                        normal: scene.face(face).normal,
                        plane: Some(scene.face(face).plane),
                        approach,
                    };
                    let mut beyond = 0.0;
                    let totals = evaluator.visible_faces(&map_place, 0.0, &mut scratch, |part| {
                        beyond += if is_room(part.face) { 0.0 } else { part.factor };
                    });
                    beyond += totals.sky;
                    let d = map_place.point.distance(on_border);
                    // Folds as above, with all that is beyond them and not lamps alone; a
                    // limit is as if all that touches the point went through it.
                    let allowed = match (amount, approach) {
                        (0.0, _) if d == 0.0 || d > 1e-7 => 0.0,
                        (_, Some(_)) => 1e-11,
                        (_, None) => ROUNDING + (2e-14 / d).powi(2),
                    };
                    assert!(
                        beyond <= allowed,
                        "warped by {amount:e}, seed {seed}: {beyond:e} at {map_place:?}"
                    );
                }
            }
        }
    }
}

/// What keeps light out must not keep it from its own nodes: those at the border of a room
/// with a lamp hold what falls just beside them.
#[test]
fn nodes_of_warped_rooms_hold_the_light_beside_them() {
    for amount in WARPS {
        for seed in 0..6 {
            let mut room = warped_room(amount, seed);
            for (name, facing) in [("lamp down", Facing::Down), ("lamp up", Facing::Up)] {
                let sides = ([-0.5, 0.5], [-0.375, 0.375]);
                add_horizontal(&mut room, name, "lamp", (sides.0, sides.1, 1.25), facing);
            }
            let pose = poses_of_rooms()[seed as usize % 3];
            let scene = build(&pose.scene(&room));
            let evaluator = Evaluator::new(&scene);
            let light = ExactLight::new(&evaluator, &Control::NEVER);
            let mut scratch = Scratch::default();
            at_nodes_of_the_room(&scene, |face, p, e| {
                let corners = scene.positions(&scene.face(face).outline);
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                let beside = light.at(face, p.lerp(middle, 1e-4), &mut scratch)[0];
                assert!(
                    (e - beside).abs() <= 1e-3,
                    "warped by {amount:e}, seed {seed}: {e} at {p}, {beside} beside it"
                );
            });
        }
    }
}

/// What is closed where edges are near is slits, and not lamps that are as small.
#[test]
fn small_lamps_beside_edges_are_seen_whole() {
    let mut scene = empty();
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
    for (name, size, height) in [("lamp", 0.03, 3.0), ("minute lamp", 1e-4, 2.5)] {
        let lamp = ([-1.0 - size, -1.0], [0.5, 0.5 + size], height);
        add_horizontal(&mut scene, name, "lamp", lamp, Facing::Down);
    }
    let open = scene.clone();
    add_box(
        &mut scene,
        "box",
        "grey",
        dvec3(0.0, -0.5, 0.0),
        dvec3(0.5, 0.5, 0.75),
    );
    let points: Vec<DVec3> = (2..14)
        .map(|k| dvec3(-(10f64.powi(-k)), 0.125, 0.0))
        .collect();
    let seen = exact(&scene, "floor", &points);
    for ((p, e), whole) in points.iter().zip(seen).zip(exact(&open, "floor", &points)) {
        assert!((e - whole).abs() <= 1e-12 * whole, "{e} of {whole} at {p}");
    }
}
