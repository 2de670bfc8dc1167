//! The errors of commands and of entries at the prompt.

use pcadlang_engine::lang::error::RunError;
use pcadlang_library::Model;
use pcadlang_syntax::diag::Error;
use pcadlang_syntax::span::Span;
use std::fmt::{Display, Formatter};

/// The message where an entry was stopped.
pub const STOPPED: &str = "stopped; nothing has changed";

/// The error of a command, or of an entry at the prompt.
#[derive(Debug)]
pub enum Failure {
    /// Diagnostics with source locations.
    Program(Box<Error>),
    /// Any other error: a message and an optional hint.
    Plain(String, Option<String>),
    /// The user interrupted the command, or stopped the entry; results so far are kept.
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

    /// Returns the message with its hint, as transcripts show it.
    pub fn with_hint(&self) -> String {
        match self {
            Failure::Plain(message, Some(hint)) => format!("error: {message}\n  = hint: {hint}"),
            Failure::Plain(message, None) => format!("error: {message}"),
            other => other.to_string(),
        }
    }

    /// Makes an error from one of a model. Without a location, it is a plain message.
    pub(crate) fn run(model: &Model, e: RunError) -> Failure {
        match e.span == Span::default() {
            true => Failure::Plain(e.message, e.hint),
            false => model.run_error(e).into(),
        }
    }
}

/// The message, without colours, hint or a final line break.
impl Display for Failure {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Failure::Program(e) => f.write_str(e.to_string().trim_end()),
            Failure::Plain(message, _) => f.write_str(message),
            Failure::Interrupted => f.write_str("interrupted"),
        }
    }
}

impl std::error::Error for Failure {}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Failure::Program(Box::new(e))
    }
}

/// Makes an error from a message without a hint.
pub fn plain(message: impl Into<String>) -> Failure {
    Failure::Plain(message.into(), None)
}
