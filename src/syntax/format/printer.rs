//! What the printer is made of: tokens, lists, blocks, and the comments that come with
//! them.

use super::layout::{Kind, Layout, Rule};
use super::source::{Comment, Place, Source};
use std::fmt::Display;

/// Walks a tree and lays its text out; with a source, it takes the tokens from there.
#[derive(Debug, Default)]
pub(super) struct Printer<'s> {
    layout: Layout<'s>,
    pub source: Option<Source<'s>>,
    /// Comments behind what was written last.
    behind: Vec<Comment<'s>>,
    /// In a computed key, which must stay on its line.
    pub inline: bool,
}

/// How the items of a list share lines, if they do not fit on one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Share {
    /// One on each line.
    Nothing,
    /// As many on a line as fit.
    Lines,
    /// They stay beside the brackets: the only one is in brackets itself.
    Brackets,
}

impl<'s> Printer<'s> {
    pub fn formatting(text: &'s str) -> Self {
        Printer { source: Some(Source::new(text)), ..Printer::default() }
    }

    /// The text of what was printed.
    pub fn set(mut self, width: usize) -> String {
        self.flush();
        self.layout.set(width)
    }

    /// Tokens, with the spaces between them.
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

    /// One token, which may hold spaces.
    pub fn token(&mut self, canonical: &str) {
        let Some(source) = &mut self.source else { return self.layout.text(canonical.to_owned()) };
        let token = source.peek();
        let before = source.take(|_| true);
        source.advance();
        let after = source.take(|place| matches!(place, Place::Trailing | Place::Below));
        if matches!(token, "," | ";") {
            // What is written before these goes behind them, but for a remark on what
            // they end.
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

    /// Writes the comments behind what was written last.
    fn flush(&mut self) {
        for comment in self.behind.drain(..) {
            self.layout.comment(comment);
        }
    }

    /// Writes the comments on lines of their own that are before the next token, and the
    /// empty line before it.
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

    /// Whether the next token of the source is this one, where the source decides.
    pub fn next_is(&self, token: &str) -> Option<bool> {
        self.source.as_ref().map(|source| source.peek() == token)
    }

    /// Whether the source has a line end behind the bracket that was just written.
    fn opened(&self) -> bool {
        self.source.as_ref().is_some_and(Source::ended_line)
    }

    pub fn line(&mut self, flat: &'static str, rule: Rule) {
        self.flush();
        self.layout.line(flat, rule);
    }

    /// A place where what follows may go to a line of its own, further in.
    pub fn continued(&mut self, print: impl FnOnce(&mut Self)) {
        self.flush();
        self.layout.indent();
        self.line(" ", Rule::Group);
        print(self);
        self.layout.dedent();
    }

    /// Parts that go on in new lines together.
    pub fn group(&mut self, print: impl FnOnce(&mut Self)) {
        self.flush();
        self.layout.open(false, Kind::Parts);
        print(self);
        self.layout.close();
    }

    /// The blocks of what is broken together.
    pub fn blocks(&mut self, broken: bool, print: impl FnOnce(&mut Self)) {
        self.flush();
        self.layout.open(broken && !self.inline, Kind::Block);
        print(self);
        self.layout.close();
    }

    /// What comes next may be lined up with lines above and below.
    pub fn stop(&mut self) {
        self.flush();
        if let Some(source) = self.source.as_ref().filter(|source| !source.has_comments()) {
            self.layout.stop(source.seen());
        }
    }

    /// `prefix` and what `print` prints, if there is a value.
    pub fn maybe<T>(&mut self, prefix: &str, value: Option<&T>, print: impl FnOnce(&mut Self, &T)) {
        if let Some(value) = value {
            self.text(prefix);
            print(self, value);
        }
    }

    /// Items with commas between them.
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

    /// A list in brackets, with `pad` inside of them.
    pub fn brackets<T>(
        &mut self,
        (open, pad, close): (&str, &'static str, &str),
        items: &[T],
        share: Share,
        mut print: impl FnMut(&mut Self, &T),
    ) {
        self.text(open);
        let remarks =
            !self.behind.is_empty() || self.source.as_ref().is_some_and(Source::has_comments);
        match items {
            [] if !remarks => return self.text(close),
            [only] if share == Share::Brackets && !remarks => {
                print(self, only);
                self.skip_comma();
                // Without the comma there is nothing to be below of.
                let below = self.behind.iter_mut().filter(|comment| comment.place == Place::Below);
                below.for_each(|comment| comment.place = Place::OwnLine);
                return self.text(close);
            }
            _ => {}
        }
        let opened = self.opened();
        // Comments behind the bracket break the list, not what is around it.
        self.layout.open(opened, Kind::Brackets);
        self.flush();
        self.layout.indent();
        for (i, item) in items.iter().enumerate() {
            let starts_line = opened && self.source.as_ref().is_some_and(Source::ended_line);
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

    /// Goes past a comma before a closing bracket, which is there or not as lines are
    /// broken.
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

    /// The end of a list or block, with the comments that are left in it.
    fn closing(&mut self, pad: &'static str, close: &str) {
        self.flush();
        self.leading_comments();
        self.layout.dedent();
        self.line(pad, Rule::Group);
        self.text(close);
    }

    /// Writes the comments on lines of their own that are before the next token.
    fn leading_comments(&mut self) {
        if let Some(source) = &mut self.source {
            self.behind.extend(source.take(|place| place != Place::Inline));
            self.flush();
        }
    }

    /// Statements in braces, on lines of their own or not as what they are in has it.
    pub fn braces(&mut self, lines: usize, mut print: impl FnMut(&mut Self, usize)) {
        self.text("{");
        let remarks =
            !self.behind.is_empty() || self.source.as_ref().is_some_and(Source::has_comments);
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

    /// A block of statements: on one line only if the source has it so.
    pub fn block(&mut self, lines: usize, print: impl FnMut(&mut Self, usize)) {
        // Comments that come before the brace are no part of the block.
        self.flush();
        let broken = self.opens_lines(lines > 0);
        self.blocks(broken, |p| p.braces(lines, print));
    }

    /// Whether the block that comes next is written on several lines; without a source,
    /// `canonical`.
    pub fn opens_lines(&self, canonical: bool) -> bool {
        self.source.as_ref().map_or(canonical, Source::opens_lines)
    }

    /// All lines of a file.
    pub fn lines(&mut self, lines: usize, mut print: impl FnMut(&mut Self, usize)) {
        for i in 0..lines {
            self.line("", Rule::Group);
            self.leading();
            print(self, i);
        }
        self.leading_comments();
    }
}
