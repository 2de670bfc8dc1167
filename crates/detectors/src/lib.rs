//! The networks with which `pcadlang` finds people in photographs: a reader and
//! interpreter of their files, and what makes people of their outputs.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod nn;
pub mod people;
mod weights;
