//! Distributions of one number: a smaller interface that does not allocate, and an
//! implementation of [`Distribution`] on top of it.

use super::tails::{CdfSlopes, Tails};
use super::{Datum, Distribution, Gradient, Named, Support};
use crate::rng::Stream;
use smallvec::SmallVec;
use std::fmt;

/// The derivatives of the log density of a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Slope {
    /// With respect to the number; `None` if it is discrete.
    pub x: Option<f64>,
    /// With respect to the parameters, in the order of the constructor; 0 for integer
    /// parameters.
    pub params: SmallVec<[f64; 3]>,
}

impl Slope {
    /// Creates the derivatives of a continuous density.
    pub fn new<const N: usize>(x: f64, params: [f64; N]) -> Self {
        Slope { x: Some(x), params: SmallVec::from_slice(&params) }
    }

    /// Creates the derivatives of the probability of an integer.
    pub fn discrete<const N: usize>(params: [f64; N]) -> Self {
        Slope { x: None, params: SmallVec::from_slice(&params) }
    }
}

/// A distribution of one number.
pub trait Scalar: Named + fmt::Debug + Send + Sync {
    /// True if it is not normalised, see [`Distribution::is_improper`].
    const IMPROPER: bool = false;

    /// The space of the values, if it is the same for all parameters.
    const SUPPORT: Support = Support::Real;

    /// Returns the space of the values, which are numbers.
    fn number_support(&self) -> Support {
        Self::SUPPORT
    }

    /// Draws a number from the support.
    fn draw(&self, rng: &mut Stream) -> f64;

    /// Returns the log density: -inf off the support, never NaN.
    fn log_density_num(&self, x: f64) -> f64;

    /// Returns the derivatives of the log density at a point where it is finite.
    fn slope(&self, x: f64) -> Slope;

    /// Returns the derivatives without that with respect to the first parameter, a shape,
    /// which may be left at 0 where it takes longest.
    #[inline]
    fn slope_without_shape(&self, x: f64) -> Slope {
        self.slope(x)
    }

    /// Returns the log probabilities on both sides of a number, if the family can compute
    /// them.
    fn tails(&self, _x: f64) -> Option<Tails> {
        None
    }

    /// Returns dP(X <= x)/da divided by the density at x, for each parameter a, where the
    /// density is positive and finite; 0 for an integer parameter.
    fn cdf_slopes(&self, _x: f64) -> Option<CdfSlopes> {
        None
    }

    /// Returns the derivatives with respect to the parameters of a function of the bounds
    /// of the support, given those with respect to the bounds; `None` if the bounds do
    /// not depend on the parameters.
    fn by_bounds(&self, _lo: f64, _hi: f64) -> Option<CdfSlopes> {
        None
    }

    /// See [`Distribution::pole`].
    #[inline]
    fn upper_pole(&self) -> Option<f64> {
        None
    }

    /// Returns the mean, if it exists.
    fn number_mean(&self) -> Option<f64> {
        None
    }

    /// Returns the standard deviation, if it exists.
    fn number_sd(&self) -> Option<f64> {
        None
    }

    /// Returns the distribution with these parameters, if it can reuse results that
    /// `self` has computed from its own.
    #[inline]
    fn reused(&self, _params: &[f64]) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Maps a number to the scale of the standard normal, for normal distributions.
    fn standardised(&self, _x: f64) -> Option<f64> {
        None
    }

    /// Maps a number from the scale of the standard normal, for normal distributions.
    fn unstandardised(&self, _z: f64) -> Option<f64> {
        None
    }
}

impl<T: Scalar> Distribution for T {
    fn name(&self) -> &'static str {
        T::NAME
    }

    fn support(&self) -> Support {
        self.number_support()
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Num(self.draw(rng))
    }

    #[inline]
    fn log_density(&self, x: &Datum) -> f64 {
        match x {
            Datum::Num(x) => self.log_density_num(*x),
            _ => f64::NEG_INFINITY,
        }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let x = x.num()?;
        if !self.log_density_num(x).is_finite() {
            return None;
        }
        let slope = self.slope(x);
        Some(Gradient { x: slope.x.into_iter().collect(), params: slope.params.to_vec() })
    }

    fn is_scalar(&self) -> bool {
        true
    }

    fn is_improper(&self) -> bool {
        T::IMPROPER
    }

    fn is_gaussian(&self) -> bool {
        self.unstandardised(0.0).is_some()
    }

    fn whiten(&self, x: &Datum) -> Option<Vec<f64>> {
        self.standardised(x.num()?).map(|z| vec![z])
    }

    fn colour(&self, z: &[f64]) -> Option<Datum> {
        match z {
            [z] => self.unstandardised(*z).map(Datum::Num),
            _ => None,
        }
    }

    #[inline]
    fn pole(&self) -> Option<f64> {
        self.upper_pole()
    }

    fn mean(&self) -> Option<f64> {
        self.number_mean()
    }

    fn sd(&self) -> Option<f64> {
        self.number_sd()
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        Scalar::tails(self, x)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Scalar::cdf_slopes(self, x)
    }

    fn has_moving_support(&self) -> bool {
        Scalar::by_bounds(self, 0.0, 0.0).is_some()
    }

    fn by_bounds(&self, lo: f64, hi: f64) -> Option<Vec<f64>> {
        match Scalar::by_bounds(self, lo, hi) {
            Some(by) => Some(by.to_vec()),
            None => Some(vec![0.0; self.param_count()]),
        }
    }
}
