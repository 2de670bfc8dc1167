//! Programs in which the coarse surrogates of observations (`with coarse = …`) replace
//! them: the first stage of delayed acceptance.

use super::op::{DistSpec, Op, Operand};
use super::program::Code;
use super::slots::SlotFacts;
use crate::lang::ids::OpId;

impl Code {
    /// Returns the program with these observations, given as indices of operations,
    /// replaced by their surrogates.
    #[must_use]
    pub fn with_surrogates(&self, observations: &[OpId]) -> Code {
        let mut code = self.clone();
        for i in observations.iter().copied() {
            let Some(Op::Observe { dist, coarse, .. }) = code.ops.get_mut(i.index()) else {
                continue;
            };
            let Some(surrogate) = coarse.take() else { continue };
            *dist = DistSpec::Value(surrogate);
            let slot = code.slots[i].slot;
            code.slots[i].reads = code.ops[i].reads();
            if let Operand::Local(read) = surrogate {
                let users = &mut code.slots[i - slot + read].users;
                if !users.contains(&slot) {
                    *users = users.iter().copied().chain([slot]).collect();
                }
            }
        }
        // Scaffolds and local densities were found for the original program, so they are
        // dropped.
        for facts in &mut code.slots {
            let SlotFacts { slot, is_effect, is_draw, is_result, reads, users, settled, .. } =
                std::mem::take(facts);
            *facts = SlotFacts {
                slot,
                is_effect,
                is_draw,
                is_result,
                reads,
                users,
                settled,
                ..SlotFacts::default()
            };
        }
        code
    }
}
