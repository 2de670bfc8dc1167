//! The building blocks of the printer: tokens, lists, blocks, and the comments beside
//! them.

use super::layout::{Kind, Layout, Rule};
use super::token_cursor::{Comment, Place, TokenCursor};
use std::fmt::Display;

/// Walks a tree and lays out its text; if there is a source, takes the tokens from it.
#[derive(Debug, Default)]
pub(super) struct Printer<'s> {
    layout: Layout<'s>,
    pub source: Option<TokenCursor<'s>>,
    /// Comments to be written behind the last token.
    behind: Vec<Comment<'s>>,
    /// True if this is in a computed key, which must stay on its line.
    pub inline: bool,
}

/// How the items of a list share lines, if they do not all fit on one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Share {
    /// One item per line.
    Nothing,
    /// As many items per line as fit.
    Lines,
    /// A single item that is itself in brackets stays beside the brackets of the list.
    Brackets,
}

impl<'s> Printer<'s> {
    pub fn formatting(text: &'s str) -> Self {
        Printer { source: Some(TokenCursor::new(text)), ..Printer::default() }
    }

    /// Returns the text of everything printed.
    pub fn set(mut self, width: usize) -> String {
        self.flush();
        self.layout.set(width)
    }

    /// Prints tokens, with the spaces between them.
    pub fn text(&mut self, text: impl Display) {
        for (i, token) in text.to_string().split(' ').enumerate() {
            if i > 0 {
                self.flush();
                self.layout.space();
            }
            if !token.is_empty() {
                self.token(token);
            }
        }
    }

    /// Prints one token, which may contain spaces.
    pub fn token(&mut self, canonical: &str) {
        let Some(source) = &mut self.source else { return self.layout.text(canonical.to_owned()) };
        let token = source.peek();
        let before = source.take(|_| true);
        source.advance();
        let after = source.take(|place| matches!(place, Place::Trailing | Place::Below));
        if matches!(token, "," | ";") {
            // Comments before these tokens move behind them, except inline comments,
            // which belong to what the tokens end.
            let (inline, lines): (Vec<_>, Vec<_>) =
                before.into_iter().partition(|c| c.place == Place::Inline);
            if !inline.is_empty() {
                self.flush();
            }
            inline.into_iter().for_each(|comment| self.layout.comment(comment));
            self.layout.text(token);
            self.behind.extend(lines);
        } else {
            self.flush();
            before.into_iter().for_each(|comment| self.layout.comment(comment));
            self.layout.text(token);
        }
        self.behind.extend(after);
    }

    /// Writes the comments behind the last token.
    fn flush(&mut self) {
        for comment in self.behind.drain(..) {
            self.layout.comment(comment);
        }
    }

    /// Writes the comments before the next token that are not inline, and the empty line
    /// before it.
    pub fn leading(&mut self) {
        let Some(source) = &mut self.source else { return };
        let comments = source.take(|place| place != Place::Inline);
        let blank = source.blank();
        self.behind.extend(comments);
        self.flush();
        if blank {
            self.layout.blank();
        }
    }

    /// Returns whether the next token of the source is this one; `None` without a source.
    pub fn next_is(&self, token: &str) -> Option<bool> {
        self.source.as_ref().map(|source| source.peek() == token)
    }

    /// Returns whether the source has a line end behind the bracket that was just
    /// written.
    fn opened(&self) -> bool {
        self.source.as_ref().is_some_and(TokenCursor::ended_line)
    }

    pub fn line(&mut self, flat: &'static str, rule: Rule) {
        self.flush();
        self.layout.line(flat, rule);
    }

    /// Prints something that may go on a new line, indented.
    pub fn continued(&mut self, print: impl FnOnce(&mut Self)) {
        self.flush();
        self.layout.indent();
        self.line(" ", Rule::Group);
        print(self);
        self.layout.dedent();
    }

    /// Prints parts that continue on new lines together.
    pub fn group(&mut self, print: impl FnOnce(&mut Self)) {
        self.flush();
        self.layout.open(false, Kind::Parts);
        print(self);
        self.layout.close();
    }

    /// Prints blocks that are broken together.
    pub fn blocks(&mut self, broken: bool, print: impl FnOnce(&mut Self)) {
        self.flush();
        self.layout.open(broken && !self.inline, Kind::Block);
        print(self);
        self.layout.close();
    }

    /// Marks the position of the next token as one that may be aligned with lines above
    /// and below.
    pub fn stop(&mut self) {
        self.flush();
        if let Some(source) = self.source.as_ref().filter(|source| !source.has_comments()) {
            self.layout.stop(source.seen());
        }
    }

