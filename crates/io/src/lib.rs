//! Formats in and out. Nothing here opens a file: readers take text or
//! bytes, writers give text or bytes.

pub mod gltf;
mod materials;
mod merge;
pub mod model;
mod names;
pub mod obj;
pub mod picture;
pub mod rad;
mod read_error;
pub mod scene_file;
pub mod stl;
pub mod study;
mod subtract;
pub mod text;
pub mod vs3;
pub mod write;

pub use read_error::ReadError;
