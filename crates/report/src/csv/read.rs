//! Reads draws from CSV: line by line, draw by draw, or a whole file.

use super::names::{columns, file_order};
use super::{DRAW_COLUMNS, levels_in};
use crate::ChainDraws;
use pcadlang_inference::draws::{Column, DrawRow, Layout, merged, width};
use std::collections::HashMap;
use std::io::{self, BufRead, Take};
use thiserror::Error;

/// The contents of a file of draws, apart from its numbers.
#[derive(Default)]
pub(crate) struct Contents {
    /// The comments before the first line of names.
    pub head: String,
    /// The comments after it, without levels.
    pub tail: String,
    /// The length of all that precedes the first line of names, in bytes.
    pub head_end: u64,
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
        loop {
            let begin = lines.position;
            let Some(line) = lines.next_line()? else { break };
            match line {
                Line::Comment(text) if found.heads == 0 => found.head += &format!("#{text}\n"),
                Line::Comment(text) if levels_in(text).is_some() => {}
                Line::Comment(text) => found.tail += &format!("#{text}\n"),
                Line::Names(columns) => {
                    if found.heads == 0 {
                        found.head_end = begin;
                    }
                    found.heads += 1;
                    found.columns = merged(&found.columns, &columns);
                }
                Line::Draw(_) => found.draws += 1,
            }
        }
        Ok(found)
    }

    /// The comments before the first line of names, without levels.
    pub fn settings(&self) -> String {
        let others = self.head.lines().filter(|l| l.get(1..).and_then(levels_in).is_none());
        others.flat_map(|l| [l, "\n"]).collect()
    }

    /// The steps of the warm-up, if the chain has ended.
    pub fn warmup(&self) -> Option<u64> {
        self.tail.lines().find_map(|l| l.strip_prefix("# warmup_steps = ")?.parse().ok())
    }
}

/// Reads the output of [`super::CsvSink`], also while it is still being written: an
/// incomplete last line is left out. Draws lack the columns that are added after them.
///
/// # Errors
/// Returns an error if a complete line is malformed.
pub fn read(text: &str) -> Result<ChainDraws, CsvError> {
    let found = Contents::of(text.as_bytes())?;
    let (comments, columns) = (found.settings() + &found.tail, found.columns);
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

/// An error in a file of draws. Lines are counted from 1.
#[derive(Debug, Error)]
pub enum CsvError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The line of names does not start with the columns about the draw.
    #[error(
        "line {line}: not a file of draws by pcadlang: its columns do not start with lp__, accept_stat__, …"
    )]
    Columns {
        /// The line.
        line: usize,
    },
    /// A line has too few or too many numbers.
    #[error("line {line}: {found} numbers, but {expected} columns")]
    Width {
        /// The line.
        line: usize,
        /// The number of numbers in the line.
        found: usize,
        /// The expected number.
        expected: usize,
    },
    /// Something that is not a number.
    #[error("line {line}: `{text}` is not a number")]
    Number {
        /// The line.
        line: usize,
        /// The text found.
        text: String,
    },
}

impl CsvError {
    /// Converts the error for callers that have errors of reading and writing only.
    pub(crate) fn into_io(self) -> io::Error {
        match self {
            CsvError::Io(e) => e,
            other => io::Error::other(other),
        }
    }
}

/// A complete line of a file of draws.
pub(super) enum Line<'a> {
    /// A comment, without its `#`.
    Comment(&'a str),
    /// The recorded columns, from a line of names.
    Names(Vec<Column>),
    /// A draw.
    Draw(Numbers<'a>),
}

/// The text of a draw, and how many recorded numbers it must have.
pub(super) struct Numbers<'a> {
    text: &'a str,
    line: usize,
    pub width: usize,
    order: Option<&'a [usize]>,
}

/// Reads the complete lines in the first bytes of a file.
pub(super) struct Lines<R> {
    from: Take<R>,
    text: String,
    /// The length of the lines read so far, in bytes.
    pub position: u64,
    /// The number of the lines read so far.
    pub count: usize,
    /// The number of recorded numbers after the last line of names, and their order.
    width: Option<usize>,
    order: Option<Vec<usize>>,
    /// The texts of columns so far.
    levels: HashMap<String, Vec<String>>,
}

impl<R: BufRead> Lines<R> {
    /// Creates a reader; nothing at or after byte `end` is read.
    pub fn new(from: R, end: u64) -> Self {
        Lines {
            from: from.take(end),
            text: String::new(),
            position: 0,
            count: 0,
            width: None,
            order: None,
            levels: HashMap::new(),
        }
    }

    /// Reads the next line; returns `None` at the end or at an incomplete line.
    pub fn next_line(&mut self) -> Result<Option<Line<'_>>, CsvError> {
        self.text.clear();
        let length = self.from.read_line(&mut self.text)?;
        let Some(text) = self.text.strip_suffix('\n') else { return Ok(None) };
        self.position += length as u64;
        self.count += 1;
        let (text, line) = (text.trim_end_matches('\r'), self.count);
        Ok(Some(if let Some(comment) = text.strip_prefix('#') {
            if let Some((name, levels)) = levels_in(comment) {
                self.levels.insert(name.to_owned(), levels);
            }
            Line::Comment(comment)
        } else if let Some(mut columns) = named(text) {
            for c in &mut columns {
                c.levels = self.levels.get(&c.name).cloned().unwrap_or_default();
            }
            (self.width, self.order) = (Some(width(&columns)), file_order(&columns));
            Line::Names(columns)
        } else {
            let width = self.width.ok_or(CsvError::Columns { line })?;
            Line::Draw(Numbers { text, line, width, order: self.order.as_deref() })
        }))
    }
}

/// Returns the recorded columns of a line of names; `None` for any other line.
fn named(text: &str) -> Option<Vec<Column>> {
    let names: Vec<&str> = text.split(',').collect();
    names.strip_prefix(&DRAW_COLUMNS).map(columns)
}

impl Numbers<'_> {
    /// Parses the draw; its chain and its number are left at 0.
    pub fn parse(&self) -> Result<DrawRow, CsvError> {
        let line = self.line;
        let parse = |s: &str| {
            let not = |_| CsvError::Number { line, text: s.chars().take(40).collect() };
            s.parse::<f64>().map_err(not)
        };
        let all = self.text.split(',').map(parse).collect::<Result<Vec<f64>, _>>()?;
        match &all[..] {
            [log_joint, acceptance, divergent, log_prior, log_likelihood, step, values @ ..]
                if values.len() == self.width =>
            {
                let mut row = values.to_vec();
                for (x, place) in values.iter().zip(self.order.unwrap_or_default()) {
                    row[*place] = *x;
                }
                Ok(DrawRow {
                    chain: 0,
                    draw: 0,
                    step: *step as u64,
                    log_joint: *log_joint,
                    log_prior: *log_prior,
                    log_likelihood: *log_likelihood,
                    acceptance: *acceptance,
                    divergent: *divergent as u64,
                    values: row,
                })
            }
            _ => {
                let expected = self.width + DRAW_COLUMNS.len();
                Err(CsvError::Width { line, found: all.len(), expected })
            }
        }
    }
}

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
        assert_eq!((&*found.head, &*found.tail), ("# id = 3\n", "# steps = 9\n"));
        assert_eq!(found.head_end, found.head.len() as u64);
        let names: Vec<&str> = found.columns.iter().map(|c| &*c.name).collect();
        assert_eq!(names, ["x", "v", "y"]);
    }

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
