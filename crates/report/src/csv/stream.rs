//! Reads draws one at a time, however many there are.

use super::lines::{CsvError, Line, Lines};
use pcadlang_inference::draws::{Column, DrawRow, Layout, merged, width};
use std::io::BufRead;

/// Reads the draws in the first `end` bytes of a file.
pub struct DrawReader<R> {
    lines: Lines<R>,
    /// The columns of the returned draws, under their names in the file.
    columns: Vec<Column>,
    /// The positions of the file's numbers in `columns`.
    layout: Layout,
}

impl<R: BufRead> DrawReader<R> {
    /// Creates a reader of the output of [`super::CsvSink`] with these columns, under
    /// their names in the file, or with fewer before more were added; nothing at or after
    /// byte `end` is read.
    pub fn new(from: R, columns: &[Column], end: u64) -> Self {
        let (columns, layout) = (columns.to_vec(), Layout::new(&[], &[]));
        DrawReader { lines: Lines::new(from, end), columns, layout }
    }

    /// Returns the length of all complete lines read so far, in bytes.
    pub fn position(&self) -> u64 {
        self.lines.position
    }

    /// Reads the next draw; returns `None` at the end or at an incomplete line.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or a line is malformed.
    pub fn next_row(&mut self) -> Result<Option<DrawRow>, CsvError> {
        let DrawReader { lines, columns, layout } = self;
        loop {
            let line = lines.count + 1;
            match lines.next_line()? {
                None => return Ok(None),
                Some(Line::Comment(_)) => {}
                Some(Line::Names(now)) => {
                    let wider = merged(columns, &now);
                    if wider != *columns {
                        let (found, expected) = (width(&wider), width(columns));
                        return Err(CsvError::Width { line, found, expected });
                    }
                    *layout = Layout::new(&now, columns);
                }
                Some(Line::Draw(numbers)) => {
                    let row = numbers.parse()?;
                    return Ok(Some(match layout.is_same(numbers.width) {
                        true => row,
                        false => DrawRow { values: layout.apply(&row.values), ..row },
                    }));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# id = 1\nlp__,accept_stat__,divergent__,log_prior__,log_likelihood__,step__,x,v.1,v.2\n-1,1,0,-2,1,5,0.5,1,2\n-3,1,0,-2,1,9,inf,1,2\n";

    fn rows(text: &str, end: usize) -> Result<(usize, u64), CsvError> {
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
