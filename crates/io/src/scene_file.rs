//! The scene file: JSON, with a schema that lies beside it.
//!
//! ```json
//! {
//!   "antumbra": 1,
//!   "length_unit": "m",
//!   "quantity": "radiometric",
//!   "materials": { "white": { "reflectance": 0.7 }, "lamp": { "exitance": [3, 2, 1] } },
//!   "surfaces": [
//!     { "name": "floor", "material": "white", "vertices": [[0,0,0],[1,0,0],[0,1,0]] }
//!   ]
//! }
//! ```
//!
//! Numbers survive a round trip bit for bit.

use crate::ReadError;
use crate::read_error::one_line;
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, SceneInput, SurfaceInput};
use glam::DVec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt::{self, Write as _};

/// The version of the format that this crate reads and writes.
const VERSION: u64 = 1;

/// Reads a scene file.
///
/// # Errors
///
/// [`ReadError`], with line and column, for text that is not JSON or not of the
/// schema: unknown fields, units and versions, numbers that are none or overflow,
/// vertices without three components.
pub fn read(text: &str) -> Result<SceneInput, ReadError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(ReadError::whole(
            "the file is empty, a scene in JSON is expected",
        ));
    }
    let file: SceneFile = serde_json::from_str(text).map_err(|error| read_error(&error))?;
    Ok(file.into())
}

/// The scene as a file that [`read`] gives back exactly (but for the notes).
///
/// One material and one surface a line.
#[must_use]
pub fn write(scene: &SceneInput) -> String {
    let materials: Vec<String> = scene
        .materials
        .iter()
        .map(|m| {
            let mut fields = Vec::new();
            for (name, values) in [("reflectance", &m.reflectance), ("exitance", &m.exitance)] {
                match values.as_slice() {
                    [zero] if zero.to_bits() == 0 => {}
                    [one] => fields.push(format!("\"{name}\": {}", json(one))),
                    _ => fields.push(format!("\"{name}\": {}", json(values))),
                }
            }
            if m.two_sided {
                fields.push("\"two_sided\": true".to_owned());
            }
            if fields.is_empty() {
                format!("{}: {{}}", json(&m.name))
            } else {
                format!("{}: {{ {} }}", json(&m.name), fields.join(", "))
            }
        })
        .collect();
    let surfaces: Vec<String> = scene
        .surfaces
        .iter()
        .map(|s| {
            let plain = |corners: &[DVec3]| -> Vec<[f64; 3]> {
                corners.iter().map(DVec3::to_array).collect()
            };
            let mut line = format!(
                "{{ \"name\": {}, \"material\": {}, \"vertices\": {}",
                json(&s.name),
                json(&s.material),
                json(&plain(&s.vertices))
            );
            if !s.holes.is_empty() {
                let holes: Vec<_> = s.holes.iter().map(|hole| plain(hole)).collect();
                // Writing to a string does not fail.
                let _ = write!(line, ", \"holes\": {}", json(&holes));
            }
            line + " }"
        })
        .collect();
    let block = |lines: &[String], open: char, close: char| {
        if lines.is_empty() {
            format!("{open}{close}")
        } else {
            format!("{open}\n    {}\n  {close}", lines.join(",\n    "))
        }
    };
    format!(
        "{{\n  \"antumbra\": {VERSION},\n  \"length_unit\": {},\n  \"quantity\": {},\n  \"materials\": {},\n  \"surfaces\": {}\n}}\n",
        json(scene.length_unit.symbol()),
        json(scene.quantity.name()),
        block(&materials, '{', '}'),
        block(&surfaces, '[', ']'),
    )
}

/// The JSON schema of scene files, as shipped in `scene.schema.json`.
#[must_use]
pub fn schema() -> String {
    let schema = schemars::schema_for!(SceneFile);
    serde_json::to_string_pretty(&schema).unwrap_or_default() + "\n"
}

fn json<T: Serialize + ?Sized>(value: &T) -> String {
    // Strings, numbers and arrays of them always have a JSON form.
    serde_json::to_string(value).unwrap_or_default()
}

