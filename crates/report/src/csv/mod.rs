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
mod write;

pub(crate) use read::Contents;
pub use read::{CsvError, DrawReader, read};
pub(crate) use write::as_written;
pub use write::{CsvSink, column_names};

/// The columns about the draw itself, which come first.
pub(crate) const DRAW_COLUMNS: [&str; 6] =
    ["lp__", "accept_stat__", "divergent__", "log_prior__", "log_likelihood__", "step__"];
