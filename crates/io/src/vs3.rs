//! View3D's `.vs3`: the input of NIST's view-factor program, three-dimensional.
//!
//! ```text
//! T  a room                                   title
//! C  encl=1 eps=1.0e-4                        run controls
//! F  3                                        vertices and surfaces follow
//! !  #   x   y   z                            comment, as is a line with /
//! V  1   0.  0.  0.
//! !  #   v1 v2 v3 v4 base cmb emit name       v4 = 0: a triangle
//! S  1    1  2  3  4   0   0  0.90 floor
//! O  2    5  6  7  8                          an obstruction
//! End of data
//! ```
//!
//! With `F 3a` each surface brings its own plane instead: a corner, an azimuth,
//! a tilt and a rectangle (`R`), triangle (`T`) or quadrilateral (`Q`) in it.
//!
//! Corners run counter-clockwise as seen from the front, as in a scene file.
//! Emittance ε becomes the reflectance 1 − ε; nothing emits.
//!
//! # Source
//!
//! Walton, *Calculation of Obstructed View Factors by Adaptive Integration*,
//! NISTIR 6925, 2002, and the example files of View3D 3.5, which are in the
//! public domain.

use crate::ReadError;
use crate::subtract::{Misfit, subtract};
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, SceneInput, SurfaceInput};
use glam::{DVec3, dvec3};
use std::collections::{BTreeMap, BTreeSet};

/// View3D computes with no smaller emittance.
const SMALLEST_EMITTANCE: f64 = 0.001;

/// The material of obstructions.
const OBSTRUCTION: &str = "obstruction";

/// Reads a View3D file of three dimensions.
///
/// * `unit` — a `.vs3` file has no unit of length.
///
/// A surface keeps its name if no other has it; else it is `NUMBER:NAME`. A
/// surface that View3D combines with another (`cmb`) is `FIRST/NAME`, so that
/// all parts of the combined surface start with the name of the first. A base
/// surface gets holes where its sub-surfaces (`base`) lie; where they part it,
/// its pieces are `NAME.1`, `NAME.2`, ….
///
/// # Errors
///
/// [`ReadError`] with the line for what View3D does not take either: unknown
/// letters, numbers that are none or out of sequence, vertices that are not
/// there, sub-surfaces that do not lie in their base. Files of two dimensions
/// (`F 2`) and masking or null surfaces (`M`, `N`) are refused with a word why.
pub fn read(text: &str, unit: LengthUnit) -> Result<SceneInput, ReadError> {
    let mut parser = Parser::new(text);
    parser.run()?;
    parser.into_scene(unit)
}

/// A line of data: its number and its words.
type Line<'a> = (usize, Vec<&'a str>);

/// A surface as it stands.
struct Surface {
    line: usize,
    is_obstruction: bool,
    /// Three or four, from 1.
    corners: Vec<usize>,
    /// The surface it lies in, from 1; 0 is none.
    base: usize,
    /// The surface it reports with, from 1; 0 is none.
    combined: usize,
    emittance: f64,
    name: Option<String>,
}

struct Parser<'a> {
    lines: std::vec::IntoIter<Line<'a>>,
    has_planes: bool,
    vertices: Vec<DVec3>,
    surfaces: Vec<Surface>,
    controls: Vec<String>,
    /// Surfaces whose emittance View3D raises.
    n_raised: usize,
    notes: Vec<String>,
}

