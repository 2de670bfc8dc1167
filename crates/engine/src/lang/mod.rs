//! The language without its syntax: values, addresses, built-ins, and the lowering of
//! syntax trees to code.
//!
//! A program is processed in this order: [`load`] finds its files, [`lower`] checks names
//! and types and produces [`code`], and the trace runs that.

pub mod address;
pub mod adjoint;
pub mod builtins;
pub mod code;
pub(crate) mod density;
pub mod error;
mod fault;
pub mod ids;
pub mod index;
pub mod key;
pub mod load;
pub mod local_density;
pub mod lower;
pub mod missing;
pub mod plan;
pub mod reach;
pub mod tape;
pub mod value;
