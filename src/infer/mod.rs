//! Inference: kernels, plans, chains and diagnostics. Depends on traces, and not on
//! pictures.

#![doc = include_str!("guide.md")]

mod best;
mod build;
pub mod calibration;
mod callback;
mod chains;
mod columns;
mod default_plan;
pub mod diagnostics;
pub mod draws;
mod evidence;
mod explained;
mod expr;
mod force;
mod host_kernel;
mod init;
mod kept;
mod kernel;
mod kernels;
mod neighbours;
mod plain;
mod plan;
mod population;
pub mod predictive;
mod record;
mod resampling;
mod selection;
mod sites;
mod state;
mod structure;

use crate::platform::threads as parallel;
#[cfg(feature = "scene")]
pub(crate) use crate::platform::threads::in_parallel;
pub use best::{BestSoFar, BestState};
pub use callback::{Callback, Callbacks};
#[doc(hidden)]
pub use chains::run_chains;
#[doc(hidden)]
pub use default_plan::default_plan;
#[doc(hidden)]
pub use evidence::{Evidence, Weighed};
pub use explained::{Selecting, selecting};
pub(crate) use force::put as force;
pub use host_kernel::KernelCall;
pub(crate) use host_kernel::KernelMaker;
pub(crate) use init::attempts;
#[doc(hidden)]
pub use init::{Start, StartError, starts};
#[doc(hidden)]
pub use kept::{KeptTrace, KeptTraces};
pub(crate) use kernel::accepts;
pub use kernel::{Kernel, Outcome, Pick, SiteSelection, StepContext, decide, recoverable};
#[doc(hidden)]
pub use kernels::{
    Abc, AbcSmc, Delayed, Hamiltonian, Hmc, Independent, Knn, Nuts, Optimize, Smc, Temper,
};
pub use kernels::{Block, Drift, Elliptical, Gibbs, Mh, Slice};
#[doc(hidden)]
pub use neighbours::{Banks, Latent, Latents, Neighbours};
#[doc(hidden)]
pub use plan::run_from;
pub use plan::{ChainError, ChainResult, Checkpoint, Progress, RunOptions};
#[doc(hidden)]
pub use selection::selected;
pub use state::StateError;
pub(crate) use state::{pack, unpack};
#[doc(hidden)]
pub use structure::stuck_structure;
