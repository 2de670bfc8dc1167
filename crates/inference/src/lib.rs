//! Inference: kernels, plans, chains and diagnostics. Depends on traces, and not on
//! pictures.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod calibration;
mod callback;
mod calls;
mod default_plan;
pub mod diagnostics;
pub mod draws;
mod force;
mod gather;
pub mod host;
mod init;
mod kernel;
mod kernels;
mod neighbours;
mod pause;
mod plain;
mod plan;
mod population;
pub mod predictive;
mod record;
mod resampling;
mod run;
mod sites;
mod state;
mod stats;
mod structure;
#[cfg(test)]
#[path = "../../engine/src/testing.rs"]
mod testing;

pub use callback::{Callback, Callbacks};
pub use calls::explained::{Selecting, selecting};
pub use calls::host_kernel::KernelCall;
pub use calls::selection::{not_a_selection, selected};
pub use default_plan::default_plan;
pub use force::force;
pub use gather::best::{BestSoFar, BestState};
pub use gather::evidence::{Evidence, Weighed};
pub use gather::kept::{KeptTrace, KeptTraces};
pub use gather::trajectory::{Trajectory, TrajectoryState};
pub use init::attempts;
pub use init::{NoStart, Start, StartError, starts};
pub use kernel::accepts;
pub use kernel::{Kernel, Outcome, Pick, SiteSelection, StepContext, decide, recoverable};
pub use kernels::{Abc, Delayed, Hamiltonian, Hmc, Knn, Nuts, Smc, Temper, table};
pub use kernels::{Block, Drift, Elliptical, Exact, Gibbs, Mh, Slice};
pub use neighbours::{Banks, Latent, Latents, Neighbours};
pub use pause::Pause;
use pcadlang_numerics::platform::threads as parallel;
pub use pcadlang_numerics::platform::threads::in_parallel;
pub use plan::checkpoint::Checkpoint;
pub use plan::run_from;
pub use run::{ChainError, ChainResult, Progress, RunOptions, Search, run_chains};
pub use state::StateError;
pub use state::{pack, unpack};
pub use structure::{stuck_structure, stuck_together};
