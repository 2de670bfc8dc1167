//! Discrete distributions.

pub(in crate::dist) mod binomial;
pub(in crate::dist) mod categorical;
pub(in crate::dist) mod flip;
pub(in crate::dist) mod geometric;
pub(in crate::dist) mod multinomial;
pub(in crate::dist) mod neg_binomial;
pub(in crate::dist) mod poisson;
pub(in crate::dist) mod uniform_discrete;
