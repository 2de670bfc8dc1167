//! What is wrong with a program or its run, as messages.

use crate::diag::{Diagnostic, IntoDiagnostic, Severity, SourceMap, render};
use crate::lang::error::{Fault, RunError};
use std::fmt;

/// What is wrong with a program, its data, or a run of it: messages with their places.
#[derive(Clone)]
pub struct Error {
    /// The messages.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts they point into.
    pub sources: SourceMap,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&render(&self.sources, &self.diagnostics, false))
    }
}

/// As it is shown: what a `main` that returns it prints is for people too.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {}

impl IntoDiagnostic for RunError {
    fn into_diagnostic(self) -> Diagnostic {
        let mut d = Diagnostic::error(self.message, self.span, "");
        if !self.address.segments.is_empty() {
            d = d.note(format!("while running {}", self.address.shortened()));
        }
        let calls: Vec<&str> = self.calls.iter().map(|(f, _)| &**f).collect();
        match calls.len() {
            0 => {}
            1..=8 => d = d.note(format!("called through {}", calls.join(" -> "))),
            n => {
                let (first, last) = (calls[..4].join(" -> "), calls[n - 3..].join(" -> "));
                d = d.note(format!("called through {first} -> … {} more … -> {last}", n - 7));
            }
        }
        d.hints.extend(self.hint);
        d
    }
}

/// An error without a place in a text.
pub(super) fn plain_error(f: Fault, sources: &SourceMap) -> Error {
    let mut d = Diagnostic::new(Severity::Error, f.message);
    d.hints.extend(f.hint);
    Error { diagnostics: vec![d], sources: sources.clone() }
}
