//! The slots that depend on a choice within its block, found once for all frames.
//!
//! Most choices are read by a few computations and observations of the same block. If no
//! operation on the way creates structure (calls, branches with frames, loops), the slots
//! that depend on the choice are the same in every state.

use super::op::{DistSpec, Op};
use super::slots::SlotFacts;
use crate::lang::ids::Slot;

/// The maximum number of these slots.
const MOST: usize = 64;

/// Returns the slots of a block that depend on a slot, each after those it reads, up to
/// and including observations and other choices, if that is the same in every state.
pub(super) fn dependents(ops: &[Op], slots: &[SlotFacts], from: Slot) -> Option<Vec<Slot>> {
    let (mut reached, mut order) = (vec![false; slots.len()], Vec::new());
    visit(ops, slots, from, &mut reached, &mut order)?;
    order.pop();
    order.reverse();
    Some(order)
}

/// Depth first: users come before what they read, so that the reverse is an order of
/// evaluation.
fn visit(
    ops: &[Op],
    slots: &[SlotFacts],
    slot: Slot,
    reached: &mut [bool],
    order: &mut Vec<Slot>,
) -> Option<()> {
    reached[slot] = true;
    if slots[slot].is_result {
        return None;
    }
    for user in &slots[slot].users {
        if reached[*user] {
            continue;
        }
        match &ops[*user] {
            Op::Prim { .. }
            | Op::Array(_)
            | Op::Record { .. }
            | Op::Index { .. }
            | Op::Select { .. } => {
                visit(ops, slots, *user, reached, order)?;
            }
            Op::Observe { coarse: None, .. } | Op::Factor { .. } => {
                reached[*user] = true;
                order.push(*user);
            }
            // A choice keeps its value when its parameters change, unless its form
            // requires otherwise; that is checked at run time.
            Op::Draw { dist: DistSpec::Family { .. }, .. } => {
                reached[*user] = true;
                order.push(*user);
            }
            _ => return None,
        }
        if order.len() > MOST {
            return None;
        }
    }
    order.push(slot);
    Some(())
}
