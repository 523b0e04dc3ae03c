//! Every writer, on a small mesh: what it writes is read back and counted.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use antumbra_geom::{DVec3, dvec2, dvec3};
use antumbra_io::model::{Curve, CurveEdge, Field, MeshedScene, SurfaceMesh};
use antumbra_io::picture::{Band, PictureOptions, Side, View, render, write_png};
use antumbra_io::write;

const TEXT_OF: &str = "a \"floor\", <large> & -- odd";

/// Two elements of one degree on the unit square at a height, bands `n_bands`.
fn square(name: &str, z: f64, degree: u8, n_bands: usize) -> SurfaceMesh {
    let p = usize::from(degree);
    let mut surface = SurfaceMesh {
        name: name.to_owned(),
        normal: DVec3::Z,
        degree,
        loops: vec![vec![
            dvec3(0.0, 0.0, z),
            dvec3(1.0, 0.0, z),
            dvec3(1.0, 1.0, z),
            dvec3(0.0, 1.0, z),
        ]],
        ..SurfaceMesh::default()
    };
    // Nodes on a grid, row by row; the diagonal belongs to both elements.
    let mut values = Vec::new();
    for j in 0..=p {
        for i in 0..=p {
            let (x, y) = (i as f64 / p as f64, j as f64 / p as f64);
            surface.nodes.push(dvec3(x, y, z));
            surface.nodes_2d.push(dvec2(x, y));
            values.extend((0..n_bands).map(|b| x * x + 0.1 * y + b as f64));
        }
    }
    for corners in [[[0, 0], [p, 0], [p, p]], [[0, 0], [p, p], [0, p]]] {
        for lattice in vtk_lattice(p) {
            let [i, j] = [0, 1].map(|axis| {
                let sum: usize = (0..3).map(|k| corners[k][axis] * lattice[k]).sum();
                sum / p
            });
            surface.elements.push((j * (p + 1) + i) as u32);
        }
    }
    let last = ((p + 1) * (p + 1) - 1) as u32;
    surface.element_errors = vec![1e-4, 2e-4];
    surface.fields = vec![Field {
        name: "direct".to_owned(),
        values,
    }];
    surface.curves = vec![Curve {
        kind: "ve".to_owned(),
        order: "d1".to_owned(),
        emitter: Some("lamp".to_owned()),
        generators: TEXT_OF.to_owned(),
        points: vec![dvec3(0.0, 0.0, z), dvec3(1.0, 1.0, z)],
    }];
    surface.curve_edges = vec![CurveEdge {
        ends: [0, last],
        curves: vec![0],
    }];
    surface
}

fn vtk_lattice(p: usize) -> Vec<[usize; 3]> {
    let mut nodes = vec![[p, 0, 0], [0, p, 0], [0, 0, p]];
    nodes.extend((1..p).map(|k| [p - k, k, 0]));
    nodes.extend((1..p).map(|k| [0, p - k, k]));
    nodes.extend((1..p).map(|k| [k, 0, p - k]));
    match p {
        3 => nodes.push([1, 1, 1]),
        4 => nodes.extend([[2, 1, 1], [1, 2, 1], [1, 1, 2]]),
        _ => {}
    }
    nodes
}

fn scene(degree: u8, n_bands: usize) -> MeshedScene {
    MeshedScene {
        length_unit: "m".to_owned(),
        unit: "W/m²".to_owned(),
        n_bands,
        surfaces: vec![
            square(TEXT_OF, 0.0, degree, n_bands),
            square("shelf", 0.1 + 0.2, degree, n_bands),
        ],
        provenance: "antumbra mesh room.json --json".to_owned(),
    }
}

fn scenes() -> impl Iterator<Item = (u8, MeshedScene)> {
    [(1, 1), (2, 3), (3, 1), (4, 2)]
        .into_iter()
        .map(|(p, n)| (p, scene(p, n)))
}

fn bytes(write: impl Fn(&mut Vec<u8>) -> std::io::Result<()>) -> Vec<u8> {
    let (mut once, mut again) = (Vec::new(), Vec::new());
    write(&mut once).unwrap();
    write(&mut again).unwrap();
    assert_eq!(once, again, "the same scene gives the same bytes");
    once
}

