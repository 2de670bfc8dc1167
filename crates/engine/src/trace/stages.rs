//! Updates in stages: what a proposal leaves to be evaluated only once it has passed a test of
//! everything before it.
//!
//! Observations that wait keep their score, so that the weight of a stage is that of everything
//! evaluated so far. Which ones wait depends on the program and on which observations both states
//! have, so it is the same for a move and its reverse. Observations that appear run at once.

use super::graph::Graph;
use super::select::Selector;
use super::{Trace, TraceResult};
use crate::lang::code::{Code, Op, Operand};
use crate::lang::ids::OpId;
use crate::lang::value::Value;
use std::sync::Arc;

impl Trace {
    /// Returns the selected observations whose coarse surrogate is `flat()`, if that is the
    /// surrogate of all that have one, and some do.
    pub fn flat_surrogates(&self, at: &Selector) -> Option<Arc<[OpId]>> {
        let all = self.coarse_observations(at);
        let flat = !all.is_empty() && all.iter().all(|op| has_flat_surrogate(&self.code, *op));
        flat.then(|| all.into())
    }

    /// Lets these observations wait in the proposals that follow, until the others that are told
    /// to wait before this ends have been tested.
    pub fn let_wait(&mut self, observations: Arc<[OpId]>) {
        self.graph.update.late.push(observations);
    }

    /// Ends the last [`Trace::let_wait`].
    pub fn end_wait(&mut self) {
        self.graph.update.late.pop();
    }

    /// True if the pending proposal has observations that wait.
    pub fn observations_wait(&self) -> bool {
        !self.graph.update.waiting.is_empty()
    }

    /// Evaluates the observations of the next stage in the pending proposal. Returns the change of
    /// the log likelihood by them; -∞ if the proposal changes which choices or observations there
    /// are, as the way back could have another first stage. `None` if nothing waits.
    ///
    /// # Errors
    /// If the program fails there; the trace is then as before the proposal.
    pub fn next_stage(&mut self) -> Option<TraceResult<f64>> {
        if !self.observations_wait() {
            return None;
        }
        let before = self.update.take()?;
        let first = self.graph.weight(&before);
        let Graph { update, store, .. } = &mut self.graph;
        update.begin_stage(store);
        let propagated = self.graph.propagate(&self.code);
        Some(self.pend(before, propagated).map(|whole| {
            let changed = whole.appeared + whole.vanished + self.graph.update.effects_changed;
            let change = whole.log_likelihood - first.log_likelihood;
            if changed == 0 && !change.is_nan() { change } else { f64::NEG_INFINITY }
        }))
    }
}

/// True if the surrogate of an observation is `flat()`.
fn has_flat_surrogate(code: &Code, op: OpId) -> bool {
    let Op::Observe { coarse: Some(Operand::Local(slot)), .. } = code.ops[op] else { return false };
    let surrogate = op - code.slots[op].slot + slot;
    let Op::Prim { builtin, args } = &code.ops[surrogate] else { return false };
    let given = |o: &Operand| !matches!(o, Operand::Const(i) if matches!(code.const_value(*i), Value::Unit));
    &*code.builtins.get(*builtin).name == "flat" && !args.iter().any(given)
}
