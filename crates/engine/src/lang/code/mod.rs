//! Lowered code: blocks of operations in slots, with every name resolved.
//!
//! A block is a straight line of operations; slot `i` holds the result of operation `i`,
//! and an operand is a constant, a slot of the same block, or a slot of an enclosing one.
//! Bodies that may run any number of times (functions, branches, loop passes) are
//! separate blocks. The trace instantiates a block as a frame of nodes, one node per
//! slot, and evaluates a slot on demand.

mod dependents;
mod finish;
mod flatten;
mod op;
mod program;
mod settled;
mod slots;
mod surrogate;

pub use super::ids::{BlockId, OpId, SiteId, Slot};
pub use op::{Callee, DistSpec, ElementDraw, ElementKey, Op, Operand, Probe};
pub use program::{Block, BlockKind, Code, Eager, Force, Observed, Site, SiteSegment, SiteTag};
pub use settled::Settled;
pub use slots::SlotFacts;
