//! An update of a trace: changes are queued and invalidate what they may reach
//! (`invalidate`), what is needed is evaluated anew (`propagate`), and the update is
//! weighed and committed or undone (`graph.rs`).

mod invalidate;
mod propagate;

pub(super) use propagate::{Failure, Poll, Step};

use super::journal::Entry;
use super::node::*;
use super::propose::{Constraint, Draws, Pending};
use super::store::Store;
use crate::lang::ids::OpId;
use crate::lang::key::Key;
use pcadlang_numerics::dist::Datum;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// The state of one update.
#[derive(Clone, Debug, Default)]
pub(crate) struct Update {
    journal: Vec<Entry>,
    /// The number of the update.
    pub epoch: u32,
    /// The stack of nodes being evaluated.
    pub stack: Vec<NodeId>,
    /// The contents of the stack when an evaluation failed.
    pub failed: Vec<NodeId>,
    /// Effects of new frames that are still to be run.
    pub effects: Vec<NodeId>,
    /// Effects and choices that became stale.
    stale_effects: Vec<NodeId>,
    stale_choices: Vec<NodeId>,
    /// Observations that wait for a later stage ([`Trace::let_wait`](super::Trace)), those of the
    /// last stage first, and the nodes of this update that do.
    pub late: Vec<Arc<[OpId]>>,
    pub waiting: Vec<NodeId>,
    /// How many stages the pending proposal has passed.
    stage: usize,
    /// Nodes whose last reference was released.
    pub unheld: Vec<NodeId>,
    /// Entries of `mem` functions whose last call was released.
    pub idle: Vec<(NodeId, Key)>,
    /// Frames that their owners released.
    pub detached: Vec<FrameId>,
    /// Nodes whose lists of outside users need compaction.
    pub untidy: Vec<NodeId>,
    /// The changes that it applies.
    pub pending: Vec<Pending>,
    /// Elements of choices that it resampled: their previous prior density is in the
    /// score's `undrawn`.
    pub redrawn: Vec<(NodeId, u32)>,
    /// The choices that vanished, with their scores at that time. Choices may have been
    /// re-scored under other parameters before they vanished.
    pub retired: Vec<(NodeId, f64)>,
    /// The choices that it removed: node, address hash and stored value.
    pub removed: Vec<(NodeId, u64, Datum)>,
    /// How many choices appeared and vanished.
    pub appeared: u32,
    pub vanished: u32,
    /// How many observations and factors did.
    pub effects_changed: u32,
    pub draws: Draws,
    /// Set while a program runs for the first time: improper choices may then take a
    /// value to start from.
    pub starting: bool,
    /// If set, continuous choices of the first run are uniform between minus this and this in
    /// the unconstrained space, instead of drawn from the prior.
    pub spread: Option<f64>,
    /// Values that choices take when they are first drawn.
    pub constraints: FxHashMap<u64, Constraint>,
}

impl Update {
    /// Begins the next update. True if the epochs start again.
    pub fn begin(&mut self) -> bool {
        debug_assert!(self.journal.is_empty());
        self.redrawn.clear();
        self.retired.clear();
        self.removed.clear();
        self.stage = 0;
        (self.appeared, self.vanished, self.effects_changed) = (0, 0, 0);
        self.next_epoch()
    }

    /// True if an observation waits for a later stage.
    pub fn is_late(&self, op: OpId) -> bool {
        let stages = self.late.len().saturating_sub(self.stage);
        self.late[..stages].iter().any(|stage| stage.contains(&op))
    }

    /// Begins the next stage: lets the observations run that waited for it.
    pub fn begin_stage(&mut self, store: &Store) {
        self.stage += 1;
        for n in std::mem::take(&mut self.waiting) {
            let waits = self.is_late(store[n].op);
            let list = if waits { &mut self.waiting } else { &mut self.stale_effects };
            list.push(n);
        }
    }

    /// True if it has neither changed which choices there are nor drawn any.
    pub fn is_fixed(&self) -> bool {
        let none = self.redrawn.is_empty() && self.retired.is_empty() && self.removed.is_empty();
        none && (self.appeared, self.vanished) == (0, 0)
    }

    /// Goes on with another change. True if the epochs start again.
    pub fn renew(&mut self) -> bool {
        self.pending.clear();
        self.next_epoch()
    }

    fn next_epoch(&mut self) -> bool {
        let next = self.epoch.checked_add(1);
        self.epoch = next.unwrap_or(1);
        next.is_none()
    }

    /// Records a mutation; the first run of a program is never undone and leaves no
    /// entries.
    #[inline]
    pub fn note(&mut self, entry: Entry) {
        if !self.starting {
            self.journal.push(entry);
        }
    }

    /// Saves a node's plain fields, once per update.
    pub fn save(&mut self, store: &mut Store, n: NodeId) {
        let node = &mut store[n];
        if node.flags & SAVED == 0 && !self.starting {
            self.journal.push(Entry::Node {
                id: n,
                value: node.value.clone(),
                score: node.score,
                refs: node.refs,
                changed: node.changed,
                state: node.state,
                flags: node.flags,
            });
            node.flags |= SAVED;
        }
    }

    /// Returns what has been recorded so far.
    pub fn journal(&self) -> &[Entry] {
        &self.journal
    }

    /// Removes the last entry of the journal.
    pub fn pop_entry(&mut self) -> Option<Entry> {
        self.journal.pop()
    }

    /// Returns the pending changes of a choice.
    pub fn pending_of(&self, n: NodeId) -> impl Iterator<Item = &Pending> {
        let first = self.pending.partition_point(|p| p.node < n);
        self.pending[first..].iter().take_while(move |p| p.node == n)
    }

    /// Returns the choices that vanished with their scores before the update, except those
    /// that appeared or were resampled in it: they are undone with what they added to the
    /// score's `drawn`.
    pub fn vanished_scores(&self) -> Vec<(NodeId, f64)> {
        let mut retired = self.retired.clone();
        retired.sort_by_key(|(n, _)| *n);
        if !retired.is_empty() {
            for entry in &self.journal {
                let Entry::Node { id, score, state, .. } = entry else { continue };
                let first = retired.partition_point(|(n, _)| n < id);
                if let Some((_, s)) = retired.get_mut(first).filter(|(n, _)| n == id)
                    && *state != State::Empty
                    && !self.redrawn.contains(&(*id, NONE))
                {
                    *s = *score;
                }
            }
        }
        retired
    }

    /// Makes the update permanent: clears the journal, and frees what it released.
    pub fn commit(&mut self, store: &mut Store) {
        for entry in self.journal.drain(..) {
            if let Entry::Node { id, .. } = entry {
                store[id].flags &= !SAVED;
            }
        }
        self.detached.drain(..).for_each(|f| store.free_frame(f));
        self.untidy.drain(..).rev().for_each(|n| store.tidy(n));
        self.forget();
    }

    /// Clears what only the update needs.
    pub fn forget(&mut self) {
        self.stack.clear();
        self.effects.clear();
        self.stale_effects.clear();
        self.stale_choices.clear();
        self.waiting.clear();
        self.unheld.clear();
        self.idle.clear();
        self.detached.clear();
        self.untidy.clear();
        self.pending.clear();
    }
}
