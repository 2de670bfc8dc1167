//! Inference: kernels, plans, chains, diagnostics. Knows traces; knows nothing of pictures.

mod build;
pub mod calibration;
mod chains;
mod default_plan;
pub mod diagnostics;
pub mod draws;
mod expr;
mod force;
mod init;
mod kernel;
mod kernels;
mod neighbours;
mod parallel;
mod plain;
mod plan;
mod population;
pub mod predictive;
mod record;
mod resampling;
mod selection;
mod sites;
mod state;

pub use chains::run_chains;
pub use default_plan::default_plan;
pub(crate) use force::put as force;
pub(crate) use init::attempts;
pub use init::{Start, StartError, starts};
pub(crate) use kernel::accepts;
pub use kernel::{At, Kernel, Outcome, Pick, Scope};
pub use kernels::{
    Abc, AbcSmc, Block, Delayed, Drift, Elliptical, Gibbs, Hamiltonian, Hmc, Independent, Knn, Mh, Nuts, Optimize,
    Slice, Smc, Temper,
};
pub use neighbours::{Banks, Latent, Latents, Neighbours};
pub(crate) use parallel::in_parallel;
pub use plan::{ChainError, ChainResult, Checkpoint, Progress, RunOptions, Watch, run_from};
pub use selection::selected;
pub use state::StateError;
