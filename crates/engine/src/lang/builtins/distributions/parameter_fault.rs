//! Distributions from parameters that are checked, and the faults of those that are not
//! in their domain.

use crate::lang::fault::Fault;
use pcadlang_numerics::dist::{Dist, ParamError};

/// A distribution of any family, or the fault of its parameters.
pub(super) fn made<T: Into<Dist>>(made: Result<T, ParamError>) -> Result<Dist, Fault> {
    made.map(Into::into).map_err(fault)
}

/// The fault of a parameter outside its domain, with a hint if there is one.
pub(super) fn fault(e: ParamError) -> Fault {
    let fault = Fault::domain(e.to_string());
    match e.rule {
        "must be positive definite" => fault.with_hint(
            "some variable is a combination of the others: leave it out, or add a variance of its own, \
             such as cov + 0.000001 * identity(2)",
        ),
        rule if rule.starts_with("must be positive") => {
            fault.with_hint("for a positive parameter use half_normal, gamma or lognormal as prior, or exp of a number")
        }
        "must make a positive definite matrix" => fault.with_hint("use a larger `jitter`, or add `+ white(sd)`"),
        _ => fault,
    }
}
