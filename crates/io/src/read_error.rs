//! Why a file could not be read.

/// A text that is not of its format, or not of its schema: exit code 3.
///
/// What is well formed but makes no scene is left to
/// [`Scene::build`](antumbra_scene::Scene::build).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", place(*.line, *.column))]
pub struct ReadError {
    /// Line, from 1.
    pub line: Option<usize>,
    /// Column, from 1.
    pub column: Option<usize>,
    /// One line, lower case, without full stop.
    pub message: String,
}

impl ReadError {
    /// An error in a line.
    pub(crate) fn at_line(line: usize, message: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            column: None,
            message: one_line(&message.into()),
        }
    }

    /// An error of the whole text.
    pub(crate) fn whole(message: impl Into<String>) -> Self {
        Self {
            line: None,
            column: None,
            message: one_line(&message.into()),
        }
    }
}

/// The text with line ends and other control characters written as escapes:
/// messages quote what stands in files, and are one line.
pub(crate) fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() {
            line.extend(c.escape_default());
        } else {
            line.push(c);
        }
    }
    line
}

fn place(line: Option<usize>, column: Option<usize>) -> String {
    match (line, column) {
        (Some(line), Some(column)) => format!("line {line}, column {column}: "),
        (Some(line), None) => format!("line {line}: "),
        _ => String::new(),
    }
}
