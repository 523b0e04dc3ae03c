//! glTF and STL: triangles of others become polygons, or are refused with a clear
//! word, whatever the bytes.

use antumbra_io::{ReadError, gltf, stl};
use antumbra_scene::{LengthUnit, Quantity, Scene, SceneInput, SurfaceInput};
use glam::{DVec3, dvec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::PI;
use std::path::PathBuf;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(fixture(name)).expect("the fixture exists")
}

/// Reads a fixture by its extension, with side files beside it.
fn read(name: &str) -> Result<SceneInput, ReadError> {
    if name.ends_with(".stl") {
        return stl::read(&bytes(name), LengthUnit::Metre);
    }
    let mut load =
        |side: &str| std::fs::read(fixture(name).with_file_name(side)).map_err(|e| e.to_string());
    gltf::read(&bytes(name), &mut load, LengthUnit::Metre)
}

fn warnings(scene: &SceneInput) -> Vec<String> {
    let built = Scene::build(scene).unwrap_or_else(|problems| panic!("{problems:?}"));
    built.warnings.into_iter().map(|p| p.message).collect()
}

fn names(scene: &SceneInput) -> Vec<&str> {
    scene.surfaces.iter().map(|s| s.name.as_str()).collect()
}

fn normal(surface: &SurfaceInput) -> DVec3 {
    let p = &surface.vertices;
    (1..p.len() - 1)
        .map(|i| (p[i] - p[0]).cross(p[i + 1] - p[0]))
        .sum::<DVec3>()
        .normalize_or_zero()
}

const NO_EMITTER: &str = "no surface emits: the irradiance is zero everywhere";

#[test]
fn box_is_six_quadrilaterals_as_text_and_binary() {
    let text = read("real/gltf-box/Box.gltf").unwrap();
    let binary = read("real/gltf-box/Box.glb").unwrap();
    assert_eq!(text, binary);
    assert_eq!(text.quantity, Quantity::Photometric);
    assert_eq!(
        names(&text),
        ["Mesh.1", "Mesh.2", "Mesh.3", "Mesh.4", "Mesh.5", "Mesh.6"]
    );
    assert!(text.surfaces.iter().all(|s| s.vertices.len() == 4));
    assert_eq!(text.materials[0].name, "Red");
    assert_eq!(text.materials[0].reflectance, [0.800000011920929, 0.0, 0.0]);
    assert_eq!(text.notes, ["12 triangles merged into 6 polygons"]);
    // The matrix of the root turns z up into y up: the first face looks up.
    assert_eq!(normal(&text.surfaces[0]), DVec3::Y);
    assert_eq!(warnings(&text), [NO_EMITTER]);
    let scene = Scene::build(&text).unwrap().scene;
    assert!(scene.report().closed);
}

#[test]
fn cornell_box_of_bevy_is_nineteen_polygons_that_touch() {
    let scene = read("real/cornell-bevy/CornellBox.glb").unwrap();
    assert_eq!(scene.surfaces.len(), 19);
    assert_eq!(scene.surfaces[0].name, "Light");
    let light = &scene.materials[0];
    assert_eq!(light.exitance, [100.0 * PI; 3]);
    assert!(light.two_sided);
    assert_eq!(scene.materials[3].reflectance, [0.5, 0.0, 0.0]);
    // Only the red wall, off its plane in the original, stays two triangles.
    let n: Vec<usize> = scene.surfaces.iter().map(|s| s.vertices.len()).collect();
    assert_eq!(n.iter().filter(|n| **n == 3).count(), 2);
    assert_eq!(n.iter().filter(|n| **n == 4).count(), 17);
    let said = warnings(&scene);
    // The boxes have bottoms, and they lie in the floor exactly.
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said.iter().all(|m| m.contains("overlaps")), "{said:?}");
    assert_eq!(Scene::build(&scene).unwrap().scene.planes.len(), 17);
}

#[test]
fn tile_room_keeps_what_its_texture_hides() {
    let scene = read("real/r3l-tile-room/tile-game-room6.glb").unwrap();
    assert!(
        scene.notes[0].starts_with("material 'Base' has a base colour texture"),
        "{:?}",
        scene.notes
    );
    assert_eq!(scene.notes[1], "88 triangles merged into 31 polygons");
    assert_eq!(scene.materials[0].reflectance, [0.5]);
    // Eight triangles whose long edges meet two short ones: a sheet with a window.
    let cover = scene.surfaces.last().unwrap();
    assert_eq!(cover.name, "Cover");
    assert_eq!((cover.vertices.len(), cover.holes.len()), (4, 1));
    assert_eq!(cover.holes[0].len(), 4);
    Scene::build(&scene).unwrap();
}

