//! The parser's entry points.

use super::ast::{Expr, ExprKind, Program};
use super::build::Builder;
use super::deep::Deep;
use super::delimiters::{Balanced, balance};
use super::error::{MAX_ERRORS, SyntaxError, SyntaxErrorKind};
use super::grammar::ExpressionParser;
use super::lexer::{self, Lexeme};
use super::recover::{explain, parse_program};
use super::span::{FileId, Span};
use super::tokens::Tokens;
use crate::diag::MAX_SOURCE_BYTES;
use std::ops::Range;

/// Returns the tokens of `text[range]`, inside `level` addresses, and the errors in it.
pub(crate) fn lex(
    text: &str,
    range: Range<usize>,
    file: FileId,
    level: u32,
) -> (Vec<Lexeme<'_>>, Vec<SyntaxError>) {
    lexer::lex(text, range, file, level, parse_range)
}

/// Parses a file.
///
/// The program holds everything that could be parsed; each statement that could not is
/// replaced by an expression statement of [`ExprKind::Error`]. Without errors it holds no
/// such expression, and its tree is no deeper than [`MAX_DEPTH`](super::MAX_DEPTH). The
/// errors are in source order; after [`MAX_ERRORS`] of them comes
/// [`SyntaxErrorKind::TooManyErrors`].
pub fn parse(text: &str, file: FileId) -> (Program, Vec<SyntaxError>) {
    if text.len() > MAX_SOURCE_BYTES {
        let error = SyntaxError::new(SyntaxErrorKind::TooLarge(text.len()), Span::new(file, 0, 0));
        return (Program::default(), vec![error]);
    }
    let (lexemes, mut errors) = lex(text, 0..text.len(), file, 0);
    let mut balanced = balance(text, file, lexemes);
    add_brackets(&mut errors, &mut balanced);
    let mut program = Program::default();
    if errors.len() <= MAX_ERRORS {
        program = parse_program(Tokens::new(text, file, "end of the file", balanced), &mut errors);
    }
    (program, finish(errors))
}

/// Parses a single expression, such as a value given to `--set` or a line of the REPL.
///
/// # Errors
/// Returns the syntax errors of the text, in source order.
pub fn parse_expr(text: &str, file: FileId) -> Result<Expr, Vec<SyntaxError>> {
    if text.len() > MAX_SOURCE_BYTES {
        return Err(vec![SyntaxError::new(
            SyntaxErrorKind::TooLarge(text.len()),
            Span::new(file, 0, 0),
        )]);
    }
    match parse_range(text, 0..text.len(), file, 0) {
        (expr, errors) if errors.is_empty() => Ok(expr.node),
        (_, errors) => Err(errors),
    }
}

/// Parses the expression in a part of a text, inside `level` addresses. After errors the
/// result may be [`ExprKind::Error`].
pub(crate) fn parse_range(
    text: &str,
    range: Range<usize>,
    file: FileId,
    level: u32,
) -> (Deep<Expr>, Vec<SyntaxError>) {
    let hole =
        Deep::leaf(Expr { kind: ExprKind::Error, span: Span::new(file, range.start, range.end) });
    // Cut off the text after the part, so that errors at the end of the part are placed
    // there.
    let text = &text[..range.end];
    let (lexemes, mut errors) = lex(text, range, file, level);
    let mut balanced = balance(text, file, lexemes);
    add_brackets(&mut errors, &mut balanced);
    let tokens = Tokens::new(
        text,
        file,
        if level == 0 { "end of the text" } else { "end of the key" },
        balanced,
    );
    let mut builder = Builder::new(file);
    let expr = match ExpressionParser::new().parse(&mut builder, tokens.iter()) {
        Ok(expr) => expr,
        Err(error) => {
            if errors.is_empty() {
                errors.push(explain(&tokens, &error));
            }
            hole
        }
    };
    errors.append(&mut builder.errors);
    (expr, finish(errors))
}

/// Sorts the errors by their place and limits their number.
fn finish(mut errors: Vec<SyntaxError>) -> Vec<SyntaxError> {
    errors.sort_by_key(|e| (e.span.start, e.span.end));
    // A stray `}` is a consequence of a `{` that was expected earlier.
    let mut missing = 0_usize;
    errors.retain(|e| match &e.kind {
        SyntaxErrorKind::Unexpected { expected, .. } if expected.contains("`{`") => {
            missing += 1;
            true
        }
        SyntaxErrorKind::StrayClose('}') if missing > 0 => {
            missing -= 1;
            false
        }
        _ => true,
    });
    if let Some(next) = errors.get(MAX_ERRORS) {
        let span = next.span;
        errors.truncate(MAX_ERRORS);
        errors.push(SyntaxError::new(SyntaxErrorKind::TooManyErrors, span));
    }
    errors
}

/// Adds the errors about brackets, except those about brackets that may be closed inside
/// a lexeme without an end.
fn add_brackets(errors: &mut Vec<SyntaxError>, balanced: &mut Balanced<'_>) {
    use SyntaxErrorKind::{Address, UnterminatedComment, UnterminatedString};
    let swallows =
        |e: &&SyntaxError| matches!(e.kind, UnterminatedString | UnterminatedComment | Address(_));
    let swallowed: Vec<u32> = errors.iter().filter(swallows).map(|e| e.span.start).collect();
    errors.extend(balanced.errors.drain(..).filter(|e| match &e.kind {
        SyntaxErrorKind::Unclosed { before, .. } => {
            let end = before.as_ref().map_or(u32::MAX, |(_, place)| place.start);
            !swallowed.iter().any(|start| (e.span.start..end).contains(start))
        }
        _ => true,
    }));
}
