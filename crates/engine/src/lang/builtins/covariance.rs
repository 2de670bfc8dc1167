//! Covariance functions of Gaussian processes as values: `sq_exp(0.5) + white(0.01)`.

use super::{Arg, ArgAdjoints, Args, Row, Type, arg, function, num};
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::{Object, Value};
use pcadlang_numerics::dist::{Covariance, ParamError};
use std::any::Any;

const SECTION: &str = "Covariances";

/// The maximum number of parameters of a covariance function.
const MOST_PARAMS: usize = 200;

/// A covariance function.
#[derive(Clone, Debug)]
pub struct CovarianceValue(pub Covariance);

impl Object for CovarianceValue {
    fn type_name(&self) -> &'static str {
        "a covariance"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn multiply(&self, other: &Value) -> Option<Result<Value, Fault>> {
        let other = other.downcast::<CovarianceValue>()?;
        Some(Self::joined(&self.0, &other.0, |x, y| x * y))
    }

    fn vjp_product(&self, other: &Value, by: &Adjoint) -> Option<[Adjoint; 2]> {
        CovarianceValue::vjp_both(&Value::object(self.clone()), other, by)
    }
}

impl CovarianceValue {
    /// Splits the adjoint of a sum or product between its two sides.
    pub(super) fn vjp_both(x: &Value, y: &Value, by: &Adjoint) -> Option<[Adjoint; 2]> {
        let (x, y) = (x.downcast::<CovarianceValue>()?, y.downcast::<CovarianceValue>()?);
        let (left, right) = (x.0.param_count(), y.0.param_count());
        let all = by.numbers(left + right);
        Some([Adjoint::Array(all[..left].to_vec()), Adjoint::Array(all[left..].to_vec())])
    }

    /// Returns the sum of two covariance functions; `None` if `x` or `y` is not one.
    pub(super) fn sum(x: &Value, y: &Value) -> Option<Result<Value, Fault>> {
        let (x, y) = (x.downcast::<CovarianceValue>()?, y.downcast::<CovarianceValue>()?);
        Some(Self::joined(&x.0, &y.0, |x, y| x + y))
    }

    fn joined(
        x: &Covariance,
        y: &Covariance,
        join: fn(Covariance, Covariance) -> Covariance,
    ) -> Result<Value, Fault> {
        if x.param_count() + y.param_count() > MOST_PARAMS {
            let message = format!("a covariance of more than {MOST_PARAMS} parameters");
            return Err(Fault::domain(message));
        }
        Ok(Value::object(CovarianceValue(join(x.clone(), y.clone()))))
    }
}

const SD: Arg = num("sd", 1.0, "The standard deviation.");
const LENGTH: Arg = arg("length", Type::Num, "The length scale, in units of the points.");

const fn covariance(
    name: &'static str,
    args: &'static [Arg],
    doc: &'static str,
    f: fn(&Args) -> Result<Value, Fault>,
) -> Row {
    function(name, SECTION, args, Type::Covariance, doc, f).vjp(vjp_params)
}

pub(super) const TABLE: &[Row] = &[
    covariance(
        "sq_exp",
        &[LENGTH, SD],
        "Squared exponential, `sd^2 exp(-(x - y)^2 / (2 length^2))`: very smooth functions.",
        |a| value(Covariance::sq_exp(a.num(0)?, a.num(1)?)),
    ),
    covariance(
        "matern32",
        &[LENGTH, SD],
        "Matérn with nu = 3/2: once-differentiable functions.",
        |a| value(Covariance::matern32(a.num(0)?, a.num(1)?)),
    ),
    covariance(
        "matern52",
        &[LENGTH, SD],
        "Matérn with nu = 5/2: twice-differentiable functions.",
        |a| value(Covariance::matern52(a.num(0)?, a.num(1)?)),
    ),
    covariance(
        "periodic",
        &[
            arg("period", Type::Num, "The period, in units of the points."),
            arg("length", Type::Num, "The length scale, relative to the period."),
            SD,
        ],
        "Periodic, `sd^2 exp(-2 sin^2(pi (x - y) / period) / length^2)`.",
        |a| value(Covariance::periodic(a.num(0)?, a.num(1)?, a.num(2)?)),
    ),
    covariance(
        "white",
        &[SD],
        "Independent noise at every point; add it to another: `sq_exp(2) + white(0.1)`.",
        |a| value(Covariance::white(a.num(0)?)),
    ),
];

/// The adjoint of a covariance has one number per parameter, in the order of the
/// arguments.
fn vjp_params(a: &Args, y: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let n = y.downcast::<CovarianceValue>()?.0.param_count();
    Some(by.numbers(n).into_iter().take(a.values.len()).map(Adjoint::Num).collect())
}

fn value(made: Result<Covariance, ParamError>) -> Result<Value, Fault> {
    made.map(|c| Value::object(CovarianceValue(c))).map_err(|e| Fault::domain(e.to_string()))
}
