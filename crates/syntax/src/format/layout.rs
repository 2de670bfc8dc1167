//! Line breaking: text and possible line breaks, laid out within a width.
//!
//! After Oppen (1980) and Wadler (2003): a group is set on one line if it fits, and
//! broken into lines if it does not. A broken group does not break the group around it:
//! `map(fn(x) {`, the body, `}, xs)`.

use super::columns::{self, Row, SourcePlace, Stop};
use super::token_cursor::{Comment, Place};
use std::borrow::Cow;

/// When a line is broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rule {
    /// If its group is broken.
    Group,
    /// If its group is broken and the following text does not fit.
    Fill,
    /// If its group is broken; the source has a line end here.
    Kept,
}

/// The kind of a group, which determines how it keeps its shape when it is formatted
/// again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// A list in brackets: broken if the source has a line end behind the opening
    /// bracket.
    Brackets,
    /// A block of statements: broken if the source has a line end behind the opening
    /// brace, or if the whole block is too long for one line. The blocks around it are
    /// broken with it.
    Block,
    /// Parts that may continue on new lines: broken if all of them are too long for one
    /// line.
    Parts,
}

#[derive(Debug)]
enum Op<'s> {
    Text(Cow<'s, str>),
    Space,
    /// A line break, with the text (a space or nothing) in its place if it is not broken.
    Line(&'static str, Rule),
    /// An empty line, if there is a line break here.
    Blank,
    Open {
        broken: bool,
        kind: Kind,
    },
    Close,
    Indent,
    Dedent,
    /// A text that is present only if its group is broken.
    IfBroken(&'static str),
    Comment(Comment<'s>),
    /// A position that may be aligned with those above and below.
    Stop(SourcePlace),
}

/// A text to be laid out, as a list of operations.
#[derive(Debug, Default)]
pub(super) struct Layout<'s> {
    ops: Vec<Op<'s>>,
    /// The indices of the open groups.
    open: Vec<usize>,
}

impl<'s> Layout<'s> {
    pub fn text(&mut self, text: impl Into<Cow<'s, str>>) {
        self.ops.push(Op::Text(text.into()));
    }

    pub fn space(&mut self) {
        self.ops.push(Op::Space);
    }

    pub fn line(&mut self, flat: &'static str, rule: Rule) {
        self.ops.push(Op::Line(flat, rule));
    }

    pub fn blank(&mut self) {
        self.ops.push(Op::Blank);
    }

    pub fn if_broken(&mut self, text: &'static str) {
        self.ops.push(Op::IfBroken(text));
    }

    pub fn indent(&mut self) {
        self.ops.push(Op::Indent);
    }

    pub fn dedent(&mut self) {
        self.ops.push(Op::Dedent);
    }

    pub fn stop(&mut self, seen: SourcePlace) {
        self.ops.push(Op::Stop(seen));
    }

    /// Opens a group. A block of statements that is broken breaks the blocks around it.
    pub fn open(&mut self, broken: bool, kind: Kind) {
        if broken && kind == Kind::Block {
            self.break_blocks();
        }
        self.open.push(self.ops.len());
        self.ops.push(Op::Open { broken, kind });
    }

    pub fn close(&mut self) {
        self.open.pop();
        self.ops.push(Op::Close);
    }

    /// Adds a comment. If the following text must be on a new line, breaks the groups
    /// around the comment up to a block of statements, and all blocks around it.
    pub fn comment(&mut self, comment: Comment<'s>) {
        if comment.place != Place::Inline {
            for &i in self.open.iter().rev() {
                if let Some(Op::Open { broken, kind }) = self.ops.get_mut(i) {
                    *broken = true;
                    if *kind == Kind::Block {
                        break;
                    }
                }
            }
            self.break_blocks();
        }
        self.ops.push(Op::Comment(comment));
    }

    fn break_blocks(&mut self) {
        for &i in &self.open {
            if let Some(Op::Open { broken, kind: Kind::Block }) = self.ops.get_mut(i) {
                *broken = true;
            }
        }
    }

    /// Returns the text in lines of at most `width` columns, as far as they can be
    /// broken.
    pub fn set(&self, width: usize) -> String {
        let mut setter = Setter {
            ops: &self.ops,
            width,
            rows: vec![Row::default()],
            column: 0,
            indents: Vec::new(),
            groups: vec![true],
            breaks: 0,
            space: false,
            comment: None,
        };
        for i in 0..self.ops.len() {
            setter.op(i);
        }
        columns::line_up(&mut setter.rows, width);
        let lines: Vec<String> = setter.rows.into_iter().map(|row| row.text).collect();
        lines.join("\n")
    }
}

struct Setter<'a, 's> {
    ops: &'a [Op<'s>],
    width: usize,
    rows: Vec<Row>,
    column: usize,
    /// For each open indent, whether its group is broken; on one line, indents have no
    /// effect.
    indents: Vec<bool>,
    /// For each open group, outermost first, whether it is broken.
    groups: Vec<bool>,
    /// The number of line ends to write before the next text.
    breaks: usize,
    /// True to write a space before the next text, if it stays on the line.
    space: bool,
    /// Set if the last text was a comment that needs a line end after it; true if the
    /// comment runs to the end of its line.
    comment: Option<bool>,
}

impl Setter<'_, '_> {
    fn op(&mut self, i: usize) {
        match &self.ops[i] {
            Op::Text(text) => self.write(text),
            Op::Space => self.space = true,
            Op::Line(flat, rule) => {
                if self.is_broken() && (*rule != Rule::Fill || !self.fits(i + 1, flat.len(), true))
                {
                    self.breaks = self.breaks.max(1);
                } else {
                    self.space |= !flat.is_empty();
                }
            }
            Op::Blank if self.breaks == 1 || self.comment.is_some() => self.breaks = 2,
            Op::Blank => {}
            Op::Open { broken, kind } => {
                self.groups.push(*broken || !self.fits(i, 0, *kind != Kind::Brackets))
            }
            Op::Close => drop(self.groups.pop()),
            Op::Indent => self.indents.push(self.is_broken()),
            Op::Dedent => drop(self.indents.pop()),
            Op::IfBroken(text) if self.is_broken() => self.write(text),
            Op::IfBroken(_) => {}
            Op::Comment(comment) => self.comment(comment),
            Op::Stop(seen) => {
                let at = self.column + usize::from(self.space);
                if !self.ends_line() {
                    self.row().stops.push(Stop { at, seen: *seen });
                }
            }
        }
    }

    /// Returns whether the innermost group is broken.
    fn is_broken(&self) -> bool {
        self.groups.last().is_none_or(|broken| *broken)
    }

    /// Returns whether the next text starts a line.
    fn ends_line(&self) -> bool {
        self.breaks > 0 || self.comment.is_some()
    }

    /// Returns the width of the current indentation.
    fn indent(&self) -> usize {
        2 * self.indents.iter().filter(|broken| **broken).count()
    }

    fn row(&mut self) -> &mut Row {
        if self.rows.is_empty() {
            self.rows.push(Row::default());
        }
        let last = self.rows.len() - 1;
        &mut self.rows[last]
    }

    /// Writes the line ends that are due. Drops them before the first line, and empty
    /// lines after an opening bracket.
    fn end_lines(&mut self, indent: usize) {
        if self.comment.take().is_some() {
            self.breaks = self.breaks.max(1);
        }
        let breaks = std::mem::take(&mut self.breaks);
        let row = self.row();
        if breaks == 0 || (row.text.is_empty() && self.rows.len() == 1) {
            return;
        }
        if breaks == 2 && !self.row().text.ends_with(['{', '[', '(']) {
            self.rows.push(Row::default());
        }
        self.rows.push(Row { text: " ".repeat(indent), ..Row::default() });
        self.column = indent;
        self.space = false;
    }

    fn write(&mut self, text: &str) {
        self.end_lines(self.indent());
        self.space &= !text.starts_with([',', ';', ')', ']']);
        if std::mem::take(&mut self.space) && self.column > 0 {
            self.row().text.push(' ');
            self.column += 1;
        }
        let mut lines = text.split('\n');
        if let Some(first) = lines.next() {
            self.row().text.push_str(first);
            self.column += first.chars().count();
        }
        for line in lines {
            self.rows.push(Row { text: line.to_owned(), ..Row::default() });
            self.column = line.chars().count();
        }
    }

    fn comment(&mut self, comment: &Comment<'_>) {
        let to_the_end = comment.text.starts_with("//");
        match comment.place {
            Place::Inline => {
                self.space |= !self.row().text.ends_with(['(', '[', ' ']);
                self.write(comment.text);
                self.space = true;
                return;
            }
            Place::Trailing if self.breaks == 0 && self.comment != Some(true) => {
                self.comment = None;
                self.space = true;
                let at = self.column + 1;
                if !comment.text.contains('\n') && self.row().comment.is_none() {
                    self.row().comment = Some(Stop { at, seen: comment.seen });
                }
                self.write(comment.text);
            }
            Place::Below => {
                self.breaks = 1;
                self.end_lines(0);
                self.row().comment = Some(Stop { at: 0, seen: comment.seen });
                self.write(comment.text);
            }
            _ => {
                self.breaks = self.breaks.max(if comment.blank { 2 } else { 1 });
                self.write(comment.text);
            }
        }
        self.comment = Some(to_the_end);
    }

    /// Returns whether the text from an operation up to the next possible line break fits
    /// on the line. Groups in it are measured on one line, even those already marked as
    /// broken if `all`; groups after it may be broken.
    fn fits(&self, start: usize, before: usize, all: bool) -> bool {
        if self.width == usize::MAX {
            return true;
        }
        let used =
            if self.ends_line() { self.indent() } else { self.column + usize::from(self.space) }
                + before;
        let Some(mut room) = self.width.checked_sub(used) else { return false };
        let mut inside: Vec<bool> = Vec::new();
        let mut outside = self.groups.as_slice();
        let mut behind = false;
        for op in &self.ops[start..] {
            let width = match op {
                Op::Text(text) => match text.split_once('\n') {
                    Some((first, _)) => return first.chars().count() <= room,
                    None => text.chars().count(),
                },
                Op::Space => 1,
                Op::Line(..) if inside.last().or(outside.last()).is_none_or(|broken| *broken) => {
                    return true;
                }
                Op::Line(flat, _) => flat.len(),
                Op::Open { broken, .. } => {
                    inside.push(behind || (*broken && !all));
                    0
                }
                Op::Close => {
                    let closed = inside.pop();
                    behind |= inside.is_empty();
                    if closed.is_none() {
                        outside = outside.split_last().map_or(&[], |(_, rest)| rest);
                    }
                    0
                }
                Op::Comment(comment) if comment.place == Place::Inline => {
                    comment.text.chars().count() + 2
                }
                Op::Comment(_) => return true,
                Op::IfBroken(text)
                    if inside.last().or(outside.last()).is_none_or(|broken| *broken) =>
                {
                    text.len()
                }
                Op::Blank | Op::Indent | Op::Dedent | Op::IfBroken(_) | Op::Stop(_) => 0,
            };
            match room.checked_sub(width) {
                Some(rest) => room = rest,
                None => return false,
            }
        }
        true
    }
}
