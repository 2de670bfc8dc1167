//! The operators, named as they are written; `neg` and `not` are the prefix operators.
//!
//! Arithmetic follows IEEE 754: division by zero gives an infinity or NaN, which is
//! detected when it is scored.

use super::covariance::CovarianceValue;
use super::derivative::of_pairs;
use super::elementwise::{self, array, array_len, broadcast, mapped, numeric};
use super::math::pow_slopes;
use super::{Arg, Args, Derivative, Row, Scalar, Type, arg, function};
use crate::lang::error::Fault;
use crate::lang::missing::Missing;
use crate::lang::value::{MOST_ELEMENTS, Value};
use std::cmp::Ordering;

const SECTION: &str = "Operators";

const SIDES: &[Arg] =
    &[arg("a", Type::Any, "The left side."), arg("b", Type::Any, "The right side.")];

const fn infix(
    name: &'static str,
    returns: Type,
    doc: &'static str,
    f: fn(&Args) -> Result<Value, Fault>,
) -> Row {
    function(name, SECTION, SIDES, returns, doc, f)
}

/// The row of an operator on numbers, given its slopes as a function of x, y and z.
macro_rules! arithmetic {
    ($name:literal, $doc:literal, $f:expr, $slopes:expr) => {
        of_pairs!(infix($name, Type::Nums, $doc, arithmetic), $f, $slopes)
    };
}

pub(super) const TABLE: &[Row] = &[
    of_pairs!(
        infix("+", Type::Any, "Sum of numbers, element by element; joins two strings; adds covariances.", add),
        |x, y| x + y,
        |_, _, _| [1.0, 1.0],
        Some(|a, _, by| { CovarianceValue::vjp_both(a.get(0), a.get(1), by).map(|both| both.into_iter().collect()) })
    ),
    arithmetic!("-", "Difference, element by element.", |x, y| x - y, |_, _, _| [1.0, -1.0]),
    of_pairs!(
        infix(
            "*",
            Type::Any,
            "Product of numbers, element by element; applies a placement to a solid; multiplies covariances.",
            multiply,
        ),
        |x, y| x * y,
        |x, y, _| [y, x],
        Some(|a, _, by| match a.get(0) {
            Value::Object(o) => o.vjp_product(a.get(1), by).map(|both| both.into_iter().collect()),
            _ => None,
        })
    ),
    arithmetic!("/", "Quotient, element by element; by zero it is an infinity or NaN.", |x, y| x / y, |_, y, z| {
        [1.0 / y, -z / y]
    }),
    arithmetic!("%", "Remainder with the sign of the divisor: `-1 % 3` is 2.", remainder, |x, y, _| {
        [1.0, -libm::floor(x / y)]
    }),
    arithmetic!("**", "Power, element by element.", libm::pow, pow_slopes),
    function(
        "neg",
        SECTION,
        &[arg("a", Type::Nums, "The operand.")],
        Type::Nums,
        "Negation `-a`, element by element.",
        mapped,
    )
    .scalar(Scalar::Unary(|x| -x))
    .derivative(Derivative::Unary(|_, _| -1.0)),
    function(
        "not",
        SECTION,
        &[arg("a", Type::Any, "A bool, or an array of them.")],
        Type::Any,
        "Logical negation, element by element.",
        not,
    )
    .scalar(Scalar::Logic(|b| !b))
    .flat(),
    infix(
        "==",
        Type::Any,
        "Equality of any two values; arrays are compared element by element (`all(a == b)` is one bool).",
        |a| equality(a, true),
    )
    .scalar(Scalar::Test(|x, y| x == y))
    .flat(),
    infix("!=", Type::Any, "The opposite of `==`.", |a| equality(a, false)).scalar(Scalar::Test(|x, y| x != y)).flat(),
    infix("<", Type::Any, "Order of numbers or strings, element by element.", |a| compare(a, Ordering::is_lt))
        .scalar(Scalar::Test(|x, y| x < y))
        .flat(),
    infix("<=", Type::Any, "Order of numbers or strings, element by element.", |a| compare(a, Ordering::is_le))
        .scalar(Scalar::Test(|x, y| x <= y))
        .flat(),
    infix(">", Type::Any, "Order of numbers or strings, element by element.", |a| compare(a, Ordering::is_gt))
        .scalar(Scalar::Test(|x, y| x > y))
        .flat(),
    infix(">=", Type::Any, "Order of numbers or strings, element by element.", |a| compare(a, Ordering::is_ge))
        .scalar(Scalar::Test(|x, y| x >= y))
        .flat(),
    function(
        "..",
        SECTION,
        &[
            arg("lo", Type::Int, "The first number."),
            arg("hi", Type::Int, "The end, excluded; the range is empty if it is not above `lo`."),
        ],
        Type::Array,
        "The whole numbers from `lo` up to but not including `hi`.",
        range,
    )
    .flat(),
];

fn add(a: &Args) -> Result<Value, Fault> {
    numeric(a, a.get(0), a.get(1), |x, y| x + y, &|x, y| match (x, y) {
        (Value::Str(x), Value::Str(y)) => {
            a.fits(x.len() + y.len())?;
            Ok(Value::Str(format!("{x}{y}").into()))
        }
        _ => match CovarianceValue::sum(x, y) {
            Some(sum) => sum,
            None => Err(unsuited(a, "numbers or strings", x, y)),
        },
    })
}

