//! The door to standard output.

use crate::failure::Failure;
use std::io::{ErrorKind, Write as _};
use std::sync::OnceLock;

/// The first error of standard output.
static ERROR: OnceLock<String> = OnceLock::new();

/// Writes a line to standard output.
pub(crate) fn line(text: &str) {
    let mut out = std::io::stdout().lock();
    check(writeln!(out, "{text}").and_then(|()| out.flush()));
}

/// Remembers what went wrong with standard output. A reader that has gone away
/// (`antumbra … | head`) is no error of ours: the command ends as if it had been read.
pub(crate) fn check(written: std::io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = ERROR.set(error.to_string());
    }
}

/// What went wrong, if something did.
pub(crate) fn failure() -> Option<Failure> {
    let error = ERROR.get()?;
    Some(Failure::internal(format!(
        "standard output: cannot be written: {error}"
    )))
}

/// Formats a line for standard output.
macro_rules! say {
    ($($arg:tt)*) => {
        $crate::say::line(&format!($($arg)*))
    };
}
pub(crate) use say;
