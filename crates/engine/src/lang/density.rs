//! Densities of values of the language and their derivatives, by which observations and
//! choices are scored in traces and on tapes.

use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{Args, CovarianceValue};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Datum, Dist, Flat, Support};
use pcadlang_numerics::num::{ExactSum, accumulate};
use smallvec::SmallVec;
use std::cmp::Ordering;
use std::sync::Arc;

/// The score of an observation.
#[derive(Clone, Debug)]
pub(crate) enum Score {
    /// One term.
    One(f64),
    /// A sum over elements.
    Sum(ExactSum),
}

/// True if it is flat everywhere. It then also accepts values that are not numbers: as a
/// surrogate, it ignores an observation.
fn tells_nothing(dist: &Dist) -> bool {
    matches!(dist, Dist::Flat(f) if *f == Flat::EVERYWHERE)
}

/// Returns the log density of an observed value under a likelihood.
pub(crate) fn likelihood_score(v: &Value, observed: &Value) -> Result<f64, Fault> {
    let Value::Likelihood(l) = v else { return Err(Fault::type_error("not a likelihood")) };
    let score = l.log_density(observed)?;
    if score.is_nan() {
        return Err(Fault::domain(format!("the likelihood `{}` is NaN here", l.name())));
    }
    Ok(score)
}

/// Scores a value, element by element if the distribution is over single numbers and the
/// value is an array.
pub(crate) fn score(dist: &Dist, observed: &Value) -> Result<Score, Fault> {
    let wrong = || {
        Fault::type_error(format!(
            "a value of `{}` cannot be {}",
            dist.name(),
            observed.type_name()
        ))
    };
    if let Some(count) = dist.elements() {
        if observed.len() != Some(count) {
            let got =
                observed.len().map_or(observed.type_name().to_owned(), |l| format!("{l} values"));
            return Err(Fault::type_error(format!(
                "expected {count} observed values, one per element of the distribution, got {got}"
            )));
        }
        return sum_scores(count, |i| {
            let x = observed.element(i).as_ref().and_then(Value::to_datum).ok_or_else(wrong)?;
            if matches!(x, Datum::Num(x) if x.is_nan()) {
                return Err(Fault::domain(format!(
                    "element {i} of the observed value is not a number"
                )));
            }
            Ok(dist.element_log_density(i, &x))
        });
    }
    let nan = || {
        Fault::domain("the observed value is not a number")
            .with_hint("leave out values that are missing: if not is_missing(x) { observe … = x; }")
    };
    match observed {
        Value::Num(x) if x.is_nan() => Err(nan()),
        Value::Array(xs) if xs.iter().any(|x| x.is_nan()) => Err(nan()),
        Value::Num(x) => Ok(Score::One(dist.log_density(&Datum::Num(*x)))),
        Value::Array(xs) if is_truth(dist) => {
            sum_scores(xs.len(), |i| Ok(dist.log_density(&Datum::Num(xs[i]))))
        }
        Value::Bool(b) => Ok(Score::One(dist.log_density(&Datum::Bool(*b)))),
        Value::Array(xs) if dist.is_scalar() => {
            sum_scores(xs.len(), |i| Ok(dist.log_density(&Datum::Num(xs[i]))))
        }
        Value::List(_) if observed.to_datum().is_some_and(|x| dist.support().fits(&x)) => {
            let x = observed.to_datum().ok_or_else(wrong)?;
            Ok(Score::One(dist.log_density(&x)))
        }
        Value::List(xs) => sum_scores(xs.len(), |i| {
            xs[i].to_datum().map(|x| dist.log_density(&x)).ok_or_else(|| {
                let (name, got) = (dist.name(), xs[i].type_name());
                let fault =
                    Fault::type_error(format!("element {i}: a value of `{name}` cannot be {got}"));
                match xs[i] {
                    Value::Unit => {
                        fault.with_hint("is_missing(x) tells which elements are missing")
                    }
                    _ => fault,
                }
            })
        }),
        Value::Array(xs) => Ok(Score::One(dist.log_density(&Datum::Vec(Arc::clone(xs))))),
        Value::Object(_) if tells_nothing(dist) => Ok(Score::One(0.0)),
        _ => Err(wrong()),
    }
}

/// Returns the log density of each observed value, whose sum is the [`score`]; NaN if it
/// is undefined.
pub(crate) fn pointwise(dist: &Dist, observed: &Value) -> Vec<f64> {
    let one = |d: &Dist, x: Option<Datum>| x.map_or(f64::NAN, |x| d.log_density(&x));
    let element = |i: usize| observed.element(i).as_ref().and_then(Value::to_datum);
    if let Some(count) = dist.elements() {
        let log_density = |i| element(i).map_or(f64::NAN, |x| dist.element_log_density(i, &x));
        return (0..count).map(log_density).collect();
    }
    match observed.len() {
        Some(count) if is_repeated(dist, observed) => {
            (0..count).map(|i| one(dist, element(i))).collect()
        }
        _ => vec![one(dist, observed.to_datum())],
    }
}

