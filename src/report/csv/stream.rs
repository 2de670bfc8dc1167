//! Reads draws one at a time, however many there are.

use super::names::column_names;
use super::read::{CsvError, named, numbers};
use crate::infer::draws::{Column, DrawRow, Layout, merged, width};
use std::io::{self, BufRead, Read};

/// The reasons why the next draw cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A line is malformed.
    #[error(transparent)]
    Csv(#[from] CsvError),
}

/// Reads the draws in the first `end` bytes of a file.
pub struct DrawReader<R> {
    from: R,
    /// The columns of the returned draws, under their names in the file.
    columns: Vec<Column>,
    position: u64,
    end: u64,
    line: usize,
    text: String,
    /// The number of numbers in the lines after the last line of names, and the positions
    /// of these numbers in `columns`.
    layout: Option<(usize, Layout)>,
}

impl<R: BufRead> DrawReader<R> {
    /// Creates a reader of the output of [`super::CsvSink`] with these columns, or with
    /// fewer before more were added; nothing at or after byte `end` is read.
    pub fn new(from: R, columns: &[Column], end: u64) -> Self {
        let names = column_names(columns);
        let columns = super::names::columns(&names.iter().map(String::as_str).collect::<Vec<_>>());
        DrawReader { from, columns, position: 0, end, line: 0, text: String::new(), layout: None }
    }

    /// Returns the length of all complete lines read so far, in bytes.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Reads the next draw; returns `None` at the end or at an incomplete line.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or a line is malformed.
    pub fn next_row(&mut self) -> Result<Option<DrawRow>, StreamError> {
        loop {
            self.text.clear();
            let length =
                self.from.by_ref().take(self.end - self.position).read_line(&mut self.text)?;
            if !self.text.ends_with('\n') {
                return Ok(None);
            }
            self.position += length as u64;
            self.line += 1;
            let text = self.text.trim_end_matches(['\n', '\r']);
            if text.starts_with('#') {
                continue;
            }
            if let Some(now) = named(text) {
                let wider = merged(&self.columns, &now);
                if wider != self.columns {
                    let (found, expected) = (width(&wider), width(&self.columns));
                    return Err(CsvError::Width { line: self.line, found, expected }.into());
                }
                self.layout = Some((width(&now), Layout::new(&now, &self.columns)));
                continue;
            }
            let Some((expected, layout)) = &self.layout else {
                return Err(CsvError::Columns { line: self.line }.into());
            };
            let row = numbers(text, self.line, *expected)?;
            return Ok(Some(match layout.is_same(*expected) {
                true => row,
                false => DrawRow { values: layout.apply(&row.values), ..row },
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# id = 1\nlp__,accept_stat__,divergent__,log_prior__,log_likelihood__,step__,x,v.1,v.2\n-1,1,0,-2,1,5,0.5,1,2\n-3,1,0,-2,1,9,inf,1,2\n";

    fn rows(text: &str, end: usize) -> Result<(usize, u64), StreamError> {
        let mut reader = DrawReader::new(
            text.as_bytes(),
            &[Column::scalar("x"), Column::vector("v", 2)],
            end as u64,
        );
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
    fn columns_that_come_later_are_nan_before() {
        let names = "lp__,accept_stat__,divergent__,log_prior__,log_likelihood__,step__";
        let text =
            format!("{names},v.1\n-1,1,0,-2,1,5,1\n{names},v.1,v.2,x\n-3,1,0,-2,1,9,3,4,7\n");
        let mut reader = DrawReader::new(
            text.as_bytes(),
            &[Column::vector("v", 2), Column::scalar("x")],
            text.len() as u64,
        );
        let mut next = || reader.next_row().unwrap().unwrap().values;
        let first = next();
        assert!(first[0] == 1.0 && first[1..].iter().all(|x| x.is_nan()) && first.len() == 3);
        assert_eq!(next(), [3.0, 4.0, 7.0]);
        let whole = super::super::read(&text).unwrap();
        assert_eq!(whole.columns, [Column::vector("v", 2), Column::scalar("x")]);
        assert!(whole.rows[0].values[1].is_nan() && whole.rows[1].values == [3.0, 4.0, 7.0]);
    }

    #[test]
    fn what_is_wrong_is_told() {
        let error = |text: &str| rows(text, text.len()).unwrap_err().to_string();
        assert!(error("a,b\n").contains("line 1"));
        assert!(error(&TEXT.replace(",v.2", "")).contains("9 numbers, but 8 columns"));
        assert!(
            error(&TEXT.replace("step__,x", "step__,y")).contains("line 2"),
            "a column that is not known"
        );
        assert!(error(&TEXT.replace("inf", "x")).contains("line 4"));
    }
}
