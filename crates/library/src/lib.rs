//! Programs, models and posteriors; the module `scene` of programs; the shipped programs.

#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod model;
pub mod scene;
pub mod shipped;
pub mod standard;

pub use model::{Model, Posterior, Program};
