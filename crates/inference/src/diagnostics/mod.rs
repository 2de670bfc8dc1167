//! Convergence diagnostics of Markov chains: rank-normalised split R-hat, bulk and tail
//! effective sample size, Monte Carlo standard errors, quantiles.
//!
//! After Vehtari, Gelman, Simpson, Carpenter and Bürkner, "Rank-normalization, folding,
//! and localization: an improved R-hat for assessing convergence of MCMC" (Bayesian
//! Analysis 16:2, 2021), with the choices of ArviZ 0.23 where the paper leaves one open.
//! The numbers agree with `arviz.summary`, but do not depend on the unit of the draws,
//! unlike its error of the standard deviation below 1e-7. Drawing, judging and printing
//! are left to other modules.
//!
//! Draws are given as one slice per chain, all of one length (longer ones are cut to the
//! shortest). Undefined results are NaN: those of fewer than four draws or of draws that
//! are not finite, R-hat of a single chain, and everything over constant chains except
//! their mean and effective sample size.

mod autocovariance;
mod chains;
mod ess;
mod evidence;
mod mcse;
mod modes;
mod normal_scores;
mod quantile;
mod rhat;
mod summary;

pub use ess::{ess_bulk, ess_mean, ess_quantile, ess_tail};
pub use evidence::{Clouds, LogEvidence, log_density, log_evidence, shares};
pub use mcse::{mcse_mean, mcse_sd};
pub use modes::modes;
pub use quantile::{quantile, quantile_sorted};
pub use rhat::r_hat;
pub use summary::{Summary, summary};
