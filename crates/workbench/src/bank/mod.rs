//! Banks: files of scenes drawn from a program's prior, each with its latents and with
//! features of its picture. The kernel `knn` uses them to find scenes that look like the
//! observed picture (Kulkarni et al. 2014, section 3: q_data).
//!
//! `learn` makes a bank, `Bank` reads one, and `BankFiles` serves the banks of a run.
//! This module joins the features of `vision` with the proposals of `infer`. Invariants:
//! entry `i` is a function of the program, the seed and `i`; a file is either complete or
//! absent.

mod command;
mod error;
mod features;
mod files;
mod format;
mod join;
mod learn;
mod read;
mod record;
mod write;

pub use error::BankError;
pub use features::{Features, Observed};
pub use files::BankFiles;
pub use format::Header;
pub use join::join;
pub use learn::{Learn, learn};
pub use read::Bank;
pub use record::{Entry, Named};
