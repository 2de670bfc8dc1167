//! Functions of numbers, element by element on arrays, through libm so that they are the same on every platform.

use super::derivative::{self, of_two, one_of};
use super::elementwise::{binary, numeric, unary};
use super::reduce::{largest, smallest};
use super::{Arg, Args, Builtin, Pull, Pulled, Type, arg, function};
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::Value;

const SECTION: &str = "Math";

const X: &[Arg] = &[arg("x", Type::Nums, "The argument.")];
const ANGLE: &[Arg] = &[arg("x", Type::Nums, "An angle.").unit("radians")];

const fn of_x(name: &'static str, doc: &'static str, f: fn(&Args) -> Result<Value, Fault>, pull: Pull) -> Builtin {
    function(name, SECTION, X, Type::Nums, doc, f).pull(pull)
}

/// Constant between jumps.
const fn steps(name: &'static str, doc: &'static str, f: fn(&Args) -> Result<Value, Fault>) -> Builtin {
    function(name, SECTION, X, Type::Nums, doc, f).flat()
}

const fn of_angle(name: &'static str, doc: &'static str, f: fn(&Args) -> Result<Value, Fault>, pull: Pull) -> Builtin {
    function(name, SECTION, ANGLE, Type::Nums, doc, f).pull(pull)
}

pub(super) const TABLE: &[Builtin] = &[
    of_x("exp", "The exponential.", |a| unary(a, libm::exp), |a, y, by| derivative::unary(a, y, by, |_, y| y)),
    of_x(
        "expm1",
        "`exp(x) - 1`, accurate near 0.",
        |a| unary(a, libm::expm1),
        |a, y, by| derivative::unary(a, y, by, |_, y| y + 1.0),
    ),
    of_x(
        "log",
        "The natural logarithm; -inf at 0, NaN below.",
        |a| unary(a, libm::log),
        |a, y, by| derivative::unary(a, y, by, |x, _| 1.0 / x),
    ),
    of_x(
        "log1p",
        "`log(1 + x)`, accurate near 0.",
        |a| unary(a, libm::log1p),
        |a, y, by| derivative::unary(a, y, by, |x, _| 1.0 / (1.0 + x)),
    ),
    of_x(
        "sqrt",
        "The square root; NaN below 0.",
        |a| unary(a, f64::sqrt),
        |a, y, by| derivative::unary(a, y, by, |_, y| 0.5 / y),
    ),
    function(
        "pow",
        SECTION,
        &[arg("x", Type::Nums, "The base."), arg("y", Type::Nums, "The exponent.")],
        Type::Nums,
        "`x ** y`.",
        |a| binary(a, libm::pow),
    )
    .pull(|a, z, by| of_two(a, z, by, pow_slopes)),
    of_x("abs", "The absolute value.", |a| unary(a, f64::abs), |a, y, by| derivative::unary(a, y, by, |x, _| sign(x))),
    steps("sign", "-1, 0 or 1.", |a| unary(a, sign)),
    steps("step", "0 below 0, 1 from 0 on.", |a| unary(a, step)),
    steps("floor", "The next whole number below.", |a| unary(a, libm::floor)),
    steps("ceil", "The next whole number above.", |a| unary(a, libm::ceil)),
    steps("round", "The nearest whole number, halves away from 0.", |a| unary(a, libm::round)),
    function(
        "min",
        SECTION,
        &[arg("x", Type::Nums, "An array, or the first of several numbers or arrays.")],
        Type::Nums,
        "The smallest element of one array, or of several arguments element by element; NaN if one is NaN.",
        |a| extreme(a, smaller, smallest),
    )
    .variadic()
    .pull(pull_extreme),
    function(
        "max",
        SECTION,
        &[arg("x", Type::Nums, "An array, or the first of several numbers or arrays.")],
        Type::Nums,
        "The largest element of one array, or of several arguments element by element; NaN if one is NaN.",
        |a| extreme(a, larger, largest),
    )
    .variadic()
    .pull(pull_extreme),
    function(
        "clamp",
        SECTION,
        &[
            arg("x", Type::Nums, "The argument."),
            arg("lo", Type::Nums, "The lower bound."),
            arg("hi", Type::Nums, "The upper bound; it wins where the bounds cross."),
        ],
        Type::Nums,
        "`x` moved into the interval from `lo` to `hi`.",
        clamp,
    )
    // The bounds first, of which the upper one wins: at a bound the argument moves nothing.
    .pull(|a, z, by| one_of(a.values, &[2, 1, 0], z, by)),
    of_angle("sin", "The sine.", |a| unary(a, libm::sin), |a, y, by| derivative::unary(a, y, by, |x, _| libm::cos(x))),
    of_angle(
        "cos",
        "The cosine.",
        |a| unary(a, libm::cos),
        |a, y, by| derivative::unary(a, y, by, |x, _| -libm::sin(x)),
    ),
    of_angle(
        "tan",
        "The tangent.",
        |a| unary(a, libm::tan),
        |a, y, by| derivative::unary(a, y, by, |_, y| 1.0 + y * y),
    ),
    of_x(
        "asin",
        "The angle in [-pi/2, pi/2] with this sine.",
        |a| unary(a, libm::asin),
        |a, y, by| derivative::unary(a, y, by, |x, _| 1.0 / (1.0 - x * x).sqrt()),
    ),
    of_x(
        "acos",
        "The angle in [0, pi] with this cosine.",
        |a| unary(a, libm::acos),
        |a, y, by| derivative::unary(a, y, by, |x, _| -1.0 / (1.0 - x * x).sqrt()),
    ),
    of_x(
        "atan",
        "The angle in (-pi/2, pi/2) with this tangent.",
        |a| unary(a, libm::atan),
        |a, y, by| derivative::unary(a, y, by, |x, _| 1.0 / (1.0 + x * x)),
    ),
    function(
        "atan2",
        SECTION,
        &[arg("y", Type::Nums, "The height."), arg("x", Type::Nums, "The width.")],
        Type::Nums,
        "The angle of the point (x, y) in [-pi, pi], in radians.",
        |a| binary(a, libm::atan2),
    )
    .pull(|a, z, by| {
        of_two(a, z, by, |y, x, _| {
            let square = x * x + y * y;
            [x / square, -y / square]
        })
    }),
    of_x(
        "sinh",
        "The hyperbolic sine.",
        |a| unary(a, libm::sinh),
        |a, y, by| derivative::unary(a, y, by, |x, _| libm::cosh(x)),
    ),
    of_x(
        "cosh",
        "The hyperbolic cosine.",
        |a| unary(a, libm::cosh),
        |a, y, by| derivative::unary(a, y, by, |x, _| libm::sinh(x)),
    ),
    of_x(
        "tanh",
        "The hyperbolic tangent.",
        |a| unary(a, libm::tanh),
        |a, y, by| derivative::unary(a, y, by, |_, y| 1.0 - y * y),
    ),
    function(
        "deg",
        SECTION,
        &[arg("x", Type::Nums, "An angle.").unit("degrees")],
        Type::Nums,
        "Degrees in radians: `deg(180)` is pi.",
        |a| unary(a, |x| x * (std::f64::consts::PI / 180.0)),
    )
    .pull(|a, y, by| derivative::unary(a, y, by, |_, _| std::f64::consts::PI / 180.0)),
    of_x(
        "logit",
        "`log(p / (1 - p))`, for probabilities.",
        |a| unary(a, logit),
        |a, y, by| derivative::unary(a, y, by, |x, _| 1.0 / (x * (1.0 - x))),
    ),
    of_x(
        "expit",
        "`1 / (1 + exp(-x))`, the inverse of `logit`.",
        |a| unary(a, expit),
        |a, y, by| derivative::unary(a, y, by, |_, y| y * (1.0 - y)),
    ),
    of_x(
        "erf",
        "The error function.",
        |a| unary(a, libm::erf),
        |a, y, by| derivative::unary(a, y, by, |x, _| std::f64::consts::FRAC_2_SQRT_PI * libm::exp(-x * x)),
    ),
    of_x(
        "lgamma",
        "The logarithm of the absolute value of the gamma function.",
        |a| unary(a, libm::lgamma),
        |a, y, by| derivative::unary(a, y, by, |x, _| crate::num::digamma(x)),
    ),
];

