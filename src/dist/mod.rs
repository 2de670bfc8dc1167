//! Probability distributions: what they draw, how they score it, the spaces their values
//! live in.
//!
//! Nothing here knows of programs, traces or images. Parameters are checked when a
//! distribution is made, so that everything after that is total: a log density is -inf
//! off the support (a value of the wrong kind included) and never NaN.

mod ascending;
mod batch;
mod beta;
mod binomial;
mod categorical;
mod cauchy;
mod covariance;
mod datum;
mod dirichlet;
#[allow(clippy::module_inception)]
mod dist;
mod distribution;
mod draw;
mod exponential;
mod factor;
mod families;
mod flat;
mod flip;
mod gamma;
mod gaussian;
mod geometric;
mod gp;
mod half_cauchy;
mod half_normal;
mod iid;
mod interval;
mod inv_gamma;
mod laplace;
mod lkj;
mod lognormal;
mod mixed;
mod mixture;
mod multinomial;
mod mv_normal;
mod neg_binomial;
mod normal;
mod ordered;
mod param;
mod poisson;
mod product;
mod reverse;
mod scalar;
mod student_t;
mod support;
mod tails;
mod transform;
mod triangle;
mod truncated;
mod truncated_normal;
mod uniform;
mod uniform_discrete;
mod von_mises;
mod weibull;
mod wishart;

pub use batch::{Batch, batch};
pub use beta::Beta;
pub use binomial::Binomial;
pub use categorical::Categorical;
pub use cauchy::Cauchy;
pub use covariance::Covariance;
pub use datum::Datum;
pub use dirichlet::Dirichlet;
pub use dist::Dist;
pub use distribution::{Distribution, Gradient};
pub use exponential::Exponential;
pub(crate) use factor::Factor;
pub use families::{FAMILIES, Family, ParamDoc};
pub use flat::Flat;
pub use flip::Flip;
pub use gamma::Gamma;
pub use geometric::Geometric;
pub use gp::{Gp, JITTER};
pub use half_cauchy::HalfCauchy;
pub use half_normal::HalfNormal;
pub use iid::Iid;
pub use inv_gamma::InvGamma;
pub use laplace::Laplace;
pub use lkj::Lkj;
pub use lognormal::LogNormal;
pub use mixed::batch_of_mixture;
pub use mixture::Mixture;
pub use multinomial::Multinomial;
pub use mv_normal::MvNormal;
pub use neg_binomial::NegBinomial;
pub use normal::Normal;
pub use ordered::Ordered;
pub use param::ParamError;
pub use poisson::Poisson;
pub use product::Product;
pub use scalar::{Scalar, Slope};
pub use student_t::StudentT;
pub use support::{MAX_ENUMERATED, Support};
pub use tails::{Speeds, Tails};
pub use truncated::{Truncated, truncated};
pub use truncated_normal::TruncatedNormal;
pub use uniform::Uniform;
pub use uniform_discrete::UniformDiscrete;
pub use von_mises::VonMises;
pub use weibull::Weibull;
pub use wishart::Wishart;

#[cfg(test)]
mod tests;