    /// Prints `prefix` and the value, if there is one.
    pub fn maybe<T>(&mut self, prefix: &str, value: Option<&T>, print: impl FnOnce(&mut Self, &T)) {
        if let Some(value) = value {
            self.text(prefix);
            print(self, value);
        }
    }

    /// Prints items separated by commas.
    pub fn list<T>(&mut self, items: &[T], mut print: impl FnMut(&mut Self, &T)) {
        self.group(|p| {
            for (i, item) in items.iter().enumerate() {
                match i {
                    0 => print(p, item),
                    _ => {
                        p.text(",");
                        p.layout.indent();
                        p.line(" ", Rule::Fill);
                        p.leading();
                        print(p, item);
                        p.layout.dedent();
                    }
                }
            }
        });
    }

    /// Prints a list in brackets, with `pad` next to them if it is on one line.
    pub fn brackets<T>(
        &mut self,
        (open, pad, close): (&str, &'static str, &str),
        items: &[T],
        share: Share,
        mut print: impl FnMut(&mut Self, &T),
    ) {
        self.text(open);
        let remarks =
            !self.behind.is_empty() || self.source.as_ref().is_some_and(TokenCursor::has_comments);
        match items {
            [] if !remarks => return self.text(close),
            [only] if share == Share::Brackets && !remarks => {
                print(self, only);
                self.skip_comma();
                // Without the comma, these comments have no trailing comment to continue.
                let below = self.behind.iter_mut().filter(|comment| comment.place == Place::Below);
                below.for_each(|comment| comment.place = Place::OwnLine);
                return self.text(close);
            }
            _ => {}
        }
        let opened = self.opened();
        // Comments behind the bracket break the list, but not the groups around it.
        self.layout.open(opened, Kind::Brackets);
        self.flush();
        self.layout.indent();
        for (i, item) in items.iter().enumerate() {
            let starts_line = opened && self.source.as_ref().is_some_and(TokenCursor::ended_line);
            let rule = match share {
                Share::Lines if i > 0 && starts_line => Rule::Kept,
                Share::Lines if i > 0 => Rule::Fill,
                _ => Rule::Group,
            };
            self.line(if i == 0 { pad } else { " " }, rule);
            self.leading();
            print(self, item);
            if i + 1 < items.len() {
                self.text(",");
            }
        }
        if !items.is_empty() && self.source.is_some() {
            self.skip_comma();
            self.layout.if_broken(",");
        }
        self.closing(pad, close);
        self.layout.close();
    }

    /// Skips a comma of the source before a closing bracket; the layout decides whether
    /// one is written.
    fn skip_comma(&mut self) {
        if let Some(source) = &mut self.source
            && source.peek() == ","
        {
            let before = source.take(|_| true);
            source.advance();
            let after = source.take(|place| matches!(place, Place::Trailing | Place::Below));
            self.behind.extend(before);
            self.behind.extend(after);
        }
    }

    /// Prints the end of a list or block, with the remaining comments in it.
    fn closing(&mut self, pad: &'static str, close: &str) {
        self.flush();
        self.leading_comments();
        self.layout.dedent();
        self.line(pad, Rule::Group);
        self.text(close);
    }

    /// Writes the comments before the next token that are not inline.
    fn leading_comments(&mut self) {
        if let Some(source) = &mut self.source {
            self.behind.extend(source.take(|place| place != Place::Inline));
            self.flush();
        }
    }

    /// Prints statements in braces; the enclosing group decides whether they are on
    /// separate lines.
    pub fn braces(&mut self, lines: usize, mut print: impl FnMut(&mut Self, usize)) {
        self.text("{");
        let remarks =
            !self.behind.is_empty() || self.source.as_ref().is_some_and(TokenCursor::has_comments);
        if lines == 0 && !remarks {
            return self.text("}");
        }
        self.flush();
        self.layout.indent();
        for i in 0..lines {
            self.line(" ", Rule::Group);
            self.leading();
            print(self, i);
        }
        self.closing(" ", "}");
    }

    /// Prints a block of statements, on one line only if it is in the source.
    pub fn block(&mut self, lines: usize, print: impl FnMut(&mut Self, usize)) {
        // Comments before the brace are not part of the block.
        self.flush();
        let broken = self.opens_lines(lines > 0);
        self.blocks(broken, |p| p.braces(lines, print));
    }

    /// Returns whether the next block is on several lines in the source; without a
    /// source, returns `canonical`.
    pub fn opens_lines(&self, canonical: bool) -> bool {
        self.source.as_ref().map_or(canonical, TokenCursor::opens_lines)
    }

    /// Prints all lines of a file.
    pub fn lines(&mut self, lines: usize, mut print: impl FnMut(&mut Self, usize)) {
        for i in 0..lines {
            self.line("", Rule::Group);
            self.leading();
            print(self, i);
        }
        self.leading_comments();
    }
}
