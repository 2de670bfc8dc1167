//! A lowered program: its blocks, and what their operations refer to by index.

use super::op::{Op, Operand};
use super::slots::SlotFacts;
use crate::lang::address::segment_hash;
use crate::lang::builtins::Table;
use crate::lang::ids::{BlockId, OpId, Slot};
use crate::lang::value::Value;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// A whole lowered program.
#[derive(Clone, Debug, Default)]
pub struct Code {
    /// The blocks; block 0 is the top level.
    pub blocks: Vec<Block>,
    /// The operations of all blocks, one block after the other, and the static facts
    /// about the slot of each.
    pub ops: Vec<Op>,
    /// See `ops`.
    pub slots: Vec<SlotFacts>,
    /// The constants.
    pub consts: Vec<Value>,
    /// The built-ins that indices in operations refer to.
    pub builtins: Arc<Table>,
    /// The sites of choices, observations, calls and loops.
    pub sites: Vec<Site>,
    /// Every tag name that occurs.
    pub tags: Vec<Arc<str>>,
    /// Top-level names and their slots, in order of binding.
    pub globals: indexmap::IndexMap<Arc<str>, Operand>,
    /// The quantities that `predict` records, in order.
    pub predictions: Vec<(Arc<str>, Operand)>,
    /// The names bound by `assume`, in order: what a report shows if nothing else is
    /// collected.
    pub assumed: Vec<(Arc<str>, Operand)>,
    /// `sample e;` statements, in order.
    pub samples: Vec<Operand>,
    /// `force @a = v;` statements, in order.
    pub forces: Vec<Force>,
    /// True if it has `freeze` statements.
    pub has_freezes: bool,
    /// Expressions of reports and exports, by source span.
    pub queries: rustc_hash::FxHashMap<Span, Operand>,
    /// Observed values that replace those of the program, by the hash of the
    /// observation's address.
    pub observed: Arc<Observed>,
    /// The slots that run even if nothing depends on them.
    pub eager: Eager,
}

/// The slots that run even if nothing depends on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Eager {
    /// Observations and factors: a choice that none of them depends on is not part of a
    /// trace.
    #[default]
    Observations,
    /// Top-level names too (except predictions), so that reading a name twice gives the
    /// same value.
    Names,
    /// Only top-level names: the prior of a program whose data are not available.
    NamesOnly,
}

/// Observed values by the hash of the observation's address.
pub type Observed = rustc_hash::FxHashMap<u64, Value>;

/// `force @a = v;`
#[derive(Clone, Debug)]
pub struct Force {
    /// The address.
    pub target: pcadlang_syntax::ast::Address,
    /// The value: an operand of the top level.
    pub value: Operand,
    /// The statement.
    pub span: Span,
}

/// The kind of a block.
#[derive(Clone, Debug, PartialEq)]
pub enum BlockKind {
    /// The top level.
    Root,
    /// A function.
    Function {
        /// Its name; `fn` if it is anonymous.
        name: Arc<str>,
        /// The names of its parameters.
        params: Arc<[Arc<str>]>,
        /// The number of leading parameters without a default.
        required: usize,
    },
    /// A branch of an `if`.
    Branch,
    /// The body of a `for` statement.
    Loop,
}

/// A straight line of operations.
#[derive(Clone, Debug)]
pub struct Block {
    /// Its kind.
    pub kind: BlockKind,
    /// The lexically enclosing block.
    pub parent: Option<BlockId>,
    /// The operations, by slot, while the block is being built; they are then moved to
    /// [`Code::ops`].
    pub ops: Vec<Op>,
    /// The index of its first operation in [`Code::ops`].
    pub first: OpId,
    /// The source span of each operation.
    pub spans: Vec<Span>,
    /// The value of the block.
    pub result: Option<Operand>,
    /// The slots that run even if nothing depends on them: observations, factors, and
    /// what contains them.
    pub effects: Vec<Slot>,
}

/// A place in the program text that contributes to addresses.
#[derive(Clone, Debug)]
pub struct Site {
    /// The segments that it adds to the path of its function's frame, outermost first.
    /// The keys of the enclosing loops go to the first of them.
    pub segments: Arc<[SiteSegment]>,
    /// The enclosing loops of the same function, as a bit mask from the innermost, that
    /// add no key because the target carries it.
    pub carried: u32,
    /// Tags of the choices at and below it: name and value.
    pub tags: Box<[SiteTag]>,
}

/// A segment of a [`Site`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SiteSegment {
    /// Its name.
    pub name: Arc<str>,
    /// The occurrence of the name.
    pub occurrence: u32,
    /// A hash of both.
    pub hash: u64,
}

impl SiteSegment {
    /// Creates a segment. Observations without a name show their occurrence even if it is
    /// the first.
    pub fn new(name: Arc<str>, occurrence: u32) -> Self {
        let hash = segment_hash(&name, occurrence);
        SiteSegment { name, occurrence, hash }
    }
}

/// A tag at a site.
#[derive(Clone, Debug)]
pub struct SiteTag {
    /// The index of its name in [`Code::tags`].
    pub name: u32,
    /// Its value, if any: an operand of the site's block.
    pub value: Option<Operand>,
}

impl Block {
    /// Creates an empty block.
    pub fn new(kind: BlockKind, parent: Option<BlockId>) -> Self {
        Block {
            kind,
            parent,
            ops: Vec::new(),
            spans: Vec::new(),
            result: None,
            first: OpId(0),
            effects: Vec::new(),
        }
    }

    /// Returns the number of slots.
    pub fn len(&self) -> usize {
        self.spans.len()
    }

    /// Iterates over its slots.
    pub fn slots(&self) -> impl DoubleEndedIterator<Item = Slot> + use<> {
        (0..self.len()).map(Slot::new)
    }

    /// True if it has no slots.
    pub fn is_empty(&self) -> bool {
        self.spans.is_empty()
    }

    /// Appends an operation and returns its slot.
    pub fn push(&mut self, op: Op, span: Span) -> Slot {
        self.ops.push(op);
        self.spans.push(span);
        Slot::new(self.ops.len() - 1)
    }
}

/// The number of most recent constants that are searched for an equal one.
const SHARED_CONSTANTS: usize = 256;

impl Code {
    /// Returns the same program with other observed values.
    #[must_use]
    pub fn with_observed(&self, observed: Arc<Observed>) -> Code {
        Code { observed, ..self.clone() }
    }

    /// Returns the operand of a constant, which is added if it is new. Numbers, bools and
    /// strings are shared.
    pub fn constant(&mut self, v: Value) -> Operand {
        let shareable = matches!(
            v,
            Value::Num(_) | Value::Bool(_) | Value::Str(_) | Value::Unit | Value::Builtin(_)
        );
        // Only the most recent ones are searched, so that the cost of a long table of
        // numbers is linear in its length.
        let first = self.consts.len().saturating_sub(SHARED_CONSTANTS);
        if shareable && let Some(i) = self.consts[first..].iter().position(|c| c.same(&v)) {
            return Operand::Const((first + i) as u32);
        }
        self.consts.push(v);
        Operand::Const(self.consts.len() as u32 - 1)
    }

    /// Returns the value of a constant.
    pub fn const_value(&self, i: u32) -> &Value {
        &self.consts[i as usize]
    }
}
