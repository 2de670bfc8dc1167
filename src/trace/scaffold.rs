//! Updates of one choice whose change spreads through its own frame in a known order (see
//! [`crate::lang::code::StaticScaffold`]).
//!
//! The general way marks all that may change and asks for it; here the list is known, so
//! each entry runs at once if something it reads has changed. What is outside of the
//! frame is marked afterwards and runs the general way, and so is what nothing may ask
//! for any more: run too soon it could fail, or draw choices, though the new state has no
//! use for it. Both ways give the same values and the same exact sums.

use super::choices::Target;
use super::graph::Graph;
use super::node::*;
use super::propagate::{Failure, Poll};
use super::propose::{Change, Pending};
use crate::lang::code::{Code, StaticScaffold};
use crate::lang::value::Value;

impl Graph {
    /// How the change of a choice spreads, if it can be updated this way in this state,
    /// and which of its slots run only if they are asked for, a bit each.
    pub fn scaffold_of<'c>(
        &self,
        code: &'c Code,
        target: Target,
    ) -> Option<(&'c StaticScaffold, u64)> {
        let facts = self.slot_facts(code, target.node);
        let scaffold = facts.scaffold.as_ref()?;
        if !self.incremental || self.nodes[target.node as usize].state != State::Clean {
            return None;
        }
        let mut leaves = self.is_read_outside(target.node);
        for slot in &scaffold.slots {
            let m = target.node - facts.slot + slot;
            leaves |= self.is_read_outside(m);
            let node = &self.nodes[m as usize];
            // A choice whose value may follow its parameters.
            let plain = matches!(node.value, Value::Num(_) | Value::Bool(_)) && node.side.is_none();
            if node.state == State::Clean && self.slot_facts(code, m).is_draw && !plain {
                return None;
            }
        }
        // What is outside may come back to what reads from there: then only the general
        // way has the right order.
        let conditional = if leaves || scaffold.turns { scaffold.conditional } else { 0 };
        (scaffold.is_closed || !leaves).then_some((scaffold, conditional))
    }

    /// Whether nodes of other frames read this one.
    pub fn is_read_outside(&self, n: NodeId) -> bool {
        let users = &self.outside[self.nodes[n as usize].outside as usize];
        users.users.len() > users.gone as usize
    }

    /// Changes a choice and updates what depends on it.
    pub fn update_along_scaffold(
        &mut self,
        code: &Code,
        target: Target,
        change: &Change,
        (scaffold, conditional): (&StaticScaffold, u64),
    ) -> Result<(), Failure> {
        let n = target.node;
        self.pending.push(Pending { node: n, element: target.element, change: change.clone() });
        self.save(n);
        self.nodes[n as usize].flags |= TARGET;
        self.rerun(code, n)?;
        let base = n - self.slot_facts(code, n).slot;
        for (i, slot) in scaffold.slots.iter().enumerate() {
            let m = base + slot;
            if self.nodes[m as usize].state == State::Clean && self.reads_changed(code, m) {
                if conditional >> i & 1 == 0 {
                    self.rerun(code, m)?;
                } else {
                    self.make_stale(code, m);
                }
            }
        }
        for m in std::iter::once(n).chain(scaffold.slots.iter().map(|slot| base + slot)) {
            let node = &self.nodes[m as usize];
            if (node.changed == self.epoch || node.state == State::Stale) && self.is_read_outside(m)
            {
                self.invalidate_outside_users(code, m);
            }
        }
        self.propagate(code)
    }

    fn reads_changed(&self, code: &Code, n: NodeId) -> bool {
        let mut changed = false;
        self.each_dep(code, n, |d, _| {
            let dep = &self.nodes[d as usize];
            changed |= dep.changed == self.epoch || dep.state == State::Stale;
        });
        changed
    }

    /// Runs an evaluated node again.
    fn rerun(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        self.save(n);
        let node = &mut self.nodes[n as usize];
        node.state = State::Running;
        node.flags |= WAS_STALE;
        let bottom = self.stack.len();
        self.stack.push(n);
        match self.run(code, n) {
            Ok(Poll::Ready) => {
                self.stack.truncate(bottom);
                Ok(())
            }
            Ok(Poll::Pending) => self.run_stack(code, bottom),
            Err(e) => {
                self.stack.truncate(bottom);
                Err(e)
            }
        }
    }
}
