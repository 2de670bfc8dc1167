//! Functions that make one number, or one running array, of an array of numbers. Sums run from left to right.

use super::math::{larger, smaller};
use super::{Arg, Args, Builtin, Type, arg, function};
use crate::lang::error::Fault;
use crate::lang::value::Value;

const SECTION: &str = "Sums and statistics";

const XS: &[Arg] = &[arg("xs", Type::Array, "Numbers; bools count 0 and 1.")];
const PAIR: &[Arg] = &[arg("xs", Type::Array, "Numbers."), arg("ys", Type::Array, "As many numbers.")];

const fn of_all(name: &'static str, doc: &'static str, f: fn(&Args) -> Result<Value, Fault>) -> Builtin {
    function(name, SECTION, XS, Type::Num, doc, f)
}

pub(super) const TABLE: &[Builtin] = &[
    of_all("sum", "The sum; 0 of nothing.", |a| a.numbers(0).map(|xs| Value::Num(sum(&xs)))),
    of_all("prod", "The product; 1 of nothing.", |a| a.numbers(0).map(|xs| Value::Num(xs.iter().product()))),
    of_all("mean", "The arithmetic mean of at least one number.", |a| {
        a.numbers_from(0, 1).map(|xs| Value::Num(mean(&xs)))
    }),
    of_all("var", "The sample variance (divisor n - 1) of at least two numbers.", |a| {
        a.numbers_from(0, 2).map(|xs| Value::Num(variance(&xs)))
    }),
    of_all("sd", "The sample standard deviation (divisor n - 1) of at least two numbers.", |a| {
        a.numbers_from(0, 2).map(|xs| Value::Num(variance(&xs).sqrt()))
    }),
    of_all("norm", "The Euclidean length.", |a| a.numbers(0).map(|xs| Value::Num(norm(&xs)))),
    of_all("log_sum_exp", "`log(sum(exp(xs)))` without overflow; -inf of nothing.", |a| {
        a.numbers(0).map(|xs| Value::Num(log_sum_exp(&xs)))
    }),
    function("cumsum", SECTION, XS, Type::Array, "The running sums.", |a| {
        let mut total = 0.0;
        let running = |x: &f64| {
            total += x;
            total
        };
        a.numbers(0).map(|xs| Value::array(xs.iter().map(running).collect::<Vec<_>>()))
    }),
    function("dot", SECTION, PAIR, Type::Num, "The sum of the products of corresponding elements.", |a| {
        a.number_pair(0, 1).map(|(xs, ys)| Value::Num(dot(&xs, &ys)))
    }),
];

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
