//! The results of one run of one setting on one case.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// The error of the answer at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// The target time, in seconds from the start; `None` for the end of a run.
    pub at: Option<f64>,
    /// The actual time.
    pub seconds: f64,
    /// The error of the answer at that time; `None` if it is undefined.
    pub error: Option<f64>,
}

/// The results of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// The name of the setting.
    pub setting: String,
    /// The case.
    pub case: String,
    /// The seed.
    pub seed: u64,
    /// The error over time; the last is the end.
    pub marks: Vec<Mark>,
    /// All scores of the final answer.
    pub scores: IndexMap<String, f64>,
    /// The steps of all chains, including warm-up.
    pub steps: u64,
    /// The smallest effective sample size of any quantity, per second of the run, if
    /// known.
    pub ess_per_second: Option<f64>,
    /// The reason if the run failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl RunRecord {
    /// Returns the error at a target time, or at the end for `None`.
    pub fn error_at(&self, at: Option<f64>) -> Option<f64> {
        self.marks.iter().find(|m| m.at == at).and_then(|m| m.error)
    }
}

/// Returns the times at which a run with this time limit is measured: four per power of
/// ten from a tenth of a second, but not just before the end, which is always measured.
pub fn marks(time: Option<f64>) -> Vec<f64> {
    let last = time.unwrap_or(1000.0);
    let nice = [1.0, 1.8, 3.2, 5.6];
    let all = (-1..7).flat_map(|power| nice.map(|x| x * 10f64.powi(power)));
    // Rounded as decimals are written, so that different runs have the same targets.
    let rounded = all.map(|t| (t * 100.0).round() / 100.0);
    rounded.take_while(|t| *t < 0.95 * last).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_evenly_spaced_in_the_logarithm() {
        assert_eq!(marks(Some(3.2)), [0.1, 0.18, 0.32, 0.56, 1.0, 1.8]);
        assert_eq!(marks(Some(0.1)), [0.0; 0]);
        let all = marks(Some(100.0));
        assert!(all.windows(2).all(|w| (1.7..1.85).contains(&(w[1] / w[0]))), "{all:?}");
    }
}