fn read_error(error: &serde_json::Error) -> ReadError {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    let message = text.strip_suffix(&place).unwrap_or(&text).to_owned();
    let message = match message.as_str() {
        "number out of range" => "a number is too large (allowed up to 1.8e308)".to_owned(),
        _ => one_line(&message),
    };
    ReadError {
        line: Some(error.line()),
        column: Some(error.column()),
        message,
    }
}

/// A scene of polygons for antumbra.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Scene")]
struct SceneFile {
    /// Version of the format: 1.
    #[serde(rename = "antumbra")]
    _antumbra: Version,
    /// Unit of all coordinates.
    #[serde(default)]
    length_unit: LengthUnitName,
    /// Unit of exitance and irradiance: W/m², lm/m² or none.
    #[serde(default)]
    quantity: QuantityName,
    /// Materials by name.
    materials: Materials,
    /// Polygons.
    surfaces: Vec<SurfaceFile>,
}

/// A diffuse material.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Material")]
struct MaterialFile {
    /// Diffuse reflectance, 0 to 1 without 1; one value, or one per band.
    #[serde(default)]
    reflectance: Bands,
    /// Exitance, not negative; one value, or one per band.
    #[serde(default)]
    exitance: Bands,
    /// Does the back emit and reflect too?
    #[serde(default)]
    two_sided: bool,
}

/// A plane polygon, which emits and receives on its front.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Surface")]
struct SurfaceFile {
    /// Unique name, the key of every output.
    name: String,
    /// Name of its material.
    material: String,
    /// Outline, counter-clockwise as seen from the front.
    vertices: Vec<[f64; 3]>,
    /// Holes in the outline, each a loop in either direction.
    #[serde(default)]
    holes: Vec<Vec<[f64; 3]>>,
}

#[derive(Clone, Copy, Default, Deserialize, JsonSchema)]
#[schemars(rename = "LengthUnit")]
enum LengthUnitName {
    #[default]
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "mm")]
    Millimetre,
    #[serde(rename = "cm")]
    Centimetre,
    #[serde(rename = "in")]
    Inch,
    #[serde(rename = "ft")]
    Foot,
}

#[derive(Clone, Copy, Default, Deserialize, JsonSchema)]
#[schemars(rename = "Quantity")]
#[serde(rename_all = "lowercase")]
enum QuantityName {
    #[default]
    Radiometric,
    Photometric,
    None,
}

struct Version;

impl<'de> Deserialize<'de> for Version {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match u64::deserialize(deserializer)? {
            VERSION => Ok(Self),
            other => Err(de::Error::custom(format!(
                "version {other} of the scene format is unknown (allowed {VERSION})"
            ))),
        }
    }
}

impl JsonSchema for Version {
    fn schema_name() -> Cow<'static, str> {
        "Version".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": VERSION })
    }
}

/// A number, or an array of one number per band.
struct Bands(Vec<f64>);

impl Default for Bands {
    fn default() -> Self {
        Self(vec![0.0])
    }
}

impl<'de> Deserialize<'de> for Bands {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;

        impl<'de> Visitor<'de> for OneOrMany {
            type Value = Bands;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or an array of numbers, one per band")
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Bands, E> {
                Ok(Bands(vec![value]))
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Bands, E> {
                Ok(Bands(vec![value as f64]))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Bands, E> {
                Ok(Bands(vec![value as f64]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Bands, A::Error> {
                let mut values = Vec::new();
                while let Some(value) = seq.next_element()? {
                    values.push(value);
                }
                Ok(Bands(values))
            }
        }

        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Bands {
    fn schema_name() -> Cow<'static, str> {
        "Bands".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number, or an array of one number per band; all arrays of a file have one length.",
            "oneOf": [
                { "type": "number", "minimum": 0 },
                { "type": "array", "items": { "type": "number", "minimum": 0 }, "minItems": 1 }
            ]
        })
    }
}

/// Materials in the order of the file; a name that occurs twice stays twice, for
/// the check of the scene to see.
struct Materials(Vec<(String, MaterialFile)>);

impl<'de> Deserialize<'de> for Materials {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder;

        impl<'de> Visitor<'de> for InOrder {
            type Value = Materials;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of materials by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Materials, A::Error> {
                let mut materials = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    materials.push(entry);
                }
                Ok(Materials(materials))
            }
        }

        deserializer.deserialize_map(InOrder)
    }
}

impl JsonSchema for Materials {
    fn schema_name() -> Cow<'static, str> {
        "Materials".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let material = generator.subschema_for::<MaterialFile>();
        json_schema!({ "type": "object", "additionalProperties": material })
    }
}

