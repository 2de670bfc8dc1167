//! What a session says: a reply, or what was wrong.

use super::Picture;
use crate::lang::error::RunError;
use crate::model::{Error, Model};
use crate::syntax::span::Span;
use std::fmt;
use std::path::PathBuf;

/// What was done.
#[derive(Debug, Default)]
pub struct Reply {
    /// Lines to show; may be empty.
    pub text: String,
    /// A picture to show, after the text.
    pub picture: Option<Picture>,
    /// What the front end is asked to do.
    pub request: Option<Request>,
    /// Whether the screen is to be empty first.
    pub clears: bool,
    /// Whether the user wants to leave.
    pub ends: bool,
}

/// What a session cannot do by itself: it knows no terminal, editor or command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Ask the user a question; where the answer is yes, enter this.
    Confirm {
        /// The question.
        question: String,
        /// What to enter then.
        then: String,
    },
    /// Let the user edit the program's text, and give it to
    /// [`Session::replace`](super::Session::replace).
    Edit,
    /// Open a run's folder, and give the session of that to
    /// [`Session::take_over`](super::Session::take_over).
    Open(PathBuf),
}

impl Reply {
    /// A request to the front end.
    pub(super) fn request(request: Request) -> Reply {
        Reply { request: Some(request), ..Reply::default() }
    }

    /// A text.
    pub fn text(text: impl Into<String>) -> Reply {
        Reply { text: text.into(), ..Reply::default() }
    }
}

/// Why nothing was done.
#[derive(Debug)]
pub enum Trouble {
    /// Messages with their places.
    Program(Box<Error>),
    /// Anything else, and what to do about it.
    Plain(String, Option<String>),
    /// It was stopped from outside.
    Stopped,
}

impl Trouble {
    /// A message without a place.
    pub fn plain(message: impl Into<String>) -> Trouble {
        Trouble::Plain(message.into(), None)
    }

    /// The same with a hint.
    #[must_use]
    pub fn hint(self, hint: impl Into<String>) -> Trouble {
        match self {
            Trouble::Plain(message, _) => Trouble::Plain(message, Some(hint.into())),
            other => other,
        }
    }

    /// A failure of a model; one without a place is only its message.
    pub(super) fn run(model: &Model, e: RunError) -> Trouble {
        match e.span == Span::default() {
            true => Trouble::Plain(e.message, e.hint),
            false => model.run_error(e).into(),
        }
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