fn multiply(a: &Args) -> Result<Value, Fault> {
    numeric(a, a.get(0), a.get(1), |x, y| x * y, &|x, y| {
        let product = if let Value::Object(o) = x { o.multiply(y) } else { None };
        product.unwrap_or_else(|| Err(unsuited(a, "numbers", x, y)))
    })
}

fn arithmetic(a: &Args) -> Result<Value, Fault> {
    numeric(a, a.get(0), a.get(1), elementwise::of_two(a), &|x, y| {
        Err(unsuited(a, "numbers", x, y))
    })
}

/// `x - y floor(x / y)`, computed from the exact IEEE remainder.
fn remainder(x: f64, y: f64) -> f64 {
    let r = x % y;
    if r != 0.0 && (r < 0.0) != (y < 0.0) { r + y } else { r }
}

fn not(a: &Args) -> Result<Value, Fault> {
    fn go(v: &Value) -> Result<Value, Fault> {
        match v {
            Value::Bool(b) => Ok(Value::Bool(!b)),
            Value::List(xs) => {
                xs.iter().map(go).collect::<Result<Vec<_>, _>>().map(Value::from_elements)
            }
            Value::Array(xs) if xs.is_empty() => Ok(v.clone()),
            _ => Err(Fault::type_error(format!("`not` needs a bool, got {}", v.type_name()))),
        }
    }
    go(a.get(0))
}

fn equality(a: &Args, wanted: bool) -> Result<Value, Fault> {
    match (a.get(0), a.get(1)) {
        (Value::Num(x), Value::Num(y)) => Ok(Value::Bool((x == y) == wanted)),
        (x, y) => broadcast(a, x, y, &|x, y| match Missing::first_in(x).or(Missing::first_in(y)) {
            // Neither answer would be right.
            Some(entry) => Err(entry.fault()),
            None => Ok(Value::Bool(equal(x, y) == wanted)),
        }),
    }
}

/// Equality of whole values: numbers by IEEE 754, functions and objects by identity.
pub(super) fn equal(x: &Value, y: &Value) -> bool {
    match (x, y) {
        (Value::Num(x), Value::Num(y)) => x == y,
        (Value::Record(r), Value::Record(s)) => {
            r.len() == s.len() && r.iter().all(|(k, x)| s.get(k).is_some_and(|y| equal(x, y)))
        }
        _ => match (array_len(x), array_len(y)) {
            (Some(m), Some(n)) => m == n && (0..n).all(|i| equal(&at(x, i), &at(y, i))),
            _ => x.same(y),
        },
    }
}

fn at(v: &Value, i: usize) -> Value {
    v.element(i).unwrap_or_default()
}

fn compare(a: &Args, holds: fn(Ordering) -> bool) -> Result<Value, Fault> {
    // Comparisons with NaN are false.
    let test = |o: Option<Ordering>| Value::Bool(o.is_some_and(holds));
    match (a.get(0), a.get(1)) {
        (Value::Num(x), Value::Num(y)) => Ok(test(x.partial_cmp(y))),
        (x, y) => broadcast(a, x, y, &|x, y| match (x, y) {
            (Value::Num(x), Value::Num(y)) => Ok(test(x.partial_cmp(y))),
            (Value::Str(x), Value::Str(y)) => Ok(test(Some(x.cmp(y)))),
            _ => Err(unsuited(a, "two numbers or two strings", x, y)),
        }),
    }
}

fn range(a: &Args) -> Result<Value, Fault> {
    let bound = |i: usize| match a.get(i) {
        Value::Num(x) if *x == libm::trunc(*x) && x.abs() <= EXACT => Ok(*x),
        Value::Num(x) => Err(Fault::domain(format!("`..` needs whole numbers, got {x}"))),
        v => Err(Fault::type_error(format!("`..` needs whole numbers, got {}", v.type_name()))),
    };
    let (lo, hi) = (bound(0)?, bound(1)?);
    let n = (hi - lo).max(0.0);
    if n > MOST_ELEMENTS as f64 {
        return Err(a.too_many(n));
    }
    Ok(array(n as usize, |i| lo + i as f64))
}

/// The largest number up to which every whole number is exact in an f64.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// The error that an operator is not defined for its operands.
fn unsuited(a: &Args, wanted: &str, x: &Value, y: &Value) -> Fault {
    let name = &a.builtin.name;
    let fault = Fault::type_error(format!(
        "`{name}` needs {wanted}, got {} and {}",
        x.type_name(),
        y.type_name()
    ));
    match (x, y) {
        (Value::Str(_), Value::Num(_)) | (Value::Num(_), Value::Str(_)) if name == "+" => {
            fault.with_hint("`str(x)` makes a string of a number")
        }
        (Value::Bool(_), _) | (_, Value::Bool(_)) => {
            fault.with_hint("`if b { 1 } else { 0 }` makes a number of a bool")
        }
        (Value::Dist(_), _) | (_, Value::Dist(_)) => {
            fault.with_hint("draw from the distribution first: `x ~ d`, then compute with `x`")
        }
        _ => fault,
    }
}