#[test]
fn cube_of_stl_is_six_squares() {
    let scene = read("real/sparrowpy-cube/cube.stl").unwrap();
    assert_eq!(scene.surfaces.len(), 6);
    assert!(scene.surfaces.iter().all(|s| s.vertices.len() == 4));
    assert!(scene.notes[0].starts_with("12 triangles without a material"));
    assert_eq!(warnings(&scene), [NO_EMITTER]);
    let scene = Scene::build(&scene).unwrap().scene;
    assert!(scene.report().closed);
}

#[test]
fn stl_is_binary_by_its_length_and_text_by_its_words() {
    let scene = read("stl/begins-with-solid.stl").unwrap();
    assert_eq!(names(&scene), ["surface.1"]);
    let scene = read("stl/two-solids.stl").unwrap();
    assert_eq!(names(&scene), ["floor", "the ceiling"]);
    assert_eq!(normal(&scene.surfaces[1]), DVec3::NEG_Z);
    assert!(scene.notes[1].starts_with("2 triangles with a normal against"));
}

#[test]
fn hostile_files_are_refused_with_what_is_wrong() {
    for (name, said) in [
        (
            "gltf/bad-base64.gltf",
            "buffer 0: its data URI is not base64",
        ),
        (
            "gltf/buffer-too-short.gltf",
            "buffer 0 has 60 bytes, 1000 are needed",
        ),
        (
            "gltf/chunk-beyond-file.glb",
            "byte 12: a chunk of 2147483647 bytes",
        ),
        (
            "gltf/container-version-1.glb",
            "this is glTF 1.0, as a binary file; only 2.0 is read",
        ),
        (
            "gltf/flat-positions.gltf",
            "mesh 0 ('floor'): its positions is VEC2",
        ),
        (
            "gltf/float-indices.gltf",
            "component type 5126 (allowed SCALAR",
        ),
        (
            "gltf/header-only.glb",
            "byte 8: the file ends within a header",
        ),
        (
            "gltf/huge-counts.gltf",
            "4294967295 elements every 12 bytes",
        ),
        ("gltf/huge-scale.gltf", "in the scene (allowed up to 1e100)"),
        (
            "gltf/huge-stride.gltf",
            "4 elements every 9223372036854775807 bytes",
        ),
        (
            "gltf/index-out-of-range.gltf",
            "its indices: vertex 9, but there are 4",
        ),
        (
            "gltf/length-below-12.glb",
            "its header says 5: it is not whole",
        ),
        ("gltf/lines-only.gltf", "there is no triangle in its scene"),
        (
            "gltf/missing-accessor.gltf",
            "accessor 7, but the file has 2",
        ),
        (
            "gltf/missing-buffer.gltf",
            "'nowhere else.bin' could not be read",
        ),
        (
            "gltf/missing-material.gltf",
            "material 3, but the file has 1",
        ),
        ("gltf/missing-node.gltf", "node 7, but the file has 1"),
        (
            "gltf/nan-position.gltf",
            "its positions: vertex 1 is (2, NaN, 0)",
        ),
        (
            "gltf/no-asset.gltf",
            "line 1, column 15: missing field `asset`",
        ),
        ("gltf/no-root.gltf", "nodes contain themselves"),
        (
            "gltf/node-cycle.gltf",
            "node 1 stands in two places or contains itself",
        ),
        ("gltf/not-json.gltf", "line 2, column 24"),
        (
            "gltf/not-triples.gltf",
            "4 corners are no number of triangles",
        ),
        (
            "gltf/projective-matrix.gltf",
            "node 0: its matrix ends in the row [1, 0, 0, 1]",
        ),
        (
            "gltf/remote-buffer.gltf",
            "lies at 'https://example.org/floor.bin'",
        ),
        (
            "gltf/required-extension.gltf",
            "requires 'KHR_draco_mesh_compression'",
        ),
        ("gltf/sparse-positions.gltf", "is a sparse accessor"),
        (
            "gltf/truncated.glb",
            "the file has 1000 bytes, its header says 1664",
        ),
        ("gltf/two-parents.gltf", "node 3 stands in two places"),
        (
            "gltf/unknown-mode.gltf",
            "primitive mode 9 (allowed 0 to 6)",
        ),
        (
            "gltf/view-beyond-buffer.gltf",
            "asks for 500 bytes from 48, but the buffer has 60",
        ),
        (
            "gltf/wrong-version.gltf",
            "this is glTF 1.0; only 2.0 is read",
        ),
        (
            "gltf/zero-rotation.gltf",
            "node 0: its rotation has the length 0",
        ),
        ("stl/empty.stl", "the file has 0 bytes"),
        (
            "stl/ends-in-facet.stl",
            "line 11: the file ends within a solid",
        ),
        (
            "stl/huge-count.stl",
            "4294967295 triangles, as byte 80 says, take 214748364834",
        ),
        (
            "stl/nan-binary.stl",
            "byte 170: triangle 2 has the corner (NaN, 1, 0)",
        ),
        (
            "stl/nan-text.stl",
            "line 13: 'nan' is not a finite coordinate",
        ),
        (
            "stl/no-endsolid.stl",
            "line 8: the file ends within a solid",
        ),
        ("stl/no-triangles-binary.stl", "there is no triangle in it"),
        ("stl/no-triangles.stl", "there is no triangle in it"),
        ("stl/short.stl", "the file has 3 bytes"),
        (
            "stl/truncated.stl",
            "the file has 164 bytes, but 2 triangles",
        ),
        (
            "stl/two-coordinates.stl",
            "line 5: a vertex with 2 coordinates",
        ),
        ("stl/two-corners.stl", "line 6: a facet with 2 corners"),
        (
            "stl/wrong-count.stl",
            "the file has 184 bytes, but 3 triangles",
        ),
        (
            "stl/wrong-word.stl",
            "line 3: 'inner loop' (allowed 'outer loop')",
        ),
    ] {
        let error = read(name).expect_err(name).to_string();
        assert!(error.contains(said), "{name}: {error}");
    }
}

