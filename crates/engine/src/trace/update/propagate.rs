//! The second half of an update: propagation, which re-evaluates what is needed.
//!
//! Evaluation is on demand and uses an explicit stack, so that recursion in a program
//! does not become recursion here. A stale node first brings what it reads up to date,
//! structure before what depends on it, and runs again only if something it reads has
//! changed.

use crate::lang::builtins::PreviousEvaluation;
use crate::lang::code::{Code, Op};
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

/// A failure with its location.
pub(crate) type Failure = Box<RunError>;

impl Graph {
    /// Finishes an update: runs new and stale effects, re-scores absorbing choices, and
    /// empties nodes that nothing holds.
    pub fn propagate(&mut self, code: &Code) -> Result<(), Failure> {
        loop {
            self.run_effects(code)?;
            // A stale choice may acquire what another node released, so stale choices run
            // before the sweep, except those that are to be swept themselves.
            if self.unheld.is_empty() && self.idle.is_empty() {
                let Some(n) = self.stale_choices.pop() else { break };
                if self.nodes[n as usize].state == State::Stale {
                    self.run_in_place(code, n)?;
                }
                continue;
            }
            let unreachable =
                if self.stale_choices.is_empty() { Vec::new() } else { self.unreachable(code) };
            let stays = |n: &NodeId| {
                self.nodes[*n as usize].state == State::Stale
                    && unreachable.binary_search(n).is_err()
            };
            let next = self.stale_choices.iter().rposition(stays).filter(|_| self.idle.is_empty());
            match next {
                Some(i) => {
                    let n = self.stale_choices.swap_remove(i);
                    self.run_in_place(code, n)?;
                }
                None => self.sweep(code),
            }
        }
        self.sweep(code);
        self.update_selections(code)
    }

    /// Returns the nodes that a sweep would empty now, if nothing released is acquired
    /// again; sorted.
    fn unreachable(&self, code: &Code) -> Vec<NodeId> {
        let mut open = self.unheld.clone();
        open.retain(|n| self.nodes[*n as usize].refs == 0);
        let (mut unreachable, mut left) = (Vec::new(), FxHashMap::<NodeId, u32>::default());
        while let Some(n) = open.pop() {
            let node = &self.nodes[n as usize];
            if node.state == State::Empty {
                continue;
            }
            unreachable.push(n);
            let mut release = |d: NodeId| {
                let refs = left.entry(d).or_insert(self.nodes[d as usize].refs);
                *refs = refs.saturating_sub(1);
                if *refs == 0 {
                    open.push(d);
                }
            };
            if node.flags & HELD != 0 {
                self.each_dep(code, n, |d, _| release(d));
            }
            if let Some(Side::Child(c)) = node.side.as_deref() {
                let frame = &self.frames[c.frame as usize];
                code.blocks[frame.block as usize]
                    .effects
                    .iter()
                    .for_each(|s| release(frame.base + s));
            }
        }
        unreachable.sort_unstable();
        unreachable
    }

    fn run_effects(&mut self, code: &Code) -> Result<(), Failure> {
        let mut stale = std::mem::take(&mut self.stale_effects);
        let mut result = Ok(());
        for n in stale.drain(..) {
            if self.nodes[n as usize].state == State::Stale {
                result = self.run_in_place(code, n);
                if result.is_err() {
                    break;
                }
            }
        }
        self.stale_effects = stale;
        result?;
        let mut next = 0;
        while next < self.effects.len() {
            let n = self.effects[next];
            next += 1;
            if self.nodes[n as usize].state == State::Empty && self.nodes[n as usize].refs > 0 {
                self.run_in_place(code, n)?;
            }
        }
        self.effects.clear();
        Ok(())
    }

    /// Runs an effect or choice, unless an owner of an enclosing frame detaches that
    /// frame: outer owners decide whether inner ones still exist.
    fn run_in_place(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        let mut owners: SmallVec<[NodeId; 8]> = SmallVec::new();
        let mut f = self.nodes[n as usize].frame;
        while self.frames[f as usize].owner != NONE {
            let owner = self.frames[f as usize].owner;
            owners.push(owner);
            f = self.nodes[owner as usize].frame;
        }
        while let Some(owner) = owners.pop() {
            if self.nodes[owner as usize].state == State::Stale {
                self.evaluate(code, owner)?;
            }
            let below = owners.last().copied().unwrap_or(n);
            if !self.frames[self.nodes[below as usize].frame as usize].attached {
                return Ok(());
            }
        }
        self.evaluate(code, n)
    }

    /// Brings a node up to date.
    pub fn evaluate(&mut self, code: &Code, root: NodeId) -> Result<(), Failure> {
        let bottom = self.stack.len();
        self.stack.push(root);
        self.run_stack(code, bottom)
    }

    /// Evaluates the nodes on the stack until it is down to height `bottom`.
    pub fn run_stack(&mut self, code: &Code, bottom: usize) -> Result<(), Failure> {
        while self.stack.len() > bottom {
            let n = self.stack[self.stack.len() - 1];
            match self.nodes[n as usize].state {
                State::Clean => {
                    self.stack.pop();
                    continue;
                }
                State::Running => {}
                state => {
                    self.save(n);
                    let node = &mut self.nodes[n as usize];
                    node.state = State::Running;
                    if state == State::Stale {
                        node.flags |= WAS_STALE;
                    }
                }
            }
            match self.count_operation(code, n).and_then(|()| self.step(code, n)) {
                Ok(Poll::Ready) => {}
                Ok(Poll::Pending) => {}
                Err(e) => {
                    self.failed.clear();
                    self.failed.extend(self.stack.drain(bottom..));
                    return Err(e);
                }
            }
        }
        Ok(())
    }

