//! Banks: scenes drawn from a program's prior, each with its latents and with features of
//! its picture, in a file. They tell the kernel `knn` which scenes look like the observed
//! picture (Kulkarni et al. 2014, section 3: q_data).
//!
//! `learn` makes a bank, `Bank` reads one, `BankFiles` answers a run. Features are
//! `vision`'s, proposals `infer`'s; here is what joins them. Invariants: entry `i` is a
//! function of program, seed and `i`; a file is whole or absent.

mod command;
mod error;
mod features;
mod files;
mod format;
mod learn;
mod read;
mod record;
mod view;
mod write;

pub use error::BankError;
pub use features::{Features, Observed};
pub use files::BankFiles;
pub use format::Header;
pub use learn::{Learn, learn};
pub use read::Bank;
pub use record::{Entry, Named};
pub use view::{as_view, picture};
