//! Writing files: whole or not at all.

use crate::args::Picture;
use crate::failure::Failure;
use crate::mesh::Work;
use antumbra::Scene;
use antumbra::io::model::{FactorTable, MeshedScene};
use antumbra::io::{picture, write};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

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
}

/// The formats of all outputs, checked before any work is done: the extension
/// must be known and the folder must be there.
pub(crate) fn formats(outputs: &[PathBuf], allowed: &[Format]) -> Result<Vec<Format>, Failure> {
    for (i, path) in outputs.iter().enumerate() {
        if outputs[..i].contains(path) {
            return Err(Failure::usage(format!("{}: given twice", path.display())));
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
            Ok(format)
        })
        .collect()
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

/// Writes one file: into a new file beside it, which then takes its name.
pub(crate) fn write(
    path: &Path,
    format: Format,
    scene: &MeshedScene,
    look: &Picture,
) -> Result<(), Failure> {
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
        Format::Txt => Err(std::io::Error::other("a mesh is not written as text")),
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

/// Writes into a new file beside `path` that takes its name when it is complete;
/// on failure nothing remains.
fn atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<std::fs::File>) -> std::io::Result<()>,
) -> Result<(), Failure> {
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let temporary = parent(path).join(format!(".{name}.{}.part", std::process::id()));
    let result = std::fs::File::create(&temporary).and_then(|file| {
        let mut out = BufWriter::new(file);
        write(&mut out)?;
        out.flush()?;
        out.get_ref().sync_all()?;
        std::fs::rename(&temporary, path)
    });
    result.map_err(|error| {
        let _ = std::fs::remove_file(&temporary);
        Failure::internal(format!("{}: cannot be written: {error}", path.display()))
    })
}
