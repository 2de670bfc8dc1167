//! From the calls of a plan to kernels, selectors and values.

pub(crate) mod build;
pub(crate) mod call;
pub(crate) mod error;
pub(crate) mod explained;
pub(crate) mod formula;
pub(crate) mod host_kernel;
pub(crate) mod selection;
