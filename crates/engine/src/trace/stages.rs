//! Updates in two stages: what a proposal leaves to be evaluated only once it has passed a first
//! test.
//!
//! Observations that wait keep their score, so that the weight of the first stage is that of
//! everything else. Which ones wait depends on the program and on which observations both states
//! have, so it is the same for a move and its reverse.

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

    /// Lets these observations wait in the proposals that follow.
    pub fn set_waiting(&mut self, observations: Option<Arc<[OpId]>>) {
        self.graph.update.late = observations;
    }

    /// Evaluates the observations that wait in the pending proposal. Returns the change of the
    /// log likelihood by them; -∞ if the proposal changes which choices or observations there are,
    /// as the way back could have another first stage. `None` if nothing waits.
    ///
    /// # Errors
    /// If the program fails there; the trace is then as before the proposal.
    pub fn finish_waiting(&mut self) -> Option<TraceResult<f64>> {
        if self.graph.update.waiting.is_empty() {
            return None;
        }
        let before = self.update.take()?;
        let first = self.graph.weight(&before);
        let late = std::mem::take(&mut self.graph.update.late);
        self.graph.update.resume();
        let propagated = self.graph.propagate(&self.code);
        self.graph.update.late = late;
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
