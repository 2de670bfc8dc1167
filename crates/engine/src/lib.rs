//! The language and its traces.
//!
//! [`lang`] lowers programs to code and has the one table of built-ins; [`trace`] executes
//! code into addressed traces of random choices. Neither knows anything of pictures.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod lang;
#[cfg(test)]
mod testing;
pub mod trace;

// The helpers of unit tests are shared with the crate above.
#[cfg(test)]
extern crate self as pcadlang_engine;
#[cfg(test)]
fn table() -> lang::builtins::Table {
    lang::builtins::Table::default()
}
