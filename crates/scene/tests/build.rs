//! Scenes as they come, and what is made of them.

use antumbra_scene::{
    Built, FaceId, MaterialInput, Problem, Scene, SceneInput, Severity, Side, SurfaceInput,
};
use glam::{DMat3, DVec3, dvec3};

fn material(name: &str, exitance: f64, two_sided: bool) -> MaterialInput {
    MaterialInput {
        name: name.to_owned(),
        reflectance: vec![0.5],
        exitance: vec![exitance],
        two_sided,
    }
}

fn scene(surfaces: Vec<SurfaceInput>) -> SceneInput {
    SceneInput {
        materials: vec![
            material("white", 0.0, false),
            material("lamp", 1.0, false),
            material("plate", 0.0, true),
        ],
        surfaces,
        ..SceneInput::default()
    }
}

fn surface(name: &str, material: &str, corners: &[[f64; 3]]) -> SurfaceInput {
    SurfaceInput {
        name: name.to_owned(),
        material: material.to_owned(),
        vertices: corners.iter().copied().map(DVec3::from_array).collect(),
        holes: Vec::new(),
    }
}

/// An axis-parallel rectangle at height `z`, facing up.
fn rectangle(name: &str, material: &str, [x0, y0, x1, y1]: [f64; 4], z: f64) -> SurfaceInput {
    surface(
        name,
        material,
        &[[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]],
    )
}

/// The six sides of a box, facing outwards.
fn push_box(surfaces: &mut Vec<SurfaceInput>, low: DVec3, high: DVec3, turn: DMat3) {
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    for side in sides {
        let vertices = side.map(|k: usize| {
            let pick = |bit: usize, a: f64, b: f64| if k >> bit & 1 == 1 { b } else { a };
            turn * dvec3(
                pick(0, low.x, high.x),
                pick(1, low.y, high.y),
                pick(2, low.z, high.z),
            )
        });
        surfaces.push(SurfaceInput {
            name: format!("s{}", surfaces.len()),
            material: "white".to_owned(),
            vertices: vertices.to_vec(),
            holes: Vec::new(),
        });
    }
}

fn build(surfaces: Vec<SurfaceInput>) -> Built {
    Scene::build(&scene(surfaces)).expect("a scene that is accepted")
}

fn kinds(problems: &[Problem]) -> Vec<&'static str> {
    problems
        .iter()
        .map(|p| p.kind)
        .filter(|&kind| kind != "no-emitter")
        .collect()
}

fn errors(surfaces: Vec<SurfaceInput>) -> Vec<Problem> {
    let problems = Scene::build(&scene(surfaces)).expect_err("a scene that is refused");
    problems
        .into_iter()
        .filter(|p| p.severity == Severity::Error)
        .collect()
}

#[test]
fn scene_far_from_the_origin_keeps_every_bit() {
    for base in [0.0, 1e6, -1e6] {
        let at = |x: f64, y: f64| [base + x, base + y, base + 0.3];
        let corners = [at(0.1, 0.1), at(3.3, 0.1), at(3.3, 2.7), at(0.1, 2.7)];
        let input = surface("floor", "lamp", &corners);
        let built = build(vec![input.clone()]);
        let scene = built.scene;
        assert!((1.0..2.0).contains(&scene.extent));
        assert!(scene.vertices.iter().all(|v| v.abs().max_element() < 4.0));
        for (v, file) in scene.faces[0].outline.iter().zip(&input.vertices) {
            assert_eq!(scene.frame.to_file(scene.position(*v)), *file);
            assert_eq!(scene.frame.to_scene(*file), scene.position(*v));
        }
        assert_eq!(scene.faces[0].normal, DVec3::Z);
    }
}

#[test]
fn corners_a_rounding_apart_are_one_vertex() {
    let mut left = rectangle("left", "lamp", [0.0, 0.0, 1.0, 1.0], 0.0);
    left.vertices[1].x += 1e-15;
    left.vertices[0].z = -0.0;
    let built = build(vec![
        left,
        rectangle("right", "white", [1.0, 0.0, 2.0, 1.0], 0.0),
    ]);
    let scene = built.scene;
    assert_eq!(scene.vertices.len(), 6);
    assert_eq!(scene.edges.len(), 7);
    assert_eq!(scene.edges.iter().filter(|e| e.faces.len() == 2).count(), 1);
    assert!(scene.vertices.iter().all(|v| v.z.is_sign_positive()));
}

