//! Radiance scene descriptions, of which polygons and diffuse materials are read.
//!
//! ```text
//! void plastic white          modifier, type, identifier
//! 0                           number of strings, and the strings
//! 0                           number of integers (always 0)
//! 5 .7 .7 .7 0 0              number of reals, and the reals
//!
//! white polygon floor
//! 0
//! 0
//! 12  0 0 0  4 0 0  4 4 0  0 4 0
//! ```
//!
//! | in the file | here |
//! |---|---|
//! | `plastic`, `metal` and their kin | reflectance = colour · (1 − specularity), on both sides as in Radiance |
//! | `trans` | the same, and · (1 − transmissivity): what passes is lost |
//! | `light`, `illum`, `glow`, `spotlight` | exitance = π · radiance, W/m², on the front; reflectance 0 |
//! | `glass`, `mirror`, `dielectric`, … | black on both sides: nothing passes and nothing is reflected |
//! | other materials, and such as are defined nowhere | reflectance 0.5 on both sides |
//!
//! All of this is said in notes. Textures and patterns are not used; surfaces
//! other than polygons, and commands (`!genbox …`), are left out and counted. A
//! plain `!xform FILE` includes the file.
//!
//! # Source
//!
//! Larson and Shakespeare, *Rendering with Radiance*, 1998; *The RADIANCE
//! Synthetic Imaging System*, section 2.

use crate::ReadError;
use crate::materials::{DEFAULT_REFLECTANCE, below_one, in_as_few_bands};
use crate::names::Namer;
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, SceneInput, SurfaceInput};
use glam::{DVec3, dvec3};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// Files within files: deeper is taken for a circle.
const DEEPEST_INCLUDE: usize = 8;
/// Files within files, all together: a chain of circles grows without end.
const MOST_INCLUDES: usize = 1000;

const SURFACES: [&str; 12] = [
    "polygon", "sphere", "bubble", "cone", "cup", "cylinder", "tube", "ring", "instance", "mesh",
    "source", "ies",
];
const PATTERNS: [&str; 13] = [
    "texfunc",
    "texdata",
    "colorfunc",
    "brightfunc",
    "colordata",
    "brightdata",
    "colorpict",
    "colortext",
    "brighttext",
    "spectrum",
    "specfile",
    "specdata",
    "specpict",
];
/// Materials of which all light that is not absorbed passes or is mirrored.
const CLEAR: [&str; 8] = [
    "glass",
    "mirror",
    "dielectric",
    "interface",
    "prism1",
    "prism2",
    "mist",
    "antimatter",
];
/// Materials and mixtures that are something else.
const OTHER: [&str; 8] = [
    "BRTDfunc", "BSDF", "aBSDF", "WGMDfunc", "mixfunc", "mixdata", "mixpict", "mixtext",
];

/// A file: its name, for messages and for what it includes, and its text.
#[derive(Clone, Debug)]
pub struct RadFile {
    /// As given by the user.
    pub name: String,
    /// What it holds.
    pub text: String,
}

/// Reads Radiance files as one scene, in their order: materials before the
/// surfaces that they modify.
///
/// * `load` — gives the text of a file that `!xform FILE` includes, by the name of
///   the given file in which it is (or whose includes it is among) and its own;
///   or says why it cannot.
/// * `unit` — Radiance has no unit of length.
///
/// A surface is named after its identifier; where several have the same,
/// `name.1`, `name.2`, ….
///
/// # Errors
///
/// [`ReadError`] with the line (and the file, if there are several) for what is
/// no scene description: unknown types, numbers that are none, arguments that are
/// missing, a text without polygons. What makes no surface (two corners, a bow
/// tie) is left to the check of the scene.
pub fn read(
    files: &[RadFile],
    load: &mut dyn FnMut(&str, &str) -> Result<String, String>,
    unit: LengthUnit,
) -> Result<SceneInput, ReadError> {
    let mut parser = Parser {
        is_single_file: files.len() == 1,
        ..Parser::default()
    };
    let mut n_includes = 0;
    for file in files {
        parser.file(file, &file.name, load, 0, &mut n_includes)?;
    }
    let is_single = files.len() == 1 && n_includes == 0;
    if parser.polygons.is_empty() {
        let skipped = parser.skipped_notes(is_single).join("; ");
        let but = if skipped.is_empty() && !parser.modifiers.is_empty() {
            let n = counted(parser.modifiers.len(), "material or pattern");
            format!(": it has {n} and no surfaces; give the files that use them after it")
        } else if skipped.is_empty() {
            ": is it a Radiance file?".to_owned()
        } else {
            format!(", but: {skipped}")
        };
        return Err(ReadError::whole(format!("there is no polygon in it{but}")));
    }
    Ok(parser.into_scene(unit, is_single))
}

