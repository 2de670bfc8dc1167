//! `pcadlang`: a probabilistic CAD language. A program draws a scene from a prior; the engine samples the scenes that
//! explain a photograph.
//!
//! [`Program`] and [`Model`] are the way in; [`trace::Trace`] is the engine's one data structure. Modules depend one way:
//! `syntax`, `dist`, `geom`, `render` and `vision` know nothing of traces, `infer` knows nothing of pictures.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod bank;
pub mod diag;
pub mod dist;
pub mod geom;
pub mod infer;
pub mod lang;
mod model;
pub mod num;
pub mod render;
pub mod report;
pub mod rng;
pub mod session;
pub mod syntax;
pub mod trace;
pub mod vision;

pub use infer::RunOptions;
pub use model::{Error, Model, Posterior, Program};
