//! The Dirichlet distribution.

use super::beta::power_term;
use super::{Datum, Distribution, Gradient, ParamError, Support};
use crate::num::{digamma, ln_gamma, log_sum_exp};
use crate::rng::Stream;

/// dirichlet(alpha): shares of a whole
#[derive(Clone, Debug, PartialEq)]
pub struct Dirichlet {
    alpha: Vec<f64>,
    norm: f64,
}

impl Dirichlet {
    /// One concentration for each share.
    ///
    /// # Errors
    /// Unless there is at least one, and all are positive and finite.
    pub fn new(alpha: &[f64]) -> Result<Self, ParamError> {
        if alpha.is_empty() {
            return Err(ParamError::new("dirichlet", "alpha", "one number for each share", "[]"));
        }
        for a in alpha {
            super::param::positive("dirichlet", "alpha", *a)?;
        }
        let norm = ln_gamma(alpha.iter().sum()) - alpha.iter().map(|a| ln_gamma(*a)).sum::<f64>();
        Ok(Dirichlet { alpha: alpha.to_vec(), norm })
    }

    fn shares<'a>(&self, x: &'a Datum) -> Option<&'a [f64]> {
        match x {
            Datum::Vec(v) if v.len() == self.alpha.len() => Some(v),
            _ => None,
        }
    }
}

impl Distribution for Dirichlet {
    fn name(&self) -> &'static str {
        "dirichlet"
    }

    fn support(&self) -> Support {
        Support::Simplex(self.alpha.len())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let logs: Vec<f64> = self.alpha.iter().map(|a| super::gamma::ln_gamma_draw(*a, rng)).collect();
        let total = log_sum_exp(&logs);
        Datum::Vec(logs.iter().map(|l| libm::exp(l - total).max(f64::MIN_POSITIVE)).collect())
    }

    /// By the first n - 1 shares; at a share of 0 with a concentration below 1 it is +inf.
    fn log_density(&self, x: &Datum) -> f64 {
        let Some(v) = self.shares(x) else { return f64::NEG_INFINITY };
        if !self.support().contains(x) {
            return f64::NEG_INFINITY;
        }
        let d = self.norm + self.alpha.iter().zip(v).map(|(a, x)| power_term(*a, libm::log(*x))).sum::<f64>();
        if d.is_nan() { f64::NEG_INFINITY } else { d }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let v = self.shares(x)?;
        if v.iter().any(|x| *x <= 0.0) || !self.support().contains(x) {
            return None;
        }
        let total = digamma(self.alpha.iter().sum());
        Some(Gradient {
            x: self.alpha.iter().zip(v).map(|(a, x)| (a - 1.0) / x).collect(),
            params: self.alpha.iter().zip(v).map(|(a, x)| libm::log(*x) - digamma(*a) + total).collect(),
        })
    }
}
