//! Short ways of updates: the same bits as the general one, with less work.

pub(in crate::trace) mod local_density;
pub(in crate::trace) mod register;
pub(in crate::trace) mod scaffold;
pub(in crate::trace) mod set_in_place;
