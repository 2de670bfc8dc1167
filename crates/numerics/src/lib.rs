//! The numerics of `pcadlang`: distributions, special functions, exact sums, least
//! squares, counter-based randomness, and parallel maps. It knows nothing of programs or images.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod dist;
pub mod elimination;
pub mod least_squares;
pub mod num;
pub mod platform;
pub mod rng;
