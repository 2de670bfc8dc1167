//! The static scaffold of a choice within its block, found once for all frames.
//!
//! Most choices are read by a few computations and observations of the same block. If no
//! operation on the way creates structure (calls, branches with frames, loops), the slots
//! that depend on the choice are the same in every state, and an update can go through
//! them in order instead of invalidating and re-evaluating on demand.

use super::op::{DistSpec, Op, Operand};
use super::slots::{SlotFacts, StaticScaffold};
use crate::lang::ids::Slot;
use smallvec::SmallVec;

/// The maximum length of the list; one bit per slot in [`StaticScaffold::conditional`].
const LONGEST: usize = u64::BITS as usize;

/// Returns the static scaffold of the choice in slot `from` of a block, if it is the same
/// in every state, given the slots that depend on it in `order`. `asked` tells which
/// slots are always needed.
pub(super) fn scaffold(
    ops: &[Op],
    order: &[Slot],
    asked: &[bool],
    from: Slot,
) -> Option<StaticScaffold> {
    // The address of a keyed choice may change.
    if order.iter().any(|s| matches!(&ops[*s], Op::Draw { keys, .. } if !keys.is_empty())) {
        return None;
    }
    let is_closed = reads_inside(ops, from, order);
    let bits = order.iter().enumerate().filter(|(_, s)| !asked[**s]);
    let conditional = bits.fold(0, |all, (i, _)| all | 1 << i);
    let decides = |o: &Operand| matches!(o, Operand::Local(s) if *s == from || order.contains(s));
    let switches =
        order.iter().any(|s| matches!(&ops[*s], Op::Select { cond, .. } if decides(cond)));
    Some(StaticScaffold { slots: order.into(), is_closed, conditional, switches })
}

/// Returns which slots the effects of their block need whatever the values of conditions.
pub(super) fn always_asked(ops: &[Op], slots: &[SlotFacts]) -> Vec<bool> {
    let mut asked: Vec<bool> = slots.iter().map(|s| s.is_effect).collect();
    let mut open: Vec<Slot> = (0..slots.len()).map(Slot::new).filter(|s| asked[*s]).collect();
    while let Some(slot) = open.pop() {
        let mut ask = |s: Slot| {
            if !std::mem::replace(&mut asked[s], true) {
                open.push(s);
            }
        };
        match (&ops[slot], &slots[slot].reads) {
            (Op::Select { cond: Operand::Local(s), .. }, _) => ask(*s),
            (_, Some(reads)) => reads.iter().filter(|(up, _)| *up == 0).for_each(|(_, s)| ask(*s)),
            _ => {}
        }
    }
    asked
}

/// Whether everything that these dependents of a slot read is up to date when they run:
/// it is in their list, or computed in this block without other frames. Values that come
/// from frames may have changed because the frames read what changes here.
fn reads_inside(ops: &[Op], from: Slot, order: &[Slot]) -> bool {
    let mut seen = vec![false; ops.len()];
    order.iter().chain([&from]).for_each(|s| seen[*s] = true);
    let mut open = order.to_vec();
    while let Some(slot) = open.pop() {
        let op = &ops[slot];
        let mut read: SmallVec<[Operand; 8]> = SmallVec::new();
        op.operands(|o| read.push(o));
        if let Op::Select { then, otherwise, .. } = op {
            read.extend([*then, *otherwise]);
        }
        for o in read {
            let s = match o {
                Operand::Const(_) => continue,
                Operand::Outer { .. } => return false,
                Operand::Local(s) => s,
            };
            if std::mem::replace(&mut seen[s], true) {
                continue;
            }
            match &ops[s] {
                Op::Param { .. } | Op::Item | Op::Accumulator | Op::Closure(_) => {}
                Op::Prim { .. } | Op::Array(_) | Op::Record { .. } | Op::Index { .. } => {
                    open.push(s)
                }
                Op::Select { .. } | Op::Draw { .. } => open.push(s),
                _ => return false,
            }
        }
    }
    true
}

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
        if order.len() > LONGEST {
            return None;
        }
    }
    order.push(slot);
    Some(())
}
