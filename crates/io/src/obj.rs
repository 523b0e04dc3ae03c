//! OBJ with MTL, read as polygons: n-gons stay whole, names are kept.
//!
//! Materials: `Kd` is the reflectance, `Ke` the exitance as it stands, in W/m²
//! per band (no factor π is applied). `Ka` is no emission. Everything else in a
//! material library is about looks and is passed over.
//!
//! The parser is our own and goes by lines. `tobj` 4.0 was tried on files made
//! to trip loaders (`fixtures/obj`): its errors give no line, and it refuses a
//! whole file for one coordinate `1.#IND`, where the check of the scene can name
//! the one surface that has it.

use crate::ReadError;
use crate::materials::{DEFAULT_REFLECTANCE, below_one, in_as_few_bands};
use crate::names::Namer;
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, SceneInput, SurfaceInput};
use glam::DVec3;
use std::collections::BTreeMap;

/// Reads an OBJ file.
///
/// * `load_mtl` — gives the text of a material library by its name in the file,
///   or says why it cannot; that is a note, not an error.
/// * `unit` — OBJ has no unit of length.
///
/// A surface is named after its group or object; where that has several faces,
/// `name.1`, `name.2`, …; without a group, `surface.1`, `surface.2`, ….
///
/// # Errors
///
/// [`ReadError`] with the line for what is not OBJ: numbers that are none,
/// indices that are zero or out of range, a file without faces. What is OBJ but
/// no surface (two corners, NaN) is left to the check of the scene, which knows
/// names.
pub fn read(
    obj: &str,
    load_mtl: &mut dyn FnMut(&str) -> Result<String, String>,
    unit: LengthUnit,
) -> Result<SceneInput, ReadError> {
    let mut parser = Parser::default();
    for (number, line) in logical_lines(obj) {
        parser.line(number, &line, load_mtl)?;
    }
    if parser.faces.is_empty() {
        return Err(ReadError::whole(
            "there is no face in it: is it an OBJ file?",
        ));
    }
    parser.into_scene(unit)
}

/// A face as it stands: where, under which name and material, which corners.
struct FaceLine {
    line: usize,
    group: Option<String>,
    material: Option<String>,
    /// From 1, not yet checked against the number of vertices.
    corners: Vec<usize>,
}

/// A material of a library.
#[derive(Clone, Default)]
struct Mtl {
    ambient: Option<[f64; 3]>,
    diffuse: Option<[f64; 3]>,
    emission: Option<[f64; 3]>,
    is_textured: bool,
}

#[derive(Default)]
struct Parser {
    positions: Vec<DVec3>,
    faces: Vec<FaceLine>,
    object: Option<String>,
    group: Option<String>,
    material: Option<String>,
    library: BTreeMap<String, Mtl>,
    notes: Vec<String>,
    /// Keywords passed over, with how many lines and the first.
    skipped: BTreeMap<String, (usize, usize)>,
}

impl Parser {
    fn line(
        &mut self,
        number: usize,
        line: &str,
        load_mtl: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<(), ReadError> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let name = || (!rest.is_empty()).then(|| rest.to_owned());
        match keyword {
            "v" => self.positions.push(position(number, rest)?),
            "f" | "fo" => self.face(number, rest)?,
            "o" => {
                self.object = name();
                self.group = name();
            }
            "g" => self.group = name().or_else(|| self.object.clone()),
            "usemtl" => self.material = name(),
            "mtllib" => self.load_library(rest, load_mtl)?,
            "vt" | "vn" | "vp" | "s" | "mg" => {}
            _ => {
                let (n, _first) = self
                    .skipped
                    .entry(keyword.to_owned())
                    .or_insert((0, number));
                *n += 1;
            }
        }
        Ok(())
    }

    fn face(&mut self, number: usize, rest: &str) -> Result<(), ReadError> {
        let n = self.positions.len();
        let corners = rest
            .split_whitespace()
            .map(|corner| {
                let text = corner.split('/').next().unwrap_or(corner);
                let index: i64 = text.parse().map_err(|_| {
                    ReadError::at_line(number, format!("'{corner}' is no corner of a face"))
                })?;
                if index > 0 {
                    return Ok(index as usize);
                }
                let back = index.unsigned_abs() as usize;
                if index == 0 || back > n {
                    let what = if index == 0 {
                        "vertex index 0 (allowed from 1, or negative)".to_owned()
                    } else {
                        format!("vertex index {index}, but {n} vertices stand before it")
                    };
                    return Err(ReadError::at_line(number, what));
                }
                Ok(n - back + 1)
            })
            .collect::<Result<Vec<usize>, ReadError>>()?;
        self.faces.push(FaceLine {
            line: number,
            group: self.group.clone(),
            material: self.material.clone(),
            corners,
        });
        Ok(())
    }