impl From<SceneFile> for SceneInput {
    fn from(file: SceneFile) -> Self {
        let corners = |vertices: Vec<[f64; 3]>| -> Vec<DVec3> {
            vertices.into_iter().map(DVec3::from_array).collect()
        };
        Self {
            length_unit: match file.length_unit {
                LengthUnitName::Metre => LengthUnit::Metre,
                LengthUnitName::Millimetre => LengthUnit::Millimetre,
                LengthUnitName::Centimetre => LengthUnit::Centimetre,
                LengthUnitName::Inch => LengthUnit::Inch,
                LengthUnitName::Foot => LengthUnit::Foot,
            },
            quantity: match file.quantity {
                QuantityName::Radiometric => Quantity::Radiometric,
                QuantityName::Photometric => Quantity::Photometric,
                QuantityName::None => Quantity::None,
            },
            materials: file
                .materials
                .0
                .into_iter()
                .map(|(name, m)| MaterialInput {
                    name,
                    reflectance: m.reflectance.0,
                    exitance: m.exitance.0,
                    two_sided: m.two_sided,
                })
                .collect(),
            surfaces: file
                .surfaces
                .into_iter()
                .map(|s| SurfaceInput {
                    name: s.name,
                    material: s.material,
                    vertices: corners(s.vertices),
                    holes: s.holes.into_iter().map(corners).collect(),
                })
                .collect(),
            triangulate: false,
            notes: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn shipped_schema_is_up_to_date() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scene.schema.json");
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            std::fs::write(path, schema()).unwrap();
        }
        assert!(
            std::fs::read_to_string(path).unwrap() == schema(),
            "scene.schema.json is out of date: run this test with UPDATE_SCHEMA=1"
        );
    }

    #[test]
    fn scene_survives_a_round_trip_bit_for_bit() {
        let scene = SceneInput {
            length_unit: LengthUnit::Foot,
            quantity: Quantity::None,
            materials: vec![
                MaterialInput {
                    name: "wei\u{df} \"1\"".to_owned(),
                    reflectance: vec![0.1, 1.0 / 3.0],
                    exitance: vec![0.0],
                    two_sided: true,
                },
                MaterialInput {
                    name: "a".to_owned(),
                    reflectance: vec![0.0],
                    exitance: vec![5e-324],
                    two_sided: false,
                },
            ],
            surfaces: vec![SurfaceInput {
                name: "f".to_owned(),
                material: "a".to_owned(),
                vertices: vec![
                    dvec3(-0.0, 1e300, 0.1 + 0.2),
                    dvec3(1.0, 2.0, 3.0),
                    dvec3(f64::MAX, f64::MIN_POSITIVE, 1e23),
                ],
                holes: vec![vec![dvec3(1e-9, 2.5, 3.25)]],
            }],
            triangulate: false,
            notes: Vec::new(),
        };
        let text = write(&scene);
        let back = read(&text).unwrap();
        assert_eq!(back, scene);
        assert!(back.surfaces[0].vertices[0].x.is_sign_negative());
        assert_eq!(write(&back), text);
    }

    #[test]
    fn errors_carry_line_and_column() {
        let error = read("{\n  \"antumbra\": 2,\n}").unwrap_err();
        assert_eq!(error.line, Some(2));
        assert!(error.to_string().starts_with("line 2, column "));
        assert!(error.message.contains("version 2"), "{error}");
        assert!(read(" \n").unwrap_err().message.contains("empty"));
    }
}
