//! STL, as text or binary, read as polygons.
//!
//! Triangles are put together into polygons (the module `merge`). STL has no
//! material and no unit of length; corners run counter-clockwise as seen from
//! outside, and the normals that stand beside them are not used.
//!
//! The parser is our own: `stl_io` 0.11 forgets the names of solids, gives no
//! line in its errors, and takes binary files that begin with "solid" for text.

use crate::ReadError;
use crate::materials::{self, DEFAULT_REFLECTANCE};
use crate::merge::{self, Part};
use antumbra_scene::{LengthUnit, Quantity, SceneInput};
use glam::DVec3;

/// Bytes before the count of triangles, and those of a triangle: a normal, three
/// corners, two bytes for whatever a program likes.
const HEADER: usize = 80;
const RECORD: usize = 50;

/// Reads an STL file.
///
/// A file is binary if its length fits the count of triangles in it, whatever it
/// begins with.
///
/// * `unit` — STL has no unit of length.
///
/// A surface is named after its solid; where that has several polygons, `name.1`,
/// `name.2`, …; without a name `surface.1`, `surface.2`, …
///
/// # Errors
///
/// [`ReadError`] with the line, or the byte of a binary file, for what is not STL:
/// a length that does not fit the count, words in the wrong place, coordinates
/// that are not finite, a text that ends before its solid does, no triangles.
pub fn read(bytes: &[u8], unit: LengthUnit) -> Result<SceneInput, ReadError> {
    let solids = if is_binary(bytes) {
        vec![from_binary(bytes)?]
    } else {
        from_text(bytes)?
    };
    let n: usize = solids.iter().map(|solid| solid.triangles.len()).sum();
    if n == 0 {
        return Err(ReadError::whole("there is no triangle in it"));
    }
    let material = materials::default("default".to_owned());
    let n_against: usize = solids.iter().map(|solid| solid.n_against).sum();
    let parts: Vec<Part> = solids
        .into_iter()
        .filter(|solid| !solid.triangles.is_empty())
        .map(|solid| Part {
            name: solid.name,
            material: material.name.clone(),
            magnitude: largest(&solid.triangles),
            triangles: solid.triangles,
        })
        .collect();
    let mut merged = merge::surfaces(&parts, unit.symbol());
    let mut notes = vec![format!(
        "{n} triangle{} without a material, for STL has none: '{}' with a reflectance of {DEFAULT_REFLECTANCE} is used",
        if n == 1 { "" } else { "s" },
        material.name
    )];
    if n_against > 0 {
        notes.push(format!(
            "{n_against} triangle{} with a normal against the order of the corners: the order counts",
            if n_against == 1 { "" } else { "s" }
        ));
    }
    notes.append(&mut merged.notes);
    Ok(SceneInput {
        length_unit: unit,
        quantity: Quantity::Radiometric,
        materials: vec![material],
        surfaces: merged.surfaces,
        triangulate: true,
        notes,
    })
}

/// Triangles under one name.
#[derive(Default)]
struct Solid {
    name: Option<String>,
    triangles: Vec<[DVec3; 3]>,
    /// Triangles whose normal points to the other side.
    n_against: usize,
}

impl Solid {
    fn add(&mut self, normal: DVec3, corners: [DVec3; 3]) {
        let [a, b, c] = corners;
        if (b - a).cross(c - a).dot(normal) < 0.0 {
            self.n_against += 1;
        }
        self.triangles.push(corners);
    }
}

fn largest(triangles: &[[DVec3; 3]]) -> f64 {
    triangles
        .iter()
        .flatten()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max)
}

/// The number of triangles and the length that goes with it.
fn counted(bytes: &[u8]) -> Option<(u32, u64)> {
    let four = bytes.get(HEADER..)?.first_chunk()?;
    let n = u32::from_le_bytes(*four);
    Some((n, (HEADER + 4) as u64 + RECORD as u64 * u64::from(n)))
}

fn is_binary(bytes: &[u8]) -> bool {
    let fits = counted(bytes).is_some_and(|(_, length)| length == bytes.len() as u64);
    fits || !starts_as_text(bytes)
}

/// Does it begin with the word `solid`, and is there no zero byte near, as there
/// is in the header, the count or the first numbers of a binary file?
fn starts_as_text(bytes: &[u8]) -> bool {
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let start = start.trim_ascii_start();
    let has_word = start
        .get(..5)
        .is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    has_word && !bytes.iter().take(1024).any(|&b| b == 0)
}

