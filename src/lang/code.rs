//! Lowered code: blocks of operations in slots, with every name resolved.
//!
//! A block is a straight line of operations; slot `i` holds the result of operation `i`,
//! and an operand is a constant, a slot of the same block, or a slot of an enclosing one.
//! Bodies that may run any number of times (functions, branches, loop passes) are
//! separate blocks. The trace instantiates a block as a frame of nodes, one node per
//! slot, and evaluates a slot on demand.

pub use super::slots::{SlotFacts, StaticScaffold};

use super::builtins::Table;
use super::value::Value;
use crate::syntax::span::Span;
use std::sync::Arc;

/// The index of a block in [`Code::blocks`].
pub type BlockId = u32;
/// The index of a slot in a block.
pub type Slot = u32;

/// Where an operation finds an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operand {
    /// A constant, by index into [`Code::consts`].
    Const(u32),
    /// A slot of the same block.
    Local(Slot),
    /// A slot of the block `up` levels out.
    Outer {
        /// How many lexical levels out.
        up: u16,
        /// The slot there.
        slot: Slot,
    },
}

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
    /// Whether it has `freeze` statements.
    pub has_freezes: bool,
    /// Expressions of reports and exports, by source span.
    pub queries: rustc_hash::FxHashMap<Span, Operand>,
    /// Observed values that replace those of the program, by the hash of the
    /// observation's address.
    pub observed: Arc<Observed>,
    /// What runs even if nothing depends on it.
    pub eager: Eager,
}

/// What runs even if nothing depends on it.
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
    pub target: crate::syntax::ast::Address,
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
    pub first: u32,
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

/// Returns the hash of a segment without its keys.
pub fn segment_hash(name: &str, occurrence: u32) -> u64 {
    super::key::mix(super::key::hash_str(0x5e67_3a11, name), u64::from(occurrence))
}

/// A tag at a site.
#[derive(Clone, Debug)]
pub struct SiteTag {
    /// The index of its name in [`Code::tags`].
    pub name: u32,
    /// Its value, if any: an operand of the site's block.
    pub value: Option<Operand>,
}

/// A distribution: constructed in place from its parameters, or a value.
#[derive(Clone, Debug)]
pub enum DistSpec {
    /// A call of a built-in family, constructed where it is needed and never stored.
    Family {
        /// The built-in, by index in the table.
        builtin: u32,
        /// Its parameters in the table's order.
        args: Box<[Operand]>,
    },
    /// Any expression whose value is a distribution or likelihood.
    Value(Operand),
}

impl DistSpec {
    /// Returns the operands it reads.
    pub fn operands(&self) -> &[Operand] {
        match self {
            DistSpec::Family { args, .. } => args,
            DistSpec::Value(v) => std::slice::from_ref(v),
        }
    }
}

/// The function of a call.
#[derive(Clone, Copy, Debug)]
pub enum Callee {
    /// A named top-level function.
    Static(BlockId),
    /// A value.
    Value(Operand),
}

/// A draw whose choices are elements of a keyed container.
#[derive(Clone, Debug)]
pub struct Source {
    /// The `for` operations that lead to the draw, outermost first: a slot of the
    /// container's block, then of each body.
    pub loops: Box<[Slot]>,
    /// The draw, in the innermost body (or the container's own block).
    pub draw: Slot,
    /// Its keys.
    pub keys: Box<[SourceKey]>,
}

/// A key of a drawn element.
#[derive(Clone, Copy, Debug)]
pub enum SourceKey {
    /// The variable of the enclosing loop, by index into [`Source::loops`].
    Loop(u32),
    /// An operand of the draw's block.
    Operand(Operand),
}

/// A property of the whole trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Probe {
    /// The log joint density.
    LogJoint,
    /// Its prior part.
    LogPrior,
    /// Its observed part.
    LogLikelihood,
}

