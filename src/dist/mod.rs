//! Distributions: what a random choice draws from and an observation scores with.
//!
//! Everything is in log space, defined at the edges of the support and in the tails, and never NaN: a density is -inf off
//! the support. Parameters are checked when a distribution is made. Knows nothing of programs or traces.

mod beta;
mod binomial;
mod categorical;
mod covariance;
mod datum;
mod dirichlet;
mod dispatch;
mod exponential;
mod families;
mod flip;
mod gamma;
mod gp;
mod half_cauchy;
mod half_normal;
mod iid;
mod lognormal;
mod mv_normal;
mod normal;
mod param;
mod poisson;
mod product;
mod student_t;
mod support;
mod transform;
mod uniform;
mod uniform_discrete;

pub use beta::Beta;
pub use binomial::Binomial;
pub use categorical::Categorical;
pub use covariance::Covariance;
pub use datum::Datum;
pub use dirichlet::Dirichlet;
pub use dispatch::Dist;
pub use exponential::Exponential;
pub use families::{FAMILIES, Family, ParamDoc};
pub use flip::Flip;
pub use gamma::Gamma;
pub use gp::Gp;
pub use half_cauchy::HalfCauchy;
pub use half_normal::HalfNormal;
pub use iid::Iid;
pub use lognormal::LogNormal;
pub use mv_normal::MvNormal;
pub use normal::Normal;
pub use param::ParamError;
pub use poisson::Poisson;
pub use product::Product;
pub use student_t::StudentT;
pub use support::Support;
pub use uniform::Uniform;
pub use uniform_discrete::UniformDiscrete;

use crate::rng::Stream;
use std::fmt;

/// The derivative of a log density.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// By the drawn value, flattened; empty if it is discrete.
    pub x: Vec<f64>,
    /// By each parameter, in the order of the constructor, flattened.
    pub params: Vec<f64>,
}

/// A distribution: sampler, log density, support, gradient.
pub trait Distribution: fmt::Debug + Send + Sync {
    /// What programs call it.
    fn name(&self) -> &'static str;
    /// Where its values lie.
    fn support(&self) -> Support;
    /// Draws a value.
    fn sample(&self, rng: &mut Stream) -> Datum;
    /// The log density or log probability; -inf off the support, for NaN, and for a datum of another kind.
    fn log_density(&self, x: &Datum) -> f64;
    /// The derivative of the log density at a point inside the support; `None` outside.
    fn gradient(&self, x: &Datum) -> Option<Gradient>;
}

/// The number in a datum, NaN for anything else: a density of NaN is -inf.
fn number(x: &Datum) -> f64 {
    match x {
        Datum::Num(x) => *x,
        _ => f64::NAN,
    }
}
