//! Callbacks that gather what a run says beside its draws.

pub(in crate::infer) mod best;
pub(in crate::infer) mod evidence;
pub(in crate::infer) mod kept;
pub(in crate::infer) mod trajectory;
