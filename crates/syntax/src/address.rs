//! Address literals, `@pose[upperarm_l]/bone#2/rot[{k}]`, and tag selections,
//! `$bone:arm_l`. Each of them is a single token.
//!
//! A segment is a name, `*` (any one segment) or `**` (any number of segments), followed
//! by the occurrence `#n` and keys, in either order. Segments are separated by `/`; a `.`
//! is read as `/`. Spaces inside an address are not allowed, so `@a / 2` is a division
//! and `@a/b` is not. A computed key `[{…}]` is lexed and parsed like any other
//! expression.

use super::ast::{Address, Expr, ExprKind, Key, Segment, SegmentName};
use super::deep::Deep;
use super::error::{AddressError, SyntaxError, SyntaxErrorKind};
use super::scan::Lexer;
use super::span::Span;
use super::token::{Token, is_name};
use std::rc::Rc;
use std::sync::Arc;

/// The maximum nesting of addresses in computed keys of addresses.
const MAX_LEVEL: u32 = 8;

/// The state of an address scan.
struct Scanner<'a, 's> {
    lexer: &'a mut Lexer<'s>,
    at: usize,
    depth: u32,
}

/// Scans the address whose `@` starts at `start` and ends at `at`. Returns the address
/// and its end; after an error, the address holds the segments read before it.
pub(super) fn scan(lexer: &mut Lexer<'_>, start: usize, at: usize) -> (Rc<Deep<Address>>, usize) {
    let mut scanner = Scanner { lexer, at, depth: 1 };
    let mut segments = Vec::new();
    if let Err(problem) = scanner.segments(&mut segments) {
        let end = scanner.lexer.rest(scanner.at).chars().next().map_or(0, char::len_utf8);
        let kind = SyntaxErrorKind::Address(problem);
        match problem {
            AddressError::NoName => scanner.lexer.error(kind, start, scanner.at),
            _ => scanner.lexer.error(kind, scanner.at, scanner.at + end),
        }
        scanner.skip_key();
    }
    let (end, depth) = (scanner.at, scanner.depth);
    (Rc::new(Deep { node: Address { segments }, depth }), end)
}

