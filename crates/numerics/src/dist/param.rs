//! Parameters outside their domain: reported as an error value, so that they cause
//! neither a panic nor a NaN later.

use thiserror::Error;

/// A parameter outside the domain of a distribution or covariance function.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{distribution}: {parameter} {rule}, got {value}")]
pub struct ParamError {
    /// The family or covariance function.
    pub distribution: &'static str,
    /// The name of the parameter.
    pub parameter: &'static str,
    /// Its value.
    pub value: String,
    /// The condition it violates, as the end of a sentence that begins with the
    /// parameter.
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

/// Returns the number if it is finite.
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

/// Returns the number if it is positive and finite.
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

/// Returns the number if it is in [0, 1].
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

/// 2^53: all integers up to this one are doubles.
pub(super) const MAX_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Returns the number if it is an integer of at most 2^53 in magnitude.
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
