//! Writing files: whole or not at all.

use crate::args::{Picture, Work};
use crate::failure::Failure;
use antumbra::Scene;
use antumbra::io::model::{FactorTable, MeshedScene};
use antumbra::io::study::{self, Study};
use antumbra::io::{picture, write};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What an output's extension asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Json,
    Obj,
    Ply,
    Vtu,
    Csv,
    Svg,
    Png,
    Txt,
    Html,
}

/// The formats of all outputs, checked before any work is done: the extension
/// must be known, the folder must be there, and it must be possible to write there.
pub(crate) fn formats(outputs: &[PathBuf], allowed: &[Format]) -> Result<Vec<Format>, Failure> {
    for (i, path) in outputs.iter().enumerate() {
        if let Some(other) = outputs[..i].iter().find(|o| is_same_file(o, path)) {
            let why = if other == path {
                "given twice".to_owned()
            } else {
                format!("is the same file as {}", other.display())
            };
            return Err(Failure::usage(format!("{}: {why}", path.display())));
        }
    }
    outputs
        .iter()
        .map(|path| {
            let extension = path
                .extension()
                .map(|e| e.to_string_lossy().to_ascii_lowercase());
            let format = match extension.as_deref() {
                Some("json") => Format::Json,
                Some("obj") => Format::Obj,
                Some("ply") => Format::Ply,
                Some("vtu") => Format::Vtu,
                Some("csv") => Format::Csv,
                Some("svg") => Format::Svg,
                Some("png") => Format::Png,
                Some("txt") => Format::Txt,
                Some("html") => Format::Html,
                _ => return Err(unknown(path)),
            };
            if !allowed.contains(&format) {
                return Err(unknown(path));
            }
            let folder = parent(path);
            if !folder.is_dir() {
                return Err(Failure::usage(format!(
                    "{}: the folder {} does not exist",
                    path.display(),
                    folder.display()
                )));
            }
            check_place(path)?;
            Ok(format)
        })
        .collect()
}

/// Do two paths lead to one file, by links or by other spellings? They do as well if there
/// is none yet and both would make it.
pub(crate) fn is_same_file(a: &Path, b: &Path) -> bool {
    match [a, b].map(std::fs::metadata) {
        #[cfg(unix)]
        [Ok(a), Ok(b)] => {
            use std::os::unix::fs::MetadataExt as _;
            (a.dev(), a.ino()) == (b.dev(), b.ino())
        }
        #[cfg(not(unix))]
        [Ok(_), Ok(_)] => match [a, b].map(std::fs::canonicalize) {
            [Ok(a), Ok(b)] => a == b,
            _ => a == b,
        },
        [Err(_), Err(_)] => {
            let place = |path: &Path| {
                let folder = std::fs::canonicalize(parent(path)).ok()?;
                Some(folder.join(path.file_name()?))
            };
            a == b || place(a).is_some_and(|a| place(b) == Some(a))
        }
        _ => false,
    }
}

