//! The parser compared with its specification: the sample programs, precedence, spans,
//! printing, recovery, limits, random text. Messages are tested in
//! `tests/language/errors.rs`.

mod formatting;
mod fuzz;
mod generator;
mod limits;
mod precedence;
mod recovery;
mod roundtrip;
mod samples;
mod spans;
mod texts;

use pcadlang_syntax::ast::{Expr, Program};
use pcadlang_syntax::diag::{IntoDiagnostic, SourceMap, render};
use pcadlang_syntax::span::FileId;
use pcadlang_syntax::{SyntaxError, parse, parse_expr};
use std::fmt::Debug;

/// Parses a program that must be valid.
fn program(text: &str) -> Program {
    let (program, errors) = parse(text, FileId(0));
    assert!(errors.is_empty(), "{}\n{text}", shown(text, errors));
    program
}

/// Parses an expression that must be valid.
fn expr(text: &str) -> Expr {
    parse_expr(text, FileId(0)).unwrap_or_else(|errors| panic!("{}", shown(text, errors)))
}

/// Renders errors as the user sees them.
fn shown(text: &str, errors: Vec<SyntaxError>) -> String {
    let mut map = SourceMap::new();
    map.add("test.pcad", text);
    let diagnostics: Vec<_> = errors.into_iter().map(IntoDiagnostic::into_diagnostic).collect();
    render(&map, &diagnostics, false)
}

/// Returns a tree without its spans, to compare the meaning of two texts.
fn bare(tree: &impl Debug) -> String {
    const SPAN: &str = "Span { file: FileId(";
    let text = format!("{tree:?}");
    let mut bare = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some(at) = rest.find(SPAN) {
        bare.push_str(&rest[..at]);
        rest = &rest[at..];
        rest = &rest[rest.find('}').map_or(rest.len(), |end| end + 1)..];
    }
    bare + rest
}
