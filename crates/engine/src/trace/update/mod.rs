//! An update of a trace: changes are queued and invalidate what they may reach
//! (`invalidate`), what is needed is evaluated anew (`propagate`), the choices that
//! appear and vanish are registered (`register`), and the update is weighed (`weight`) and
//! committed or undone (`commit`).

mod commit;
mod invalidate;
mod limits;
mod propagate;
mod register;
mod weight;

pub(super) use propagate::{Failure, Poll};
pub(super) use register::push_key;
