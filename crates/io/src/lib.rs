//! Formats in and out. Nothing here opens a file: readers take text, writers
//! give text or bytes.

pub mod model;
pub mod obj;
pub mod picture;
mod read_error;
pub mod scene_file;
pub mod write;

pub use read_error::ReadError;
