//! local
pub mod address;
pub mod builtins;
pub mod code;
pub mod error;
pub mod index;
pub mod key;
pub mod value;
