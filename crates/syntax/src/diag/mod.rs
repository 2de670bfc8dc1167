//! Diagnostics: messages to the user, the source text they refer to, and their rendering.
//!
//! Every phase (syntax, names, types, run time) has its own error type and converts it to
//! a [`Diagnostic`] in one place, by [`IntoDiagnostic`]. Nothing in this module prints or
//! reads files: [`render`] returns text.

mod diagnostic;
mod error;
mod excerpt;
mod nearest;
mod render;
mod source;

#[doc(inline)]
pub use crate::span::{FileId, Span};
pub use diagnostic::{Diagnostic, IntoDiagnostic, Label, Severity};
pub use error::Error;
pub use nearest::nearest;
pub use render::render;
pub(crate) use source::too_large;
pub use source::{MAX_SOURCE_BYTES, SourceFile, SourceMap};
