//! The facts about slots, derived from the operations of a whole program.

use super::op::{Callee, Op, Operand};
use super::program::{Block, Code, Eager};
use super::settled::Settled;
use super::slots::SlotFacts;
use super::{dependents::dependents, flatten};
use crate::lang::ids::{BlockId, OpId};
use crate::lang::local_density::LocalDensity;
use crate::lang::value::Value;
use std::sync::Arc;

impl Code {
    /// Derives the facts about all slots from the operations, among them users and
    /// effects.
    pub fn finish(&mut self) {
        flatten::flatten(self);
        let effects = self.effects();
        let mut settled = Settled::default();
        let root = self.blocks[BlockId::ROOT].slots();
        let settled: Vec<bool> = root.map(|slot| settled.slot(self, slot)).collect();
        for ((id, block), is_effect) in self.blocks.iter_mut().enumerate().zip(effects) {
            block.effects = block.slots().filter(|s| is_effect[*s]).collect();
            block.first = OpId::new(self.ops.len());
            let mut users = vec![Vec::new(); block.ops.len()];
            for (slot, op) in block.slots().zip(&block.ops) {
                let mut uses = |o| {
                    if let Operand::Local(s) = o
                        && users[s].last() != Some(&slot)
                    {
                        users[s].push(slot);
                    }
                };
                op.operands(&mut uses);
                if let Op::Select { then, otherwise, .. } = op {
                    uses(*then);
                    uses(*otherwise);
                }
                if matches!(op, Op::Gather) {
                    users[slot.index() - 1].push(slot);
                }
            }
            for (slot, (op, users)) in block.slots().zip(block.ops.drain(..).zip(users)) {
                self.slots.push(SlotFacts {
                    slot,
                    is_effect: is_effect[slot],
                    is_draw: matches!(op, Op::Draw { .. }),
                    is_result: block.result == Some(Operand::Local(slot)),
                    reads: op.reads(),
                    users: users.into(),
                    local_density: None,
                    settled: (id == 0 && settled[slot.index()]).then(Arc::default),
                });
                self.ops.push(op);
            }
            let (ops, slots) =
                (&self.ops[block.first.index()..], &self.slots[block.first.index()..]);
            let found: Vec<_> = block
                .slots()
                .filter(|s| matches!(ops[*s], Op::Draw { .. } | Op::Index { .. }))
                .filter_map(|s| {
                    let dependents = dependents(ops, slots, s)?;
                    Some((s, LocalDensity::new(ops, dependents, s, &self.builtins).map(Box::new)))
                })
                .collect();
            for (slot, local_density) in found {
                self.slots[block.first + slot].local_density = local_density;
            }
        }
    }

    /// Returns, by block, which slots run even if nothing depends on them.
    fn effects(&self) -> Vec<Vec<bool>> {
        let mut effects = match self.eager {
            Eager::NamesOnly => self.blocks.iter().map(|b| vec![false; b.ops.len()]).collect(),
            _ => self.find_effects(),
        };
        if self.eager == Eager::Observations {
            return effects;
        }
        let predicted = |o: &Operand| self.predictions.iter().any(|(_, p)| p == o);
        for o in self.globals.values().filter(|o| !predicted(o)) {
            let Operand::Local(slot) = *o else { continue };
            // For a container, all elements: they are gathered in the slot that follows
            // it.
            let is_container = matches!(self.blocks[0].ops[slot], Op::Container { .. });
            effects[0][slot.index() + usize::from(is_container)] = true;
        }
        effects
    }

    /// Finds the slots that observe, or that contain or call a block that does. Calls of
    /// function values count if any function that is used as a value observes.
    fn find_effects(&self) -> Vec<Vec<bool>> {
        let n = self.blocks.len();
        let mut observes = vec![false; n];
        let mut escaped_observes = false;
        loop {
            let mut changed = false;
            for b in 0..n {
                let has = self.blocks[b]
                    .ops
                    .iter()
                    .any(|op| op_observes(op, &observes, escaped_observes));
                if has && !observes[b] {
                    observes[b] = true;
                    changed = true;
                }
            }
            let escaped = self.blocks.iter().flat_map(|b| &b.ops).any(|op| match op {
                Op::Closure(block) => observes[*block],
                _ => false,
            }) || self.consts.iter().any(|c| match c {
                Value::Closure(c) => observes[c.block],
                _ => false,
            });
            if escaped && !escaped_observes {
                escaped_observes = true;
                changed = true;
            }
            if !changed {
                break;
            }
        }
        let of = |b: &Block| {
            b.ops.iter().map(|op| op_observes(op, &observes, escaped_observes)).collect()
        };
        self.blocks.iter().map(of).collect()
    }
}

fn op_observes(op: &Op, observes: &[bool], escaped: bool) -> bool {
    match op {
        Op::Observe { .. } | Op::Factor { .. } => true,
        Op::If { then, otherwise, .. } => observes[*then] || observes[*otherwise],
        Op::For { body, .. } => observes[*body],
        Op::Call { callee: Callee::Static(b), .. } => observes[*b],
        Op::Call { callee: Callee::Value(_), .. } | Op::Map { .. } | Op::Fold { .. } => escaped,
        _ => false,
    }
}
