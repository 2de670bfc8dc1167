//! The source files of a run: names, texts and line starts. This module does not read
//! files.

use super::diagnostic::Diagnostic;
use crate::span::{FileId, Span};
use std::sync::Arc;

/// The largest source file accepted, in bytes.
pub const MAX_SOURCE_BYTES: usize = 4 << 20;

/// One source file.
#[derive(Clone, Debug)]
pub struct SourceFile {
    name: Arc<str>,
    text: Arc<str>,
    /// The byte offset of the start of each line; the first is 0.
    line_starts: Vec<usize>,
}

impl SourceFile {
    fn new(name: &str, text: &str) -> Self {
        let line_starts =
            std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        SourceFile { name: name.into(), text: text.into(), line_starts }
    }

    /// Returns the name shown to the user: a path, or `<repl>` and the like.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the whole text.
    pub fn text(&self) -> &Arc<str> {
        &self.text
    }

    /// Returns the number of lines, at least 1.
    #[doc(hidden)]
    pub fn line_count(&self) -> usize {
        self.line_starts.len()
    }

    /// Returns the index (from 0) of the line that contains a byte; the last line for a
    /// byte past the end.
    #[doc(hidden)]
    pub fn line_index(&self, byte: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= byte).saturating_sub(1)
    }

    /// Returns the byte range of a line, including its line break; an empty range at the
    /// end of the text for a line past the last.
    #[doc(hidden)]
    pub fn line_range(&self, index: usize) -> std::ops::Range<usize> {
        let at = |i: usize| self.line_starts.get(i).copied().unwrap_or(self.text.len());
        at(index)..at(index.saturating_add(1))
    }

    /// Returns the line and column of a byte, both from 1; columns count characters.
    pub fn location(&self, byte: usize) -> (usize, usize) {
        let line = self.line_index(byte);
        let start = self.line_range(line).start;
        let column =
            self.text[start..].char_indices().take_while(|(i, _)| start + i < byte).count();
        (line + 1, column + 1)
    }
}

/// All source files, numbered by [`FileId`] in the order they were added.
#[derive(Clone, Debug, Default)]
pub struct SourceMap {
    files: Vec<SourceFile>,
}

impl SourceMap {
    /// Creates an empty map.
    pub fn new() -> Self {
        SourceMap::default()
    }

    /// Adds a text and returns its number.
    pub fn add(&mut self, name: &str, text: &str) -> FileId {
        self.files.push(SourceFile::new(name, text));
        FileId((self.files.len() - 1) as u32)
    }

    /// Adds the contents of a file, which should be UTF-8 of at most
    /// [`MAX_SOURCE_BYTES`].
    ///
    /// # Errors
    /// A diagnostic that points at the first byte that is not UTF-8, or says that the
    /// file is too large. The file is added in any case (with replacement characters, or
    /// empty), so that the diagnostic can be rendered.
    #[doc(hidden)]
    pub fn add_bytes(&mut self, name: &str, bytes: &[u8]) -> Result<FileId, Diagnostic> {
        if bytes.len() > MAX_SOURCE_BYTES {
            let id = self.add(name, "");
            return Err(too_large(bytes.len(), Span::new(id, 0, 0)));
        }
        let error = match std::str::from_utf8(bytes) {
            Ok(text) => return Ok(self.add(name, text)),
            Err(error) => error,
        };
        // Lossy decoding does not change the text before the error, so the offset stays
        // right.
        let id = self.add(name, &String::from_utf8_lossy(bytes));
        let at = error.valid_up_to();
        let byte = bytes.get(at).copied().unwrap_or_default();
        let hint = match bytes {
            [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "it looks like UTF-16; save the file as UTF-8",
            _ => {
                "save the file as UTF-8 (an older encoding such as Latin-1 writes letters with accents this way)"
            }
        };
        let span = Span::new(id, at, at + char::REPLACEMENT_CHARACTER.len_utf8());
        Err(Diagnostic::error(
            "the file is not UTF-8 text",
            span,
            format!("byte 0x{byte:02x} is not UTF-8"),
        )
        .hint(hint))
    }

    /// Returns a file; `None` if the number is not from this map.
    pub fn get(&self, id: FileId) -> Option<&SourceFile> {
        self.files.get(id.0 as usize)
    }

    /// Returns the source text of a span; empty if the span is outside the text.
    pub fn slice(&self, span: Span) -> &str {
        self.get(span.file)
            .and_then(|f| f.text.get(span.start as usize..span.end as usize))
            .unwrap_or("")
    }

    /// Returns `file:line:column` of the start of a span.
    pub fn locate(&self, span: Span) -> String {
        match self.get(span.file) {
            Some(file) => {
                let (line, column) = file.location(span.start as usize);
                format!("{}:{line}:{column}", file.name())
            }
            None => "<unknown>".to_owned(),
        }
    }
}

/// Creates the diagnostic for a file over the size limit.
pub(crate) fn too_large(bytes: usize, span: Span) -> Diagnostic {
    let mib = |b: usize| b as f64 / f64::from(1 << 20);
    let message = format!(
        "the file is too large: {:.1} MiB, at most {} MiB",
        mib(bytes),
        mib(MAX_SOURCE_BYTES)
    );
    Diagnostic::error(message, span, "")
        .hint("put data into a separate file: `data d = csv(\"points.csv\");`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_from_one_and_count_characters() {
        let mut map = SourceMap::new();
        let id = map.add("a.pcad", "ab\né x\n");
        let at = |start| map.locate(Span::new(id, start, start));
        assert_eq!(
            [at(0), at(1), at(3), at(6), at(8)],
            ["a.pcad:1:1", "a.pcad:1:2", "a.pcad:2:1", "a.pcad:2:3", "a.pcad:3:1"]
        );
        assert_eq!(map.get(id).unwrap().line_count(), 3);
        assert_eq!(map.slice(Span::new(id, 3, 5)), "é");
        assert_eq!(map.slice(Span::new(id, 3, 4)), "", "not a character boundary");
        assert_eq!(map.locate(Span::new(FileId(7), 0, 0)), "<unknown>");
    }

    #[test]
    fn bytes_that_are_no_text_are_located() {
        let mut map = SourceMap::new();
        let error =
            map.add_bytes("latin1.pcad", b"let a = 1;\nlet b = \"caf\xe9\";\n").unwrap_err();
        assert_eq!(map.locate(error.labels[0].span), "latin1.pcad:2:13");
        let error = map.add_bytes("utf16.pcad", &[0xff, 0xfe, b'l', 0]).unwrap_err();
        assert!(error.hints[0].contains("UTF-16"));
        let error = map.add_bytes("big.pcad", &vec![b' '; MAX_SOURCE_BYTES + 1]).unwrap_err();
        assert!(error.message.contains("too large"), "{}", error.message);
        assert!(map.add_bytes("full.pcad", &vec![b' '; MAX_SOURCE_BYTES]).is_ok());
    }
}
