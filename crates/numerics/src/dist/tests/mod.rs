//! Tests across families: samplers, gradients, transforms, normalisation, edges. Values
//! of log densities are checked in `tests/numbers/dist_reference.rs`.

mod edges;
mod gaussian;
mod gradients;
mod matrices;
mod mixtures;
mod normalisation;
mod samplers;
mod transforms;
mod truncated;

use super::*;
use crate::rng::{Purpose, Stream, StreamKey};
use std::sync::Arc;

/// Returns a separate random stream for each test.
fn stream(site: u64) -> Stream {
    StreamKey::new(20, 0, Purpose::VALUES).stream(0, site, 0)
}

const INF: f64 = f64::INFINITY;

/// Returns a square matrix from its entries by rows.
fn square(n: usize, entries: &[f64]) -> nalgebra::DMatrix<f64> {
    nalgebra::DMatrix::from_row_slice(n, n, entries)
}

/// Creates a distribution by name.
fn make(family: &str, p: &[f64]) -> Dist {
    try_make(family, p).unwrap()
}

fn try_make(family: &str, p: &[f64]) -> Result<Dist, ParamError> {
    Ok(match family {
        "normal" => Dist::Normal(Normal::new(p[0], p[1])?),
        "lognormal" => Dist::LogNormal(LogNormal::new(p[0], p[1])?),
        "uniform" => Dist::Uniform(Uniform::new(p[0], p[1])?),
        "beta" => Dist::Beta(Beta::new(p[0], p[1])?),
        "gamma" => Dist::Gamma(Gamma::new(p[0], p[1])?),
        "exponential" => Dist::Exponential(Exponential::new(p[0])?),
        "half_normal" => Dist::HalfNormal(HalfNormal::new(p[0])?),
        "half_cauchy" => Dist::HalfCauchy(HalfCauchy::new(p[0], p[1])?),
        "student_t" => Dist::StudentT(StudentT::new(p[0], p[1], p[2])?),
        "truncated_normal" => {
            Dist::TruncatedNormal(Arc::new(TruncatedNormal::new(p[0], p[1], p[2], p[3])?))
        }
        "inv_gamma" => Dist::InvGamma(InvGamma::new(p[0], p[1])?),
        "cauchy" => Dist::Cauchy(Cauchy::new(p[0], p[1])?),
        "laplace" => Dist::Laplace(Laplace::new(p[0], p[1])?),
        "von_mises" => Dist::VonMises(VonMises::new(p[0], p[1])?),
        "weibull" => Dist::Weibull(Weibull::new(p[0], p[1])?),
        "neg_binomial" => Dist::NegBinomial(NegBinomial::new(p[0], p[1])?),
        "geometric" => Dist::Geometric(Geometric::new(p[0])?),
        "flat" => Dist::Flat(match p {
            [] => Flat::default(),
            p => Flat::new(p[0], p[1])?,
        }),
        "multinomial" => Dist::Multinomial(Arc::new(Multinomial::new(p[0], &p[1..])?)),
        "lkj" => Dist::Lkj(Arc::new(Lkj::new(p[0], p[1])?)),
        "flip" => Dist::Flip(Flip::new(p[0])?),
        "uniform_discrete" => Dist::UniformDiscrete(UniformDiscrete::new(p[0], p[1])?),
        "binomial" => Dist::Binomial(Binomial::new(p[0], p[1])?),
        "poisson" => Dist::Poisson(Poisson::new(p[0])?),
        "categorical" => Dist::Categorical(Categorical::new(p)?),
        "dirichlet" => Dist::Dirichlet(Arc::new(Dirichlet::new(p)?)),
        other => panic!("no family {other}"),
    })
}

/// Returns all numbers in a value, in order.
fn numbers(x: &Datum) -> Vec<f64> {
    match x {
        Datum::Num(x) => vec![*x],
        Datum::Vec(xs) => xs.to_vec(),
        Datum::List(xs) => xs.iter().flat_map(numbers).collect(),
        Datum::Bool(_) => Vec::new(),
    }
}