    /// Pushes a node that is needed onto the stack.
    pub fn need(&mut self, code: &Code, n: NodeId) -> Result<Poll, Failure> {
        if self.nodes[n as usize].state == State::Running {
            let message = match self.name_of(code, n) {
                Some(name) => format!("`{name}` depends on its own value"),
                None => "this value depends on itself".to_owned(),
            };
            return Err(self.fail(code, n, FaultKind::Cycle, message, None));
        }
        self.stack.push(n);
        Ok(Poll::Pending)
    }

    /// Ends the evaluation of a node with a value.
    pub fn finish(&mut self, code: &Code, n: NodeId, value: Value) -> Poll {
        let epoch = self.epoch;
        let node = &mut self.nodes[n as usize];
        if node.flags & WAS_STALE == 0 || !value.same(&node.value) {
            node.value = value;
            node.changed = epoch;
        }
        self.finish_unchanged(code, n)
    }

    /// Ends the evaluation of a node with a newly built value, which counts towards the
    /// limits.
    pub fn finish_made(&mut self, code: &Code, n: NodeId, value: Value) -> Result<Poll, Failure> {
        self.count_elements(code, n, &value)?;
        Ok(self.finish(code, n, value))
    }

    /// Ends the evaluation of a node whose value does not change.
    pub fn finish_unchanged(&mut self, code: &Code, n: NodeId) -> Poll {
        let node = &mut self.nodes[n as usize];
        node.state = State::Clean;
        node.flags &= !WAS_STALE;
        if node.flags & HELD == 0 {
            node.flags |= HELD;
            let mut deps: SmallVec<[(NodeId, bool); 8]> = SmallVec::new();
            self.each_dep(code, n, |d, outside| deps.push((d, outside)));
            for (d, outside) in deps {
                self.acquire(d, n, outside);
            }
        }
        Poll::Ready
    }

    /// Replaces the nodes that a node holds besides its operands.
    pub fn set_deps(&mut self, n: NodeId, deps: Deps) {
        if deps.is_empty() && self.nodes[n as usize].side.is_none() {
            return;
        }
        let held = self.nodes[n as usize].flags & HELD != 0;
        let old = match self.nodes[n as usize].side.as_deref() {
            Some(Side::Deps(old) | Side::Kept(Kept { deps: old, .. })) => old.clone(),
            Some(Side::Choice(c)) => c.deps.clone(),
            Some(Side::Total(t)) => t.deps.clone(),
            _ => Deps::new(),
        };
        if old == deps && !matches!(self.nodes[n as usize].side.as_deref(), Some(Side::Kept(_))) {
            return;
        }
        if held {
            deps.iter().for_each(|d| self.acquire(*d, n, true));
            old.iter().for_each(|d| self.release(*d, true));
        }
        match self.nodes[n as usize].side.as_deref_mut() {
            Some(Side::Choice(c)) => {
                self.journal.push(Entry::Choice(n, Box::new(c.clone())));
                c.deps = deps;
            }
            Some(Side::Total(t)) => {
                let old = std::mem::replace(&mut t.deps, deps);
                self.note(Entry::TotalDeps(n, old));
            }
            _ => self.set_side(n, if deps.is_empty() { None } else { Some(Side::Deps(deps)) }),
        }
    }

    /// Stores the evaluation of an incremental function, and the nodes held besides the
    /// operands.
    pub fn keep(&mut self, n: NodeId, deps: Deps, before: PreviousEvaluation) {
        let old = match self.nodes[n as usize].side.as_deref() {
            Some(Side::Deps(old) | Side::Kept(Kept { deps: old, .. })) => old.clone(),
            _ => Deps::new(),
        };
        if self.nodes[n as usize].flags & HELD != 0 && old != deps {
            deps.iter().for_each(|d| self.acquire(*d, n, true));
            old.iter().for_each(|d| self.release(*d, true));
        }
        self.set_side(n, Some(Side::Kept(Kept { deps, before: Arc::new(before) })));
    }

    /// Returns the previous evaluation that an incremental function may start from.
    pub fn kept(&self, n: NodeId) -> Option<&Arc<PreviousEvaluation>> {
        match self.nodes[n as usize].side.as_deref() {
            Some(Side::Kept(k)) if self.incremental => Some(&k.before),
            _ => None,
        }
    }

    /// Makes one attempt to evaluate a node.
    fn step(&mut self, code: &Code, n: NodeId) -> Result<Poll, Failure> {
        if self.nodes[n as usize].flags & WAS_STALE != 0 && self.incremental {
            let mut changed = false;
            let mut wait = NONE;
            let epoch = self.epoch;
            self.each_dep(code, n, |d, _| {
                let dep = &self.nodes[d as usize];
                if !changed && wait == NONE {
                    if dep.state != State::Clean {
                        wait = d;
                    } else if dep.changed == epoch {
                        changed = true;
                    }
                }
            });
            if !changed {
                if wait != NONE {
                    return self.need(code, wait);
                }
                // Elements of passes also read their owner, and targets their pending
                // change.
                let op = self.op(code, n);
                let reads_more = matches!(op, Op::Item | Op::Accumulator | Op::Param { .. });
                if !reads_more && self.nodes[n as usize].flags & TARGET == 0 {
                    return Ok(self.finish_unchanged(code, n));
                }
            }
        }
        self.run(code, n)
    }

    /// Makes one attempt to run the operation of a node.
    pub fn run(&mut self, code: &Code, n: NodeId) -> Result<Poll, Failure> {
        let step = self.run_op(code, n)?;
        if let (Poll::Ready, Some(log)) = (&step, &mut self.execution_log) {
            let f = &self.frames[self.nodes[n as usize].frame as usize];
            log.push((f.block, n - f.base));
        }
        Ok(step)
    }
}
