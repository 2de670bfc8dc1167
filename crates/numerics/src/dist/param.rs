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

/// Defines checks that return the number if it is in a domain.
macro_rules! checks {
    ($($(#[$doc:meta])* $check:ident($x:ident): $inside:expr, $rule:literal;)*) => {$(
        $(#[$doc])*
        #[inline]
        pub(super) fn $check(
            distribution: &'static str,
            parameter: &'static str,
            $x: f64,
        ) -> Result<f64, ParamError> {
            if $inside { Ok($x) } else { Err(ParamError::new(distribution, parameter, $x, $rule)) }
        }
    )*};
}

/// 2^53: all integers up to this one are doubles.
pub(super) const MAX_INTEGER: f64 = 9_007_199_254_740_992.0;

checks! {
    /// Any number, also infinite ones and NaN: the family checks it.
    any(x): true, "";
    finite(x): x.is_finite(), "must be finite";
    positive(x): x > 0.0 && x.is_finite(), "must be positive and finite";
    not_negative(x): x >= 0.0 && x.is_finite(), "must be finite and not negative";
    probability(x): (0.0..=1.0).contains(&x), "must be between 0 and 1";
    /// A probability of success, which must occur eventually.
    success(x): x > 0.0 && x <= 1.0, "must be above 0 and at most 1";
    integer(x): x == libm::trunc(x) && x.abs() <= MAX_INTEGER, "must be an integer of at most 2^53";
    /// A mean that may be drawn as an integer.
    rate(x): (0.0..=MAX_INTEGER).contains(&x), "must be between 0 and 2^53";
}
