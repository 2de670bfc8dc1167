//! Monte Carlo standard errors: the error of an estimate due to the finite number of
//! draws.

use super::chains::{Chains, mean, variance};
use super::ess::ess;

/// Standard error of the mean: sd / √(effective sample size of the mean).
pub fn mcse_mean<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| of_mean(&c))
}

/// Standard error of the standard deviation, by the delta method on the squared
/// deviations (Kenney & Keeping 1951, as in ArviZ). NaN for constant chains.
pub fn mcse_sd<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| of_sd(&c))
}

pub(super) fn of_mean(chains: &Chains) -> f64 {
    chains.unit() * (variance(chains.values()) / ess(&chains.split())).sqrt()
}

pub(super) fn of_sd(chains: &Chains) -> f64 {
    let m = mean(chains.values());
    let squares = chains.map(|x| (x - m) * (x - m));
    let expected = mean(squares.values());
    let fourth = mean(&squares.values().iter().map(|s| s * s).collect::<Vec<_>>());
    let of_variance = (fourth - expected * expected) / ess(&squares.split());
    chains.unit() * (of_variance / expected / 4.0).sqrt()
}