#[test]
fn grid_of_boxes_has_few_planes_upright_and_turned() {
    let turned = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(0.4);
    for turn in [DMat3::IDENTITY, turned] {
        let mut surfaces = Vec::new();
        for i in 0..6 {
            for j in 0..6 {
                let low = dvec3(f64::from(i), f64::from(j), 0.0);
                push_box(&mut surfaces, low, low + dvec3(0.6, 0.6, 0.5), turn);
            }
        }
        let scene = build(surfaces).scene;
        // Two planes a row in x and in y, the bottom and the top.
        assert_eq!(scene.planes.len(), 12 + 12 + 2);
        assert!(scene.report().closed);
        for f in scene.face_ids() {
            let face = scene.face(f);
            assert!(
                face.outline
                    .iter()
                    .all(|&v| scene.side(v, face.plane) == Side::On)
            );
            let normal = scene.planes[face.plane.index()].normal;
            assert_eq!(face.along_plane, face.normal == normal);
        }
    }
}

#[test]
fn table_a_micron_over_the_floor_keeps_its_plane() {
    let built = build(vec![
        rectangle("floor", "white", [-2.0, -2.0, 2.0, 2.0], 0.0),
        rectangle("table", "lamp", [0.0, 0.0, 1.0, 1.0], 2f64.powi(-30)),
    ]);
    assert_eq!(built.scene.planes.len(), 2);
    assert!(kinds(&built.warnings).is_empty());
}

#[test]
fn emitters_that_overlap_are_refused_and_others_are_said() {
    let floor = || rectangle("floor", "white", [0.0, 0.0, 4.0, 4.0], 0.0);
    let problems = errors(vec![
        rectangle("a", "lamp", [0.0, 0.0, 2.0, 2.0], 1.0),
        rectangle("b", "lamp", [1.0, 1.0, 3.0, 3.0], 1.0),
    ]);
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].kind, "overlap");
    assert_eq!(problems[0].names, ["a", "b"]);
    assert_eq!(
        (problems[0].found, problems[0].allowed),
        (Some(1.0), Some(0.0))
    );

    let rug = rectangle("rug", "white", [1.0, 1.0, 2.0, 2.0], 0.0);
    let built = build(vec![floor(), rug]);
    assert_eq!(kinds(&built.warnings), ["overlap"]);

    let mut copy = floor();
    copy.name = "copy".to_owned();
    copy.vertices.rotate_left(2);
    assert_eq!(
        kinds(&build(vec![floor(), copy.clone()]).warnings),
        ["duplicate"]
    );

    // Back to back it is a thin plate; side by side they only touch.
    copy.vertices.reverse();
    assert!(kinds(&build(vec![floor(), copy]).warnings).is_empty());
    let beside = rectangle("beside", "lamp", [4.0, 0.0, 8.0, 4.0], 0.0);
    assert!(kinds(&build(vec![floor(), beside]).warnings).is_empty());
}