impl<'a> Parser<'a> {
    fn new(text: &'a str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let lines: Vec<Line<'a>> = text
            .lines()
            .enumerate()
            .map(|(i, line)| {
                let line = line.split('!').next().unwrap_or(line);
                let is_gap = |c: char| c.is_whitespace() || c == ',';
                (
                    i + 1,
                    line.split(is_gap).filter(|w| !w.is_empty()).collect(),
                )
            })
            .filter(|(_, words): &Line<'a>| !words.is_empty())
            .collect();
        Self {
            lines: lines.into_iter(),
            has_planes: false,
            vertices: Vec::new(),
            surfaces: Vec::new(),
            controls: Vec::new(),
            n_raised: 0,
            notes: Vec::new(),
        }
    }

    fn run(&mut self) -> Result<(), ReadError> {
        while let Some((line, words)) = self.lines.next() {
            let (keyword, rest) = (words[0], &words[1..]);
            let letter = keyword.chars().next().unwrap_or(' ').to_ascii_uppercase();
            match letter {
                'T' | 'X' | '/' => {}
                'C' => self.controls.extend(rest.iter().map(|&w| w.to_owned())),
                'F' => self.format(line, rest)?,
                'V' => self.vertex(line, rest)?,
                'S' | 'O' if self.has_planes => self.surface_in_plane(line, letter == 'O', rest)?,
                'S' | 'O' => self.surface(line, letter == 'O', rest)?,
                'M' | 'N' => {
                    let what = if letter == 'M' { "masking" } else { "null" };
                    let why = format!(
                        "'{letter}' is a {what} surface, which there is no like of here: leave it out, or make it an obstruction (O)"
                    );
                    return Err(ReadError::at_line(line, why));
                }
                'E' | '*' => break,
                _ => {
                    let why = format!(
                        "'{keyword}' starts no line of a .vs3 file (allowed T, C, F, V, S, O, E, ! and /)"
                    );
                    return Err(ReadError::at_line(line, why));
                }
            }
        }
        if self.surfaces.is_empty() {
            return Err(ReadError::whole(
                "there is no surface in it: is it a View3D file?",
            ));
        }
        Ok(())
    }

    fn format(&mut self, line: usize, rest: &[&str]) -> Result<(), ReadError> {
        if !self.surfaces.is_empty() {
            return Err(ReadError::at_line(line, "F stands after surfaces"));
        }
        match rest.first().map(|w| w.to_ascii_lowercase()).as_deref() {
            Some("3") => Ok(()),
            Some("3a") => {
                self.has_planes = true;
                Ok(())
            }
            Some("2") => Err(ReadError::at_line(
                line,
                "the file is of two dimensions (F 2, View2D), where surfaces are lines without end: only F 3 and F 3a can be read",
            )),
            other => Err(ReadError::at_line(
                line,
                format!(
                    "geometry '{}' is unknown (allowed 3 and 3a)",
                    other.unwrap_or("")
                ),
            )),
        }
    }

    fn vertex(&mut self, line: usize, rest: &[&str]) -> Result<(), ReadError> {
        if self.has_planes {
            return Err(ReadError::at_line(
                line,
                "a vertex in a file of geometry 3a, whose surfaces bring their own corners",
            ));
        }
        let number = self.vertices.len() + 1;
        in_sequence(line, "vertex", rest, number)?;
        let &[_, x, y, z] = rest else {
            let n = rest.len() - 1;
            let why = format!("vertex {number} has {n} coordinates (3 are needed)");
            return Err(ReadError::at_line(line, why));
        };
        let [x, y, z] = [x, y, z].map(|word| real(line, word));
        self.vertices.push(dvec3(x?, y?, z?));
        Ok(())
    }

    /// `S # v1 v2 v3 v4 base cmb emit name`, `O # v1 v2 v3 v4 name`.
    fn surface(
        &mut self,
        line: usize,
        is_obstruction: bool,
        rest: &[&str],
    ) -> Result<(), ReadError> {
        let number = self.surfaces.len() + 1;
        in_sequence(line, "surface", rest, number)?;
        let needed = if is_obstruction { 5 } else { 8 };
        if let Some(shape @ ("R" | "r" | "T" | "t" | "Q" | "q")) = rest.get(1).copied() {
            let why = format!("'{shape}' is no vertex but a shape: is the file one of F 3a?");
            return Err(ReadError::at_line(line, why));
        }
        if rest.len() < needed {
            let columns = if is_obstruction {
                "number, v1, v2, v3, v4"
            } else {
                "number, v1, v2, v3, v4, base, cmb, emit, and a name"
            };
            let why = format!(
                "surface {number} has {} columns (needed: {columns})",
                rest.len()
            );
            return Err(ReadError::at_line(line, why));
        }
        let mut corners = Vec::with_capacity(4);
        for (k, word) in rest[1..5].iter().enumerate() {
            match index(line, "vertex", word)? {
                0 if k == 3 => {}
                0 => {
                    let why = format!(
                        "vertex 0 as corner {} of surface {number} (only the fourth may be 0, in a triangle)",
                        k + 1
                    );
                    return Err(ReadError::at_line(line, why));
                }
                v => corners.push(v),
            }
        }
        let columns = &rest[5..];
        self.finish(line, is_obstruction, corners, columns)
    }

    /// `S # shape base cmb emit name`, then a corner, azimuth, tilt, and the shape
    /// in its plane, over one line or several.
    fn surface_in_plane(
        &mut self,
        line: usize,
        is_obstruction: bool,
        rest: &[&str],
    ) -> Result<(), ReadError> {
        let number = self.surfaces.len() + 1;
        in_sequence(line, "surface", rest, number)?;
        let shape = rest.get(1).map(|w| w.to_ascii_uppercase());
        let n_sizes = match shape.as_deref() {
            Some("R") => 2,
            Some("T") => 6,
            Some("Q") => 8,
            other => {
                let why = format!(
                    "surface {number} has the shape '{}' (allowed R, T and Q)",
                    other.unwrap_or("")
                );
                return Err(ReadError::at_line(line, why));
            }
        };
        let numbers = self.numbers(line, 5 + n_sizes)?;
        let [x, y, z, azimuth, tilt] = [0, 1, 2, 3, 4].map(|k| numbers[k]);
        let sizes = &numbers[5..];
        let in_plane: Vec<(f64, f64)> = if n_sizes == 2 {
            let (width, height) = (sizes[0], sizes[1]);
            vec![(0.0, height), (0.0, 0.0), (width, 0.0), (width, height)]
        } else {
            sizes.chunks_exact(2).map(|p| (p[0], p[1])).collect()
        };
        // Along the plane to the right, and up in it.
        let (sin_azimuth, cos_azimuth) = sin_cos_degrees(azimuth);
        let (sin_tilt, cos_tilt) = sin_cos_degrees(tilt);
        let right = dvec3(-cos_azimuth, sin_azimuth, 0.0);
        let up = dvec3(-cos_tilt * sin_azimuth, -cos_tilt * cos_azimuth, sin_tilt);
        let first = self.vertices.len() + 1;
        let corner = dvec3(x, y, z);
        let n = in_plane.len();
        self.vertices.extend(
            in_plane
                .into_iter()
                .map(|(u, v)| corner + u * right + v * up),
        );
        let columns = rest.get(2..).unwrap_or(&[]);
        self.finish(line, is_obstruction, (first..first + n).collect(), columns)
    }

    /// The next `n` numbers, from the lines after `line`.
    fn numbers(&mut self, line: usize, n: usize) -> Result<Vec<f64>, ReadError> {
        let mut numbers = Vec::with_capacity(n);
        let mut last = line;
        while numbers.len() < n {
            let Some((line, words)) = self.lines.next() else {
                let why = format!("the file ends after {} of {n} numbers", numbers.len());
                return Err(ReadError::at_line(last, why));
            };
            last = line;
            for word in words {
                numbers.push(real(line, word)?);
            }
        }
        if numbers.len() > n {
            let why = format!("{} numbers of a surface (needed {n})", numbers.len());
            return Err(ReadError::at_line(last, why));
        }
        Ok(numbers)
    }

    /// `base cmb emit name` of a surface; an obstruction has a name at most.
    fn finish(
        &mut self,
        line: usize,
        is_obstruction: bool,
        corners: Vec<usize>,
        columns: &[&str],
    ) -> Result<(), ReadError> {
        let mut surface = Surface {
            line,
            is_obstruction,
            corners,
            base: 0,
            combined: 0,
            emittance: 1.0,
            name: None,
        };
        if is_obstruction {
            // Some files give it the columns of a surface; they mean nothing.
            let name = columns.last().filter(|word| word.parse::<f64>().is_err());
            surface.name = name.map(|&word| word.to_owned());
        } else {
            let &[base, combined, emittance, ref name @ ..] = columns else {
                let why = format!(
                    "{} of the columns base, cmb and emit (all 3 are needed)",
                    columns.len()
                );
                return Err(ReadError::at_line(line, why));
            };
            surface.base = index(line, "base", base)?;
            surface.combined = index(line, "cmb", combined)?;
            surface.emittance = real(line, emittance)?;
            if !(0.0..=1.0).contains(&surface.emittance) {
                let why = format!("emittance {emittance} (allowed 0 to 1)");
                return Err(ReadError::at_line(line, why));
            }
            if surface.emittance < SMALLEST_EMITTANCE {
                surface.emittance = SMALLEST_EMITTANCE;
                self.n_raised += 1;
            }
            surface.name = (!name.is_empty()).then(|| name.join(" "));
        }
        self.surfaces.push(surface);
        Ok(())
    }

    fn into_scene(mut self, unit: LengthUnit) -> Result<SceneInput, ReadError> {
        self.check_numbers()?;
        let names = self.names();
        let mut sub_surfaces: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (s, surface) in self.surfaces.iter().enumerate() {
            if surface.base > 0 {
                sub_surfaces.entry(surface.base - 1).or_default().push(s);
            }
        }
        let mut notes = self.general_notes(&names);
        let mut taken: BTreeSet<String> = names.iter().cloned().collect();
        let mut materials = Vec::new();
        let mut surfaces = Vec::with_capacity(self.surfaces.len());
        for (s, surface) in self.surfaces.iter().enumerate() {
            let material = material(surface);
            if !materials.contains(&material) {
                materials.push(material.clone());
            }
            let mut push = |name: String, vertices: Vec<DVec3>, holes: Vec<Vec<DVec3>>| {
                surfaces.push(SurfaceInput {
                    name,
                    material: material.name.clone(),
                    vertices,
                    holes,
                });
            };
            let Some(cuts) = sub_surfaces.get(&s) else {
                push(names[s].clone(), self.corners(surface), Vec::new());
                continue;
            };
            let outlines: Vec<Vec<DVec3>> = cuts
                .iter()
                .map(|&c| self.corners(&self.surfaces[c]))
                .collect();
            let outlines: Vec<&[DVec3]> = outlines.iter().map(Vec::as_slice).collect();
            let regions = subtract(&self.corners(surface), &outlines)
                .map_err(|misfit| self.misfit(&misfit, &names, s, cuts))?;
            let pieces = match regions.len() {
                0 => "; nothing is left of it".to_owned(),
                1 => String::new(),
                n => format!("; {n} pieces are left, '{0}.1' to '{0}.{n}'", names[s]),
            };
            notes.push(format!(
                "surface '{}': {} {} cut out of it{pieces}",
                names[s],
                listed(cuts.iter().map(|&c| names[c].as_str())),
                if cuts.len() == 1 { "is" } else { "are" },
            ));
            let n_pieces = regions.len();
            for (k, region) in regions.into_iter().enumerate() {
                let name = if n_pieces == 1 {
                    names[s].clone()
                } else {
                    unique(&format!("{}.{}", names[s], k + 1), &mut taken)
                };
                push(name, region.outline, region.holes);
            }
        }
        Ok(SceneInput {
            length_unit: unit,
            quantity: Quantity::Radiometric,
            materials,
            surfaces,
            triangulate: true,
            notes,
        })
    }

    fn corners(&self, surface: &Surface) -> Vec<DVec3> {
        // Checked by `check_numbers`.
        let corners = surface.corners.iter();
        corners.map(|&v| self.vertices[v - 1]).collect()
    }

    fn check_numbers(&self) -> Result<(), ReadError> {
        let n = self.vertices.len();
        for (s, surface) in self.surfaces.iter().enumerate() {
            let number = s + 1;
            let fail = |why: String| Err(ReadError::at_line(surface.line, why));
            if let Some(v) = surface.corners.iter().find(|&&v| v > n) {
                return fail(format!(
                    "surface {number} has vertex {v} as a corner, but the file has {n} vertices"
                ));
            }
            let base = surface.base;
            let is_base = base < number
                || self
                    .surfaces
                    .get(base - 1)
                    .is_some_and(|b| b.is_obstruction);
            if !is_base {
                return fail(format!(
                    "surface {number} lies in base {base} (allowed an earlier surface or an obstruction)"
                ));
            }
            let first = surface.combined;
            if first >= number {
                return fail(format!(
                    "surface {number} is combined with {first} (allowed an earlier surface)"
                ));
            }
            if first > 0 && self.surfaces[first - 1].combined > 0 {
                return fail(format!(
                    "surface {number} is combined with {first}, which is combined itself (allowed the first of the group)"
                ));
            }
            if first > 0 && self.surfaces[first - 1].is_obstruction {
                return fail(format!(
                    "surface {number} is combined with an obstruction, {first}"
                ));
            }
        }
        Ok(())
    }

    /// The names of all surfaces, each once.
    fn names(&self) -> Vec<String> {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for name in self.surfaces.iter().filter_map(|s| s.name.as_deref()) {
            *counts.entry(name).or_default() += 1;
        }
        let mut taken = BTreeSet::new();
        let mut names: Vec<String> = Vec::with_capacity(self.surfaces.len());
        for (s, surface) in self.surfaces.iter().enumerate() {
            let number = s + 1;
            let own = match surface.name.as_deref() {
                Some(name) if counts[name] == 1 => name.to_owned(),
                Some(name) => format!("{number}:{name}"),
                None => format!("surface.{number}"),
            };
            let name = match surface.combined {
                0 => own,
                first => format!("{}/{own}", names[first - 1]),
            };
            names.push(unique(&name, &mut taken));
        }
        names
    }

    /// What a user may not expect of the whole file.
    fn general_notes(&mut self, names: &[String]) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        if !self.controls.is_empty() {
            let text = self.controls.join(" ");
            let is_enclosure = text
                .split_whitespace()
                .any(|w| w.strip_prefix("encl=").is_some_and(|v| v != "0"));
            let enclosure = if is_enclosure {
                "; encl says that the surfaces enclose a room"
            } else {
                ""
            };
            notes.push(format!(
                "View3D's run controls are not used: {text}{enclosure}"
            ));
        }
        let n_shared = self.surfaces.iter().zip(1..).filter(|(surface, number)| {
            let name = surface.name.as_deref().unwrap_or_default();
            let own = format!("{number}:{name}");
            names[number - 1].rsplit('/').next() == Some(own.as_str())
        });
        let n_shared = n_shared.count();
        if n_shared > 0 {
            notes.push(format!(
                "{n_shared} surfaces share their names with others: they are named NUMBER:NAME"
            ));
        }
        let mut parts = self
            .surfaces
            .iter()
            .zip(names)
            .filter(|(s, _)| s.combined > 0);
        if let Some((surface, example)) = parts.next() {
            notes.push(format!(
                "{} surfaces are parts of combined ones (cmb) and stay single here: they are named FIRST/NAME, such as '{example}', a part of '{}'",
                parts.count() + 1,
                names[surface.combined - 1],
            ));
        }
        let n_obstructions = self.surfaces.iter().filter(|s| s.is_obstruction).count();
        if n_obstructions > 0 {
            let are = if n_obstructions == 1 {
                "obstruction (O) is"
            } else {
                "obstructions (O) are"
            };
            notes.push(format!(
                "{n_obstructions} {are} black: light is blocked and none reflected"
            ));
        }
        if self.n_raised > 0 {
            notes.push(format!(
                "{} surfaces have an emittance below {SMALLEST_EMITTANCE}: {SMALLEST_EMITTANCE} is used, as in View3D",
                self.n_raised
            ));
        }
        notes
    }

