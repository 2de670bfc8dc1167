//! Programs in which the coarse surrogates of observations (`with coarse = …`) stand in
//! their place: what delayed acceptance moves in first.

use super::code::{Code, DistSpec, Op, Operand};
use super::slots::SlotFacts;

impl Code {
    /// The same program with the surrogates of these observations, given as indices of
    /// operations, in their place.
    #[must_use]
    pub fn with_surrogates(&self, observations: &[u32]) -> Code {
        let mut code = self.clone();
        for i in observations.iter().map(|i| *i as usize) {
            let Some(Op::Observe { dist, coarse, .. }) = code.ops.get_mut(i) else { continue };
            let Some(surrogate) = coarse.take() else { continue };
            *dist = DistSpec::Value(surrogate);
            let slot = code.slots[i].slot;
            code.slots[i].reads = code.ops[i].reads();
            if let Operand::Local(read) = surrogate {
                let users = &mut code.slots[i - slot as usize + read as usize].users;
                if !users.contains(&slot) {
                    *users = users.iter().copied().chain([slot]).collect();
                }
            }
        }
        // How changes spread was found for the program as it was.
        for facts in &mut code.slots {
            let SlotFacts { slot, is_effect, is_draw, is_result, reads, users, .. } =
                std::mem::take(facts);
            *facts = SlotFacts {
                slot,
                is_effect,
                is_draw,
                is_result,
                reads,
                users,
                ..SlotFacts::default()
            };
        }
        code
    }
}
