//! The data of a diagnostic, without its rendering.
//!
//! A good diagnostic has at least one primary label, a message that makes sense without
//! the source, and hints that say what to type.

use crate::span::Span;

/// The severity of a diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// For information.
    Note,
    /// Suspicious, but the program runs.
    Warning,
    /// The program does not run.
    Error,
}

/// A span of the source with a text about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// The span.
    pub span: Span,
    /// The text; may be empty.
    pub text: String,
    /// True for the location of the error itself (underlined with `^`), false for a span that
    /// helps to explain it (`-`).
    pub primary: bool,
}

/// A message to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The severity.
    pub severity: Severity,
    /// The error, in one line.
    pub message: String,
    /// The relevant spans of the source.
    pub labels: Vec<Label>,
    /// Suggestions for a fix.
    pub hints: Vec<String>,
    /// Further information, e.g. the address being executed and the call path.
    pub notes: Vec<String>,
}

impl Diagnostic {
    /// Creates a message of the given severity, without labels.
    pub fn new(severity: Severity, message: impl Into<String>) -> Self {
        Diagnostic {
            severity,
            message: message.into(),
            labels: Vec::new(),
            hints: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Creates an error with a primary label at `span`.
    pub fn error(message: impl Into<String>, span: Span, text: impl Into<String>) -> Self {
        Diagnostic::new(Severity::Error, message).primary(span, text)
    }

    /// Adds a label at the location of the error.
    #[must_use]
    pub fn primary(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push(Label { span, text: text.into(), primary: true });
        self
    }

    /// Adds a label at a span that helps to explain the error.
    #[must_use]
    pub fn secondary(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push(Label { span, text: text.into(), primary: false });
        self
    }

    /// Adds a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hints.push(hint.into());
        self
    }

    /// Adds a hint in place.
    #[doc(hidden)]
    pub fn hint_also(&mut self, hint: impl Into<String>) {
        self.hints.push(hint.into());
    }

    /// Adds a label that helps to explain the error, in place.
    #[doc(hidden)]
    pub fn point_at(&mut self, span: Span, text: &str) {
        self.labels.push(Label { span, text: text.into(), primary: false });
    }

    /// Adds a note.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }
}

/// An error that can be shown to the user.
pub trait IntoDiagnostic {
    /// Converts the error to a diagnostic.
    fn into_diagnostic(self) -> Diagnostic;
}

impl IntoDiagnostic for Diagnostic {
    fn into_diagnostic(self) -> Diagnostic {
        self
    }
}
