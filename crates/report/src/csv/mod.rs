//! Draws of one chain as CSV in CmdStan's format, which `cmdstanpy.from_csv`,
//! `rstan::read_stan_csv`, cmdstanr and ArviZ 0.x (`from_cmdstan`) can read.
//!
//! A file has comment lines (`# key = value`), a line of column names, and a line per
//! draw. When a draw has new columns, the line of names is repeated with them; at the end
//! of a run, all chains are brought to the same columns. Columns that end in `__` are
//! about the draw: `lp__` (log joint density), `accept_stat__` (acceptance rate since the
//! last draw), `divergent__` (divergent trajectories since the last draw), `log_prior__`,
//! `log_likelihood__`, `step__`. The recorded quantities follow, with the elements of an
//! array as `name.1, name.2, …`, of two dimensions as `name.1.1, name.2.1, …`. Texts are
//! numbers of categories, counted from 0; a comment before the line of names lists them
//! (`# levels of kind: ["cup", "vase"]`, in JSON without `=`). Numbers are written so that
//! reading them gives the same bits.
//!
//! `num_samples` and `num_warmup` are known when a run ends ([`with_counts`]) and 0 until then.
//!
//! Invariant: the file is readable at any moment, because every line is passed to the
//! system in one call and the reader leaves out an incomplete last line.

mod names;
mod read;

pub(crate) use names::as_written;
pub use names::column_names;
pub(crate) use read::Contents;
pub use read::{CsvError, DrawReader, read};

use pcadlang_inference::draws::{Column, DrawRow, Sink, width};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::time::Instant;

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
    /// The order in which they are written, if it is another.
    order: Option<Vec<usize>>,
    begun: Instant,
    /// The time to the first draw, in seconds.
    warm: f64,
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
        let order = columns.and_then(names::file_order);
        CsvSink { width: columns.map(width), order, written, ..CsvSink::bare(file) }
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
        let mut text = format!(
            "# model = pcadlang\n# method = sample\n# pcadlang_version = {}\n# id = {}\n",
            env!("CARGO_PKG_VERSION"),
            u64::from(chain) + 1
        );
        for (key, value) in comments {
            let value = value.replace(|c: char| c.is_control(), " ");
            let _ = writeln!(text, "# {key} = {value}");
        }
        // R finds these by their words, of which the last place counts.
        for count in COUNTS {
            text += &counted(count, 0);
        }
        text += "# save_warmup = 0\n# thin = 1\n";
        out.write_all(text.as_bytes())?;
        let written = text.len() as u64;
        Ok(CsvSink { comments: text, written, ..CsvSink::bare(out) })
    }

    /// Creates a sink whose output begins with the line of names.
    pub(crate) fn bare(out: W) -> Self {
        CsvSink {
            out,
            comments: String::new(),
            width: None,
            order: None,
            begun: Instant::now(),
            warm: 0.0,
            line: String::new(),
            written: 0,
        }
    }

    /// Writes comments after the draws, and flushes the writer.
    ///
    /// # Errors
    /// Returns an error if the output cannot be written.
    pub(crate) fn end(&mut self, comments: &str) -> io::Result<()> {
        self.out.write_all(comments.as_bytes())?;
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
        let mut line = String::new();
        for c in as_written(columns).iter().filter(|c| !c.levels.is_empty()) {
            line += &levels_of(c);
        }
        line += &names.collect::<Vec<_>>().join(",");
        line.push('\n');
        if self.width.is_none() {
            self.warm = self.begun.elapsed().as_secs_f64();
        }
        (self.width, self.order) = (Some(width(columns)), names::file_order(columns));
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
        let places = self.order.iter().flatten().copied();
        let other = places.filter_map(|i| row.values.get(i));
        let same = row.values.iter().filter(|_| self.order.is_none());
        for x in same.chain(other) {
            let _ = write!(self.line, ",{x:?}");
        }
        self.line.push('\n');
        self.written += self.line.len() as u64;
        self.out.write_all(self.line.as_bytes())
    }

    fn chain_done(&mut self, _chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()> {
        let warm = self.warm.min(seconds);
        let rest = seconds - warm;
        let text = format!(
            "# steps = {steps}\n# warmup_steps = {warmup}\n# \n#  Elapsed Time: {warm:.3} seconds (Warm-up)\n\
             #                {rest:.3} seconds (Sampling)\n#                {seconds:.3} seconds (Total)\n# \n"
        );
        self.out.write_all(text.as_bytes())?;
        self.out.flush()
    }
}

