//! The parser's entry points.

use super::ast::{Expr, ExprKind, Program};
use super::build::Builder;
use super::deep::Deep;
use super::delimiters::balance;
use super::error::{MAX_ERRORS, SyntaxError, SyntaxErrorKind};
use super::grammar::ExpressionParser;
use super::lexer::lex;
use super::recover::{Tokens, parse_program};
use super::span::{FileId, Span};
use crate::diag::MAX_SOURCE_BYTES;
use std::ops::Range;

/// Parses a file.
///
/// The program holds what could be parsed: where a statement could not, it has an expression statement of
/// [`ExprKind::Error`]. Without errors it holds no such expression, and its tree is no deeper than
/// [`MAX_DEPTH`](super::MAX_DEPTH).
/// The errors, at most a few more than [`MAX_ERRORS`], are in the order of the text.
pub fn parse(text: &str, file: FileId) -> (Program, Vec<SyntaxError>) {
    if text.len() > MAX_SOURCE_BYTES {
        let error = SyntaxError::new(SyntaxErrorKind::TooLarge(text.len()), Span::new(file, 0, 0));
        return (Program::default(), vec![error]);
    }
    let (lexemes, mut errors) = lex(text, 0..text.len(), file, 0);
    if errors.len() >= MAX_ERRORS {
        let end = errors.last().map_or(0, |e| e.span.end as usize);
        errors.push(SyntaxError::new(SyntaxErrorKind::TooManyErrors, Span::new(file, end, end)));
        return (Program::default(), errors);
    }
    let mut balanced = balance(text, file, lexemes);
    errors.append(&mut balanced.errors);
    let program = parse_program(Tokens::new(text, file, balanced), &mut errors);
    errors.sort_by_key(|e| (e.span.start, e.span.end));
    (program, errors)
}

/// Parses one expression: a value given to `--set`, a line of the REPL.
///
/// # Errors
/// What is wrong with the text, in its order.
pub fn parse_expr(text: &str, file: FileId) -> Result<Expr, Vec<SyntaxError>> {
    if text.len() > MAX_SOURCE_BYTES {
        return Err(vec![SyntaxError::new(SyntaxErrorKind::TooLarge(text.len()), Span::new(file, 0, 0))]);
    }
    match parse_range(text, 0..text.len(), file, 0) {
        (expr, errors) if errors.is_empty() => Ok(expr.node),
        (_, errors) => Err(errors),
    }
}

/// Parses the expression in a part of a text, `level` addresses deep; after errors it may be [`ExprKind::Error`].
pub(crate) fn parse_range(text: &str, range: Range<usize>, file: FileId, level: u32) -> (Deep<Expr>, Vec<SyntaxError>) {
    let hole = Deep::leaf(Expr { kind: ExprKind::Error, span: Span::new(file, range.start, range.end) });
    // Without what follows the part, errors at its end are placed there.
    let text = &text[..range.end];
    let (lexemes, mut errors) = lex(text, range, file, level);
    let mut balanced = balance(text, file, lexemes);
    errors.append(&mut balanced.errors);
    let tokens = Tokens::new(text, file, balanced);
    let mut builder = Builder::new(file);
    let expr = match ExpressionParser::new().parse(&mut builder, tokens.iter()) {
        Ok(expr) => expr,
        Err(error) => {
            if errors.is_empty() {
                errors.push(tokens.explain(&error, 0));
            }
            hole
        }
    };
    errors.append(&mut builder.errors);
    errors.sort_by_key(|e| (e.span.start, e.span.end));
    (expr, errors)
}
