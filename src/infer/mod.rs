//! Inference: kernels, plans, chains, diagnostics. Knows traces; knows nothing of pictures.

mod build;
pub mod calibration;
mod chains;
mod default_plan;
pub mod diagnostics;
pub mod draws;
mod expr;
mod force;
mod foreign;
mod init;
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

use crate::platform::threads as parallel;
pub(crate) use crate::platform::threads::in_parallel;
pub use chains::run_chains;
pub use default_plan::default_plan;
pub use foreign::KernelCall;
pub(crate) use foreign::KernelMaker;
pub(crate) use init::attempts;
pub use init::{Start, StartError, starts};
pub use kernel::{At, Kernel, Outcome, Pick, Scope, decide, recoverable};
pub use kernels::{
    Abc, AbcSmc, Block, Delayed, Drift, Elliptical, Gibbs, Hamiltonian, Hmc, Independent, Knn, Mh, Nuts, Optimize,
    Slice, Smc, Temper,
};
pub use neighbours::{Banks, Latent, Latents, Neighbours};
pub use plan::{ChainError, ChainResult, Checkpoint, Progress, RunOptions, Watch, run_from};
pub use state::StateError;
