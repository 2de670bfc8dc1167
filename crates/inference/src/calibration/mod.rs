//! Tests whether a sampler draws from the posterior. They need no known posterior to
//! compare with, only data that can be simulated.
//!
//! [`sbc()`] ranks true values among draws given data simulated from them (Talts et al.
//! 2018); [`geweke()`] alternates kernels with fresh data and compares with the prior
//! (Geweke 2004). Both take any [`Sampler`]: a plan of a program, or one kernel in a
//! loop. Running chains and printing are left to other modules.
//!
//! Invariant: results are functions of the program, sampler, seed and counts, and do not
//! depend on the number of threads.

mod geweke;
mod quantities;
mod sampler;
mod sbc;
pub(crate) mod simulate;

pub use geweke::{Geweke, GewekeRow, geweke};
pub use sampler::{PlanSampler, Sampler};
pub use sbc::{RANKS, Sbc, SbcRow, sbc};

use super::parallel::in_parallel;
use super::run::ChainError;
use pcadlang_engine::trace::Limits;
use std::time::Duration;

/// The probability that a correct sampler fails a check, over all quantities together
/// (Bonferroni).
pub const FALSE_ALARMS: f64 = 1e-3;

/// The fewest replicates that are informative.
pub const FEWEST: usize = 20;

/// Counts and settings of a check.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Data sets (`sbc`) or chains (`geweke`); at least [`FEWEST`].
    pub replicates: usize,
    /// The seed; the same seed gives the same result.
    pub seed: u64,
    /// The number of threads.
    pub threads: usize,
    /// Kernel applications of each chain after warm-up. If `None`, the plan's number;
    /// `sbc` then runs longer chains if the effective sample size of a few pilot chains
    /// is too small.
    pub steps: Option<u64>,
    /// Limits on what the program may build.
    pub limits: Limits,
    /// Called by `sbc` with the time that the rest takes, estimated from a few pilot chains.
    pub estimated: Option<fn(Duration)>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            replicates: 200,
            seed: 1,
            threads: 1,
            steps: None,
            limits: Limits::default(),
            estimated: None,
        }
    }
}

/// Why a check has no result.
#[derive(Debug)]
pub enum CalibrationError {
    /// Data cannot be simulated from the program, for this reason.
    NotSimulable(String),
    /// There are too few replicates or draws; the message says what to do.
    TooFew(String),
    /// A chain failed.
    Chain(ChainError),
}

impl From<ChainError> for CalibrationError {
    fn from(e: ChainError) -> Self {
        CalibrationError::Chain(e)
    }
}

impl From<Box<pcadlang_engine::lang::error::RunError>> for CalibrationError {
    fn from(e: Box<pcadlang_engine::lang::error::RunError>) -> Self {
        CalibrationError::Chain(ChainError::Run(e))
    }
}

/// Calls a function for each index, on several threads. Returns the results in order, or
/// the first error.
fn each<T: Send>(
    settings: &Settings,
    indices: std::ops::Range<u32>,
    one: impl Fn(u32) -> Result<T, CalibrationError> + Sync + Send,
) -> Result<Vec<T>, CalibrationError> {
    in_parallel(settings.threads.max(1), indices.collect(), one).into_iter().collect()
}