/// True if a value consists of several values of a distribution, each observed on its
/// own.
pub(crate) fn is_repeated(dist: &Dist, observed: &Value) -> bool {
    match observed {
        Value::Array(_) => dist.is_scalar() || is_truth(dist),
        Value::List(_) => !observed.to_datum().is_some_and(|x| dist.support().fits(&x)),
        _ => false,
    }
}

/// True if it is over a boolean; the numbers 1 and 0 of an array are then booleans too.
fn is_truth(dist: &Dist) -> bool {
    !dist.is_scalar() && dist.support() == Support::Boolean
}

fn sum_scores(
    count: usize,
    mut score: impl FnMut(usize) -> Result<f64, Fault>,
) -> Result<Score, Fault> {
    let mut sum = ExactSum::default();
    for i in 0..count {
        sum.add(score(i)?);
    }
    Ok(Score::Sum(sum))
}

/// Returns the derivatives of the log density with respect to the value, in its shape,
/// and to the parameters. As in scoring, several values under a distribution of one
/// number are independent.
pub(crate) fn gradient(dist: &Dist, value: &Value) -> Option<(Adjoint, Vec<f64>)> {
    if let (Value::Array(xs), true) = (value, dist.is_scalar() || is_truth(dist)) {
        let (mut by_x, mut params) = (Vec::with_capacity(xs.len()), Vec::new());
        for x in xs.iter() {
            let g = dist.gradient(&Datum::Num(*x))?;
            by_x.push(g.x.first().copied().unwrap_or(0.0));
            accumulate(&mut params, &g.params);
        }
        return Some((Adjoint::Array(by_x), params));
    }
    if let (Value::List(xs), None) = (value, dist.elements())
        && !value.to_datum().is_some_and(|x| dist.support().fits(&x))
    {
        let (mut by_x, mut params) = (Vec::with_capacity(xs.len()), Vec::new());
        for x in xs.iter() {
            let (one, own) = gradient(dist, x)?;
            by_x.push(one);
            accumulate(&mut params, &own);
        }
        return Some((Adjoint::List(by_x), params));
    }
    if matches!(value, Value::Object(_)) && tells_nothing(dist) {
        return Some((Adjoint::Zero, vec![0.0; dist.param_count()]));
    }
    let g = dist.gradient(&value.to_datum()?)?;
    let mut rest = &g.x[..];
    Some((shaped(value, &mut rest), g.params))
}

/// Arranges numbers in the shape of a value; discrete parts have zero adjoints.
fn shaped(value: &Value, rest: &mut &[f64]) -> Adjoint {
    match value {
        Value::Num(_) => match rest.split_first() {
            Some((g, after)) => {
                *rest = after;
                Adjoint::Num(*g)
            }
            None => Adjoint::Zero,
        },
        Value::Array(xs) if rest.len() >= xs.len() => {
            let (own, after) = rest.split_at(xs.len());
            *rest = after;
            Adjoint::Array(own.to_vec())
        }
        Value::List(xs) => Adjoint::List(xs.iter().map(|x| shaped(x, rest)).collect()),
        _ => Adjoint::Zero,
    }
}

