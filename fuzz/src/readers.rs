//! Laws of readers, whatever the format.

use antumbra::{Scene, SceneInput};

/// A fuzz target of a reader.
///
/// The reader takes bytes, or text, and gives a `SceneInput` or an error:
///
/// ```ignore
/// #![no_main]
/// antumbra_fuzz::reader!(text: t, antumbra_io::scene_file::read(t));
/// ```
///
/// with `bytes: b` in place of `text: t` for a format that is not text. A reader that asks
/// for other files is given [`no_file`], or something that makes them of the bytes.
#[macro_export]
macro_rules! reader {
    (text: $text:ident, $read:expr) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            if let Ok($text) = std::str::from_utf8(bytes) {
                $crate::readers::check($read);
            }
        });
    };
    (bytes: $bytes:ident, $read:expr) => {
        libfuzzer_sys::fuzz_target!(|$bytes: &[u8]| {
            $crate::readers::check($read);
        });
    };
}

/// What a reader is told when it asks for another file.
///
/// # Errors
///
/// Always.
pub fn no_file<T>(name: &str) -> Result<T, String> {
    Err(format!("{name} is not there"))
}

/// What is read can be written and read again, and is accepted or refused with a name;
/// what is not read is said in one line.
///
/// # Panics
///
/// If not.
pub fn check<E: std::fmt::Display>(read: Result<SceneInput, E>) {
    let input = match read {
        Ok(input) => input,
        Err(error) => {
            let message = error.to_string();
            assert!(!message.trim().is_empty(), "an error without a message");
            assert!(!message.contains('\n'), "more than a line: {message:?}");
            return;
        }
    };
    let has_nan = input
        .surfaces
        .iter()
        .flat_map(|s| s.vertices.iter().chain(s.holes.iter().flatten()))
        .any(|v| !v.is_finite());
    let numbers = input
        .materials
        .iter()
        .flat_map(|m| m.reflectance.iter().chain(&m.exitance));
    // JSON has no numbers for these.
    if !has_nan && numbers.clone().all(|x| x.is_finite()) {
        let written = antumbra_io::scene_file::write(&input);
        let again = antumbra_io::scene_file::read(&written)
            .unwrap_or_else(|e| panic!("{e}\nin what was written of {input:?}:\n{written}"));
        let expected = SceneInput {
            triangulate: false,
            notes: again.notes.clone(),
            ..input.clone()
        };
        assert_eq!(again, expected, "read again from\n{written}");
    }
    // The check of overlaps compares all pairs of surfaces.
    if input.surfaces.len() <= 200
        && let Err(problems) = Scene::build(&input)
    {
        assert!(!problems.is_empty(), "refused without a reason");
    }
}

/// An OBJ file and its material library in one text: what follows the first line
/// `mtl` is the library, by whatever name it is asked for.
///
/// # Errors
///
/// What the reader says.
pub fn read_obj(text: &str) -> Result<SceneInput, antumbra_io::ReadError> {
    let (obj, mtl) = text.split_once("\nmtl\n").unwrap_or((text, ""));
    let mut load = |name: &str| {
        if mtl.is_empty() {
            no_file(name)
        } else {
            Ok(mtl.to_owned())
        }
    };
    antumbra_io::obj::read(obj, &mut load, antumbra::scene::LengthUnit::Metre)
}

/// A glTF or GLB file whose other files are all missing.
///
/// # Errors
///
/// What the reader says.
pub fn read_gltf(bytes: &[u8]) -> Result<SceneInput, antumbra_io::ReadError> {
    let metre = antumbra::scene::LengthUnit::Metre;
    antumbra_io::gltf::read(bytes, &mut no_file, metre)
}

/// Radiance files in one text, apart where a line says `file`; commands find none.
///
/// # Errors
///
/// What the reader says.
pub fn read_rad(text: &str) -> Result<SceneInput, antumbra_io::ReadError> {
    let files: Vec<antumbra_io::rad::RadFile> = text
        .split("\nfile\n")
        .enumerate()
        .map(|(k, text)| antumbra_io::rad::RadFile {
            name: format!("{k}.rad"),
            text: text.to_owned(),
        })
        .collect();
    let mut load = |_: &str, name: &str| no_file(name);
    antumbra_io::rad::read(&files, &mut load, antumbra::scene::LengthUnit::Metre)
}
