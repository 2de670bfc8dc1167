//! Evaluation of one node, by kind of operation; one file per family of operations, and
//! here observations and factors.

mod call;
pub(crate) mod choice;
mod container;
mod loops;

use super::graph::Graph;
use super::journal::Entry;
use super::node::*;
use super::update::{Failure, Poll, Step};
use crate::lang::builtins::{Builtin, PreviousEvaluation};
use crate::lang::code::{Code, DistSpec, Op, Operand};
pub(crate) use crate::lang::density::Score;
use crate::lang::density::{self, likelihood_score};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::{Closure, Value};
use pcadlang_numerics::num::ExactSum;

impl Graph {
    /// Makes one attempt to run the operation of a node.
    pub(super) fn run_op(&mut self, code: &Code, n: NodeId) -> Step {
        let frame = self.store[n].frame;
        match &code.ops[self.store[n].op] {
            Op::Param { index, default } => self.evaluate_param(n, *index, *default),
            Op::Item => self.evaluate_item(n),
            Op::Accumulator => self.evaluate_accumulator(n),
            Op::Prim { builtin, args } => {
                let builtin = code.builtins.get(*builtin);
                let mut deps = Deps::new();
                let made = match self
                    .inputs(frame, args, &mut deps)
                    .map(|values| self.apply_at(n, builtin, &values))
                {
                    Ok(made) => made,
                    Err(m) => return self.need(m),
                };
                let made = made.map_err(|e| self.fault(n, e))?;
                self.finish_call(n, deps, made)
            }
            Op::Array(items) => {
                if let Some(step) = self.await_plain(frame, items)? {
                    return Ok(step);
                }
                let mut deps = Deps::new();
                let values =
                    items.iter().map(|o| self.plain(frame, *o, &mut deps).clone()).collect();
                self.set_deps(n, deps);
                self.finish_made(n, Value::from_elements(values))
            }
            Op::Record { names, values } => {
                if let Some(step) = self.await_plain(frame, values)? {
                    return Ok(step);
                }
                let mut deps = Deps::new();
                let fields = names.iter().zip(values.iter());
                let fields = fields
                    .map(|(k, o)| (k.clone(), self.plain(frame, *o, &mut deps).clone()))
                    .collect();
                self.set_deps(n, deps);
                self.finish_made(n, Value::Record(std::sync::Arc::new(fields)))
            }
            Op::Closure(block) => {
                Ok(self.finish(n, Value::Closure(Closure { block: *block, frame })))
            }
            Op::Index { base, keys } => self.evaluate_index(code, n, *base, keys),
            Op::Call { callee, args, site } => self.evaluate_call(n, *callee, args, *site),
            Op::If { cond, then, otherwise } => self.evaluate_if(n, *cond, *then, *otherwise),
            Op::Select { cond, then, otherwise } => {
                self.evaluate_select(n, *cond, *then, *otherwise)
            }
            Op::For { iter, body } => self.evaluate_for(n, *iter, *body),
            Op::Map { f, over, .. } => self.evaluate_map(n, *f, *over),
            Op::Fold { f, init, over, .. } => self.evaluate_fold(n, *f, *init, *over),
            Op::Container { sources, .. } => self.evaluate_container(n, sources),
            Op::Gather => self.evaluate_gather(code, n),
            Op::Mem { f, .. } => self.evaluate_mem(n, *f),
            Op::Draw { dist, site, keys } => self.evaluate_draw(n, dist, *site, keys),
            Op::Observe { dist, value, .. } => self.evaluate_observe(n, dist, *value),
            Op::Factor { weight, .. } => self.evaluate_factor(n, *weight),
            Op::Probe(p) => {
                let value = self.score.probe(*p);
                Ok(self.finish(n, Value::Num(value)))
            }
        }
    }

    /// Waits for operands; `None` if all are ready.
    pub(super) fn await_all(
        &mut self,
        frame: FrameId,
        operands: &[Operand],
    ) -> Result<Option<Poll>, Failure> {
        for o in operands {
            if let Some(m) = self.unready(frame, *o) {
                return self.need(m).map(Some);
            }
        }
        Ok(None)
    }

    /// Waits for operands, and for the elements of those that are containers.
    pub(super) fn await_plain(
        &mut self,
        frame: FrameId,
        operands: &[Operand],
    ) -> Result<Option<Poll>, Failure> {
        for o in operands {
            if let Some(m) = self.unready(frame, *o) {
                return self.need(m).map(Some);
            }
            if let Value::Container(r) = self.value(frame, *o)
                && self.store[r.node.gather()].state != State::Clean
            {
                let gather = r.node.gather();
                return self.need(gather).map(Some);
            }
        }
        Ok(None)
    }

    /// Calls a built-in at a node; an incremental function continues from its previous
    /// evaluation.
    pub(super) fn apply_at(
        &self,
        n: NodeId,
        builtin: &Builtin,
        values: &[&Value],
    ) -> Result<Made, Fault> {
        match builtin.resume(values, self.kept(n).map(|b| &**b)) {
            None => builtin.apply(values).map(Made::Value),
            Some(made) => made.map(Made::Kept),
        }
    }

    /// Ends the evaluation of a call.
    fn finish_call(&mut self, n: NodeId, deps: Deps, made: Made) -> Step {
        match made {
            Made::Value(value) => {
                self.set_deps(n, deps);
                self.finish_made(n, value)
            }
            Made::Kept(before) => {
                let value = before.value.clone();
                self.keep(n, deps, before);
                self.finish_made(n, value)
            }
        }
    }

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
        self.retire_previous(n);
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
        self.retire_previous(n);
        self.score.likelihood.add(score);
        self.store[n].score = score;
        Ok(self.finish(n, Value::Unit))
    }

    /// Removes the score that an observation or factor had, if it existed before.
    fn retire_previous(&mut self, n: NodeId) {
        if self.store[n].flags & WAS_STALE != 0 {
            self.retire_score(n);
        } else {
            self.update.effects_changed += 1;
        }
    }

    /// Removes an observation's or factor's score from the likelihood.
    pub(crate) fn retire_score(&mut self, n: NodeId) {
        let mut likelihood = std::mem::take(&mut self.score.likelihood);
        self.take_score(n, &mut likelihood);
        self.score.likelihood = likelihood;
    }
}

/// The result of a call.
pub(super) enum Made {
    Value(Value),
    /// With the data from which the next evaluation starts.
    Kept(PreviousEvaluation),
}
