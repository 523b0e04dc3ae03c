//! glTF 2.0, as text with buffers or as a GLB file, read as polygons.
//!
//! Triangles are put together into the polygons they were made from
//! (the module `merge`), for glTF has nothing else. Materials:
//! `baseColorFactor` is the reflectance,
//! in three bands, and `emissiveFactor` times `KHR_materials_emissive_strength` the
//! luminance in cd/m², so π times it the exitance in lm/m². `doubleSided` is
//! two-sided. What is about looks (textures, gloss, transparency) is passed over
//! with a note. Lengths are metres, unless the caller knows better: files of
//! programs that draw in millimetres often say so nowhere.
//!
//! The reader is our own over `serde_json`. The crate `gltf` 1.4.1 panics on files
//! that are wrong in the right place (its validation follows an index of
//! `POSITION` before it has checked it, and a GLB header with a length below 12
//! overflows), refuses files without the bounds of positions, which we do not
//! need, and rounds all numbers to single precision on the way.

mod container;
mod data;
mod document;

use crate::ReadError;
use crate::materials::{self, DEFAULT_REFLECTANCE};
use crate::merge::{self, Part};
use crate::names::Taken;
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, SceneInput};
use data::{Data, get};
use document::{Document, Material, Node, Primitive};
use glam::{DMat4, DQuat, DVec3, DVec4};
use serde::Deserialize;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// What is read of what files may require.
const EXTENSIONS: [&str; 4] = [
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_mesh_quantization",
    // Texture coordinates are not.
    "KHR_texture_transform",
];

/// What the names of extensions contain that are about looks, lamps without a surface, or
/// what is known of the file: they change no shape, and may be passed over even where the
/// file requires them.
const NO_SHAPE: [&str; 7] = [
    "_materials_",
    "_texture_",
    "_lights_",
    "_xmp",
    "_techniques_",
    "_metadata",
    "_mesh_features",
];

/// Where a file says no base colour, for which glTF has 1: a very white paint.
const WHITE: f64 = 0.9;

/// More triangles than this are refused before they are made: a few bytes can
/// place one mesh thousands of times, and the engine is for thousands of polygons.
const MOST_TRIANGLES: usize = 4_000_000;

/// Larger coordinates are refused, as the check of scenes does.
const LARGEST: f64 = 1e100;

/// Reads a glTF or GLB file.
///
/// * `load` — gives the bytes of a buffer by its name in the file, or says why it
///   cannot; images are not asked for.
/// * `unit` — metres by the standard.
///
/// All meshes of the default scene are read, or of all root nodes if there is
/// none. A surface is named after its node, else its mesh; where that has several
/// polygons, `name.1`, `name.2`, …
///
/// # Errors
///
/// [`ReadError`] for what is not glTF 2.0 or not whole: indices and ranges out of
/// bounds, coordinates that are not finite, nodes that contain themselves; for
/// required extensions and sparse accessors, which are not read; for a file
/// without triangles.
pub fn read(
    bytes: &[u8],
    load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    unit: LengthUnit,
) -> Result<SceneInput, ReadError> {
    let is_binary = container::is_binary(bytes);
    let (json, binary) = if is_binary {
        let container = container::open(bytes)?;
        (Cow::Borrowed(container.json), container.binary)
    } else {
        (plain_text(bytes)?, None)
    };
    check_version(&json)?;
    let document: Document = serde_json::from_slice(&json).map_err(|error| {
        let error = json_error(&error);
        match is_binary {
            true => ReadError::whole(format!("the JSON chunk of the file: {error}")),
            false => error,
        }
    })?;
    check_extensions(&document)?;

    let mut reader = Reader {
        document: &document,
        data: Data::new(&document, binary, load),
        materials: Materials::default(),
        left_out: LeftOut::default(),
        n_triangles: 0,
    };
    let parts = reader.parts()?;
    if parts.is_empty() {
        let unused = match document.meshes.len() {
            0 => "",
            _ => " in its scene",
        };
        return Err(ReadError::whole(format!("there is no triangle{unused}")));
    }
    let mut merged = merge::surfaces(&parts, unit.symbol());
    let mut notes = reader.left_out.notes(&document);
    notes.append(&mut reader.materials.notes);
    notes.append(&mut merged.notes);
    let mut materials = reader.materials.list;
    materials::below_one(&mut materials, &mut notes);
    materials::in_as_few_bands(&mut materials);
    Ok(SceneInput {
        length_unit: unit,
        quantity: Quantity::Photometric,
        materials,
        surfaces: merged.surfaces,
        triangulate: true,
        notes,
    })
}

