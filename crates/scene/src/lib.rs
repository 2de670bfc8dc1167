//! The scene of `pcadlang`: geometry, drawing on the CPU, and the evidence of images. It
//! knows nothing of programs and traces, and can be used without them.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod cameras;
mod contours;
pub mod geom;
pub mod render;
pub mod vision;
