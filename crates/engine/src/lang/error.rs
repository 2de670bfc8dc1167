//! Errors at run time: what went wrong, where in the text, at which address, and through
//! which calls.

pub use super::fault::{Fault, FaultKind};

use super::address::Address;
use pcadlang_syntax::diag::{Diagnostic, IntoDiagnostic};
use pcadlang_syntax::span::Span;
use std::fmt;
use std::sync::Arc;

/// A failure while a program runs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunError {
    /// Its kind.
    pub kind: FaultKind,
    /// The error message.
    pub message: String,
    /// The expression or statement being executed.
    pub span: Span,
    /// The address being executed.
    pub address: Address,
    /// The calls that lead there, outermost first: function and call site.
    pub calls: Vec<(Arc<str>, Span)>,
    /// A suggestion.
    pub hint: Option<String>,
}

impl RunError {
    /// True if a proposal that fails like this is rejected, rather than ending the run.
    pub fn is_recoverable(&self) -> bool {
        self.kind == FaultKind::Domain
    }
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.message)?;
        if !self.address.segments.is_empty() {
            write!(f, " (at {})", self.address)?;
        }
        Ok(())
    }
}

impl std::error::Error for RunError {}

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