/// The JSON of a file that is no container.
fn plain_text(bytes: &[u8]) -> Result<Cow<'_, [u8]>, ReadError> {
    let text = match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => {
            let text = crate::text::decoded(bytes).map_err(ReadError::whole)?;
            Cow::Owned(text.text.into_bytes())
        }
        _ => Cow::Borrowed(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    };
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    match first {
        Some(b'{') => Ok(text),
        Some(_) => Err(ReadError::whole(
            "it is neither glTF, which begins with '{', nor GLB, which begins with 'glTF'",
        )),
        None => Err(ReadError::whole("the file is empty")),
    }
}

/// The error in words that are about files and not about programs.
fn json_error(error: &serde_json::Error) -> ReadError {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    let text = text.strip_suffix(&place).unwrap_or(&text);
    let message = ["usize", "u64"].iter().fold(text.to_owned(), |text, kind| {
        text.replace(
            &format!("expected {kind}"),
            "expected a whole number from 0, as for an index or a count",
        )
    });
    ReadError {
        line: Some(error.line()),
        column: Some(error.column()),
        message,
    }
}

/// What tells the version: read first, for the rest depends on it.
#[derive(Deserialize)]
struct Versioned {
    asset: Option<serde_json::Map<String, Value>>,
    /// A list since 2.0, a dictionary before.
    #[serde(default)]
    scenes: Value,
    #[serde(default)]
    meshes: Value,
}

fn check_version(json: &[u8]) -> Result<(), ReadError> {
    // What is no JSON, or has an asset that is none, is told of where all of it is read.
    let Ok(file) = serde_json::from_slice::<Versioned>(json) else {
        return Ok(());
    };
    let said = |key: &str| match file.asset.as_ref()?.get(key)? {
        Value::String(text) => Some(text.clone()),
        other => Some(other.to_string()),
    };
    let (version, least) = (said("version"), said("minVersion"));
    let is_first = match &version {
        Some(version) => version.starts_with("1.") || version == "1" || version.starts_with("0."),
        None => file.scenes.is_object() || file.meshes.is_object(),
    };
    if is_first {
        return Err(ReadError::whole(format!(
            "this is glTF {}; only 2.0 is read: convert the file, or export it again",
            version.as_deref().unwrap_or("1.0")
        )));
    }
    let is_known = match (&least, &version) {
        (Some(least), _) => least == "2.0",
        (None, Some(version)) => version.split('.').next() == Some("2"),
        // Told of with the place where it is missing.
        (None, None) => true,
    };
    if is_known {
        return Ok(());
    }
    Err(ReadError::whole(format!(
        "glTF version '{}' (allowed 2.0)",
        least.or(version).unwrap_or_default()
    )))
}

fn check_extensions(document: &Document) -> Result<(), ReadError> {
    let unknown: Vec<&str> = document
        .extensions_required
        .iter()
        .map(String::as_str)
        .filter(|name| !EXTENSIONS.contains(name) && !changes_no_shape(name))
        .collect();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(ReadError::whole(format!(
        "the file requires '{}', which is not read (allowed {}, and what is about materials): export without compression and extensions",
        unknown.join("', '"),
        EXTENSIONS.join(", ")
    )))
}

fn changes_no_shape(extension: &str) -> bool {
    NO_SHAPE.iter().any(|part| extension.contains(part))
}

/// Goes through the nodes and collects parts.
struct Reader<'a> {
    document: &'a Document,
    data: Data<'a>,
    materials: Materials,
    left_out: LeftOut,
    n_triangles: usize,
}

