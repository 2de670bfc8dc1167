//! The operations of lowered code, and where they find their inputs.

use crate::lang::ids::{BlockId, SiteId, Slot};
use std::sync::Arc;

/// Where an operation finds an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operand {
    /// A constant, by index into [`Code::consts`](super::Code::consts).
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
pub struct ElementDraw {
    /// The `for` operations that lead to the draw, outermost first: a slot of the
    /// container's block, then of each body.
    pub loops: Box<[Slot]>,
    /// The draw, in the innermost body (or the container's own block).
    pub draw: Slot,
    /// Its keys.
    pub keys: Box<[ElementKey]>,
}

/// A key of a drawn element.
#[derive(Clone, Copy, Debug)]
pub enum ElementKey {
    /// The variable of the enclosing loop, by index into [`ElementDraw::loops`].
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
        /// Its site, by index into [`Code::sites`](super::Code::sites).
        site: SiteId,
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
        site: SiteId,
    },
    /// `fold(f, init, xs)`
    Fold {
        /// The function of running value and element.
        f: Operand,
        /// The first running value.
        init: Operand,
        /// The array or record that it iterates over.
        over: Operand,
        /// Its site, by index into [`Code::sites`](super::Code::sites).
        site: SiteId,
    },
    /// A keyed container of random choices.
    Container {
        /// Its name.
        name: Arc<str>,
        /// The draws of its elements.
        sources: Box<[ElementDraw]>,
    },
    /// The array or record of all elements of the container in the preceding slot.
    Gather,
    /// `mem(f)`
    Mem {
        /// The function.
        f: Operand,
        /// Its site, by index into [`Code::sites`](super::Code::sites).
        site: SiteId,
    },
    /// A random choice.
    Draw {
        /// Its distribution.
        dist: DistSpec,
        /// Its site, by index into [`Code::sites`](super::Code::sites).
        site: SiteId,
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
        /// Its site, by index into [`Code::sites`](super::Code::sites).
        site: SiteId,
    },
    /// A soft constraint.
    Factor {
        /// The log weight.
        weight: Operand,
        /// Its site, by index into [`Code::sites`](super::Code::sites).
        site: SiteId,
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

    /// Returns the locations of its operands, if it holds exactly those that it always
    /// reads.
    pub(super) fn reads(&self) -> Option<Box<[(u16, Slot)]>> {
        if matches!(
            self,
            Op::Param { .. } | Op::Call { .. } | Op::Select { .. } | Op::Fold { .. } | Op::Gather
        ) {
            return None;
        }
        let mut reads = Vec::new();
        self.operands(|o| match o {
            Operand::Const(_) => {}
            Operand::Local(slot) => reads.push((0, slot)),
            Operand::Outer { up, slot } => reads.push((up, slot)),
        });
        Some(reads.into())
    }
}
