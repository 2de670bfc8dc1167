//! Coordinates of numbers below a pole that is not at 0, where doubles are coarse: those of
//! an interval, but beyond the last double they go on, and the Jacobian makes the density
//! what it is for numbers that no double can show.
//!
//! A trace keeps such a coordinate beside the value, which alone would not tell it. The
//! probability of the last double is then that of all numbers that round to it.

use super::Support;
use super::clamp::near;
use crate::num::log1p_exp;
use core::ops::RangeFrom;

/// The coordinate from which a trace keeps coordinates: below, values tell them to 1e-9.
const COARSE: f64 = 16.0;

/// The distance of the last double from the bound, as a share of the interval.
fn gap(lo: f64, hi: f64) -> f64 {
    (hi - hi.next_down()) / (hi - lo)
}

/// Returns ln(share / gap) at a coordinate whose numbers round to the last double or to the
/// bound, with the remaining share of the interval; `None` before.
fn beyond(lo: f64, hi: f64, y: f64) -> Option<f64> {
    if y < COARSE {
        return None;
    }
    let above = -log1p_exp(y) - libm::log(gap(lo, hi));
    (above < LN_1_5).then_some(above)
}

/// The largest coordinate.
const FARTHEST: f64 = 1e300;

/// ln 1.5: half way from the last double to the one before.
const LN_1_5: f64 = 0.405_465_108_108_164_4;

/// Returns the coordinate of a number. For the last double it is one of many, of which this
/// share of the probability lies beyond.
pub(super) fn to_free(lo: f64, hi: f64, power: f64, x: f64, beyond: f64) -> f64 {
    if x >= hi.next_down() && gap(lo, hi) < 1e-9 {
        return -libm::log(gap(lo, hi)) - LN_1_5 - libm::log(beyond) / power;
    }
    Support::Interval { lo, hi }.to_free_scalar(x)
}

/// Returns the number at a coordinate, and the log Jacobian, with which a density that is
/// proportional to distance^(power - 1) has the right probability beyond the last double.
pub(super) fn from_free(lo: f64, hi: f64, power: f64, y: f64) -> (f64, f64) {
    let y = y.min(FARTHEST);
    match beyond(lo, hi, y) {
        None => Support::Interval { lo, hi }.from_free_scalar(y),
        Some(above) => (hi.next_down(), libm::log(hi - lo) - log1p_exp(y) + (power - 1.0) * above),
    }
}

/// As [`Support::free_gradient`]: beyond the last double, the value does not move.
pub(super) fn gradient(lo: f64, hi: f64, power: f64, y: f64, by: f64) -> f64 {
    let p = crate::num::expit(near(y));
    match beyond(lo, hi, y) {
        None => by * (hi - lo) * p * (1.0 - p) + 1.0 - 2.0 * p,
        Some(_) => -power * p,
    }
}

impl Support {
    /// The coordinates that a value near a pole need not tell.
    #[doc(hidden)]
    pub const COARSE: RangeFrom<f64> = COARSE..;

    /// Returns the coordinate that is kept of one that a value was made from, which is
    /// otherwise that of the value.
    #[doc(hidden)]
    #[inline]
    pub fn settled(&self, y: f64, of_value: f64) -> f64 {
        if matches!(self, Support::Pole { .. }) && y >= COARSE { y } else { of_value }
    }

    /// Returns the coordinate of a number near a pole: the one that was kept, if it is one
    /// of this number's, otherwise one of them by a number between 0 and 1. `None` if the
    /// number tells it.
    #[doc(hidden)]
    pub fn coarse_coordinate(
        &self,
        x: f64,
        kept: Option<f64>,
        uniform: impl Fn() -> f64,
    ) -> Option<f64> {
        let Support::Pole { lo, hi, power } = self else { return None };
        match kept {
            Some(y) if y.is_finite() && self.from_free_scalar(y).0 == x => Some(y),
            _ if x >= hi.next_down() => Some(to_free(*lo, *hi, *power, x, uniform())),
            _ => None,
        }
    }
}