    /// The rest of the line is one name, perhaps with blanks, or several.
    fn load_library(
        &mut self,
        rest: &str,
        load_mtl: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<(), ReadError> {
        let whole = load_mtl(rest);
        let names: Vec<&str> = rest.split_whitespace().collect();
        if whole.is_ok() || names.len() < 2 {
            return self.add_library(rest, whole);
        }
        for name in names {
            let text = load_mtl(name);
            self.add_library(name, text)?;
        }
        Ok(())
    }

    fn add_library(&mut self, name: &str, text: Result<String, String>) -> Result<(), ReadError> {
        match text {
            Ok(text) => {
                for (material, mtl) in library(name, &text)? {
                    self.library.entry(material).or_insert(mtl);
                }
            }
            Err(why) => {
                let note = format!("material library '{name}' could not be read: {why}");
                if !self.notes.contains(&note) {
                    self.notes.push(note);
                }
            }
        }
        Ok(())
    }

    fn into_scene(mut self, unit: LengthUnit) -> Result<SceneInput, ReadError> {
        for (keyword, (n, first)) in &self.skipped {
            self.notes.push(format!(
                "{n} lines '{keyword}' passed over, the first is line {first}"
            ));
        }
        let used = self.used_materials();
        let default = default_name(&self.library, &used);
        let n = self.positions.len();
        let mut namer = Namer::new(self.faces.iter().map(|f| f.group.as_deref()));
        let mut surfaces = Vec::with_capacity(self.faces.len());
        for face in &self.faces {
            if let Some(index) = face.corners.iter().find(|&&i| i > n) {
                let what = format!("vertex index {index}, but the file has {n} vertices");
                return Err(ReadError::at_line(face.line, what));
            }
            let known = face
                .material
                .as_ref()
                .filter(|m| self.library.contains_key(*m));
            surfaces.push(SurfaceInput {
                name: namer.next(face.group.as_deref()),
                material: known.unwrap_or(&default).clone(),
                vertices: face
                    .corners
                    .iter()
                    .map(|&i| self.positions[i - 1])
                    .collect(),
                holes: Vec::new(),
            });
        }
        let materials = self.materials(&used, &default);
        Ok(SceneInput {
            length_unit: unit,
            quantity: Quantity::Radiometric,
            materials,
            surfaces,
            triangulate: true,
            notes: self.notes,
        })
    }

    /// Materials of faces in the order of their first use, with the number of
    /// faces; `None` is no material at all.
    fn used_materials(&self) -> Vec<(Option<String>, usize)> {
        let mut used: Vec<(Option<String>, usize)> = Vec::new();
        let mut place: BTreeMap<&Option<String>, usize> = BTreeMap::new();
        for face in &self.faces {
            let i = *place.entry(&face.material).or_insert_with(|| {
                used.push((face.material.clone(), 0));
                used.len() - 1
            });
            used[i].1 += 1;
        }
        used
    }

    fn materials(&mut self, used: &[(Option<String>, usize)], default: &str) -> Vec<MaterialInput> {
        let mut materials = Vec::new();
        let mut has_default = false;
        for (name, n) in used {
            let known = name
                .as_ref()
                .and_then(|name| Some((name, self.library.get(name)?)));
            if let Some((name, mtl)) = known {
                self.notes.extend(notes(name, mtl));
                materials.push(material(name, mtl));
                continue;
            }
            let faces = if *n == 1 { "face" } else { "faces" };
            let why = match name {
                Some(name) => format!("material '{name}' ({n} {faces}) is in no material library"),
                None => format!("{n} {faces} without a material"),
            };
            self.notes.push(format!(
                "{why}: '{default}' with a reflectance of {DEFAULT_REFLECTANCE} is used"
            ));
            has_default = true;
        }
        if has_default {
            materials.push(crate::materials::default(default.to_owned()));
        }
        below_one(&mut materials, &mut self.notes);
        in_as_few_bands(&mut materials);
        materials
    }
}

fn material(name: &str, mtl: &Mtl) -> MaterialInput {
    let emits = mtl.emission.is_some_and(|e| e != [0.0; 3]);
    let diffuse = mtl
        .diffuse
        .unwrap_or([if emits { 0.0 } else { DEFAULT_REFLECTANCE }; 3]);
    MaterialInput {
        name: name.to_owned(),
        reflectance: diffuse.to_vec(),
        exitance: mtl.emission.unwrap_or([0.0; 3]).to_vec(),
        two_sided: false,
    }
}

/// What a user may not expect of a material.
fn notes(name: &str, mtl: &Mtl) -> Vec<String> {
    let emits = mtl.emission.is_some_and(|e| e != [0.0; 3]);
    let lower = name.to_lowercase();
    let sounds_bright = ["light", "lamp", "emit"]
        .iter()
        .any(|word| lower.contains(word));
    let mut notes = Vec::new();
    if !emits && sounds_bright && mtl.ambient.is_some_and(|a| a.iter().any(|&x| x > 0.0)) {
        notes.push(format!(
            "material '{name}' has Ka but no Ke: Ka is not emission, write Ke if it is to emit"
        ));
    }
    if mtl.diffuse.is_none() && !emits {
        notes.push(format!(
            "material '{name}' has no Kd: a reflectance of {DEFAULT_REFLECTANCE} is used"
        ));
    }
    if mtl.is_textured {
        notes.push(format!(
            "material '{name}' has a texture, which is not used"
        ));
    }
    notes
}

/// `default`, or a variant if the library has a material of that name in use.
fn default_name(library: &BTreeMap<String, Mtl>, used: &[(Option<String>, usize)]) -> String {
    let is_taken = |name: &str| {
        library.contains_key(name) && used.iter().any(|(used, _)| used.as_deref() == Some(name))
    };
    let mut name = "default".to_owned();
    while is_taken(&name) {
        name.push('_');
    }
    name
}

fn library(file: &str, text: &str) -> Result<Vec<(String, Mtl)>, ReadError> {
    let mut materials: Vec<(String, Mtl)> = Vec::new();
    for (number, line) in logical_lines(text) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            materials.push((rest.to_owned(), Mtl::default()));
            continue;
        }
        let Some((_, mtl)) = materials.last_mut() else {
            continue;
        };
        let bands = || {
            colour(rest).ok_or_else(|| {
                ReadError::whole(format!(
                    "material library '{file}', line {number}: '{line}' is no colour (allowed one number or three)"
                ))
            })
        };
        match keyword {
            "Ka" => mtl.ambient = colour(rest),
            "Kd" => mtl.diffuse = Some(bands()?),
            "Ke" => mtl.emission = Some(bands()?),
            "map_Kd" | "map_Ke" => mtl.is_textured = true,
            _ => {}
        }
    }
    Ok(materials)
}

