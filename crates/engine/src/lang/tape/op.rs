//! The operations of a tape, forwards and backwards.

use super::form::{Form, call_from, vjp_call};
use super::log_sum_exp::LogSumExp;
use super::values::{Adjoints, Values};
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{Binary, Builtin, PreviousEvaluation, Reduction, times};
use crate::lang::density;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Batch, Datum, Dist, Rows};
use pcadlang_numerics::num::simd::{sum_of_triples, vectorised_if_many};
use pcadlang_numerics::num::{Column, ExactSum};
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::Arc;

/// The sums of the scores on a tape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScoreSums {
    /// The log prior of the choices on the tape.
    pub prior: ExactSum,
    /// The log density of the observations and factors on the tape.
    pub likelihood: ExactSum,
    /// The log Jacobians of the transforms.
    pub jacobian: ExactSum,
}

/// The terms that an operation added to the sums of the scores.
#[derive(Clone, Debug)]
pub enum ScoreTerms {
    /// One term.
    One(f64),
    /// Terms of the elements of an array.
    Each,
    /// The sum of such terms.
    Sum(ExactSum),
}

/// Where the score of one choice, observation or factor is on a tape.
#[derive(Clone, Debug)]
pub enum Scored {
    /// The terms of an operation.
    Operation(usize),
    /// One of the terms of an operation for several scores.
    Member(usize, usize, IsArray),
    /// Numbers of the buffer from an index on: the terms of the elements of an array, or a
    /// single one.
    Numbers(Range<usize>, IsArray),
}

/// True if terms are those of an array's elements, which may be one.
type IsArray = bool;

