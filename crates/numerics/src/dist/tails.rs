//! The log probabilities on both sides of a number, which truncation is based on.

use super::Dist;
use crate::num::{log_diff_exp, log_sum_exp};
use smallvec::SmallVec;

/// The logarithms of P(X <= x) and of P(X > x). Each is accurate where it is the smaller
/// one, however small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tails {
    /// ln P(X <= x).
    pub below: f64,
    /// ln P(X > x).
    pub above: f64,
}

/// One derivative per parameter.
pub type CdfSlopes = SmallVec<[f64; 3]>;

impl Tails {
    /// All of the probability lies below.
    pub const ALL_BELOW: Tails = Tails { below: 0.0, above: f64::NEG_INFINITY };
    /// None of the probability lies below.
    pub const NONE_BELOW: Tails = Tails { below: f64::NEG_INFINITY, above: 0.0 };

    /// Computes both from the logarithm of the probability below.
    pub fn from_below(below: f64) -> Tails {
        let below = below.min(0.0);
        Tails { below, above: log_diff_exp(0.0, below) }
    }

    /// Computes both from the logarithm of the probability above.
    pub fn from_above(above: f64) -> Tails {
        Tails::from_below(above).swapped()
    }

    /// Exchanges the two sides.
    pub fn swapped(self) -> Tails {
        Tails { below: self.above, above: self.below }
    }

    /// Returns the tails of a mixture from the logarithms of the normalised weights and
    /// the components' tails.
    fn mixed(all: &[(f64, Tails)]) -> Tails {
        let sum = |of: fn(&Tails) -> f64| {
            log_sum_exp(&all.iter().map(|(share, t)| share + of(t)).collect::<SmallVec<[f64; 8]>>())
                .min(0.0)
        };
        Tails { below: sum(|t| t.below), above: sum(|t| t.above) }
    }
}

/// Returns dP(X <= x)/da divided by the density at x, by a central difference of fourth
/// order of the logarithm of the smaller tail. `tails` takes the parameter; `log_density`
/// is that at x.
pub(super) fn speed_by_differences(
    a: f64,
    log_density: f64,
    tails: impl Fn(f64) -> Option<Tails>,
) -> Option<f64> {
    let here = tails(a)?;
    let lower = here.below < here.above;
    let h = 2e-3 * a;
    let at = |k: f64| tails(a + k * h).map(|t| if lower { t.below } else { t.above });
    let slope = (8.0 * (at(1.0)? - at(-1.0)?) - (at(2.0)? - at(-2.0)?)) / (12.0 * h);
    let (part, sign) = if lower { (here.below, 1.0) } else { (here.above, -1.0) };
    let speed = sign * slope * libm::exp(part - log_density);
    Some(if speed.is_finite() { speed } else { 0.0 })
}

impl Dist {
    /// Returns the log probabilities on both sides of a number; `None` if they are not
    /// known.
    pub(super) fn tails(&self, x: f64) -> Option<Tails> {
        use super::Scalar;
        if x == f64::INFINITY {
            return Some(Tails::ALL_BELOW);
        }
        if x == f64::NEG_INFINITY {
            return Some(Tails::NONE_BELOW);
        }
        match self {
            Dist::LogNormal(d) => d.tails(x),
            Dist::Normal(d) => d.tails(x),
            Dist::Uniform(d) => d.tails(x),
            Dist::Beta(d) => d.tails(x),
            Dist::Gamma(d) => d.tails(x),
            Dist::Exponential(d) => d.tails(x),
            Dist::HalfNormal(d) => d.tails(x),
            Dist::HalfCauchy(d) => d.tails(x),
            Dist::StudentT(d) => d.tails(x),
            Dist::InvGamma(d) => d.tails(x),
            Dist::Cauchy(d) => d.tails(x),
            Dist::Laplace(d) => d.tails(x),
            Dist::Weibull(d) => d.tails(x),
            Dist::NegBinomial(d) => d.tails(x),
            Dist::Geometric(d) => d.tails(x),
            Dist::UniformDiscrete(d) => d.tails(x),
            Dist::Binomial(d) => d.tails(x),
            Dist::Poisson(d) => d.tails(x),
            Dist::Categorical(d) => d.tails(x),
            Dist::Mixture(d) => {
                let (_, shares, _) = d.shares();
                let all =
                    shares.iter().zip(d.components()).filter(|(s, _)| **s > f64::NEG_INFINITY);
                let all: Option<Vec<(f64, Tails)>> =
                    all.map(|(s, c)| Some((*s, c.tails(x)?))).collect();
                Some(Tails::mixed(&all?))
            }
            _ => None,
        }
    }

    /// Returns dP(X <= x)/da divided by the density at x, for each parameter a, where the
    /// density is positive and finite.
    pub(super) fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        use super::Scalar;
        match self {
            Dist::LogNormal(d) => d.cdf_slopes(x),
            Dist::Normal(d) => d.cdf_slopes(x),
            Dist::Uniform(d) => d.cdf_slopes(x),
            Dist::Beta(d) => d.cdf_slopes(x),
            Dist::Gamma(d) => d.cdf_slopes(x),
            Dist::Exponential(d) => d.cdf_slopes(x),
            Dist::HalfNormal(d) => d.cdf_slopes(x),
            Dist::HalfCauchy(d) => d.cdf_slopes(x),
            Dist::StudentT(d) => d.cdf_slopes(x),
            Dist::InvGamma(d) => d.cdf_slopes(x),
            Dist::Cauchy(d) => d.cdf_slopes(x),
            Dist::Laplace(d) => d.cdf_slopes(x),
            Dist::Weibull(d) => d.cdf_slopes(x),
            Dist::NegBinomial(d) => d.cdf_slopes(x),
            Dist::Geometric(d) => d.cdf_slopes(x),
            Dist::UniformDiscrete(d) => d.cdf_slopes(x),
            Dist::Binomial(d) => d.cdf_slopes(x),
            Dist::Poisson(d) => d.cdf_slopes(x),
            Dist::Categorical(d) => d.cdf_slopes(x),
            Dist::Mixture(d) => {
                let (_, shares, total) = d.shares();
                let all = self.log_density_num(x);
                let below = libm::exp(self.tails(x)?.below);
                let mut by_weight = CdfSlopes::new();
                let mut rest = CdfSlopes::new();
                for (share, c) in shares.iter().zip(d.components()) {
                    by_weight
                        .push((libm::exp(c.tails(x)?.below) - below) / total * libm::exp(-all));
                    let own = libm::exp(share + c.log_density_num(x) - all);
                    match c.cdf_slopes(x).filter(|_| own > 0.0) {
                        Some(cdf_slopes) => rest.extend(cdf_slopes.iter().map(|s| own * s)),
                        None if own > 0.0 => return None,
                        None => rest.extend(std::iter::repeat_n(0.0, c.param_count())),
                    }
                }
                by_weight.extend(rest);
                Some(by_weight)
            }
            _ => None,
        }
    }
}
