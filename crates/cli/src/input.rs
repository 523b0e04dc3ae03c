//! Reading scenes and saying what is wrong with them.

use crate::args::{Color, Common};
use crate::failure::Failure;
use crate::{output, progress};
use antumbra::geom::Stop;
use antumbra::scene::LengthUnit;
use antumbra::{Control, Problem, Scene, Severity, io, thin_surfaces};
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A scene that was read and accepted.
pub(crate) struct Loaded {
    pub(crate) scene: Scene,
    pub(crate) warnings: Vec<Problem>,
    pub(crate) notes: Vec<String>,
}

/// Reads a scene file by its extension and welds it if that is asked for, without checking
/// its content.
pub(crate) fn read(common: &Common) -> Result<antumbra::SceneInput, Failure> {
    let mut input = read_file(common)?;
    weld(&mut input, common)
        .map_err(|problems| Failure::not_acceptable(refusal(&common.scene, &problems, common)))?;
    Ok(input)
}

/// Welds if that is asked for; what is refused stays as it was.
pub(crate) fn weld(input: &mut antumbra::SceneInput, common: &Common) -> Result<(), Vec<Problem>> {
    match common.weld {
        None => Ok(()),
        Some(length) => input
            .weld(length)
            .map(|_| ())
            .map_err(|problem| vec![*problem]),
    }
}

/// Reads a scene file by its extension, without checking its content.
pub(crate) fn read_file(common: &Common) -> Result<antumbra::SceneInput, Failure> {
    let mut scene = read_any(common)?;
    scene.triangulate |= common.triangulate;
    Ok(scene)
}

/// Reads a scene file by its extension, as it stands.
fn read_any(common: &Common) -> Result<antumbra::SceneInput, Failure> {
    let path = &common.scene;
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase());
    let extension = extension.as_deref();
    if let (Some(second), true) = (
        common.more.first(),
        !matches!(extension, Some("rad" | "mat")),
    ) {
        return Err(Failure::usage(format!(
            "{}: only .rad and .mat files can be several",
            second.display()
        )));
    }
    let unit = common.length_unit;
    let scene = match extension {
        Some("json") => {
            scene_text(path).and_then(|text| io::scene_file::read(&text).map_err(|e| e.to_string()))
        }
        Some("obj") => obj(path, unit),
        Some("gltf" | "glb") => gltf(path, unit),
        Some("stl") => {
            bytes(path).and_then(|bytes| io::stl::read(&bytes, unit).map_err(|e| e.to_string()))
        }
        Some("vs3") => {
            let mut notes = Vec::new();
            let scene = text(path, &mut notes)
                .and_then(|text| io::vs3::read(&text, unit).map_err(|e| e.to_string()));
            scene.map(|scene| with_notes(scene, notes))
        }
        Some("rad" | "mat") => return rad(common),
        _ => Err(
            "is not a format that can be read: .json, .obj, .gltf, .glb, .stl, .vs3 and .rad are"
                .to_owned(),
        ),
    };
    scene.map_err(|message| Failure::unreadable(format!("{}: {message}", path.display())))
}

fn obj(path: &Path, unit: LengthUnit) -> Result<antumbra::SceneInput, String> {
    let mut notes = Vec::new();
    let obj = text(path, &mut notes)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut load = |name: &str| text(&folder.join(name), &mut notes);
    let scene = io::obj::read(&obj, &mut load, unit).map_err(|e| e.to_string())?;
    Ok(with_notes(scene, notes))
}

fn gltf(path: &Path, unit: LengthUnit) -> Result<antumbra::SceneInput, String> {
    let gltf = bytes(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    io::gltf::read(&gltf, &mut |name| bytes(&folder.join(name)), unit).map_err(|e| e.to_string())
}

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    files_read().push(path.to_owned());
    std::fs::read(path).map_err(|e| e.to_string())
}

/// The files that the scene was read from: nothing may be written over them.
static FILES_READ: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn files_read() -> MutexGuard<'static, Vec<PathBuf>> {
    // Whoever panicked while it had the list: it is still a list.
    FILES_READ.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Refuses outputs that would replace a file the scene was read from: one that it
/// includes as well, and by whatever name.
pub(crate) fn spare(outputs: &[PathBuf]) -> Result<(), Failure> {
    for file in files_read().iter() {
        if let Some(output) = outputs.iter().find(|o| output::is_same_file(o, file)) {
            return Err(Failure::usage(format!(
                "{}: is {}, which the scene is read from",
                output.display(),
                file.display()
            )));
        }
    }
    Ok(())
}

/// The text of a file of another program, and a note if it is not UTF-8.
fn text(path: &Path, notes: &mut Vec<String>) -> Result<String, String> {
    let text = io::text::decoded(&bytes(path)?)?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    notes.extend(text.note(&name.to_string_lossy()));
    Ok(text.text)
}