/// Something that modifies surfaces: a material, a mixture, a pattern, a texture.
struct Modifier {
    name: String,
    kind: String,
    /// What modifies it.
    by: By,
    reals: Vec<f64>,
}

/// What a surface or a modifier is modified by.
#[derive(Clone)]
enum By {
    Void,
    Unknown(String),
    Known(usize),
}

struct Polygon {
    name: String,
    by: By,
    vertices: Vec<DVec3>,
}

/// How many there are of something left out, and the first.
struct Skipped {
    n: usize,
    file: String,
    line: usize,
}

#[derive(Default)]
struct Parser {
    is_single_file: bool,
    modifiers: Vec<Modifier>,
    /// The last definition of every name.
    by_name: BTreeMap<String, By>,
    polygons: Vec<Polygon>,
    skipped: BTreeMap<String, Skipped>,
    /// The same for commands; with the first command.
    commands: Option<(Skipped, String)>,
    notes: Vec<String>,
}

impl Parser {
    fn file(
        &mut self,
        file: &RadFile,
        root: &str,
        load: &mut dyn FnMut(&str, &str) -> Result<String, String>,
        depth: usize,
        n_includes: &mut usize,
    ) -> Result<(), ReadError> {
        // A line alone is enough where there is no other file.
        let is_clear = depth == 0 && self.is_single_file;
        let name = |error: ReadError| match error.line {
            Some(line) if !is_clear => {
                ReadError::whole(format!("'{}', line {line}: {}", file.name, error.message))
            }
            _ => error,
        };
        let mut words = Words::new(&file.text);
        while let Some(step) = words.object().map_err(name)? {
            match step {
                Step::Object(object) => self.object(object, file).map_err(name)?,
                Step::Command(line, command) => {
                    let Some(inner) = included(&command) else {
                        self.skip_command(file, line, &command);
                        continue;
                    };
                    *n_includes += 1;
                    if depth == DEEPEST_INCLUDE || *n_includes > MOST_INCLUDES {
                        let why = format!(
                            "'{inner}' is included too deep or too often: does it include itself?"
                        );
                        return Err(name(ReadError::at_line(line, why)));
                    }
                    match load(root, inner) {
                        Ok(text) => {
                            let inner = RadFile {
                                name: inner.to_owned(),
                                text,
                            };
                            self.file(&inner, root, load, depth + 1, n_includes)?;
                        }
                        Err(why) => {
                            let why = format!("'{inner}' could not be read: {why}");
                            return Err(name(ReadError::at_line(line, why)));
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn object(&mut self, object: Object, file: &RadFile) -> Result<(), ReadError> {
        let Object { line, kind, .. } = &object;
        let by = self.by(&object.modifier);
        match kind.as_str() {
            "polygon" => {
                if !object.reals.len().is_multiple_of(3) {
                    let why = format!(
                        "polygon '{}' has {} real arguments (3 for each corner are needed)",
                        object.name,
                        object.reals.len()
                    );
                    return Err(ReadError::at_line(*line, why));
                }
                let corners = object.reals.chunks_exact(3);
                self.polygons.push(Polygon {
                    name: object.name,
                    by,
                    vertices: corners.map(|p| dvec3(p[0], p[1], p[2])).collect(),
                });
            }
            "alias" => {
                let target = self.by(object.strings.first().map_or("void", String::as_str));
                self.by_name.insert(object.name, target);
            }
            kind if SURFACES.contains(&kind) => {
                self.skipped
                    .entry(kind.to_owned())
                    .or_insert(Skipped {
                        n: 0,
                        file: file.name.clone(),
                        line: *line,
                    })
                    .n += 1;
            }
            kind => {
                let needed = n_reals(kind);
                if object.reals.len() < needed {
                    let why = format!(
                        "{kind} '{}' has {} real arguments ({needed} are needed)",
                        object.name,
                        object.reals.len()
                    );
                    return Err(ReadError::at_line(*line, why));
                }
                self.by_name
                    .insert(object.name.clone(), By::Known(self.modifiers.len()));
                self.modifiers.push(Modifier {
                    name: object.name,
                    kind: object.kind,
                    by,
                    reals: object.reals,
                });
            }
        }
        Ok(())
    }

    fn by(&self, name: &str) -> By {
        match self.by_name.get(name) {
            _ if name == "void" => By::Void,
            Some(by) => by.clone(),
            None => By::Unknown(name.to_owned()),
        }
    }

    fn skip_command(&mut self, file: &RadFile, line: usize, command: &str) {
        let (skipped, _) = self.commands.get_or_insert_with(|| {
            let first = Skipped {
                n: 0,
                file: file.name.clone(),
                line,
            };
            (first, command.to_owned())
        });
        skipped.n += 1;
    }

    /// The first material among what modifies a polygon.
    fn material_of(&self, by: &By) -> By {
        let By::Known(mut index) = *by else {
            return by.clone();
        };
        // A modifier refers to earlier ones only, so this ends.
        while PATTERNS.contains(&self.modifiers[index].kind.as_str()) {
            match &self.modifiers[index].by {
                By::Known(next) => index = *next,
                by => return by.clone(),
            }
        }
        By::Known(index)
    }

    fn into_scene(mut self, unit: LengthUnit, is_single: bool) -> SceneInput {
        let materials_of: Vec<By> = self
            .polygons
            .iter()
            .map(|p| self.material_of(&p.by))
            .collect();
        let key = |by: &By| match by {
            By::Void => None,
            By::Unknown(name) => Some(Err(name.clone())),
            By::Known(index) => Some(Ok(*index)),
        };
        // In the order of their first use, with the number of polygons.
        let mut used: Vec<(By, usize)> = Vec::new();
        let mut place: BTreeMap<Result<usize, String>, usize> = BTreeMap::new();
        let mut n_void = 0;
        for by in &materials_of {
            let Some(key) = key(by) else {
                n_void += 1;
                continue;
            };
            let i = *place.entry(key).or_insert_with(|| {
                used.push((by.clone(), 0));
                used.len() - 1
            });
            used[i].1 += 1;
        }
        let mut taken = BTreeSet::new();
        let mut materials = Vec::with_capacity(used.len());
        let mut names = Vec::with_capacity(used.len());
        for (by, n) in &used {
            let (mut material, note) = match by {
                By::Known(index) => self.known(&self.modifiers[*index], *n),
                By::Unknown(name) => {
                    let note = format!(
                        "material '{name}' ({}) is in none of the files: a reflectance of {DEFAULT_REFLECTANCE} is used; give its file before this one",
                        counted(*n, "polygon")
                    );
                    (diffuse(name, [DEFAULT_REFLECTANCE; 3]), Some(note))
                }
                By::Void => continue,
            };
            let base = material.name.clone();
            let mut k = 2;
            while !taken.insert(material.name.clone()) {
                material.name = format!("{base}_{k}");
                k += 1;
            }
            names.push(material.name.clone());
            materials.push(material);
            self.notes.extend(note);
        }
        if n_void > 0 {
            self.notes.push(format!(
                "{} left out: 'void' modifies them, which is nothing to be seen",
                counted(n_void, "polygon")
            ));
        }
        let skipped = self.skipped_notes(is_single);
        self.notes.extend(skipped);
        below_one(&mut materials, &mut self.notes);
        in_as_few_bands(&mut materials);

        let mut namer = Namer::new(
            self.polygons
                .iter()
                .zip(&materials_of)
                .filter(|(_, by)| key(by).is_some())
                .map(|(p, _)| Some(p.name.as_str())),
        );
        let mut surfaces = Vec::with_capacity(self.polygons.len() - n_void);
        for (polygon, by) in self.polygons.into_iter().zip(&materials_of) {
            let Some(i) = key(by).and_then(|key| place.get(&key).copied()) else {
                continue;
            };
            surfaces.push(SurfaceInput {
                name: namer.next(Some(&polygon.name)),
                material: names[i].clone(),
                vertices: polygon.vertices,
                holes: Vec::new(),
            });
        }
        SceneInput {
            length_unit: unit,
            quantity: Quantity::Radiometric,
            materials,
            surfaces,
            triangulate: true,
            notes: self.notes,
        }
    }

    /// A material as far as it is diffuse, and what is not used of it.
    fn known(&self, modifier: &Modifier, n_polygons: usize) -> (MaterialInput, Option<String>) {
        let Modifier {
            name, kind, reals, ..
        } = modifier;
        let rgb = |factor: f64| [0, 1, 2].map(|k| reals[k] * factor);
        let pattern = self.pattern_of(modifier);
        let but = |what: String| {
            let what = match pattern {
                Some(pattern) => format!("{what}; '{pattern}', which modifies it, is not used"),
                None => what,
            };
            Some(format!("material '{name}' is {kind}: {what}"))
        };
        let plain = || {
            pattern.map(|pattern| {
                format!("material '{name}': '{pattern}', which modifies it, is not used")
            })
        };
        match kind.as_str() {
            "light" | "illum" | "glow" | "spotlight" => {
                let is_seen_only = kind == "glow" && reals[3] < 0.0;
                let emitted = if is_seen_only { [0.0; 3] } else { rgb(PI) };
                let material = MaterialInput {
                    name: name.clone(),
                    reflectance: vec![0.0; 3],
                    exitance: emitted.to_vec(),
                    two_sided: false,
                };
                let note = match kind.as_str() {
                    "spotlight" => but("its cone is not used, it emits to all sides".to_owned()),
                    "glow" if is_seen_only => {
                        but("its radius is negative, so it lights nothing".to_owned())
                    }
                    _ => plain(),
                };
                (material, note)
            }
            kind if CLEAR.contains(&kind) => {
                let what = format!(
                    "{} black, no light passes and none is reflected",
                    counted_are(n_polygons, "polygon")
                );
                (diffuse(name, [0.0; 3]), but(what))
            }
            kind if OTHER.contains(&kind) => {
                let what = format!("a reflectance of {DEFAULT_REFLECTANCE} is used");
                (diffuse(name, [DEFAULT_REFLECTANCE; 3]), but(what))
            }
            "ashik2" => {
                let what = "its specular part is not used".to_owned();
                (diffuse(name, rgb(1.0)), but(what))
            }
            kind => {
                let specular = reals[3];
                let passing = transmission(kind).map_or(0.0, |k| reals[k]);
                let material = diffuse(name, rgb((1.0 - specular) * (1.0 - passing)));
                let mut lost = Vec::new();
                if specular != 0.0 {
                    lost.push(format!("the specular part, {specular},"));
                }
                if passing != 0.0 {
                    lost.push(format!("what passes, {passing},"));
                }
                let note = if lost.is_empty() {
                    plain()
                } else {
                    but(format!("{} is lost", lost.join(" and ")))
                };
                (material, note)
            }
        }
    }

    /// The pattern or texture on a material.
    fn pattern_of(&self, modifier: &Modifier) -> Option<&str> {
        let By::Known(over) = modifier.by else {
            return None;
        };
        let over = &self.modifiers[over];
        PATTERNS
            .contains(&over.kind.as_str())
            .then_some(over.name.as_str())
    }

    /// What was left out, one note a kind.
    fn skipped_notes(&self, is_single: bool) -> Vec<String> {
        let place = |skipped: &Skipped| {
            if is_single {
                format!("line {}", skipped.line)
            } else {
                format!("'{}', line {}", skipped.file, skipped.line)
            }
        };
        let mut notes: Vec<String> = self
            .skipped
            .iter()
            .map(|(kind, skipped)| {
                let n = skipped.n;
                format!(
                    "{} left out, the first in {}: only polygons are read",
                    counted(n, kind),
                    place(skipped)
                )
            })
            .collect();
        if let Some((skipped, command)) = &self.commands {
            notes.push(format!(
                "{} not run, the first in {} ('{}'): flatten the scene with Radiance's xform first (xform FILE > FLAT)",
                counted(skipped.n, "command"),
                place(skipped),
                shortened(command)
            ));
        }
        notes
    }
}

/// A colour that reflects on both sides.
fn diffuse(name: &str, reflectance: [f64; 3]) -> MaterialInput {
    MaterialInput {
        name: name.to_owned(),
        reflectance: reflectance.to_vec(),
        exitance: vec![0.0; 3],
        two_sided: true,
    }
}

/// Real arguments that a type must have.
fn n_reals(kind: &str) -> usize {
    match kind {
        "light" | "illum" => 3,
        "glow" | "plasfunc" | "plasdata" | "metfunc" | "metdata" => 4,
        "plastic" | "metal" => 5,
        "plastic2" | "metal2" | "transfunc" | "transdata" => 6,
        "trans" | "spotlight" => 7,
        "trans2" | "ashik2" => 8,
        _ => 0,
    }
}

/// Which real argument is the transmissivity.
fn transmission(kind: &str) -> Option<usize> {
    match kind {
        "trans" => Some(5),
        "trans2" => Some(6),
        "transfunc" | "transdata" => Some(4),
        _ => None,
    }
}

fn is_known_type(kind: &str) -> bool {
    n_reals(kind) > 0
        || kind == "alias"
        || [&SURFACES[..], &PATTERNS, &CLEAR, &OTHER]
            .iter()
            .any(|list| list.contains(&kind))
}

/// The file that a command includes as it is: `!xform FILE`.
fn included(command: &str) -> Option<&str> {
    let mut words = command.split_whitespace();
    let is_xform = words.next() == Some("!xform");
    let file = words.next().filter(|word| !word.starts_with('-'))?;
    let is_plain = !command.contains(['|', '<', '>', ';', '&', '$', '`', '*', '?', '"', '\'']);
    (is_xform && is_plain && words.next().is_none()).then_some(file)
}

fn counted(n: usize, what: &str) -> String {
    if n == 1 {
        format!("1 {what}")
    } else {
        format!("{n} {what}s")
    }
}

fn counted_are(n: usize, what: &str) -> String {
    let verb = if n == 1 { "is" } else { "are" };
    format!("{} {verb}", counted(n, what))
}

/// The start of a command, for a message of one line.
fn shortened(command: &str) -> String {
    const LONGEST: usize = 40;
    let words: Vec<&str> = command.split_whitespace().collect();
    let text = words.join(" ");
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text,
    }
}

/// A primitive of the file.
struct Object {
    line: usize,
    modifier: String,
    kind: String,
    name: String,
    strings: Vec<String>,
    reals: Vec<f64>,
}

enum Step {
    Object(Object),
    Command(usize, String),
}

/// The words of a file, without comments, with their lines.
struct Words<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            rest: text.strip_prefix('\u{feff}').unwrap_or(text),
            line: 1,
        }
    }

    fn advance(&mut self, n: usize) -> &'a str {
        let (done, rest) = self.rest.split_at(n);
        self.line += done.matches('\n').count();
        self.rest = rest;
        done
    }

    fn skip_blanks_and_comments(&mut self) {
        loop {
            let blank = self.rest.len() - self.rest.trim_start().len();
            self.advance(blank);
            if !self.rest.starts_with('#') {
                return;
            }
            let end = self.rest.find('\n').unwrap_or(self.rest.len());
            self.advance(end);
        }
    }

    /// The next word and its line; a word may be quoted.
    fn word(&mut self) -> Option<(usize, &'a str)> {
        self.skip_blanks_and_comments();
        let first = self.rest.chars().next()?;
        let line = self.line;
        if (first == '"' || first == '\'')
            && let Some(end) = self.rest[1..].find(first)
        {
            let quoted = self.advance(end + 2);
            return Some((line, &quoted[1..=end]));
        }
        let end = self
            .rest
            .find(char::is_whitespace)
            .unwrap_or(self.rest.len());
        Some((line, self.advance(end)))
    }

    /// The rest of the line and, after a `\` at its end, of the next.
    fn command(&mut self) -> String {
        let mut command = String::new();
        loop {
            let end = self.rest.find('\n').map_or(self.rest.len(), |i| i + 1);
            let text = self.advance(end).trim_end();
            let Some(text) = text.strip_suffix('\\') else {
                command.push_str(text);
                return command;
            };
            command.push_str(text);
            command.push(' ');
            if self.rest.is_empty() {
                return command;
            }
        }
    }

    /// The next primitive or command.
    fn object(&mut self) -> Result<Option<Step>, ReadError> {
        self.skip_blanks_and_comments();
        if self.rest.starts_with('!') {
            let line = self.line;
            return Ok(Some(Step::Command(line, self.command())));
        }
        let Some((line, modifier)) = self.word() else {
            return Ok(None);
        };
        let missing = |what: &str| {
            ReadError::at_line(
                line,
                format!("after '{modifier}' the file ends without {what}"),
            )
        };
        let (kind_line, kind) = self.word().ok_or_else(|| missing("a type"))?;
        if !is_known_type(kind) {
            let why = format!("'{kind}' is no type of Radiance's");
            return Err(ReadError::at_line(kind_line, why));
        }
        let (_, name) = self.word().ok_or_else(|| missing("an identifier"))?;
        let mut object = Object {
            line,
            modifier: modifier.to_owned(),
            kind: kind.to_owned(),
            name: name.to_owned(),
            strings: Vec::new(),
            reals: Vec::new(),
        };
        if kind == "alias" {
            let (_, target) = self
                .word()
                .ok_or_else(|| missing("what the alias is for"))?;
            object.strings.push(target.to_owned());
            return Ok(Some(Step::Object(object)));
        }
        let head = Head {
            line,
            what: format!("{kind} '{name}'"),
        };
        self.arguments(&head, "string", |_, word| {
            object.strings.push(word.to_owned());
            Ok(())
        })?;
        self.arguments(&head, "integer", |line, word| {
            let why = || ReadError::at_line(line, format!("'{word}' is not a whole number"));
            word.parse::<i64>().map(|_| ()).map_err(|_| why())
        })?;
        self.arguments(&head, "real", |line, word| {
            object.reals.push(real(line, word)?);
            Ok(())
        })?;
        Ok(Some(Step::Object(object)))
    }

    /// A count, and so many words.
    fn arguments(
        &mut self,
        head: &Head,
        what: &str,
        mut take: impl FnMut(usize, &str) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        let Head { line, what: whose } = head;
        let (count_line, count) = self.word().ok_or_else(|| {
            let why = format!("the file ends before the number of {what} arguments of {whose}");
            ReadError::at_line(*line, why)
        })?;
        let n: usize = count.parse().map_err(|_| {
            let why = format!("'{count}' is no number of {what} arguments of {whose}");
            ReadError::at_line(count_line, why)
        })?;
        for k in 0..n {
            let (line, word) = self.word().ok_or_else(|| {
                let why = format!("{whose} has {n} {what} arguments, but the file ends after {k}");
                ReadError::at_line(*line, why)
            })?;
            take(line, word)?;
        }
        Ok(())
    }
}

/// Of which primitive something is said.
struct Head {
    line: usize,
    what: String,
}

fn real(line: usize, word: &str) -> Result<f64, ReadError> {
    let why = match word.parse::<f64>() {
        Ok(x) if x.is_finite() => return Ok(x),
        Ok(_) => format!("'{word}' is not finite"),
        Err(_) => format!("'{word}' is not a number"),
    };
    Err(ReadError::at_line(line, why))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> RadFile {
        RadFile {
            name: "room.rad".to_owned(),
            text: text.to_owned(),
        }
    }

    fn read_plain(text: &str) -> Result<SceneInput, ReadError> {
        let mut load = |_: &str, name: &str| Err(format!("no {name}"));
        read(&[file(text)], &mut load, LengthUnit::Metre)
    }

    fn square(modifier: &str) -> String {
        format!("{modifier} polygon p 0 0 12 0 0 0 1 0 0 1 1 0 0 1 0\n")
    }

    fn one_material(text: &str, name: &str) -> (MaterialInput, Vec<String>) {
        let mut scene = read_plain(&format!("{text}\n{}", square(name))).unwrap();
        assert_eq!(scene.materials.len(), 1, "{:?}", scene.materials);
        (scene.materials.remove(0), scene.notes)
    }

    #[test]
    fn diffuse_part_is_read_and_the_rest_is_said() {
        let (m, notes) = one_material("void plastic a 0 0 5 .5 .5 .5 0 .1", "a");
        assert_eq!((m.reflectance, m.two_sided), (vec![0.5], true));
        assert!(notes.is_empty());
        let (m, notes) = one_material("void metal a\n0\n0\n5 .8 .4 .2 .25 .1", "a");
        assert_eq!(m.reflectance, [0.8 * 0.75, 0.4 * 0.75, 0.2 * 0.75]);
        assert!(notes[0].contains("specular part, 0.25,"), "{notes:?}");
        let (m, notes) = one_material("void trans a 0 0 7 .5 .5 .5 0 0 .5 1", "a");
        assert_eq!(m.reflectance, [0.25]);
        assert!(notes[0].contains("what passes, 0.5,"), "{notes:?}");
        let (m, notes) = one_material("void glass a 0 0 3 .6 .6 .6", "a");
        assert_eq!(m.reflectance, [0.0]);
        assert!(notes[0].contains("1 polygon is black"), "{notes:?}");
        let (m, notes) = one_material("", "paint");
        assert_eq!((m.name.as_str(), m.reflectance), ("paint", vec![0.5]));
        assert!(notes[0].contains("'paint' (1 polygon)"), "{notes:?}");
    }

    #[test]
    fn radiance_times_pi_is_exitance() {
        let (m, _) = one_material("void light a 0 0 3 1 2 3", "a");
        assert_eq!(m.exitance, [PI, 2.0 * PI, 3.0 * PI]);
        assert_eq!((m.reflectance, m.two_sided), (vec![0.0; 3], false));
        let (m, notes) = one_material("void glow a 0 0 4 1 1 1 -1", "a");
        assert_eq!(m.exitance, [0.0]);
        assert!(notes[0].contains("lights nothing"), "{notes:?}");
        let text = "void brightdata ies 4 corr l.dat source.cal src 0 0\nies light a 0 0 3 1 1 1";
        let (m, notes) = one_material(text, "a");
        assert_eq!(m.exitance, [PI]);
        assert!(notes[0].contains("'ies'"), "{notes:?}");
    }

    #[test]
    fn later_definitions_aliases_and_patterns_are_followed() {
        let text = format!(
            "# a comment\nvoid plastic a 0 0 5 .1 .1 .1 0 0\n{0}void plastic a 0 0 5 .2 .2 .2 0 0\n\
             {0}void alias b a\n{1}a brightfunc fog 2 f.cal x 0 0\n{2}{3}",
            square("a"),
            square("b"),
            square("fog"),
            square("void"),
        );
        let scene = read_plain(&text).unwrap();
        let used: Vec<&str> = scene.surfaces.iter().map(|s| s.material.as_str()).collect();
        assert_eq!(used, ["a", "a_2", "a_2", "a_2"]);
        let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["p.1", "p.2", "p.3", "p.4"]);
        assert!(
            scene.notes[0].contains("1 polygon left out"),
            "{:?}",
            scene.notes
        );
    }