/// A node that is being read, and where it stands.
struct Placed {
    node: usize,
    world_from_node: DMat4,
}

impl Reader<'_> {
    fn parts(&mut self) -> Result<Vec<Part>, ReadError> {
        let document = self.document;
        let mut open: Vec<Placed> = self
            .roots()?
            .into_iter()
            .rev()
            .map(|node| Placed {
                node,
                world_from_node: DMat4::IDENTITY,
            })
            .collect();
        let mut is_seen = vec![false; document.nodes.len()];
        let mut parts = Vec::new();
        while let Some(placed) = open.pop() {
            let node = get(&document.nodes, placed.node, "node", "the scene")?;
            // Each node has one parent; a second one may be its own child.
            if std::mem::replace(&mut is_seen[placed.node], true) {
                return Err(ReadError::whole(format!(
                    "node {} stands in two places or contains itself (allowed one parent)",
                    placed.node
                )));
            }
            let world_from_node = placed.world_from_node * transform(node, placed.node)?;
            self.left_out.node(node);
            if let Some(mesh) = node.mesh {
                self.mesh(placed.node, mesh, world_from_node, &mut parts)?;
            }
            open.extend(node.children.iter().rev().map(|&node| Placed {
                node,
                world_from_node,
            }));
        }
        self.left_out.n_unused = is_seen
            .iter()
            .zip(&document.nodes)
            .filter(|(is_seen, node)| !**is_seen && node.mesh.is_some())
            .count();
        Ok(parts)
    }

    /// The nodes of the default scene, or all that are no one's children.
    fn roots(&self) -> Result<Vec<usize>, ReadError> {
        if let Some(scene) = self.document.scene {
            return Ok(get(&self.document.scenes, scene, "scene", "the file")?
                .nodes
                .clone());
        }
        let mut is_child = vec![false; self.document.nodes.len()];
        for (i, node) in self.document.nodes.iter().enumerate() {
            for &child in &node.children {
                get(&self.document.nodes, child, "node", &format!("node {i}"))?;
                is_child[child] = true;
            }
        }
        let roots: Vec<usize> = (0..is_child.len()).filter(|&i| !is_child[i]).collect();
        if roots.is_empty() && !is_child.is_empty() {
            return Err(ReadError::whole(
                "every node is a child of another: nodes contain themselves",
            ));
        }
        Ok(roots)
    }

    fn mesh(
        &mut self,
        node: usize,
        index: usize,
        world_from_node: DMat4,
        parts: &mut Vec<Part>,
    ) -> Result<(), ReadError> {
        let document = self.document;
        let mesh = get(&document.meshes, index, "mesh", &format!("node {node}"))?;
        let node = &document.nodes[node];
        let given = |name: &Option<String>| name.clone().filter(|name| !name.trim().is_empty());
        let name = given(&node.name).or_else(|| given(&mesh.name));
        let what = match &name {
            Some(name) => format!("mesh {index} ('{name}')"),
            None => format!("mesh {index}"),
        };
        if mesh.weights.iter().chain(&node.weights).any(|&w| w != 0.0) {
            self.left_out.n_morphed += 1;
        }
        for primitive in &mesh.primitives {
            self.left_out.primitive(primitive);
            let Some(triangles) = self.triangles(primitive, &what)? else {
                continue;
            };
            if triangles.corners.is_empty() {
                continue;
            }
            self.n_triangles += triangles.corners.len();
            if self.n_triangles > MOST_TRIANGLES {
                return Err(ReadError::whole(format!(
                    "{what}: more than {MOST_TRIANGLES} triangles up to here (allowed {MOST_TRIANGLES})"
                )));
            }
            let material = self.materials.name(document, primitive.material, &what)?;
            parts.push(triangles.placed(name.clone(), material, world_from_node, &what)?);
        }
        Ok(())
    }

    /// The triangles of a primitive; `None` if it is one of points or lines.
    fn triangles(
        &mut self,
        primitive: &Primitive,
        what: &str,
    ) -> Result<Option<Triangles>, ReadError> {
        let mode = match primitive.mode.unwrap_or(4) {
            0..=3 => {
                self.left_out.n_lines += 1;
                return Ok(None);
            }
            4 => Mode::Triangles,
            5 => Mode::Strip,
            6 => Mode::Fan,
            other => {
                return Err(ReadError::whole(format!(
                    "{what}: primitive mode {other} (allowed 0 to 6)"
                )));
            }
        };
        let Some(positions) = primitive.attributes.get("POSITION") else {
            self.left_out.n_without_positions += 1;
            return Ok(None);
        };
        let accessor = positions.as_u64().and_then(|i| usize::try_from(i).ok());
        let accessor = accessor.ok_or_else(|| {
            ReadError::whole(format!(
                "{what}: POSITION is {positions} (allowed the index of an accessor)"
            ))
        })?;
        let points = self
            .data
            .points(accessor, &format!("{what}: its positions"))?;
        let corners = match primitive.indices {
            Some(accessor) => {
                let what = format!("{what}: its indices");
                let indices = self.data.indices(accessor, &what)?;
                if let Some(bad) = indices.iter().find(|&&i| i as usize >= points.len()) {
                    return Err(ReadError::whole(format!(
                        "{what}: vertex {bad}, but there are {} (counted from 0)",
                        points.len()
                    )));
                }
                mode.triangles(&indices, &what)?
            }
            None => {
                let all: Vec<u32> = (0..points.len() as u32).collect();
                mode.triangles(&all, what)?
            }
        };
        Ok(Some(Triangles { points, corners }))
    }
}

