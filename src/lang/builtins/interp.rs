//! Linear interpolation of tables.

use super::{Args, Builtin, Type, arg, function};
use crate::lang::error::Fault;
use crate::lang::value::Value;

pub(super) const TABLE: &[Builtin] = &[function(
    "interp",
    "Arrays and records",
    &[
        arg("x", Type::Nums, "Where to read: a number or an array of them."),
        arg("xs", Type::Array, "The places of the table, in ascending order."),
        arg("ys", Type::Array, "As many values."),
    ],
    Type::Nums,
    "The straight lines through a table of points, read at `x`; beyond its ends the values there.",
    interp,
)];

fn interp(a: &Args) -> Result<Value, Fault> {
    let xs = a.numbers_from(1, 1)?;
    let ys = a.numbers(2)?;
    if ys.len() != xs.len() {
        return Err(a.wrong_length(2, &format!("{} numbers, as many as there are places", xs.len())));
    }
    // Also false of NaN.
    if !xs.is_sorted_by(|a, b| a <= b) {
        return Err(Fault::domain("interp: the places `xs` must ascend"));
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
