//! The second half of an update: propagation, which re-evaluates what is needed.
//!
//! Evaluation is on demand and uses an explicit stack, so that recursion in a program
//! does not become recursion here. A stale node first brings what it reads up to date,
//! structure before what depends on it, and runs again only if something it reads has
//! changed.

use crate::lang::builtins::PreviousEvaluation;
use crate::lang::code::{Code, Op, Operand};
use crate::lang::error::{FaultKind, RunError};
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::sync::Arc;

/// The outcome of one attempt to evaluate a node.
pub(crate) enum Poll {
    /// It has its value.
    Ready,
    /// It waits for the nodes that it put on the stack.
    Pending,
}

/// One attempt to evaluate a node.
pub(crate) type Step = Result<Poll, Failure>;

/// A failure with its location.
pub(crate) type Failure = Box<RunError>;

impl Graph {
    /// Finishes an update: runs new and stale effects, re-scores absorbing choices, and
    /// empties nodes that nothing holds.
    pub fn propagate(&mut self, code: &Code) -> Result<(), Failure> {
        loop {
            self.run_effects(code)?;
            // A stale choice may acquire what another node released, so stale choices run
            // before the sweep, except those that are to be swept themselves. So may an
            // observation that waits: nothing is swept before the last stage.
            let waits = !self.update.waiting.is_empty();
            if waits || self.update.unheld.is_empty() && self.update.idle.is_empty() {
                let Some(n) = self.update.stale_choices.pop() else { break };
                if self.store[n].state == State::Stale {
                    self.run_in_place(code, n)?;
                }
                continue;
            }
            let is_stale = |n: &NodeId| self.store[*n].state == State::Stale;
            let unreachable = match self.update.stale_choices.iter().any(is_stale) {
                true => self.unreachable(),
                false => Vec::new(),
            };
            let stays = |n: &NodeId| is_stale(n) && unreachable.binary_search(n).is_err();
            let next = self
                .update
                .stale_choices
                .iter()
                .rposition(stays)
                .filter(|_| self.update.idle.is_empty());
            match next {
                Some(i) => {
                    let n = self.update.stale_choices.swap_remove(i);
                    self.run_in_place(code, n)?;
                }
                None => self.sweep(),
            }
        }
        if self.update.waiting.is_empty() {
            self.sweep();
        }
        self.choices.update_selections(&self.store, &mut self.update)
    }

    /// Returns the nodes that a sweep would empty now, if nothing released is acquired
    /// again; sorted.
    fn unreachable(&self) -> Vec<NodeId> {
        let mut open = self.update.unheld.clone();
        open.retain(|n| self.store[*n].refs == 0);
        let (mut unreachable, mut left) = (Vec::new(), FxHashMap::<NodeId, u32>::default());
        while let Some(n) = open.pop() {
            let node = &self.store[n];
            if node.state == State::Empty {
                continue;
            }
            unreachable.push(n);
            let mut release = |d: NodeId| {
                let refs = left.entry(d).or_insert(self.store[d].refs);
                *refs = refs.saturating_sub(1);
                if *refs == 0 {
                    open.push(d);
                }
            };
            if node.flags & HELD != 0 {
                self.each_dep(n, |d, _| release(d));
            }
            if let Some(Side::Child(c)) = node.side.as_deref() {
                let frame = &self.store[c.frame];
                self.code.blocks[frame.block].effects.iter().for_each(|s| release(frame.base + *s));
            }
        }
        unreachable.sort_unstable();
        unreachable
    }

    fn run_effects(&mut self, code: &Code) -> Result<(), Failure> {
        let mut stale = std::mem::take(&mut self.update.stale_effects);
        let mut result = Ok(());
        for n in stale.drain(..) {
            if self.store[n].state == State::Stale {
                let waits = self.update.is_late(self.store[n].op);
                result = if waits { self.wait(code, n) } else { self.run_in_place(code, n) };
                if result.is_err() {
                    break;
                }
            }
        }
        self.update.stale_effects = stale;
        result?;
        let mut next = 0;
        while next < self.update.effects.len() {
            let n = self.update.effects[next];
            next += 1;
            if self.store[n].state == State::Empty && self.store[n].refs > 0 {
                self.run_in_place(code, n)?;
            }
        }
        self.update.effects.clear();
        Ok(())
    }

    /// Runs an effect or choice, unless an owner of an enclosing frame detaches that
    /// frame.
    fn run_in_place(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        if self.stays(code, n)? { self.evaluate(code, n) } else { Ok(()) }
    }

    /// Leaves an observation to the second stage, unless its frame is detached.
    fn wait(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        if self.stays(code, n)? {
            self.update.waiting.push(n);
        }
        Ok(())
    }