/// An operation.
#[derive(Clone, Debug)]
pub enum Op {
    /// A parameter of the function, or its default.
    Param {
        /// The index of the parameter.
        index: u16,
        /// Its default.
        default: Option<Operand>,
    },
    /// The element of a loop pass or `map` call.
    Item,
    /// The running value of a `fold`.
    Accumulator,
    /// A built-in function.
    Prim {
        /// Its index in the table.
        builtin: u32,
        /// Its arguments in the table's order; the constant `nothing` for omitted ones.
        args: Box<[Operand]>,
    },
    /// `[a, b]`
    Array(Box<[Operand]>),
    /// `{ a: x, b: y }`
    Record {
        /// The names.
        names: Box<[Arc<str>]>,
        /// The values.
        values: Box<[Operand]>,
    },
    /// `a[i]`, `a.b`, and `t[i][j]` of a container with two keys.
    Index {
        /// The array, record, object or container.
        base: Operand,
        /// The keys.
        keys: Box<[Operand]>,
    },
    /// A call of a user function.
    Call {
        /// The function.
        callee: Callee,
        /// The arguments as written.
        args: Box<[(Option<Arc<str>>, Operand)]>,
        /// Its site, by index into [`Code::sites`].
        site: u32,
    },
    /// `if c { … } else { … }`
    If {
        /// The condition.
        cond: Operand,
        /// When true.
        then: BlockId,
        /// When false.
        otherwise: BlockId,
    },
    /// A branch whose alternatives are slots of this block (created by `flatten`); only
    /// the one taken is evaluated.
    Select {
        /// The condition.
        cond: Operand,
        /// When true.
        then: Operand,
        /// When false.
        otherwise: Operand,
    },
    /// A function value, closing over this frame.
    Closure(BlockId),
    /// `for x in e { … }`: one frame per pass.
    For {
        /// The array, range or record that it iterates over.
        iter: Operand,
        /// The body.
        body: BlockId,
    },
    /// `map(f, xs)`: a container of results.
    Map {
        /// The function.
        f: Operand,
        /// The array or record that it iterates over.
        over: Operand,
        /// Its site; the element's key goes to its last segment but one, or to its only
        /// one.
        site: u32,
    },
    /// `fold(f, init, xs)`
    Fold {
        /// The function of running value and element.
        f: Operand,
        /// The first running value.
        init: Operand,
        /// The array or record that it iterates over.
        over: Operand,
        /// Its site, by index into [`Code::sites`].
        site: u32,
    },
    /// A keyed container of random choices.
    Container {
        /// Its name.
        name: Arc<str>,
        /// The draws of its elements.
        sources: Box<[Source]>,
    },
    /// The array or record of all elements of the container in the preceding slot.
    Gather,
    /// `mem(f)`
    Mem {
        /// The function.
        f: Operand,
        /// Its site, by index into [`Code::sites`].
        site: u32,
    },
    /// A random choice.
    Draw {
        /// Its distribution.
        dist: DistSpec,
        /// Its site, by index into [`Code::sites`].
        site: u32,
        /// The keys of `t[k] ~ d`.
        keys: Box<[Operand]>,
    },
    /// An observation.
    Observe {
        /// The distribution or likelihood.
        dist: DistSpec,
        /// The observed value.
        value: Operand,
        /// The surrogate for delayed acceptance: a slot of this block that nothing else
        /// depends on.
        coarse: Option<Operand>,
        /// Its site, by index into [`Code::sites`].
        site: u32,
    },
    /// A soft constraint.
    Factor {
        /// The log weight.
        weight: Operand,
        /// Its site, by index into [`Code::sites`].
        site: u32,
    },
    /// A property of the whole trace; never cached.
    Probe(Probe),
}

impl Op {
    /// Calls `f` with each operand that the operation always reads when it is evaluated;
    /// branches, bodies and callees read more.
    pub fn operands(&self, mut f: impl FnMut(Operand)) {
        match self {
            Op::Param { default, .. } => default.iter().copied().for_each(f),
            Op::Prim { args, .. } => args.iter().copied().for_each(f),
            Op::Array(xs) => xs.iter().copied().for_each(f),
            Op::Record { values, .. } => values.iter().copied().for_each(f),
            Op::Index { base, keys } => {
                f(*base);
                keys.iter().copied().for_each(f);
            }
            Op::Call { callee, args, .. } => {
                if let Callee::Value(v) = callee {
                    f(*v);
                }
                args.iter().for_each(|(_, a)| f(*a));
            }
            Op::If { cond, .. } | Op::Select { cond, .. } => f(*cond),
            Op::For { iter, .. } => f(*iter),
            Op::Map { f: g, over, .. } => {
                f(*g);
                f(*over);
            }
            Op::Fold { f: g, init, over, .. } => {
                f(*g);
                f(*init);
                f(*over);
            }
            Op::Mem { f: g, .. } => f(*g),
            Op::Draw { dist, keys, .. } => {
                dist.operands().iter().copied().for_each(&mut f);
                keys.iter().copied().for_each(f);
            }
            Op::Observe { dist, value, .. } => {
                dist.operands().iter().copied().for_each(&mut f);
                f(*value);
            }
            Op::Factor { weight, .. } => f(*weight),
            Op::Container { .. }
            | Op::Gather
            | Op::Item
            | Op::Accumulator
            | Op::Closure(_)
            | Op::Probe(_) => {}
        }
    }
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
            first: 0,
            effects: Vec::new(),
        }
    }

    /// Returns the number of slots.
    pub fn len(&self) -> usize {
        self.spans.len()
    }

    /// Whether it has no slots.
    pub fn is_empty(&self) -> bool {
        self.spans.is_empty()
    }

    /// Appends an operation and returns its slot.
    pub fn push(&mut self, op: Op, span: Span) -> Slot {
        self.ops.push(op);
        self.spans.push(span);
        self.ops.len() as Slot - 1
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