/// One number for all bands, or three.
fn colour(text: &str) -> Option<[f64; 3]> {
    let values: Vec<f64> = text.split_whitespace().map(number).collect::<Option<_>>()?;
    match values[..] {
        [grey] => Some([grey; 3]),
        [r, g, b, ..] => Some([r, g, b]),
        _ => None,
    }
}

fn position(line: usize, rest: &str) -> Result<DVec3, ReadError> {
    let mut values = [0.0; 3];
    let mut words = rest.split_whitespace();
    for (k, value) in values.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| {
            ReadError::at_line(line, format!("a vertex has {k} coordinates (3 are needed)"))
        })?;
        *value = number(word)
            .ok_or_else(|| ReadError::at_line(line, format!("'{word}' is not a number")))?;
    }
    // A weight or a colour may follow; neither moves the point.
    Ok(DVec3::from_array(values))
}

/// A number, also in the spellings of C libraries for what is none.
fn number(word: &str) -> Option<f64> {
    word.parse().ok().or_else(|| {
        let (sign, rest) = match word.strip_prefix('-') {
            Some(rest) => (-1.0, rest),
            None => (1.0, word),
        };
        match rest.split_once('#')?.1.to_ascii_uppercase().as_str() {
            "INF" => Some(sign * f64::INFINITY),
            "IND" | "QNAN" | "SNAN" | "NAN" => Some(f64::NAN),
            _ => None,
        }
    })
}

