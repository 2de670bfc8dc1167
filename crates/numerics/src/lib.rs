//! The numerics of `pcadlang`: distributions, special functions, exact sums,
//! counter-based randomness, and parallel maps. It knows nothing of programs or images.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod dist;
pub mod num;
pub mod platform;
pub mod rng;
