//! Bodies that stand on one another: what they cover receives and sends nothing.
//!
//! In a closed room of which everything emits alike, every point that is not covered sees
//! light from everywhere: whatever is taken for covered and is not, or the other way
//! round, shows.

use antumbra::scene::{Scene, SurfaceInput};
use antumbra::{Control, Evaluator, ExactLight, FactorOptions, SceneInput, Scratch, values};
use antumbra_tests::cases::{build, fixture};
use antumbra_tests::meshes::gathered;
use antumbra_tests::motion::Motion;
use antumbra_tests::scenes::{
    Facing, add_box, add_horizontal, add_room, empty, exact, material, only_face, points_on,
};
use glam::{DVec3, dvec3};

/// What everything emits.
const EXITANCE: f64 = 0.5;

fn furnace() -> SceneInput {
    let mut scene = empty();
    scene.materials = vec![
        material("hot", 0.5, EXITANCE),
        material("sheet", 0.5, EXITANCE),
    ];
    scene.materials[1].two_sided = true;
    scene
}

/// A room of 4 × 3 × 2.5 m.
fn room_of(material: &str) -> SceneInput {
    let mut scene = furnace();
    add_room(
        &mut scene,
        "room",
        material,
        DVec3::ZERO,
        dvec3(4.0, 3.0, 2.5),
    );
    scene
}

fn room() -> SceneInput {
    room_of("hot")
}

fn with_box(mut scene: SceneInput, name: &str, min: [f64; 3], max: [f64; 3]) -> SceneInput {
    add_box(&mut scene, name, "hot", min.into(), max.into());
    scene
}

fn with_room(mut scene: SceneInput, name: &str, min: [f64; 3], max: [f64; 3]) -> SceneInput {
    add_room(&mut scene, name, "hot", min.into(), max.into());
    scene
}

/// A two-sided rug on the floor.
fn with_rug(mut scene: SceneInput) -> SceneInput {
    let place = ([1.0, 2.0], [1.0, 2.0], 0.0);
    add_horizontal(&mut scene, "rug", "sheet", place, Facing::Up);
    scene
}

fn table() -> SceneInput {
    let mut scene = with_box(room(), "top", [1.0, 1.0, 0.75], [2.0, 2.0, 0.875]);
    for (name, x, y) in [("l0", 1.0, 1.0), ("l1", 1.875, 1.0), ("l2", 1.0, 1.875)] {
        scene = with_box(scene, name, [x, y, 0.0], [x + 0.125, y + 0.125, 0.75]);
    }
    scene
}

/// A room with a niche of 1 × 1 × 0.5 m in the wall x = 0.
fn niche() -> SceneInput {
    let mut scene = room();
    let wall = scene.surfaces.iter_mut().find(|s| s.name == "room.x0");
    wall.expect("the room has this wall").holes = vec![vec![
        dvec3(0.0, 1.0, 1.0),
        dvec3(0.0, 1.0, 2.0),
        dvec3(0.0, 2.0, 2.0),
        dvec3(0.0, 2.0, 1.0),
    ]];
    scene = with_room(scene, "niche", [-0.5, 1.0, 1.0], [0.0, 2.0, 2.0]);
    scene.surfaces.retain(|s| s.name != "niche.x1");
    scene
}

/// A tray of sheets: it has a bottom and four sides.
fn tray() -> SceneInput {
    let mut scene = with_rug(room());
    let mut sides = furnace();
    add_box(
        &mut sides,
        "tray",
        "sheet",
        dvec3(1.0, 1.0, 0.0),
        dvec3(2.0, 2.0, 0.25),
    );
    sides.surfaces.retain(|s| !s.name.contains(".z"));
    scene.surfaces.extend(sides.surfaces);
    scene
}

/// A floor of tiles, each a surface, and a box that stands on several.
fn tiles() -> SceneInput {
    let mut scene = room();
    scene.surfaces.retain(|s| s.name != "room.z0");
    for (i, j) in (0..4).flat_map(|i| (0..3).map(move |j| (f64::from(i), f64::from(j)))) {
        let place = ([i, i + 1.0], [j, j + 1.0], 0.0);
        add_horizontal(
            &mut scene,
            &format!("tile-{i}-{j}"),
            "hot",
            place,
            Facing::Up,
        );
    }
    with_box(scene, "box", [0.5, 0.25, 0.0], [2.75, 2.5, 1.0])
}

