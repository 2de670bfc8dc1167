//! Effective sample sizes: the number of independent draws with the same precision.
//!
//! Geyer's initial monotone sequence over the autocorrelations of all chains together
//! (Vehtari et al. 2021, section 3.2), on rank-normalised draws for the bulk and on
//! indicators for quantiles.

use super::autocovariance::autocovariance;
use super::chains::{Chains, mean, unit, variance};
use super::normal_scores::normal_scores;
use super::quantile::quantile;

/// Effective sample size for the bulk of the distribution, from the rank-normalised,
/// split chains. NaN if it is undefined (see the module).
pub fn ess_bulk<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| bulk(&c))
}

/// Effective sample size for the tails: the smaller of those for the 5 % and 95 %
/// quantiles.
pub fn ess_tail<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| tail(&c))
}

/// Effective sample size for the mean, from the split chains without rank normalisation.
pub fn ess_mean<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| ess(&c.split()))
}

/// Effective sample size for the quantile at `p` in [0, 1].
pub fn ess_quantile<C: AsRef<[f64]>>(chains: &[C], p: f64) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| of_quantile(&c, p))
}

pub(super) fn bulk(chains: &Chains) -> f64 {
    ess(&normal_scores(&chains.split()))
}

pub(super) fn tail(chains: &Chains) -> f64 {
    of_quantile(chains, 0.05).min(of_quantile(chains, 0.95))
}

fn of_quantile(chains: &Chains, p: f64) -> f64 {
    let q = quantile(chains.values(), p);
    if q.is_nan() {
        return f64::NAN;
    }
    ess(&chains.map(|x| f64::from(u8::from(x <= q))).split())
}

/// The effective sample size of the given chains, without splitting; constant chains
/// count in full.
pub(super) fn ess(chains: &Chains) -> f64 {
    let (count, n) = (chains.count() as f64, chains.draws());
    let total = count * n as f64;
    let (low, high) =
        chains.values().iter().fold((f64::MAX, f64::MIN), |(l, h), &x| (l.min(x), h.max(x)));
    if high - low < RESOLUTION * unit(chains.values()) {
        return total;
    }
    let covariances: Vec<Vec<f64>> = chains.iter().map(autocovariance).collect();
    let covariance = |lag: usize| covariances.iter().map(|c| c[lag]).sum::<f64>() / count;
    let within = covariance(0) * n as f64 / (n as f64 - 1.0);
    let mut pooled = covariance(0);
    if chains.count() > 1 {
        pooled += variance(&chains.iter().map(mean).collect::<Vec<_>>());
    }
    let rho = |lag: usize| 1.0 - (within - covariance(lag)) / pooled;

    // Geyer's initial positive sequence: pairs of neighbouring lags, as long as their sum
    // is positive.
    let (mut even, mut odd) = (1.0, rho(1));
    let mut rhos = vec![even, odd];
    while rhos.len() + 2 < n && even + odd > 0.0 {
        even = rho(rhos.len());
        odd = rho(rhos.len() + 1);
        if even + odd >= 0.0 {
            rhos.extend([even, odd]);
        } else {
            rhos.extend([0.0, 0.0]);
        }
    }
    // The last pair is left out of the sum, except for its even member if that is
    // positive.
    let used = rhos.len() - 2;
    let last_even = if even > 0.0 { even } else { rhos[used] };
    rhos.truncate(used);
    // Geyer's initial monotone sequence: the sums of pairs do not rise.
    for t in (3..used).step_by(2) {
        let before = rhos[t - 3] + rhos[t - 2];
        if rhos[t - 1] + rhos[t] > before {
            rhos[t - 1] = before / 2.0;
            rhos[t] = before / 2.0;
        }
    }
    // An antithetic chain may be worth more than independent draws, but not beyond this
    // bound (section 3.2).
    let tau = (-1.0 + 2.0 * rhos.iter().sum::<f64>() + last_even).max(1.0 / libm::log10(total));
    total / tau
}

/// The decimal resolution of a double, in the unit of the draws: draws with a smaller
/// range count as constant.
const RESOLUTION: f64 = 1e-15;
