//! Errors in a program or its run, as diagnostics.

use super::{Diagnostic, SourceMap, render};
use std::fmt;

/// An error in a program, its data or a run of it: diagnostics with the source texts they
/// refer to.
#[derive(Clone)]
pub struct Error {
    /// The diagnostics.
    pub diagnostics: Vec<Diagnostic>,
    /// The source texts that they refer to.
    pub sources: SourceMap,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&render(&self.sources, &self.diagnostics, false))
    }
}

/// The same as `Display`, because a `main` that returns this error prints it with
/// `Debug`.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {}
