//! Probability distributions: sampling, log densities, and the supports of their values.
//!
//! This module is independent of programs, traces and images. Parameters are checked when
//! a distribution is made, so that everything after that is total: a log density is -inf
//! off the support (including values of the wrong kind) and never NaN.

mod batch;
mod clamp;
mod continuous;
mod datum;
mod discrete;
#[allow(clippy::module_inception)]
mod dist;
mod distribution;
mod draw;
mod families;
mod family;
mod joint;
mod normals;
mod param;
mod pole;
mod scalar;
mod support;
mod tails;
mod transform;

pub use batch::{Batch, To, Weights};
pub use continuous::*;
pub use datum::Datum;
pub use discrete::*;
pub use distribution::{Distribution, Gradient};
pub use families::{Dist, FAMILIES};
pub use family::{Drawn, Family, Named, Numbers, ParamDoc, ParamKind};
pub use joint::*;
pub use normals::batch;
pub use param::ParamError;
pub use scalar::{Scalar, Slope};
pub use support::{MAX_ENUMERATED, Support};
pub use tails::{CdfSlopes, Tails};

// For the families, which import everything above.
use crate::rng::Stream;
use smallvec::smallvec;
use std::sync::Arc;

#[cfg(test)]
mod tests;
