//! Branches without structure become slots of the block around them.
//!
//! An `if` creates a frame for the branch it takes. If both branches only compute (no
//! choices, observations, calls, loops), no frame is needed: their operations are
//! appended to the block, and the `if` becomes an [`Op::Select`] that reads one of the
//! two results. Evaluation is on demand, so the other branch is still not run, and
//! choices that only it reads are not drawn.

use super::op::{Op, Operand};
use super::program::{Block, BlockKind, Code};
use crate::lang::ids::{BlockId, Slot};
use crate::lang::value::Value;

/// Flattens every block, inner ones first.
pub(super) fn flatten(code: &mut Code) {
    let nothing = code.constant(Value::Unit);
    for b in (0..code.blocks.len()).rev() {
        for slot in 0..code.blocks[b].ops.len() {
            let Op::If { cond, then, otherwise } = code.blocks[b].ops[slot] else { continue };
            if !only_computes(&code.blocks[then]) || !only_computes(&code.blocks[otherwise]) {
                continue;
            }
            let then = splice(code, b, then, nothing);
            let otherwise = splice(code, b, otherwise, nothing);
            code.blocks[b].ops[slot] = Op::Select { cond, then, otherwise };
        }
    }
}

fn only_computes(block: &Block) -> bool {
    block.kind == BlockKind::Branch
        && block.ops.iter().all(|op| {
            matches!(
                op,
                Op::Prim { .. }
                    | Op::Array(_)
                    | Op::Record { .. }
                    | Op::Index { .. }
                    | Op::Select { .. }
            )
        })
}

/// Moves the operations of a branch to the end of the block around it, and returns its
/// result as an operand of that block.
fn splice(code: &mut Code, into: usize, branch: BlockId, nothing: Operand) -> Operand {
    let (ops, spans) = (
        std::mem::take(&mut code.blocks[branch].ops),
        std::mem::take(&mut code.blocks[branch].spans),
    );
    let first = code.blocks[into].ops.len() as u32;
    let outwards = |o: &mut Operand| {
        *o = match *o {
            Operand::Const(i) => Operand::Const(i),
            Operand::Local(s) => Operand::Local(Slot(first + s.0)),
            Operand::Outer { up: 1, slot } => Operand::Local(slot),
            Operand::Outer { up, slot } => Operand::Outer { up: up - 1, slot },
        };
    };
    for (mut op, span) in ops.into_iter().zip(spans) {
        match &mut op {
            Op::Prim { args, .. } | Op::Array(args) => args.iter_mut().for_each(outwards),
            Op::Record { values, .. } => values.iter_mut().for_each(outwards),
            Op::Index { base, keys } => {
                outwards(base);
                keys.iter_mut().for_each(outwards);
            }
            Op::Select { cond, then, otherwise } => {
                [cond, then, otherwise].into_iter().for_each(outwards)
            }
            _ => {}
        }
        code.blocks[into].push(op, span);
    }
    let mut result = code.blocks[branch].result.take().unwrap_or(nothing);
    outwards(&mut result);
    result
}