    fn misfit(&self, misfit: &Misfit, names: &[String], base: usize, cuts: &[usize]) -> ReadError {
        let (at, what) = match *misfit {
            Misfit::OffPlane(i, off) => {
                (cuts[i], format!("lies {off:.3e} off the plane of its base"))
            }
            Misfit::Turned(i) => (cuts[i], "faces the other way than its base".to_owned()),
            Misfit::Outside(i) => (cuts[i], "does not lie within its base".to_owned()),
            Misfit::Overlap(i, j) => (
                cuts[j],
                format!("overlaps sub-surface '{}' of the same base", names[cuts[i]]),
            ),
        };
        let why = format!("surface '{}' {what}, '{}'", names[at], names[base]);
        ReadError::at_line(self.surfaces[at].line, why)
    }
}

fn material(surface: &Surface) -> MaterialInput {
    let (name, reflectance) = if surface.is_obstruction {
        (OBSTRUCTION.to_owned(), 0.0)
    } else {
        // 1 − 0.9 is 0.1, not 0.09999999999999998.
        let reflectance = ((1.0 - surface.emittance) * 1e12).round() / 1e12;
        (format!("emittance {}", surface.emittance), reflectance)
    };
    MaterialInput {
        name,
        reflectance: vec![reflectance],
        exitance: vec![0.0],
        two_sided: false,
    }
}

