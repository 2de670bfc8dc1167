//! Reads a chain's draws.

use super::DRAW_COLUMNS;
use super::names::columns;
use crate::infer::draws::{Column, DrawRow, Layout, merged, width};
use crate::report::ChainDraws;
use thiserror::Error;

/// An error in a file of draws. Lines are counted from 1.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CsvError {
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

/// Reads the output of [`super::CsvSink`], also while it is still being written: an
/// incomplete last line is left out.
///
/// # Errors
/// Returns an error if a complete line is malformed.
pub fn read(text: &str) -> Result<ChainDraws, CsvError> {
    let mut chain = ChainDraws::default();
    let mut id = 0;
    let mut layout: Option<(usize, Vec<Column>)> = None;
    let finished = text.split_inclusive('\n').filter_map(|l| l.strip_suffix('\n'));
    for (line, text) in finished.enumerate().map(|(i, l)| (i + 1, l.trim_end_matches('\r'))) {
        if let Some(comment) = text.strip_prefix('#') {
            if let Some((key, value)) = comment.split_once('=') {
                let (key, value) = (key.trim(), value.trim());
                if key == "id" {
                    id = value.parse().unwrap_or(1_u32).saturating_sub(1);
                }
                chain.comments.push((key.to_owned(), value.to_owned()));
            }
        } else if let Some(now) = named(text) {
            // Earlier draws lack the columns that are added later.
            let all =
                if chain.columns.is_empty() { now.clone() } else { merged(&chain.columns, &now) };
            chain.widen(all);
            layout = Some((width(&now), now));
        } else {
            let Some((expected, now)) = &layout else { return Err(CsvError::Columns { line }) };
            let row = numbers(text, line, *expected)?;
            let values = match now == &chain.columns {
                true => row.values,
                false => Layout::new(now, &chain.columns).apply(&row.values),
            };
            chain.rows.push(DrawRow { chain: id, draw: chain.rows.len() as u64, values, ..row });
        }
    }
    Ok(chain)
}

/// Returns the recorded columns of a line of names; `None` for any other line.
pub(crate) fn named(text: &str) -> Option<Vec<Column>> {
    let names: Vec<&str> = text.split(',').collect();
    names.strip_prefix(&DRAW_COLUMNS).map(columns)
}

/// Parses a draw with `expected` recorded numbers; the chain and the number of the draw
/// are left at 0.
pub(super) fn numbers(text: &str, line: usize, expected: usize) -> Result<DrawRow, CsvError> {
    let parse = |s: &str| {
        s.parse::<f64>().map_err(|_| CsvError::Number { line, text: s.chars().take(40).collect() })
    };
    let all = text.split(',').map(parse).collect::<Result<Vec<f64>, _>>()?;
    match &all[..] {
        [log_joint, acceptance, divergent, log_prior, log_likelihood, step, values @ ..]
            if values.len() == expected =>
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
            Err(CsvError::Width { line, found: all.len(), expected: expected + DRAW_COLUMNS.len() })
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
        assert_eq!(read("a,b\n1,2\n"), Err(CsvError::Columns { line: 1 }));
        let short = format!("{HEAD}1,2,3\n");
        assert_eq!(read(&short), Err(CsvError::Width { line: 3, found: 3, expected: 9 }));
        let word = format!("{HEAD}1,2,3,4,5,6,x,6,7\n");
        assert_eq!(read(&word), Err(CsvError::Number { line: 3, text: "x".into() }));
        assert_eq!(read("").unwrap(), ChainDraws::default());
    }
}
