//! Observations and factors, which condition the trace.

use crate::lang::code::{Code, DistSpec, Op, Operand};
pub(crate) use crate::lang::density::Score;
use crate::lang::density::{self, likelihood_score};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::update::{Failure, Step};
use pcadlang_numerics::num::ExactSum;

impl Graph {
    pub(super) fn evaluate_observe(&mut self, n: NodeId, spec: &DistSpec, value: Operand) -> Step {
        let mut deps = Deps::new();
        // Observing a view renders a picture.
        if matches!(spec, DistSpec::Value(_)) {
            self.budget.count_large();
        }
        let score = match self.observation_score(n, spec, value, &mut deps) {
            Ok(score) => score?,
            Err(m) => return self.need(m),
        };
        let stale = self.store[n].flags & WAS_STALE != 0;
        if stale {
            self.retire_score(n);
        }
        match score {
            Score::One(score) => {
                self.score.likelihood.add(score);
                self.store[n].score = score;
                if matches!(self.store[n].side.as_deref(), Some(Side::Total(_))) || !deps.is_empty()
                {
                    self.set_total(n, ExactSum::default());
                }
            }
            Score::Sum(sum) => {
                self.score.likelihood.merge(&sum);
                self.store[n].score = 0.0;
                self.set_total(n, sum);
            }
        }
        self.set_deps(n, deps);
        self.store[n].flags &= !TARGET;
        Ok(self.finish(n, Value::Unit))
    }

    /// Stores the total of an observation's elements.
    fn set_total(&mut self, n: NodeId, sum: ExactSum) {
        match self.store[n].side.as_deref_mut() {
            Some(Side::Total(t)) => {
                let old = std::mem::replace(&mut t.sum, sum);
                self.update.note(Entry::Sum(n, old));
            }
            _ => self.set_side(n, Some(Side::Total(Total { sum, deps: Deps::new() }))),
        }
    }

    /// Returns the log density of an observation's coarse surrogate, which is never part
    /// of the joint.
    pub(crate) fn surrogate_score(
        &mut self,
        code: &Code,
        n: NodeId,
    ) -> Result<Option<f64>, Failure> {
        let frame = self.store[n].frame;
        let Op::Observe { value, coarse: Some(coarse), .. } = self.op(n) else {
            return Ok(None);
        };
        let (value, coarse) = (*value, *coarse);
        for o in [value, coarse] {
            if let Some(m) = self.unready(frame, o) {
                self.evaluate(code, m)?;
            }
        }
        let observed = match self.replaced(n) {
            Some(v) => v,
            None => self.value(frame, value),
        };
        let score = match self.value(frame, coarse) {
            v @ Value::Likelihood(_) => likelihood_score(v, observed),
            Value::Dist(d) => density::score(d, observed).map(|s| match s {
                Score::One(x) => x,
                Score::Sum(s) => s.value(),
            }),
            v => Err(Fault::type_error(format!(
                "`with coarse` needs a distribution or likelihood, got {}",
                v.type_name()
            ))),
        };
        score.map(Some).map_err(|f| self.fault(n, f))
    }

    pub(super) fn evaluate_factor(&mut self, n: NodeId, weight: Operand) -> Step {
        let frame = self.store[n].frame;
        if let Some(m) = self.unready(frame, weight) {
            return self.need(m);
        }
        let score = match self.value(frame, weight) {
            Value::Num(w) if w.is_nan() => {
                let hint =
                    "0 / 0, inf - inf and the logarithm of a negative number are NaN".to_owned();
                return Err(self.fail(
                    n,
                    FaultKind::Domain,
                    "the log weight is not a number".into(),
                    Some(hint),
                ));
            }
            Value::Num(w) => *w,
            v => {
                let message =
                    format!("`factor` needs a log weight, a number; got {}", v.type_name());
                return Err(self.type_error(n, message));
            }
        };
        if self.store[n].flags & WAS_STALE != 0 {
            self.retire_score(n);
        }
        self.score.likelihood.add(score);
        self.store[n].score = score;
        Ok(self.finish(n, Value::Unit))
    }

    /// Removes an observation's or factor's score from the likelihood.
    pub(crate) fn retire_score(&mut self, n: NodeId) {
        let mut likelihood = std::mem::take(&mut self.score.likelihood);
        self.take_score(n, &mut likelihood);
        self.score.likelihood = likelihood;
    }
}
