//! Undo journal: every mutation leaves an entry, and a roll-back replays the entries
//! backwards.
//!
//! A node's plain fields are saved once per update, before their first change; structure
//! is saved at each change. The score sums are saved whole. In the steady state nothing
//! is allocated, because the journal keeps its capacity.

use super::choices::Listed;
use super::node::*;
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
