//! Why a command fails.

use pcadlang_syntax::diag::Error;
use pcadlang_workbench::session::Trouble;
use std::fmt::{Display, Formatter};

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Diagnostics with source locations.
    Program(Box<Error>),
    /// Any other error: a message and an optional hint.
    Plain(String, Option<String>),
    /// The user interrupted the command; results so far are kept.
    Interrupted,
}

impl Failure {
    /// Adds a hint to a plain message.
    #[must_use]
    pub fn hint(self, hint: impl Into<String>) -> Failure {
        match self {
            Failure::Plain(message, _) => Failure::Plain(message, Some(hint.into())),
            other => other,
        }
    }
}

/// The message, without colours or a final line break.
impl Display for Failure {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Failure::Program(e) => f.write_str(e.to_string().trim_end()),
            Failure::Plain(message, _) => f.write_str(message),
            Failure::Interrupted => f.write_str("interrupted"),
        }
    }
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Failure::Program(Box::new(e))
    }
}

/// Makes a failure from a message without a hint.
pub fn plain(message: impl Into<String>) -> Failure {
    Failure::Plain(message.into(), None)
}

impl From<Trouble> for Failure {
    fn from(t: Trouble) -> Self {
        match t {
            Trouble::Program(e) => Failure::Program(e),
            Trouble::Plain(message, hint) => Failure::Plain(message, hint),
            Trouble::Stopped => Failure::Interrupted,
        }
    }
}