fn from_binary(bytes: &[u8]) -> Result<Solid, ReadError> {
    let Some((n, needed)) = counted(bytes) else {
        return Err(ReadError::whole(format!(
            "the file has {} bytes: neither the word 'solid' of a text, nor the {} bytes a binary file begins with",
            bytes.len(),
            HEADER + 4
        )));
    };
    if needed != bytes.len() as u64 {
        return Err(ReadError::whole(format!(
            "the file has {} bytes, but {n} triangles, as byte {HEADER} says, take {needed}",
            bytes.len()
        )));
    }
    let mut solid = Solid::default();
    for (t, record) in bytes[HEADER + 4..].chunks_exact(RECORD).enumerate() {
        let vector = |k: usize| {
            DVec3::from_array(std::array::from_fn(|axis| {
                let at = 12 * k + 4 * axis;
                let four = [record[at], record[at + 1], record[at + 2], record[at + 3]];
                f64::from(f32::from_le_bytes(four))
            }))
        };
        let corners = [vector(1), vector(2), vector(3)];
        if let Some(k) = corners.iter().position(|p| !p.is_finite()) {
            let p = corners[k];
            return Err(ReadError::whole(format!(
                "byte {}: triangle {} has the corner ({}, {}, {}) (allowed finite numbers)",
                HEADER + 4 + RECORD * t + 12 * (k + 1),
                t + 1,
                p.x,
                p.y,
                p.z
            )));
        }
        solid.add(vector(0), corners);
    }
    Ok(solid)
}

/// Where in a text the parser is.
enum State {
    /// Between solids.
    Outside,
    /// In a solid, between facets.
    Solid,
    /// After `facet normal`.
    Facet,
    /// After `outer loop`: corners.
    Loop,
    /// After `endloop`.
    AfterLoop,
}

fn from_text(bytes: &[u8]) -> Result<Vec<Solid>, ReadError> {
    // Names may be in any encoding; all else is ASCII.
    let text = match crate::text::decoded(bytes) {
        Ok(text) => text.text,
        Err(_) => String::from_utf8_lossy(bytes).into_owned(),
    };
    let mut solids: Vec<Solid> = Vec::new();
    let mut state = State::Outside;
    let mut normal = DVec3::ZERO;
    let mut corners: Vec<DVec3> = Vec::new();
    let mut n_lines = 0;
    for (i, line) in text.lines().enumerate() {
        n_lines = i + 1;
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else {
            continue;
        };
        let keyword = keyword.to_ascii_lowercase();
        state = match (state, keyword.as_str()) {
            (State::Outside, "solid") => {
                let name = words.collect::<Vec<_>>().join(" ");
                solids.push(Solid {
                    name: Some(name).filter(|name| !name.is_empty()),
                    ..Solid::default()
                });
                State::Solid
            }
            (State::Solid, "facet") => {
                // A normal that is none is not used, and no reason to stop.
                let numbers: Vec<f64> = words.skip(1).map_while(|w| w.parse().ok()).collect();
                normal = match numbers[..] {
                    [x, y, z] => DVec3::new(x, y, z),
                    _ => DVec3::ZERO,
                };
                State::Facet
            }
            (State::Facet, "outer") => {
                corners.clear();
                State::Loop
            }
            (State::Loop, "vertex") => {
                corners.push(position(n_lines, words)?);
                State::Loop
            }
            (State::Loop, "endloop") => {
                let [a, b, c] = corners[..] else {
                    return Err(ReadError::at_line(
                        n_lines,
                        format!("a facet with {} corners (allowed 3)", corners.len()),
                    ));
                };
                if let Some(solid) = solids.last_mut() {
                    solid.add(normal, [a, b, c]);
                }
                State::AfterLoop
            }
            (State::AfterLoop, "endfacet") => State::Solid,
            (State::Solid, "endsolid") => State::Outside,
            (state, _) => {
                return Err(ReadError::at_line(
                    n_lines,
                    format!("'{}' (allowed {})", line.trim(), state.allowed()),
                ));
            }
        };
    }
    match state {
        State::Outside => Ok(solids),
        state => Err(ReadError::at_line(
            n_lines,
            format!(
                "the file ends within a solid ({} expected): it is not whole",
                state.allowed()
            ),
        )),
    }
}

impl State {
    fn allowed(&self) -> &'static str {
        match self {
            Self::Outside => "'solid'",
            Self::Solid => "'facet normal' or 'endsolid'",
            Self::Facet => "'outer loop'",
            Self::Loop => "'vertex' or 'endloop'",
            Self::AfterLoop => "'endfacet'",
        }
    }
}

fn position<'a>(line: usize, words: impl Iterator<Item = &'a str>) -> Result<DVec3, ReadError> {
    let words: Vec<&str> = words.collect();
    if words.len() != 3 {
        return Err(ReadError::at_line(
            line,
            format!("a vertex with {} coordinates (allowed 3)", words.len()),
        ));
    }
    let mut point = DVec3::ZERO;
    for (k, word) in words.iter().enumerate() {
        // The format has single precision: what is above its range is none.
        let value = word
            .parse()
            .ok()
            .filter(|x: &f64| x.abs() < f64::from(f32::MAX));
        point[k] = value.ok_or_else(|| {
            ReadError::at_line(line, format!("'{word}' is not a finite coordinate"))
        })?;
    }
    Ok(point)
}
