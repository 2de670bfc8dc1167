//! Counts of what the kernels of a chain did.

use serde::{Deserialize, Serialize};

/// The least number of proposals from which a choice is judged.
pub(super) const JUDGED: u64 = 100;

/// Statistics of a kernel in a chain, or in all of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelStats {
    /// The kernel as the program writes it.
    pub name: String,
    /// Proposals made.
    pub proposals: u64,
    /// Those accepted.
    pub accepted: u64,
    /// Wall time spent in it, in seconds.
    pub seconds: f64,
    /// Those rejected because the program is undefined there (a domain error).
    pub failed: u64,
    /// Divergent trajectories (Hamiltonian kernels).
    #[serde(default)]
    pub divergent: u64,
    /// Proposals that led, or could have led, to another state of positive probability
    /// (single-site kernels).
    #[serde(default)]
    pub possible: u64,
    /// The step size after warm-up (Hamiltonian kernels); over several chains, the mean.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_size: Option<f64>,
    /// The log of the evidence, from kernels that estimate it; over several chains, the
    /// log of the mean estimate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_evidence: Option<f64>,
}

/// Statistics of single-site kernels at one choice, in a chain or in all of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SiteStats {
    /// Its address.
    pub address: String,
    /// Proposals made.
    pub proposals: u64,
    /// Those accepted.
    pub accepted: u64,
    /// Those that led, or could have led, to another state of positive probability.
    #[serde(default)]
    pub possible: u64,
}

impl SiteStats {
    /// The acceptance rate; `None` if there were no proposals.
    pub fn acceptance(&self) -> Option<f64> {
        (self.proposals > 0).then(|| self.accepted as f64 / self.proposals as f64)
    }

    /// Sums the statistics of several chains by address, in order of first appearance.
    pub fn total<'a>(stats: impl IntoIterator<Item = &'a SiteStats>) -> Vec<SiteStats> {
        let mut sum: indexmap::IndexMap<&str, SiteStats> = indexmap::IndexMap::new();
        for s in stats {
            let new = || SiteStats { address: s.address.clone(), ..Default::default() };
            let t = sum.entry(&s.address).or_insert_with(new);
            t.proposals += s.proposals;
            t.accepted += s.accepted;
            t.possible += s.possible;
        }
        sum.into_values().collect()
    }

    /// True if the choice never moved, although other values of it are possible.
    pub fn is_stuck(&self) -> bool {
        self.proposals >= JUDGED && self.accepted == 0 && self.possible > 0
    }
}

impl KernelStats {
    /// Adds the outcome of a step, and the time it took.
    #[doc(hidden)]
    pub fn add(&mut self, outcome: &super::kernel::Outcome, time: std::time::Duration) {
        let add = |a: &mut u64, b: u32| *a = a.saturating_add(b.into());
        add(&mut self.proposals, outcome.proposals);
        add(&mut self.accepted, outcome.accepted);
        add(&mut self.failed, outcome.failed);
        add(&mut self.divergent, outcome.divergent);
        add(&mut self.possible, outcome.possible);
        self.seconds += time.as_secs_f64();
    }

    /// The acceptance rate; `None` if there were no proposals.
    pub fn acceptance(&self) -> Option<f64> {
        (self.proposals > 0).then(|| self.accepted as f64 / self.proposals as f64)
    }

    /// Sums the statistics of several chains by kernel name, in order of first
    /// appearance.
    #[doc(hidden)]
    pub fn total<'a>(stats: impl IntoIterator<Item = &'a KernelStats>) -> Vec<KernelStats> {
        let mut sum: indexmap::IndexMap<&str, KernelStats> = indexmap::IndexMap::new();
        let all: Vec<&KernelStats> = stats.into_iter().collect();
        for s in &all {
            let t = sum
                .entry(&s.name)
                .or_insert_with(|| KernelStats { name: s.name.clone(), ..Default::default() });
            t.proposals += s.proposals;
            t.accepted += s.accepted;
            t.seconds += s.seconds;
            t.failed += s.failed;
            t.divergent += s.divergent;
            t.possible += s.possible;
        }
        for t in sum.values_mut() {
            let same = all.iter().filter(|s| s.name == t.name);
            let estimates: Vec<f64> = same.filter_map(|s| s.log_evidence).collect();
            let mean = || {
                pcadlang_numerics::num::log_sum_exp(&estimates) - libm::log(estimates.len() as f64)
            };
            t.log_evidence = (!estimates.is_empty()).then(mean);
            let sizes: Vec<f64> =
                all.iter().filter(|s| s.name == t.name).filter_map(|s| s.step_size).collect();
            let n = sizes.len() as f64;
            t.step_size = (n > 0.0).then(|| sizes.iter().sum::<f64>() / n);
        }
        sum.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_of_the_same_name_add_up_in_order() {
        let k = |name: &str, proposals, accepted| KernelStats {
            name: name.into(),
            proposals,
            accepted,
            seconds: 0.5,
            failed: 1,
            ..Default::default()
        };
        let total = KernelStats::total(&[k("mh", 4, 1), k("drift", 2, 2), k("mh", 6, 4)]);
        assert_eq!(total.iter().map(|t| &*t.name).collect::<Vec<_>>(), ["mh", "drift"]);
        assert_eq!(
            (total[0].proposals, total[0].accepted, total[0].failed, total[0].seconds),
            (10, 5, 2, 1.0)
        );
        assert_eq!(total[0].acceptance(), Some(0.5));
        assert_eq!(KernelStats::default().acceptance(), None);
    }

    #[test]
    fn estimates_of_the_evidence_are_averaged() {
        let k =
            |log_evidence| KernelStats { name: "smc".into(), log_evidence, ..Default::default() };
        let total =
            KernelStats::total(&[k(Some(libm::log(2.0))), k(None), k(Some(libm::log(4.0)))]);
        assert!(
            (total[0].log_evidence.unwrap() - libm::log(3.0)).abs() < 1e-15,
            "{:?}",
            total[0].log_evidence
        );
        assert_eq!(KernelStats::total(&[k(None)])[0].log_evidence, None);
    }
}
