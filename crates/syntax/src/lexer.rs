//! Converts text to tokens: drives logos, scans by hand the lexemes that logos can only
//! begin, and reports characters that are not part of any token.
//!
//! Unless there are too many errors or tokens, every byte is consumed, also after errors.
//! Foreign spellings are replaced by their probable meaning (`&&` becomes `and`), so that
//! the parser sees a likely program and still checks the rest of the text. Spans are byte
//! offsets in the whole text.

use super::address;
use super::error::{MAX_ERRORS, MAX_TOKENS, SyntaxError, SyntaxErrorKind};
use super::scan::{Lexer, ParseKey};
use super::span::FileId;
use super::token::{Foreign, Open, Token};
use logos::Logos;
use std::ops::Range;

/// A token and its byte range.
#[derive(Clone, Debug)]
pub(crate) struct Lexeme<'s> {
    pub token: Token<'s>,
    pub start: usize,
    pub end: usize,
}

/// Returns the tokens of `text[range]` and the errors in it.
pub(super) fn lex(
    text: &str,
    range: Range<usize>,
    file: FileId,
    level: u32,
    parse_key: ParseKey,
) -> (Vec<Lexeme<'_>>, Vec<SyntaxError>) {
    let mut lexer = Lexer { text, end: range.end, file, level, parse_key, errors: Vec::new() };
    let mut lexemes = Vec::new();
    let byte_order_mark = range.start == 0 && text.starts_with('\u{feff}');
    let base = range.start + if byte_order_mark { '\u{feff}'.len_utf8() } else { 0 };
    let mut logos = Token::lexer(&text[base..range.end]);
    while let Some(found) = logos.next() {
        let start = base + logos.span().start;
        let mut end = base + logos.span().end;
        let token = match found {
            Ok(Token::Open(open)) => {
                let token;
                (token, end) = lexer.scan(open, start, end);
                token
            }
            Ok(Token::Foreign(foreign)) => {
                let token;
                (token, end) = lexer.foreign(foreign, start, end);
                token
            }
            Ok(Token::Number(x)) if x.is_infinite() => {
                lexer.error(SyntaxErrorKind::NumberTooLarge, start, end);
                Some(Token::Number(x))
            }
            Ok(token) => Some(token),
            Err(()) => {
                lexer.unknown(start, end);
                None
            }
        };
        logos.bump(end - base - logos.span().end);
        lexemes.extend(token.map(|token| Lexeme { token, start, end }));
        if lexemes.len() > MAX_TOKENS {
            lexer.error(SyntaxErrorKind::TooManyTokens, start, end);
            lexemes.clear();
            break;
        }
        if lexer.errors.len() > MAX_ERRORS {
            // This is not a program, or it needs repair before more errors are useful.
            break;
        }
    }
    (lexemes, lexer.errors)
}

impl<'s> Lexer<'s> {
    /// Scans the lexeme that starts at `start` and whose opening delimiter ends at `at`.
    /// Returns its token, if it makes one, and its end.
    fn scan(&mut self, open: Open, start: usize, at: usize) -> (Option<Token<'s>>, usize) {
        match open {
            Open::Str => {
                let (text, end) = self.string(start, at, &['"']);
                (Some(Token::Str(text)), end)
            }
            Open::Comment => match self.rest(at).find("*/") {
                Some(length) => (None, at + length + 2),
                None => {
                    self.error(SyntaxErrorKind::UnterminatedComment, start, at);
                    (None, self.end)
                }
            },
            Open::Address => {
                let (address, end) = address::scan(self, start, at);
                (Some(Token::Address(address)), end)
            }
            Open::TagSel => self.tag_selection(start, at),
        }
    }

    /// Reports a foreign spelling. Returns the token that was probably meant, and its
    /// end.
    fn foreign(
        &mut self,
        foreign: Foreign,
        start: usize,
        end: usize,
    ) -> (Option<Token<'s>>, usize) {
        let text = &self.text[start..end];
        let meant = match foreign {
            Foreign::And => Token::And,
            Foreign::Or | Foreign::Bar => Token::Or,
            Foreign::Not => Token::Not,
            Foreign::LeftArrow | Foreign::ColonEq | Foreign::Update => Token::Bind,
            Foreign::EqEqEq => Token::EqEq,
            Foreign::NotEqEq => Token::NotEq,
            Foreign::Caret => Token::StarStar,
            Foreign::Increment => Token::Plus,
            Foreign::ColonColon => Token::Dot,
            Foreign::Number => Token::Number(0.0),
            Foreign::Name => Token::Name(text),
            Foreign::RightArrow => {
                self.foreign_error(foreign, text, start, end);
                return (None, end);
            }
            Foreign::Quote => return self.foreign_string(start, end),
        };
        self.foreign_error(foreign, text, start, end);
        (Some(meant), end)
    }

    /// Reports a foreign spelling, at most once per line.
    fn foreign_error(&mut self, foreign: Foreign, text: &str, start: usize, end: usize) {
        let kind = SyntaxErrorKind::Foreign(foreign, text.into());
        let said = |e: &SyntaxError| {
            e.kind == kind && !self.text[e.span.start as usize..start].contains('\n')
        };
        if !self.errors.iter().any(said) {
            self.error(kind, start, end);
        }
    }

    /// Reads a string in foreign quotes, if it is closed on the same line.
    fn foreign_string(&mut self, start: usize, at: usize) -> (Option<Token<'s>>, usize) {
        let quote = &self.text[start..at];
        let close: &[char] = if quote == "'" {
            &['\'']
        } else {
            &['"', '“', '”', '„', '«', '»', '‘', '’', '`', '\'']
        };
        let line = self.rest(at).split('\n').next().unwrap_or("");
        if !line.contains(close) {
            self.foreign_error(Foreign::Quote, quote, start, at);
            return (None, at);
        }
        let (value, end) = self.string(start, at, close);
        self.foreign_error(Foreign::Quote, quote, start, end);
        (Some(Token::Str(value)), end)
    }

    /// Reports characters that cannot begin a token; adjacent ones are one error.
    fn unknown(&mut self, start: usize, end: usize) {
        let text = &self.text[start..end];
        if let Some(SyntaxError { kind: SyntaxErrorKind::UnknownCharacter(_), span }) =
            self.errors.last_mut()
            && span.end as usize == start
        {
            span.end = end as u32;
            return;
        }
        if let Some(c) = text.chars().next() {
            self.error(SyntaxErrorKind::UnknownCharacter(c), start, end);
        }
    }
}
