//! The door to standard output.

use std::io::Write as _;

/// Writes a line to standard output. A reader that has gone away
/// (`antumbra … | head`) is no error of ours: the command ends as if it had been read.
pub(crate) fn line(text: &str) {
    let mut out = std::io::stdout().lock();
    // An error means that nobody listens: there is nobody to tell.
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Formats a line for standard output.
macro_rules! say {
    ($($arg:tt)*) => {
        $crate::say::line(&format!($($arg)*))
    };
}
pub(crate) use say;
