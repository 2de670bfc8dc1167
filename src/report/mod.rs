//! What a run leaves behind: draws as CmdStan CSV, a run directory, pictures, tables, and a page that shows all of it.
//!
//! Nothing here prints or decides; it turns results into text and files. It knows draws, diagnostics and plain pixel
//! buffers, not programs, traces or the renderer.

pub mod csv;
mod draws;
mod hash;
pub mod npy;
mod sinks;

pub use draws::{ChainDraws, Quantity, quantities};
pub use hash::text_hash;
pub use sinks::{Memory, Tee};
