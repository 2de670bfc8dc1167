//! The interface of all distributions. Families over one number implement the simpler
//! [`super::Scalar`] instead.

use super::{Datum, Support};
use crate::rng::Stream;
use std::fmt;

/// The derivatives of a log density.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// By the value, one for each of its numbers; empty for a discrete value.
    pub x: Vec<f64>,
    /// By the parameters, in the order of the constructor. An integer parameter has 0; a
    /// covariance has none.
    pub params: Vec<f64>,
}

/// A probability distribution.
///
/// Some keep their choices in a *stored* form that is not the value: a Gaussian process
/// keeps the white noise behind it, so that its values follow when its parameters move.
/// By default the stored form is the value itself.
pub trait Distribution: fmt::Debug + Send + Sync {
    /// The name in the language.
    fn name(&self) -> &str;

    /// The space of its values.
    fn support(&self) -> Support;

    /// Draws a value, always in the support. Draws too large or too near 0 for a double
    /// are the nearest one that is not.
    fn sample(&self, rng: &mut Stream) -> Datum;

    /// The log density, in nats: -inf off the support and for a value of another kind;
    /// never NaN. It is +inf at poles.
    fn log_density(&self, x: &Datum) -> f64;

    /// The derivatives of the log density; `None` where it is not finite.
    fn gradient(&self, x: &Datum) -> Option<Gradient>;

    /// Whether it is a linear image of white noise, see [`Distribution::colour`].
    fn is_gaussian(&self) -> bool {
        false
    }

    /// The white noise behind a value; `None` if the distribution is not Gaussian or the
    /// value does not fit.
    fn whiten(&self, _x: &Datum) -> Option<Vec<f64>> {
        None
    }

    /// The value made from white noise: standard normal noise gives draws.
    fn colour(&self, _z: &[f64]) -> Option<Datum> {
        None
    }

    /// Whether its bounds are parameters, so that the support moves with them. Bounds
    /// that are the same for all parameters may say so here: gradients by the parameters
    /// of one that moves are not known.
    fn has_moving_support(&self) -> bool {
        use Support::*;
        matches!(self.support(), AtLeast { .. } | AtMost { .. } | Interval { .. } | Ascending(..))
    }

    /// Whether values are single numbers.
    fn is_scalar(&self) -> bool {
        self.support().is_number()
    }

    /// Whether it has no integral, so that nothing can be drawn from it: a density of 1
    /// everywhere. Its `sample` gives a place to start a chain from.
    fn is_improper(&self) -> bool {
        false
    }

    /// Whether the stored form is white noise.
    #[doc(hidden)]
    fn is_stored_whitened(&self) -> bool {
        false
    }

    /// Draws in stored form.
    #[doc(hidden)]
    fn sample_stored(&self, rng: &mut Stream) -> Datum {
        self.sample(rng)
    }

    /// The log density of a stored form, in its own space.
    #[doc(hidden)]
    fn log_density_stored(&self, s: &Datum) -> f64 {
        self.log_density(s)
    }

    /// The derivatives of [`Distribution::log_density_stored`].
    #[doc(hidden)]
    fn gradient_stored(&self, s: &Datum) -> Option<Gradient> {
        self.gradient(s)
    }

    /// The value of a stored form.
    #[doc(hidden)]
    fn from_noncentred(&self, s: &Datum) -> Datum {
        s.clone()
    }

    /// The stored form of a value; `None` if it does not fit.
    #[doc(hidden)]
    fn to_noncentred(&self, value: &Datum) -> Option<Datum> {
        Some(value.clone())
    }

    /// The space of stored forms.
    #[doc(hidden)]
    fn stored_support(&self) -> Support {
        self.support()
    }

    /// The mean of a number, if it exists. A truth value counts as 0 or 1.
    fn mean(&self) -> Option<f64> {
        None
    }

    /// The standard deviation of a number, if it exists.
    fn sd(&self) -> Option<f64> {
        None
    }
}