/// A scene of nodes over one mesh: a square with z up and a triangle beside it.
fn document(change: impl Fn(&mut serde_json::Value)) -> Result<SceneInput, ReadError> {
    let text = String::from_utf8(bytes("gltf/square.gltf")).expect("JSON is UTF-8");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    change(&mut json);
    let mut none = |name: &str| Err(format!("no {name}"));
    gltf::read(json.to_string().as_bytes(), &mut none, LengthUnit::Metre)
}

#[test]
fn transforms_compose_and_mirrors_keep_the_front() {
    let scene = document(|json| {
        json["nodes"] = serde_json::json!([
            { "name": "hall", "children": [1, 2], "scale": [2, 2, 2], "translation": [10, 0, 0] },
            { "name": "floor", "mesh": 0, "translation": [0, 1, 0] },
            // Mirrored in x: without a turn of its corners its front would look down.
            { "name": "mirrored", "mesh": 0, "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,3,0,1] }
        ]);
    })
    .unwrap();
    assert_eq!(names(&scene), ["floor", "mirrored"]);
    let [floor, mirrored] = [&scene.surfaces[0], &scene.surfaces[1]];
    assert_eq!(floor.vertices[0], dvec3(10.0, 2.0, 0.0));
    assert_eq!(floor.vertices[1], dvec3(14.0, 2.0, 0.0));
    assert_eq!([normal(floor), normal(mirrored)], [DVec3::Y; 2]);
    assert!(mirrored.vertices.contains(&dvec3(6.0, 6.0, -2.0)));
}

#[test]
fn nodes_without_a_default_scene_start_at_the_roots() {
    let scene = document(|json| {
        json.as_object_mut().unwrap().remove("scene");
        json["nodes"] = serde_json::json!([
            { "mesh": 0, "rotation": [0, 0, 2, 0] },
            { "name": " ", "children": [0], "translation": [0, 5, 0] }
        ]);
    })
    .unwrap();
    // Neither node nor mesh has a name; half a turn about z, though of length 2.
    assert_eq!(names(&scene), ["surface.1"]);
    assert_eq!(normal(&scene.surfaces[0]), DVec3::NEG_Y);
    assert_eq!(scene.surfaces[0].vertices[1], dvec3(-2.0, 5.0, 0.0));
}

#[test]
fn strips_and_fans_keep_the_direction_of_all_triangles() {
    for (mode, indices) in [(5, [0u16, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let scene = document(|json| {
            let mut data: Vec<u8> = [[0f32, 0., 0.], [2., 0., 0.], [2., 0., -1.], [0., 0., -1.]]
                .as_flattened()
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect();
            data.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
            let hex: String = data.iter().map(|b| format!("%{b:02x}")).collect();
            json["buffers"] = serde_json::json!([
                { "byteLength": data.len(), "uri": format!("DATA:,{hex}") }
            ]);
            json["accessors"][1]["count"] = 4.into();
            json["bufferViews"][1]["byteLength"] = 8.into();
            json["meshes"][0]["primitives"][0]["mode"] = mode.into();
        })
        .unwrap();
        assert_eq!(scene.surfaces.len(), 1, "mode {mode}");
        assert_eq!(scene.surfaces[0].vertices.len(), 4);
        assert_eq!(normal(&scene.surfaces[0]), DVec3::Y);
    }
}

#[test]
fn quantised_positions_are_numbers_or_fractions() {
    for (normalized, far) in [(false, 127.0), (true, 1.0)] {
        let scene = document(|json| {
            json["buffers"] = serde_json::json!([
                { "byteLength": 12, "uri": "data:,%00%00%00%00%7f%00%00%00%00%81%00%00" }
            ]);
            json["bufferViews"] = serde_json::json!([
                { "buffer": 0, "byteLength": 12, "byteStride": 4 }
            ]);
            json["accessors"] = serde_json::json!([{
                "bufferView": 0, "componentType": 5120, "count": 3, "type": "VEC3",
                "normalized": normalized
            }]);
            json["meshes"][0]["primitives"][0] =
                serde_json::json!({ "attributes": { "POSITION": 0 } });
            json["extensionsRequired"] = serde_json::json!(["KHR_mesh_quantization"]);
        })
        .unwrap();
        let expected = [
            dvec3(0.0, 0.0, 0.0),
            dvec3(far, 0.0, 0.0),
            dvec3(0.0, -far, 0.0),
        ];
        assert_eq!(scene.surfaces[0].vertices, expected);
        assert_eq!(scene.materials[0].name, "default");
        assert!(scene.notes[0].starts_with("mesh 0 ('floor') has no material"));
    }
}

#[test]
fn what_is_left_out_is_said() {
    let scene = document(|json| {
        json["extensionsUsed"] = serde_json::json!([
            "KHR_lights_punctual",
            "KHR_materials_ior",
            "KHR_texture_transform"
        ]);
        json["nodes"] = serde_json::json!([
            { "name": "floor", "mesh": 0, "skin": 0, "children": [1], "weights": [0.5],
              "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "mesh": 1, "translation": [0, 1, 0] },
            { "mesh": 0 }
        ]);
        let primitive = json["meshes"][0]["primitives"][0].clone();
        let mut lines = primitive.clone();
        lines["mode"] = 3.into();
        let mut morphed = primitive;
        morphed["targets"] = serde_json::json!([{ "POSITION": 0 }]);
        json["meshes"] = serde_json::json!([
            { "primitives": [morphed, lines] },
            { "primitives": [json["meshes"][0]["primitives"][0], { "attributes": {} }] }
        ]);
        json["animations"] = serde_json::json!([{}, {}]);
        json["materials"] = serde_json::json!([{
            "pbrMetallicRoughness": { "baseColorFactor": [1, 0.5, 0.25, 1] },
            "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 }, "alphaMode": "BLEND"
        }]);
    })
    .unwrap();
    assert_eq!(scene.materials[0].name, "material.1");
    assert_eq!(scene.materials[0].reflectance, [0.999, 0.5, 0.25]);
    assert_eq!(scene.materials[0].exitance, [0.0; 3]);
    assert_eq!(
        scene.notes,
        [
            "1 primitive of points or lines left out: only triangles are surfaces",
            "1 primitive without positions left out",
            "1 mesh with a skin: read as modelled, not as posed",
            "1 primitive with morph targets: read without them",
            "1 mesh with morph weights other than 0: the shape differs from what other programs show",
            "2 animations left out: the scene stands as modelled",
            "1 node with a mesh left out: not in the scene that was read",
            "extension 'KHR_lights_punctual' is not read, in 1 place: only surfaces emit",
            "not read: 'KHR_materials_ior'",
            "material 'material.1' has an emissive texture, which is not used: it does not emit",
            "material 'material.1' is metallic (1): it reflects diffusely here",
            "material 'material.1' has the alpha mode BLEND: it is opaque here",
            "4 triangles merged into 2 polygons",
            "a reflectance of 1 or more is taken as 0.999, for nothing reflects all light: in 'material.1'",
        ]
    );
}

#[test]
fn colour_that_is_not_said_is_a_white_paint_and_old_materials_have_theirs() {
    let scene = document(|json| json["materials"] = serde_json::json!([{}])).unwrap();
    assert_eq!(scene.materials[0].reflectance, [0.9]);
    let scene = document(|json| {
        json["extensionsRequired"] = serde_json::json!(["KHR_materials_pbrSpecularGlossiness"]);
        json["materials"] = serde_json::json!([{ "extensions": {
            "KHR_materials_pbrSpecularGlossiness": { "diffuseFactor": [0.25, 0.5, 1.5, 1.0] }
        } }]);
    })
    .unwrap();
    assert_eq!(scene.materials[0].reflectance, [0.25, 0.5, 0.999]);
}

#[test]
fn required_extensions_that_change_no_shape_are_passed_over_with_a_note() {
    for name in [
        "KHR_materials_unlit",
        "EXT_texture_webp",
        "KHR_lights_punctual",
        "KHR_xmp_json_ld",
    ] {
        let required = |json: &mut serde_json::Value| {
            json["extensionsRequired"] = serde_json::json!([name]);
        };
        let scene = document(required).expect(name);
        let note = format!("not read: '{name}'");
        assert!(scene.notes.contains(&note), "{:?}", scene.notes);
    }
    for name in ["EXT_meshopt_compression", "EXT_mesh_gpu_instancing"] {
        let required = |json: &mut serde_json::Value| {
            json["extensionsRequired"] = serde_json::json!([name]);
        };
        let error = document(required).expect_err(name).to_string();
        assert!(error.contains(name), "{error}");
    }
}

/// A GLB file of chunks, padded as they are asked to be.
fn glb(json: &str, pad_json: bool, pad_binary: bool) -> Vec<u8> {
    let mut body = Vec::new();
    let corners: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut binary: Vec<u8> = corners
        .as_flattened()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    binary.push(7);
    for (kind, mut bytes, is_padded, with) in [
        (b"JSON", json.as_bytes().to_vec(), pad_json, b' '),
        (b"BIN\0", binary, pad_binary, 0),
    ] {
        if is_padded {
            bytes.resize(bytes.len().next_multiple_of(4), with);
        }
        body.extend((bytes.len() as u32).to_le_bytes());
        body.extend(kind);
        body.extend(bytes);
    }
    let mut file = b"glTF".to_vec();
    file.extend(2u32.to_le_bytes());
    file.extend((body.len() as u32 + 12).to_le_bytes());
    file.extend(body);
    file
}

#[test]
fn chunks_that_are_not_padded_are_read() {
    let json = r#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "nodes":[{"mesh":0}],"buffers":[{"byteLength":37}],"bufferViews":[{"buffer":0,"byteLength":36}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}]}"#;
    let mut none = |name: &str| Err(format!("no {name}"));
    for blanks in 0..4 {
        let json = format!("{json}{}", " ".repeat(blanks));
        for (pad_json, pad_binary) in [(false, false), (false, true), (true, false), (true, true)] {
            let file = glb(&json, pad_json, pad_binary);
            let scene = gltf::read(&file, &mut none, LengthUnit::Metre).expect("not padded");
            assert_eq!(scene.surfaces.len(), 1);
            // Zeros in place of blanks, and a length that counts what is not there.
            let zeros = json.clone() + &"\0".repeat((4 - json.len() % 4) % 4);
            let file = glb(&zeros, pad_json, pad_binary);
            assert!(gltf::read(&file, &mut none, LengthUnit::Metre).is_ok());
        }
    }
}

#[test]
fn what_is_no_gltf_of_today_is_called_what_it_is() {
    let mut none = |name: &str| Err(format!("no {name}"));
    let mut said = |bytes: &[u8]| {
        let error = gltf::read(bytes, &mut none, LengthUnit::Metre).unwrap_err();
        error.to_string()
    };
    let first = br#"{"scene":"main","scenes":{"main":{"nodes":["a"]}},"nodes":{"a":{}}}"#;
    assert!(said(first).starts_with("this is glTF 1.0; only 2.0 is read"));
    let first = br#"{"asset":{"version":"1.0"},"scene":"main"}"#;
    assert!(said(first).starts_with("this is glTF 1.0; only 2.0 is read"));
    assert!(said(b"\x89PNG\r\n").contains("neither glTF"));
    assert!(said(b"  ").contains("empty"));
    let wrong = br#"{"asset":{"version":"2.0"},"scene":"main"}"#;
    assert!(
        said(wrong).contains("expected a whole number from 0"),
        "{}",
        said(wrong)
    );
    let chunk = glb("GARBAGE!", true, true);
    assert!(
        said(&chunk).contains("the JSON chunk of the file"),
        "{}",
        said(&chunk)
    );
}

#[test]
fn mesh_placed_too_often_is_refused_before_it_is_made() {
    // 100,000 corners, one byte each, in 200 places: 6.7 million triangles.
    let n = 99_999;
    let mut data = vec![0u8; n];
    for (i, byte) in data.iter_mut().enumerate() {
        *byte = (i % 3) as u8;
    }
    data.extend(
        [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]]
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    let nodes: Vec<_> = (0..200).map(|_| serde_json::json!({ "mesh": 0 })).collect();
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "nodes": nodes,
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 1 }, "indices": 0 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5121, "count": n, "type": "SCALAR" },
            { "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": n },
            { "buffer": 0, "byteOffset": n, "byteLength": 36 }
        ],
        "buffers": [{ "byteLength": data.len(), "uri": "mesh.bin" }]
    });
    let mut load = |_: &str| Ok(data.clone());
    let error = gltf::read(json.to_string().as_bytes(), &mut load, LengthUnit::Metre).unwrap_err();
    assert!(
        error.message.contains("more than 4000000 triangles"),
        "{error}"
    );
}

