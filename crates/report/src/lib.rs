//! The output of a run: draws as CmdStan CSV, a run directory, pictures, tables, and a
//! page that shows all of it.
//!
//! This module neither prints nor makes decisions; it turns results into text and files.
//! It depends on draws, diagnostics, meshes and drawn pictures, but not on programs or
//! traces.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod aligned;
mod atomic_write;
pub mod checkpoint;
pub mod csv;
mod draws;
pub mod embedded;
pub mod evaluation;
pub mod film;
pub mod html;
pub mod inference;
mod modes;
mod moments;
pub mod pictures;
mod rundir;
mod sinks;
pub mod svg;
pub mod table;
mod warnings;
pub mod zarr;

pub use aligned::{align, rename, reread};
pub use atomic_write::write_file;
pub use checkpoint::{bytes_hash, text_hash};
pub use draws::widen;
pub use draws::{ChainDraws, Frequent, Quantity, mark_categories, quantities};
pub use modes::{DISAGREE, Mode, modes, modes_table};
pub use moments::{Moments, Point};
pub use pcadlang_inference::diagnostics::Summary;
pub use rundir::{RunDir, RunDirError};
pub use sinks::{ChainFile, ChainFiles, Memory, Tee};
pub use table::{number, r_hat_text, seconds};
pub use warnings::warnings;
