//! Draws of one chain as CSV in CmdStan's format, which ArviZ (`from_cmdstan`), posterior
//! and CmdStan's tools can read.
//!
//! A file has comment lines (`# key = value`), a line of column names, and a line per
//! draw. When a draw has new columns, the line of names is repeated with them; at the end
//! of a run, all chains are brought to the same columns. Columns that end in `__` are
//! about the draw: `lp__` (log joint density), `accept_stat__` (acceptance rate since the
//! last draw), `divergent__` (divergent trajectories since the last draw), `log_prior__`,
//! `log_likelihood__`, `step__`. The recorded quantities follow, with the elements of a
//! vector as `name.1, name.2, …`. Numbers are written so that reading them gives the same
//! bits.
//!
//! Invariant: the file is readable at any moment, because every line is passed to the
//! system in one call and the reader leaves out an incomplete last line.

mod read;

pub(crate) use read::Contents;
pub use read::{CsvError, DrawReader, read};

use pcadlang_inference::draws::{Column, DrawRow, Shape, Sink, width};
use std::collections::HashSet;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

/// The columns about the draw itself, which come first.
pub(crate) const DRAW_COLUMNS: [&str; 6] =
    ["lp__", "accept_stat__", "divergent__", "log_prior__", "log_likelihood__", "step__"];

/// A sink that writes CmdStan CSV to a file or another writer.
#[derive(Debug)]
pub struct CsvSink<W = File> {
    out: W,
    comments: String,
    /// The number of numbers in a row; `None` before the columns are known.
    width: Option<usize>,
    line: String,
    /// The number of bytes written so far.
    written: u64,
}

impl CsvSink {
    /// Creates (or empties) the file of a chain, counted from 0, and writes its comments:
    /// first those that ArviZ needs, then the given pairs.
    ///
    /// # Errors
    /// Returns an error if the file cannot be created or written.
    pub fn create(path: &Path, chain: u32, comments: &[(&str, String)]) -> io::Result<Self> {
        CsvSink::new(File::create(path)?, chain, comments)
    }

    /// Continues a file that ends after the first `written` bytes of a chain. `columns`
    /// are the columns declared so far, if any.
    pub(crate) fn resume(file: File, written: u64, columns: Option<&[Column]>) -> Self {
        CsvSink {
            out: file,
            comments: String::new(),
            width: columns.map(width),
            line: String::new(),
            written,
        }
    }

    /// Flushes all draws to the disk.
    ///
    /// # Errors
    /// Returns an error if the file cannot be synchronised.
    pub(crate) fn sync(&self) -> io::Result<()> {
        self.out.sync_data()
    }
}

impl<W: Write> CsvSink<W> {
    /// Does the same as [`CsvSink::create`] for a writer, which should not buffer lines.
    ///
    /// # Errors
    /// Returns an error if the writer fails.
    pub fn new(mut out: W, chain: u32, comments: &[(&str, String)]) -> io::Result<Self> {
        let mut text =
            format!("# model = pcadlang\n# id = {}\n# save_warmup = 0\n", u64::from(chain) + 1);
        for (key, value) in comments {
            let value = value.replace(|c: char| c.is_control(), " ");
            let _ = writeln!(text, "# {key} = {value}");
        }
        out.write_all(text.as_bytes())?;
        let written = text.len() as u64;
        Ok(CsvSink { out, comments: text, width: None, line: String::new(), written })
    }

    /// Creates a sink whose output begins with the line of names.
    pub(crate) fn bare(out: W) -> Self {
        CsvSink { out, comments: String::new(), width: None, line: String::new(), written: 0 }
    }

    /// Flushes the writer.
    ///
    /// # Errors
    /// Returns an error if the output cannot be written.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Returns the number of bytes written so far.
    pub(crate) fn written(&self) -> u64 {
        self.written
    }

    /// Returns the comments at the head of the file.
    #[doc(hidden)]
    pub fn comments(&self) -> &str {
        &self.comments
    }
}

