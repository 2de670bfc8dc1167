//! Static facts about the slots of lowered code that updates need: which slots read a
//! slot, what it reads, whether it is an effect, and the static scaffold and local
//! density of a choice.

use crate::lang::ids::Slot;
use crate::lang::local_density::LocalDensity;

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
    /// For a choice that only computations of its own block depend on: its static
    /// scaffold.
    pub scaffold: Option<StaticScaffold>,
    /// For a choice or an element of an array: the scores of its block as a function of
    /// its value.
    pub local_density: Option<Box<LocalDensity>>,
}

/// The part of a choice's scaffold that lies in its own block, if that is the same in
/// every state.
#[derive(Clone, Debug)]
pub struct StaticScaffold {
    /// The slots that depend on the choice, each after those it reads, up to and
    /// including observations and other choices.
    pub slots: Box<[Slot]>,
    /// True if none of them reads from another block.
    pub is_closed: bool,
    /// A bit mask of the slots that may not be needed any more when conditions have
    /// changed, so they must not run before the conditions.
    pub conditional: u64,
    /// True if the condition of a selection depends on the choice.
    pub switches: bool,
}