impl<'s> Scanner<'_, 's> {
    fn rest(&self) -> &'s str {
        self.lexer.rest(self.at)
    }

    fn eat(&mut self, text: &str) -> bool {
        let found = self.rest().starts_with(text);
        if found {
            self.at += text.len();
        }
        found
    }

    fn segments(&mut self, segments: &mut Vec<Segment>) -> Result<(), AddressError> {
        loop {
            let name = self.name().ok_or(AddressError::NoName)?;
            segments.push(Segment { name, occurrence: 1, keys: Vec::new() });
            if let Some(segment) = segments.last_mut() {
                self.suffixes(segment)?;
            }
            let mut ahead = self.rest().chars();
            let separated = matches!(ahead.next(), Some('/' | '.'));
            if !separated
                || !ahead.next().is_some_and(|c| c.is_ascii_alphabetic() || matches!(c, '_' | '*'))
            {
                return Ok(());
            }
            self.at += 1;
        }
    }

    fn name(&mut self) -> Option<SegmentName> {
        if self.eat("**") {
            return Some(SegmentName::Deep);
        }
        if self.eat("*") {
            return Some(SegmentName::Any);
        }
        let name = self.lexer.name(self.at)?;
        self.at += name.len();
        Some(SegmentName::Name(name.into()))
    }

    /// Reads the suffixes `#n` and `[key]` of a segment.
    fn suffixes(&mut self, segment: &mut Segment) -> Result<(), AddressError> {
        let mut numbered = false;
        loop {
            let digits = self
                .rest()
                .strip_prefix('#')
                .map_or(0, |t| t.bytes().take_while(u8::is_ascii_digit).count());
            if digits > 0 && !numbered {
                numbered = true;
                let occurrence = self.rest()[1..=digits].parse().ok().filter(|n| *n > 0);
                segment.occurrence = occurrence.ok_or(AddressError::Occurrence)?;
                self.at += 1 + digits;
            } else if self.eat("[") {
                segment.keys.push(self.key()?);
                if !self.eat("]") {
                    return Err(AddressError::KeyEnd);
                }
            } else {
                return Ok(());
            }
        }
    }

    fn key(&mut self) -> Result<Key, AddressError> {
        let start = self.at;
        if self.eat("*") {
            return Ok(Key::Any);
        }
        if self.eat("\"") {
            let (text, end) = self.lexer.string(start, self.at, &['"']);
            self.at = end;
            return Ok(Key::Str(text));
        }
        if self.eat("{") {
            return Ok(Key::Expr(Box::new(self.computed_key()?)));
        }
        let in_key = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'-' | b'+');
        let length = self.rest().bytes().take_while(|b| in_key(b)).count();
        let word = &self.rest()[..length];
        let key = match word.parse::<f64>() {
            _ if is_name(word) => Key::Str(word.into()),
            Ok(x) if x.is_finite() && is_number(word) => Key::Num(x),
            _ => return Err(AddressError::Key),
        };
        self.at += length;
        Ok(key)
    }

    /// Parses the expression after `[{`, up to its `}`.
    fn computed_key(&mut self) -> Result<Expr, AddressError> {
        let start = self.at;
        let length = key_length(self.rest()).ok_or(AddressError::OpenKey)?;
        let (file, level) = (self.lexer.file, self.lexer.level + 1);
        self.at = start + length + 1;
        if level > MAX_LEVEL {
            let span = Span::new(file, start, start);
            self.lexer.errors.push(SyntaxError::new(SyntaxErrorKind::TooDeep, span));
            return Ok(Expr { kind: ExprKind::Error, span });
        }
        let parse = self.lexer.parse_key;
        let (expr, errors) = parse(self.lexer.text, start..start + length, file, level);
        self.lexer.errors.extend(errors);
        self.depth = self.depth.max(expr.depth);
        Ok(expr.node)
    }

    /// Skips the rest of a bad key, if its `]` comes before the end of the line and any
    /// `;`.
    fn skip_key(&mut self) {
        let rest = self.rest();
        let near = rest.find(['\n', ';']).unwrap_or(rest.len());
        if let Some(end) = rest[..near].find(']') {
            self.at += end + 1;
        }
    }
}

/// Returns whether a word that parses as an `f64` is also a number of the language, which
/// excludes `+1`, `.5` and `1.`.
fn is_number(word: &str) -> bool {
    let digits = word.strip_prefix('-').unwrap_or(word);
    digits.starts_with(|c: char| c.is_ascii_digit())
        && !digits.ends_with('.')
        && !digits.contains(".e")
}

/// Returns the length of the text before the `}` that closes a computed key.
fn key_length(text: &str) -> Option<usize> {
    let mut depth = 0_usize;
    let mut chars = text.char_indices();
    while let Some((i, c)) = chars.next() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => return Some(i),
            '}' => depth -= 1,
            '"' => {
                // A string may contain braces.
                while let Some((_, c)) = chars.next().filter(|(_, c)| *c != '"' && *c != '\n') {
                    if c == '\\' {
                        chars.next();
                    }
                }
            }
            // A key is short; if its end is missing, do not read the following text as
            // part of it.
            '\n' | ';' => return None,
            _ => {}
        }
    }
    None
}

impl<'s> Lexer<'s> {
    /// Scans the tag selection whose `$` starts at `start` and ends at `at`. Returns its
    /// token and its end.
    pub(super) fn tag_selection(&mut self, start: usize, at: usize) -> (Option<Token<'s>>, usize) {
        let Some(name) = self.name(at) else {
            self.error(SyntaxErrorKind::TagSelection, start, at);
            return (Some(Token::TagSel(("".into(), None))), at);
        };
        let at = at + name.len();
        let rest = self.rest(at).strip_prefix(':').unwrap_or("");
        let (value, end): (Option<Arc<str>>, _) = if rest.starts_with('"') {
            let (value, end) = self.string(at + 1, at + 2, &['"']);
            (Some(value), end)
        } else {
            let length =
                rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count();
            let value = Some(&rest[..length]).filter(|value| !value.is_empty());
            (value.map(Arc::from), value.map_or(at, |value| at + 1 + value.len()))
        };
        (Some(Token::TagSel((name.into(), value))), end)
    }
}