fn text(write: impl Fn(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let text = String::from_utf8(bytes(write)).unwrap();
    let is_not_a_number = |word: &str| ["nan", "inf"].contains(&word.to_lowercase().as_str());
    assert!(
        !text
            .split(|c: char| !c.is_alphanumeric())
            .any(is_not_a_number)
    );
    text
}

#[test]
fn obj_has_every_node_and_degree_squared_triangles_per_element() {
    for (p, scene) in scenes() {
        let obj = text(|out| write::obj::write(&scene, out));
        let p = usize::from(p);
        let rows = |key: &str| obj.lines().filter(|l| l.starts_with(key)).count();
        assert_eq!(rows("v "), 2 * (p + 1) * (p + 1));
        assert_eq!(rows("f "), 2 * 2 * p * p);
        assert_eq!(rows("o "), 2);
        assert!(obj.contains("W/m²"));
        assert!(obj.contains(" 0.30000000000000004 "));
        for line in obj.lines().filter_map(|l| l.strip_prefix("f ")) {
            for index in line.split(' ') {
                assert!((1..=rows("v ")).contains(&index.parse().unwrap()));
            }
        }
    }
}

#[test]
fn ply_is_as_long_as_its_header_says() {
    for (p, scene) in scenes() {
        let ply = bytes(|out| write::ply::write(&scene, out));
        let end = b"end_header\n";
        let start = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = std::str::from_utf8(&ply[..start]).unwrap();
        assert!(header.is_ascii() && header.contains("comment unit W/m^2"));
        let p = usize::from(p);
        let (n_nodes, n_faces) = (2 * (p + 1) * (p + 1), 4 * p * p);
        assert!(header.contains(&format!("element vertex {n_nodes}\n")));
        assert!(header.contains(&format!("element face {n_faces}\n")));
        assert_eq!(
            header.contains("property double direct_1"),
            scene.n_bands > 1
        );
        let body = n_nodes * 8 * (3 + scene.n_bands) + n_faces * (1 + 3 * 4 + 4);
        assert_eq!(ply.len() - start, body);
    }
}

#[test]
fn vtu_is_well_formed_and_its_arrays_are_as_long_as_they_say() {
    for (p, scene) in scenes() {
        let vtu = text(|out| write::vtu::write(&scene, out));
        assert_well_formed(&vtu);
        let pieces: Vec<&str> = vtu.split("<Piece ").skip(1).collect();
        assert_eq!(pieces.len(), 2);
        let p = usize::from(p);
        let per_element = (p + 1) * (p + 2) / 2;
        let elements = (2 * (p + 1) * (p + 1), 4, 4 * per_element);
        let lines = (4, 2, 4);
        for (piece, (n_points, n_cells, n_connectivity)) in
            pieces.into_iter().zip([elements, lines])
        {
            let arrays = arrays(piece);
            let expected = [
                ("direct", n_points * 8 * scene.n_bands),
                ("surface", n_cells * 4),
                ("degree", n_cells * 4),
                ("element_error", n_cells * 8),
                ("curve_kind", n_cells * 4),
                ("curve_order", n_cells * 4),
                ("curve_count", n_cells * 4),
                ("Points", n_points * 24),
                ("connectivity", n_connectivity * 8),
                ("offsets", n_cells * 8),
                ("types", n_cells),
            ];
            assert_eq!(arrays.len(), expected.len());
            for ((name, data), (expected_name, length)) in arrays.iter().zip(expected) {
                assert_eq!((name.as_str(), data.len()), (expected_name, length));
            }
        }
        let first = arrays(vtu.split("<Piece ").nth(1).unwrap());
        let types = &first.last().unwrap().1;
        assert_eq!(types[0], [5, 22, 69, 69][p - 1]);
    }
}

/// Names and decoded data of the arrays of a piece.
fn arrays(piece: &str) -> Vec<(String, Vec<u8>)> {
    let parse = |array: &str| {
        let name = array
            .split("Name=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        let base64 = array.split_once('>').unwrap().1.split('<').next().unwrap();
        let data = decoded(base64.trim());
        let (length, data) = data.split_at(8);
        let length = u64::from_le_bytes(length.try_into().unwrap());
        assert_eq!(length, data.len() as u64);
        (name.to_owned(), data.to_vec())
    };
    piece.split("<DataArray ").skip(1).map(parse).collect()
}

fn decoded(base64: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("{c} is not a digit"),
    };
    assert_eq!(base64.len() % 4, 0);
    let (mut word, mut n_bits, mut data) = (0_u32, 0, Vec::new());
    for c in base64.trim_end_matches('=').bytes() {
        word = word << 6 | u32::from(digit(c));
        n_bits += 6;
        if n_bits >= 8 {
            n_bits -= 8;
            data.push((word >> n_bits & 0xff) as u8);
        }
    }
    data
}

/// Tags match, attributes are quoted, comments hold no two hyphens.
fn assert_well_formed(xml: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        assert!(!rest[..start].contains('>'));
        rest = &rest[start + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            let end = comment.find("--").unwrap();
            assert!(comment[end..].starts_with("-->"));
            rest = &comment[end + 3..];
            continue;
        }
        let (tag, after) = rest.split_once('>').unwrap();
        rest = after;
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') && !tag.starts_with('?') {
            open.push(tag.split([' ', '\n']).next().unwrap());
        }
    }
    assert!(open.is_empty());
}

