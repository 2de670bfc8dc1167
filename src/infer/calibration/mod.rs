//! Is what a sampler draws the posterior? Checks that need no posterior to compare with,
//! only that data can be simulated.
//!
//! [`sbc()`] ranks true values among draws given data simulated from them (Talts et al.
//! 2018); [`geweke()`] lets kernels and fresh data take turns and compares with the prior
//! (Geweke 2004). Both take any [`Sampler`]: a plan of a program, or one kernel in a
//! loop. Not here: running chains, printing.
//!
//! Invariant: results are functions of program, sampler, seed and counts, not of the
//! number of threads.

mod geweke;
mod quantities;
mod sampler;
mod sbc;
pub(in crate::infer) mod simulate;

pub use geweke::{Geweke, GewekeRow, geweke};
pub use sampler::{KernelSampler, PlanSampler, Sampler};
pub use sbc::{RANKS, Sbc, SbcRow, sbc};

use super::parallel::in_parallel;
use super::plan::ChainError;
use crate::trace::Limits;

/// The probability that a right sampler fails a check, over all quantities together
/// (Bonferroni).
pub const FALSE_ALARMS: f64 = 1e-3;

/// The fewest replicates that say anything.
pub const FEWEST: usize = 20;

/// Counts and settings of a check.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Data sets (`sbc`) or chains (`geweke`); at least [`FEWEST`].
    pub replicates: usize,
    /// The seed: same seed, same result.
    pub seed: u64,
    /// Threads that replicates are shared among.
    pub threads: usize,
    /// Kernel applications of each chain after warm-up. Without it what the plan says;
    /// `sbc` then runs longer where a few first chains come to fewer independent draws
    /// than it ranks.
    pub steps: Option<u64>,
    /// Bounds on what the program may build.
    pub limits: Limits,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { replicates: 200, seed: 1, threads: 1, steps: None, limits: Limits::default() }
    }
}

/// Why a check says nothing.
#[derive(Debug)]
pub enum CalibrationError {
    /// Data cannot be simulated from the program: the reason.
    NotSimulable(String),
    /// Too little to go by: what to do.
    TooFew(String),
    /// A chain failed.
    Chain(ChainError),
}

impl From<ChainError> for CalibrationError {
    fn from(e: ChainError) -> Self {
        CalibrationError::Chain(e)
    }
}

impl From<Box<crate::lang::error::RunError>> for CalibrationError {
    fn from(e: Box<crate::lang::error::RunError>) -> Self {
        CalibrationError::Chain(ChainError::Run(e))
    }
}

/// Does the same for each index, on some threads; results in order, the first error if
/// there is one.
fn each<T: Send>(
    settings: &Settings,
    indices: std::ops::Range<u32>,
    one: impl Fn(u32) -> Result<T, CalibrationError> + Sync + Send,
) -> Result<Vec<T>, CalibrationError> {
    in_parallel(settings.threads.max(1), indices.collect(), one).into_iter().collect()
}
