//! The Wishart distribution over covariance matrices, as one over their Cholesky factors (Bartlett's decomposition).

use super::draw::ln_gamma_draw;
use super::factor::Factor;
use super::param::positive;
use super::triangle;
use super::{Datum, Distribution, Gradient, ParamError, Support};
use crate::num::{LN_SQRT_2PI, digamma, ln_gamma};
use crate::rng::Stream;
use core::f64::consts::LN_2;
use nalgebra::DMatrix;

/// `wishart(df, scale_chol)`: the lower triangular Cholesky factor L, as n rows, of a matrix W = L L' that has the Wishart
/// distribution with this many degrees of freedom and scale matrix S S', S = `scale_chol`. The mean of W is df S S'.
///
/// L = S A, where A is lower triangular with standard normal numbers below the diagonal, and A\[i\]\[i\]^2 chi-squared with df - i
/// degrees of freedom. The density is by the lower triangle of L. Gradients are by the value (n x n numbers, 0 above the
/// diagonal) and by df.
#[derive(Clone, Debug, PartialEq)]
pub struct Wishart {
    df: f64,
    scale: Factor,
    log_norm: f64,
}

impl Wishart {
    /// Fails unless the scale's factor is square, finite, lower triangular with a positive diagonal, has a row, and `df` is
    /// finite and above the number of rows less 1.
    pub fn new(df: f64, scale_chol: &DMatrix<f64>) -> Result<Wishart, ParamError> {
        let n = scale_chol.nrows();
        if n == 0 || scale_chol.ncols() != n {
            let value = format!("{n} x {}", scale_chol.ncols());
            return Err(ParamError::new("wishart", "scale_chol", value, "must be square, with a row"));
        }
        if (0..n).any(|j| (0..j).any(|i| scale_chol[(i, j)] != 0.0)) {
            return Err(ParamError::new("wishart", "scale_chol", "one that is not", "must be lower triangular"));
        }
        let bad = || ParamError::new("wishart", "scale_chol", "one without", "must be finite with a positive diagonal");
        let scale = Factor::from_lower(scale_chol).ok_or_else(bad)?;
        let df = positive("wishart", "df", df)?;
        if df <= (n - 1) as f64 {
            return Err(ParamError::new("wishart", "df", df, "must be above the number of rows less 1"));
        }
        let diagonal = |i: usize| {
            let half = 0.5 * (df - i as f64);
            let jacobian = (i + 1) as f64 * libm::log(scale_chol[(i, i)]);
            (1.0 - half) * LN_2 - ln_gamma(half) - LN_SQRT_2PI * i as f64 - jacobian
        };
        let log_norm = (0..n).map(diagonal).sum();
        Ok(Wishart { df, scale, log_norm })
    }

    /// S^-1 L.
    fn whiten(&self, xs: &[f64]) -> Vec<f64> {
        let n = self.scale.size();
        let (zeros, mut a) = (vec![0.0; n], vec![0.0; n * n]);
        for j in 0..n {
            let column: Vec<f64> = (0..n).map(|i| xs[i * n + j]).collect();
            for (i, z) in self.scale.whiten(&zeros, &column).into_iter().enumerate().skip(j) {
                a[i * n + j] = z;
            }
        }
        a
    }
}

impl Distribution for Wishart {
    fn name(&self) -> &'static str {
        "wishart"
    }

    fn support(&self) -> Support {
        Support::CovarianceFactor(self.scale.size())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let n = self.scale.size();
        let (zeros, mut xs) = (vec![0.0; n], vec![0.0; n * n]);
        for j in 0..n {
            let mut column = vec![0.0; n];
            for (i, a) in column.iter_mut().enumerate().skip(j) {
                *a = if i > j {
                    rng.standard_normal()
                } else {
                    libm::exp(0.5 * (LN_2 + ln_gamma_draw(0.5 * (self.df - i as f64), rng)))
                };
            }
            for (i, x) in self.scale.colour(&zeros, &column).into_iter().enumerate().skip(j) {
                let least = if i == j { f64::MIN_POSITIVE } else { f64::MIN };
                xs[i * n + j] = x.clamp(least, f64::MAX);
            }
        }
        triangle::value(n, &xs)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let n = self.scale.size();
        let Some(xs) = triangle::entries(x, n).filter(|xs| triangle::is_covariance_factor(xs, n)) else {
            return f64::NEG_INFINITY;
        };
        let a = self.whiten(&xs);
        let square: f64 = a.iter().map(|a| a * a).sum();
        let power: f64 = (0..n).map(|i| (self.df - i as f64 - 1.0) * libm::log(a[i * n + i])).sum();
        let score = self.log_norm + power - 0.5 * square;
        if score.is_nan() { f64::NEG_INFINITY } else { score }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        let n = self.scale.size();
        let a = self.whiten(&triangle::entries(x, n)?);
        let mut by_x = vec![0.0; n * n];
        let mut by_df = 0.0;
        for j in 0..n {
            let d = a[j * n + j];
            let mut column: Vec<f64> = (0..n).map(|i| -a[i * n + j]).collect();
            column[j] += (self.df - j as f64 - 1.0) / d;
            for (i, g) in self.scale.solve_transposed(column).into_iter().enumerate().skip(j) {
                by_x[i * n + j] = g;
            }
            by_df += libm::log(d) - 0.5 * LN_2 - 0.5 * digamma(0.5 * (self.df - j as f64));
        }
        let finite = by_x.iter().all(|g| g.is_finite());
        finite.then(|| Gradient { x: by_x, params: vec![by_df] })
    }
}
