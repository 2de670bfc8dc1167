//! Functions of numbers, element by element on arrays. They use libm, so that results are
//! the same on every platform.

use super::derivative::{of_pairs, one_of};
use super::elementwise::{mapped, numeric};
use super::reduce::{larger, largest, smaller, smallest};
use super::{Arg, ArgAdjoints, Args, Derivative, Row, Scalar, Type, arg, function};
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::num;

const SECTION: &str = "Math";

const X: &[Arg] = &[arg("x", Type::Nums, "The argument.")];
const ANGLE: &[Arg] = &[arg("x", Type::Nums, "An angle.").unit("radians")];
const DEGREES: &[Arg] = &[arg("x", Type::Nums, "An angle.").unit("degrees")];
/// One degree in radians.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// The row of a function of one number, given its slope as a function of x and y.
macro_rules! smooth {
    ($name:literal, $args:ident, $doc:literal, $f:expr, $slope:expr) => {
        function($name, SECTION, $args, Type::Nums, $doc, mapped)
            .scalar(Scalar::Unary($f))
            .derivative(Derivative::Unary($slope))
    };
}

/// The row of a piecewise constant function.
const fn steps(name: &'static str, doc: &'static str, f: fn(f64) -> f64) -> Row {
    function(name, SECTION, X, Type::Nums, doc, mapped).scalar(Scalar::Unary(f)).flat()
}

pub(super) const TABLE: &[Row] = &[
    smooth!("exp", X, "The exponential.", libm::exp, |_, y| y),
    smooth!("expm1", X, "`exp(x) - 1`, accurate near 0.", libm::expm1, |_, y| y + 1.0),
    smooth!("log", X, "The natural logarithm; -inf at 0, NaN below.", libm::log, |x, _| 1.0 / x),
    smooth!("log1p", X, "`log(1 + x)`, accurate near 0.", libm::log1p, |x, _| 1.0 / (1.0 + x)),
    smooth!("sqrt", X, "The square root; NaN below 0.", f64::sqrt, |_, y| 0.5 / y),
    of_pairs!(
        function(
            "pow",
            SECTION,
            &[arg("x", Type::Nums, "The base."), arg("y", Type::Nums, "The exponent.")],
            Type::Nums,
            "`x ** y`.",
            mapped,
        ),
        libm::pow,
        pow_slopes
    ),
    smooth!("abs", X, "The absolute value.", f64::abs, |x, _| sign(x)),
    steps("sign", "-1, 0 or 1.", sign),
    steps("step", "0 below 0, otherwise 1.", step),
    steps("floor", "The largest whole number not above.", libm::floor),
    steps("ceil", "The smallest whole number not below.", libm::ceil),
    steps("round", "The nearest whole number, halves away from 0.", libm::round),
    function(
        "min",
        SECTION,
        &[arg("x", Type::Nums, "An array, or the first of several numbers or arrays.")],
        Type::Nums,
        "The smallest element of one array, or of several arguments element by element; NaN if one is NaN.",
        |a| extreme(a, smaller, smallest),
    )
    .variadic()
    .vjp(vjp_extreme),
    function(
        "max",
        SECTION,
        &[arg("x", Type::Nums, "An array, or the first of several numbers or arrays.")],
        Type::Nums,
        "The largest element of one array, or of several arguments element by element; NaN if one is NaN.",
        |a| extreme(a, larger, largest),
    )
    .variadic()
    .vjp(vjp_extreme),
    function(
        "clamp",
        SECTION,
        &[
            arg("x", Type::Nums, "The argument."),
            arg("lo", Type::Nums, "The lower bound."),
            arg("hi", Type::Nums, "The upper bound; it takes precedence if the bounds cross."),
        ],
        Type::Nums,
        "`x` moved into the interval from `lo` to `hi`.",
        clamp,
    )
    // The bounds come first, the upper before the lower one: at a bound, the derivative
    // with respect to `x` is 0.
    .vjp(|a, z, by| one_of(a.values, &[2, 1, 0], z, by)),
    smooth!("sin", ANGLE, "The sine.", libm::sin, |x, _| libm::cos(x)),
    smooth!("cos", ANGLE, "The cosine.", libm::cos, |x, _| -libm::sin(x)),
    smooth!("tan", ANGLE, "The tangent.", libm::tan, |_, y| 1.0 + y * y),
    smooth!("asin", X, "The angle in [-pi/2, pi/2] with this sine.", libm::asin, |x, _| 1.0 / (1.0 - x * x).sqrt()),
    smooth!("acos", X, "The angle in [0, pi] with this cosine.", libm::acos, |x, _| -1.0 / (1.0 - x * x).sqrt()),
    smooth!("atan", X, "The angle in (-pi/2, pi/2) with this tangent.", libm::atan, |x, _| 1.0 / (1.0 + x * x)),
    of_pairs!(
        function(
            "atan2",
            SECTION,
            &[arg("y", Type::Nums, "The y coordinate."), arg("x", Type::Nums, "The x coordinate.")],
            Type::Nums,
            "The angle of the point (x, y) in [-pi, pi], in radians.",
            mapped,
        ),
        libm::atan2,
        |y, x, _| {
            let square = x * x + y * y;
            [x / square, -y / square]
        }
    ),
    smooth!("sinh", X, "The hyperbolic sine.", libm::sinh, |x, _| libm::cosh(x)),
    smooth!("cosh", X, "The hyperbolic cosine.", libm::cosh, |x, _| libm::sinh(x)),
    smooth!("tanh", X, "The hyperbolic tangent.", libm::tanh, |_, y| 1.0 - y * y),
    smooth!("deg", DEGREES, "Converts degrees to radians: `deg(180)` is pi.", |x| x * DEGREE, |_, _| DEGREE),
    smooth!("logit", X, "`log(p / (1 - p))`, for probabilities.", logit, |x, _| 1.0 / (x * (1.0 - x))),
    smooth!("expit", X, "`1 / (1 + exp(-x))`, the inverse of `logit`.", expit, |_, y| y * (1.0 - y)),
    smooth!("erf", X, "The error function.", libm::erf, |x, _| std::f64::consts::FRAC_2_SQRT_PI * libm::exp(-x * x)),
    smooth!("erfc", X, "`1 - erf(x)`, accurate where it is small.", libm::erfc, |x, _| {
        -std::f64::consts::FRAC_2_SQRT_PI * libm::exp(-x * x)
    }),
    smooth!("log1m_exp", X, "`log(1 - exp(x))`, accurate for `x` near 0 and far below; -inf at 0, NaN above.", num::log1m_exp, |x, _| {
        -1.0 / libm::expm1(-x)
    }),
    smooth!("lgamma", X, "The logarithm of the absolute value of the gamma function.", libm::lgamma, |x, _| {
        num::digamma(x)
    }),
];

