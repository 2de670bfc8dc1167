//! The description of the name under a cursor.

use super::Analysis;
use super::names::Binding;
use super::words::start_of;
use pcadlang_engine::lang::builtins::doc::doc;
use pcadlang_syntax::span::{FileId, Span};

/// The maximum number of lines of a declaration that are shown.
const LINES: usize = 6;

impl Analysis {
    /// Returns what the name or keyword at a byte is, as Markdown, and where it stands.
    pub fn hover(&self, byte: u32) -> Option<(Span, String)> {
        if let Some((o, binding)) = self.names.at(0, byte) {
            return Some((o.span, self.binding_text(binding)));
        }
        let (span, name) = match self.names.other_at(0, byte) {
            Some((span, name)) => (span, name.to_owned()),
            None => self.word_at(byte as usize)?,
        };
        let text = doc(&self.builtins, &name)?;
        Some((span, format!("```\n{}\n```", text.trim_end())))
    }

    fn binding_text(&self, b: &Binding) -> String {
        let text = self.sources.slice(b.whole);
        let lines: Vec<&str> = text.lines().take(LINES).collect();
        let more = if text.lines().count() > LINES { "\n…" } else { "" };
        let file = match b.span.file {
            FileId(0) => String::new(),
            _ => format!(" in {}", self.sources.locate(b.span)),
        };
        format!("```pcad\n{}{more}\n```\n{} `{}`{file}", lines.join("\n"), b.kind.name(), b.name)
    }

    /// Returns the word around a byte.
    fn word_at(&self, byte: usize) -> Option<(Span, String)> {
        let text = self.text();
        let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let (before, after) = text.split_at_checked(byte)?;
        let start = start_of(before, part);
        let end = byte + after.find(|c| !part(c)).unwrap_or(after.len());
        let word = text.get(start..end).filter(|w| !w.is_empty())?;
        Some((Span::new(FileId(0), start, end), word.to_owned()))
    }
}
