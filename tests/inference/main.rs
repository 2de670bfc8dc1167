//! Kernels and plans: the posterior is the right one, by every kind of proof there is, and
//! chains can be interrupted.

#[path = "../common/mod.rs"]
mod common;

mod adaptation;
mod appearing;
mod balance;
mod calibration;
mod chains;
mod circle;
mod default_plan;
mod enumeration;
mod exact;
mod gathered;
mod kept_state;
mod kernels;
mod lathe_parts;
mod own_kernels;
mod planted_errors;
mod posteriordb;
mod published;
mod published_models;
mod resume;
mod starts;
mod summing_out;
mod transitions;