#[test]
fn json_holds_everything() {
    for (p, scene) in scenes() {
        let json = text(|out| write::json::write(&scene, out));
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["antumbra_mesh"], 1);
        assert_eq!(json["unit"], "W/m²");
        let surface = &json["surfaces"][0];
        assert_eq!(surface["name"], TEXT_OF);
        let p = usize::from(p);
        assert_eq!(
            surface["nodes"].as_array().unwrap().len(),
            (p + 1) * (p + 1)
        );
        let direct = surface["fields"]["direct"].as_array().unwrap();
        assert_eq!(direct.len(), (p + 1) * (p + 1));
        assert_eq!(direct[0].as_array().unwrap().len(), scene.n_bands);
        let element = &surface["elements"][1];
        assert_eq!(element["degree"], p);
        assert_eq!(element["error"], 2e-4);
        assert_eq!(
            element["nodes"].as_array().unwrap().len(),
            (p + 1) * (p + 2) / 2
        );
        assert_eq!(surface["constraint_edges"][0]["curves"][0], 0);
        assert_eq!(surface["curves"][0]["generators"], TEXT_OF);
        assert_eq!(json["surfaces"][1]["nodes"][0][2], 0.1 + 0.2);
    }
}

#[test]
fn csv_has_a_row_per_node_and_a_column_per_band() {
    let scene = scene(2, 3);
    let csv = text(|out| write::csv::write(&scene, out));
    let mut lines = csv.lines();
    assert_eq!(
        lines.next(),
        Some("surface,part,x,y,z,direct_0,direct_1,direct_2")
    );
    assert_eq!(lines.clone().count(), 2 * 9);
    assert!(csv.contains("\"a \"\"floor\"\", <large> & -- odd\",0,0.5,0.0,0.0,0.25,1.25,2.25"));
}

#[test]
fn svg_is_well_formed_and_says_what_made_a_curve() {
    for (_, mut scene) in scenes() {
        scene.surfaces[1].curve_edges.clear();
        let one = text(|out| write::svg::write_surface(&scene.surfaces[0], &scene, out));
        let all = text(|out| write::svg::write_all(&scene, out));
        for svg in [&one, &all] {
            assert_well_formed(svg);
            assert!(svg.contains("<title>ve d1: a &quot;floor&quot;, &lt;large&gt; &amp; -- odd (emitter lamp)</title>"));
            assert!(svg.contains("ve, d1: slope jumps"));
        }
        assert!(all.contains(">shelf</text>") && !one.contains("shelf"));
    }
}

