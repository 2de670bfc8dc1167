//! From the text of a plan: kernels, selections, expressions.

pub(in crate::infer) mod build;
pub(in crate::infer) mod explained;
pub(in crate::infer) mod expr;
pub(in crate::infer) mod host_kernel;
pub(in crate::infer) mod selection;