/// A box of which every side is two surfaces, with corners where others have none.
fn box_of_panels() -> SceneInput {
    let whole = with_box(furnace(), "box", [1.0, 1.0, 0.0], [2.0, 2.0, 1.0]);
    let mut scene = room();
    for surface in whole.surfaces {
        let [a, b, c, d] = surface.vertices[..] else {
            panic!("a box has rectangles");
        };
        let (p, q) = (a.lerp(b, 0.375), d.lerp(c, 0.375));
        for (k, vertices) in [vec![a, p, q, d], vec![p, b, c, q]].into_iter().enumerate() {
            scene.surfaces.push(SurfaceInput {
                name: format!("{}-{k}", surface.name),
                vertices,
                ..surface.clone()
            });
        }
    }
    scene
}

/// A scene with a name, and what is covered in it, by the names of sides: `~` marks a back.
type CoveredScene = (&'static str, SceneInput, Vec<(&'static str, f64)>);

fn covered_scenes() -> Vec<CoveredScene> {
    let cabinet = |scene| with_box(scene, "cabinet", [0.0, 0.0, 0.0], [1.0, 0.5, 2.0]);
    let lower = || with_box(room(), "a", [1.0, 1.0, 0.0], [2.0, 2.0, 1.0]);
    vec![
        (
            "cabinet in a corner",
            cabinet(room()),
            vec![
                ("room.x0", 1.0),
                ("room.y0", 2.0),
                ("room.z0", 0.5),
                ("cabinet.x0", 1.0),
                ("cabinet.y0", 2.0),
                ("cabinet.z0", 0.5),
            ],
        ),
        (
            "cabinet in a corner of a room of sheets",
            cabinet(room_of("sheet")),
            vec![
                ("room.x0", 1.0),
                ("room.y0", 2.0),
                ("room.z0", 0.5),
                ("cabinet.x0", 1.0),
                ("cabinet.y0", 2.0),
                ("cabinet.z0", 0.5),
            ],
        ),
        (
            "equal boxes on one another",
            with_box(lower(), "b", [1.0, 1.0, 1.0], [2.0, 2.0, 1.5]),
            vec![
                ("room.z0", 1.0),
                ("a.z0", 1.0),
                ("a.z1", 1.0),
                ("b.z0", 1.0),
            ],
        ),
        (
            "boxes on one another, shifted",
            with_box(lower(), "b", [1.25, 1.25, 1.0], [2.5, 1.75, 1.5]),
            vec![
                ("room.z0", 1.0),
                ("a.z0", 1.0),
                ("a.z1", 0.375),
                ("b.z0", 0.375),
            ],
        ),
        (
            "boxes side by side",
            with_box(lower(), "b", [2.0, 1.5, 0.0], [3.0, 2.5, 0.5]),
            vec![
                ("room.z0", 2.0),
                ("a.x1", 0.25),
                ("a.z0", 1.0),
                ("b.x0", 0.25),
                ("b.z0", 1.0),
            ],
        ),
        (
            "pillar from floor to ceiling",
            with_box(room(), "pillar", [1.0, 1.0, 0.0], [1.5, 1.5, 2.5]),
            vec![
                ("room.z0", 0.25),
                ("room.z1", 0.25),
                ("pillar.z0", 0.25),
                ("pillar.z1", 0.25),
            ],
        ),
        (
            "table with flush legs",
            table(),
            vec![
                ("room.z0", 3.0 / 64.0),
                ("top.z0", 3.0 / 64.0),
                ("l0.z0", 1.0 / 64.0),
                ("l0.z1", 1.0 / 64.0),
                ("l1.z0", 1.0 / 64.0),
                ("l1.z1", 1.0 / 64.0),
                ("l2.z0", 1.0 / 64.0),
                ("l2.z1", 1.0 / 64.0),
            ],
        ),
        (
            "cabinet in a niche",
            with_box(niche(), "cabinet", [-0.5, 1.0, 1.0], [0.0, 2.0, 1.5]),
            vec![
                ("niche.x0", 0.5),
                ("niche.y0", 0.25),
                ("niche.y1", 0.25),
                ("niche.z0", 0.5),
                ("cabinet.x0", 0.5),
                ("cabinet.y0", 0.25),
                ("cabinet.y1", 0.25),
                ("cabinet.z0", 0.5),
            ],
        ),
        (
            "cabinet that fills a niche",
            with_box(niche(), "cabinet", [-0.5, 1.0, 1.0], [0.0, 2.0, 2.0]),
            vec![
                ("niche.x0", 1.0),
                ("niche.y0", 0.5),
                ("niche.y1", 0.5),
                ("niche.z0", 0.5),
                ("niche.z1", 0.5),
                ("cabinet.x0", 1.0),
                ("cabinet.y0", 0.5),
                ("cabinet.y1", 0.5),
                ("cabinet.z0", 0.5),
                ("cabinet.z1", 0.5),
            ],
        ),
        (
            "rug on the floor of a room",
            with_rug(room()),
            vec![("room.z0", 1.0), ("rug~", 1.0)],
        ),
        (
            "tray on the floor of a room",
            tray(),
            vec![("room.z0", 1.0), ("rug~", 1.0)],
        ),
        (
            "box of panels",
            box_of_panels(),
            vec![("room.z0", 1.0), ("box.z0-0", 0.375), ("box.z0-1", 0.625)],
        ),
    ]
}

