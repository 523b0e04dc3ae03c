//! Formats in and out. Nothing here opens a file: readers take text, writers
//! give text or bytes.

pub mod model;
pub mod obj;
mod read_error;
pub mod scene_file;

pub use read_error::ReadError;
