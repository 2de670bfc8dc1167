//! `pcadlang`: a probabilistic CAD language.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod diag;
pub mod dist;
pub mod geom;
//pub mod infer;
pub mod lang;
pub mod num;
pub mod render;
pub mod report;
pub mod rng;
pub mod syntax;
pub mod trace;
pub mod vision;
