//! Which values of the top level are settled: computed without random choices, so that they are
//! the same in every trace.

use super::op::{Callee, Op, Operand};
use super::program::{Block, Code};
use crate::lang::ids::{BlockId, Slot};
use crate::lang::value::Value;
use rustc_hash::FxHashSet;

/// What is known of slots of the top level and of blocks.
#[derive(Default)]
pub struct Settled {
    known: FxHashSet<Part>,
    varying: FxHashSet<Slot>,
}

/// A part of a program whose evaluation may read a choice.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Part {
    /// A slot of the top level.
    Slot(Slot),
    /// A block, with those inside of it.
    Block(BlockId),
}

impl Settled {
    /// True if the value of a slot of the top level is settled.
    pub fn slot(&mut self, code: &Code, slot: Slot) -> bool {
        let settled = self.all(code, Part::Slot(slot));
        if !settled {
            self.varying.insert(slot);
        }
        settled
    }

    /// True if a function makes no choices, and what it reads besides its arguments is settled.
    pub fn function(&mut self, code: &Code, block: BlockId) -> bool {
        self.all(code, Part::Block(block))
    }

    /// Follows everything that the evaluation of a part may read or call. A function value comes
    /// from an operation or a constant that is met on the way.
    fn all(&mut self, code: &Code, start: Part) -> bool {
        let mut open = vec![start];
        let mut met = FxHashSet::default();
        while let Some(part) = open.pop() {
            if self.known.contains(&part) || !met.insert(part) {
                continue;
            }
            let settled = match part {
                Part::Slot(slot) if self.varying.contains(&slot) => false,
                Part::Slot(slot) => {
                    let op = &code.blocks[BlockId::ROOT].ops[slot];
                    if matches!(op, Op::Gather) {
                        open.push(Part::Slot(Slot::new(slot.index() - 1)));
                    }
                    follow(code, BlockId::ROOT, op, &mut open)
                }
                Part::Block(block) => {
                    let Block { ops, result, .. } = &code.blocks[block];
                    result.iter().for_each(|o| operand(code, block, *o, &mut open));
                    ops.iter().all(|op| follow(code, block, op, &mut open))
                }
            };
            if !settled {
                return false;
            }
        }
        self.known.extend(met);
        true
    }
}

/// Adds the parts that an operation reads or calls; false if it depends on the trace.
fn follow(code: &Code, block: BlockId, op: &Op, open: &mut Vec<Part>) -> bool {
    op.operands(|o| operand(code, block, o, open));
    let mut inside = |b: &BlockId| open.push(Part::Block(*b));
    match op {
        Op::Closure(b) | Op::For { body: b, .. } | Op::Call { callee: Callee::Static(b), .. } => {
            inside(b)
        }
        Op::If { then, otherwise, .. } => [then, otherwise].into_iter().for_each(inside),
        Op::Select { then, otherwise, .. } => {
            [then, otherwise].into_iter().for_each(|o| operand(code, block, *o, open));
        }
        Op::Mem { .. }
        | Op::Container { .. }
        | Op::Draw { .. }
        | Op::Observe { .. }
        | Op::Factor { .. }
        | Op::Probe(_) => return false,
        Op::Param { .. }
        | Op::Item
        | Op::Accumulator
        | Op::Prim { .. }
        | Op::Array(_)
        | Op::Record { .. }
        | Op::Index { .. }
        | Op::Gather
        | Op::Call { callee: Callee::Value(_), .. }
        | Op::Map { .. }
        | Op::Fold { .. } => {}
    }
    true
}

/// Adds what an operand of a block refers to.
fn operand(code: &Code, block: BlockId, o: Operand, open: &mut Vec<Part>) {
    let (at, slot) = match o {
        Operand::Const(i) => {
            if let Value::Closure(c) = code.const_value(i) {
                open.push(Part::Block(c.block));
            }
            return;
        }
        Operand::Local(slot) => (block, slot),
        Operand::Outer { up, slot } => {
            let out = |b: BlockId, _| code.blocks[b].parent.unwrap_or(BlockId::ROOT);
            ((0..up).fold(block, out), slot)
        }
    };
    match at {
        BlockId::ROOT => open.push(Part::Slot(slot)),
        // The operations of this block are followed anyway.
        _ if at == block => {}
        _ => open.push(Part::Block(at)),
    }
}
