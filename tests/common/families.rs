//! Distributions by name and parameters, for tables of reference values (`tests/data`).

use pcadlang::dist::*;
use std::sync::Arc;

/// Returns the distribution of a family, with its parameters in the order of the tables
/// of reference values.
pub fn made(family: &str, p: &[f64]) -> Dist {
    match (family, p) {
        ("normal", [a, b]) => Dist::Normal(Normal::new(*a, *b).unwrap()),
        ("lognormal", [a, b]) => Dist::LogNormal(LogNormal::new(*a, *b).unwrap()),
        ("uniform", [a, b]) => Dist::Uniform(Uniform::new(*a, *b).unwrap()),
        ("beta", [a, b]) => Dist::Beta(Beta::new(*a, *b).unwrap()),
        ("gamma", [a, b]) => Dist::Gamma(Gamma::new(*a, *b).unwrap()),
        ("exponential", [a]) => Dist::Exponential(Exponential::new(*a).unwrap()),
        ("half_normal", [a]) => Dist::HalfNormal(HalfNormal::new(*a).unwrap()),
        ("half_cauchy", [a, b]) => Dist::HalfCauchy(HalfCauchy::new(*a, *b).unwrap()),
        ("student_t", [a, b, c]) => Dist::StudentT(StudentT::new(*a, *b, *c).unwrap()),
        ("truncated_normal", [m, s, lo, hi]) => {
            Dist::TruncatedNormal(Arc::new(TruncatedNormal::new(*m, *s, *lo, *hi).unwrap()))
        }
        (name, [lo, hi, p @ ..]) if name.starts_with("truncated:") => {
            truncated(&made(&name["truncated:".len()..], p), *lo, *hi).unwrap()
        }
        ("inv_gamma", [a, b]) => Dist::InvGamma(InvGamma::new(*a, *b).unwrap()),
        ("cauchy", [a, b]) => Dist::Cauchy(Cauchy::new(*a, *b).unwrap()),
        ("laplace", [a, b]) => Dist::Laplace(Laplace::new(*a, *b).unwrap()),
        ("von_mises", [a, b]) => Dist::VonMises(VonMises::new(*a, *b).unwrap()),
        ("weibull", [a, b]) => Dist::Weibull(Weibull::new(*a, *b).unwrap()),
        ("neg_binomial", [a, b]) => Dist::NegBinomial(NegBinomial::new(*a, *b).unwrap()),
        ("geometric", [a]) => Dist::Geometric(Geometric::new(*a).unwrap()),
        ("multinomial", [n, w @ ..]) => {
            Dist::Multinomial(Arc::new(Multinomial::new(*n, w).unwrap()))
        }
        ("lkj", [n, eta]) => Dist::Lkj(Arc::new(Lkj::new(*n, *eta).unwrap())),
        ("wishart", [df, scale @ ..]) => {
            let scale = nalgebra::DMatrix::from_row_slice(3, 3, scale);
            Dist::Wishart(Arc::new(Wishart::new(*df, &scale).unwrap()))
        }
        ("uniform_discrete", [a, b]) => {
            Dist::UniformDiscrete(UniformDiscrete::new(*a, *b).unwrap())
        }
        ("binomial", [a, b]) => Dist::Binomial(Binomial::new(*a, *b).unwrap()),
        ("poisson", [a]) => Dist::Poisson(Poisson::new(*a).unwrap()),
        ("categorical", p) => Dist::Categorical(Categorical::new(p).unwrap()),
        ("mixture", [a, b, parts @ ..]) => {
            let parts: Vec<Dist> = parts.chunks(2).map(|p| made("normal", p)).collect();
            Dist::Mixture(Arc::new(Mixture::new(&[*a, *b], parts).unwrap()))
        }
        ("dirichlet", p) => Dist::Dirichlet(Arc::new(Dirichlet::new(p).unwrap())),
        other => panic!("unknown family {other:?}"),
    }
}

/// Returns the value with these numbers; a matrix has rows of three.
pub fn datum(family: &str, x: &[f64]) -> Datum {
    match x {
        [x] => Datum::Num(*x),
        rows if matches!(family, "lkj" | "wishart") => {
            Datum::List(rows.chunks(3).map(|r| r.to_vec().into()).collect())
        }
        _ => x.to_vec().into(),
    }
}
