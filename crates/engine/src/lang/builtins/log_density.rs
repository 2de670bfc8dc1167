//! The log density of a value under a distribution, as a number: for marginalised
//! mixtures, pointwise scores and factors.

use super::{ArgAdjoints, Args, Row, Type, arg, function};
use crate::lang::adjoint::Adjoint;
use crate::lang::density::{self, Score};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::Dist;
use smallvec::smallvec;

pub(super) const TABLE: &[Row] = &[function(
    "log_density",
    "Distributions",
    &[
        arg("d", Type::Dist, "A distribution."),
        arg("x", Type::Any, "A value of `d`, or an array of values."),
    ],
    Type::Num,
    "The log density (of a discrete distribution, the log probability) of `x` under `d`, in nats: \
     -inf outside the support. Several values of a scalar distribution are treated as \
     independent, as in `observe`: their log densities are summed.",
    |a| {
        let d = dist(a)?;
        if !fits(d, a.get(1)) {
            let wanted = format!("as `{}` draws it", d.name());
            return Err(a.wrong(1, &format!("a value {wanted}")).with_hint(drawn(d)));
        }
        let nan = |_| Fault::domain("log_density: `x` is not a number");
        Ok(Value::Num(match density::score(d, a.get(1)).map_err(nan)? {
            Score::One(score) => score,
            Score::Sum(scores) => scores.value(),
        }))
    },
)
.vjp(vjp)];

fn dist<'a>(a: &Args<'a>) -> Result<&'a Dist, Fault> {
    match a.get(0) {
        Value::Dist(d) => Ok(d),
        Value::Likelihood(_) => Err(a
            .wrong(0, "a distribution")
            .with_hint("a likelihood is scored by `observe`, and its sum is log_likelihood()")),
        _ => Err(a
            .wrong(0, "a distribution")
            .with_hint("the distribution comes first: log_density(normal(0, 1), x)")),
    }
}

/// True if a value is in the space of a distribution, or an array of such values.
fn fits(d: &Dist, x: &Value) -> bool {
    let one = |d: &Dist, x: &Value| x.to_datum().is_some_and(|x| d.support().fits(&x));
    match (d.elements(), x) {
        (Some(n), x) => {
            x.len() == Some(n)
                && (0..n).all(|i| x.element(i).is_some_and(|x| one(&d.element(i), &x)))
        }
        (None, Value::Array(_)) if d.is_scalar() => true,
        (None, Value::List(xs)) => one(d, x) || xs.iter().all(|x| one(d, x)),
        (None, x) => one(d, x),
    }
}

/// Describes the values of a distribution, as a hint.
fn drawn(d: &Dist) -> String {
    let name = d.name();
    match d.elements() {
        Some(n) => format!("`{name}` has {n} elements here, so `x` is an array of {n} values"),
        None if d.is_scalar() => {
            format!("`{name}` draws numbers: `x` is a number or an array of them")
        }
        None if matches!(d.support(), pcadlang_numerics::dist::Support::Boolean) => {
            format!("`{name}` draws true or false: compare a number, as in `n == 1`")
        }
        None => format!("`{name}` draws arrays; see `pcadlang doc {name}`"),
    }
}

/// The adjoint of the distribution has its parameters, then the entries of the factor of
/// its covariance if it has one. Adjoints are zero where the log density is not finite.
fn vjp(a: &Args, value: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let (Value::Dist(d), Value::Num(score)) = (a.get(0), value) else { return None };
    let weight = by.number();
    if weight == 0.0 || !score.is_finite() {
        return Some(ArgAdjoints::new());
    }
    // The value itself is scored, even if choices of this distribution are stored as
    // noise.
    let d = Dist::clone(d).centred();
    let (mut by_x, mut params) = density::gradient(&d, a.get(1))?;
    if density::matrix(&d, &[]).is_some() {
        params.resize(d.param_count(), 0.0);
        params.extend(density::by_factor(&d, &a.get(1).to_datum()?, &[])?);
    }
    by_x.scale(weight);
    params.iter_mut().for_each(|p| *p *= weight);
    Some(smallvec![Adjoint::Array(params), by_x])
}