/// Scenes in which nothing is covered, though faces look opposite ways in one plane.
fn sheets() -> Vec<(&'static str, SceneInput)> {
    let outer = |min, max| with_box(room(), "outer", min, max);
    vec![
        ("closed room of sheets", room_of("sheet")),
        (
            "smaller room upon a room",
            with_room(room(), "upper", [1.0, 1.0, 2.5], [2.0, 2.0, 4.0]),
        ),
        (
            "equal room upon a room",
            with_room(room(), "upper", [0.0, 0.0, 2.5], [4.0, 3.0, 4.0]),
        ),
        (
            "smaller room beside a room",
            with_room(room(), "next", [4.0, 0.0, 0.0], [6.0, 2.0, 2.5]),
        ),
        ("room in a shell", outer([0.0, 0.0, 0.0], [4.0, 3.0, 2.5])),
        (
            "room in a shell with thick walls",
            outer([-0.25, -0.25, 0.0], [4.25, 3.25, 2.75]),
        ),
        (
            "room in a shell with thin floor and ceiling",
            outer([-0.25, -0.25, 0.0], [4.25, 3.25, 2.5]),
        ),
        ("rug without a room", {
            let mut scene = furnace();
            let place = ([0.0, 3.0], [0.0, 3.0], 0.0);
            add_horizontal(&mut scene, "floor", "hot", place, Facing::Up);
            let place = ([1.0, 2.0], [1.0, 2.0], 0.0);
            add_horizontal(&mut scene, "rug", "hot", place, Facing::Down);
            scene
        }),
    ]
}

/// What is covered, by the names of sides; file units.
fn covered(scene: &Scene) -> Vec<(String, f64)> {
    let sides = scene.covered_areas().into_iter().map(|side| {
        let name = &scene.surfaces[side.surface.index()].name;
        let mark = if side.is_back { "~" } else { "" };
        (format!("{name}{mark}"), side.covered_area)
    });
    sides.collect()
}

#[test]
fn what_bodies_press_together_is_covered_and_nothing_else() {
    for motion in [Motion::IDENTITY, Motion::skew()] {
        for (name, input, expected) in covered_scenes() {
            let found = covered(&build(&motion.scene(&input)));
            let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
            let wanted: Vec<&str> = expected.iter().map(|(name, _)| *name).collect();
            assert_eq!(names, wanted, "{name}");
            for ((side, area), (_, wanted)) in found.iter().zip(&expected) {
                assert!(
                    (area - wanted).abs() < 1e-12,
                    "{name}: {side} {area}, not {wanted}"
                );
            }
        }
        for (name, input) in sheets() {
            let found = covered(&build(&motion.scene(&input)));
            assert!(found.is_empty(), "{name}: {found:?}");
        }
    }
}

#[test]
fn a_box_on_tiles_covers_what_it_stands_on() {
    let scene = build(&tiles());
    let sides = covered(&scene);
    let of_tiles = sides.iter().filter(|(name, _)| name.starts_with("tile"));
    let area: f64 = of_tiles.map(|(_, area)| area).sum();
    assert!((area - 2.25 * 2.25).abs() < 1e-12, "{area}");
}

