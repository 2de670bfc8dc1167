//! The distribution of Lewandowski, Kurowicka & Joe (2009) over correlation matrices, in
//! terms of their Cholesky factors.

use crate::dist::draw::{ln_gamma_draw, x_log_y};
use crate::dist::joint::triangle;
use crate::dist::param::{integer, positive};
use crate::dist::*;
use crate::num::{digamma, expit, ln_beta, ln_gamma};
use core::f64::consts::PI;

/// The largest number of rows.
const MOST: f64 = 1000.0;

/// `lkj(n, eta)`: the lower triangular Cholesky factor L, as n rows, of a random n x n
/// correlation matrix L L' with density proportional to det(L L')^(eta - 1). The density
/// is with respect to the numbers below the diagonal, as in Stan's `lkj_corr_cholesky`.
///
/// A gradient with respect to the value has a number for each of the n x n entries. Only
/// those of the diagonal, on which the density depends, are not 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Lkj {
    n: usize,
    eta: f64,
    log_norm: f64,
}

impl Lkj {
    /// Creates the distribution with `n` rows and this shape; fails unless `n` is an
    /// integer between 1 and 1000 and `eta` is positive and finite.
    pub fn new(n: f64, eta: f64) -> Result<Lkj, ParamError> {
        let (n, eta) = (rows("lkj", n)?, positive("lkj", "eta", eta)?);
        let mut d = Lkj { n, eta, log_norm: 0.0 };
        let norm = |i: usize| {
            let half = 0.5 * i as f64;
            ln_gamma(half) - half * libm::log(PI) - ln_beta(d.shape(i), half)
        };
        d.log_norm = (1..n).map(norm).sum();
        Ok(d)
    }

    /// Returns the first parameter of the beta(shape, i / 2) distribution of row i's
    /// squared diagonal.
    fn shape(&self, i: usize) -> f64 {
        self.eta + 0.5 * (self.n - 1 - i) as f64
    }
}

/// Checks a number of rows.
pub(in crate::dist) fn rows(distribution: &'static str, n: f64) -> Result<usize, ParamError> {
    match integer(distribution, "n", n)? {
        n if (1.0..=MOST).contains(&n) => Ok(n as usize),
        n => Err(ParamError::new(distribution, "n", n, "must be between 1 and 1000")),
    }
}

impl Distribution for Lkj {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        Support::CorrelationFactor(self.n)
    }

    /// Draws row by row: a uniform direction, and a length that leaves a beta-distributed
    /// squared diagonal.
    fn sample(&self, rng: &mut Stream) -> Datum {
        let n = self.n;
        let mut xs = vec![0.0; n * n];
        for i in 0..n {
            let (row, rest) = xs[i * n..].split_at_mut(i);
            row.iter_mut().for_each(|x| *x = rng.standard_normal());
            let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
            if i == 0 || length == 0.0 {
                rest[0] = 1.0;
                continue;
            }
            let log_odds = ln_gamma_draw(self.shape(i), rng) - ln_gamma_draw(0.5 * i as f64, rng);
            let scale = expit(-log_odds).sqrt() / length;
            row.iter_mut().for_each(|x| *x *= scale);
            rest[0] = expit(log_odds).sqrt().max(f64::MIN_POSITIVE);
        }
        triangle::value(n, &xs)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let Some(xs) =
            triangle::entries(x, self.n).filter(|xs| triangle::is_correlation_factor(xs, self.n))
        else {
            return f64::NEG_INFINITY;
        };
        let mut sum = self.log_norm;
        for i in 1..self.n {
            let term = x_log_y(2.0 * (self.shape(i) - 1.0), xs[i * self.n + i]);
            // An impossible row (-inf) takes precedence over poles (+inf) of other rows.
            if term == f64::NEG_INFINITY || sum == f64::NEG_INFINITY {
                sum = f64::NEG_INFINITY;
            } else {
                sum += term;
            }
        }
        sum
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        let xs = triangle::entries(x, self.n)?;
        let mut by_x = vec![0.0; xs.len()];
        let all = digamma(self.eta + 0.5 * (self.n - 1) as f64);
        let mut by_eta = 0.0;
        for i in 1..self.n {
            let (d, shape) = (xs[i * self.n + i], self.shape(i));
            if shape != 1.0 {
                by_x[i * self.n + i] = 2.0 * (shape - 1.0) / d;
            }
            by_eta += 2.0 * libm::log(d.max(f64::MIN_POSITIVE)) + all - digamma(shape);
        }
        Some(Gradient { x: by_x, params: vec![0.0, by_eta] })
    }
}
