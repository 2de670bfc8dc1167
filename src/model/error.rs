//! Errors in a program or its run, as diagnostics.

use crate::diag::{Diagnostic, IntoDiagnostic, Severity, SourceMap, render};
use crate::lang::error::{Fault, RunError};
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

/// Creates an error without a source location.
pub(super) fn plain_error(f: Fault, sources: &SourceMap) -> Error {
    let mut d = Diagnostic::new(Severity::Error, f.message);
    d.hints.extend(f.hint);
    Error { diagnostics: vec![d], sources: sources.clone() }
}
