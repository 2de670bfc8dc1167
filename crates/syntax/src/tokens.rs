//! The tokens of a text while it is parsed: the statements they form, and repairs.

use super::delimiters::{Balanced, first_on_line, starts_statement};
use super::error::SyntaxError;
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
    /// The name of the end of this text in messages.
    pub end_name: &'static str,
    pub lexemes: Vec<Lexeme<'s>>,
    mates: Vec<usize>,
    /// True for each token before which a `;` is added; the last entry is for the end of the
    /// text.
    pub semicolon: Vec<bool>,
    /// True for each token that is left out, as part of a bad statement.
    dropped: Vec<bool>,
    /// The index of the token that the parser requested last.
    last: Cell<usize>,
}

/// A token between its start and end byte, as the parser expects it.
pub(crate) type Triple<'s> = (usize, Token<'s>, usize);

impl<'s> Tokens<'s> {
    pub fn new(
        text: &'s str,
        file: FileId,
        end_name: &'static str,
        balanced: Balanced<'s>,
    ) -> Self {
        let Balanced { lexemes, mates, .. } = balanced;
        let (semicolon, dropped) = (vec![false; lexemes.len() + 1], vec![false; lexemes.len()]);
        Tokens { text, file, end_name, lexemes, mates, semicolon, dropped, last: Cell::new(0) }
    }

    /// Returns the repaired tokens.
    pub fn iter(&self) -> impl Iterator<Item = Triple<'s>> {
        (0..=self.lexemes.len()).flat_map(move |i| {
            let end = i.checked_sub(1).and_then(|i| self.lexemes.get(i)).map_or(0, |l| l.end);
            let semicolon = self.semicolon[i].then_some((end, Token::Semi, end));
            let token = self.lexemes.get(i).filter(|_| !self.dropped[i]);
            let token = token.map(|l| (l.start, l.token.clone(), l.end));
            semicolon.into_iter().chain(token).inspect(move |_| self.last.set(i))
        })
    }

    /// Returns the index of the token that did not fit (the number of tokens for the end
    /// of the text), and the tokens that would have fitted.
    pub fn misfit<'e>(&self, error: &'e ParseError<usize, Token<'s>, ()>) -> (usize, &'e [String]) {
        match error {
            ParseError::UnrecognizedEof { expected, .. } => (self.lexemes.len(), expected),
            ParseError::UnrecognizedToken { expected, .. } => (self.last.get(), expected),
            // Errors of grammar actions, errors of a built-in lexer, and extra tokens do
            // not occur.
            _ => (self.last.get(), &[]),
        }
    }

    /// Returns the span of a token, or of the end of the text.
    pub fn span_at(&self, at: usize) -> Span {
        let end = self.text.trim_end().len().max(self.lexemes.last().map_or(0, |l| l.end));
        let (start, end) = self.lexemes.get(at).map_or((end, end), |l| (l.start, l.end));
        Span::new(self.file, start, end)
    }

    /// Returns the empty span right after the token before token `at`.
    pub fn span_after(&self, at: usize) -> Span {
        let end = at.checked_sub(1).and_then(|i| self.lexemes.get(i)).map_or(0, |l| l.end);
        Span::new(self.file, end, end)
    }

    pub fn token(&self, i: usize) -> Option<&Token<'s>> {
        self.lexemes.get(i).map(|l| &l.token)
    }

    /// Returns whether a `;` is missing before token `at`: it would fit there, and a
    /// line, a block or the text ends, or a statement starts.
    pub fn lacks_semicolon(&self, at: usize, expected: &[String]) -> bool {
        let fits = expected.iter().any(|e| e == "\";\"") && at > 0 && !self.semicolon[at];
        fits && match self.token(at) {
            None | Some(Token::RBrace) => true,
            Some(token) if first_on_line(self.text, &self.lexemes, at) => {
                starts_statement(&self.lexemes, at)
                    || (token.starts_expression() && *token != Token::LBrace)
            }
            Some(_) => starts_statement(&self.lexemes, at),
        }
    }

    /// Returns the statement to discard for an error at token `at`: the innermost one
    /// that has any tokens. If a statement was expected to begin there (`fresh`), it
    /// excludes the tokens before `at`.
    pub fn statement(&self, at: usize, fresh: bool) -> Option<Range<usize>> {
        let (mut block, mut found) = (0..self.lexemes.len(), None);
        loop {
            let statement = self.statement_in(&block, at, fresh);
            if !statement.is_empty() && self.token(statement.start) != Some(&Token::Bad) {
                found = Some(statement.clone());
            }
            let Some(brace) = self.block_around(&statement, at) else { return found };
            block = brace + 1..self.mates[brace];
        }
    }

    /// Returns the statement of a block that token `at` belongs to.
    fn statement_in(&self, block: &Range<usize>, at: usize, fresh: bool) -> Range<usize> {
        let (mut start, mut i) = (block.start, block.start);
        while i < block.end {
            if fresh && i == at {
                start = at;
            }
            let next = self.live(self.mates[i].max(i) + 1).min(block.end);
            let ended = match self.lexemes[i].token {
                Token::Semi | Token::Bad => true,
                Token::LBrace => self.is_block(i) && !self.continues_statement(next),
                _ => false,
            };
            let begins = starts_statement(&self.lexemes, next)
                && first_on_line(self.text, &self.lexemes, next);
            if ended || begins || self.semicolon[next] {
                // An error at a keyword belongs to the statement that broke off before
                // it.
                if next > at || (next == at && !ended && !fresh) {
                    return start..next;
                }
                start = next;
            }
            i = next;
        }
        start..block.end
    }

    /// Returns the first token from `i` on that is not left out.
    fn live(&self, i: usize) -> usize {
        (i..self.lexemes.len()).find(|&i| !self.dropped[i]).unwrap_or(self.lexemes.len())
    }

    /// Returns the outermost opening brace of a block in the statement that contains
    /// token `at`.
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

    /// Returns whether token `i` opens a block of statements rather than a record.
    fn is_block(&self, i: usize) -> bool {
        self.token(i) == Some(&Token::LBrace) && self.token(i + 2) != Some(&Token::Colon)
    }

    /// Returns whether token `i` continues a statement after a block.
    fn continues_statement(&self, i: usize) -> bool {
        use Token::*;
        self.token(i).is_some_and(|t| {
            t.is_infix()
                || matches!(
                    t,
                    Else | Semi
                        | Comma
                        | RParen
                        | RBracket
                        | Dot
                        | As
                        | With
                        | To
                        | Bind
                        | Tilde
                        | Arrow
                )
        })
    }

    /// Adds the errors found by the actions, except those in an item that already has an
    /// error: they may only be consequences of it.
    pub fn add_new(&self, found: Vec<SyntaxError>, errors: &mut Vec<SyntaxError>) {
        let known: Vec<u32> = errors.iter().map(|e| e.span.start).collect();
        for error in found {
            let at = self.lexemes.partition_point(|l| l.start < error.span.start as usize);
            let item = self.statement_in(&(0..self.lexemes.len()), at, false);
            let bytes =
                self.span_at(item.start).start..self.span_at(item.end.saturating_sub(1)).end;
            if !known.iter().any(|start| bytes.contains(start)) {
                errors.push(error);
            }
        }
    }

    pub fn drop_statement(&mut self, range: Range<usize>) {
        self.lexemes[range.start].token = Token::Bad;
        self.lexemes[range.start].end = self.lexemes[range.end - 1].end;
        self.dropped[range.start + 1..range.end].fill(true);
    }
}
