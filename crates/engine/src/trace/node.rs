//! Nodes and frames: the storage of a trace.
//!
//! A frame is one instance of a block; its nodes are contiguous, one per slot. A node
//! stores its last value, its contribution to the score, and a reference count: how many
//! evaluated nodes and effects hold it. Data that only structural nodes need is boxed.

use crate::lang::builtins::PreviousEvaluation;
use crate::lang::error::RunError;
use crate::lang::key::Key;
use crate::lang::value::Value;
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::num::ExactSum;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::sync::Arc;

pub(crate) use crate::lang::ids::{BlockId, FrameId, NodeId, OpId, SiteId, Slot};

/// Not an element: a whole choice.
pub(crate) const NONE: u32 = u32::MAX;

/// True if a node's value is up to date.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum State {
    /// Not evaluated: nothing needs it.
    #[default]
    Empty,
    /// Up to date.
    Clean,
    /// Something it depends on may have changed.
    Stale,
    /// Being evaluated.
    Running,
}

/// The node holds its operands.
pub(crate) const HELD: u8 = 1;
/// The node is a choice with a pending change, or an observation with another value.
pub(crate) const TARGET: u8 = 2;
/// The node's state before it began to run was [`State::Stale`].
pub(crate) const WAS_STALE: u8 = 4;
/// The node is a choice with an improper distribution, which cannot be sampled.
pub(crate) const IMPROPER: u8 = 8;
/// The node is a selection that takes its second alternative.
pub(crate) const OTHERWISE: u8 = 16;

/// The node was saved to the journal in this update.
pub(crate) const SAVED: u8 = 32;

/// A node: one cache line, with the most frequently read fields first.
#[derive(Clone, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Its value; `nothing` while empty.
    pub value: Value,
    /// True if its value is up to date.
    pub state: State,
    /// [`HELD`], [`TARGET`], [`WAS_STALE`], [`IMPROPER`], [`OTHERWISE`], [`SAVED`].
    pub flags: u8,
    /// Its operation, by index in [`crate::lang::code::Code::ops`].
    pub op: OpId,
    /// Its contribution to the log joint, if that is a single term.
    pub score: f64,
    /// Data that only structural nodes and vector choices need.
    pub side: Option<Box<Side>>,
    /// How many evaluated nodes and effects hold it.
    pub refs: u32,
    /// The epoch in which its value last changed.
    pub changed: u32,
    /// Its frame.
    pub frame: FrameId,
    /// Its list of users in other frames, by index in the graph's `outside`.
    pub outside: u32,
}

const _: () = assert!(size_of::<Node>() == 64);

/// Data that only some nodes need.
#[derive(Clone, Debug)]
pub(crate) enum Side {
    /// Nodes held besides the operands: the element that an index selected, the elements
    /// that a gather read.
    Deps(Deps),
    /// The previous evaluation of an incremental host function, from which the next one
    /// starts, and nodes held besides the operands.
    Kept(Kept),
    /// `if` and calls of user functions.
    Child(Child),
    /// A call that went through `mem`.
    MemoCall(MemoCall),
    /// `for`, `map`, `fold`.
    Loop(Loop),
    /// A keyed container.
    Table(Table),
    /// `mem(f)`.
    Memo(Memo),
    /// A choice whose stored form differs from its value, or that has several elements.
    Choice(ChoiceSide),
    /// An observed array, or an observation that reads containers.
    Total(Total),
}

impl Side {
    /// Returns the nodes held besides the operands and the result.
    pub fn deps(&self) -> &[NodeId] {
        match self {
            Side::Deps(deps)
            | Side::Kept(Kept { deps, .. })
            | Side::MemoCall(MemoCall { deps, .. })
            | Side::Loop(Loop { deps, .. })
            | Side::Table(Table { deps, .. })
            | Side::Choice(ChoiceSide { deps, .. })
            | Side::Total(Total { deps, .. }) => deps,
            Side::Child(_) | Side::Memo(_) => &[],
        }
    }

    /// Returns where the node with the result of a call, branch or loop is kept.
    pub fn result(&mut self) -> Option<&mut NodeId> {
        match self {
            Side::Child(Child { result, .. })
            | Side::MemoCall(MemoCall { result, .. })
            | Side::Loop(Loop { result, .. }) => Some(result),
            _ => None,
        }
    }
}

/// Nodes held besides the operands.
pub(crate) type Deps = SmallVec<[NodeId; 4]>;

/// The last evaluation of an incremental function.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    /// Nodes held besides the operands.
    pub deps: Deps,
    /// The evaluation.
    pub before: Arc<PreviousEvaluation>,
}

/// A call that went through `mem`.
#[derive(Clone, Debug)]
pub(crate) struct MemoCall {
    /// The node of the `mem` function.
    pub memo: NodeId,
    /// The key of the entry.
    pub key: Key,
    /// The node with its result, or [`NONE`].
    pub result: NodeId,
    /// The arguments.
    pub deps: Deps,
}

/// The score of an observed array.
#[derive(Clone, Debug, Default)]
pub(crate) struct Total {
    /// The sum of the scores of the elements.
    pub sum: ExactSum,
    /// Nodes held besides the operands.
    pub deps: Deps,
}

/// The frame of a branch or call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child {
    /// The frame.
    pub frame: FrameId,
    /// The node with its result, or [`NONE`] if the result is a constant or missing.
    pub result: NodeId,
}

