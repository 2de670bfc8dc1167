//! The networks with which `pcadlang` finds people and objects in photographs: readers and an
//! interpreter of their files, and what makes people and objects of their outputs.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod boxes;
pub mod nn;
pub mod objects;
pub mod people;
mod shared;
mod weights;
