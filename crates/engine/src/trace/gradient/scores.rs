//! Derivatives of the scores of a trace: choices under their priors, observations,
//! factors.

use super::{Inputs, Reverse};
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::Args;
use crate::lang::code::{DistSpec, Op};
use crate::lang::density;
use crate::lang::error::FaultKind;
use crate::lang::value::Value;
use crate::trace::node::*;
use crate::trace::update::Failure;
use pcadlang_numerics::dist::{Datum, Dist};
use smallvec::SmallVec;

impl Reverse<'_> {
    /// Returns the nodes that the score of a choice, observation or factor is computed
    /// from, except the choice itself.
    pub(super) fn score_inputs(&self, n: NodeId) -> Inputs {
        let mut all = Inputs::new();
        let frame = self.graph[n].frame;
        match self.graph.op(n) {
            // The density of white noise does not depend on the choice's parameters.
            Op::Draw { .. } if self.graph.is_whitened(n) => {}
            Op::Draw { dist, .. } => self.dist_inputs(n, dist, &mut all),
            Op::Observe { dist, value, .. } => {
                self.dist_inputs(n, dist, &mut all);
                if self.graph.replaced(n).is_none() {
                    all.extend(self.source(frame, *value));
                }
            }
            Op::Factor { weight, .. } => all.extend(self.source(frame, *weight)),
            _ => {}
        }
        all
    }

    /// Adds the derivatives of one score to the adjoints of its inputs.
    pub(super) fn vjp_score(&mut self, n: NodeId) -> Result<(), Failure> {
        let g = self.graph;
        let frame = g[n].frame;
        match g.op(n) {
            Op::Factor { weight, .. } => self.give(frame, *weight, Adjoint::Num(self.power)),
            Op::Draw { dist: spec, .. } => {
                let Some(dist) = g.dist_of(n) else { return Ok(()) };
                let Some(stored) = g.stored(n) else { return Ok(()) };
                let own = self.is_active(n);
                if g.is_whitened(n) {
                    // It is added together with the derivative through the noise.
                    return Ok(());
                }
                let Some((mut by_x, mut params)) =
                    density::gradient(&dist, &Value::from_datum(&stored))
                else {
                    return Err(self.no_density_derivative(n, &dist, &Value::from_datum(&stored)));
                };
                by_x.scale(self.weight);
                params.iter_mut().for_each(|p| *p *= self.weight);
                if own {
                    self.give_node(n, by_x);
                }
                self.give_params(n, spec, &dist, params)?;
                self.give_matrix(n, spec, &dist, &stored, &[], self.weight)?;
            }
            Op::Observe { dist: spec, value, .. } => {
                let observed = g.observed_value(n);
                if let DistSpec::Value(o) = spec
                    && let Value::Likelihood(l) = g.value(frame, *o)
                {
                    let Some(mut by) = l.gradient(observed) else {
                        return Err(
                            self.no_derivative(n, &format!("the likelihood `{}`", l.name()))
                        );
                    };
                    by.scale(self.power);
                    self.give(frame, *o, by);
                    return Ok(());
                }
                let dist = g.make_dist(n, spec)?;
                let Some((mut by_x, mut params)) = density::gradient(&dist, observed) else {
                    return Err(self.no_density_derivative(n, &dist, observed));
                };
                by_x.scale(self.power);
                params.iter_mut().for_each(|p| *p *= self.power);
                if g.replaced(n).is_none() {
                    self.give(frame, *value, by_x);
                }
                self.give_params(n, spec, &dist, params)?;
                if let Some(x) = observed.to_datum() {
                    // The observed datum is the value itself, even if a choice would be
                    // stored non-centred.
                    self.give_matrix(n, spec, &dist.centred(), &x, &[], self.power)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the failure of a density without derivatives: of the state, which kernels
    /// reject, if the density is not finite there, otherwise of the program.
    fn no_density_derivative(&self, n: NodeId, dist: &Dist, x: &Value) -> Failure {
        let finite = density::pointwise(dist, x).iter().all(|score| score.is_finite());
        if finite {
            return self.no_derivative(n, &format!("the density of `{}`", dist.name()));
        }
        let message = format!("the density of `{}` is not finite here", dist.name());
        self.graph.fail(n, FaultKind::Domain, message, None)
    }

    /// Adds the derivatives with respect to a distribution's parameters to the nodes they
    /// were computed from.
    pub(super) fn give_params(
        &mut self,
        n: NodeId,
        spec: &DistSpec,
        dist: &Dist,
        params: Vec<f64>,
    ) -> Result<(), Failure> {
        let frame = self.graph[n].frame;
        match spec {
            DistSpec::Value(o) => self.give(frame, *o, Adjoint::Array(params)),
            DistSpec::Family { builtin, args } => {
                let builtin = self.graph.code.builtins.get(*builtin);
                let values = self.values(frame, args);
                let mut argument_adjoints =
                    density::by_arguments(&Args { builtin, values: &values }, dist, &params);
                if let Some(p) =
                    density::matrix(dist, &values).and_then(|i| argument_adjoints.get_mut(i))
                {
                    *p = Adjoint::Zero;
                }
                self.give_arguments(n, builtin, args.iter().map(|o| Some(*o)), argument_adjoints)?;
            }
        }
        Ok(())
    }

    /// Adds `weight` times the derivatives with respect to a covariance, or a factor of
    /// one, to the node it was computed from; [`density::by_arguments`] omits them.
    pub(super) fn give_matrix(
        &mut self,
        n: NodeId,
        spec: &DistSpec,
        dist: &Dist,
        stored: &Datum,
        by_value: &[f64],
        weight: f64,
    ) -> Result<(), Failure> {
        let frame = self.graph[n].frame;
        let values = self.values(frame, spec.operands());
        let i = match spec {
            DistSpec::Value(_) => density::matrix(dist, &[]).map(|_| 0),
            DistSpec::Family { .. } => density::matrix(dist, &values),
        };
        let source = i.and_then(|i| spec.operands().get(i)).and_then(|o| self.source(frame, *o));
        let Some(source) = source.filter(|s| self.is_active(*s)) else { return Ok(()) };
        let Some(mut by) = density::by_factor(dist, stored, by_value) else {
            return Err(self.no_matrix(n, dist));
        };
        by.iter_mut().for_each(|g| *g *= weight);
        let by = match spec {
            // They follow the parameters; the call that makes the distribution separates
            // them.
            DistSpec::Value(_) => {
                let mut all = vec![0.0; dist.param_count()];
                all.append(&mut by);
                Some(Adjoint::Array(all))
            }
            DistSpec::Family { builtin, .. } => density::by_matrix(
                &Args { builtin: self.graph.code.builtins.get(*builtin), values: &values },
                dist,
                &by,
            ),
        };
        let Some(by) = by else { return Err(self.no_matrix(n, dist)) };
        self.give_node(source, by);
        Ok(())
    }

    /// Returns the adjoints of the arguments of a distribution value from those of its
    /// parameters, which are followed by those of the factor of its covariance. `wanted`
    /// tells whether the adjoint of an argument is used.
    pub(super) fn by_distribution(
        &self,
        n: NodeId,
        a: &Args,
        dist: &Dist,
        by: &Adjoint,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<SmallVec<[Adjoint; 4]>, Failure> {
        let all = by.numbers(if let Adjoint::Array(gs) = by { gs.len() } else { 0 });
        let Some(i) = density::matrix(dist, a.values) else {
            return Ok(density::by_arguments(a, dist, &all));
        };
        let (params, factor) = all.split_at(dist.param_count().min(all.len()));
        let mut argument_adjoints = density::by_arguments(a, dist, params);
        if let Some(p) = argument_adjoints.get_mut(i) {
            *p = match factor {
                _ if !wanted(i) => Adjoint::Zero,
                // It is part of a distribution of several, such as `iid`, which
                // propagates parameters only.
                [] => Adjoint::Unknown,
                _ => density::by_matrix(a, dist, factor).ok_or_else(|| self.no_matrix(n, dist))?,
            };
        }
        Ok(argument_adjoints)
    }

    fn no_matrix(&self, n: NodeId, dist: &Dist) -> Failure {
        self.no_derivative(n, &format!("the covariance of `{}`", dist.name()))
    }
}
