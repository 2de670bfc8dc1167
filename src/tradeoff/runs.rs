//! What one run of one setting on one case gave.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// How good the answer was at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// The time that was aimed at, in seconds from the start; none for the end of a run.
    pub at: Option<f64>,
    /// The time it was.
    pub seconds: f64,
    /// The error of the answer that there was by then; none if a number could not be had.
    pub error: Option<f64>,
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// The setting, by its name.
    pub setting: String,
    /// The case.
    pub case: String,
    /// The seed.
    pub seed: u64,
    /// The error over time; the last is the end.
    pub marks: Vec<Mark>,
    /// Everything that was measured of the last answer.
    pub scores: IndexMap<String, f64>,
    /// Steps of all chains, warm-up included.
    pub steps: u64,
    /// The smallest effective number of draws of any quantity a second of the run, where
    /// it is known.
    pub ess_per_second: Option<f64>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl RunRecord {
    /// The error at the time that was aimed at, `None` for the end.
    pub fn error_at(&self, at: Option<f64>) -> Option<f64> {
        self.marks.iter().find(|m| m.at == at).and_then(|m| m.error)
    }
}

/// When to look at a run of so many seconds: four times in each power of ten from a tenth
/// of a second, but not just before its end, which is looked at in any case.
pub fn marks(time: Option<f64>) -> Vec<f64> {
    let last = time.unwrap_or(1000.0);
    let nice = [1.0, 1.8, 3.2, 5.6];
    let all = (-1..7).flat_map(|power| nice.map(|x| x * 10f64.powi(power)));
    // As decimals are written, so that two runs aim at the same numbers.
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
