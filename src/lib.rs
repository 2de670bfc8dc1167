//! `pcadlang`: a probabilistic CAD language.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

pub mod diag;
pub mod dist;
pub mod geom;
pub mod infer {
    //! Draws and diagnostics.
    pub mod diagnostics;
    pub mod draws;
}
pub mod num;
pub mod render;
pub mod rng;
//pub mod syntax;
pub mod vision;
