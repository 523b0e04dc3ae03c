//! Formats in and out. Nothing here opens a file: readers take text, writers
//! give text or bytes.

pub mod model;
pub mod obj;
pub mod picture;
pub mod rad;
mod read_error;
pub mod scene_file;
mod subtract;
pub mod vs3;
pub mod write;

pub use read_error::ReadError;