/// Lines with the number of their first part, joined at a `\` at their end,
/// without comments and blanks around; empty ones are left out.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, String)> + '_ {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (i, first) = lines.next()?;
        let mut line = first.trim_end().to_owned();
        while line.ends_with('\\') {
            line.pop();
            line.push(' ');
            let Some((_, next)) = lines.next() else {
                break;
            };
            line.push_str(next.trim_end());
        }
        Some((i + 1, without_comment(&line).trim().to_owned()))
    })
    .filter(|(_, line)| !line.is_empty())
}

/// A comment starts at a `#` that starts a word; `1.#IND` is a number.
fn without_comment(line: &str) -> &str {
    let is_start = |i: usize| i == 0 || line[..i].ends_with(char::is_whitespace);
    line.match_indices('#')
        .find(|&(i, _)| is_start(i))
        .map_or(line, |(i, _)| &line[..i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_plain(obj: &str) -> Result<SceneInput, ReadError> {
        read(
            obj,
            &mut |name| Err(format!("no {name}")),
            LengthUnit::Metre,
        )
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0 0.5\nv 1 1 0 1 0 0\nv 0 1 0\n";

    #[test]
    fn names_come_from_groups_and_are_unique() {
        let obj = format!(
            "{SQUARE}f 1 2 3\no box\nf 1 2 3 4\nf -4 -3 -2\ng lid\nf 1/1 2/2/2 3//3 \\\n 4\ng box.1\nf 1 2 3\n"
        );
        let scene = read_plain(&obj).unwrap();
        let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["surface.1", "box.1", "box.2", "lid", "box.1_2"]);
        assert_eq!(scene.surfaces[3].vertices.len(), 4);
        assert_eq!(scene.materials[0].name, "default");
        assert_eq!(scene.materials[0].reflectance, [0.5]);
    }

    #[test]
    fn emission_is_ke_and_ka_is_noted() {
        let mtl = "newmtl light\nKa 20 20 20\nKd .5 .5 .5\nnewmtl lamp\nKe 3 2 1\nnewmtl unused\nKd 1 1 1";
        let obj = format!(
            "mtllib a b.mtl\n{SQUARE}usemtl light\nf 1 2 3\nusemtl lamp\nf 1 2 3\nusemtl gold\nf 1 2 3\n"
        );
        let mut load = |name: &str| match name {
            "a b.mtl" => Ok(mtl.to_owned()),
            _ => Err("no such file".to_owned()),
        };
        let scene = read(&obj, &mut load, LengthUnit::Millimetre).unwrap();
        let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, ["light", "lamp", "default"]);
        assert_eq!(scene.materials[1].exitance, [3.0, 2.0, 1.0]);
        assert_eq!(scene.materials[1].reflectance, [0.0; 3]);
        assert!(
            scene.notes[0].contains("'light' has Ka"),
            "{:?}",
            scene.notes
        );
        assert!(
            scene.notes[1].contains("'gold' (1 face)"),
            "{:?}",
            scene.notes
        );
    }

    #[test]
    fn white_without_end_is_dimmed_and_said_once() {
        let mtl = "newmtl a\nKd 1 1 1\nnewmtl b\nKd .5 1.5 .5\nnewmtl c\nKd .9 .9 .9";
        let obj =
            format!("mtllib x\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n");
        let scene = read(&obj, &mut |_| Ok(mtl.to_owned()), LengthUnit::Metre).unwrap();
        assert_eq!(scene.materials[0].reflectance, [0.999; 3]);
        assert_eq!(scene.materials[1].reflectance, [0.5, 0.999, 0.5]);
        assert_eq!(scene.materials[2].reflectance, [0.9; 3]);
        assert_eq!(
            scene.notes,
            [
                "a reflectance of 1 or more is taken as 0.999, for nothing reflects all light: in 'a', 'b'"
            ]
        );
        assert!(scene.triangulate);
    }

    #[test]
    fn errors_carry_the_line() {
        for (obj, line, what) in [
            ("v 1 2\n", 1, "2 coordinates"),
            ("\nv 1 2 x\n", 2, "'x'"),
            ("v 0 0 0\nf 0 1 1\n", 2, "index 0"),
            ("v 0 0 0\nf 1 1 2\n", 2, "index 2"),
            ("f -4 -3 -2", 1, "index -4"),
        ] {
            let error = read_plain(obj).unwrap_err();
            assert_eq!(error.line, Some(line), "{obj}");
            assert!(error.message.contains(what), "{error}");
        }
        assert!(read_plain("hello world").is_err());
    }
}
