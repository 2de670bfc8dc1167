//! The graph behind a trace: what it stores, the update in progress, and the score.
//!
//! Each part has methods of its own; here are those that concern several: an update from
//! its beginning to its end, and the references by which nodes hold each other.

use super::choices::Choices;
use super::journal::{Before, Entry};
use super::limits::{Budget, Limits, raise};
use super::node::*;
use super::propose::Weight;
use super::score::Score;
use super::store::Store;
use super::update::{Failure, Update};
use crate::lang::code::{Code, Op};
use crate::lang::error::FaultKind;
use crate::lang::value::Value;
use smallvec::SmallVec;
use std::ops::Deref;
use std::sync::Arc;

/// The dependency graph of one execution. It reads as its [`Store`].
#[derive(Clone, Debug)]
pub(crate) struct Graph {
    pub store: Store,
    pub update: Update,
    pub score: Score,
    pub choices: Choices,
    pub budget: Budget,
    /// Counts committed updates.
    pub revision: u64,
    /// Block and slot of everything executed, while execution is recorded.
    pub execution_log: Option<Vec<(BlockId, Slot)>>,
}

impl Deref for Graph {
    type Target = Store;

    #[inline]
    fn deref(&self) -> &Store {
        &self.store
    }
}

impl Graph {
    /// Creates the graph of a program that has not run.
    pub fn new(code: Arc<Code>, limits: Limits) -> Self {
        Graph {
            store: Store::new(code),
            update: Update::default(),
            score: Score::default(),
            choices: Choices::default(),
            budget: Budget::new(limits),
            revision: 0,
            execution_log: None,
        }
    }

    /// Begins an update.
    pub fn begin(&mut self) -> Before {
        if self.update.begin() {
            self.store.forget_changes();
        }
        self.budget.renew();
        self.score.begin()
    }

    /// Returns the effect of the current update on the score.
    pub fn weight(&self, before: &Before) -> Weight {
        let mut undrawn = self.score.undrawn.clone();
        self.update.vanished_scores().iter().for_each(|(_, s)| undrawn.add(*s));
        let Update { appeared, vanished, .. } = self.update;
        Weight { appeared, vanished, ..self.score.weight(before, &undrawn) }
    }

    /// Commits the update.
    pub fn commit(&mut self) {
        self.revision += 1;
        self.update.commit(&mut self.store);
        self.choices.forget_update();
    }

    /// Undoes the update.
    pub fn rollback(&mut self, before: Before) {
        while let Some(entry) = self.update.pop_entry() {
            entry.undo(&mut self.store, &mut self.choices);
        }
        self.score.rollback(before);
        self.update.forget();
        self.choices.forget_update();
    }

    /// Creates a frame for `owner` as part of the current update, and queues its effects.
    pub fn make_frame(&mut self, frame: Frame) -> Result<FrameId, Failure> {
        let len = self.code.blocks[frame.block].len();
        if frame.depth > self.budget.limits.depth {
            return Err(self.fail(
                frame.owner,
                FaultKind::Limit,
                format!("calls are nested more than {} deep", self.budget.limits.depth),
                Some(format!("does the recursion reach a base case? If so, {}", raise("depth"))),
            ));
        }
        if self.store.len() + len > self.budget.limits.nodes as usize {
            return Err(self.fail(
                frame.owner,
                FaultKind::Limit,
                format!("the trace grew beyond {} nodes", self.budget.limits.nodes),
                Some(format!(
                    "does the program loop or recurse forever? If not, {}",
                    raise("nodes")
                )),
            ));
        }
        self.budget.count_operation(&self.store, frame.owner)?;
        let block = frame.block;
        let id = self.store.place_frame(frame);
        self.update.note(Entry::FrameMade(id));
        let base = self.store[id].base;
        for i in 0..self.code.blocks[block].effects.len() {
            let n = base + self.code.blocks[block].effects[i];
            self.store[n].refs = 1;
            self.update.effects.push(n);
        }
        Ok(id)
    }

    /// Adds a reference to a node.
    pub fn acquire(&mut self, dep: NodeId, user: NodeId, outside: bool) {
        self.update.note(Entry::Acquired(dep, outside));
        self.store[dep].refs += 1;
        if outside {
            self.store.add_outside(dep, user);
        }
    }