#[test]
fn values_that_are_not_finite_never_become_text() {
    let mut scene = scene(2, 1);
    for value in &mut scene.surfaces[0].fields[0].values {
        *value = f64::NAN;
    }
    scene.surfaces[1].fields[0].values[3] = f64::INFINITY;
    scene.surfaces[0].element_errors[0] = f64::NAN;
    let texts = [
        text(|out| write::obj::write(&scene, out)),
        text(|out| write::json::write(&scene, out)),
        text(|out| write::csv::write(&scene, out)),
        text(|out| write::svg::write_all(&scene, out)),
    ];
    assert!(texts.iter().all(|t| !t.is_empty()));
    let _ = render(&scene, &small());
}

#[test]
fn mesh_that_does_not_fit_together_is_refused_before_the_first_byte() {
    let mut scene = scene(2, 1);
    scene.surfaces[1].elements[4] = 99;
    let mut out = Vec::new();
    let error = write::vtu::write(&scene, &mut out).unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::InvalidData);
    assert_eq!(
        error.to_string(),
        "mesh of surface 1 (shelf): an element has node 99 of 9"
    );
    assert!(out.is_empty());
}

#[test]
fn parts_and_backs_are_told_apart() {
    let mut scene = scene(1, 1);
    let mut part = scene.surfaces[1].clone();
    part.part = 1;
    part.is_back = true;
    scene.surfaces.push(part);
    let obj = text(|out| write::obj::write(&scene, out));
    assert!(obj.contains("o shelf.0\n") && obj.contains("o shelf.1.back\n"));
}

fn small() -> PictureOptions {
    PictureOptions {
        width: 320,
        height: 200,
        ..PictureOptions::default()
    }
}

#[test]
fn png_has_the_size_asked_for_and_a_legend() {
    for (_, scene) in scenes() {
        let picture = render(&scene, &small());
        assert_eq!(picture, render(&scene, &small()));
        assert_eq!(picture.rgb.len(), 320 * 200 * 3);
        // On the right, the colour bar goes from dark blue to yellow.
        let right =
            |y: usize| (y * 320 + 245..(y + 1) * 320).map(|i| &picture.rgb[3 * i..3 * i + 3]);
        let has = |color: [u8; 3]| (0..200).any(|y| right(y).any(|rgb| near(rgb, color)));
        assert!(has([0x44, 0x01, 0x54]) && has([0xfd, 0xe7, 0x25]) && has([0x1f, 0x9e, 0x89]));

        let png = bytes(|out| write_png(&picture, out));
        let decoder = png::Decoder::new(std::io::Cursor::new(png));
        let reader = decoder.read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (320, 200));
    }
}

fn near(rgb: &[u8], color: [u8; 3]) -> bool {
    rgb.iter().zip(color).all(|(&a, b)| a.abs_diff(b) < 12)
}

#[test]
fn map_of_a_surface_shows_the_polynomial_not_its_corners() {
    let mut scene = scene(2, 1);
    scene.surfaces.truncate(1);
    // One at the middle of an edge, zero at all corners.
    let surface = &mut scene.surfaces[0];
    let values = surface.nodes_2d.iter().map(|p| 4.0 * p.x * (1.0 - p.x));
    surface.fields[0].values = values.collect();
    let options = PictureOptions {
        view: View::Surface(TEXT_OF.to_owned()),
        scale: Some((0.0, 1.0)),
        isolux: false,
        ..small()
    };
    let picture = render(&scene, &options);
    let n_yellow = picture
        .rgb
        .chunks(3)
        .filter(|rgb| near(rgb, [0xfd, 0xe7, 0x25]))
        .count();
    assert!(n_yellow > 300, "{n_yellow}");
}

#[test]
fn every_view_and_option_gives_a_picture() {
    let scene = scene(3, 2);
    let sides = [
        Side::Front,
        Side::Back,
        Side::Left,
        Side::Right,
        Side::Top,
        Side::Bottom,
    ];
    let camera = View::Camera {
        eye: dvec3(0.5, 0.5, 0.4),
        target: dvec3(1.0, 0.5, 0.2),
        up: DVec3::Z,
        fov_deg: 60.0,
    };
    let views = sides
        .map(View::Named)
        .into_iter()
        .chain([View::Auto, camera]);
    for view in views {
        let options = PictureOptions {
            mesh: true,
            curves: true,
            band: Band::Index(1),
            view,
            ..small()
        };
        options.check(&scene).unwrap();
        let _ = render(&scene, &options);
    }
    for (width, height) in [(0, 0), (1, 1), (7, 900), (900, 3)] {
        let picture = render(
            &scene,
            &PictureOptions {
                width,
                height,
                ..small()
            },
        );
        assert_eq!(picture.rgb.len(), picture.width * picture.height * 3);
    }
    let _ = render(&MeshedScene::default(), &small());
}