    #[test]
    fn other_surfaces_and_commands_are_counted() {
        let text = format!(
            "void sphere s 0 0 4 0 0 0 1\nvoid sphere s 0 0 4 0 0 0 1\n!genbox a b 1 1 1 \\\n -r .1 | xform -t 1 0 0\n{}",
            square("a")
        );
        let scene = read_plain(&text).unwrap();
        let notes = scene.notes.join("\n");
        assert!(
            notes.contains("2 spheres left out, the first in line 1"),
            "{notes}"
        );
        assert!(
            notes.contains("1 command not run, the first in line 3 ('!genbox"),
            "{notes}"
        );
        let error = read_plain("void sphere s 0 0 4 0 0 0 1").unwrap_err();
        assert!(error.to_string().contains("1 sphere left out"), "{error}");
    }

    #[test]
    fn several_files_are_one_scene() {
        let files = [
            file("void plastic a 0 0 5 .2 .2 .2 0 0"),
            file("!xform ./b.rad\n!xform -t 1 0 0 b.rad"),
        ];
        let mut load = |root: &str, name: &str| {
            assert_eq!((root, name), ("room.rad", "./b.rad"));
            Ok(square("a"))
        };
        let scene = read(&files, &mut load, LengthUnit::Metre).unwrap();
        assert_eq!(scene.materials[0].reflectance, [0.2]);
        assert!(
            scene.notes[0].contains("'room.rad', line 2"),
            "{:?}",
            scene.notes
        );
        let mut circle = |_: &str, _: &str| Ok("!xform b.rad".to_owned());
        let error = read(&files, &mut circle, LengthUnit::Metre).unwrap_err();
        assert!(error.message.contains("include itself"), "{error}");
    }

    #[test]
    fn errors_carry_the_line() {
        for (text, line, what) in [
            ("void plastik a", 1, "'plastik' is no type"),
            (
                "\n# c\nvoid plastic a 0 0 4 1 1 1 0",
                3,
                "4 real arguments (5",
            ),
            ("void polygon p 0 0 9 0 0 0 1 0 0", 1, "ends after 6"),
            ("void polygon p 0 0 99999999999999 0 0", 1, "ends after 2"),
            ("void polygon p 0 0\n4 0 0 0 1", 1, "3 for each corner"),
            ("void polygon p 0 0\n3 0 x 0", 2, "'x' is not a number"),
            ("void polygon p 0 0\n3 0 1e999 0", 2, "not finite"),
            ("void polygon p\nmany", 2, "'many' is no number of string"),
            ("void polygon", 1, "without an identifier"),
            ("!xform a.rad", 1, "no a.rad"),
        ] {
            let error = read_plain(text).unwrap_err();
            assert_eq!(error.line, Some(line), "{text}: {error}");
            assert!(error.message.contains(what), "{error}");
        }
        assert!(read_plain("").is_err());
    }
}
