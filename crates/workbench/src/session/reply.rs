//! Replies of a session.

use super::picture::ViewPicture;
use std::path::PathBuf;

/// The result of an entry.
#[derive(Debug, Default)]
pub struct Reply {
    /// Lines to show; may be empty.
    pub text: String,
    /// A picture to show, after the text.
    pub picture: Option<ViewPicture>,
    /// An action that the front end must take, if any.
    pub request: Option<Request>,
    /// True to clear the screen first.
    pub clears: bool,
    /// True if the user quits.
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
