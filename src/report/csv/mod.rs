//! Draws of one chain as CSV in the form CmdStan writes, which ArviZ (`from_cmdstan`),
//! posterior and CmdStan's own tools open.
//!
//! Comment lines (`# key = value`), one line of column names, one line a draw; where a
//! draw has columns that those before it lack, a line of names comes again, until the run
//! ends and all chains are brought to the same columns. Columns that end in `__` are
//! about the draw: `lp__` (log joint), `accept_stat__` (accepted proposals per proposal
//! since the last draw), `divergent__` (divergent trajectories since then),
//! `log_prior__`, `log_likelihood__`, `step__`; then the recorded quantities, the
//! elements of a vector as `name.1, name.2, …`. Numbers are written so that reading gives
//! the same bits back.
//!
//! Invariant: the file is readable at any moment, for every line is handed to the system
//! in one call; the reader leaves out a last line without its end.

mod names;
mod read;
mod stream;
mod write;

pub use names::column_names;
pub(crate) use read::named;
pub use read::{CsvError, read};
pub use stream::{DrawReader, StreamError};
pub use write::CsvSink;

/// The columns about the draw itself, which come first.
pub(crate) const DRAW_COLUMNS: [&str; 6] =
    ["lp__", "accept_stat__", "divergent__", "log_prior__", "log_likelihood__", "step__"];
