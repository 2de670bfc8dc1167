//! The text that is formatted, read token by token, with the comments between the tokens.

use super::columns::SourcePlace;
use crate::parse::lex;
use crate::span::FileId;
use std::ops::Range;

/// The position of a comment among the tokens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// Before a token on the same line.
    Inline,
    /// Behind the last token of a line.
    Trailing,
    /// Below a trailing comment, which it continues.
    Below,
    /// On separate lines.
    OwnLine,
}

/// A comment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comment<'s> {
    /// The comment with its delimiters.
    pub text: &'s str,
    pub place: Place,
    /// True if an empty line precedes it.
    pub blank: bool,
    pub seen: SourcePlace,
}

/// A text, its tokens, and the position of the next one.
#[derive(Debug)]
pub(super) struct TokenCursor<'s> {
    text: &'s str,
    tokens: Vec<Range<usize>>,
    /// The byte at which each line starts.
    lines: Vec<usize>,
    next: usize,
    /// The comments before the next token that have not been taken.
    comments: Vec<Comment<'s>>,
    /// True if an empty line directly precedes the next token.
    blank: bool,
}

impl<'s> TokenCursor<'s> {
    pub fn new(text: &'s str) -> Self {
        let (lexemes, _) = lex(text, 0..text.len(), FileId(0), 0);
        let tokens = lexemes.into_iter().map(|lexeme| lexeme.start..lexeme.end).collect();
        let lines =
            std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        let mut source =
            TokenCursor { text, tokens, lines, next: 0, comments: Vec::new(), blank: false };
        source.read_gap();
        source
    }

    /// Returns the next token; the empty text at the end.
    pub fn peek(&self) -> &'s str {
        self.tokens.get(self.next).map_or("", |token| &self.text[token.clone()])
    }

    /// Returns how many tokens from the next one on are opening parentheses that start
    /// before a byte.
    pub fn parentheses(&self, before: u32) -> usize {
        let open = |token: &&Range<usize>| {
            token.start < before as usize && &self.text[(*token).clone()] == "("
        };
        self.tokens[self.next.min(self.tokens.len())..].iter().take_while(open).count()
    }

    /// Moves past the next token.
    pub fn advance(&mut self) {
        self.next += 1;
        self.read_gap();
    }

    /// Takes the comments before the next token, up to the first whose place is not
    /// wanted.
    pub fn take(&mut self, wanted: impl Fn(Place) -> bool) -> Vec<Comment<'s>> {
        let n = self.comments.iter().take_while(|comment| wanted(comment.place)).count();
        self.comments.drain(..n).collect()
    }

    /// Returns whether comments before the next token have not been taken.
    pub fn has_comments(&self) -> bool {
        !self.comments.is_empty()
    }

    /// Returns whether an empty line directly precedes the next comment or token.
    pub fn blank(&self) -> bool {
        self.comments.first().map_or(self.blank, |comment| comment.blank)
    }

    /// Returns whether the token that was just passed ends its line.
    pub fn ended_line(&self) -> bool {
        self.gap(self.next).trim_start_matches([' ', '\t']).starts_with('\n')
    }

    /// Returns whether the next token, a bracket, ends its line.
    pub fn opens_lines(&self) -> bool {
        self.tokens.get(self.next).is_some_and(|token| self.opened_at(token.start as u32))
    }

    /// Returns whether the bracket at a byte ends its line.
    pub fn opened_at(&self, byte: u32) -> bool {
        let behind = self.text.get(byte as usize + 1..).unwrap_or("");
        behind.trim_start_matches([' ', '\t']).starts_with('\n')
    }

    /// Returns the position of the next token.
    pub fn seen(&self) -> SourcePlace {
        self.place(self.tokens.get(self.next).map_or(self.text.len(), |token| token.start))
    }

    fn place(&self, byte: usize) -> SourcePlace {
        let line = self.lines.partition_point(|start| *start <= byte).saturating_sub(1);
        let before = &self.text[self.lines.get(line).copied().unwrap_or(0)..byte];
        let column = before.chars().count();
        SourcePlace { line, column, spaces: column - before.trim_end().chars().count() }
    }

    /// Returns the text between the previous token and this one.
    fn gap(&self, token: usize) -> &'s str {
        let start =
            token.checked_sub(1).and_then(|last| self.tokens.get(last)).map_or(0, |last| last.end);
        let end = self.tokens.get(token).map_or(self.text.len(), |next| next.start);
        self.text.get(start..end).unwrap_or("")
    }

    /// Reads the comments before the next token.
    fn read_gap(&mut self) {
        let (first, last) = (self.next == 0, self.next >= self.tokens.len());
        let gap = self.gap(self.next);
        let base = gap.as_ptr() as usize - self.text.as_ptr() as usize;
        let mut comments: Vec<Comment<'s>> = Vec::new();
        let mut at = 0;
        // The number of line ends before the next comment.
        let mut ends = usize::from(first);
        let mut own_line = Vec::new();
        // Only after `,` or `;` can a comment continue the trailing one above it;
        // elsewhere it is one on separate lines.
        let last_token = self.next.checked_sub(1).and_then(|last| self.tokens.get(last));
        let ends_part =
            last_token.is_some_and(|token| matches!(&self.text[token.clone()], "," | ";"));
        while let Some(rest) = gap.get(at..).filter(|rest| !rest.is_empty()) {
            let length = if rest.starts_with("//") {
                rest.find('\n').unwrap_or(rest.len())
            } else if rest.starts_with("/*") {
                rest.find("*/").map_or(rest.len(), |i| i + 2)
            } else {
                let c = rest.chars().next().unwrap_or(' ');
                ends += usize::from(c == '\n');
                at += c.len_utf8();
                continue;
            };
            let seen = self.place(base + at);
            own_line.push(ends);
            let continues = comments.last().is_some_and(|above: &Comment<'_>| {
                ends_part
                    && matches!(above.place, Place::Trailing | Place::Below)
                    && (seen.line, seen.column) == (above.seen.line + 1, above.seen.column)
                    && !above.text.contains('\n')
            });
            let place = match ends {
                0 => Place::Trailing,
                _ if continues => Place::Below,
                _ => Place::OwnLine,
            };
            comments.push(Comment {
                text: rest[..length].trim_end(),
                place,
                blank: ends > 1,
                seen,
            });
            ends = 0;
            at += length;
        }
        self.blank = ends > 1;
        // Comments on the line of the next token belong to that token.
        if ends == 0 && !last {
            for (comment, ends) in comments.iter_mut().zip(own_line).rev() {
                comment.place = Place::Inline;
                if ends > 0 {
                    break;
                }
            }
        }
        self.comments = comments;
    }
}
