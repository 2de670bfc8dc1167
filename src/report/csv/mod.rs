//! Draws of one chain as CSV in the form CmdStan writes, which ArviZ (`from_cmdstan`), posterior and CmdStan's own tools
//! open.
//!
//! Comment lines (`# key = value`), one line of column names, one line a draw. Columns that end in `__` are about the
//! draw: `lp__` (log joint), `log_prior__`, `log_likelihood__`, `step__`; then the recorded quantities, the elements of a
//! vector as `name.1, name.2, …`. Numbers are written so that reading gives the same bits back.
//!
//! Invariant: the file is readable at any moment, for every line is handed to the system in one call; the reader leaves
//! out a last line without its end.

mod names;
mod read;
mod stream;
mod write;

pub use names::column_names;
pub use read::{CsvError, read};
pub use stream::{DrawReader, StreamError};
pub use write::CsvSink;

/// The columns about the draw itself, which come first.
pub(crate) const DRAW_COLUMNS: [&str; 4] = ["lp__", "log_prior__", "log_likelihood__", "step__"];