/// The file after some edits: bytes set, digits changed, an end cut off, a piece
/// doubled.
#[derive(Clone, Debug)]
enum Edit {
    Set(usize, u8),
    Flip(usize, u8),
    Digit(usize, u8),
    Cut(usize),
    Repeat(usize, usize),
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = any::<usize>();
    prop_oneof![
        2 => (at, any::<u8>()).prop_map(|(at, byte)| Edit::Set(at, byte)),
        4 => (at, 0u8..8).prop_map(|(at, bit)| Edit::Flip(at, bit)),
        6 => (at, prop::sample::select(b"0123456789-.e".to_vec()))
            .prop_map(|(at, digit)| Edit::Digit(at, digit)),
        1 => at.prop_map(Edit::Cut),
        1 => (at, 1usize..60).prop_map(|(at, n)| Edit::Repeat(at, n)),
    ]
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let n = bytes.len().max(1);
        match *self {
            Self::Set(at, byte) => {
                if let Some(place) = bytes.get_mut(at % n) {
                    *place = byte;
                }
            }
            Self::Flip(at, bit) => {
                if let Some(place) = bytes.get_mut(at % n) {
                    *place ^= 1 << bit;
                }
            }
            // The next digit from there: mostly a number of the JSON or of a text.
            Self::Digit(at, digit) => {
                let start = at % n;
                let place = bytes.iter_mut().skip(start).find(|b| b.is_ascii_digit());
                if let Some(place) = place {
                    *place = digit;
                }
            }
            Self::Cut(at) => bytes.truncate(at % n),
            Self::Repeat(at, length) => {
                let start = at % n;
                let piece = bytes[start..(start + length).min(bytes.len())].to_vec();
                bytes.splice(start..start, piece);
            }
        }
    }
}

