//! Reductions of an array of numbers to one number, and cumulative sums. Sums run from
//! left to right.

use super::derivative::times;
use super::{Arg, Derivative, Reduction, Row, Type, arg, function};
use crate::lang::adjoint::Adjoint;
use crate::lang::value::Value;
use smallvec::smallvec;

const SECTION: &str = "Sums and statistics";

const XS: &[Arg] = &[arg("xs", Type::Array, "Numbers; bools count 0 and 1.")];
const PAIR: &[Arg] =
    &[arg("xs", Type::Array, "Numbers."), arg("ys", Type::Array, "The same number of numbers.")];

/// The row of a function of at least `$least` numbers.
macro_rules! of_all {
    ($name:literal, $least:literal, $doc:literal, $f:expr, $slopes:expr) => {
        function($name, SECTION, XS, Type::Num, $doc, |a| {
            let f: fn(&[f64]) -> f64 = $f;
            a.numbers_from(0, $least).map(|xs| Value::Num(f(&xs)))
        })
        .derivative(Derivative::Reduction(&const { Reduction { value: $f, slopes: $slopes } }))
    };
}

pub(super) const TABLE: &[Row] = &[
    of_all!("sum", 0, "The sum; 0 if empty.", sum, |_, _, by| by.fill(1.0)),
    of_all!("prod", 0, "The product; 1 if empty.", |xs| xs.iter().product(), |xs, _, by| {
        let others =
            |i: usize| xs.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, x)| x).product();
        by.iter_mut().enumerate().for_each(|(i, by)| *by = others(i));
    }),
    of_all!("mean", 1, "The arithmetic mean of at least one number.", mean, |xs, _, by| by
        .fill(1.0 / xs.len() as f64)),
    of_all!(
        "var",
        2,
        "The sample variance (divisor n - 1) of at least two numbers.",
        variance,
        |xs, _, by| { variance_slopes(xs, 2.0, by) }
    ),
    of_all!(
        "sd",
        2,
        "The sample standard deviation (divisor n - 1) of at least two numbers.",
        |xs| variance(xs).sqrt(),
        |xs, y, by| variance_slopes(xs, 1.0 / y, by)
    ),
    of_all!("norm", 0, "The Euclidean norm.", norm, |xs, y, by| {
        by.iter_mut().zip(xs).for_each(|(by, x)| *by = x / y)
    }),
    of_all!(
        "log_sum_exp",
        0,
        "`log(sum(exp(xs)))` without overflow; -inf if empty.",
        log_sum_exp,
        |xs, y, by| by.iter_mut().zip(xs).for_each(|(by, x)| *by = libm::exp(x - y))
    ),
    function("cumsum", SECTION, XS, Type::Array, "The cumulative sums.", |a| {
        let mut total = 0.0;
        let running = |x: &f64| {
            total += x;
            total
        };
        a.numbers(0).map(|xs| Value::array(xs.iter().map(running).collect::<Vec<_>>()))
    })
    .vjp(|_, y, by| {
        let mut g = by.numbers(y.len()?);
        for i in (1..g.len()).rev() {
            g[i - 1] += g[i];
        }
        Some(smallvec![Adjoint::Array(g)])
    }),
    function(
        "dot",
        SECTION,
        PAIR,
        Type::Num,
        "The dot product: the sum of the products of corresponding elements.",
        |a| a.number_pair(0, 1).map(|(xs, ys)| Value::Num(dot(&xs, &ys))),
    )
    .vjp(|a, _, by| {
        let (xs, ys) = a.number_pair(0, 1).ok()?;
        let along = |v: &[f64]| Adjoint::Array(v.iter().map(|x| times(by.number(), *x)).collect());
        Some(smallvec![along(&ys), along(&xs)])
    }),
];

/// `factor (x - mean) / (n - 1)`: the derivatives of the variance if the factor is 2.
fn variance_slopes(xs: &[f64], factor: f64, by: &mut [f64]) {
    let m = mean(xs);
    by.iter_mut().zip(xs).for_each(|(by, x)| *by = factor * (x - m) / (xs.len() as f64 - 1.0));
}

fn sum(xs: &[f64]) -> f64 {
    // std's sum starts from -0, which would be the result for an empty array.
    xs.iter().fold(0.0, |s, x| s + x)
}

fn mean(xs: &[f64]) -> f64 {
    sum(xs) / xs.len() as f64
}

/// Two passes, so that a large mean does not cancel the variation.
fn variance(xs: &[f64]) -> f64 {
    let m = mean(xs);
    xs.iter().fold(0.0, |s, x| s + (x - m) * (x - m)) / (xs.len() as f64 - 1.0)
}

pub(crate) fn dot(xs: &[f64], ys: &[f64]) -> f64 {
    xs.iter().zip(ys).fold(0.0, |s, (x, y)| s + x * y)
}

/// Scaled by the largest element, so that squares neither overflow nor underflow.
fn norm(xs: &[f64]) -> f64 {
    let scale = xs.iter().fold(0.0, |m, x| larger(m, x.abs()));
    if scale == 0.0 || !scale.is_finite() {
        return scale;
    }
    scale * xs.iter().fold(0.0, |s, x| s + (x / scale) * (x / scale)).sqrt()
}

fn log_sum_exp(xs: &[f64]) -> f64 {
    let top = largest(xs);
    if !top.is_finite() {
        return top;
    }
    top + libm::log(xs.iter().fold(0.0, |s, x| s + libm::exp(x - top)))
}

/// The largest element; -inf if empty.
pub(super) fn largest(xs: &[f64]) -> f64 {
    xs.iter().copied().fold(f64::NEG_INFINITY, larger)
}

/// The smallest element; inf if empty.
pub(super) fn smallest(xs: &[f64]) -> f64 {
    xs.iter().copied().fold(f64::INFINITY, smaller)
}

/// The smaller of two numbers, NaN if either is (std's `min` ignores NaN, which would
/// hide a mistake).
pub(super) fn smaller(x: f64, y: f64) -> f64 {
    if x < y || x.is_nan() { x } else { y }
}

/// The larger of two numbers, NaN if either is.
pub(super) fn larger(x: f64, y: f64) -> f64 {
    if x > y || x.is_nan() { x } else { y }
}
