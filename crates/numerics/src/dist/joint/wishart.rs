//! The Wishart distribution over covariance matrices, in terms of their Cholesky factors
//! (Bartlett's decomposition).

use crate::dist::draw::ln_gamma_draw;
use crate::dist::joint::factor::Factor;
use crate::dist::joint::triangle;
use crate::dist::param::positive;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, digamma, ln_gamma};
use core::f64::consts::LN_2;
use nalgebra::DMatrix;

/// `wishart(df, scale_chol)`: the lower triangular Cholesky factor L, as n rows, of a
/// matrix W = L L' that has the Wishart distribution with `df` degrees of freedom and
/// scale matrix S S', S = `scale_chol`. The mean of W is df S S'.
///
/// L = S A, where A is lower triangular with standard normal numbers below the diagonal,
/// and A\[i\]\[i\]^2 is chi-squared with df - i degrees of freedom. The density is with
/// respect to the lower triangle of L. Gradients are with respect to the value (n x n
/// numbers, 0 above the diagonal) and df; those with respect to S are separate
/// ([`Wishart::scale_gradient`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Wishart {
    df: f64,
    scale: Factor,
    log_norm: f64,
}

impl Wishart {
    /// Creates the distribution. Fails unless the scale's factor is square, finite, not
    /// empty and lower triangular with a positive diagonal, and `df` is finite and above
    /// the number of rows minus 1.
    pub fn new(df: f64, scale_chol: &DMatrix<f64>) -> Result<Wishart, ParamError> {
        let n = scale_chol.nrows();
        if n == 0 || scale_chol.ncols() != n {
            let value = format!("{n} x {}", scale_chol.ncols());
            return Err(Self::bad("scale_chol", value, "must be square and not empty"));
        }
        if (0..n).any(|j| (0..j).any(|i| scale_chol[(i, j)] != 0.0)) {
            return Err(Self::bad("scale_chol", "one that is not", "must be lower triangular"));
        }
        let bad =
            || Self::bad("scale_chol", "one without", "must be finite with a positive diagonal");
        let scale = Factor::from_lower(scale_chol).ok_or_else(bad)?;
        let df = positive("wishart", "df", df)?;
        if df <= (n - 1) as f64 {
            return Err(Self::bad("df", df, "must be above the number of rows minus 1"));
        }
        let jacobian =
            |i: usize| (i + 1) as f64 * libm::log(scale_chol[(i, i)]) + LN_SQRT_2PI * i as f64;
        let log_norm = -(0..n).map(jacobian).sum::<f64>();
        Ok(Wishart { df, scale, log_norm })
    }

    /// Returns the derivatives of the log density with respect to the scale's factor S,
    /// its lower triangle by rows. With A = S^-1 L and G the derivatives with respect to
    /// A, they are -S^-T G A' minus those of the log Jacobian.
    pub fn scale_gradient(&self, x: &Datum) -> Option<Vec<f64>> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        let n = self.scale.size();
        let a = self.whiten(&triangle::entries(x, n)?);
        let columns: Vec<Vec<f64>> =
            (0..n).map(|j| self.scale.solve_transposed(self.by_whitened(&a, j))).collect();
        let cell = |i: usize, k: usize| {
            let sum: f64 = columns.iter().enumerate().map(|(j, c)| c[i] * a[k * n + j]).sum();
            -sum - if i == k { (i + 1) as f64 / self.scale.diagonal(i) } else { 0.0 }
        };
        Some((0..n).flat_map(|i| (0..=i).map(move |k| (i, k))).map(|(i, k)| cell(i, k)).collect())
    }

    /// Returns the derivatives of the log density with respect to column `j` of A = S^-1
    /// L.
    fn by_whitened(&self, a: &[f64], j: usize) -> Vec<f64> {
        let n = self.scale.size();
        let mut column: Vec<f64> = (0..n).map(|i| -a[i * n + j]).collect();
        column[j] += (self.df - j as f64 - 1.0) / a[j * n + j];
        column
    }

    /// Returns S^-1 L.
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

/// Returns the log density of the square root of a chi-squared number. Uses the gamma
/// density where the plain formula would cancel.
fn log_chi(df: f64, x: f64) -> f64 {
    let (half, t) = (0.5 * df, 0.5 * x * x);
    match Gamma::new(half, 1.0) {
        Ok(gamma) if half >= 64.0 && t > 0.0 => gamma.log_density_num(t) + libm::log(x),
        _ => (1.0 - half) * LN_2 - ln_gamma(half) + (df - 1.0) * libm::log(x) - t,
    }
}

impl Distribution for Wishart {
    fn name(&self) -> &'static str {
        Self::NAME
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
        let Some(xs) = triangle::entries(x, n).filter(|xs| triangle::is_covariance_factor(xs, n))
        else {
            return f64::NEG_INFINITY;
        };
        let a = self.whiten(&xs);
        let noise: f64 = (0..n).flat_map(|i| &a[i * n..i * n + i]).map(|a| a * a).sum();
        let diagonal: f64 = (0..n).map(|i| log_chi(self.df - i as f64, a[i * n + i])).sum();
        let score = self.log_norm + diagonal - 0.5 * noise;
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
            for (i, g) in
                self.scale.solve_transposed(self.by_whitened(&a, j)).into_iter().enumerate().skip(j)
            {
                by_x[i * n + j] = g;
            }
            by_df += libm::log(d) - 0.5 * LN_2 - 0.5 * digamma(0.5 * (self.df - j as f64));
        }
        Some(Gradient { x: by_x, params: vec![by_df] })
    }
}
