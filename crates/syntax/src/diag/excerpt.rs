//! The source lines that one diagnostic shows, sanitised for a terminal, in the form that
//! codespan-reporting needs.
//!
//! A line longer than [`MAX_COLUMNS`] is cut to a window around its first label (a
//! generated program may have megabytes in one line), and control characters are
//! replaced, so that a source cannot send escape sequences to the terminal. Line and
//! column numbers remain those of the source.

use super::diagnostic::Diagnostic;
use super::source::{SourceFile, SourceMap};
use crate::span::{FileId, Span};
use codespan_reporting::files::{Error, Files, column_index};
use std::collections::BTreeMap;
use std::ops::Range;

/// The number of characters to which longer lines are cut.
const MAX_COLUMNS: usize = 200;
/// The number of characters kept before the first label in a cut line.
const COLUMNS_BEFORE: usize = 60;
const ELLIPSIS: &str = "…";

/// The shown lines of every file in a diagnostic.
pub(super) struct Excerpts(BTreeMap<FileId, Excerpt>);

/// The shown lines of one file.
struct Excerpt {
    name: String,
    text: String,
    lines: Vec<Line>,
    /// The index in the source of the first shown line.
    first: usize,
}

/// One shown line.
struct Line {
    /// The byte range of the source that is shown, without its line break.
    source: Range<usize>,
    /// Byte offsets in the excerpt's text: the start of the line, the start of the
    /// source's text in it (after a possible ellipsis), and the end of that text.
    shown: [usize; 3],
    /// The number of columns cut off on the left.
    cut: usize,
}

impl Excerpts {
    pub(super) fn new(map: &SourceMap, diagnostic: &Diagnostic) -> Self {
        let mut spans: BTreeMap<FileId, Vec<Range<usize>>> = BTreeMap::new();
        for label in &diagnostic.labels {
            let Span { file, start, end } = label.span;
            spans.entry(file).or_default().push(start as usize..end.max(start) as usize);
        }
        let shown = |(id, spans): (FileId, Vec<_>)| {
            map.get(id).map(|file| (id, Excerpt::new(file, &spans)))
        };
        Excerpts(spans.into_iter().filter_map(shown).collect())
    }

    /// Returns the range of a span in the excerpt of its file; `None` if the file does
    /// not exist.
    pub(super) fn range(&self, span: Span) -> Option<Range<usize>> {
        let excerpt = self.0.get(&span.file)?;
        let start = excerpt.shown_at(span.start as usize);
        Some(start..excerpt.shown_at(span.end as usize).max(start))
    }

    fn file(&self, id: FileId) -> Result<&Excerpt, Error> {
        self.0.get(&id).ok_or(Error::FileMissing)
    }
}

impl Excerpt {
    fn new(file: &SourceFile, spans: &[Range<usize>]) -> Self {
        let first = spans.iter().map(|s| file.line_index(s.start)).min().unwrap_or(0);
        let last = spans.iter().map(|s| file.line_index(s.end)).max().unwrap_or(0);
        let mut excerpt =
            Excerpt { name: file.name().to_owned(), text: String::new(), lines: Vec::new(), first };
        for index in first..=last {
            let range = file.line_range(index);
            let line = file.text()[range.clone()].trim_end_matches(['\n', '\r']);
            let labels = spans.iter().flat_map(|s| [s.start, s.end]);
            let label =
                labels.filter(|p| (range.start..=range.start + line.len()).contains(p)).min();
            excerpt.push(line, range.start, label.map(|p| p - range.start));
        }
        excerpt
    }

    /// Adds a line that starts at byte `start` of the source and has its first label at
    /// its byte `label`.
    fn push(&mut self, line: &str, start: usize, label: Option<usize>) {
        let begin = self.text.len();
        let long = line.chars().nth(MAX_COLUMNS).is_some();
        let (mut cut, mut kept) = (0, 0..line.len());
        if long {
            let columns = line.char_indices().take_while(|(i, _)| *i < label.unwrap_or(0)).count();
            cut = columns.saturating_sub(COLUMNS_BEFORE);
            let byte = |column| line.char_indices().nth(column).map_or(line.len(), |(i, _)| i);
            kept = byte(cut)..byte(cut + MAX_COLUMNS);
        }
        if cut > 0 {
            self.text.push_str(ELLIPSIS);
        }
        let shown = [begin, self.text.len(), self.text.len() + kept.len()];
        for c in line[kept.clone()].chars() {
            if unprintable(c) {
                // One `?` per byte keeps the offsets.
                self.text.extend(std::iter::repeat_n('?', c.len_utf8()));
            } else {
                self.text.push(c);
            }
        }
        if kept.end < line.len() {
            self.text.push_str(ELLIPSIS);
        }
        self.text.push('\n');
        self.lines.push(Line { source: start + kept.start..start + kept.end, shown, cut });
    }

    /// Returns the byte of the excerpt that shows a byte of the source, or the nearest
    /// one.
    fn shown_at(&self, byte: usize) -> usize {
        let index = self.lines.partition_point(|line| line.source.start <= byte).saturating_sub(1);
        let Some(line) = self.lines.get(index) else { return 0 };
        // If the next line is cut on the left, a byte in the part cut off is beyond the
        // end of this line.
        let inside = byte.clamp(line.source.start, line.source.end) - line.source.start;
        let mut at = line.shown[1] + inside;
        while !self.text.is_char_boundary(at) {
            at -= 1;
        }
        at
    }

    fn line_of(&self, shown: usize) -> usize {
        self.lines.partition_point(|line| line.shown[0] <= shown).saturating_sub(1)
    }
}

fn unprintable(c: char) -> bool {
    let bidirectional = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && c != '\t') || bidirectional
}

impl<'a> Files<'a> for Excerpts {
    type FileId = FileId;
    type Name = &'a str;
    type Source = &'a str;

    fn name(&'a self, id: FileId) -> Result<&'a str, Error> {
        Ok(&self.file(id)?.name)
    }

    fn source(&'a self, id: FileId) -> Result<&'a str, Error> {
        Ok(&self.file(id)?.text)
    }

    fn line_index(&'a self, id: FileId, byte: usize) -> Result<usize, Error> {
        Ok(self.file(id)?.line_of(byte))
    }

    fn line_number(&'a self, id: FileId, line: usize) -> Result<usize, Error> {
        Ok(self.file(id)?.first + line + 1)
    }

    fn column_number(&'a self, id: FileId, line: usize, byte: usize) -> Result<usize, Error> {
        let file = self.file(id)?;
        let shown = column_index(&file.text, self.line_range(id, line)?, byte);
        let (cut, ellipsis) =
            file.lines.get(line).map_or((0, 0), |l| (l.cut, usize::from(l.cut > 0)));
        Ok((cut + shown + 1).saturating_sub(ellipsis))
    }

    fn line_range(&'a self, id: FileId, line: usize) -> Result<Range<usize>, Error> {
        let file = self.file(id)?;
        let missing = Error::LineTooLarge { given: line, max: file.lines.len().saturating_sub(1) };
        let start = file.lines.get(line).ok_or(missing)?.shown[0];
        let end = file.lines.get(line + 1).map_or(file.text.len(), |next| next.shown[0]);
        Ok(start..end)
    }
}
