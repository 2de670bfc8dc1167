//! Static facts about the slots of lowered code that updates need: which slots read a
//! slot, what it reads, whether it is an effect, and the local density of a choice.

use crate::lang::ids::Slot;
use crate::lang::local_density::LocalDensity;
use crate::lang::value::Value;
use std::sync::{Arc, OnceLock};

/// Static facts about a slot.
#[derive(Clone, Debug, Default)]
pub struct SlotFacts {
    /// The slot.
    pub slot: Slot,
    /// True if it runs even if nothing depends on it.
    pub is_effect: bool,
    /// True if it is a random choice.
    pub is_draw: bool,
    /// True if it is the result of its block.
    pub is_result: bool,
    /// The slots it reads whenever it is evaluated: the number of levels out, and the
    /// slot there; `None` if they depend on the state.
    pub reads: Option<Box<[(u16, Slot)]>>,
    /// The slots of the same block that have it as an operand.
    pub users: Box<[Slot]>,
    /// For a choice or an element of an array: the scores of its block as a function of
    /// its value.
    pub local_density: Option<Box<LocalDensity>>,
    /// For a settled value of the top level: the value, once a trace has computed it.
    pub settled: Option<Arc<OnceLock<Value>>>,
}