/// Converts derivatives with respect to a distribution's parameters to derivatives with
/// respect to the arguments it was made from.
pub(crate) fn by_arguments(a: &Args, dist: &Dist, params: &[f64]) -> SmallVec<[Adjoint; 4]> {
    let count = a.values.len();
    let covariance = matrix(dist, a.values);
    // A product made from arrays: the parameters of each element in turn.
    if let Dist::Product(p) = dist
        && !p.is_empty()
    {
        let each = params.len() / p.len();
        let column = |i: usize| {
            params.chunks_exact(each.max(1)).map(move |c| c.get(i).copied().unwrap_or(0.0))
        };
        // A truncated one: the parameters of the base distribution, then the bounds.
        if let Value::Dist(d) = a.get(0) {
            let own = each.saturating_sub(2);
            let inner = params.chunks_exact(each.max(1)).map(|c| &c[..own]);
            let mut of_base = Vec::new();
            match &**d {
                Dist::Product(_) => inner.for_each(|c| of_base.extend(c)),
                _ => inner.for_each(|c| accumulate(&mut of_base, c)),
            }
            let bound = |i: usize| match a.get(i) {
                Value::Num(_) => Adjoint::Num(column(own + i - 1).sum()),
                Value::Array(_) => Adjoint::Array(column(own + i - 1).collect()),
                _ => Adjoint::Zero,
            };
            return (0..count)
                .map(|i| if i == 0 { Adjoint::Array(of_base.clone()) } else { bound(i) })
                .collect();
        }
        let one = |i: usize| match a.get(i) {
            Value::Num(_) => Adjoint::Num(column(i).sum()),
            Value::Array(_) => Adjoint::Array(column(i).collect()),
            _ => Adjoint::Zero,
        };
        return (0..count).map(one).collect();
    }
    let mut rest = params;
    let mut take = |n: usize| -> Option<Vec<f64>> {
        let (own, after) = rest.split_at_checked(n)?;
        rest = after;
        Some(own.to_vec())
    };
    let one = |i: usize| -> Adjoint {
        match a.get(i) {
            _ if covariance == Some(i) => Adjoint::Unknown,
            _ if matches!(a.values[i], Value::Unit) && matches!(dist, Dist::Gp(_)) => Adjoint::Zero,
            // The jitter.
            Value::Num(_) if i == 4 && matches!(dist, Dist::Gp(_)) => Adjoint::Unknown,
            Value::Num(_) if matches!(dist, Dist::Gp(_)) => {
                Adjoint::Num(take(params.len()).map_or(0.0, |all| all.iter().sum()))
            }
            Value::Num(_) => take(1).map_or(Adjoint::Zero, |g| Adjoint::Num(g[0])),
            Value::Array(xs) => take(xs.len()).map_or(Adjoint::Unknown, Adjoint::Array),
            Value::Dist(d) => take(d.param_count()).map_or(Adjoint::Unknown, Adjoint::Array),
            Value::List(xs) => {
                let parts = xs.iter().map(|x| match x {
                    Value::Dist(d) => {
                        take(d.param_count()).map_or(Adjoint::Unknown, Adjoint::Array)
                    }
                    _ => Adjoint::Unknown,
                });
                Adjoint::List(parts.collect())
            }
            Value::Unit | Value::Bool(_) | Value::Str(_) => Adjoint::Zero,
            _ => Adjoint::Unknown,
        }
    };
    (0..count).map(one).collect()
}

/// Returns the index of the argument that is a covariance or a factor of one, whose
/// derivatives are computed by [`by_factor`] and [`by_matrix`] instead.
pub(crate) fn matrix(dist: &Dist, values: &[&Value]) -> Option<usize> {
    match (dist, values.get(1)) {
        (Dist::MvNormal(_), Some(Value::Unit)) => Some(2),
        (Dist::Gp(_) | Dist::MvNormal(_) | Dist::Wishart(_), _) => Some(1),
        _ => None,
    }
}

/// Returns the derivatives with respect to the Cholesky factor of a distribution's
/// covariance (its lower triangle, row by row): for a value stored as such, those of its
/// log density; for one stored as white noise, those of the quantity whose derivatives
/// with respect to the value are `by_value`.
pub(crate) fn by_factor(dist: &Dist, stored: &Datum, by_value: &[f64]) -> Option<Vec<f64>> {
    match dist {
        Dist::Gp(d) => d.factor_gradient(stored, by_value),
        Dist::MvNormal(d) => d.factor_gradient(stored, by_value),
        Dist::Wishart(d) => d.scale_gradient(stored),
        _ => None,
    }
}

/// Converts those to derivatives with respect to the argument that the factor was made
/// from, in its shape.
pub(crate) fn by_matrix(a: &Args, dist: &Dist, by_factor: &[f64]) -> Option<Adjoint> {
    // An off-diagonal entry of a covariance occurs twice in it, one of a factor once.
    let rows = |by: &[f64], above: f64| {
        let n = (0..).find(|n| n * (n + 1) / 2 >= by.len()).unwrap_or(0);
        let cell = |i: usize, j: usize| {
            let (row, column) = (i.max(j), i.min(j));
            let share = match i.cmp(&j) {
                Ordering::Equal => 1.0,
                Ordering::Less => above,
                Ordering::Greater => 1.0 - above,
            };
            by.get(row * (row + 1) / 2 + column).map_or(0.0, |g| g * share)
        };
        Adjoint::List(
            (0..n).map(|i| Adjoint::Array((0..n).map(|j| cell(i, j)).collect())).collect(),
        )
    };
    match dist {
        Dist::Gp(d) => {
            let cov = a.get(1).downcast::<CovarianceValue>()?;
            Some(Adjoint::Array(d.vjp_covariance(&cov.0, &a.array(2).ok()?, by_factor)?))
        }
        Dist::MvNormal(d) if !matches!(a.get(1), Value::Unit) => {
            Some(rows(&d.vjp_covariance(by_factor), 0.5))
        }
        Dist::MvNormal(_) | Dist::Wishart(_) => Some(rows(by_factor, 0.0)),
        _ => None,
    }
}