#[test]
fn keyhole_with_one_hole_is_opened() {
    let wall = surface(
        "wall",
        "lamp",
        &[
            [0.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [4.0, 3.0, 0.0],
            [0.0, 3.0, 0.0],
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [1.0, 2.0, 0.0],
            [2.0, 2.0, 0.0],
            [2.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
        ],
    );
    let built = build(vec![wall]);
    assert_eq!(kinds(&built.warnings), ["keyhole"]);
    let face = &built.scene.faces[0];
    assert_eq!((face.outline.len(), face.holes.len()), (4, 1));
    assert_eq!(built.scene.frame.area_to_file(face.area), 11.0);
}

#[test]
fn keyhole_with_four_holes_at_one_corner_is_opened() {
    for turn in [
        DMat3::IDENTITY,
        DMat3::from_rotation_x(1.0) * DMat3::from_rotation_z(0.3),
    ] {
        let corner = dvec3(0.0, 0.0, 0.0);
        let mut vertices = vec![corner];
        for x in [9.1, 6.2, 3.3, 0.4] {
            let hole = [[x, 1.0], [x + 2.5, 1.0], [x + 2.5, 2.8], [x, 2.8], [x, 1.0]];
            // The outline runs clockwise here, so the wall faces away.
            vertices.extend(hole.map(|[x, y]| dvec3(x, y, 0.0)));
            vertices.push(corner);
        }
        vertices.extend([[0.0, 3.0], [12.0, 3.0], [12.0, 0.0]].map(|[x, y]| dvec3(x, y, 0.0)));
        let mut wall = surface("wall", "lamp", &[]);
        wall.vertices = vertices.into_iter().map(|v| turn * v).collect();
        let built = build(vec![wall]);
        assert_eq!(kinds(&built.warnings), ["keyhole"]);
        let face = &built.scene.faces[0];
        assert_eq!((face.outline.len(), face.holes.len()), (4, 4));
        assert!((built.scene.frame.area_to_file(face.area) - 18.0).abs() < 1e-12);
        assert!(face.normal.dot(turn * DVec3::Z) < -0.999_999);
        let chart = built.scene.chart(FaceId(0));
        let loops = built.scene.loops_in_chart(FaceId(0), &chart);
        let turns: Vec<bool> = loops
            .iter()
            .map(|l| antumbra_geom::signed_area(l) > 0.0)
            .collect();
        assert_eq!(turns, [true, false, false, false, false]);
    }
}

#[test]
fn holes_may_touch_the_outline_in_a_corner_but_not_run_along_it() {
    let with_hole = |hole: &[[f64; 2]]| {
        let mut wall = rectangle("wall", "lamp", [0.0, 0.0, 4.0, 3.0], 0.0);
        wall.holes = vec![hole.iter().map(|p| dvec3(p[0], p[1], 0.0)).collect()];
        wall
    };
    let touching = build(vec![with_hole(&[[2.0, 0.0], [3.0, 1.0], [1.0, 1.0]])]);
    let face = &touching.scene.faces[0];
    assert_eq!((face.outline.len(), face.holes.len()), (5, 1));
    assert_eq!(touching.scene.frame.area_to_file(face.area), 11.0);

    let door = errors(vec![with_hole(&[
        [1.0, 0.0],
        [2.0, 0.0],
        [2.0, 2.0],
        [1.0, 2.0],
    ])]);
    assert_eq!(kinds(&door), ["hole"]);
    let nested = {
        let mut wall = with_hole(&[[1.0, 1.0], [3.0, 1.0], [3.0, 2.0], [1.0, 2.0]]);
        wall.holes.push(vec![
            dvec3(1.5, 1.2, 0.0),
            dvec3(2.0, 1.2, 0.0),
            dvec3(2.0, 1.5, 0.0),
        ]);
        errors(vec![wall])
    };
    assert_eq!(kinds(&nested), ["hole"]);
}

#[test]
fn warp_is_ignored_split_or_refused_by_its_size() {
    let warped = |lift: f64| {
        let mut quad = rectangle("quad", "lamp", [0.0, 0.0, 1.0, 1.0], 0.0);
        quad.vertices[2].z = lift;
        quad
    };
    for (lift, n_faces, said) in [(1e-12, 1, vec![]), (4e-3, 2, vec!["non-planar"])] {
        let built = build(vec![warped(lift)]);
        assert_eq!(built.scene.faces.len(), n_faces);
        assert_eq!(kinds(&built.warnings), said);
    }
    let problems = errors(vec![warped(0.1)]);
    assert_eq!(kinds(&problems), ["non-planar"]);
    assert!(problems[0].message.contains("'quad'") && problems[0].message.contains("2e-3"));
}

#[test]
fn what_has_no_area_is_dropped_and_keeps_its_place() {
    let mut floor = rectangle("floor", "lamp", [0.0, 0.0, 1.0, 1.0], 0.0);
    floor.vertices.insert(1, dvec3(0.5, 0.0, 0.0));
    floor.vertices.insert(1, dvec3(0.5, 0.0, 0.0));
    let line = surface(
        "line",
        "white",
        &[[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]],
    );
    let back = surface(
        "spike",
        "white",
        &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
    );
    let built = build(vec![line, floor, back]);
    assert_eq!(
        kinds(&built.warnings),
        ["zero-area", "repeated-vertices", "zero-area"]
    );
    assert!(
        built.warnings[1]
            .message
            .contains("1 repeated and 1 collinear vertices")
    );
    assert_eq!(built.scene.surfaces.len(), 3);
    assert!(built.scene.surfaces[0].faces.is_empty());
    assert_eq!(built.scene.faces[0].outline.len(), 4);
    assert_eq!(built.scene.vertices.len(), 4);
}

#[test]
fn all_problems_are_reported_in_the_order_of_the_surfaces() {
    let mut input = scene(vec![
        surface("two", "white", &[[0.0; 3], [1.0, 0.0, 0.0]]),
        surface(
            "gone",
            "gold",
            &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        ),
        surface(
            "nan",
            "white",
            &[[0.0; 3], [f64::NAN, 0.0, 0.0], [0.0, 1.0, 0.0]],
        ),
        surface(
            "bow",
            "white",
            &[[0.0; 3], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        ),
        surface(
            "two",
            "white",
            &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        ),
    ]);
    input.materials[0].reflectance = vec![1.0];
    input.materials[2].exitance = vec![1.0, 2.0];
    input.materials[1].exitance = vec![1.0, 2.0, 3.0];
    let problems = Scene::build(&input).unwrap_err();
    assert_eq!(
        kinds(&problems),
        [
            "bands",
            "material",
            "duplicate-name",
            "too-few-vertices",
            "unknown-material",
            "non-finite",
            "self-intersecting"
        ]
    );
    assert!(problems[1].message.contains("'white'") && problems[1].message.contains("'nan'"));
    assert_eq!(
        kinds(&Scene::build(&scene(Vec::new())).unwrap_err()),
        ["no-surfaces"]
    );
}

#[test]
fn two_sided_surface_has_fronts_then_backs() {
    let mut plate = rectangle("plate", "plate", [0.0, 0.0, 1.0, 1.0], 0.5);
    plate.holes = vec![vec![
        dvec3(0.2, 0.2, 0.5),
        dvec3(0.4, 0.2, 0.5),
        dvec3(0.4, 0.4, 0.5),
    ]];
    let scene = build(vec![plate]).scene;
    let [front, back] = &scene.faces[..] else {
        panic!("two faces expected")
    };
    assert!(!front.is_back && back.is_back);
    assert_eq!((front.normal, back.normal), (DVec3::Z, -DVec3::Z));
    assert_eq!(front.plane, back.plane);
    for f in scene.face_ids() {
        let chart = scene.chart(f);
        let loops = scene.loops_in_chart(f, &chart);
        assert!(antumbra_geom::signed_area(&loops[0]) > 0.0);
        assert!(antumbra_geom::signed_area(&loops[1]) < 0.0);
        let pieces = scene.face(f).pieces.clone();
        let area: f64 = scene.pieces[pieces.start as usize..pieces.end as usize]
            .iter()
            .map(|p| {
                let flat: Vec<_> = scene
                    .positions(&p.vertices)
                    .iter()
                    .map(|&x| chart.to_chart(x))
                    .collect();
                antumbra_geom::signed_area(&flat)
            })
            .sum();
        assert!((area - scene.face(f).area).abs() < 1e-15);
    }
    assert!(scene.edges.iter().all(|e| e.faces == [FaceId(0)]));
    assert_eq!(
        scene.tree.len(),
        (front.pieces.end - front.pieces.start) as usize
    );
}

#[test]
fn report_counts_gaps_and_t_vertices() {
    // One long rectangle against two short ones: one vertex inside its edge.
    let scene = build(vec![
        rectangle("long", "lamp", [0.0, 0.0, 2.0, 1.0], 0.0),
        rectangle("left", "white", [0.0, 1.0, 1.0, 2.0], 0.0),
        rectangle("right", "white", [1.0, 1.0, 2.0, 2.0], 0.0),
    ])
    .scene;
    let report = scene.report();
    assert_eq!(
        (report.t_vertices, report.emitters, report.planes),
        (1, 1, 1)
    );
    assert_eq!(
        (report.edges, report.open_edges, report.closed),
        (11, 10, false)
    );
    assert_eq!(report.extent, dvec3(2.0, 2.0, 0.0));
    assert_eq!((report.area, report.area_square_metres), (4.0, 4.0));

    // A cube whose lid is two halves is closed all the same.
    let mut cube = Vec::new();
    push_box(
        &mut cube,
        DVec3::ZERO,
        DVec3::ONE,
        DMat3::from_rotation_y(0.3),
    );
    let lid = cube.remove(1);
    let [a, b, c, d] = lid.vertices[..] else {
        panic!("four corners expected")
    };
    let (ab, cd) = (a.midpoint(b), c.midpoint(d));
    for (name, vertices) in [("lid.1", vec![a, ab, cd, d]), ("lid.2", vec![ab, b, c, cd])] {
        cube.push(SurfaceInput {
            name: name.to_owned(),
            vertices,
            ..lid.clone()
        });
    }
    let report = build(cube).scene.report();
    assert_eq!((report.t_vertices, report.closed), (2, true));
}

#[test]
fn points_are_found_on_their_face() {
    let mut quad = rectangle("quad", "lamp", [0.0, 0.0, 1.0, 1.0], 0.0);
    quad.vertices[2].z = 4e-3;
    let scene = build(vec![
        quad,
        rectangle("roof", "plate", [0.0, 0.0, 1.0, 1.0], 2.0),
    ])
    .scene;
    let [quad, roof] = ["quad", "roof"].map(|name| scene.surface_named(name).unwrap());
    let at = |x: f64, y: f64, z: f64| scene.frame.to_scene(dvec3(x, y, z));
    let face = scene.face_containing(roof, at(0.3, 0.4, 2.0)).unwrap();
    assert!(!scene.face(face).is_back);
    assert_eq!(
        scene.face_containing(roof, at(1.0 + 1e-12, 0.5, 2.0)),
        Some(face)
    );
    assert_eq!(scene.face_containing(roof, at(1.0 + 1e-6, 0.5, 2.0)), None);
    assert_eq!(scene.face_containing(roof, at(0.3, 0.4, 2.1)), None);
    let corner = scene.face_containing(quad, at(0.0, 0.0, 0.0));
    assert!(corner.is_some());
}
