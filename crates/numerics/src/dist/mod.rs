//! Probability distributions: sampling, log densities, and the supports of their values.
//!
//! This module is independent of programs, traces and images. Parameters are checked when
//! a distribution is made, so that everything after that is total: a log density is -inf
//! off the support (including values of the wrong kind) and never NaN.

mod batch;
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
mod param;
mod scalar;
mod support;
mod tails;
mod transform;

pub use batch::{Batch, batch};
pub use continuous::beta::Beta;
pub use continuous::cauchy::Cauchy;
pub use continuous::exponential::Exponential;
pub use continuous::flat::Flat;
pub use continuous::gamma::Gamma;
pub use continuous::half_cauchy::HalfCauchy;
pub use continuous::half_normal::HalfNormal;
pub use continuous::inv_gamma::InvGamma;
pub use continuous::laplace::Laplace;
pub use continuous::lognormal::LogNormal;
pub use continuous::normal::Normal;
pub use continuous::student_t::StudentT;
pub use continuous::truncated::{Truncated, truncated};
pub use continuous::truncated_normal::TruncatedNormal;
pub use continuous::uniform::Uniform;
pub use continuous::von_mises::VonMises;
pub use continuous::weibull::Weibull;
pub use datum::Datum;
pub use discrete::binomial::Binomial;
pub use discrete::categorical::Categorical;
pub use discrete::flip::Flip;
pub use discrete::geometric::Geometric;
pub use discrete::multinomial::Multinomial;
pub use discrete::neg_binomial::NegBinomial;
pub use discrete::poisson::Poisson;
pub use discrete::uniform_discrete::UniformDiscrete;
pub use distribution::{Distribution, Gradient};
pub use families::{Dist, FAMILIES};
pub use family::{Family, Named, Numbers, ParamDoc, ParamKind};
pub use joint::covariance::Covariance;
pub use joint::dirichlet::Dirichlet;
pub use joint::factor::Factor;
pub use joint::gp::{Gp, JITTER};
pub use joint::iid::Iid;
pub use joint::lkj::Lkj;
pub use joint::mixed::batch_of_mixture;
pub use joint::mixture::Mixture;
pub use joint::mv_normal::MvNormal;
pub use joint::ordered::Ordered;
pub use joint::product::Product;
pub use joint::wishart::Wishart;
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