/// Functions of the normal distribution, which searches find behind the distributions.
pub(super) const NORMAL: &[Row] = &[
    smooth!(
        "normal_cdf",
        X,
        "The probability that a standard normal number is at most `x`.",
        num::normal_cdf,
        |x, _| { num::normal_density(x) }
    ),
    smooth!(
        "log_normal_cdf",
        X,
        "The logarithm of `normal_cdf(x)`, also where that underflows.",
        num::log_normal_cdf,
        |x, _| { num::log_normal_cdf_slope(x) }
    ),
];

/// The partial derivatives of z = x^y.
pub(super) fn pow_slopes(x: f64, y: f64, z: f64) -> [f64; 2] {
    // At a base of 0, which has no logarithm, x^y does not vary with y.
    [
        if y == 0.0 { 0.0 } else { y * libm::pow(x, y - 1.0) },
        if z == 0.0 { 0.0 } else { z * libm::log(x) },
    ]
}

fn vjp_extreme(a: &Args, z: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
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

fn extreme(
    a: &Args,
    of_two: fn(f64, f64) -> f64,
    of_all: fn(&[f64]) -> f64,
) -> Result<Value, Fault> {
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
    let wrong =
        |i: usize| move |_: &Value, _: &Value| Err(a.wrong(i, "a number or an array of numbers"));
    let raised = numeric(a, a.get(0), a.get(1), larger, &wrong(1))?;
    numeric(a, &raised, a.get(2), smaller, &wrong(2))
}

/// `log p - log(1 - p)`, the second term with `log1p`, which is accurate for small `p`.
fn logit(p: f64) -> f64 {
    libm::log(p) - libm::log1p(-p)
}

fn expit(x: f64) -> f64 {
    // In this form the exponential never overflows.
    if x >= 0.0 {
        1.0 / (1.0 + libm::exp(-x))
    } else {
        let e = libm::exp(x);
        e / (1.0 + e)
    }
}