/// How indices make triangles.
#[derive(Clone, Copy)]
enum Mode {
    Triangles,
    Strip,
    Fan,
}

impl Mode {
    fn triangles(self, indices: &[u32], what: &str) -> Result<Vec<[u32; 3]>, ReadError> {
        let n = indices.len();
        Ok(match self {
            Self::Triangles => {
                let (triangles, rest) = indices.as_chunks::<3>();
                if !rest.is_empty() {
                    return Err(ReadError::whole(format!(
                        "{what}: {n} corners are no number of triangles (allowed multiples of 3)"
                    )));
                }
                triangles.to_vec()
            }
            // Every other triangle of a strip runs the other way round.
            Self::Strip => (2..n)
                .map(|i| match i % 2 {
                    0 => [indices[i - 2], indices[i - 1], indices[i]],
                    _ => [indices[i - 1], indices[i - 2], indices[i]],
                })
                .collect(),
            Self::Fan => (2..n)
                .map(|i| [indices[0], indices[i - 1], indices[i]])
                .collect(),
        })
    }
}

/// The triangles of a primitive in the space of its node.
struct Triangles {
    points: Vec<DVec3>,
    corners: Vec<[u32; 3]>,
}

impl Triangles {
    fn placed(
        self,
        name: Option<String>,
        material: String,
        world_from_node: DMat4,
        what: &str,
    ) -> Result<Part, ReadError> {
        let mut magnitude: f64 = 0.0;
        let mut points = Vec::with_capacity(self.points.len());
        for point in self.points {
            let world = world_from_node.transform_point3(point);
            // What cancels in the sum was rounded all the same.
            let linear = world_from_node.transform_vector3(point).abs();
            let parts = linear.max(world_from_node.w_axis.truncate().abs());
            let largest = parts.max(world.abs()).max_element();
            if !world.is_finite() || largest > LARGEST {
                return Err(ReadError::whole(format!(
                    "{what}: a vertex is ({:e}, {:e}, {:e}) in the scene (allowed up to {LARGEST:e})",
                    world.x, world.y, world.z
                )));
            }
            magnitude = magnitude.max(largest);
            points.push(world);
        }
        // A mirror turns fronts into backs, so corners run the other way round.
        let mirrors = world_from_node.determinant() < 0.0;
        let triangles = self
            .corners
            .iter()
            .map(|&[a, b, c]| {
                let corners = if mirrors { [a, c, b] } else { [a, b, c] };
                corners.map(|i| points[i as usize])
            })
            .collect();
        Ok(Part {
            name,
            material,
            triangles,
            magnitude,
        })
    }
}