/// The text of a scene file.
fn scene_text(path: &Path) -> Result<String, String> {
    String::from_utf8(bytes(path)?).map_err(|_| "is not UTF-8 text".to_owned())
}

/// The scene, with these notes before its own.
fn with_notes(mut scene: antumbra::SceneInput, mut notes: Vec<String>) -> antumbra::SceneInput {
    notes.append(&mut scene.notes);
    scene.notes = notes;
    scene
}

/// All `.rad` files of the command line, as one scene.
fn rad(common: &Common) -> Result<antumbra::SceneInput, Failure> {
    let mut notes = Vec::new();
    let mut files = Vec::with_capacity(1 + common.more.len());
    for path in std::iter::once(&common.scene).chain(&common.more) {
        let name = path.display().to_string();
        let text =
            text(path, &mut notes).map_err(|e| Failure::unreadable(format!("{name}: {e}")))?;
        files.push(io::rad::RadFile { name, text });
    }
    let mut load = |root: &str, name: &str| {
        let folder = Path::new(root).parent().unwrap_or(Path::new("."));
        text(&folder.join(name), &mut notes)
    };
    let scene = io::rad::read(&files, &mut load, common.length_unit).map_err(|e| {
        let place = match common.more.len() {
            0 => format!("{}: ", common.scene.display()),
            _ => String::new(),
        };
        Failure::unreadable(format!("{place}{e}"))
    })?;
    Ok(with_notes(scene, notes))
}

/// What a scene is read for: which findings matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Light that comes straight from emitters.
    Direct,
    /// Light that goes on, and may leave where it should not.
    Interreflection,
    /// Form factors, which no surface needs to emit for.
    Factors,
}

/// Reads and checks a scene for direct light; warnings are shown unless `--quiet`.
pub(crate) fn load(common: &Common) -> Result<Loaded, Failure> {
    load_for(common, Purpose::Direct)
}

/// What is worth saying of a scene that is accepted: rooms that are open, surfaces that
/// face the wrong way, corners that miss each other.
///
/// Nothing if it was stopped.
pub(crate) fn doubts(scene: &Scene, input: &antumbra::SceneInput) -> Option<Vec<Problem>> {
    progress::scene_is_there();
    let stop = Stop::new(&progress::is_stop_wanted);
    let mut doubts = scene.room_problems(&Control::stopping(stop))?;
    doubts.extend(input.corner_gaps().map(|mut gaps| {
        gaps.message.push_str(" (--weld)");
        gaps
    }));
    Some(doubts)
}

/// Reads and checks a scene; warnings are shown unless `--quiet`.
pub(crate) fn load_for(common: &Common, purpose: Purpose) -> Result<Loaded, Failure> {
    let input = read(common)?;
    let notes = input.notes.clone();
    match Scene::build(&input) {
        Ok(built) => {
            let mut warnings = built.warnings;
            warnings.extend(thin_surfaces(&built.scene));
            if purpose != Purpose::Direct {
                match doubts(&built.scene, &input) {
                    Some(doubts) => warnings.extend(doubts),
                    None => eprintln!(
                        "antumbra: stopped by {}: whether rooms are closed was not looked at",
                        progress::stopped_by().1
                    ),
                }
            }
            if purpose == Purpose::Factors {
                warnings.retain(|w| w.kind != "no-emitter");
            }
            if !common.quiet {
                for note in &notes {
                    eprintln!("{}: {note}", label("note", common));
                }
                for warning in &warnings {
                    eprintln!("{}: {}", label("warning", common), warning.message);
                }
            }
            Ok(Loaded {
                scene: built.scene,
                warnings,
                notes,
            })
        }
        Err(problems) => Err(Failure::not_acceptable(refusal(
            &common.scene,
            &problems,
            common,
        ))),
    }
}

/// All problems of a refused scene, one a line.
pub(crate) fn refusal(path: &Path, problems: &[Problem], common: &Common) -> String {
    let n = problems
        .iter()
        .filter(|p| p.severity == Severity::Error)
        .count();
    let mut text = format!(
        "{}: the scene cannot be used: {n} {}",
        path.display(),
        if n == 1 { "error" } else { "errors" }
    );
    for problem in problems {
        let kind = match problem.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        text.push_str(&format!("\n  {}: {}", label(kind, common), problem.message));
        if problem.kind == "non-planar" && problem.severity == Severity::Error {
            text.push_str("; --triangulate splits it");
        }
    }
    text
}

fn label(kind: &str, common: &Common) -> String {
    let colored = match common.color {
        Color::Always => true,
        Color::Never => false,
        Color::Auto => std::io::stderr().is_terminal(),
    };
    let code = match kind {
        "error" => "31",
        "warning" => "33",
        _ => "36",
    };
    if colored {
        format!("\x1b[{code}m{kind}\x1b[0m")
    } else {
        kind.to_owned()
    }
}
