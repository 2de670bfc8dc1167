//! The Dirichlet distribution: proportions that sum to 1.

use crate::dist::draw::{ln_gamma_draw, x_log_y};
use crate::dist::param::positive;
use crate::dist::support::is_simplex;
use crate::dist::*;
use crate::num::{digamma, ln_gamma, log_sum_exp};

/// `dirichlet(alpha)`. The density is with respect to all proportions but the last. A
/// proportion of 0 is a pole (+inf) if its concentration is below 1 and impossible (-inf)
/// if it is above; -inf takes precedence.
#[derive(Clone, Debug, PartialEq)]
pub struct Dirichlet {
    alpha: Box<[f64]>,
    log_norm: f64,
}

impl Dirichlet {
    /// Creates the distribution with these concentrations; fails if there are none, and
    /// unless all are positive and have a finite sum.
    pub fn new(alpha: &[f64]) -> Result<Dirichlet, ParamError> {
        if alpha.is_empty() {
            return Err(Self::bad("alpha", "none", "must have one number per component"));
        }
        for a in alpha {
            positive("dirichlet", "alpha", *a)?;
        }
        let total = positive("dirichlet", "the sum of alpha", alpha.iter().sum())?;
        let log_norm = ln_gamma(total) - alpha.iter().map(|a| ln_gamma(*a)).sum::<f64>();
        Ok(Dirichlet {
            alpha: alpha.into(),
            log_norm: if alpha.len() == 1 { 0.0 } else { log_norm },
        })
    }

    fn score(&self, xs: &[f64]) -> f64 {
        if !is_simplex(xs) {
            return f64::NEG_INFINITY;
        }
        if xs.iter().zip(&self.alpha).any(|(x, a)| *x == 0.0 && *a > 1.0) {
            return f64::NEG_INFINITY;
        }
        if xs.len() == 1 {
            return 0.0;
        }
        self.log_norm + xs.iter().zip(&self.alpha).map(|(x, a)| x_log_y(a - 1.0, *x)).sum::<f64>()
    }
}

impl Distribution for Dirichlet {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        Support::Simplex(self.alpha.len())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let mut xs: Vec<f64> = self.alpha.iter().map(|a| ln_gamma_draw(*a, rng)).collect();
        let total = log_sum_exp(&xs);
        xs.iter_mut().for_each(|x| *x = libm::exp(*x - total).clamp(f64::MIN_POSITIVE, 1.0));
        xs.into()
    }

    fn log_density(&self, x: &Datum) -> f64 {
        x.with_numbers(self.alpha.len(), |xs| self.score(xs)).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        x.with_numbers(self.alpha.len(), |xs| {
            let total = digamma(self.alpha.iter().sum());
            let pairs = || xs.iter().zip(&self.alpha);
            let alone = xs.len() == 1;
            let by_x = |(x, a): (&f64, &f64)| if *a == 1.0 || alone { 0.0 } else { (a - 1.0) / x };
            let by_alpha = |(x, a): (&f64, &f64)| {
                if alone { 0.0 } else { libm::log(x.max(f64::MIN_POSITIVE)) - digamma(*a) + total }
            };
            Gradient { x: pairs().map(by_x).collect(), params: pairs().map(by_alpha).collect() }
        })
    }
}
