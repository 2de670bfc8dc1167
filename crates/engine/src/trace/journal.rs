//! Undo journal: every mutation leaves an entry, and a roll-back replays the entries
//! backwards.
//!
//! A node's plain fields are saved once per update, before their first change; structure
//! is saved at each change. The score sums are saved whole. In the steady state nothing
//! is allocated, because the journal keeps its capacity.

use super::choices::{Choices, Listed};
use super::node::*;
use super::store::Store;
use crate::lang::key::Key;
use crate::lang::value::Value;
use pcadlang_numerics::num::ExactSum;

/// One undoable mutation.
#[derive(Clone, Debug)]
pub(crate) enum Entry {
    /// The plain fields of a node before the update.
    Node {
        id: NodeId,
        value: Value,
        score: f64,
        refs: u32,
        changed: u32,
        state: State,
        flags: u8,
    },
    /// A node's side before it was replaced.
    Side(NodeId, Option<Box<Side>>),
    /// The content of a choice's side before it changed.
    Choice(NodeId, Box<ChoiceSide>),
    /// The total of an observed array, or the nodes it holds, before a change.
    Sum(NodeId, ExactSum),
    TotalDeps(NodeId, Deps),
    /// A frame was made.
    FrameMade(FrameId),
    /// A frame was detached.
    FrameDetached(FrameId),
    /// The frame of a pass was made on demand.
    PassMade(NodeId, u32),
    /// A frame now belongs to another pass.
    PassMoved(FrameId, u32),
    /// An entry of a `mem` function changed.
    Memo(NodeId, Key, Option<(FrameId, u32)>),
    /// A reference to a node was acquired or released, from another frame or not.
    Acquired(NodeId, bool),
    Released(NodeId, bool),
    /// A choice was registered, or removed, under this address hash.
    ChoiceAdded(NodeId, u64),
    ChoiceRemoved(NodeId, u64),
    /// The members of a selection changed.
    TargetsReplaced {
        selection: u32,
        before: Listed,
    },
    /// An entry of the address index was overwritten.
    AddressShadowed(u64, NodeId),
    /// An observed value was replaced.
    Observed(u64, Option<Value>),
}

/// The score sums before an update.
#[derive(Clone, Debug)]
pub(crate) struct Before {
    pub prior: ExactSum,
    pub likelihood: ExactSum,
}

impl Entry {
    /// Undoes the mutation.
    pub fn undo(self, store: &mut Store, choices: &mut Choices) {
        match self {
            Entry::Node { id, value, score, refs, changed, state, flags } => {
                let node = &mut store[id];
                node.value = value;
                node.score = score;
                node.refs = refs;
                node.changed = changed;
                node.state = state;
                node.flags = flags;
            }
            Entry::Side(n, side) => store[n].side = side,
            Entry::Choice(n, old) => {
                if let Some(Side::Choice(c)) = store[n].side.as_deref_mut() {
                    *c = *old;
                }
            }
            Entry::Sum(n, old) => {
                if let Some(Side::Total(t)) = store[n].side.as_deref_mut() {
                    t.sum = old;
                }
            }
            Entry::TotalDeps(n, old) => {
                if let Some(Side::Total(t)) = store[n].side.as_deref_mut() {
                    t.deps = old;
                }
            }
            Entry::FrameMade(f) => store.free_frame(f),
            Entry::FrameDetached(f) => store[f].attached = true,
            Entry::PassMade(n, pass) => {
                if let Some(Side::Loop(l)) = store[n].side.as_deref_mut() {
                    l.frames[pass as usize] = FrameId::NONE;
                }
            }
            Entry::PassMoved(f, before) => store[f].pass = before,
            Entry::Memo(n, key, old) => {
                if let Some(Side::Memo(m)) = store[n].side.as_deref_mut() {
                    match old {
                        Some(e) => m.entries.insert(key, e),
                        None => m.entries.remove(&key),
                    };
                }
            }
            Entry::Acquired(n, outside) => {
                store[n].refs -= 1;
                if outside {
                    store.outside_mut(n).users.pop();
                }
            }
            Entry::Released(n, outside) => {
                store[n].refs += 1;
                if outside {
                    store.outside_mut(n).gone -= 1;
                }
            }
            Entry::ChoiceAdded(n, hash) => {
                if choices.find(hash) == Some(n) {
                    choices.by_address.remove(&hash);
                }
            }
            Entry::ChoiceRemoved(n, hash) | Entry::AddressShadowed(hash, n) => {
                choices.by_address.insert(hash, n);
            }
            Entry::TargetsReplaced { selection, before } => {
                choices.selections[selection as usize].listed = before;
            }
            Entry::Observed(hash, old) => store.undo_observed(hash, old),
        }
    }
}
