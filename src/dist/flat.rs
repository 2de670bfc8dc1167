//! The improper flat prior: density 1 everywhere, so not a distribution that could be drawn from.

use super::{Scalar, Slope, Support};
use crate::rng::Stream;

/// `flat()`. Its log density is 0 at every number. What it "draws" is a start for a chain only: uniform(-2, 2), as in Stan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flat;

impl Scalar for Flat {
    const NAME: &'static str = "flat";
    const IMPROPER: bool = true;

    fn number_support(&self) -> Support {
        Support::Real
    }

    /// A place to start from, uniform on (-2, 2).
    fn draw(&self, rng: &mut Stream) -> f64 {
        4.0 * rng.open_uniform() - 2.0
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x.is_finite() { 0.0 } else { f64::NEG_INFINITY }
    }

    fn slope(&self, _x: f64) -> Slope {
        Slope::new(0.0, [])
    }

    fn number_mean(&self) -> Option<f64> {
        None
    }

    fn number_sd(&self) -> Option<f64> {
        None
    }
}
