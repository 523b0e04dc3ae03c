//! What a command fails with, and its exit code.

use std::fmt;

/// The kinds of failure, by exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Internal = 1,
    Usage = 2,
    Unreadable = 3,
    NotAcceptable = 4,
}

/// A failure with its message, possibly of several lines.
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    kind: Kind,
    message: String,
}

impl Failure {
    /// A bug of ours, or of the machine: exit code 1.
    pub(crate) fn internal(message: impl Into<String>) -> Self {
        Self {
            kind: Kind::Internal,
            message: message.into(),
        }
    }

    /// Bad usage: exit code 2.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self {
            kind: Kind::Usage,
            message: message.into(),
        }
    }

    /// No file, not the format, not the schema: exit code 3.
    pub(crate) fn unreadable(message: impl Into<String>) -> Self {
        Self {
            kind: Kind::Unreadable,
            message: message.into(),
        }
    }

    /// Content that cannot be accepted: exit code 4.
    pub(crate) fn not_acceptable(message: impl Into<String>) -> Self {
        Self {
            kind: Kind::NotAcceptable,
            message: message.into(),
        }
    }

    pub(crate) fn exit_code(&self) -> u8 {
        self.kind as u8
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}
