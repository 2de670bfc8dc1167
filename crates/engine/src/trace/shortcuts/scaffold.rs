//! Updates of one choice along its static scaffold: the slots of its own frame that
//! depend on it, in a known order (see [`crate::lang::code::StaticScaffold`]).
//!
//! A general update invalidates everything that may change and then evaluates what is
//! needed. Here the list is known, so each entry runs at once if something it reads has
//! changed. Users in other frames are invalidated afterwards and updated in the general
//! way, and so are entries that may no longer be needed: evaluated too early, they could
//! fail or draw choices that the new state does not contain. Both ways give the same
//! values and the same exact sums.

use crate::lang::code::{Code, StaticScaffold};
use crate::lang::value::Value;
use crate::trace::choices::Target;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use crate::trace::propose::{Change, Pending};
use crate::trace::update::{Failure, Poll};

impl Graph {
    /// Returns the static scaffold of a choice, if it can be used in this state, and a
    /// bit mask of the entries that are evaluated on demand only.
    pub fn scaffold_of<'c>(
        &self,
        code: &'c Code,
        target: Target,
    ) -> Option<(&'c StaticScaffold, u64)> {
        let facts = &code.slots[self.store[target.node].op];
        let scaffold = facts.scaffold.as_ref()?;
        if !self.incremental || self.store[target.node].state != State::Clean {
            return None;
        }
        let mut leaves = self.is_read_outside(target.node);
        for slot in &scaffold.slots {
            let m = target.node - facts.slot + *slot;
            leaves |= self.is_read_outside(m);
            let node = &self.store[m];
            // The value of a choice that is not plain may change with its parameters.
            let plain = matches!(node.value, Value::Num(_) | Value::Bool(_)) && node.side.is_none();
            if node.state == State::Clean && self.slot_facts(m).is_draw && !plain {
                return None;
            }
        }
        // A change that leaves the frame may come back to an entry through other frames;
        // only the general way has the right order then.
        let conditional = if leaves || scaffold.switches { scaffold.conditional } else { 0 };
        (scaffold.is_closed || !leaves).then_some((scaffold, conditional))
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
        self.update.pending.push(Pending {
            node: n,
            element: target.element,
            change: change.clone(),
        });
        self.update.save(&mut self.store, n);
        self.store[n].flags |= TARGET;
        self.rerun(code, n)?;
        let base = n - self.slot_facts(n).slot;
        for (i, slot) in scaffold.slots.iter().enumerate() {
            let m = base + *slot;
            if self.store[m].state == State::Clean && self.reads_changed(m) {
                if conditional >> i & 1 == 0 {
                    self.rerun(code, m)?;
                } else {
                    self.update.make_stale(&mut self.store, m);
                }
            }
        }
        for m in std::iter::once(n).chain(scaffold.slots.iter().map(|slot| base + *slot)) {
            let node = &self.store[m];
            if (node.changed == self.update.epoch || node.state == State::Stale)
                && self.is_read_outside(m)
            {
                self.update.invalidate_outside_users(&mut self.store, code, m);
            }
        }
        self.propagate(code)
    }

    fn reads_changed(&self, n: NodeId) -> bool {
        let mut changed = false;
        self.each_dep(n, |d, _| {
            let dep = &self.store[d];
            changed |= dep.changed == self.update.epoch || dep.state == State::Stale;
        });
        changed
    }

    /// Runs an evaluated node again.
    fn rerun(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        self.update.save(&mut self.store, n);
        let node = &mut self.store[n];
        node.state = State::Running;
        node.flags |= WAS_STALE;
        let bottom = self.update.stack.len();
        self.update.stack.push(n);
        match self.run(code, n) {
            Ok(Poll::Ready) => {
                self.update.stack.truncate(bottom);
                Ok(())
            }
            Ok(Poll::Pending) => self.run_stack(code, bottom),
            Err(e) => {
                self.update.stack.truncate(bottom);
                Err(e)
            }
        }
    }
}