/// An operation; the numbers it reads precede those it writes.
#[derive(Debug)]
pub(super) enum Op {
    /// A function of one number x with value y, and its slope as a function of x and y,
    /// element by element.
    Unary { f: fn(f64) -> f64, slope: fn(f64, f64) -> f64, x: usize, out: usize, n: usize },
    /// A function of two numbers, element by element.
    Binary { f: &'static Binary, x: Column, y: Column, out: usize, n: usize },
    /// A reduction of an array to one number.
    Reduce { f: &'static Reduction, x: usize, n: usize, out: usize },
    /// The product of a fixed matrix, stored row by row from `rows` on, and a vector.
    Matrix { rows: usize, x: usize, width: usize, out: usize, n: usize },
    /// Numbers gathered from anywhere into an array.
    Gather { from: Box<[usize]>, out: usize },
    /// A call of any built-in whose result has a place.
    Call {
        builtin: Builtin,
        args: Box<[Form]>,
        out: Form,
        before: Option<Arc<PreviousEvaluation>>,
        keeps: bool,
    },
    /// The value of a choice that is stored as white noise.
    Coloured { dist: Form, noise: Form, out: usize, n: usize, last: Option<Dist> },
    /// A value that must be the same as when the tape was recorded.
    Guard { form: Form, value: Value },
    /// The log densities of numbers: added to the sums of scores, or numbers in the buffer.
    Density {
        batch: Box<dyn Batch>,
        x: Column,
        params: SmallVec<[Column; 3]>,
        n: usize,
        observed: bool,
        out: Option<usize>,
        /// The distribution when it was recorded, if it is of one number.
        dist: Option<Dist>,
    },
    /// The log density of any value under any distribution or likelihood: added to the
    /// sums of scores, or a number in the buffer. Those of the last run are kept.
    Score {
        dist: Form,
        x: Form,
        observed: bool,
        out: Option<usize>,
        last: Option<(Value, density::Score)>,
    },
    /// A log weight.
    Factor { x: usize },
    /// The log of a sum of exponentials of sums of terms.
    LogSumExp(LogSumExp),
    /// Log densities from which choices are summed out, in runs of consecutive places.
    Total { from: Vec<Range<usize>> },
}

impl Op {
    /// Runs it; false if the tape cannot evaluate the program here.
    pub fn forward(&mut self, values: &mut Values, sums: &mut ScoreSums, power: f64) -> bool {
        let v = &mut values.numbers[..];
        match self {
            Op::Unary { f, x, out, n, .. } => {
                let (before, y) = v.split_at_mut(*out);
                y[..*n].iter_mut().zip(&before[*x..*x + *n]).for_each(|(y, x)| *y = f(*x));
                true
            }
            Op::Binary { f, x, y, out, n } => {
                (f.forward)(v, *x, *y, *out, *n);
                true
            }
            Op::Reduce { f, x, n, out } => {
                v[*out] = (f.value)(&v[*x..*x + *n]);
                true
            }
            Op::Matrix { rows, x, width, out, n } => {
                let (before, y) = v.split_at_mut(*out);
                let x = &before[*x..*x + *width];
                let rows = before[*rows..].chunks_exact((*width).max(1));
                y[..*n]
                    .iter_mut()
                    .zip(rows)
                    .for_each(|(y, row)| *y = crate::lang::builtins::dot(row, x));
                true
            }
            Op::Gather { from, out } => {
                from.iter().enumerate().for_each(|(i, at)| v[*out + i] = v[*at]);
                true
            }
            Op::Call { builtin, args, out, before, keeps } => {
                match call_from(builtin, args, values, before, *keeps) {
                    Some(value) => out.write(values, &value),
                    None => false,
                }
            }
            Op::Coloured { dist, noise, out, n, last } => {
                let Some(Value::Dist(d)) = dist.value(values) else { return false };
                let Some(z) = noise.value(values).and_then(|z| z.to_datum()) else { return false };
                let there = match d.from_noncentred(&z) {
                    Datum::Vec(x) if x.len() == *n => {
                        values.numbers[*out..*out + *n].copy_from_slice(&x);
                        true
                    }
                    _ => false,
                };
                *last = Some(Dist::clone(&d));
                there
            }
            Op::Guard { form, value } => form.value(values).is_some_and(|now| now.same(value)),
            Op::Density { batch, x, params, n, observed, out, .. } => {
                let rows = Rows { x: *x, params, n: *n };
                match out {
                    Some(out) => batch.score_each(v, rows, *out),
                    None => batch.score(v, rows, sums.of(*observed)),
                }
            }
            Op::Score { dist, x, observed, out, last } => {
                let (Some(dist), Some(x)) = (dist.value(values), x.value(values)) else {
                    return false;
                };
                let Some(found) = score(&dist, &x, *observed) else { return false };
                let mut own = ExactSum::default();
                let sum = if out.is_some() { &mut own } else { sums.of(*observed) };
                match &found {
                    density::Score::One(score) => sum.add(*score),
                    density::Score::Sum(scores) => sum.merge(scores),
                }
                if let Some(out) = out {
                    values.numbers[*out] = own.value();
                }
                *last = Some((dist, found));
                true
            }
            Op::Factor { x } => {
                sums.likelihood.add(v[*x]);
                !v[*x].is_nan()
            }
            Op::LogSumExp(l) => l.forward(v, power),
            Op::Total { from } => {
                sums.prior.add(sum(from, v));
                true
            }
        }
    }

    /// Propagates adjoints backwards; false if a derivative is not known.
    pub fn reverse(
        &self,
        values: &Values,
        adjoints: &mut Adjoints,
        power: f64,
        scratch: &mut Vec<f64>,
    ) -> bool {
        let (v, g) = (&values.numbers[..], &mut adjoints.numbers[..]);
        let weight = |observed: bool| if observed { power } else { 1.0 };
        match self {
            Op::Unary { slope, x, out, n, .. } => {
                for i in 0..*n {
                    g[x + i] += times(g[out + i], slope(v[x + i], v[out + i]));
                }
                true
            }
            Op::Binary { f, x, y, out, n } => {
                (f.reverse)(v, g, *x, *y, *out, *n);
                true
            }
            Op::Reduce { f, x, n, out } => {
                let by = g[*out];
                scratch.clear();
                scratch.resize(*n, 0.0);
                (f.slopes)(&v[*x..x + n], v[*out], scratch);
                g[*x..x + n].iter_mut().zip(scratch).for_each(|(g, s)| *g += times(by, *s));
                true
            }
            Op::Matrix { rows, x, width, out, n } => {
                let (before, by) = g.split_at_mut(*out);
                let rows = v[*rows..].chunks_exact((*width).max(1));
                for (by, row) in by[..*n].iter().zip(rows) {
                    before[*x..x + width]
                        .iter_mut()
                        .zip(row)
                        .for_each(|(g, a)| *g += times(*by, *a));
                }
                true
            }
            Op::Gather { from, out } => {
                from.iter().enumerate().for_each(|(i, at)| g[*at] += g[out + i]);
                true
            }
            Op::Call { builtin, args, out, .. } => {
                let by = out.take_adjoint(adjoints);
                by.is_zero()
                    || out
                        .value(values)
                        .is_some_and(|value| vjp_call(builtin, args, value, &by, values, adjoints))
            }
            Op::Coloured { dist, noise, out, n, last } => {
                let Some(d) = last else { return false };
                let by = g[*out..*out + *n].to_vec();
                vjp_coloured((dist, d), noise, by, values, adjoints).unwrap_or(false)
            }
            Op::Guard { .. } => true,
            Op::Density { batch, x, params, n, observed, out, .. } => {
                let rows = Rows { x: *x, params, n: *n };
                match out {
                    Some(out) => batch.vjp_each(v, g, rows, *out),
                    None => batch.vjp(v, g, rows, weight(*observed)),
                }
                true
            }
            Op::Score { dist, x, observed, out, last } => {
                let Some((made, _)) = last else { return false };
                let weight = out.map_or(weight(*observed), |out| g[out]);
                weight == 0.0
                    || vjp_score((dist, made), x, *observed, values, adjoints, weight)
                        .unwrap_or(false)
            }
            Op::Factor { x } => {
                g[*x] += power;
                true
            }
            Op::LogSumExp(l) => {
                l.reverse(g, power);
                true
            }
            Op::Total { from } => {
                from.iter().for_each(|run| g[run.clone()].iter_mut().for_each(|g| *g += 1.0));
                true
            }
        }
    }
}

impl Op {
    /// Returns the last evaluation of an incremental function.
    pub fn evaluation(&self) -> Option<&Arc<PreviousEvaluation>> {
        match self {
            Op::Call { before, .. } => before.as_ref(),
            _ => None,
        }
    }

    /// Returns the terms that it added to the sums in the last run, and appends them to
    /// `each` if they are separate; `None` if it added none.
    pub fn terms(&self, v: &[f64], each: &mut Vec<f64>) -> Option<ScoreTerms> {
        match self {
            Op::Density { batch, x, params, n, out: None, .. } => {
                batch.each(v, Rows { x: *x, params, n: *n }, each);
                match (x.step, &each[..]) {
                    (0, [one]) => Some(ScoreTerms::One(*one)),
                    _ => Some(ScoreTerms::Each),
                }
            }
            Op::Score { last, .. } => match &last.as_ref()?.1 {
                density::Score::One(score) => Some(ScoreTerms::One(*score)),
                density::Score::Sum(sum) => Some(ScoreTerms::Sum(sum.clone())),
            },
            Op::Factor { x } => Some(ScoreTerms::One(v[*x])),
            _ => None,
        }
    }
}

impl ScoreSums {
    /// Moves sums of which these are a part from an earlier run, `old`, to this one.
    pub fn replace(&self, old: &ScoreSums, prior: &mut ExactSum, likelihood: &mut ExactSum) {
        for (sum, new, old) in
            [(prior, &self.prior, &old.prior), (likelihood, &self.likelihood, &old.likelihood)]
        {
            sum.merge(new);
            sum.unmerge(old);
        }
    }

    /// The sum of the observations' scores, or of the choices'.
    pub fn of(&mut self, observed: bool) -> &mut ExactSum {
        if observed { &mut self.likelihood } else { &mut self.prior }
    }
}

/// The sum of some numbers, in a fixed order. These are logs of sums, which are rounded
/// themselves, so an exact sum would be no more accurate.
fn sum(from: &[Range<usize>], v: &[f64]) -> f64 {
    let of_run = |run: &Range<usize>| {
        let xs = &v[run.clone()];
        vectorised_if_many(
            xs.len(),
            #[inline(always)]
            || sum_of_triples(xs, xs, xs, |x, _, _| x),
        )
    };
    from.iter().map(of_run).sum()
}

/// Places in their order, as runs of consecutive ones.
pub(super) fn runs(places: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for at in places {
        match runs.last_mut() {
            Some(run) if run.end == at => run.end = at + 1,
            _ => runs.push(at..at + 1),
        }
    }
    runs
}

/// Returns the log density of a value; `None` if it is undefined.
fn score(dist: &Value, x: &Value, observed: bool) -> Option<density::Score> {
    match dist {
        // A value drawn as one choice has one density, even if it is an array.
        Value::Dist(d) if !observed && d.elements().is_none() => {
            x.to_datum().map(|x| density::Score::One(d.log_density_stored(&x)))
        }
        Value::Dist(d) => density::score(d, x).ok(),
        Value::Likelihood(_) => density::likelihood_score(dist, x).ok().map(density::Score::One),
        _ => None,
    }
}

fn vjp_score(
    (dist, made): (&Form, &Value),
    x: &Form,
    observed: bool,
    at: &Values,
    adjoints: &mut Adjoints,
    weight: f64,
) -> Option<bool> {
    let value = x.value(at)?;
    if let Value::Likelihood(l) = made {
        let mut by = l.gradient(&value)?;
        by.scale(weight);
        return Some(dist.vjp(by, at, adjoints));
    }
    let Value::Dist(d) = made else { return None };
    if !observed && d.is_stored_whitened() {
        // White noise has a density of its own.
        let mut by = Adjoint::Array(d.gradient_stored(&value.to_datum()?)?.x);
        by.scale(weight);
        return Some(x.vjp(by, at, adjoints));
    }
    let (mut by_x, mut params) = density::gradient(d, &value)?;
    by_x.scale(weight);
    params.iter_mut().for_each(|p| *p *= weight);
    let stored = value.to_datum()?;
    // The observed datum is the value itself, even if a choice would be stored
    // non-centred.
    let scored: Dist = if observed { Dist::clone(d).centred() } else { Dist::clone(d) };
    let by_matrix = |a: &crate::lang::builtins::Args| {
        let mut by = density::by_matrix(a, &scored, &density::by_factor(&scored, &stored, &[])?)?;
        by.scale(weight);
        Some(by)
    };
    Some(x.vjp(by_x, at, adjoints) && dist.vjp_dist(d, params, by_matrix, at, adjoints))
}

/// Propagates the adjoint of a value stored as white noise to the noise and to the
/// parameters: value = mean + L noise.
fn vjp_coloured(
    (dist, d): (&Form, &Dist),
    noise: &Form,
    by: Vec<f64>,
    at: &Values,
    adjoints: &mut Adjoints,
) -> Option<bool> {
    let by_noise = Adjoint::Array(d.from_noncentred_vjp(&by)?);
    if !noise.vjp(by_noise, at, adjoints) {
        return Some(false);
    }
    if dist.is_fixed() {
        return Some(true);
    }
    let stored = noise.value(at)?.to_datum()?;
    let by_factor = density::by_factor(d, &stored, &by);
    let by_matrix = |a: &crate::lang::builtins::Args| density::by_matrix(a, d, &by_factor?);
    Some(dist.vjp_dist(d, by, by_matrix, at, adjoints))
}
