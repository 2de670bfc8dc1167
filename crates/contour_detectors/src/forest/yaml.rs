//! The subset of YAML in which OpenCV writes a forest: names with numbers, lists of
//! numbers and lists of such lists. It is read from a stream, number by number, since a
//! forest's text has a few hundred megabytes.

use std::io::{BufRead, ErrorKind};

/// The maximum length of a word.
const WORD: usize = 64;

/// An element of a text, ignoring spaces, commas and line ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    /// A name at the beginning of a line, and whether it is indented.
    Name(String, bool),
    /// A number.
    Number(f64),
}

/// Tokens of a text.
pub struct Tokens<R> {
    from: R,
    line: u64,
    /// Bytes read so far.
    read: u64,
    most: u64,
    /// True if this line has had anything other than spaces, and whether it began with
    /// spaces.
    begun: bool,
    indented: bool,
    /// Number of open brackets.
    depth: u32,
}

impl<R: BufRead> Tokens<R> {
    /// Reads a text of at most `most` bytes.
    pub fn new(from: R, most: u64) -> Self {
        Tokens { from, line: 1, read: 0, most, begun: false, indented: false, depth: 0 }
    }

    /// Returns an error message that begins with the current line.
    pub fn wrong(&self, what: impl std::fmt::Display) -> String {
        format!("line {}: {what}", self.line)
    }

    fn peek(&mut self) -> Result<Option<u8>, String> {
        loop {
            return match self.from.fill_buf() {
                Ok(bytes) => Ok(bytes.first().copied()),
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) if e.kind() == ErrorKind::UnexpectedEof => {
                    Err(self.wrong("the file is truncated"))
                }
                Err(e) => Err(self.wrong(format!("cannot decompress it: {e}"))),
            };
        }
    }

    fn skip(&mut self) -> Result<(), String> {
        self.from.consume(1);
        self.read += 1;
        match self.read > self.most {
            true => Err(format!("the text is too long; at most {} bytes are supported", self.most)),
            false => Ok(()),
        }
    }

    /// Skips the rest of the line.
    fn skip_line(&mut self) -> Result<(), String> {
        while self.peek()?.is_some_and(|b| b != b'\n') {
            self.skip()?;
        }
        Ok(())
    }

    /// Returns the next token; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Token>, String> {
        while let Some(byte) = self.peek()? {
            match byte {
                b'\n' => {
                    self.line += 1;
                    (self.begun, self.indented) = (false, false);
                    self.skip()?;
                }
                b' ' | b'\t' | b'\r' => {
                    self.indented |= !self.begun;
                    self.skip()?;
                }
                // `%YAML:1.0` comes before the text, `---` begins it, and `...` ends it.
                b'%' | b'#' if !self.begun && self.depth == 0 => self.skip_line()?,
                b'[' => {
                    self.depth += 1;
                    if self.depth > 2 {
                        return Err(self.wrong("lists are nested too deeply"));
                    }
                    self.begun = true;
                    self.skip()?;
                }
                b']' => {
                    self.depth =
                        self.depth.checked_sub(1).ok_or_else(|| self.wrong("`]` without `[`"))?;
                    self.skip()?;
                }
                b',' if self.depth > 0 => self.skip()?,
                _ => {
                    if let Some(token) = self.word()? {
                        return Ok(Some(token));
                    }
                }
            }
        }
        match self.depth {
            0 => Ok(None),
            _ => Err(self.wrong("the file is truncated: a list has no end")),
        }
    }

    /// Reads a name, a number, or one of the marks `-`, `---` and `...`.
    fn word(&mut self) -> Result<Option<Token>, String> {
        let mut word = [0u8; WORD];
        let mut n = 0;
        while let Some(b) = self.peek()? {
            if !(b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'-' | b'+')) {
                break;
            }
            *word.get_mut(n).ok_or_else(|| self.wrong("a word of more than 64 characters"))? = b;
            n += 1;
            self.skip()?;
        }
        let word = &word[..n];
        let first = !std::mem::replace(&mut self.begun, true);
        if self.peek()? == Some(b':') && self.depth == 0 && first && n > 0 {
            self.skip()?;
            return Ok(Some(Token::Name(
                String::from_utf8_lossy(word).into_owned(),
                self.indented,
            )));
        }
        match word {
            [] => {
                let b = self.peek()?.unwrap_or(b' ');
                Err(self.wrong(format!("unexpected `{}`", char::from(b).escape_default())))
            }
            // Another list item follows on the same line.
            b"-" if self.depth == 0 => {
                self.begun = false;
                self.indented = true;
                Ok(None)
            }
            b"---" | b"..." if first && !self.indented => Ok(None),
            _ => match number(word) {
                Some(x) => Ok(Some(Token::Number(x))),
                None => {
                    Err(self.wrong(format!("`{}` is not a number", String::from_utf8_lossy(word))))
                }
            },
        }
    }
}

/// Parses a finite number. Most are small integers, which have a fast path.
fn number(word: &[u8]) -> Option<f64> {
    if word.len() < 10 && word.iter().all(u8::is_ascii_digit) {
        return Some(f64::from(word.iter().fold(0u32, |n, b| 10 * n + u32::from(b - b'0'))));
    }
    // "inf" and "nan" would also parse as numbers.
    let plain =
        word.iter().all(|b| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E'));
    let x: f64 = std::str::from_utf8(word).ok().filter(|_| plain)?.parse().ok()?;
    x.is_finite().then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Result<Vec<Token>, String> {
        let mut tokens = Tokens::new(text.as_bytes(), 10_000);
        let mut all = Vec::new();
        while let Some(t) = tokens.next()? {
            all.push(t);
        }
        Ok(all)
    }

    #[test]
    fn names_numbers_and_lists() {
        use Token::{Name, Number};
        let text = "%YAML:1.0\n---\na:\n   stride: 2\n   x: 5.\nb:\n   - [ 1, -2.5e-01,\n       3 ]\n   - 4\n   -\n      - 5\nc: [ [ 6 ], [ ] ]\n...\n";
        let name = |n: &str, indented| Name(n.into(), indented);
        let expected = [
            name("a", false),
            name("stride", true),
            Number(2.0),
            name("x", true),
            Number(5.0),
            name("b", false),
            Number(1.0),
            Number(-0.25),
            Number(3.0),
            Number(4.0),
            Number(5.0),
            name("c", false),
            Number(6.0),
        ];
        assert_eq!(tokens(text).unwrap(), expected);
        assert_eq!(tokens("").unwrap(), []);
    }

    #[test]
    fn what_is_no_such_text() {
        for (text, why) in [
            ("a: [ 1, 2", "line 1: the file is truncated: a list has no end"),
            ("a: ]", "line 1: `]` without `[`"),
            ("a:\n- [ 1, x ]", "line 2: `x` is not a number"),
            ("a: 1.2.3", "line 1: `1.2.3` is not a number"),
            ("a: inf", "line 1: `inf` is not a number"),
            ("a: 1e999", "line 1: `1e999` is not a number"),
            ("a: [[[1]]]", "line 1: lists are nested too deeply"),
            ("\n\n{a}", "line 3: unexpected `{`"),
            ("a: \u{e4}", "line 1: unexpected `\\u{c3}`"),
            ("a: 1, 2", "line 1: unexpected `,`"),
        ] {
            assert_eq!(tokens(text).unwrap_err(), why, "{text}");
        }
        assert!(tokens(&"9".repeat(65)).unwrap_err().contains("64"));
        assert!(tokens(&" ".repeat(10_001)).unwrap_err().contains("too long"));
    }
}