fn unknown(path: &Path) -> Failure {
    Failure::usage(format!(
        "{}: its extension is none that can be written here (see --help)",
        path.display()
    ))
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Every format a mesh can be written in.
pub(crate) const MESHES: [Format; 7] = [
    Format::Json,
    Format::Obj,
    Format::Ply,
    Format::Vtu,
    Format::Csv,
    Format::Svg,
    Format::Png,
];

/// Writes all files. One that cannot be written does not keep the others from being
/// written; the failure tells which ones are there.
pub(crate) fn write_all(
    outputs: &[PathBuf],
    formats: Vec<Format>,
    scene: &MeshedScene,
    look: &Picture,
) -> Result<(), Failure> {
    each(outputs, formats, |path, format| {
        write(path, format, scene, look)
    })
}

/// Does for every output what writes it; the failures of some do not keep the others from
/// being written.
pub(crate) fn each(
    outputs: &[PathBuf],
    formats: Vec<Format>,
    write: impl Fn(&Path, Format) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let (mut written, mut failures) = (Vec::new(), Vec::new());
    for (path, format) in outputs.iter().zip(formats) {
        match write(path, format) {
            Ok(()) => written.push(path.display().to_string()),
            Err(failure) => failures.push(failure.to_string()),
        }
    }
    if failures.is_empty() {
        return Ok(());
    }
    let mut message = failures.join("\n");
    if !written.is_empty() {
        message.push_str(&format!("\nwritten all the same: {}", written.join(", ")));
    }
    Err(Failure::internal(message))
}

/// Writes one file: into a new file beside it, which then takes its name.
fn write(path: &Path, format: Format, scene: &MeshedScene, look: &Picture) -> Result<(), Failure> {
    atomically(path, |out| match format {
        Format::Json => write::json::write(scene, out),
        Format::Obj => write::obj::write(scene, out),
        Format::Ply => write::ply::write(scene, out),
        Format::Vtu => write::vtu::write(scene, out),
        Format::Csv => write::csv::write(scene, out),
        Format::Svg => match look.view.strip_prefix("surface:") {
            Some(name) => match scene.surfaces.iter().find(|s| s.name == name) {
                Some(surface) => write::svg::write_surface(surface, scene, out),
                None => Err(std::io::Error::other(format!(
                    "there is no surface '{name}'"
                ))),
            },
            None => write::svg::write_all(scene, out),
        },
        Format::Png => {
            let mut options = picture_options(look)?;
            let solved = scene
                .surfaces
                .iter()
                .any(|s| s.field("irradiance").is_some());
            if options.field.is_none() && solved {
                options.field = Some("irradiance".to_owned());
            }
            options.check(scene).map_err(std::io::Error::other)?;
            picture::write_png(&picture::render(scene, &options), out)
        }
        Format::Txt | Format::Html => Err(std::io::Error::other(
            "a mesh is not written as text or as a page",
        )),
    })
}

/// Every format a matrix of form factors can be written in.
pub(crate) const FACTORS: [Format; 3] = [Format::Csv, Format::Json, Format::Txt];

/// Writes a matrix of form factors: into a new file beside it, which then takes its
/// name.
pub(crate) fn write_factors(
    path: &Path,
    format: Format,
    table: &FactorTable,
) -> Result<(), Failure> {
    atomically(path, |out| match format {
        Format::Csv => write::factors::write_csv(table, out),
        Format::Json => write::factors::write_json(table, out),
        Format::Txt => write::factors::write_view3d(table, out),
        _ => Err(std::io::Error::other(
            "form factors are written as .csv, .json or .txt",
        )),
    })
}

/// Every format a study can be written in.
pub(crate) const STUDIES: [Format; 5] = [
    Format::Html,
    Format::Json,
    Format::Csv,
    Format::Png,
    Format::Svg,
];

/// Pixels of a study's picture.
const STUDY_SIZE: (usize, usize) = (1500, 960);

/// Writes a study: into a new file beside it, which then takes its name.
pub(crate) fn write_study(path: &Path, format: Format, found: &Study) -> Result<(), Failure> {
    let (x, y) = (study::Horizontal::Seconds, study::Vertical::Rms);
    let (width, height) = STUDY_SIZE;
    atomically(path, |out| match format {
        Format::Html => study::write_html(found, out),
        Format::Json => study::write_json(found, out),
        Format::Csv => study::write_csv(found, out),
        Format::Png => picture::write_png(&study::render(found, x, y, width, height), out),
        Format::Svg => {
            let size = glam::dvec2(width as f64, height as f64);
            writeln!(out, "{}", study::svg(found, x, y, size))
        }
        _ => Err(std::io::Error::other(
            "a study is written as .html, .json, .csv, .png or .svg",
        )),
    })
}

fn picture_options(look: &Picture) -> std::io::Result<picture::PictureOptions> {
    let view = match look.view.as_str() {
        "auto" => picture::View::Auto,
        name => match name.strip_prefix("surface:") {
            Some(surface) => picture::View::Surface(surface.to_owned()),
            None => named(name).ok_or_else(|| {
                std::io::Error::other(format!(
                    "'{name}' is no view: auto, front, back, left, right, top, bottom, surface:NAME"
                ))
            })?,
        },
    };
    Ok(picture::PictureOptions {
        width: look.size.0,
        height: look.size.1,
        field: look.field.clone(),
        scale: look.scale,
        isolux: !look.no_isolux,
        mesh: look.draw_mesh,
        curves: look.draw_curves,
        view,
        ..picture::PictureOptions::default()
    })
}

fn named(name: &str) -> Option<picture::View> {
    let side = match name {
        "front" => picture::Side::Front,
        "back" => picture::Side::Back,
        "left" => picture::Side::Left,
        "right" => picture::Side::Right,
        "top" => picture::Side::Top,
        "bottom" => picture::Side::Bottom,
        _ => return None,
    };
    Some(picture::View::Named(side))
}

/// Are `--view` and `--field` ones there are? Asked before any work is done.
pub(crate) fn check_look(look: &Picture, scene: &Scene, work: Work) -> Result<(), Failure> {
    let fields: &[&str] = match work {
        Work::Mesh => &["direct"],
        Work::Solve => &["direct", "irradiance", "radiosity"],
    };
    if let Some(field) = &look.field
        && !fields.contains(&field.as_str())
    {
        return Err(Failure::usage(format!(
            "--field {field}: here the fields are {}",
            fields.join(", ")
        )));
    }
    match look.view.strip_prefix("surface:") {
        Some(name) if scene.surface_named(name).is_none() => Err(Failure::usage(format!(
            "--view {}: there is no surface '{name}'",
            look.view
        ))),
        _ => picture_options(look)
            .map(|_| ())
            .map_err(|e| Failure::usage(format!("--view: {e}"))),
    }
}

/// Files that are being written, to be removed if the process ends before.
static TEMPORARIES: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn temporaries() -> MutexGuard<'static, Vec<PathBuf>> {
    // Whoever panicked while it had the list: it is still a list.
    TEMPORARIES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes what is half written, then calls `end`; meanwhile no new file is begun.
pub(crate) fn remove_temporaries(end: impl FnOnce()) {
    let mut list = temporaries();
    for path in list.drain(..) {
        let _ = std::fs::remove_file(path);
    }
    end();
}

/// A new file that is removed again unless it is renamed: also on a panic, and on the
/// second interrupt.
pub(crate) struct Temporary(PathBuf);

impl Temporary {
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    pub(crate) fn create(path: PathBuf) -> std::io::Result<(Self, File)> {
        let mut list = temporaries();
        let file = File::create(&path)?;
        list.push(path.clone());
        Ok((Self(path), file))
    }

    fn rename(self, to: &Path) -> std::io::Result<()> {
        let mut list = temporaries();
        std::fs::rename(&self.0, to)?;
        list.retain(|path| *path != self.0);
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let mut list = temporaries();
        if let Some(at) = list.iter().position(|path| *path == self.0) {
            list.remove(at);
            let _ = std::fs::remove_file(&self.0);
        }
    }
}

/// The file that a path leads to, if it is a link; and the name of a new file beside it.
fn places(path: &Path) -> (PathBuf, PathBuf) {
    let target = match std::fs::canonicalize(path) {
        Ok(target) if path.is_symlink() => target,
        _ => path.to_owned(),
    };
    let name = target
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let temporary = parent(&target).join(format!(".{name}.{}.part", std::process::id()));
    (target, temporary)
}

/// Can a file be written here? Asked before any work is done.
fn check_place(path: &Path) -> Result<(), Failure> {
    let refuse = |why: String| Err(Failure::usage(format!("{}: {why}", path.display())));
    match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => return refuse("is a folder".into()),
        Ok(found) if !found.is_file() => return refuse("is no regular file".into()),
        Ok(found) if found.permissions().readonly() => {
            return refuse("is there already and read-only".into());
        }
        _ => {}
    }
    let (_, temporary) = places(path);
    match Temporary::create(temporary) {
        Ok(_) => Ok(()),
        Err(error) => refuse(format!("cannot be written: {error}")),
    }
}

/// Writes into a new file beside `path` that takes its name when it is complete;
/// on failure nothing remains.
pub(crate) fn atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), Failure> {
    let (target, temporary) = places(path);
    let write = || -> std::io::Result<()> {
        let (temporary, file) = Temporary::create(temporary)?;
        let mut out = BufWriter::new(file);
        write(&mut out)?;
        out.flush()?;
        out.get_ref().sync_all()?;
        temporary.rename(&target)
    };
    write().map_err(|error| {
        Failure::internal(format!("{}: cannot be written: {error}", path.display()))
    })
}
