//! The interface of all distributions. Families over one number implement the simpler
//! [`super::Scalar`] instead.

use super::tails::{CdfSlopes, Tails};
use super::{Datum, Dist, Support};
use crate::rng::{Purpose, Stream, StreamKey};
use std::fmt;

/// The derivatives of a log density.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// With respect to the value, one for each of its numbers; empty for a discrete
    /// value.
    pub x: Vec<f64>,
    /// With respect to the parameters, in the order of the constructor. They are 0 for
    /// integer parameters and omitted for a covariance.
    pub params: Vec<f64>,
}

/// A probability distribution.
///
/// Some distributions keep their choices in a *stored* form that is not the value: a
/// Gaussian process stores white noise, so its values follow when its parameters change.
/// By default the stored form is the value itself.
pub trait Distribution: fmt::Debug + Send + Sync {
    /// Returns the name in the language.
    fn name(&self) -> &str;

    /// Returns the space of the values.
    fn support(&self) -> Support;

    /// Draws a value, which is always in the support. Draws that overflow or underflow
    /// are replaced by the nearest double in range.
    fn sample(&self, rng: &mut Stream) -> Datum;

    /// Returns the log density, in nats: -inf off the support and for a value of another
    /// kind, +inf at poles, and never NaN.
    fn log_density(&self, x: &Datum) -> f64;

    /// Returns the derivatives of the log density: `None` where it is not finite, and if
    /// the distribution has none; numbers that are not finite where they are too large
    /// for doubles.
    fn gradient(&self, x: &Datum) -> Option<Gradient>;

    /// Returns whether values are a linear function of white noise, see
    /// [`Distribution::colour`].
    fn is_gaussian(&self) -> bool {
        false
    }

    /// Returns the white noise that gives a value; `None` if the distribution is not
    /// Gaussian or the value does not fit.
    fn whiten(&self, _x: &Datum) -> Option<Vec<f64>> {
        None
    }

    /// Returns the value that corresponds to white noise: standard normal noise gives
    /// draws.
    fn colour(&self, _z: &[f64]) -> Option<Datum> {
        None
    }

    /// Returns whether the support depends on the parameters. The default assumes so for
    /// supports with bounds; distributions whose bounds are fixed may override it,
    /// because gradients with respect to the parameters are not available with a moving
    /// support.
    fn has_moving_support(&self) -> bool {
        use Support::*;
        matches!(self.support(), AtLeast { .. } | AtMost { .. } | Interval { .. } | Ascending(..))
    }

    /// Returns whether values are single numbers.
    fn is_scalar(&self) -> bool {
        self.support().is_number()
    }

    /// Returns whether the density is not normalised, such as a density of 1 everywhere,
    /// so that the distribution cannot be sampled. Its `sample` then gives a starting
    /// point for a chain.
    fn is_improper(&self) -> bool {
        false
    }

    /// Returns whether the stored form is white noise.
    #[doc(hidden)]
    fn is_stored_whitened(&self) -> bool {
        false
    }

    /// Draws in stored form.
    #[doc(hidden)]
    fn sample_stored(&self, rng: &mut Stream) -> Datum {
        self.sample(rng)
    }

    /// Returns the log density of a stored form, in its own space.
    #[doc(hidden)]
    fn log_density_stored(&self, s: &Datum) -> f64 {
        self.log_density(s)
    }

    /// Returns the derivatives of [`Distribution::log_density_stored`].
    #[doc(hidden)]
    fn gradient_stored(&self, s: &Datum) -> Option<Gradient> {
        self.gradient(s)
    }

    /// Returns the value of a stored form.
    #[doc(hidden)]
    #[allow(clippy::wrong_self_convention)] // The distribution is the map, not the result.
    fn from_noncentred(&self, s: &Datum) -> Datum {
        s.clone()
    }

    /// Returns the stored form of a value; `None` if it does not fit.
    #[doc(hidden)]
    fn to_noncentred(&self, value: &Datum) -> Option<Datum> {
        Some(value.clone())
    }

    /// Returns the space of stored forms.
    #[doc(hidden)]
    fn stored_support(&self) -> Support {
        match (self.pole(), self.support()) {
            (Some(power), Support::Interval { lo, hi }) if hi != 0.0 => {
                Support::Pole { lo, hi, power }
            }
            (_, support) => support,
        }
    }

    /// Returns the power of the distance that the probability near the upper bound is
    /// proportional to, if the density has a pole there.
    #[doc(hidden)]
    fn pole(&self) -> Option<f64> {
        None
    }

    /// Returns the mean of a number, if it exists. Truth values count as 0 and 1.
    fn mean(&self) -> Option<f64> {
        None
    }

    /// Returns the standard deviation of a number, if it exists.
    fn sd(&self) -> Option<f64> {
        None
    }

    /// Returns the log probabilities on both sides of a finite number, if they are known.
    #[doc(hidden)]
    fn tails(&self, _x: f64) -> Option<Tails> {
        None
    }

    /// Returns dP(X <= x)/da divided by the density at x, for each parameter a, where the
    /// density is positive and finite.
    #[doc(hidden)]
    fn cdf_slopes(&self, _x: f64) -> Option<CdfSlopes> {
        None
    }

    /// Returns the number of parameter derivatives in [`Distribution::gradient`]. It is
    /// the same for all values, so it is counted at one draw.
    #[doc(hidden)]
    fn param_count(&self) -> usize {
        let x = self.sample(&mut StreamKey::new(0, 0, Purpose::VALUES).stream(0, 0, 0));
        self.gradient(&x).map_or(0, |g| g.params.len())
    }

    /// Returns the derivatives with respect to the parameters of a function of the bounds
    /// of the support, given those with respect to the bounds.
    #[doc(hidden)]
    fn by_bounds(&self, _lo: f64, _hi: f64) -> Option<Vec<f64>> {
        (!self.has_moving_support()).then(|| vec![0.0; self.param_count()])
    }

    /// For a value mean + L z made from white noise z: returns the derivatives with
    /// respect to z of a function whose derivatives with respect to the value are `by`.
    #[doc(hidden)]
    #[allow(clippy::wrong_self_convention)] // The distribution is the map, not the result.
    fn from_noncentred_vjp(&self, _by: &[f64]) -> Option<Vec<f64>> {
        None
    }

    /// Returns the same distribution in centred form, which stores values, if it is not.
    #[doc(hidden)]
    fn centred(&self) -> Option<Dist> {
        None
    }

    /// Returns the distributions it is made of, and how often they are repeated.
    #[doc(hidden)]
    fn made_of(&self) -> Option<(&[Dist], usize)> {
        None
    }
}
