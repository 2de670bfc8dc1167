//! Several errors from one text: where it does not parse, the tokens are repaired and parsed again.
//!
//! A repair adds a forgotten `;`, or replaces the statement that holds the error by [`Token::Bad`]. So a bad statement
//! hides neither the statements after it nor those around it, the grammar needs no error productions, and the work is
//! bounded: one parse for each error. What follows from an error already reported in the same statement is repaired
//! without a word.

use super::advice::{self, Context};
use super::ast::Program;
use super::build::Builder;
use super::delimiters::{Balanced, first_on_line, starts_statement};
use super::error::{MAX_ERRORS, SyntaxError, SyntaxErrorKind};
use super::grammar::ProgramParser;
use super::lexer::Lexeme;
use super::span::{FileId, Span};
use super::token::Token;
use lalrpop_util::ParseError;
use std::cell::Cell;
use std::ops::Range;

/// The tokens of a text, and the repairs made to them.
pub(crate) struct Tokens<'s> {
    pub text: &'s str,
    pub file: FileId,
    pub lexemes: Vec<Lexeme<'s>>,
    mates: Vec<usize>,
    /// Whether a `;` is added before the token; also for the end of the text.
    semicolon: Vec<bool>,
    /// Whether the token is left out, being part of a bad statement.
    dropped: Vec<bool>,
    /// The index of the token the parser asked for last.
    last: Cell<usize>,
}

/// A token with its first byte and the byte after its last, as the parser wants it.
pub(crate) type Triple<'s> = (usize, Token<'s>, usize);

impl<'s> Tokens<'s> {
    pub fn new(text: &'s str, file: FileId, balanced: Balanced<'s>) -> Self {
        let Balanced { lexemes, mates, .. } = balanced;
        let n = lexemes.len();
        Tokens {
            text,
            file,
            lexemes,
            mates,
            semicolon: vec![false; n + 1],
            dropped: vec![false; n],
            last: Cell::new(0),
        }
    }

    /// The tokens as repaired.
    pub fn iter(&self) -> impl Iterator<Item = Triple<'s>> {
        (0..=self.lexemes.len()).flat_map(move |i| {
            let end = i.checked_sub(1).and_then(|i| self.lexemes.get(i)).map_or(0, |l| l.end);
            let semicolon = self.semicolon[i].then_some((end, Token::Semi, end));
            let token = self.lexemes.get(i).filter(|_| !self.dropped[i]);
            let token = token.map(|l| (l.start, l.token.clone(), l.end));
            semicolon.into_iter().chain(token).inspect(move |_| self.last.set(i))
        })
    }

    /// Turns an error of the parser into one for the user.
    pub fn explain(&self, error: &ParseError<usize, Token<'s>, ()>, start: usize) -> SyntaxError {
        let at = self.error_index(error);
        let kind = match error {
            ParseError::UnrecognizedEof { expected, .. } | ParseError::UnrecognizedToken { expected, .. } => {
                advice::explain(&Context { tokens: self, at, start, expected })
            }
            // The grammar's own errors and extra tokens do not occur.
            _ => advice::explain(&Context { tokens: self, at, start, expected: &[] }),
        };
        SyntaxError::new(kind, self.span_at(at))
    }

    /// The index of the token that did not fit; the number of tokens at the end of the text.
    fn error_index(&self, error: &ParseError<usize, Token<'s>, ()>) -> usize {
        match error {
            ParseError::UnrecognizedEof { .. } => self.lexemes.len(),
            _ => self.last.get(),
        }
    }

    /// The place of a token, or of the end of the text.
    fn span_at(&self, at: usize) -> Span {
        let end = self.text.trim_end().len();
        let (start, end) = self.lexemes.get(at).map_or((end, end), |l| (l.start, l.end));
        Span::new(self.file, start, end)
    }

    fn token(&self, i: usize) -> Option<&Token<'s>> {
        self.lexemes.get(i).map(|l| &l.token)
    }

    /// Whether a `;` is missing before token `at`, where one would fit: a line, a block or the text ends, or a statement
    /// starts.
    fn lacks_semicolon(&self, at: usize, expected: &[String]) -> bool {
        let fits = expected.iter().any(|e| e == "\";\"") && at > 0 && !self.semicolon[at];
        fits && match self.token(at) {
            None | Some(Token::RBrace) => true,
            Some(token) if first_on_line(self.text, &self.lexemes, at) => {
                starts_statement(&self.lexemes, at) || (token.starts_expression() && *token != Token::LBrace)
            }
            Some(_) => starts_statement(&self.lexemes, at),
        }
    }

    /// The statement to give up for an error at token `at`: the innermost that has any tokens.
    fn statement(&self, at: usize) -> Option<Range<usize>> {
        let (mut block, mut found) = (0..self.lexemes.len(), None);
        loop {
            let statement = self.statement_in(&block, at);
            if !statement.is_empty() && self.token(statement.start) != Some(&Token::Bad) {
                found = Some(statement.clone());
            }
            let Some(brace) = self.block_around(&statement, at) else { return found };
            block = brace + 1..self.mates[brace];
        }
    }

    /// The statement of a block that token `at` belongs to.
    fn statement_in(&self, block: &Range<usize>, at: usize) -> Range<usize> {
        let (mut start, mut i) = (block.start, block.start);
        while i < block.end {
            let next = self.live(self.mates[i].max(i) + 1).min(block.end);
            let ended = match self.lexemes[i].token {
                Token::Semi | Token::Bad => true,
                Token::LBrace => self.is_block(i) && !self.goes_on(next),
                _ => false,
            };
            let begins = starts_statement(&self.lexemes, next) && first_on_line(self.text, &self.lexemes, next);
            if ended || begins || self.semicolon[next] {
                // A statement that broke off before a keyword owns the error at the keyword.
                if next > at || (next == at && !ended) {
                    return start..next;
                }
                start = next;
            }
            i = next;
        }
        start..block.end
    }

    /// The first token from `i` on that is not left out.
    fn live(&self, i: usize) -> usize {
        (i..self.lexemes.len()).find(|&i| !self.dropped[i]).unwrap_or(self.lexemes.len())
    }

    /// The outermost brace of a block in the statement that token `at` is inside of.
    fn block_around(&self, statement: &Range<usize>, at: usize) -> Option<usize> {
        let mut i = statement.start;
        while i < statement.end.min(at) {
            let mate = self.mates[i];
            if mate > i && at <= mate {
                if self.is_block(i) {
                    return Some(i);
                }
                i += 1;
            } else {
                i = mate.max(i) + 1;
            }
        }
        None
    }

    /// Whether token `i` opens a block of statements, and not a record.
    fn is_block(&self, i: usize) -> bool {
        self.token(i) == Some(&Token::LBrace) && self.token(i + 2) != Some(&Token::Colon)
    }

    /// Whether a statement goes on after a block with token `i`.
    fn goes_on(&self, i: usize) -> bool {
        use Token::*;
        self.token(i).is_some_and(|t| {
            t.is_infix()
                || matches!(t, Else | Semi | Comma | RParen | RBracket | Dot | As | With | To | Bind | Tilde | Arrow)
        })
    }

    fn drop_statement(&mut self, range: Range<usize>) {
        if let Some(first) = self.lexemes.get_mut(range.start) {
            first.token = Token::Bad;
        }
        self.dropped[range.start + 1..range.end].fill(true);
    }
}

