//! All diagnostics of one quantity in one struct.

use super::chains::{Chains, mean, unit, variance};
use super::quantile::quantile_sorted;
use super::{ess, mcse, rhat};
use serde::{Deserialize, Serialize};

/// The summary of one scalar quantity over the chains. Undefined entries are NaN, and
/// `null` in JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The mean of all draws.
    #[serde(with = "nullable")]
    pub mean: f64,
    /// The standard deviation of all draws, over n - 1.
    #[serde(with = "nullable")]
    pub sd: f64,
    /// The 5 % quantile.
    #[serde(with = "nullable")]
    pub q05: f64,
    /// The median.
    #[serde(with = "nullable")]
    pub q50: f64,
    /// The 95 % quantile.
    #[serde(with = "nullable")]
    pub q95: f64,
    /// Monte Carlo standard error of the mean.
    #[serde(with = "nullable")]
    pub mcse_mean: f64,
    /// Monte Carlo standard error of the standard deviation.
    #[serde(with = "nullable")]
    pub mcse_sd: f64,
    /// Effective sample size for the bulk.
    #[serde(with = "nullable")]
    pub ess_bulk: f64,
    /// Effective sample size for the tails.
    #[serde(with = "nullable")]
    pub ess_tail: f64,
    /// Rank-normalised split R-hat.
    #[serde(with = "nullable")]
    pub r_hat: f64,
}

/// Summarises one scalar quantity, `chains[chain][draw]`. Moments and quantiles need no
/// minimum number of draws and use chains of different lengths in full; a NaN draw makes
/// all of them NaN.
pub fn summary<C: AsRef<[f64]>>(chains: &[C]) -> Summary {
    let mut all: Vec<f64> = chains.iter().flat_map(|c| c.as_ref()).copied().collect();
    let nan = all.iter().any(|x| x.is_nan());
    let defined = |x: f64| if nan { f64::NAN } else { x };
    let unit = unit(&all);
    let scaled: Vec<f64> = all.iter().map(|x| x / unit).collect();
    let (mut m, mut sd) = (unit * mean(&scaled), unit * variance(&scaled).sqrt());
    all.sort_by(f64::total_cmp);
    // Rounding would make a mean of equal numbers another number.
    if let [first, .., last] = all[..]
        && first == last
    {
        (m, sd) = (first, 0.0);
    }
    let valid = Chains::new(chains);
    let of = |f: fn(&Chains) -> f64| valid.as_ref().map_or(f64::NAN, f);
    Summary {
        mean: m,
        sd,
        q05: defined(quantile_sorted(&all, 0.05)),
        q50: defined(quantile_sorted(&all, 0.5)),
        q95: defined(quantile_sorted(&all, 0.95)),
        mcse_mean: of(mcse::of_mean),
        mcse_sd: of(mcse::of_sd),
        ess_bulk: of(ess::bulk),
        ess_tail: of(ess::tail),
        r_hat: of(rhat::rank_normalised),
    }
}

/// Serialises numbers that are NaN or infinite as `null`, since JSON has no such numbers.
mod nullable {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(x: &f64, s: S) -> Result<S::Ok, S::Error> {
        if x.is_finite() { s.serialize_some(x) } else { s.serialize_none() }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(d)?.unwrap_or(f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_round_trips_with_null_for_nan() {
        let s = summary(&[vec![1.0, 2.0, 3.0, 5.0, 0.1]]);
        let text = serde_json::to_string(&s).unwrap();
        assert!(text.contains("\"r_hat\":null"), "{text}");
        let back: Summary = serde_json::from_str(&text).unwrap();
        assert_eq!(format!("{s:?}"), format!("{back:?}"));
    }

    #[test]
    fn a_constant_is_its_mean() {
        let s = summary(&[vec![0.1; 999], vec![0.1; 999]]);
        assert_eq!((s.mean, s.sd), (0.1, 0.0));
        let s = summary(&[[0.0, -0.0, 0.0, -0.0]]);
        assert_eq!((s.mean, s.sd), (0.0, 0.0));
        assert!(summary(&[[f64::NAN; 4]]).mean.is_nan());
    }

    #[test]
    fn few_and_no_draws_are_defined() {
        let s = summary(&[vec![1.0, 3.0]]);
        assert_eq!((s.mean, s.q50, s.sd), (2.0, 2.0, 2.0_f64.sqrt()));
        assert!(s.ess_bulk.is_nan() && s.mcse_mean.is_nan());
        let none = summary::<Vec<f64>>(&[]);
        assert!(none.mean.is_nan() && none.q95.is_nan());
    }
}
