//! Parameters outside their domain.

/// A parameter outside its domain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{distribution}: {parameter} must be {rule}, got {value}")]
pub struct ParamError {
    /// The family.
    pub distribution: &'static str,
    /// The parameter.
    pub parameter: &'static str,
    /// What it must be.
    pub rule: &'static str,
    /// What it is.
    pub value: String,
}

impl ParamError {
    pub(super) fn new(
        distribution: &'static str,
        parameter: &'static str,
        rule: &'static str,
        value: impl ToString,
    ) -> Self {
        ParamError { distribution, parameter, rule, value: value.to_string() }
    }
}

/// Checks that a parameter is finite.
pub(super) fn finite(distribution: &'static str, parameter: &'static str, x: f64) -> Result<f64, ParamError> {
    if x.is_finite() { Ok(x) } else { Err(ParamError::new(distribution, parameter, "finite", x)) }
}

/// Checks that a parameter is positive and finite.
pub(super) fn positive(distribution: &'static str, parameter: &'static str, x: f64) -> Result<f64, ParamError> {
    if x > 0.0 && x.is_finite() {
        Ok(x)
    } else {
        Err(ParamError::new(distribution, parameter, "positive and finite", x))
    }
}

/// Checks that a parameter is a probability.
pub(super) fn probability(distribution: &'static str, parameter: &'static str, x: f64) -> Result<f64, ParamError> {
    if (0.0..=1.0).contains(&x) { Ok(x) } else { Err(ParamError::new(distribution, parameter, "between 0 and 1", x)) }
}