/// `name`, or a variant that is not taken yet.
fn unique(name: &str, taken: &mut BTreeSet<String>) -> String {
    let mut free = name.to_owned();
    let mut k = 2;
    while !taken.insert(free.clone()) {
        free = format!("{name}_{k}");
        k += 1;
    }
    free
}

/// Up to four names, and how many more there are.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const SHOWN: usize = 4;
    let names: Vec<String> = names.map(|name| format!("'{name}'")).collect();
    let mut text = names[..names.len().min(SHOWN)].join(", ");
    if names.len() > SHOWN {
        text += &format!(" and {} more", names.len() - SHOWN);
    }
    text
}

/// Vertices and surfaces are numbered from 1 without gaps.
fn in_sequence(line: usize, what: &str, rest: &[&str], expected: usize) -> Result<(), ReadError> {
    let Some(word) = rest.first() else {
        let why = format!("a {what} without a number ({expected} is next)");
        return Err(ReadError::at_line(line, why));
    };
    let found = index(line, what, word)?;
    if found == expected {
        return Ok(());
    }
    let why = format!("{what} {found} is out of sequence ({expected} is next)");
    Err(ReadError::at_line(line, why))
}

fn index(line: usize, what: &str, word: &str) -> Result<usize, ReadError> {
    word.parse::<u32>().map(|n| n as usize).map_err(|_| {
        let why = format!("{what} '{word}' is no number of one{}", dash_hint(word));
        ReadError::at_line(line, why)
    })
}

fn real(line: usize, word: &str) -> Result<f64, ReadError> {
    match word.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(_) => Err(ReadError::at_line(line, format!("'{word}' is not finite"))),
        Err(_) => {
            let why = format!("'{word}' is not a number{}", dash_hint(word));
            Err(ReadError::at_line(line, why))
        }
    }
}

/// Word processors make of a minus what no program reads.
fn dash_hint(word: &str) -> String {
    let dash = word
        .chars()
        .find(|&c| ('\u{2010}'..='\u{2015}').contains(&c) || c == '\u{2212}');
    dash.map_or_else(String::new, |c| {
        format!(": it has '{c}' (U+{:04X}) in place of '-'", u32::from(c))
    })
}

/// Sine and cosine, exact for right angles.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let quarter = degrees / 90.0;
    if quarter.fract() != 0.0 {
        return degrees.to_radians().sin_cos();
    }
    match quarter.rem_euclid(4.0) as u8 {
        0 => (0.0, 1.0),
        1 => (1.0, 0.0),
        2 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    }
}
