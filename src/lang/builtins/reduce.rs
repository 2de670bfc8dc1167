//! Functions that make one number, or one running array, of an array of numbers. Sums run from left to right.

use super::derivative::{reduction, times};
use super::math::{larger, smaller};
use super::{Arg, Args, Builtin, Pull, Type, arg, function};
use crate::lang::adjoint::Adjoint;
use crate::lang::error::Fault;
use crate::lang::value::Value;
use smallvec::smallvec;

const SECTION: &str = "Sums and statistics";

const XS: &[Arg] = &[arg("xs", Type::Array, "Numbers; bools count 0 and 1.")];
const PAIR: &[Arg] = &[arg("xs", Type::Array, "Numbers."), arg("ys", Type::Array, "As many numbers.")];

const fn of_all(name: &'static str, doc: &'static str, f: fn(&Args) -> Result<Value, Fault>, pull: Pull) -> Builtin {
    function(name, SECTION, XS, Type::Num, doc, f).pull(pull)
}

pub(super) const TABLE: &[Builtin] = &[
    of_all(
        "sum",
        "The sum; 0 of nothing.",
        |a| a.numbers(0).map(|xs| Value::Num(sum(&xs))),
        |a, y, by| reduction(a, y, by, |xs, _| vec![1.0; xs.len()]),
    ),
    of_all(
        "prod",
        "The product; 1 of nothing.",
        |a| a.numbers(0).map(|xs| Value::Num(xs.iter().product())),
        |a, _, by| {
            let others =
                |xs: &[f64], i: usize| xs.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, x)| x).product();
            let xs = a.numbers(0).ok()?;
            let g = by.number();
            Some(smallvec![Adjoint::Array((0..xs.len()).map(|i| times(g, others(&xs, i))).collect())])
        },
    ),
    of_all(
        "mean",
        "The arithmetic mean of at least one number.",
        |a| a.numbers_from(0, 1).map(|xs| Value::Num(mean(&xs))),
        |a, y, by| reduction(a, y, by, |xs, _| vec![1.0 / xs.len() as f64; xs.len()]),
    ),
    of_all(
        "var",
        "The sample variance (divisor n - 1) of at least two numbers.",
        |a| a.numbers_from(0, 2).map(|xs| Value::Num(variance(&xs))),
        |a, y, by| reduction(a, y, by, |xs, _| spread_slopes(xs, 2.0)),
    ),
    of_all(
        "sd",
        "The sample standard deviation (divisor n - 1) of at least two numbers.",
        |a| a.numbers_from(0, 2).map(|xs| Value::Num(variance(&xs).sqrt())),
        |a, y, by| reduction(a, y, by, |xs, y| spread_slopes(xs, 1.0 / y)),
    ),
    of_all(
        "norm",
        "The Euclidean length.",
        |a| a.numbers(0).map(|xs| Value::Num(norm(&xs))),
        |a, y, by| reduction(a, y, by, |xs, y| xs.iter().map(|x| x / y).collect()),
    ),
    of_all(
        "log_sum_exp",
        "`log(sum(exp(xs)))` without overflow; -inf of nothing.",
        |a| a.numbers(0).map(|xs| Value::Num(log_sum_exp(&xs))),
        |a, y, by| reduction(a, y, by, |xs, y| xs.iter().map(|x| libm::exp(x - y)).collect()),
    ),
    function("cumsum", SECTION, XS, Type::Array, "The running sums.", |a| {
        let mut total = 0.0;
        let running = |x: &f64| {
            total += x;
            total
        };
        a.numbers(0).map(|xs| Value::array(xs.iter().map(running).collect::<Vec<_>>()))
    })
    .pull(|_, y, by| {
        let mut g = by.numbers(y.len()?);
        for i in (1..g.len()).rev() {
            g[i - 1] += g[i];
        }
        Some(smallvec![Adjoint::Array(g)])
    }),
    function("dot", SECTION, PAIR, Type::Num, "The sum of the products of corresponding elements.", |a| {
        a.number_pair(0, 1).map(|(xs, ys)| Value::Num(dot(&xs, &ys)))
    })
    .pull(|a, _, by| {
        let (xs, ys) = a.number_pair(0, 1).ok()?;
        let along = |v: &[f64]| Adjoint::Array(v.iter().map(|x| times(by.number(), *x)).collect());
        Some(smallvec![along(&ys), along(&xs)])
    }),
];

/// `factor (x - mean) / (n - 1)`: the derivatives of the variance for a factor of 2.
fn spread_slopes(xs: &[f64], factor: f64) -> Vec<f64> {
    let m = mean(xs);
    xs.iter().map(|x| factor * (x - m) / (xs.len() as f64 - 1.0)).collect()
}

fn sum(xs: &[f64]) -> f64 {
    // std's sum starts from -0, which shows for an empty array.
    xs.iter().fold(0.0, |s, x| s + x)
}

fn mean(xs: &[f64]) -> f64 {
    sum(xs) / xs.len() as f64
}

/// Two passes, so that a large mean does not swallow the spread.
fn variance(xs: &[f64]) -> f64 {
    let m = mean(xs);
    xs.iter().fold(0.0, |s, x| s + (x - m) * (x - m)) / (xs.len() as f64 - 1.0)
}

pub(super) fn dot(xs: &[f64], ys: &[f64]) -> f64 {
    xs.iter().zip(ys).fold(0.0, |s, (x, y)| s + x * y)
}

/// Scaled by the largest, so that squares neither overflow nor vanish.
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

/// The largest; -inf of nothing.
pub(super) fn largest(xs: &[f64]) -> f64 {
    xs.iter().copied().fold(f64::NEG_INFINITY, larger)
}

/// The smallest; inf of nothing.
pub(super) fn smallest(xs: &[f64]) -> f64 {
    xs.iter().copied().fold(f64::INFINITY, smaller)
}
