//! What follows from the operations of lowered code and updates need at hand: who reads a
//! slot, what it reads, whether it runs although nothing asks for it, how the change of a
//! choice spreads.

use super::code::{Block, Callee, Code, Eager, Op, Operand, Slot};
use super::local_density::LocalDensity;
use super::value::Value;

/// What updates need to know of a slot.
#[derive(Clone, Debug, Default)]
pub struct SlotFacts {
    /// The slot.
    pub slot: Slot,
    /// Whether it runs although nothing asks for it.
    pub is_effect: bool,
    /// Whether it is a random choice.
    pub is_draw: bool,
    /// Whether it is the result of its block.
    pub is_result: bool,
    /// The slots it reads whenever it is evaluated: how many levels out, and which;
    /// `None` where that depends on the state.
    pub reads: Option<Box<[(u16, Slot)]>>,
    /// The slots of the same block that have it as an operand.
    pub users: Box<[Slot]>,
    /// For a choice that only computations of its own block depend on: how its change
    /// spreads.
    pub scaffold: Option<StaticScaffold>,
    /// For a choice or an element of an array: what another number there does to the
    /// scores of its block.
    pub local_density: Option<Box<LocalDensity>>,
}

/// The part of a choice's scaffold that lies in its own block, where that is the same in
/// every state.
#[derive(Clone, Debug)]
pub struct StaticScaffold {
    /// What depends on the choice, each after what it reads, up to and including
    /// observations and other choices.
    pub slots: Box<[Slot]>,
    /// Whether none of them reads anything of another block.
    pub is_closed: bool,
    /// A bit for each of the slots: it may be asked for by nothing once conditions have
    /// changed, so it must not run before they have.
    pub conditional: u64,
    /// Whether conditions of selections are among them.
    pub turns: bool,
}

impl Code {
    /// Fills in what follows from the operations: in-block users and effects.
    pub fn finish(&mut self) {
        super::flatten::flatten(self);
        let effects = self.effects();
        for (block, is_effect) in self.blocks.iter_mut().zip(effects) {
            block.effects =
                (0..block.ops.len() as Slot).filter(|s| is_effect[*s as usize]).collect();
            block.first = self.ops.len() as u32;
            let mut users = vec![Vec::new(); block.ops.len()];
            for (slot, op) in block.ops.iter().enumerate() {
                let mut uses = |o| {
                    if let Operand::Local(s) = o
                        && users[s as usize].last() != Some(&(slot as Slot))
                    {
                        users[s as usize].push(slot as Slot);
                    }
                };
                op.operands(&mut uses);
                if let Op::Select { then, otherwise, .. } = op {
                    uses(*then);
                    uses(*otherwise);
                }
                if matches!(op, Op::Gather) {
                    users[slot - 1].push(slot as Slot);
                }
            }
            for (slot, (op, users)) in block.ops.drain(..).zip(users).enumerate() {
                self.slots.push(SlotFacts {
                    slot: slot as Slot,
                    is_effect: is_effect[slot],
                    is_draw: matches!(op, Op::Draw { .. }),
                    is_result: block.result == Some(Operand::Local(slot as Slot)),
                    reads: op.reads(),
                    users: users.into(),
                    scaffold: None,
                    local_density: None,
                });
                self.ops.push(op);
            }
            let (ops, slots) =
                (&self.ops[block.first as usize..], &self.slots[block.first as usize..]);
            let asked = super::scaffold::always_asked(ops, slots);
            let found: Vec<_> = (0..slots.len() as Slot)
                .filter(|s| matches!(ops[*s as usize], Op::Draw { .. } | Op::Index { .. }))
                .map(|s| {
                    let scaffold = if slots[s as usize].is_draw {
                        super::scaffold::scaffold(ops, slots, &asked, s)
                    } else {
                        None
                    };
                    (s, scaffold, LocalDensity::new(ops, slots, s, &self.builtins).map(Box::new))
                })
                .collect();
            for (slot, scaffold, local_density) in found {
                let facts = &mut self.slots[block.first as usize + slot as usize];
                (facts.scaffold, facts.local_density) = (scaffold, local_density);
            }
        }
    }

    /// Marks the slots that run although nothing asks for them.
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
            // Of a container all elements: they are gathered in the slot after it.
            let is_container = matches!(self.blocks[0].ops[slot as usize], Op::Container { .. });
            effects[0][slot as usize + usize::from(is_container)] = true;
        }
        effects
    }

    /// Marks the slots that observe, or hold or call a block that does. Calls of function
    /// values count if any function that is used as a value observes.
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
                Op::Closure(block) => observes[*block as usize],
                _ => false,
            }) || self.consts.iter().any(|c| match c {
                Value::Closure(c) => observes[c.block as usize],
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

impl Op {
    /// Where its operands are, if those it always reads are all it holds.
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

fn op_observes(op: &Op, observes: &[bool], escaped: bool) -> bool {
    match op {
        Op::Observe { .. } | Op::Factor { .. } => true,
        Op::If { then, otherwise, .. } => observes[*then as usize] || observes[*otherwise as usize],
        Op::For { body, .. } => observes[*body as usize],
        Op::Call { callee: Callee::Static(b), .. } => observes[*b as usize],
        Op::Call { callee: Callee::Value(_), .. } | Op::Map { .. } | Op::Fold { .. } => escaped,
        _ => false,
    }
}