/// Parent from node, composed in double precision.
fn transform(node: &Node, index: usize) -> Result<DMat4, ReadError> {
    if let Some(columns) = node.matrix {
        let matrix = DMat4::from_cols_array(&columns);
        if matrix.row(3) != DVec4::W {
            return Err(ReadError::whole(format!(
                "node {index}: its matrix ends in the row {} (allowed 0, 0, 0, 1)",
                matrix.row(3)
            )));
        }
        return Ok(matrix);
    }
    let rotation = match node.rotation {
        None => DQuat::IDENTITY,
        Some(given) => {
            let length = DVec4::from_array(given).length();
            if !(length > 0.0 && length.is_finite()) {
                return Err(ReadError::whole(format!(
                    "node {index}: its rotation has the length {length} (allowed 1)"
                )));
            }
            DQuat::from_vec4(DVec4::from_array(given) / length)
        }
    };
    Ok(DMat4::from_scale_rotation_translation(
        DVec3::from_array(node.scale.unwrap_or([1.0; 3])),
        rotation,
        DVec3::from_array(node.translation.unwrap_or([0.0; 3])),
    ))
}

/// Materials in the order of their first use.
#[derive(Default)]
struct Materials {
    list: Vec<MaterialInput>,
    notes: Vec<String>,
    names: Taken,
    /// The names given; `None` is no material.
    given: BTreeMap<Option<usize>, String>,
}

impl Materials {
    fn name(
        &mut self,
        document: &Document,
        index: Option<usize>,
        what: &str,
    ) -> Result<String, ReadError> {
        if let Some(name) = self.given.get(&index) {
            return Ok(name.clone());
        }
        let material = match index {
            None => {
                let name = self.names.unique("default");
                self.notes.push(format!(
                    "{what} has no material: '{name}' with a reflectance of {DEFAULT_REFLECTANCE} is used for it and others like it"
                ));
                materials::default(name)
            }
            Some(i) => {
                let material = get(&document.materials, i, "material", what)?;
                let named = material.name.clone().filter(|n| !n.trim().is_empty());
                let name = named.unwrap_or_else(|| format!("material.{}", i + 1));
                let name = self.names.unique(&name);
                self.notes.extend(notes(&name, material));
                to_input(name, material)
            }
        };
        let name = material.name.clone();
        self.given.insert(index, name.clone());
        self.list.push(material);
        Ok(name)
    }
}

fn to_input(name: String, material: &Material) -> MaterialInput {
    let (factor, texture) = base_colour(material);
    let [r, g, b, _] = factor.unwrap_or([WHITE; 4]);
    let reflectance = [r, g, b].map(|x| {
        // The factor dims a texture: by itself it says little.
        match texture {
            Some(_) if factor.is_some() => x * DEFAULT_REFLECTANCE,
            Some(_) => DEFAULT_REFLECTANCE,
            None => x,
        }
    });
    let strength = strength(material);
    let exitance = if material.emissive_texture.is_some() {
        [0.0; 3]
    } else {
        material.emissive_factor.map(|x| PI * strength * x)
    };
    MaterialInput {
        name,
        reflectance: reflectance.to_vec(),
        exitance: exitance.to_vec(),
        two_sided: material.double_sided,
    }
}

/// The colour of what is reflected, if the file says it, and its texture.
fn base_colour(material: &Material) -> (Option<[f64; 4]>, Option<&Value>) {
    let pbr = &material.pbr_metallic_roughness;
    match &material.extensions.specular_glossiness {
        Some(diffuse) => (diffuse.diffuse_factor, diffuse.diffuse_texture.as_ref()),
        None => (pbr.base_color_factor, pbr.base_color_texture.as_ref()),
    }
}

fn strength(material: &Material) -> f64 {
    let extension = &material.extensions.emissive_strength;
    extension.as_ref().map_or(1.0, |e| e.emissive_strength)
}

