//! Parameters outside their domain: an error value, never a panic and never a NaN later
//! on.

use thiserror::Error;

/// A parameter that a distribution or covariance cannot have.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{distribution}: {parameter} {rule}, got {value}")]
pub struct ParamError {
    /// The family, or the covariance function.
    pub distribution: &'static str,
    /// Which parameter.
    pub parameter: &'static str,
    /// What it was.
    pub value: String,
    /// What it must be, as the end of a sentence that begins with the parameter.
    pub rule: &'static str,
}

impl ParamError {
    pub(super) fn new(
        distribution: &'static str,
        parameter: &'static str,
        value: impl ToString,
        rule: &'static str,
    ) -> Self {
        ParamError { distribution, parameter, value: value.to_string(), rule }
    }
}

/// The number, if it is finite.
#[inline]
pub(super) fn finite(
    distribution: &'static str,
    parameter: &'static str,
    x: f64,
) -> Result<f64, ParamError> {
    if x.is_finite() {
        Ok(x)
    } else {
        Err(ParamError::new(distribution, parameter, x, "must be finite"))
    }
}

/// The number, if it is positive and finite.
#[inline]
pub(super) fn positive(
    distribution: &'static str,
    parameter: &'static str,
    x: f64,
) -> Result<f64, ParamError> {
    if x > 0.0 && x.is_finite() {
        Ok(x)
    } else {
        Err(ParamError::new(distribution, parameter, x, "must be positive and finite"))
    }
}

/// The number, if it is in [0, 1].
#[inline]
pub(super) fn probability(
    distribution: &'static str,
    parameter: &'static str,
    x: f64,
) -> Result<f64, ParamError> {
    if (0.0..=1.0).contains(&x) {
        Ok(x)
    } else {
        Err(ParamError::new(distribution, parameter, x, "must be between 0 and 1"))
    }
}

/// The largest integer up to which all are doubles.
pub(super) const MAX_INTEGER: f64 = 9_007_199_254_740_992.0;

/// The number, if it is integral and every integer up to it is a double.
#[inline]
pub(super) fn integer(
    distribution: &'static str,
    parameter: &'static str,
    x: f64,
) -> Result<f64, ParamError> {
    if x == libm::trunc(x) && x.abs() <= MAX_INTEGER {
        Ok(x)
    } else {
        Err(ParamError::new(distribution, parameter, x, "must be an integer of at most 2^53"))
    }
}