/// Direct light at points of all faces: all of it where nothing is covered, else none.
fn check_evenness(name: &str, input: &SceneInput) {
    let scene = build(input);
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    let is_inside = |f| !scene.surface_of(f).name.starts_with("outer");
    for place in values::random_places(&scene, 1_000, &is_inside) {
        let value = values::exact(&light, &place, &mut scratch)[0];
        let face = scene.face(place.face);
        let expected = if face.is_covered { 0.0 } else { EXITANCE };
        // Backs of sheets that bound the room look out of it.
        if face.is_back && name.contains("of sheets") {
            continue;
        }
        assert!(
            (value - expected).abs() < 1e-9,
            "{name}: {value} on '{}' at {}",
            scene.surface_of(place.face).name,
            place.point
        );
    }
}

#[test]
fn furnace_rooms_with_furniture_are_even_where_they_are_not_covered() {
    for motion in [Motion::IDENTITY, Motion::skew()] {
        for (name, input, _) in covered_scenes() {
            check_evenness(name, &motion.scene(&input));
        }
        check_evenness("box on tiles", &motion.scene(&tiles()));
    }
}

#[test]
fn rooms_that_only_share_a_plane_keep_their_light() {
    for (name, input) in sheets() {
        if name.starts_with("room in") || name.contains("room upon") || name.contains("beside") {
            check_evenness(name, &input);
        }
    }
}

#[test]
fn rows_over_uncovered_areas_sum_to_one() {
    for (name, input, expected) in covered_scenes() {
        if name.contains("sheets") || !["corner", "pillar", "rug"].iter().any(|w| name.contains(w))
        {
            continue;
        }
        let scene = build(&input);
        let options = FactorOptions {
            tolerance: 1e-9,
            ..FactorOptions::default()
        };
        let factors = antumbra::factors(&scene, &options, &Control::NEVER);
        for (i, sum) in factors.row_sums().into_iter().enumerate() {
            let surface = factors.names[i].as_str();
            let hidden = expected
                .iter()
                .find(|(n, _)| n.trim_end_matches('~') == surface);
            let geometric = scene.surface_area(antumbra::scene::SurfaceId(i as u32));
            let sides = if surface == "rug" { 2.0 } else { 1.0 };
            let area = sides * geometric - hidden.map_or(0.0, |h| h.1);
            assert!((factors.areas[i] - area).abs() < 1e-12, "{name}: {surface}");
            let whole = if area > 0.0 { 1.0 } else { 0.0 };
            assert!((sum - whole).abs() < 1e-9, "{name}: {surface} {sum}");
        }
    }
}

#[test]
fn box_bottom_is_not_lit_through_the_floor_it_stands_on() {
    let scene = fixture("covered/box-bottom-lit-through-floor");
    let points = points_on(
        dvec3(-0.5, -0.5, 0.0),
        dvec3(1.0, 0.0, 0.0),
        dvec3(0.0, 1.0, 0.0),
        5,
    );
    for (surface, points) in [("b0", &points), ("floor", &points)] {
        for value in exact(&scene, surface, points) {
            assert_eq!(value, 0.0, "{surface}");
        }
    }
    let built = build(&scene);
    assert!(built.face(only_face(&built, "b0")).is_covered);
}

/// A cabinet in a dark room with a lamp, `gap` off the floor and two walls.
fn lit_cabinet(gap: f64) -> SceneInput {
    let mut scene = empty();
    add_room(
        &mut scene,
        "room",
        "grey",
        DVec3::ZERO,
        dvec3(4.0, 3.0, 2.5),
    );
    let place = ([2.0, 3.0], [1.0, 2.0], 2.25);
    add_horizontal(&mut scene, "lamp", "lamp", place, Facing::Down);
    let min = DVec3::splat(gap);
    add_box(
        &mut scene,
        "cabinet",
        "grey",
        min,
        min + dvec3(1.0, 0.5, 2.0),
    );
    scene
}

