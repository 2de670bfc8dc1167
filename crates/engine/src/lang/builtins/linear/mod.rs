//! Matrices.

pub(in crate::lang::builtins) mod definite;
pub(in crate::lang::builtins) mod matrix;