#[test]
fn picture_that_cannot_be_is_said_to_be_so() {
    let scene = scene(1, 1);
    let asks = [
        PictureOptions {
            view: View::Surface("roof".to_owned()),
            ..small()
        },
        PictureOptions {
            field: Some("colour".to_owned()),
            ..small()
        },
        PictureOptions {
            band: Band::Index(1),
            ..small()
        },
    ];
    let problems = asks.map(|options| options.check(&scene).unwrap_err().to_string());
    assert_eq!(
        problems,
        [
            "no surface is named roof",
            "no surface has a field colour",
            "no band 1 of 1"
        ]
    );
}

/// The surface of [`square`] as one quadrilateral with the same nodes.
fn as_quadrilateral(mut surface: SurfaceMesh) -> SurfaceMesh {
    let p = usize::from(surface.degree);
    let mut lattice = vec![[0, 0], [p, 0], [p, p], [0, p]];
    // Edges 0–1, 1–2, 3–2 and 0–3, then inside row by row.
    lattice.extend((1..p).map(|i| [i, 0]));
    lattice.extend((1..p).map(|i| [p, i]));
    lattice.extend((1..p).map(|i| [i, p]));
    lattice.extend((1..p).map(|i| [0, i]));
    lattice.extend((1..p).flat_map(|j| (1..p).map(move |i| [i, j])));
    let node = |[i, j]: [usize; 2]| (j * (p + 1) + i) as u32;
    surface.quads = lattice.into_iter().map(node).collect();
    surface.elements = Vec::new();
    surface.element_errors = vec![1e-4];
    surface
}

#[test]
fn a_quadrilateral_shows_the_polynomial_that_two_triangles_show() {
    for degree in 2..=4 {
        let pictures = [false, true].map(|is_quad| {
            let mut surface = square("floor", 0.0, degree, 1);
            if is_quad {
                surface = as_quadrilateral(surface);
            }
            let scene = MeshedScene {
                n_bands: 1,
                surfaces: vec![surface],
                ..MeshedScene::default()
            };
            let options = PictureOptions {
                width: 120,
                height: 100,
                view: View::Surface("floor".to_owned()),
                ..PictureOptions::default()
            };
            render(&scene, &options).rgb
        });
        let differences = pictures[0].iter().zip(&pictures[1]);
        let worst = differences.map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(2), "degree {degree}: {worst:?}");
    }
}

#[test]
fn quadrilaterals_are_in_every_format() {
    for degree in 1..=4 {
        let surface = as_quadrilateral(square("floor", 0.0, degree, 1));
        let scene = MeshedScene {
            n_bands: 1,
            surfaces: vec![surface],
            ..MeshedScene::default()
        };
        let mut obj = Vec::new();
        write::obj::write(&scene, &mut obj).unwrap();
        let n_faces = String::from_utf8(obj).unwrap().matches("\nf ").count();
        assert_eq!(n_faces, 2 * usize::from(degree).pow(2));
        let mut json = Vec::new();
        write::json::write(&scene, &mut json).unwrap();
        assert!(
            String::from_utf8(json)
                .unwrap()
                .contains(r#""shape":"quadrilateral""#)
        );
        let mut ply = Vec::new();
        write::ply::write(&scene, &mut ply).unwrap();
        let header = format!("element face {n_faces}\n");
        assert!(String::from_utf8_lossy(&ply).contains(&header));
        let mut svg = Vec::new();
        write::svg::write_all(&scene, &mut svg).unwrap();
        // Four sides.
        let svg = String::from_utf8(svg).unwrap();
        let mesh = svg
            .split("class=\"mesh\"")
            .nth(1)
            .unwrap()
            .split("/>")
            .next();
        assert_eq!(mesh.unwrap().matches('M').count(), 4);
    }
}
