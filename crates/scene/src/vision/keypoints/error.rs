//! Errors of keypoints, with hints.

use std::fmt;

/// An error in keypoints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeypointsError {
    /// What is wrong, with the path in the file.
    pub message: String,
    /// How to fix it.
    pub hint: Option<String>,
}

impl KeypointsError {
    pub(super) fn new(message: impl Into<String>) -> KeypointsError {
        KeypointsError { message: message.into(), hint: None }
    }

    pub(super) fn hint(self, hint: impl Into<String>) -> KeypointsError {
        KeypointsError { hint: Some(hint.into()), ..self }
    }
}

impl fmt::Display for KeypointsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        self.hint.as_ref().map_or(Ok(()), |h| write!(f, "; {h}"))
    }
}

impl std::error::Error for KeypointsError {}

/// Joins the first few of some names, for messages.
pub(super) fn first<'a>(names: impl ExactSizeIterator<Item = &'a str>, most: usize) -> String {
    let all = names.len();
    let mut text = names.take(most).collect::<Vec<_>>().join(", ");
    if all > most {
        text.push_str(&format!(", … {all} in all"));
    }
    text
}