    /// True if no owner of an enclosing frame detaches the frame of a node: outer owners decide
    /// whether inner ones still exist.
    fn stays(&mut self, code: &Code, n: NodeId) -> Result<bool, Failure> {
        let mut owners: SmallVec<[NodeId; 8]> = self.owners(n).collect();
        while let Some(owner) = owners.pop() {
            if self.store[owner].state == State::Stale {
                self.evaluate(code, owner)?;
            }
            let below = owners.last().copied().unwrap_or(n);
            if !self.store[self.store[below].frame].attached {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Brings a node up to date.
    pub fn evaluate(&mut self, code: &Code, root: NodeId) -> Result<(), Failure> {
        let bottom = self.update.stack.len();
        self.update.stack.push(root);
        self.run_stack(code, bottom)
    }

    /// Evaluates the nodes on the stack until it is down to height `bottom`.
    pub fn run_stack(&mut self, code: &Code, bottom: usize) -> Result<(), Failure> {
        while self.update.stack.len() > bottom {
            let n = self.update.stack[self.update.stack.len() - 1];
            match self.store[n].state {
                State::Clean => {
                    self.update.stack.pop();
                    continue;
                }
                State::Running => {}
                state => {
                    self.update.save(&mut self.store, n);
                    if state == State::Empty && self.incremental && self.take_settled(n) {
                        continue;
                    }
                    let node = &mut self.store[n];
                    node.state = State::Running;
                    if state == State::Stale {
                        node.flags |= WAS_STALE;
                    }
                }
            }
            let step =
                self.budget.count_operation(&self.store, n).and_then(|()| self.step(code, n));
            if let Err(e) = step {
                // Others on the stack wait for their turn.
                let running = |n: &NodeId| self.store[*n].state == State::Running;
                self.update.failed.clear();
                self.update.failed.extend(self.update.stack.drain(bottom..).filter(running));
                return Err(e);
            }
        }
        Ok(())
    }

    /// Gives a node the value that another trace has computed, if no choice affects it.
    fn take_settled(&mut self, n: NodeId) -> bool {
        let known = self.store.slot_facts(n).settled.as_ref().and_then(|v| v.get());
        let Some(value) = known.cloned() else { return false };
        let node = &mut self.store[n];
        (node.value, node.changed, node.state) = (value, self.update.epoch, State::Clean);
        true
    }

    /// Pushes a node that is needed onto the stack.
    pub fn need(&mut self, n: NodeId) -> Step {
        if self.store[n].state == State::Running {
            let message = match self.name_of(n) {
                Some(name) => format!("`{name}` depends on its own value"),
                None => "this value depends on itself".to_owned(),
            };
            return Err(self.fail(n, FaultKind::Cycle, message, None));
        }
        self.update.stack.push(n);
        Ok(Poll::Pending)
    }

    /// Ends the evaluation of a node with a value.
    pub fn finish(&mut self, n: NodeId, value: Value) -> Poll {
        let epoch = self.update.epoch;
        let node = &mut self.store[n];
        if node.flags & WAS_STALE == 0 || !value.same(&node.value) {
            node.value = value;
            node.changed = epoch;
        }
        self.finish_unchanged(n)
    }

    /// Ends the evaluation of a node with a newly built value, which counts towards the
    /// limits.
    pub fn finish_made(&mut self, n: NodeId, value: Value) -> Step {
        self.budget.count_elements(&self.store, n, &value)?;
        Ok(self.finish(n, value))
    }

    /// Ends the evaluation of a node whose value does not change.
    pub fn finish_unchanged(&mut self, n: NodeId) -> Poll {
        let node = &mut self.store[n];
        node.state = State::Clean;
        node.flags &= !WAS_STALE;
        if node.flags & HELD == 0 {
            node.flags |= HELD;
            let mut deps: SmallVec<[(NodeId, bool); 8]> = SmallVec::new();
            self.each_dep(n, |d, outside| deps.push((d, outside)));
            for (d, outside) in deps {
                self.acquire(d, n, outside);
            }
        }
        Poll::Ready
    }

    /// Replaces the nodes that a node holds besides its operands.
    pub fn set_deps(&mut self, n: NodeId, deps: Deps) {
        match self.store[n].side.as_deref() {
            None if deps.is_empty() => return,
            Some(Side::Kept(_)) | None => {}
            Some(side) if side.deps() == deps.as_slice() => return,
            Some(_) => {}
        }
        self.hold_instead(n, &deps);
        match self.store[n].side.as_deref_mut() {
            Some(Side::Choice(c)) => {
                self.update.note(Entry::Choice(n, Box::new(c.clone())));
                c.deps = deps;
            }
            Some(Side::Total(t)) => {
                let old = std::mem::replace(&mut t.deps, deps);
                self.update.note(Entry::TotalDeps(n, old));
            }
            _ => self.set_side(n, if deps.is_empty() { None } else { Some(Side::Deps(deps)) }),
        }
    }

    /// Stores the evaluation of an incremental function, and the nodes held besides the
    /// operands.
    pub fn keep(&mut self, n: NodeId, deps: Deps, before: PreviousEvaluation) {
        if self.store[n].side.as_deref().map_or(&[][..], Side::deps) != deps.as_slice() {
            self.hold_instead(n, &deps);
        }
        self.set_side(n, Some(Side::Kept(Kept { deps, before: Arc::new(before) })));
    }

    /// Acquires what a node will hold besides its operands, and releases what it held.
    fn hold_instead(&mut self, n: NodeId, deps: &[NodeId]) {
        if self.store[n].flags & HELD != 0 {
            let side = self.store[n].side.as_deref();
            let old: Deps = side.map_or(&[][..], Side::deps).into();
            deps.iter().for_each(|d| self.acquire(*d, n, true));
            old.iter().for_each(|d| self.release(*d, true));
        }
    }

    /// Makes one attempt to evaluate a node.
    fn step(&mut self, code: &Code, n: NodeId) -> Step {
        let facts = &code.slots[self.store[n].op];
        let (epoch, mut changed) = (self.update.epoch, false);
        if let Some(reads) = &facts.reads {
            let height = self.update.stack.len();
            for (up, slot) in reads {
                let d = match up {
                    0 => n - facts.slot + *slot,
                    _ => self.store.outer(self.store[n].frame, *up, *slot),
                };
                let dep = &self.store[d];
                match dep.state {
                    State::Clean => changed |= dep.changed == epoch,
                    // After those before it.
                    State::Running if self.update.stack.len() > height => break,
                    _ => {
                        self.need(d)?;
                    }
                }
            }
            // All that it reads in any case waits on the stack, the first on top.
            if self.update.stack.len() > height {
                self.update.stack[height..].reverse();
                return Ok(Poll::Pending);
            }
        }
        if self.store[n].flags & WAS_STALE != 0 && self.incremental && !changed {
            let mut wait = NodeId::NONE;
            let look = |d: NodeId, _: bool| {
                let dep = &self.store[d];
                if !changed && wait == NodeId::NONE {
                    if dep.state != State::Clean {
                        wait = d;
                    } else if dep.changed == epoch {
                        changed = true;
                    }
                }
            };
            match facts.reads {
                Some(_) => self.each_side_dep(n, look),
                None => self.each_dep(n, look),
            }
            if !changed {
                if wait != NodeId::NONE {
                    return self.need(wait);
                }
                // Elements of passes also read their owner, and targets their pending
                // change.
                let op = self.op(n);
                let reads_more = matches!(op, Op::Item | Op::Accumulator | Op::Param { .. });
                if !reads_more && self.store[n].flags & TARGET == 0 {
                    return Ok(self.finish_unchanged(n));
                }
            }
        }
        self.run(code, n)
    }

    /// Makes one attempt to run the operation of a node.
    pub fn run(&mut self, code: &Code, n: NodeId) -> Step {
        let step = self.run_op(code, n).map_err(|mut e| {
            // A choice outside of its support, such as a label beyond the number of groups,
            // gives the state density zero, whatever it indexes. A choice is scored before
            // anything that depends on it is evaluated.
            if e.kind == FaultKind::Index && self.score.prior.value() == f64::NEG_INFINITY {
                e.kind = FaultKind::Domain;
            }
            e
        })?;
        if let (Poll::Ready, Some(settled)) = (&step, &self.store.slot_facts(n).settled)
            && settled.get().is_none()
            && self.store[n].value.is_portable()
        {
            let _ = settled.set(self.store[n].value.clone());
        }
        if let (Poll::Ready, Some(log)) = (&step, &mut self.execution_log) {
            let f = &self.store[self.store[n].frame];
            log.push((f.block, n - f.base));
        }
        Ok(step)
    }

    /// Evaluates operands of a frame, with containers read as arrays or records.
    pub fn query(
        &mut self,
        code: &Code,
        frame: FrameId,
        operands: &[Operand],
    ) -> Result<Vec<Value>, Failure> {
        let mut values = Vec::with_capacity(operands.len());
        for o in operands {
            if let Some(n) = self.resolve(frame, *o) {
                self.evaluate(code, n)?;
            }
            if let Value::Container(r) = self.value(frame, *o) {
                let gather = r.node.gather();
                self.evaluate(code, gather)?;
            }
            values.push(self.plain(frame, *o, &mut Deps::new()).clone());
        }
        Ok(values)
    }
}
