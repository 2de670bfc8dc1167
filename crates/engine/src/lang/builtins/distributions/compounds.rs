//! Distributions composed of other distributions.

use super::parameter_fault::made;
use crate::lang::builtins::Args;
use crate::lang::builtins::elementwise::array_len;
use crate::lang::error::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{self, Dist};
use std::sync::Arc;

/// Reads an array of distributions.
fn distributions(a: &Args, i: usize) -> Result<Vec<Dist>, Fault> {
    let component = |v: &Value| match v {
        Value::Dist(d) => Ok(Dist::clone(d)),
        other => Err(a.element_wrong(i, "an array of distributions", other)),
    };
    a.elements(i)?.iter().map(component).collect()
}

/// `n` numbers of a single distribution, or one of each in an array, in ascending order.
pub(super) fn ordered(a: &Args) -> Result<Dist, Fault> {
    made(match a.get(0) {
        Value::Dist(d) if a.given(1) => dist::Ordered::new(Dist::clone(d), a.count(1)?),
        Value::Dist(_) => {
            let hint = "ordered(normal(0, 1), 3) is three numbers; list different priors: ordered([d1, d2])";
            return Err(Fault::type_error("ordered: with a single distribution, `n` is required")
                .with_hint(hint));
        }
        _ if a.given(1) => {
            let hint = "omit `n`: an array gives one number per distribution";
            return Err(a.wrong(0, "a single distribution when `n` is given").with_hint(hint));
        }
        Value::List(_) | Value::Array(_) => dist::Ordered::of(distributions(a, 0)?),
        _ => return Err(a.wrong(0, "a distribution or an array of distributions")),
    })
}

/// A distribution truncated to an interval, element by element if a bound is an array.
pub(super) fn truncated(a: &Args) -> Result<Dist, Fault> {
    let Value::Dist(d) = a.get(0) else { return Err(a.wrong(0, "a distribution")) };
    let mut columns: [Option<Arc<[f64]>>; 2] = [None, None];
    let mut bounds = [0.0; 2];
    for i in 0..2 {
        match a.get(i + 1) {
            Value::Num(x) => bounds[i] = *x,
            v if array_len(v).is_some() => columns[i] = Some(a.array(i + 1)?),
            _ => return Err(a.wrong(i + 1, "a number or an array of numbers")),
        }
    }
    let Some(n) = columns.iter().flatten().map(|xs| xs.len()).next() else {
        return made(dist::truncated(d, bounds[0], bounds[1]));
    };
    let expected = d.elements().unwrap_or(n);
    if let Some(i) = columns.iter().position(|c| c.as_ref().is_some_and(|xs| xs.len() != expected))
    {
        return Err(a.wrong_length(i + 1, &format!("as many elements as the rest, {expected}")));
    }
    let mut elements = Vec::with_capacity(n);
    for k in 0..n {
        let [lo, hi] = [0, 1].map(|i| columns[i].as_ref().map_or(bounds[i], |xs| xs[k]));
        let one = dist::truncated(&d.element(k), lo, hi);
        elements.push(one.map_err(|e| Fault::domain(format!("{e} (element {k})")))?);
    }
    made(dist::Product::new(elements))
}

/// A weighted mixture of distributions.
pub(super) fn mixture(a: &Args) -> Result<Dist, Fault> {
    let components = distributions(a, 1)?;
    made(dist::Mixture::new(&a.array(0)?, components))
}
