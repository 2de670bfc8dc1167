//! String literals: `"…"` on one line, with the escapes `\n \t \r \" \\ \u{1f600}`.

use super::error::SyntaxErrorKind;
use super::scan::Lexer;
use super::token::is_name;
use std::borrow::Cow;
use std::fmt::Write;
use std::sync::Arc;

impl Lexer<'_> {
    /// Reads the string that starts at `start` and whose contents start at `at`, up to
    /// one of the quotes `close` on the same line. Returns its value and its end.
    pub(super) fn string(
        &mut self,
        start: usize,
        mut at: usize,
        close: &[char],
    ) -> (Arc<str>, usize) {
        let mut value = String::new();
        while let Some(c) = self.rest(at).chars().next().filter(|&c| c != '\n') {
            if close.contains(&c) {
                return (value.into(), at + c.len_utf8());
            }
            let (c, length) =
                if c == '\\' { escape(self.rest(at)) } else { (Some(c), c.len_utf8()) };
            match c {
                Some(c) => value.push(c),
                None => self.error(SyntaxErrorKind::UnknownEscape, at, at + length),
            }
            at += length;
        }
        let end = start + self.text[start..at].trim_end().len();
        self.error(SyntaxErrorKind::UnterminatedString, start, end);
        (value.into(), end)
    }
}

/// Returns the character that the escape at the start of the text stands for, if it is
/// valid, and the length of the escape.
fn escape(text: &str) -> (Option<char>, usize) {
    let simple = match text.chars().nth(1) {
        Some('n') => '\n',
        Some('t') => '\t',
        Some('r') => '\r',
        Some(c @ ('"' | '\\')) => c,
        Some('u') => return unicode_escape(text),
        // A backslash at the end of the line: the missing quote is the error to report.
        None | Some('\n' | '\r') => return (Some('\\'), 1),
        Some(other) => return (None, 1 + other.len_utf8()),
    };
    (Some(simple), 2)
}

/// Reads `\u{…}` with one to six hexadecimal digits.
fn unicode_escape(text: &str) -> (Option<char>, usize) {
    let digits = text
        .strip_prefix("\\u{")
        .map(|t| t.bytes().take(7).take_while(u8::is_ascii_hexdigit).count());
    match digits {
        Some(n @ 1..=6) if text[3 + n..].starts_with('}') => {
            (u32::from_str_radix(&text[3..3 + n], 16).ok().and_then(char::from_u32), n + 4)
        }
        _ => (None, 2),
    }
}

/// Formats the key of a record: in quotes, unless it is a name.
pub fn record_key(key: &str) -> Cow<'_, str> {
    if is_name(key) { Cow::Borrowed(key) } else { Cow::Owned(quote(key)) }
}

/// Formats a string as a literal of the language.
pub(super) fn quote(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for c in text.chars() {
        match c {
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            '\r' => quoted.push_str("\\r"),
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => {
                // Writing to a string cannot fail.
                let _ = write!(quoted, "\\u{{{:x}}}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use crate::{format, parse_expr, print_expr, span::FileId};

    #[test]
    fn keys_of_records_may_be_in_quotes() {
        let printed = |text: &str| print_expr(&parse_expr(text, FileId(0)).unwrap());
        assert_eq!(
            printed(r#"{ "mixamorig:LeftArm": 1, "x": 2, if: 3, "": {}, "a\"b": 4, }"#),
            r#"{ "mixamorig:LeftArm": 1, x: 2, if: 3, "": {}, "a\"b": 4 }"#
        );
        assert_eq!(printed("f({})"), "f({})");
        // The formatter leaves quotes as they are written.
        assert_eq!(
            format("let a={\"x\":1,\"upperarm01.L\":{  }};").unwrap(),
            "let a = { \"x\": 1, \"upperarm01.L\": {} };\n"
        );
        assert!(parse_expr("{ 1: 2 }", FileId(0)).is_err());
        // Braces after a head are a block, as before.
        assert!(format("fn f() {} for i in {} {} fn g(x) { if x {} else {} {} }").is_ok());
    }
}
