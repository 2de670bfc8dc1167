//! The lines of a file of draws, and what can be wrong with them.

use super::DRAW_COLUMNS;
use super::names::columns;
use pcadlang_inference::draws::{Column, DrawRow, width};
use std::io::{self, BufRead, Take};
use thiserror::Error;

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
}

/// Reads the complete lines in the first bytes of a file.
pub(super) struct Lines<R> {
    from: Take<R>,
    text: String,
    /// The length of the lines read so far, in bytes.
    pub position: u64,
    /// The number of the lines read so far.
    pub count: usize,
    /// The number of recorded numbers after the last line of names.
    width: Option<usize>,
}

impl<R: BufRead> Lines<R> {
    /// Creates a reader; nothing at or after byte `end` is read.
    pub fn new(from: R, end: u64) -> Self {
        Lines { from: from.take(end), text: String::new(), position: 0, count: 0, width: None }
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
            Line::Comment(comment)
        } else if let Some(columns) = named(text) {
            self.width = Some(width(&columns));
            Line::Names(columns)
        } else {
            let width = self.width.ok_or(CsvError::Columns { line })?;
            Line::Draw(Numbers { text, line, width })
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
                Ok(DrawRow {
                    chain: 0,
                    draw: 0,
                    step: *step as u64,
                    log_joint: *log_joint,
                    log_prior: *log_prior,
                    log_likelihood: *log_likelihood,
                    acceptance: *acceptance,
                    divergent: *divergent as u64,
                    values: values.to_vec(),
                })
            }
            _ => {
                let expected = self.width + DRAW_COLUMNS.len();
                Err(CsvError::Width { line, found: all.len(), expected })
            }
        }
    }
}
