//! Weights of values without updates: the same bits, with less work.

pub(in crate::trace) mod local_density;
pub(in crate::trace) mod register;