/// What a user may not expect of a material.
fn notes(name: &str, material: &Material) -> Vec<String> {
    let mut notes = Vec::new();
    let pbr = &material.pbr_metallic_roughness;
    let (factor, texture) = base_colour(material);
    if texture.is_some() {
        notes.push(format!(
            "material '{name}' has a base colour texture, which is not used: its reflectance is {DEFAULT_REFLECTANCE} times the base colour factor"
        ));
    } else if factor.is_none() {
        notes.push(format!(
            "material '{name}' has no base colour, which stands for 1, and nothing reflects all light: {WHITE} is used"
        ));
    }
    if material.emissive_texture.is_some() && material.emissive_factor != [0.0; 3] {
        notes.push(format!(
            "material '{name}' has an emissive texture, which is not used: it does not emit"
        ));
    }
    if pbr.metallic_factor > 0.0 && material.extensions.specular_glossiness.is_none() {
        notes.push(format!(
            "material '{name}' is metallic ({}): it reflects diffusely here",
            pbr.metallic_factor
        ));
    }
    if let Some(mode) = material.alpha_mode.as_deref().filter(|m| *m != "OPAQUE") {
        notes.push(format!(
            "material '{name}' has the alpha mode {mode}: it is opaque here"
        ));
    }
    notes
}

/// What is in the file and not in the scene.
#[derive(Default)]
struct LeftOut {
    n_lines: usize,
    n_without_positions: usize,
    n_skinned: usize,
    n_morphed: usize,
    n_targets: usize,
    n_unused: usize,
    /// On nodes and primitives.
    extensions: BTreeMap<String, usize>,
}

impl LeftOut {
    fn node(&mut self, node: &Node) {
        if node.mesh.is_some() && node.skin.is_some() {
            self.n_skinned += 1;
        }
        for name in node.extensions.keys() {
            *self.extensions.entry(name.clone()).or_default() += 1;
        }
    }

    fn primitive(&mut self, primitive: &Primitive) {
        if !primitive.targets.is_empty() {
            self.n_targets += 1;
        }
        for name in primitive.extensions.keys() {
            *self.extensions.entry(name.clone()).or_default() += 1;
        }
    }

    fn notes(&self, document: &Document) -> Vec<String> {
        let mut notes = Vec::new();
        let mut note = |n: usize, one: &str, many: &str, rest: &str| {
            if n > 0 {
                notes.push(format!("{n} {}{rest}", if n == 1 { one } else { many }));
            }
        };
        note(
            self.n_lines,
            "primitive",
            "primitives",
            " of points or lines left out: only triangles are surfaces",
        );
        note(
            self.n_without_positions,
            "primitive",
            "primitives",
            " without positions left out",
        );
        note(
            self.n_skinned,
            "mesh",
            "meshes",
            " with a skin: read as modelled, not as posed",
        );
        note(
            self.n_targets,
            "primitive",
            "primitives",
            " with morph targets: read without them",
        );
        note(
            self.n_morphed,
            "mesh",
            "meshes",
            " with morph weights other than 0: the shape differs from what other programs show",
        );
        note(
            document.animations.len(),
            "animation",
            "animations",
            " left out: the scene stands as modelled",
        );
        note(
            self.n_unused,
            "node",
            "nodes",
            " with a mesh left out: not in the scene that was read",
        );
        for (name, n) in &self.extensions {
            let places = if *n == 1 { "place" } else { "places" };
            let advice = match name.as_str() {
                "KHR_lights_punctual" => ": only surfaces emit",
                _ => "",
            };
            notes.push(format!(
                "extension '{name}' is not read, in {n} {places}{advice}"
            ));
        }
        let mut others: Vec<&str> = document
            .extensions_used
            .iter()
            .chain(&document.extensions_required)
            .map(String::as_str)
            .filter(|name| !EXTENSIONS.contains(name) && !self.extensions.contains_key(*name))
            .collect();
        others.sort_unstable();
        others.dedup();
        if !others.is_empty() {
            notes.push(format!("not read: '{}'", others.join("', '")));
        }
        notes
    }
}
