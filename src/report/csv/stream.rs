//! Reading draws back one at a time, however many there are.

use super::DRAW_COLUMNS;
use super::read::{CsvError, numbers};
use crate::infer::draws::{Column, DrawRow, width};
use std::io::{self, BufRead, Read};

/// Why the next draw cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A line is not what it should be.
    #[error(transparent)]
    Csv(#[from] CsvError),
}

/// Reads the draws of the first so many bytes of a file.
pub struct DrawReader<R> {
    from: R,
    /// Numbers that are recorded with a draw.
    width: usize,
    position: u64,
    end: u64,
    line: usize,
    text: String,
    /// Whether the line of names has come.
    named: bool,
}

impl<R: BufRead> DrawReader<R> {
    /// A reader of what [`super::CsvSink`] wrote with these columns; nothing at or after byte `end` is looked at.
    pub fn new(from: R, columns: &[Column], end: u64) -> Self {
        DrawReader { from, width: width(columns), position: 0, end, line: 0, text: String::new(), named: false }
    }

    /// The bytes of all finished lines so far.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// The next draw; `None` at the end, or at a line that is not finished.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is not what it should be.
    pub fn next_row(&mut self) -> Result<Option<DrawRow>, StreamError> {
        loop {
            self.text.clear();
            let length = self.from.by_ref().take(self.end - self.position).read_line(&mut self.text)?;
            if !self.text.ends_with('\n') {
                return Ok(None);
            }
            self.position += length as u64;
            self.line += 1;
            let text = self.text.trim_end_matches(['\n', '\r']);
            if text.starts_with('#') {
                continue;
            }
            if self.named {
                return Ok(Some(numbers(text, self.line, self.width)?));
            }
            let found = text.split(',').count();
            if !text.split(',').take(DRAW_COLUMNS.len()).eq(DRAW_COLUMNS) {
                return Err(CsvError::Columns { line: self.line }.into());
            }
            let expected = self.width + DRAW_COLUMNS.len();
            if found != expected {
                return Err(CsvError::Width { line: self.line, found, expected }.into());
            }
            self.named = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "# id = 1\nlp__,log_prior__,log_likelihood__,step__,x,v.1,v.2\n-1,-2,1,5,0.5,1,2\n-3,-2,1,9,inf,1,2\n";

    fn rows(text: &str, end: usize) -> Result<(usize, u64), StreamError> {
        let mut reader = DrawReader::new(text.as_bytes(), &[Column::scalar("x"), Column::vector("v", 2)], end as u64);
        let mut n = 0;
        while let Some(row) = reader.next_row()? {
            assert_eq!((row.step, row.values.len()), ([5, 9][n], 3));
            n += 1;
        }
        Ok((n, reader.position()))
    }

    #[test]
    fn draws_come_one_by_one_up_to_an_end() {
        let first = TEXT.find("-3").unwrap();
        assert_eq!(rows(TEXT, TEXT.len()).unwrap(), (2, TEXT.len() as u64));
        assert_eq!(rows(TEXT, first).unwrap(), (1, first as u64));
        assert_eq!(rows(TEXT, first + 4).unwrap(), (1, first as u64), "half a line is none");
        assert_eq!(rows(TEXT, 0).unwrap(), (0, 0));
    }

    #[test]
    fn what_is_wrong_is_told() {
        let error = |text: &str| rows(text, text.len()).unwrap_err().to_string();
        assert!(error("a,b\n").contains("line 1"));
        assert!(error(&TEXT.replace(",v.2", "")).contains("6 numbers, but 7 columns"));
        assert!(error(&TEXT.replace("inf", "x")).contains("line 4"));
    }
}
