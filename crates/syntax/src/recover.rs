//! Error recovery: where a text does not parse, its tokens are repaired and parsed again,
//! so that several errors can be reported.
//!
//! A repair adds a forgotten `;`, or replaces the statement that contains the error with
//! [`Token::Bad`]. A bad statement therefore hides neither the statements after it nor
//! those around it, the grammar needs no error productions, and the work is bounded: one
//! parse for each repair. Consequences of an error already reported in the same statement
//! are repaired silently.

use super::advice::{self, Context};
use super::ast::Program;
use super::build::Builder;
use super::error::{MAX_ERRORS, SyntaxError, SyntaxErrorKind};
use super::expected::{is_statement, names};
use super::grammar::ProgramParser;
use super::span::Span;
use super::token::Token;
use super::tokens::Tokens;
use lalrpop_util::ParseError;

/// Converts an error of the parser into one for the user, in a text that is not a list of
/// statements.
pub(crate) fn explain<'s>(
    tokens: &Tokens<'s>,
    error: &ParseError<usize, Token<'s>, ()>,
) -> SyntaxError {
    let (at, expected) = tokens.misfit(error);
    advice::explain(&Context { tokens, at, start: 0, expected, semicolon: false })
}

/// Parses a program, and repairs tokens that do not fit.
pub(crate) fn parse_program(mut tokens: Tokens<'_>, errors: &mut Vec<SyntaxError>) -> Program {
    let earlier: Vec<Span> = errors.iter().map(|e| e.span).collect();
    loop {
        let mut builder = Builder::new(tokens.file);
        let error = match ProgramParser::new().parse(&mut builder, tokens.iter()) {
            Ok(program) => {
                tokens.add_new(builder.errors, errors);
                return program;
            }
            Err(error) => error,
        };
        let (at, expected) = tokens.misfit(&error);
        let statement = tokens.statement(at, is_statement(&names(expected)));
        let start = statement.as_ref().map_or(at, |s| s.start);
        let semicolon = tokens.lacks_semicolon(at, expected);
        let explained =
            advice::explain(&Context { tokens: &tokens, at, start, expected, semicolon });
        let add_semicolon = matches!(explained.kind, SyntaxErrorKind::MissingSemicolon { .. });
        let known = earlier
            .iter()
            .any(|e| (tokens.span_at(start).start..=tokens.span_at(at).end).contains(&e.start));
        if !known && tokens.token(at) != Some(&Token::Bad) {
            errors.push(explained);
        }
        match statement {
            _ if add_semicolon => tokens.semicolon[at] = true,
            Some(range) => tokens.drop_statement(range),
            // Nothing is left to discard.
            None => return Program::default(),
        }
        if errors.len() > MAX_ERRORS {
            return Program::default();
        }
    }
}
