//! Bytes of a text and positions of the protocol: lines, and columns in units that the
//! two sides agree on; paths and addresses of files.

use crate::editor::Analysis;
use lsp_types::{Position, Range, Uri};
use pcadlang_syntax::diag::{FileId, SourceFile, Span};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The units of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Bytes.
    Utf8,
    /// 16-bit units, which every editor understands.
    Utf16,
}

impl Encoding {
    fn length(self, text: &str) -> u32 {
        match self {
            Encoding::Utf8 => text.len() as u32,
            Encoding::Utf16 => text.encode_utf16().count() as u32,
        }
    }

    /// Returns the position of a byte.
    pub fn position(self, file: &SourceFile, byte: u32) -> Position {
        let byte = (byte as usize).min(file.text().len());
        let line = file.line_index(byte);
        let before = file.text().get(file.line_range(line).start..byte).unwrap_or("");
        Position { line: line as u32, character: self.length(before) }
    }

    /// Returns the byte at a position; the end of the line for a column past it.
    pub fn byte(self, file: &SourceFile, at: Position) -> u32 {
        let range = file.line_range(at.line as usize);
        let line = file.text().get(range.clone()).unwrap_or("");
        let line = line.trim_end_matches(['\n', '\r']);
        let mut column = 0;
        for (i, c) in line.char_indices() {
            if column >= at.character {
                return (range.start + i) as u32;
            }
            column += self.length(c.encode_utf8(&mut [0; 4]));
        }
        (range.start + line.len()) as u32
    }

    /// Returns the range of a span.
    pub fn range(self, file: &SourceFile, span: Span) -> Range {
        Range { start: self.position(file, span.start), end: self.position(file, span.end) }
    }
}

/// Returns the path of a file's address; other addresses stand for themselves.
pub fn path_of(uri: &Uri) -> String {
    let text = uri.as_str();
    let Some(rest) = text.strip_prefix("file://") else { return text.to_owned() };
    let mut bytes = Vec::with_capacity(rest.len());
    let mut rest = rest.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let code = after.get(..2).and_then(|hex| std::str::from_utf8(hex).ok());
        let code = code.and_then(|hex| u8::from_str_radix(hex, 16).ok());
        match (first, code) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    let path = String::from_utf8_lossy(&bytes).into_owned();
    // `/C:/…` on Windows.
    match path.as_bytes() {
        [b'/', drive, b':', ..] if drive.is_ascii_alphabetic() => path[1..].to_owned(),
        _ => path,
    }
}

/// Returns the address of a file.
fn uri_of(path: &Path) -> Option<Uri> {
    let path: PathBuf = std::path::absolute(path).ok()?;
    let mut text = String::from("file://");
    let path = path.to_str()?.replace('\\', "/");
    if !path.starts_with('/') {
        text.push('/');
    }
    for byte in path.bytes() {
        match byte {
            b'/' | b'-' | b'.' | b'_' | b'~' | b':' => text.push(char::from(byte)),
            b if b.is_ascii_alphanumeric() => text.push(char::from(b)),
            b => text.push_str(&format!("%{b:02X}")),
        }
    }
    Uri::from_str(&text).ok()
}

/// Returns the address of a file of a program whose text has this one; `None` for a
/// shipped file, which is not on the disk.
pub fn address(analysis: &Analysis, own: &Uri, file: FileId) -> Option<Uri> {
    if file == FileId(0) {
        return Some(own.clone());
    }
    let path = Path::new(analysis.sources.get(file)?.name());
    path.exists().then(|| uri_of(path)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_syntax::diag::SourceMap;

    #[test]
    fn columns_are_counted_in_the_agreed_units() {
        let mut map = SourceMap::new();
        let id = map.add("a", "let é = \"𝄞\"; x\nlast");
        let file = map.get(id).unwrap();
        for (encoding, x) in [(Encoding::Utf8, 17), (Encoding::Utf16, 14)] {
            let byte = file.text().find('x').unwrap() as u32;
            let at = Position { line: 0, character: x };
            assert_eq!(encoding.position(file, byte), at, "{encoding:?}");
            assert_eq!(encoding.byte(file, at), byte, "{encoding:?}");
            let past = Position { line: 0, character: 99 };
            assert_eq!(encoding.byte(file, past), byte + 1);
            assert_eq!(encoding.byte(file, Position { line: 7, character: 1 }), 23);
        }
    }

    #[test]
    fn addresses_and_paths_correspond() {
        let uri = uri_of(Path::new("/tmp/a b/é.pcad")).unwrap();
        assert_eq!(uri.as_str(), "file:///tmp/a%20b/%C3%A9.pcad");
        assert_eq!(path_of(&uri), "/tmp/a b/é.pcad");
        assert_eq!(path_of(&Uri::from_str("untitled:Untitled-1").unwrap()), "untitled:Untitled-1");
        assert_eq!(path_of(&Uri::from_str("file:///C:/x.pcad").unwrap()), "C:/x.pcad");
    }
}
