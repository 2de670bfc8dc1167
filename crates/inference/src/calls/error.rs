//! Errors in plans.

use pcadlang_engine::lang::error::{Fault, FaultKind, RunError};
use pcadlang_syntax::span::Span;

/// The error of a built-in, with its position in a plan.
pub(crate) fn fault(span: Span, f: Fault) -> Box<RunError> {
    Box::new(RunError { hint: f.hint, ..*fail(span, f.message) })
}

/// An error in an inference block.
pub(crate) fn fail(span: Span, message: String) -> Box<RunError> {
    Box::new(RunError {
        kind: FaultKind::Type,
        message,
        span,
        address: Default::default(),
        calls: Vec::new(),
        hint: None,
    })
}
