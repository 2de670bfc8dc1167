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
use std::cmp::Ordering;

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
                let Some((by_x, params)) = of_value(&dist, &Value::from_datum(&stored)) else {
                    return Err(self.no_derivative(n, &format!("the density of `{}`", dist.name())));
                };
                if own {
                    self.give_node(n, by_x);
                }
                self.give_params(n, spec, &dist, params)?;
                self.give_matrix(n, spec, &dist, &stored, &[], 1.0)?;
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
                if let Some(p) = matrix_argument(dist, &values).and_then(|i| pulled.get_mut(i)) {
                    *p = Adjoint::Zero;
                }
                self.give_arguments(n, builtin, args.iter().map(|o| Some(*o)), pulled)?;
            }
        }
        Ok(())
    }

    /// Hands the derivatives by a covariance or a factor of one, `weight` times, to what it was computed from; [`by_arguments`]
    /// leaves it out.
    pub(super) fn give_matrix(
        &mut self,
        n: NodeId,
        spec: &DistSpec,
        dist: &Dist,
        stored: &Datum,
        by_value: &[f64],
        weight: f64,
    ) -> Result<(), Failure> {
        let frame = self.graph.nodes[n as usize].frame;
        let values = self.values(frame, spec.operands());
        let i = match spec {
            DistSpec::Value(_) => matrix_argument(dist, &[]).map(|_| 0),
            DistSpec::Family { .. } => matrix_argument(dist, &values),
        };
        let source = i.and_then(|i| spec.operands().get(i)).and_then(|o| self.source(frame, *o));
        let Some(source) = source.filter(|s| self.is_active(*s)) else { return Ok(()) };
        let Some(mut by) = by_factor(dist, stored, by_value) else {
            return Err(self.no_matrix(n, dist));
        };
        by.iter_mut().for_each(|g| *g *= weight);
        let by = match spec {
            // Behind the parameters: what makes the distribution takes them apart.
            DistSpec::Value(_) => {
                let mut all = vec![0.0; dist.param_count()];
                all.append(&mut by);
                Some(Adjoint::Array(all))
            }
            DistSpec::Family { builtin, .. } => {
                by_matrix(&Args { builtin: self.code.builtins.get(*builtin), values: &values }, dist, &by)
            }
        };
        let Some(by) = by else { return Err(self.no_matrix(n, dist)) };
        self.give_node(source, by);
        Ok(())
    }

    /// The adjoints of the arguments of a distribution that is a value: its parameters, and behind them the factor of its
    /// covariance. `wanted` says whether an argument leads anywhere.
    pub(super) fn by_distribution(
        &self,
        n: NodeId,
        a: &Args,
        dist: &Dist,
        by: &Adjoint,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<SmallVec<[Adjoint; 4]>, Failure> {
        let all = by.numbers(if let Adjoint::Array(gs) = by { gs.len() } else { 0 });
        let Some(i) = matrix_argument(dist, a.values) else { return Ok(by_arguments(a, dist, &all)) };
        let (params, factor) = all.split_at(dist.param_count().min(all.len()));
        let mut pulled = by_arguments(a, dist, params);
        if let Some(p) = pulled.get_mut(i) {
            *p = match factor {
                _ if !wanted(i) => Adjoint::Zero,
                // Within a distribution of several, such as `iid`, which hands out parameters only.
                [] => Adjoint::Unknown,
                _ => by_matrix(a, dist, factor).ok_or_else(|| self.no_matrix(n, dist))?,
            };
        }
        Ok(pulled)
    }

    fn no_matrix(&self, n: NodeId, dist: &Dist) -> Failure {
        self.no_derivative(n, &format!("the covariance of `{}`", dist.name()))
    }
}

/// The argument that is a covariance or a factor of one, whose derivatives come by another way: [`Reverse::give_matrix`].
fn matrix_argument(dist: &Dist, values: &[&Value]) -> Option<usize> {
    match (dist, values.get(1)) {
        (Dist::MvNormal(_), Some(Value::Unit)) => Some(2),
        (Dist::Gp(_) | Dist::MvNormal(_) | Dist::Wishart(_), _) => Some(1),
        _ => None,
    }
}

/// The derivatives by the Cholesky factor of a distribution's covariance, its lower triangle by rows: of the log density of a
/// stored value; of one stored as noise, of what has these derivatives by the value.
fn by_factor(dist: &Dist, stored: &Datum, by_value: &[f64]) -> Option<Vec<f64>> {
    match dist {
        Dist::Gp(d) => d.factor_gradient(stored, by_value),
        Dist::MvNormal(d) => d.factor_gradient(stored, by_value),
        Dist::Wishart(d) => d.scale_gradient(stored),
        _ => None,
    }
}

/// From those to the derivatives by the argument the factor was made from, in its shape.
fn by_matrix(a: &Args, dist: &Dist, by_factor: &[f64]) -> Option<Adjoint> {
    // An entry off the diagonal of a covariance stands for two places, one of a factor for one.
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
        Adjoint::List((0..n).map(|i| Adjoint::Array((0..n).map(|j| cell(i, j)).collect())).collect())
    };
    match dist {
        Dist::Gp(d) => {
            let cov = a.get(1).downcast::<CovarianceValue>()?;
            Some(Adjoint::Array(d.pull_covariance(&cov.0, &a.array(2).ok()?, by_factor)?))
        }
        Dist::MvNormal(d) if !matches!(a.get(1), Value::Unit) => Some(rows(&d.pull_covariance(by_factor), 0.5)),
        Dist::MvNormal(_) | Dist::Wishart(_) => Some(rows(by_factor, 0.0)),
        _ => None,
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
            _ if matrix_argument(dist, a.values) == Some(i) => Adjoint::Unknown,
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
