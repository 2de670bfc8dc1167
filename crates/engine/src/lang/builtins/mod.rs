//! The table of built-ins: every function, distribution, form and name of plans with its
//! arguments, units and doc line. Kernels are added above.
//!
//! Evaluation, static checks, `pcadlang doc` and the language reference all read this
//! table. The functions are pure: equal arguments give bit-identical results on every
//! platform.

mod args;
mod builtin;
mod call;
mod covariance;
pub mod data;
mod derivative;
mod distributions;
mod elementwise;
pub mod examples;
mod finding;
mod forms;
mod interp;
mod language;
mod linear;
mod list;
mod log_density;
mod math;
mod operators;
mod plans;
mod reduce;
mod row;
mod table;

pub use builtin::{
    ArgAdjoints, Args, Argument, Binary, Builtin, Derivative, Domain, Form, HostItem, KernelTraits,
    Kind, PlanForm, PreviousEvaluation, Reduction, Scalar, State, Text, Type, Vjp, Which,
};
pub use covariance::CovarianceValue;
pub(crate) use derivative::times;
pub use finding::{doc, search};
pub(crate) use reduce::dot;
pub use row::{Arg, Default, Resume, Row, arg, flag, function, int, num, opt, word};
pub use table::{Constant, Defaults, InputHook, Table};