impl<W: Write + Send> Sink for CsvSink<W> {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        let names = DRAW_COLUMNS.map(String::from).into_iter().chain(column_names(columns));
        let line = names.collect::<Vec<_>>().join(",") + "\n";
        self.width = Some(width(columns));
        self.written += line.len() as u64;
        self.out.write_all(line.as_bytes())
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        if self.width != Some(row.values.len()) {
            let said =
                self.width.map_or("no columns declared".into(), |w| format!("{w} announced"));
            let message = format!("a draw of {} numbers with {said}", row.values.len());
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        self.line.clear();
        // Writing to a string cannot fail. `{:?}` is the shortest text that reads back to
        // the same bits.
        let r = row;
        let _ = write!(self.line, "{:?},{:?},{}", r.log_joint, r.acceptance, r.divergent);
        let _ = write!(self.line, ",{:?},{:?},{}", r.log_prior, r.log_likelihood, r.step);
        for x in &row.values {
            let _ = write!(self.line, ",{x:?}");
        }
        self.line.push('\n');
        self.written += self.line.len() as u64;
        self.out.write_all(self.line.as_bytes())
    }

    fn chain_done(&mut self, _chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()> {
        let text = format!(
            "# steps = {steps}\n# warmup_steps = {warmup}\n# Elapsed Time: {seconds:.3} seconds (Total)\n"
        );
        self.out.write_all(text.as_bytes())?;
        self.out.flush()
    }
}

/// Returns the name of every column of the file, with the elements of vectors one by one.
///
/// In ArviZ a `.` starts an index and a trailing `__` marks a statistic of the sampler,
/// and neither ArviZ nor CmdStan supports quotes. Therefore `.` becomes `/`, a comma `;`,
/// white space and quotes `_`, and a name that ends in `__` gets a trailing `/`. Names
/// that become equal get the suffixes `/2`, `/3`, ….
pub fn column_names(columns: &[Column]) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut names = Vec::new();
    for column in columns {
        let wanted = csv_safe(&column.name);
        let mut name = wanted.clone();
        let mut copies = 1;
        while !taken.insert(name.clone()) {
            copies += 1;
            name = format!("{wanted}/{copies}");
        }
        match column.shape {
            Shape::Scalar => names.push(name),
            Shape::Vector(n) => names.extend((1..=n).map(|i| format!("{name}.{i}"))),
        }
    }
    names
}

fn csv_safe(name: &str) -> String {
    let mut out: String = name
        .chars()
        .map(|c| match c {
            '.' => '/',
            ',' => ';',
            c if c.is_whitespace() || c.is_control() || c == '"' => '_',
            c => c,
        })
        .collect();
    if out.is_empty() || out.starts_with('#') {
        out.insert(0, '_');
    }
    if out.ends_with("__") {
        out.push('/');
    }
    out
}

/// Returns these columns under the names that they have in a file.
pub(crate) fn as_written(wanted: &[Column]) -> Vec<Column> {
    columns(&column_names(wanted).iter().map(String::as_str).collect::<Vec<_>>())
}

