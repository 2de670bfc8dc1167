//! What a run leaves behind: draws as CmdStan CSV, a run directory, pictures, tables, and a page that shows all of it.
//!
//! Nothing here prints or decides; it turns results into text and files. It knows draws, diagnostics and plain pixel
//! buffers, not programs, traces or the renderer.

mod chain_file;
pub mod checkpoint;
pub mod csv;
mod draws;
pub mod evaluation;
mod hash;
pub mod html;
mod modes;
mod moments;
pub mod npy;
mod number;
pub mod pictures;
mod rundir;
mod sinks;
pub mod table;
mod warnings;
mod whole;

pub use chain_file::ChainFile;
pub use draws::{ChainDraws, Quantity, quantities};
pub use hash::{bytes_hash, text_hash};
pub use modes::{DISAGREE, Mode, modes, modes_table, r_hat_text};
pub use moments::{Moments, Point};
pub use number::{number, seconds};
pub use rundir::{RunDir, RunDirError};
pub use sinks::{Memory, Tee};
pub use warnings::warnings;
pub use whole::write_file;