#[test]
fn standing_is_the_limit_of_hovering_a_hair_above() {
    let points = [
        ("room.z0", dvec3(2.0, 1.5, 0.0)),
        ("room.z0", dvec3(1.2, 1.0, 0.0)),
        ("room.x0", dvec3(0.0, 1.0, 1.0)),
        ("room.y0", dvec3(1.5, 0.0, 0.5)),
        ("cabinet.x1", dvec3(1.0, 0.25, 1.0)),
        ("cabinet.y1", dvec3(0.5, 0.5, 0.5)),
    ];
    let at = |gap: f64| -> Vec<f64> {
        let scene = lit_cabinet(gap);
        let value = |(name, p): (&str, DVec3)| {
            // What belongs to the cabinet moves with it.
            let moved = if name.starts_with("cabinet") {
                p + DVec3::splat(gap)
            } else {
                p
            };
            exact(&scene, name, &[moved])[0]
        };
        points.into_iter().map(value).collect()
    };
    let standing = at(0.0);
    for gap in [1e-2, 1e-3, 1e-5, 1e-7, 1e-9] {
        for ((value, limit), (name, p)) in at(gap).iter().zip(&standing).zip(points) {
            assert!(
                (value - limit).abs() < 0.3 * gap + 1e-12,
                "{name} {p} at {gap}: {value}, {limit}"
            );
        }
    }
}

#[test]
fn factors_are_continuous_as_a_cabinet_comes_to_stand() {
    let at = |gap: f64| {
        let options = FactorOptions {
            tolerance: 1e-7,
            ..FactorOptions::default()
        };
        antumbra::factors(&build(&lit_cabinet(gap)), &options, &Control::NEVER)
    };
    let standing = at(0.0);
    let index = |name: &str| {
        standing
            .names
            .iter()
            .position(|n| n == name)
            .expect("is there")
    };
    let pairs = [
        ("room.x1", "room.z0"),
        ("room.y1", "room.x0"),
        ("cabinet.x1", "room.y0"),
    ];
    for gap in [1e-3, 1e-5] {
        let hovering = at(gap);
        for (from, to) in pairs {
            let (i, j) = (index(from), index(to));
            let [near, limit] = [&hovering, &standing].map(|f| f.areas[i] * f.factor(i, j));
            assert!(
                (near - limit).abs() < 10.0 * gap + 1e-6,
                "{from} to {to} at {gap}: {near}, {limit}"
            );
        }
    }
}

#[test]
fn nodes_where_furniture_meets_walls_see_light_from_everywhere() {
    for motion in [Motion::IDENTITY, Motion::skew()] {
        for (name, input, _) in covered_scenes() {
            let is_wanted = ["corner", "side by side", "niche", "table"];
            if name.contains("of sheets") || !is_wanted.iter().any(|w| name.contains(w)) {
                continue;
            }
            let scene = build(&motion.scene(&input));
            let options = antumbra::Options {
                tolerance: antumbra::Tolerance::Relative(1e-2),
                ..antumbra::Options::default()
            };
            let meshed = antumbra::mesh(&scene, &options, &Control::NEVER)
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            for mesh in &meshed.mesh.receivers {
                let face = scene.face(mesh.face);
                let expected = if face.is_covered { 0.0 } else { EXITANCE };
                let surface = &scene.surface_of(mesh.face).name;
                for (uv, value) in mesh.nodes.iter().zip(&mesh.direct) {
                    let p = motion
                        .inverse()
                        .point(scene.frame.to_file(mesh.chart.to_space(*uv)));
                    assert!(
                        (value - expected).abs() < 1e-9,
                        "{name}: {value} at the node {p} of '{surface}'"
                    );
                }
            }
        }
    }
}

#[test]
fn furnace_rooms_are_even_after_all_bounces() {
    for (name, input, _) in covered_scenes() {
        if !["cabinet in a corner", "boxes side by side"].contains(&name) {
            continue;
        }
        let scene = build(&input);
        let evaluator = Evaluator::new(&scene);
        let light = ExactLight::new(&evaluator, &Control::NEVER);
        let options = antumbra::Options::default();
        let solved = antumbra::solve(&scene, &options, &Control::NEVER)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let places = values::random_places(&scene, 200, &|f| !scene.face(f).is_covered);
        let found = gathered(&light, &evaluator, &solved, &places);
        for (place, value) in places.iter().zip(found) {
            // E = M / (1 − ρ).
            assert!(
                (value[0] - 1.0).abs() < 1e-6,
                "{name}: {} at {}",
                value[0],
                place.point
            );
        }
    }
}
