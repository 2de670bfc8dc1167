//! From the calls of a plan to kernels, selectors and values.

pub(in crate::infer) mod build;
pub(in crate::infer) mod error;
pub(in crate::infer) mod explained;
pub(in crate::infer) mod formula;
pub(in crate::infer) mod host_kernel;
pub(in crate::infer) mod selection;
