//! Derivatives of what a trace is scored by: choices under their priors, observations, factors.

use super::{Inputs, Reverse};
use crate::dist::{Datum, Dist};
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{Args, CovarianceValue};
use crate::lang::code::{DistSpec, Op};
use crate::lang::value::Value;
use crate::num::accumulate;
use crate::trace::demand::Failure;
use crate::trace::node::*;
use smallvec::SmallVec;

impl Reverse<'_> {
    /// The nodes that the score of a choice, observation or factor is computed from, but for the choice itself.
    pub(super) fn score_inputs(&self, n: NodeId) -> Inputs {
        let mut all = Inputs::new();
        let frame = self.graph.nodes[n as usize].frame;
        match self.graph.op(self.code, n) {
            // The density of white noise is the same whatever it is the noise of.
            Op::Draw { .. } if self.graph.is_whitened(n) => {}
            Op::Draw { dist, .. } => self.dist_inputs(n, dist, &mut all),
            Op::Observe { dist, value, .. } => {
                self.dist_inputs(n, dist, &mut all);
                if self.graph.replaced(self.code, n).is_none() {
                    all.extend(self.source(frame, *value));
                }
            }
            Op::Factor { weight, .. } => all.extend(self.source(frame, *weight)),
            _ => {}
        }
        all
    }

    /// Derivatives of one score.
    pub(super) fn pull_score(&mut self, n: NodeId) -> Result<(), Failure> {
        let (g, code) = (self.graph, self.code);
        let frame = g.nodes[n as usize].frame;
        match g.op(code, n) {
            Op::Factor { weight, .. } => self.give(frame, *weight, Adjoint::Num(self.power)),
            Op::Draw { dist: spec, .. } => {
                let Some(dist) = g.dist_of(code, n) else { return Ok(()) };
                let Some(stored) = g.stored(n) else { return Ok(()) };
                let own = self.is_active(n);
                if g.is_whitened(n) {
                    // Added where the noise's own derivative is made.
                    return Ok(());
                }
                let Some((mut by_x, mut params)) = of_value(&dist, &Value::from_datum(&stored)) else {
                    return Err(self.no_derivative(n, &format!("the density of `{}`", dist.name())));
                };
                scale(&mut by_x, self.weight);
                params.iter_mut().for_each(|p| *p *= self.weight);
                if own {
                    self.give_node(n, by_x);
                }
                self.give_params(n, spec, &dist, params)?;
                self.give_matrix(n, spec, &dist, &stored, &[], self.weight)?;
            }
            Op::Observe { dist: spec, value, .. } => {
                let mut deps = Deps::new();
                let observed = g.observed_value(code, n, *value, &mut deps);
                if let DistSpec::Value(o) = spec
                    && let Value::Likelihood(l) = g.value(code, frame, *o)
                {
                    let Some(mut by) = l.gradient(observed) else {
                        return Err(self.no_derivative(n, &format!("the likelihood `{}`", l.name())));
                    };
                    scale(&mut by, self.power);
                    self.give(frame, *o, by);
                    return Ok(());
                }
                let dist = g.make_dist(code, n, frame, spec, &mut deps)?;
                let Some((mut by_x, mut params)) = of_value(&dist, observed) else {
                    return Err(self.no_derivative(n, &format!("the density of `{}`", dist.name())));
                };
                scale(&mut by_x, self.power);
                params.iter_mut().for_each(|p| *p *= self.power);
                if g.replaced(code, n).is_none() {
                    self.give(frame, *value, by_x);
                }
                self.give_params(n, spec, &dist, params)?;
                if let Some(x) = observed.to_datum() {
                    // What is observed is the value, however a choice would be stored.
                    self.give_matrix(n, spec, &dist.centred(), &x, &[], self.power)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Hands the derivatives by a distribution's parameters to what they were computed from.
    pub(super) fn give_params(
        &mut self,
        n: NodeId,
        spec: &DistSpec,
        dist: &Dist,
        params: Vec<f64>,
    ) -> Result<(), Failure> {
        let frame = self.graph.nodes[n as usize].frame;
        match spec {
            DistSpec::Value(o) => self.give(frame, *o, Adjoint::Array(params)),
            DistSpec::Family { builtin, args } => {
                let builtin = self.code.builtins.get(*builtin);
                let values = self.values(frame, args);
                let mut pulled = by_arguments(&Args { builtin, values: &values }, dist, &params);
                pulled
                    .iter_mut()
                    .enumerate()
                    .filter(|(i, _)| is_matrix(dist, *i))
                    .for_each(|(_, p)| *p = Adjoint::Zero);
                self.give_arguments(n, builtin, args.iter().map(|o| Some(*o)), pulled)?;
            }
        }
        Ok(())
    }
}

/// What [`Reverse::give_matrix`] is about: the argument with a covariance.
enum Matrix {
    Kernel,
    Covariance,
    Factor,
}

impl Reverse<'_> {
    /// Hands the derivatives by a covariance, `weight` times, to what it was computed from; [`by_arguments`] leaves it out.
    pub(super) fn give_matrix(
        &mut self,
        n: NodeId,
        spec: &DistSpec,
        dist: &Dist,
        stored: &Datum,
        by_value: &[f64],
        weight: f64,
    ) -> Result<(), Failure> {
        let DistSpec::Family { builtin, args } = spec else { return Ok(()) };
        let frame = self.graph.nodes[n as usize].frame;
        let values = self.values(frame, args);
        let (i, which) = match (dist, values.get(1)) {
            (Dist::Gp(_), _) => (1, Matrix::Kernel),
            (Dist::MvNormal(_), Some(Value::Unit)) => (2, Matrix::Factor),
            (Dist::MvNormal(_), _) => (1, Matrix::Covariance),
            _ => return Ok(()),
        };
        let Some(source) = args.get(i).and_then(|o| self.source(frame, *o)).filter(|s| self.is_active(*s)) else {
            return Ok(());
        };
        let a = Args { builtin: self.code.builtins.get(*builtin), values: &values };
        let found = match (dist, which) {
            (Dist::Gp(d), _) => {
                let cov = values.get(1).and_then(|v| v.downcast::<CovarianceValue>());
                let at = a.array(2).ok();
                let by = cov.zip(at).and_then(|(c, at)| d.covariance_gradient(&c.0, &at, stored, by_value));
                by.map(Adjoint::Array)
            }
            (Dist::MvNormal(d), which) => {
                let rows = d.matrix_gradient(matches!(which, Matrix::Factor), stored, by_value);
                rows.map(|rows| Adjoint::List(rows.into_iter().map(Adjoint::Array).collect()))
            }
            _ => None,
        };
        let Some(mut by) = found else {
            return Err(self.no_derivative(n, &format!("the covariance of `{}`", dist.name())));
        };
        scale(&mut by, weight);
        self.give_node(source, by);
        Ok(())
    }
}

fn scale(by: &mut Adjoint, power: f64) {
    if power == 1.0 {
        return;
    }
    match by {
        Adjoint::Num(g) => *g *= power,
        Adjoint::Array(gs) => gs.iter_mut().for_each(|g| *g *= power),
        Adjoint::List(all) => all.iter_mut().for_each(|a| scale(a, power)),
        Adjoint::Record(all) => all.iter_mut().for_each(|(_, a)| scale(a, power)),
        Adjoint::Zero | Adjoint::Unknown => {}
    }
}

/// The derivatives of the log density of a value: by the value, in its shape, and by the parameters. As scored, many values
/// under a distribution of one number are independent.
fn of_value(dist: &Dist, value: &Value) -> Option<(Adjoint, Vec<f64>)> {
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
            let (one, own) = of_value(dist, x)?;
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
pub(super) fn by_arguments(a: &Args, dist: &Dist, params: &[f64]) -> SmallVec<[Adjoint; 4]> {
    let count = a.values.len();
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
            _ if is_matrix(dist, i) => Adjoint::Unknown,
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

/// Whether an argument is a covariance, whose derivatives come by another way: [`Reverse::give_matrix`].
fn is_matrix(dist: &Dist, i: usize) -> bool {
    matches!((dist, i), (Dist::Gp(_), 1) | (Dist::MvNormal(_), 1 | 2))
}
