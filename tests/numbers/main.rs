//! Densities, samplers, special functions and diagnostics: their numbers compared with
//! independent ones, from ordinary to extreme values.

#[path = "../common/mod.rs"]
mod common;

mod diagnostics;
mod dist_reference;
mod distributions;
mod extremes;
mod logits;
mod poles;
mod truncation;
