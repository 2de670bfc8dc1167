//! Densities of values of the language and their derivatives: what observations and choices are scored by, whatever scores them.

use crate::dist::{Datum, Dist};
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{Args, CovarianceValue};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use crate::num::{ExactSum, accumulate};
use smallvec::SmallVec;
use std::sync::Arc;

/// The score of an observation.
pub(crate) enum Score {
    /// One term.
    One(f64),
    /// One an element.
    Sum(ExactSum),
}

/// The log density of an observed value under a likelihood.
pub(crate) fn likelihood_score(v: &Value, observed: &Value) -> Result<f64, Fault> {
    let Value::Likelihood(l) = v else { return Err(Fault::type_error("not a likelihood")) };
    let score = l.log_density(observed).map_err(Fault::type_error)?;
    if score.is_nan() {
        return Err(Fault::domain(format!("the likelihood `{}` is not a number here", l.name())));
    }
    Ok(score)
}

/// Scores a value, element by element where the distribution is over single numbers and the value is an array.
pub(crate) fn score(dist: &Dist, observed: &Value) -> Result<Score, Fault> {
    let wrong = || Fault::type_error(format!("`{}` cannot be observed to be {}", dist.name(), observed.type_name()));
    if let Some(count) = dist.elements() {
        if observed.len() != Some(count) {
            let got = observed.len().map_or(observed.type_name().to_owned(), |l| format!("{l} values"));
            return Err(Fault::type_error(format!("the distribution has {count} elements, but {got} are observed")));
        }
        return sum_scores(count, |i| {
            let x = observed.element(i).as_ref().and_then(Value::to_datum).ok_or_else(wrong)?;
            if matches!(x, Datum::Num(x) if x.is_nan()) {
                return Err(Fault::domain(format!("element {i} of what is observed is not a number")));
            }
            Ok(dist.element_log_density(i, &x))
        });
    }
    let nan = || Fault::domain("the observed value is not a number");
    match observed {
        Value::Num(x) if x.is_nan() => Err(nan()),
        Value::Array(xs) if xs.iter().any(|x| x.is_nan()) => Err(nan()),
        Value::Num(x) => Ok(Score::One(dist.log_density(&Datum::Num(*x)))),
        Value::Bool(b) => Ok(Score::One(dist.log_density(&Datum::Bool(*b)))),
        Value::Array(xs) if dist.is_scalar() => sum_scores(xs.len(), |i| Ok(dist.log_density(&Datum::Num(xs[i])))),
        Value::List(_) if observed.to_datum().is_some_and(|x| dist.support().fits(&x)) => {
            let x = observed.to_datum().ok_or_else(wrong)?;
            Ok(Score::One(dist.log_density(&x)))
        }
        Value::List(xs) => sum_scores(xs.len(), |i| xs[i].to_datum().map(|x| dist.log_density(&x)).ok_or_else(wrong)),
        Value::Array(xs) => Ok(Score::One(dist.log_density(&Datum::Vec(Arc::clone(xs))))),
        _ => Err(wrong()),
    }
}

fn sum_scores(count: usize, mut score: impl FnMut(usize) -> Result<f64, Fault>) -> Result<Score, Fault> {
    let mut sum = ExactSum::default();
    for i in 0..count {
        sum.add(score(i)?);
    }
    Ok(Score::Sum(sum))
}

/// The derivatives of the log density of a value: by the value, in its shape, and by the parameters. As scored, many values
/// under a distribution of one number are independent.
pub(crate) fn gradient(dist: &Dist, value: &Value) -> Option<(Adjoint, Vec<f64>)> {
    if let (Value::Array(xs), true) = (value, dist.is_scalar()) {
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
    let g = dist.gradient(&value.to_datum()?)?;
    let mut rest = &g.x[..];
    Some((shaped(value, &mut rest), g.params))
}

/// Numbers one after the other in the shape of a value; nothing by discrete parts.
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

/// From the derivatives by a distribution's parameters to those by the arguments it was made from.
pub(crate) fn by_arguments(a: &Args, dist: &Dist, params: &[f64]) -> SmallVec<[Adjoint; 4]> {
    let count = a.values.len();
    let covariance = matrix(a, dist).map(|(i, _)| i);
    // A product made of arrays: the parameters of each element in turn.
    if let Dist::Product(p) = dist
        && !p.is_empty()
    {
        let each = params.len() / p.len();
        let column = |i: usize| params.chunks_exact(each.max(1)).map(move |c| c.get(i).copied().unwrap_or(0.0));
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
            Value::Num(_) if dist.name() == "gp" => {
                Adjoint::Num(take(params.len()).map_or(0.0, |all| all.iter().sum()))
            }
            Value::Num(_) => take(1).map_or(Adjoint::Zero, |g| Adjoint::Num(g[0])),
            Value::Array(xs) => take(xs.len()).map_or(Adjoint::Unknown, Adjoint::Array),
            Value::Dist(d) => take(d.param_count()).map_or(Adjoint::Unknown, Adjoint::Array),
            Value::List(xs) => {
                let parts = xs.iter().map(|x| match x {
                    Value::Dist(d) => take(d.param_count()).map_or(Adjoint::Unknown, Adjoint::Array),
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

/// What an argument says of a covariance.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Matrix {
    Kernel,
    Covariance,
    Factor,
}

/// The argument with a covariance, whose derivatives come by another way: [`by_matrix`].
pub(crate) fn matrix(a: &Args, dist: &Dist) -> Option<(usize, Matrix)> {
    match (dist, a.get(1)) {
        (Dist::Gp(_), _) => Some((1, Matrix::Kernel)),
        (Dist::MvNormal(_), Value::Unit) => Some((2, Matrix::Factor)),
        (Dist::MvNormal(_), _) => Some((1, Matrix::Covariance)),
        _ => None,
    }
}

/// The derivatives by the argument with a covariance, and which it is: of the log density of a stored value, or of a function with
/// the derivatives `by_value` by the value that white noise makes. Nothing if there is no such argument; `None` where they are not known.
pub(crate) fn by_matrix(a: &Args, dist: &Dist, stored: &Datum, by_value: &[f64]) -> Option<Option<(usize, Adjoint)>> {
    let Some((i, which)) = matrix(a, dist) else { return Some(None) };
    let by = match dist {
        Dist::Gp(d) => {
            let cov = a.get(1).downcast::<CovarianceValue>()?;
            let at = a.array(2).ok()?;
            Adjoint::Array(d.covariance_gradient(&cov.0, &at, stored, by_value)?)
        }
        Dist::MvNormal(d) => {
            let rows = d.matrix_gradient(which == Matrix::Factor, stored, by_value)?;
            Adjoint::List(rows.into_iter().map(Adjoint::Array).collect())
        }
        _ => return None,
    };
    Some(Some((i, by)))
}