/// Parses a program, repairing what does not fit.
pub(crate) fn parse_program(mut tokens: Tokens<'_>, errors: &mut Vec<SyntaxError>) -> Program {
    let earlier: Vec<Span> = errors.iter().map(|e| e.span).collect();
    loop {
        let mut builder = Builder::new(tokens.file);
        let error = match ProgramParser::new().parse(&mut builder, tokens.iter()) {
            Ok(program) => {
                errors.extend(builder.errors);
                return program;
            }
            Err(error) => error,
        };
        let at = tokens.error_index(&error);
        if errors.len() >= MAX_ERRORS {
            errors.push(SyntaxError::new(SyntaxErrorKind::TooManyErrors, tokens.span_at(at)));
            return Program::default();
        }
        let statement = tokens.statement(at);
        let start = statement.as_ref().map_or(at, |s| s.start);
        let first_byte = tokens.lexemes.get(start).map_or(0, |l| l.start) as u32;
        let here = tokens.span_at(at);
        let known = earlier.iter().any(|e| (first_byte..=here.end).contains(&e.start));
        let missing = matches!(&error, ParseError::UnrecognizedEof { expected, .. }
            | ParseError::UnrecognizedToken { expected, .. } if tokens.lacks_semicolon(at, expected));
        let explained = tokens.explain(&error, start);
        if missing && matches!(&explained.kind, SyntaxErrorKind::Unexpected { advice: None, .. }) {
            let end = tokens.lexemes[at - 1].end;
            if !known {
                let kind = SyntaxErrorKind::MissingSemicolon { at_end: at == tokens.lexemes.len() };
                errors.push(SyntaxError::new(kind, Span::new(tokens.file, end, end)));
            }
            tokens.semicolon[at] = true;
            continue;
        }
        let cascade = tokens.lexemes.get(at).is_some_and(|l| l.token == Token::Bad);
        if !known && !cascade {
            errors.push(explained);
        }
        match statement {
            Some(range) => tokens.drop_statement(range),
            // Nothing is left to give up.
            None => return Program::default(),
        }
    }
}
