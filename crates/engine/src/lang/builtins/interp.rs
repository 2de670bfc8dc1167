//! Linear interpolation of tables.

use super::{ArgAdjoints, Args, Row, Type, arg, function};
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::Value;
use smallvec::smallvec;

pub(super) const TABLE: &[Row] = &[function(
    "interp",
    "Arrays and records",
    &[
        arg("x", Type::Nums, "The points to evaluate at: a number or an array of numbers."),
        arg("xs", Type::Array, "The abscissae of the table, in ascending order."),
        arg("ys", Type::Array, "The values there, as many."),
    ],
    Type::Nums,
    "Linear interpolation of a table at `x`; constant beyond its ends.",
    interp,
)
.vjp(vjp)];

fn interp(a: &Args) -> Result<Value, Fault> {
    let xs = a.numbers_from(1, 1)?;
    let ys = a.numbers(2)?;
    if ys.len() != xs.len() {
        return Err(a.wrong_length(2, &format!("{} numbers, as many as `xs`", xs.len())));
    }
    // Also rejects NaN.
    if !xs.is_sorted_by(|a, b| a <= b) {
        return Err(Fault::domain("interp: `xs` must be ascending"));
    }
    let read = |x: f64| {
        let above = xs.partition_point(|p| *p <= x);
        match above {
            _ if x.is_nan() => f64::NAN,
            0 => ys[0],
            i if i == xs.len() => ys[i - 1],
            i => {
                let t = (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
                ys[i - 1] + t * (ys[i] - ys[i - 1])
            }
        }
    };
    match a.get(0) {
        Value::Num(x) => Ok(Value::Num(read(*x))),
        _ => Ok(Value::Array(a.numbers(0)?.iter().map(|x| read(*x)).collect())),
    }
}

/// The adjoints of the points of evaluation, the abscissae and the values of the table.
/// At an abscissa, where the derivative jumps, the segment to its right counts.
fn vjp(a: &Args, _: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let (xs, ys) = (a.numbers(1).ok()?, a.numbers(2).ok()?);
    let (mut by_xs, mut by_ys) = (vec![0.0; xs.len()], vec![0.0; ys.len()]);
    let mut read = |x: f64, g: f64| {
        let i = xs.partition_point(|p| *p <= x);
        if i == 0 || i == xs.len() {
            by_ys[i.saturating_sub(1)] += g;
            return 0.0;
        }
        let width = xs[i] - xs[i - 1];
        let (t, slope) = ((x - xs[i - 1]) / width, (ys[i] - ys[i - 1]) / width);
        by_ys[i - 1] += g * (1.0 - t);
        by_ys[i] += g * t;
        by_xs[i - 1] -= g * slope * (1.0 - t);
        by_xs[i] -= g * slope * t;
        g * slope
    };
    let by_x = match a.get(0) {
        Value::Num(x) => Adjoint::Num(read(*x, by.number())),
        _ => {
            let at = a.numbers(0).ok()?;
            Adjoint::Array(at.iter().zip(by.numbers(at.len())).map(|(x, g)| read(*x, g)).collect())
        }
    };
    Some(smallvec![by_x, Adjoint::Array(by_xs), Adjoint::Array(by_ys)])
}
