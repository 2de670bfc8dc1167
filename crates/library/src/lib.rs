//! Programs, models and posteriors; the module `scene` of programs; the shipped programs.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod model;
pub mod scene;
pub mod shipped;
pub mod standard;

pub use model::{Model, Posterior, Program, Started};