/// So many random cases, always the same ones.
fn cases() -> ProptestConfig {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u32>().ok());
    ProptestConfig {
        cases: number("DAMAGE_CASES").unwrap_or(2000),
        rng_seed: RngSeed::Fixed(u64::from(number("DAMAGE_SEED").unwrap_or(1))),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn damaged_files_end_in_a_scene_or_an_error(
        name in prop::sample::select(vec![
            "real/gltf-box/Box.glb",
            "real/gltf-box/Box.gltf",
            "real/r3l-tile-room/tile-game-room6.glb",
            "gltf/square.gltf",
            "real/sparrowpy-cube/cube.stl",
            "stl/two-solids.stl",
            "stl/begins-with-solid.stl",
        ]),
        edits in prop::collection::vec(edit(), 1..4)
    ) {
        let mut damaged = bytes(name);
        for edit in &edits {
            edit.apply(&mut damaged);
        }
        let result = if name.ends_with(".stl") {
            stl::read(&damaged, LengthUnit::Metre)
        } else {
            let mut load = |_: &str| Ok(bytes("real/gltf-box/Box0.bin"));
            gltf::read(&damaged, &mut load, LengthUnit::Metre)
        };
        match result {
            Err(error) => prop_assert!(!error.message.is_empty()),
            Ok(scene) => {
                // Accepted or not, but without a panic, and each finding with a word.
                if let Err(problems) = Scene::build(&scene) {
                    prop_assert!(problems.iter().all(|p| !p.message.is_empty()));
                }
            }
        }
    }
}
