//! Callbacks that gather what a run says beside its draws.

pub(crate) mod best;
pub(crate) mod evidence;
pub(crate) mod kept;
pub(crate) mod trajectory;