/// The passes of a loop.
#[derive(Clone, Debug)]
pub(crate) struct Loop {
    /// The keys of the passes.
    pub keys: Keys,
    /// The elements.
    pub items: Value,
    /// The frames; [`NONE`] for a pass that nothing has needed yet.
    pub frames: Vec<FrameId>,
    /// The block of the body and its lexical parent frame.
    pub block: BlockId,
    /// See `block`.
    pub parent: FrameId,
    /// For `fold`: the node with the last result.
    pub result: NodeId,
    /// Nodes held besides the operands.
    pub deps: Deps,
}

/// The keys of a loop's passes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Keys {
    /// `start`, `start + 1`, …
    Range { start: i64, len: usize },
    /// Any distinct keys.
    Listed { keys: Arc<[Key]>, index: Arc<FxHashMap<Key, u32>> },
}

impl Keys {
    /// The number of passes.
    pub fn len(&self) -> usize {
        match self {
            Keys::Range { len, .. } => *len,
            Keys::Listed { keys, .. } => keys.len(),
        }
    }

    /// Returns the key of pass `i`.
    pub fn get(&self, i: usize) -> Key {
        match self {
            Keys::Range { start, .. } => Key::Num(((start + i as i64) as f64 + 0.0).to_bits()),
            Keys::Listed { keys, .. } => keys[i].clone(),
        }
    }

    /// Returns the pass that a key belongs to.
    pub fn find(&self, key: &Key) -> Option<usize> {
        match self {
            Keys::Range { start, len } => {
                let Key::Num(bits) = key else { return None };
                let x = f64::from_bits(*bits) - *start as f64;
                (x >= 0.0 && x < *len as f64 && x == libm::trunc(x)).then_some(x as usize)
            }
            Keys::Listed { index, .. } => index.get(key).map(|i| *i as usize),
        }
    }
}

/// Where the elements of a keyed container are.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    /// The nodes that were read to build it.
    pub deps: Deps,
    /// By key: the source, and the pass of each of its loops; `None` if the keys of one
    /// loop are those of the container.
    pub entries: Option<Arc<indexmap::IndexMap<SmallVec<[Key; 1]>, Element>>>,
}

/// Where one element of a container is drawn.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    /// The index of the source.
    pub source: u32,
    /// The pass of each loop that leads to it.
    pub passes: SmallVec<[u32; 2]>,
}

/// The entries of a `mem` function.
#[derive(Clone, Debug)]
pub(crate) struct Memo {
    /// The function.
    pub block: BlockId,
    /// Its lexical parent frame.
    pub parent: FrameId,
    /// The live entries: frame and number of calls that use each.
    pub entries: FxHashMap<Key, (FrameId, u32)>,
}

/// Data of a vector choice, or of one whose stored form differs from its value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ChoiceSide {
    /// The stored form, if it is not the value.
    pub stored: Option<Datum>,
    /// The scores of the elements.
    pub scores: Vec<f64>,
    /// The number of separately addressed elements; [`NONE`] for a single choice.
    pub elements: u32,
    /// The hash of its address, if its frame does not determine that.
    pub hash: Option<u64>,
    /// Nodes held besides the operands.
    pub deps: Deps,
}

impl Default for ChoiceSide {
    fn default() -> ChoiceSide {
        let (stored, scores, deps) = (None, Vec::new(), Deps::new());
        ChoiceSide { stored, scores, elements: NONE, hash: None, deps }
    }
}

/// The source of a function's parameters.
#[derive(Clone, Debug)]
pub(crate) enum Arguments {
    /// Not a function's frame.
    None,
    /// Parameter `i` is argument `i` of the calling node.
    Positional(u16),
    /// Parameter `i` is this argument of the calling node, or its default.
    Mapped(Box<[Option<u16>]>),
    /// Parameter 0 is the element of the pass.
    Item,
    /// Parameter 0 is the running value, parameter 1 the element.
    Fold,
    /// The values themselves (`mem`).
    Values(Arc<[Value]>),
    /// The values, or why one is missing, which matters only if it is read.
    Supplied(Arc<[Result<Value, Box<RunError>>]>),
}

/// One instance of a block; by default, of the top level.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// The block.
    pub block: BlockId,
    /// The frame of the lexically enclosing block.
    pub parent: FrameId,
    /// The node that made it; [`NONE`] for the top level.
    pub owner: NodeId,
    /// Its first node.
    pub base: NodeId,
    /// The hash of the address prefix of its function's frame.
    pub path: u64,
    /// The depth of nested calls.
    pub depth: u32,
    /// The pass of its owner's loop.
    pub pass: u32,
    /// The key of the pass, `map` element or `mem` entry.
    pub key: Option<Key>,
    /// The source of its parameters.
    pub args: Arguments,
    /// True if its owner still uses it.
    pub attached: bool,
}

impl Default for Frame {
    fn default() -> Frame {
        Frame {
            block: BlockId::ROOT,
            parent: FrameId::NONE,
            owner: NodeId::NONE,
            base: NodeId(0),
            path: 0,
            depth: 0,
            pass: 0,
            key: None,
            args: Arguments::None,
            attached: true,
        }
    }
}

/// Users of a node that cannot be derived from its block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outside {
    /// The users; some may have released the node.
    pub users: SmallVec<[NodeId; 4]>,
    /// How many have.
    pub gone: u32,
}

impl Outside {
    /// True if most of the users have released the node.
    pub fn is_untidy(&self) -> bool {
        self.gone as usize * 2 > self.users.len()
    }
}
