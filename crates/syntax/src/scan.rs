//! The text being lexed, from which lexemes are scanned by hand.

use super::ast::Expr;
use super::deep::Deep;
use super::error::{SyntaxError, SyntaxErrorKind};
use super::span::{FileId, Span};
use super::token::is_name;
use std::ops::Range;

/// Parses the computed key in a part of a text, inside that many addresses.
pub(super) type ParseKey = fn(&str, Range<usize>, FileId, u32) -> (Deep<Expr>, Vec<SyntaxError>);

/// The state of the lexer.
pub(crate) struct Lexer<'s> {
    /// The whole text of the file.
    pub text: &'s str,
    /// The end of the part being lexed.
    pub end: usize,
    pub file: FileId,
    /// The number of addresses around this text: keys may be expressions, which may
    /// contain addresses.
    pub level: u32,
    pub parse_key: ParseKey,
    pub errors: Vec<SyntaxError>,
}

impl<'s> Lexer<'s> {
    pub fn error(&mut self, kind: SyntaxErrorKind, start: usize, end: usize) {
        self.errors.push(SyntaxError::new(kind, Span::new(self.file, start, end)));
    }

    /// Returns the text from byte `at` to the end of the part being lexed.
    pub fn rest(&self, at: usize) -> &'s str {
        self.text.get(at..self.end).unwrap_or("")
    }

    /// Returns the name that starts at byte `at`.
    pub fn name(&self, at: usize) -> Option<&'s str> {
        let rest = self.rest(at);
        let length = rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count();
        Some(&rest[..length]).filter(|name| is_name(name))
    }
}
