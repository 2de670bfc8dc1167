//! Student's t distribution.

use super::param::{finite, positive};
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::{digamma, ln_gamma};
use crate::rng::Stream;

/// student_t(df, location, scale)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudentT {
    df: f64,
    location: f64,
    scale: f64,
    norm: f64,
}

impl StudentT {
    /// Degrees of freedom, location and scale.
    ///
    /// # Errors
    /// Unless `df` and `scale` are positive and finite and `location` is finite.
    pub fn new(df: f64, location: f64, scale: f64) -> Result<Self, ParamError> {
        let df = positive("student_t", "df", df)?;
        let location = finite("student_t", "location", location)?;
        let scale = positive("student_t", "scale", scale)?;
        let norm = ln_ratio(df) - 0.5 * libm::log(df) - 0.5 * libm::log(core::f64::consts::PI) - libm::log(scale);
        Ok(StudentT { df, location, scale, norm })
    }
}

/// ln Gamma((v + 1) / 2) - ln Gamma(v / 2); by a series where the difference would cancel.
fn ln_ratio(v: f64) -> f64 {
    if v < 1e6 {
        return ln_gamma(0.5 * (v + 1.0)) - ln_gamma(0.5 * v);
    }
    0.5 * libm::log(0.5 * v) - 0.25 / v
}

/// ln(1 + z^2 / v), also where z^2 overflows.
fn ln_tail(z: f64, v: f64) -> f64 {
    let z = z.abs();
    if z < 1e150 { libm::log1p(z * z / v) } else { 2.0 * libm::log(z) - libm::log(v) }
}

impl Distribution for StudentT {
    fn name(&self) -> &'static str {
        "student_t"
    }

    fn support(&self) -> Support {
        Support::Real
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        // z / sqrt(chi2 / df), the chi-square in log space for small df.
        let z = rng.standard_normal();
        let ln_chi2 = super::gamma::ln_gamma_draw(0.5 * self.df, rng) + core::f64::consts::LN_2;
        let t = z * libm::exp(0.5 * (libm::log(self.df) - ln_chi2).min(1400.0));
        Datum::Num((self.location + self.scale * t).clamp(-f64::MAX, f64::MAX))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if !x.is_finite() {
            return f64::NEG_INFINITY;
        }
        let z = (x - self.location) / self.scale;
        self.norm - 0.5 * (self.df + 1.0) * ln_tail(z, self.df)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let z = (number(x) - self.location) / self.scale;
        let (v, q) = (self.df, z * z);
        if !q.is_finite() {
            return None;
        }
        let slope = -(v + 1.0) * z / (v + q) / self.scale;
        let by_df = 0.5
            * (digamma(0.5 * (v + 1.0)) - digamma(0.5 * v) - 1.0 / v - ln_tail(z, v) + (v + 1.0) * q / (v * (v + q)));
        Some(Gradient { x: vec![slope], params: vec![by_df, -slope, -1.0 / self.scale - slope * z] })
    }
}
