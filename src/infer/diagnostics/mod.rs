//! Convergence diagnostics of Markov chains: rank-normalised split R-hat, bulk and tail
//! effective sample size, Monte Carlo standard errors, quantiles.
//!
//! After Vehtari, Gelman, Simpson, Carpenter and Bürkner, "Rank-normalization, folding,
//! and localization: an improved R-hat for assessing convergence of MCMC" (Bayesian
//! Analysis 16:2, 2021), with the choices ArviZ 0.23 makes where the paper leaves one;
//! the numbers agree with `arviz.summary`, but do not depend on the unit of draws, as its
//! error of the standard deviation does below 1e-7. Not here: drawing, judging, printing.
//!
//! Draws are given as one slice per chain, all of one length (longer ones are cut to the
//! shortest). What cannot be said is NaN: fewer than four draws, a draw that is not
//! finite, R-hat of a single chain, anything over constant chains but their mean and
//! effective sample size.

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
