//! The beginning and the end of an update: it is committed, or undone by its journal.

use crate::lang::code::Code;
use crate::trace::graph::Graph;
use crate::trace::journal::{Before, Entry};
use crate::trace::node::*;
use pcadlang_numerics::num::ExactSum;

impl Graph {
    /// Begins an update.
    pub fn begin(&mut self) -> Before {
        debug_assert!(self.journal.is_empty());
        self.epoch = match self.epoch.checked_add(1) {
            Some(e) => e,
            None => {
                for n in &mut self.nodes {
                    n.changed = 0;
                }
                1
            }
        };
        self.spent.renew();
        self.drawn = ExactSum::default();
        self.undrawn = ExactSum::default();
        self.redrawn.clear();
        self.retired.clear();
        self.jacobian = ExactSum::default();
        self.removed.clear();
        self.appeared = 0;
        self.vanished = 0;
        Before { prior: self.prior.clone(), likelihood: self.likelihood.clone() }
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
    pub fn save(&mut self, n: NodeId) {
        let node = &mut self.nodes[n as usize];
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

    /// Commits the update.
    pub fn commit(&mut self, code: &Code) {
        self.revision += 1;
        let mut journal = std::mem::take(&mut self.journal);
        for entry in journal.drain(..) {
            if let Entry::Node { id, .. } = entry {
                self.nodes[id as usize].flags &= !SAVED;
            }
        }
        self.journal = journal;
        let detached = std::mem::take(&mut self.detached);
        for f in &detached {
            self.free_frame(code, *f);
        }
        self.detached = detached;
        self.forget_update();
        while let Some(n) = self.untidy.pop() {
            self.tidy(code, n);
        }
    }

    /// Undoes the update.
    pub fn rollback(&mut self, code: &Code, before: Before) {
        while let Some(entry) = self.journal.pop() {
            match entry {
                Entry::Node { id, value, score, refs, changed, state, flags } => {
                    let node = &mut self.nodes[id as usize];
                    node.value = value;
                    node.score = score;
                    node.refs = refs;
                    node.changed = changed;
                    node.state = state;
                    node.flags = flags;
                }
                Entry::Side(n, side) => self.nodes[n as usize].side = side,
                Entry::Choice(n, old) => {
                    if let Some(Side::Choice(c)) = self.nodes[n as usize].side.as_deref_mut() {
                        *c = *old;
                    }
                }
                Entry::Sum(n, old) => {
                    if let Some(Side::Total(t)) = self.nodes[n as usize].side.as_deref_mut() {
                        t.sum = old;
                    }
                }
                Entry::TotalDeps(n, old) => {
                    if let Some(Side::Total(t)) = self.nodes[n as usize].side.as_deref_mut() {
                        t.deps = old;
                    }
                }
                Entry::FrameMade(f) => self.free_frame(code, f),
                Entry::FrameDetached(f) => self.frames[f as usize].attached = true,
                Entry::PassMade(n, pass) => {
                    if let Some(Side::Loop(l)) = self.nodes[n as usize].side.as_deref_mut() {
                        l.frames[pass as usize] = NONE;
                    }
                }
                Entry::PassMoved(f, before) => self.frames[f as usize].pass = before,
                Entry::Memo(n, key, old) => {
                    if let Some(Side::Memo(m)) = self.nodes[n as usize].side.as_deref_mut() {
                        match old {
                            Some(e) => m.entries.insert(key, e),
                            None => m.entries.remove(&key),
                        };
                    }
                }
                Entry::Acquired(n, outside) => {
                    let node = &mut self.nodes[n as usize];
                    node.refs -= 1;
                    if outside {
                        self.outside[node.outside as usize].users.pop();
                    }
                }
                Entry::Released(n, outside) => {
                    let node = &mut self.nodes[n as usize];
                    node.refs += 1;
                    if outside {
                        self.outside[node.outside as usize].gone -= 1;
                    }
                }
                Entry::ChoiceAdded(n, hash) => {
                    if self.choices.find(hash) == Some(n) {
                        self.choices.by_address.remove(&hash);
                    }
                }
                Entry::ChoiceRemoved(n, hash) | Entry::AddressShadowed(hash, n) => {
                    self.choices.by_address.insert(hash, n);
                }
                Entry::TargetsReplaced { selection, before } => {
                    self.choices.selections[selection as usize].listed = before;
                }
                Entry::Observed(hash, old) => self.undo_observed(hash, old),
            }
        }
        self.prior = before.prior;
        self.likelihood = before.likelihood;
        self.forget_update();
        self.untidy.clear();
    }

    /// Clears the data of one update.
    fn forget_update(&mut self) {
        self.stack.clear();
        self.effects.clear();
        self.stale_effects.clear();
        self.stale_choices.clear();
        self.unheld.clear();
        self.idle.clear();
        self.detached.clear();
        self.pending.clear();
        self.choices.forget_update();
    }

    /// Frees a frame's storage.
    fn free_frame(&mut self, code: &Code, f: FrameId) {
        let (block, base) = (self.frames[f as usize].block as usize, self.frames[f as usize].base);
        let end = base + code.blocks[block].len() as u32;
        for n in base..end {
            let outside = self.nodes[n as usize].outside;
            if outside != 0 {
                self.outside[outside as usize].users.clear();
                self.outside[outside as usize].gone = 0;
                self.free_outside.push(outside);
            }
            self.nodes[n as usize] = Node::default();
        }
        self.free_bases[block].push(base);
        self.free_frames.push(f);
    }

    /// Removes the users that have released a node from its list of outside users.
    fn tidy(&mut self, code: &Code, n: NodeId) {
        let list = self.nodes[n as usize].outside as usize;
        if list == 0 || self.outside[list].gone as usize * 2 <= self.outside[list].users.len() {
            return;
        }
        let mut users = std::mem::take(&mut self.outside[list].users);
        users.sort_unstable();
        // Keeps one entry per reading, since each is released on its own.
        let (mut user, mut readings) = (NONE, 0);
        users.retain(|u| {
            if *u != user {
                (user, readings) = (*u, 0);
                if self.nodes[user as usize].state != State::Empty {
                    self.each_dep(code, user, |d, outside| {
                        readings += u32::from(outside && d == n)
                    });
                }
            }
            let kept = readings > 0;
            readings = readings.saturating_sub(1);
            kept
        });
        self.outside[list] = Outside { users, gone: 0 };
    }
}
