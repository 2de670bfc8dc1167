//! The language and its traces.
//!
//! [`lang`] lowers programs to code and has the one table of built-ins; [`trace`] executes
//! code into addressed traces of random choices. Neither knows anything of pictures.

#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod lang;
pub mod trace;