    /// Releases a reference to a node; nodes without references are emptied at the end of
    /// the update.
    pub fn release(&mut self, dep: NodeId, outside: bool) {
        self.update.note(Entry::Released(dep, outside));
        let node = &mut self.store[dep];
        node.refs -= 1;
        if node.refs == 0 {
            self.update.unheld.push(dep);
        }
        if outside {
            let list = self.store.outside_mut(dep);
            list.gone += 1;
            if list.is_untidy() && list.gone > 8 {
                self.update.untidy.push(dep);
            }
        }
    }

    /// Detaches a frame: its effects are released, together with what only they hold.
    pub fn detach(&mut self, id: FrameId) {
        let frame = &mut self.store[id];
        if !frame.attached {
            return;
        }
        frame.attached = false;
        let (block, base) = (frame.block, frame.base);
        self.update.note(Entry::FrameDetached(id));
        self.update.detached.push(id);
        for i in 0..self.code.blocks[block].effects.len() {
            self.release(base + self.code.blocks[block].effects[i], false);
        }
    }

    /// Empties every node that nothing holds.
    pub fn sweep(&mut self) {
        loop {
            if let Some(n) = self.update.unheld.pop() {
                let node = &self.store[n];
                if node.refs == 0 && node.state != State::Empty {
                    self.retire(n);
                }
            } else if let Some((memo, key)) = self.update.idle.pop() {
                self.drop_idle(memo, &key);
            } else {
                return;
            }
        }
    }

    /// Empties a node: removes its contribution to the score and releases what it holds.
    fn retire(&mut self, n: NodeId) {
        self.update.save(&mut self.store, n);
        let op = self.op(n);
        match op {
            Op::Draw { .. } => self.retire_choice(n),
            Op::Observe { .. } | Op::Factor { .. } => {
                self.update.effects_changed += 1;
                self.retire_score(n);
            }
            _ => {}
        }
        if self.store[n].flags & HELD != 0 {
            let mut deps: SmallVec<[(NodeId, bool); 8]> = SmallVec::new();
            self.each_dep(n, |d, outside| deps.push((d, outside)));
            for (d, outside) in deps {
                self.release(d, outside);
            }
        }
        self.drop_structure(n);
        let node = &mut self.store[n];
        node.state = State::Empty;
        node.flags &= SAVED;
        node.value = Value::Unit;
        node.score = 0.0;
    }

    /// Releases everything that a node holds besides its operands, before its form
    /// changes.
    pub fn let_side_go(&mut self, n: NodeId) {
        if self.store[n].flags & HELD != 0 {
            let mut deps: SmallVec<[(NodeId, bool); 4]> = SmallVec::new();
            self.each_side_dep(n, |d, outside| deps.push((d, outside)));
            for (d, outside) in deps {
                self.release(d, outside);
            }
        }
        self.drop_structure(n);
    }

    /// Releases the frames and table entries that a node owns, and its side.
    pub fn drop_structure(&mut self, n: NodeId) {
        let Some(side) = self.swap_side(n, None) else { return };
        match &side {
            Side::Child(c) => self.detach(c.frame),
            Side::MemoCall(c) => self.leave_memo(c.memo, &c.key),
            Side::Loop(l) => {
                l.frames.iter().filter(|f| **f != FrameId::NONE).for_each(|f| self.detach(*f))
            }
            Side::Memo(m) => m.entries.values().for_each(|(f, _)| self.detach(*f)),
            _ => {}
        }
        self.update.note(Entry::Side(n, Some(Box::new(side))));
    }

    /// Replaces a node's side without a journal entry.
    pub fn swap_side(&mut self, n: NodeId, side: Option<Side>) -> Option<Side> {
        std::mem::replace(&mut self.store[n].side, side.map(Box::new)).map(|b| *b)
    }

    /// Replaces a node's side, and records the old one for a roll-back.
    pub fn set_side(&mut self, n: NodeId, side: Option<Side>) {
        let old = std::mem::replace(&mut self.store[n].side, side.map(Box::new));
        self.update.note(Entry::Side(n, old));
    }
}
