//! Reads a chain's draws, also while they are still being written: an incomplete last
//! line is left out.

use super::lines::{CsvError, Line, Lines};
use super::stream::DrawReader;
use crate::ChainDraws;
use pcadlang_inference::draws::{Column, DrawRow, merged};
use std::io::BufRead;

/// The contents of a file of draws, apart from its numbers.
#[derive(Default)]
pub(crate) struct Contents {
    /// The lines of comments.
    pub comments: String,
    /// The union of the columns of its draws.
    pub columns: Vec<Column>,
    /// The number of lines of names.
    pub heads: usize,
    /// The number of its draws.
    pub draws: u64,
}

impl Contents {
    /// Reads a file without parsing its numbers.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or has draws before the line of names.
    pub fn of(from: impl BufRead) -> Result<Contents, CsvError> {
        let mut found = Contents::default();
        let mut lines = Lines::new(from, u64::MAX);
        while let Some(line) = lines.next_line()? {
            match line {
                Line::Comment(text) => found.comments += &format!("#{text}\n"),
                Line::Names(columns) => {
                    found.heads += 1;
                    found.columns = merged(&found.columns, &columns);
                }
                Line::Draw(_) => found.draws += 1,
            }
        }
        Ok(found)
    }
}

/// Reads the output of [`super::CsvSink`], also while it is still being written: an
/// incomplete last line is left out. Draws lack the columns that are added after them.
///
/// # Errors
/// Returns an error if a complete line is malformed.
pub fn read(text: &str) -> Result<ChainDraws, CsvError> {
    let Contents { comments, columns, .. } = Contents::of(text.as_bytes())?;
    let pair = |line: &str| {
        let (key, value) = line.strip_prefix('#')?.split_once('=')?;
        Some((key.trim().to_owned(), value.trim().to_owned()))
    };
    let comments: Vec<(String, String)> = comments.lines().filter_map(pair).collect();
    let id = comments.iter().find(|(key, _)| key == "id");
    let chain = id.map_or(0, |(_, id)| id.parse().unwrap_or(1_u32).saturating_sub(1));
    let mut reader = DrawReader::new(text.as_bytes(), &columns, u64::MAX);
    let mut rows = Vec::new();
    while let Some(row) = reader.next_row()? {
        rows.push(DrawRow { chain, draw: rows.len() as u64, ..row });
    }
    Ok(ChainDraws { comments, columns, rows, ..ChainDraws::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str =
        "# id = 3\nlp__,accept_stat__,divergent__,log_prior__,log_likelihood__,step__,x,v.1,v.2\n";

    #[test]
    fn an_unfinished_line_is_left_out() {
        let whole = format!("{HEAD}-1,0.5,0,-2,1,5,0.5,1,2\n");
        for cut in 0..whole.len() {
            let chain = read(&whole[..cut]).unwrap();
            assert!(chain.rows.is_empty());
        }
        let chain = read(&whole).unwrap();
        assert_eq!(
            (chain.rows[0].chain, chain.rows[0].step, chain.rows[0].values.len()),
            (2, 5, 3)
        );
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let error = |text: &str| read(text).unwrap_err().to_string();
        assert!(error("a,b\n1,2\n").starts_with("line 1: not a file of draws by pcadlang"));
        assert_eq!(error(&format!("{HEAD}1,2,3\n")), "line 3: 3 numbers, but 9 columns");
        let word = format!("{HEAD}1,2,3,4,5,6,x,6,7\n");
        assert_eq!(error(&word), "line 3: `x` is not a number");
        assert_eq!(read("").unwrap(), ChainDraws::default());
    }

    #[test]
    fn a_file_is_looked_through_without_its_numbers() {
        let more = HEAD.split_once('\n').map_or("", |(_, names)| names).replace(",v.2", ",v.2,y");
        let text = format!("{HEAD}1,2,3,4,5,6,7,8,x\n{more}1\n# steps = 9\r\n1,2,3");
        let found = Contents::of(text.as_bytes()).unwrap();
        assert_eq!((found.draws, found.heads), (2, 2), "half a line is none");
        assert_eq!(found.comments, "# id = 3\n# steps = 9\n");
        let names: Vec<&str> = found.columns.iter().map(|c| &*c.name).collect();
        assert_eq!(names, ["x", "v", "y"]);
    }
}
