//! Student's t distribution, with a location and a scale.

use crate::dist::draw::{far_square, ln_gamma_draw, standard};
use crate::dist::tails::speed_by_differences;
use crate::dist::*;
use crate::num::{beta_tails, digamma, ln_beta};

/// `student_t(df, location, scale)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudentT {
    df: f64,
    location: f64,
    scale: f64,
    /// The part of `log_norm` that the scale does not change.
    log_shape: f64,
    log_norm: f64,
}

impl StudentT {
    pub(in crate::dist) fn of(df: f64, location: f64, scale: f64) -> Result<StudentT, ParamError> {
        let log_shape = -ln_beta(0.5 * df, 0.5) - 0.5 * libm::log(df);
        let log_norm = log_shape - libm::log(scale);
        Ok(StudentT { df, location, scale, log_shape, log_norm })
    }
}

impl StudentT {
    /// Returns minus the derivative with respect to the number, and z times that in units of
    /// the scale, z the distance from the location in units of the scale.
    #[inline]
    fn slopes_of_place(&self, x: f64) -> (f64, f64) {
        let (df, z) = (self.df, standard(x, self.location, self.scale));
        let t = z / self.df.sqrt();
        // (df + 1) z / (df + z^2), and z times that.
        let (once, twice) = if t.abs() < 1.0 {
            let weight = (df + 1.0) / (df * (1.0 + t * t));
            (weight * z, weight * z * z)
        } else {
            ((df + 1.0) / (z + df / z), (df + 1.0) / (1.0 + df / z / z))
        };
        let by_x = if z.is_finite() { once / self.scale } else { (df + 1.0) / (x - self.location) };
        (by_x, twice)
    }

    /// Returns ln(1 + z^2 / df), where z is the distance from the location in units of
    /// the scale.
    #[inline]
    fn log_tail(&self, x: f64) -> f64 {
        let t = standard(x, self.location, self.scale) / self.df.sqrt();
        if t.abs() < 1e150 {
            libm::log1p(t * t)
        } else {
            far_square(x, self.location, self.scale) - libm::log(self.df)
        }
    }
}

impl Scalar for StudentT {
    fn draw(&self, rng: &mut Stream) -> f64 {
        let z = rng.standard_normal();
        let half = 0.5 * self.df;
        let spread = libm::exp(0.5 * (libm::log(half) - ln_gamma_draw(half, rng))).min(f64::MAX);
        (self.location + self.scale * (z * spread)).clamp(f64::MIN, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !x.is_finite() {
            return f64::NEG_INFINITY;
        }
        self.log_norm - 0.5 * (self.df + 1.0) * self.log_tail(x)
    }

    fn slope(&self, x: f64) -> Slope {
        let df = self.df;
        let (by_x, twice) = self.slopes_of_place(x);
        let norm = 0.5 * (digamma(0.5 * (df + 1.0)) - digamma(0.5 * df) - 1.0 / df);
        let by_df = norm - 0.5 * self.log_tail(x) + 0.5 * twice / df;
        Slope::new(-by_x, [by_df, by_x, (twice - 1.0) / self.scale])
    }

    #[inline]
    fn slope_without_shape(&self, x: f64) -> Slope {
        let (by_x, twice) = self.slopes_of_place(x);
        Slope::new(-by_x, [0.0, by_x, (twice - 1.0) / self.scale])
    }

    /// Degrees of freedom that stay as they were keep their part of the norm, and a scale
    /// that stays keeps all of it.
    #[inline]
    fn reused(&self, params: &[f64]) -> Option<StudentT> {
        let [df, location, scale] = *params else { return None };
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        let valid = same(df, self.df) && location.is_finite() && scale > 0.0 && scale.is_finite();
        valid.then(|| StudentT {
            location,
            scale,
            log_norm: match same(scale, self.scale) {
                true => self.log_norm,
                false => self.log_shape - libm::log(scale),
            },
            ..*self
        })
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        student_tails(self.df, standard(x, self.location, self.scale))
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let z = standard(x, self.location, self.scale);
        let by_df =
            speed_by_differences(self.df, self.log_density_num(x), |df| student_tails(df, z));
        Some(smallvec![by_df, -1.0, -z])
    }

    fn number_mean(&self) -> Option<f64> {
        (self.df > 1.0).then_some(self.location)
    }

    fn number_sd(&self) -> Option<f64> {
        (self.df > 2.0).then(|| self.scale * (self.df / (self.df - 2.0)).sqrt())
    }
}

/// Returns the tails of the standard distribution, by the incomplete beta function of df
/// / (df + z^2) (Abramowitz & Stegun 26.7.1).
fn student_tails(df: f64, z: f64) -> Option<Tails> {
    let square = z * z;
    let (x, y) = (1.0 / (1.0 + square / df), 1.0 / (1.0 + df / square));
    let (beyond, _) = beta_tails(0.5 * df, 0.5, x, y)?;
    let tails = Tails::from_below(beyond - core::f64::consts::LN_2);
    Some(if z < 0.0 { tails } else { tails.swapped() })
}
