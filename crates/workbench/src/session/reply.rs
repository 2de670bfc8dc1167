//! Replies of a session, and its errors.

use super::picture::Picture;
use pcadlang_engine::lang::error::RunError;
use pcadlang_library::model::{Error, Model};
use pcadlang_syntax::span::Span;
use std::fmt;
use std::path::PathBuf;

/// The result of an entry.
#[derive(Debug, Default)]
pub struct Reply {
    /// Lines to show; may be empty.
    pub text: String,
    /// A picture to show, after the text.
    pub picture: Option<Picture>,
    /// What the front end must do, if anything.
    pub request: Option<Request>,
    /// Whether to clear the screen first.
    pub clears: bool,
    /// Whether the user quits.
    pub ends: bool,
}

/// An action for the front end, since a session has no terminal, editor or command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Ask the user a question, and enter a text if the answer is yes.
    Confirm {
        /// The question.
        question: String,
        /// The text to enter.
        then: String,
    },
    /// Let the user edit the program's text, and pass the result to
    /// [`Session::replace`](super::Session::replace).
    Edit,
    /// Open the folder of a run, and pass its session to
    /// [`Session::take_over`](super::Session::take_over).
    Open(PathBuf),
}

impl Reply {
    /// Makes a reply with a request to the front end.
    pub(super) fn request(request: Request) -> Reply {
        Reply { request: Some(request), ..Reply::default() }
    }

    /// Makes a reply with a text.
    pub fn text(text: impl Into<String>) -> Reply {
        Reply { text: text.into(), ..Reply::default() }
    }
}

/// Why an entry failed.
#[derive(Debug)]
pub enum Trouble {
    /// Diagnostics with source locations.
    Program(Box<Error>),
    /// Any other error: a message and an optional hint.
    Plain(String, Option<String>),
    /// The entry was stopped from outside.
    Stopped,
}

impl Trouble {
    /// Makes an error from a message without a location.
    pub fn plain(message: impl Into<String>) -> Trouble {
        Trouble::Plain(message.into(), None)
    }

    /// Adds a hint to a plain message.
    #[must_use]
    pub fn hint(self, hint: impl Into<String>) -> Trouble {
        match self {
            Trouble::Plain(message, _) => Trouble::Plain(message, Some(hint.into())),
            other => other,
        }
    }

    /// Makes an error from a failure of a model. Without a location, it is a plain
    /// message.
    pub(super) fn run(model: &Model, e: RunError) -> Trouble {
        match e.span == Span::default() {
            true => Trouble::Plain(e.message, e.hint),
            false => model.run_error(e).into(),
        }
    }
}

impl From<Error> for Trouble {
    fn from(e: Error) -> Self {
        Trouble::Program(Box::new(e))
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::Program(e) => f.write_str(e.to_string().trim_end()),
            Trouble::Plain(message, None) => write!(f, "error: {message}"),
            Trouble::Plain(message, Some(hint)) => write!(f, "error: {message}\n  = hint: {hint}"),
            Trouble::Stopped => f.write_str("stopped; nothing has changed"),
        }
    }
}

impl std::error::Error for Trouble {}