/// Returns the columns of a line of names: the inverse of [`column_names`] for names that
/// it did not change.
pub(super) fn columns(names: &[&str]) -> Vec<Column> {
    let mut columns: Vec<Column> = Vec::new();
    for name in names {
        let element =
            name.rsplit_once('.').and_then(|(base, i)| Some((base, i.parse::<usize>().ok()?)));
        match (element, columns.last_mut()) {
            (Some((base, i)), Some(Column { name, shape: Shape::Vector(n) }))
                if name == base && i == *n + 1 =>
            {
                *n = i
            }
            (Some((base, 1)), _) => columns.push(Column::vector(base, 1)),
            _ => columns.push(Column::scalar(*name)),
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// Records the total length after every call to `write`.
    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<(Vec<u8>, Vec<usize>)>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut inner = self.0.lock().unwrap();
            inner.0.extend(bytes);
            let end = inner.0.len();
            inner.1.push(end);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn row(draw: u64, values: Vec<f64>) -> DrawRow {
        let x = draw as f64 / 3.0;
        let (log_joint, log_prior, log_likelihood) = (-x, 0.5 - x, -0.5);
        let (acceptance, divergent) = (0.25, draw % 2);
        DrawRow {
            chain: 2,
            draw,
            step: 10 * draw,
            log_joint,
            log_prior,
            log_likelihood,
            acceptance,
            divergent,
            values,
        }
    }

    const ODD: [f64; 8] = [
        0.1,
        -0.0,
        5e-324,
        f64::MAX,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        1.000_000_000_000_000_2,
    ];

    #[test]
    fn readable_after_every_call_and_bit_for_bit() {
        let shared = Shared::default();
        let mut sink =
            CsvSink::new(shared.clone(), 2, &[("seed", "7".into()), ("program", "a\nb".into())])
                .unwrap();
        let columns = [Column::vector("v", 7), Column::scalar("a/b")];
        sink.columns(&columns).unwrap();
        for draw in 0..5 {
            sink.draw(&row(draw, ODD.to_vec())).unwrap();
        }
        sink.chain_done(2, 40, 10, 1.25).unwrap();
        let (bytes, ends) = shared.0.lock().unwrap().clone();
        assert_eq!(ends.len(), 8, "one call for the head, the names, each draw and the end");
        for (i, end) in ends.iter().enumerate() {
            let chain = read(std::str::from_utf8(&bytes[..*end]).unwrap()).unwrap();
            assert_eq!(chain.rows.len(), i.saturating_sub(1).min(5));
        }
        let chain = read(std::str::from_utf8(&bytes).unwrap()).unwrap();
        assert_eq!(chain.columns, columns);
        for (draw, back) in chain.rows.iter().enumerate() {
            let wrote = row(draw as u64, ODD.to_vec());
            let bits = |r: &DrawRow| r.values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(back), bits(&wrote));
            assert_eq!((back.log_joint, back.log_prior), (wrote.log_joint, wrote.log_prior));
            assert_eq!((back.chain, back.draw, back.step), (2, wrote.draw, wrote.step));
            assert_eq!((back.acceptance, back.divergent), (wrote.acceptance, wrote.divergent));
        }
        let said =
            |key: &str| chain.comments.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str());
        assert_eq!(
            (said("seed"), said("program"), said("steps")),
            (Some("7"), Some("a b"), Some("40"))
        );
    }

    #[test]
    fn a_row_of_the_wrong_width_is_refused_and_leaves_no_trace() {
        let shared = Shared::default();
        let mut sink = CsvSink::new(shared.clone(), 0, &[]).unwrap();
        assert!(sink.draw(&row(0, vec![])).is_err());
        sink.columns(&[Column::scalar("x")]).unwrap();
        let before = shared.0.lock().unwrap().0.clone();
        assert!(sink.draw(&row(0, vec![1.0, 2.0])).is_err());
        assert_eq!(shared.0.lock().unwrap().0, before);
    }

    #[test]
    fn names_survive_the_way_there_and_back() {
        let wanted = [
            Column::scalar("a/b"),
            Column::vector("v", 3),
            Column::vector("w", 1),
            Column::scalar("f(x;y)"),
        ];
        let names = column_names(&wanted);
        assert_eq!(names, ["a/b", "v.1", "v.2", "v.3", "w.1", "f(x;y)"]);
        assert_eq!(columns(&names.iter().map(String::as_str).collect::<Vec<_>>()), wanted);
    }

    #[test]
    fn what_would_break_a_reader_is_replaced() {
        let odd = ["a.b", "f(x, y)", "# c", "", "lp__", "a/b", "q\"\n"].map(Column::scalar);
        assert_eq!(column_names(&odd), ["a/b", "f(x;_y)", "_#_c", "_", "lp__/", "a/b/2", "q__/"]);
    }

    #[test]
    fn empty_vectors_have_no_columns() {
        assert_eq!(column_names(&[Column::vector("v", 0), Column::scalar("x")]), ["x"]);
    }
}