/// The counts at the head of a file that are known at the end of the run.
const COUNTS: [&str; 2] = ["num_warmup", "num_samples"];

/// The line of a count, equally long for all counts.
fn counted(key: &str, n: u64) -> String {
    format!("# {key} = {n:<20}\n")
}

/// Returns the comments at the head of a file with the number of steps of the warm-up and of
/// draws; the length stays the same. Comments of older versions, without counts, stay as they
/// are. Without a warm-up the number is 1, for the start: CmdStanPy refuses 0.
pub(crate) fn with_counts(head: &str, warmup: u64, draws: u64) -> String {
    let line = |line: &str| {
        let key = line.strip_prefix("# ").and_then(|l| l.split_once(" = ")).map(|(key, _)| key);
        match COUNTS.iter().position(|count| Some(*count) == key) {
            Some(i) => counted(COUNTS[i], [warmup.max(1), draws][i]),
            None => format!("{line}\n"),
        }
    };
    head.lines().map(line).collect()
}

/// The comment with the texts of a column.
fn levels_of(c: &Column) -> String {
    let json = serde_json::json!(c.levels).to_string().replace('=', "\\u003d");
    format!("# levels of {}: {json}\n", c.name)
}

/// The name and the texts in such a comment, without its `#`.
fn levels_in(comment: &str) -> Option<(&str, Vec<String>)> {
    let (name, json) = comment.strip_prefix(" levels of ")?.split_once(": ")?;
    Some((name, serde_json::from_str(json).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_inference::draws::Shape;
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
        let columns = [Column::vector("v", 7), Column::scalar("a_b")];
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
    fn arrays_and_texts_come_back() {
        let texts = ["a = b, \"c\"\n", "vase"].map(str::to_owned).to_vec();
        let columns = [
            Column::new("R", Shape::Array(vec![2, 3])),
            Column { levels: texts, ..Column::scalar("kind") },
        ];
        let shared = Shared::default();
        let mut sink = CsvSink::new(shared.clone(), 0, &[]).unwrap();
        sink.columns(&columns).unwrap();
        let values = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1.0];
        sink.draw(&row(0, values.clone())).unwrap();
        sink.chain_done(0, 1, 0, 0.5).unwrap();
        let bytes = shared.0.lock().unwrap().0.clone();
        let text = std::str::from_utf8(&bytes).unwrap();
        assert!(text.contains(",R.1.1,R.2.1,R.1.2,R.2.2,R.1.3,R.2.3,kind\n"));
        assert!(text.contains(",1.0,4.0,2.0,5.0,3.0,6.0,1.0\n"), "the first index changes first");
        assert!(text.contains("# levels of kind: [\"a \\u003d b, \\\"c\\\"\\n\",\"vase\"]\n"));
        let chain = read(text).unwrap();
        assert_eq!((&chain.columns[..], &chain.rows[0].values), (&columns[..], &values));
    }

    #[test]
    fn counts_are_filled_in_without_moving_anything() {
        let mut sink =
            CsvSink::new(Vec::new(), 0, &[("program", "num_samples = 7".into())]).unwrap();
        sink.columns(&[]).unwrap();
        let head = sink.comments().to_owned();
        let filled = with_counts(&head, 12, 345);
        assert_eq!(filled.len(), head.len());
        let line = |key: &str| {
            filled.lines().find(|l| l.starts_with(&format!("# {key} ="))).map(str::trim_end)
        };
        assert_eq!(line("num_samples"), Some("# num_samples = 345"));
        assert_eq!(line("num_warmup"), Some("# num_warmup = 12"));
        assert_eq!(line("program"), Some("# program = num_samples = 7"));
        assert_eq!(with_counts("# id = 1\n", 1, 2), "# id = 1\n", "an older file");
    }
}