/// The derivatives of x^y.
pub(super) fn pow_slopes(x: f64, y: f64, z: f64) -> [f64; 2] {
    // A base of 0 has no logarithm, and x^y does not move with y there.
    [if y == 0.0 { 0.0 } else { y * libm::pow(x, y - 1.0) }, if z == 0.0 { 0.0 } else { z * libm::log(x) }]
}

fn pull_extreme(a: &Args, z: &Value, by: &Adjoint) -> Option<Pulled> {
    if a.values.len() > 1 {
        let order: Vec<usize> = (0..a.values.len()).collect();
        return one_of(a.values, &order, z, by);
    }
    let Value::Array(xs) = a.get(0) else { return Some(smallvec::smallvec![by.clone()]) };
    let Value::Num(z) = z else { return None };
    let mut all = Adjoint::Zero;
    all.add_element(xs.len(), xs.iter().position(|x| x == z)?, by.clone());
    Some(smallvec::smallvec![all])
}

fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        // Zero keeps its sign and NaN stays NaN.
        x
    }
}

fn step(x: f64) -> f64 {
    if x.is_nan() { x } else { f64::from(u8::from(x >= 0.0)) }
}

/// The smaller of two, NaN if one is (std's ignores NaN, which would hide a mistake).
pub(super) fn smaller(x: f64, y: f64) -> f64 {
    if x < y || x.is_nan() { x } else { y }
}

/// The larger of two, NaN if one is.
pub(super) fn larger(x: f64, y: f64) -> f64 {
    if x > y || x.is_nan() { x } else { y }
}

fn extreme(a: &Args, of_two: fn(f64, f64) -> f64, of_all: fn(&[f64]) -> f64) -> Result<Value, Fault> {
    if a.values.len() < 2 {
        return match a.get(0) {
            Value::Num(x) => Ok(Value::Num(*x)),
            _ => a.numbers_from(0, 1).map(|xs| Value::Num(of_all(&xs))),
        };
    }
    let mut all = a.get(0).clone();
    for i in 1..a.values.len() {
        let wrong = |_: &Value, _: &Value| Err(a.wrong(i, "a number or an array of numbers"));
        all = numeric(a, &all, a.get(i), of_two, &wrong)?;
    }
    Ok(all)
}

fn clamp(a: &Args) -> Result<Value, Fault> {
    let wrong = |i: usize| move |_: &Value, _: &Value| Err(a.wrong(i, "a number or an array of numbers"));
    let raised = numeric(a, a.get(0), a.get(1), larger, &wrong(1))?;
    numeric(a, &raised, a.get(2), smaller, &wrong(2))
}

/// `ln p - ln(1 - p)`, the second by log1p, so that small `p` lose nothing.
fn logit(p: f64) -> f64 {
    libm::log(p) - libm::log1p(-p)
}

fn expit(x: f64) -> f64 {
    // The exponential never overflows this way.
    if x >= 0.0 {
        1.0 / (1.0 + libm::exp(-x))
    } else {
        let e = libm::exp(x);
        e / (1.0 + e)
    }
}
