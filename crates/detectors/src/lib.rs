//! The networks with which `pcadlang` finds people in photographs: a reader and
//! interpreter of their files, and what makes people of their outputs.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod nn;
pub mod people;
mod weights;
