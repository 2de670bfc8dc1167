//! The potential scale reduction factor.

use super::chains::{Chains, mean, variance};
use super::normal_scores::normal_scores;
use super::quantile::median;

/// Rank-normalised split R-hat: the larger of bulk and folded R-hat (Vehtari et al. 2021,
/// section 4.1). Near 1 if the chains agree; above 1.01 they have not converged. NaN for
/// a single chain, or if it is undefined (see the module).
pub fn r_hat<C: AsRef<[f64]>>(chains: &[C]) -> f64 {
    Chains::new(chains).map_or(f64::NAN, |c| rank_normalised(&c))
}

pub(super) fn rank_normalised(chains: &Chains) -> f64 {
    if chains.count() < 2 {
        return f64::NAN;
    }
    // Of two draws in the middle, rounding decides which is nearer, as in ArviZ.
    let median = median(chains.values());
    let bulk = plain(&normal_scores(&chains.split()));
    let folded = plain(&normal_scores(&chains.map(|x| (x - median).abs()).split()));
    // If the folded draws do not vary, their R-hat is NaN and the bulk's is used.
    if folded > bulk { folded } else { bulk }
}

/// √(marginal variance / within-chain variance) (Gelman & Rubin 1992); NaN if all chains
/// are constant, as their variances are rounding errors.
fn plain(chains: &Chains) -> f64 {
    if chains.iter().all(|c| c.windows(2).all(|w| w[0] == w[1])) {
        return f64::NAN;
    }
    let n = chains.draws() as f64;
    let within = mean(&chains.iter().map(variance).collect::<Vec<_>>());
    let between = n * variance(&chains.iter().map(mean).collect::<Vec<_>>());
    ((between / within + n - 1.0) / n).sqrt()
}
