//! Counts of the proposals of single-site kernels, by address. Off by default
//! ([`super::RunOptions::sites`]).

use super::kernel::Outcome;
use super::stats::SiteStats;
use pcadlang_engine::trace::Trace;
use rustc_hash::FxHashMap;

/// The most addresses that are counted: open universes have unboundedly many.
const MOST: usize = 1000;

/// Counts by the hash of the address. The address is spelt out when it is first seen.
#[derive(Debug, Default)]
pub(super) struct Sites(FxHashMap<u64, SiteStats>);

impl Sites {
    /// Adds one step. A choice that vanished in that step is not counted.
    pub fn count(&mut self, trace: &Trace, outcome: &Outcome) {
        let Some(t) = outcome.site.filter(|t| trace.is_active(*t)) else { return };
        let hash = trace.address_hash(t);
        if self.0.len() >= MOST && !self.0.contains_key(&hash) {
            return;
        }
        let new = || SiteStats { address: trace.address(t).to_string(), ..Default::default() };
        let site = self.0.entry(hash).or_insert_with(new);
        site.proposals = site.proposals.saturating_add(outcome.proposals.into());
        site.accepted = site.accepted.saturating_add(outcome.accepted.into());
    }

    /// The counts, for a checkpoint.
    pub fn list(&self) -> Vec<(u64, SiteStats)> {
        self.0.iter().map(|(hash, stats)| (*hash, stats.clone())).collect()
    }

    /// Restores the counts of a checkpoint.
    pub fn load(&mut self, list: Vec<(u64, SiteStats)>) {
        self.0 = list.into_iter().collect();
    }

    /// The counts, sorted by address.
    pub fn into_stats(self) -> Vec<SiteStats> {
        let mut all: Vec<SiteStats> = self.0.into_values().collect();
        all.sort_by(|a, b| a.address.cmp(&b.address));
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::RunOptions;
    use crate::draws::SiteStats;
    use pcadlang_library::model::Model;

    #[test]
    fn single_site_kernels_are_counted_by_address() {
        let model = Model::from_text(
            "assume c ~ flip(0.5); assume x = if c { a ~ normal(0, 1); a } else { b ~ normal(1, 1); b };
             assume z ~ iid(normal(0, 1), 2);
             observe normal(x + z[0] - z[1], 1) = 0;
             infer { warmup 100 { mh(one(@**)); } repeat 3000 { mh(one(@**)); gibbs(@c); drift(one($continuous)); } }",
        )
        .unwrap();
        let done = model.run(&RunOptions { sites: true, ..RunOptions::default() }, 2, 1).unwrap();
        let all = SiteStats::total(done.chains.iter().flat_map(|c| &c.sites));
        let names: Vec<&str> = all.iter().map(|s| &*s.address).collect();
        assert_eq!(names, ["@c", "@x/a", "@x/b", "@z[0]", "@z[1]"]);
        // Every choice still exists after a step that picks it, so every proposal counts
        // at some address.
        let proposals: u64 = done.chains.iter().flat_map(|c| &c.kernels).map(|k| k.proposals).sum();
        assert_eq!(all.iter().map(|s| s.proposals).sum::<u64>(), proposals);
        assert!(all.iter().all(|s| s.acceptance().is_some_and(|a| a > 0.05 && a < 1.0)), "{all:?}");
        let silent = model.run(&RunOptions::default(), 1, 1).unwrap();
        assert!(silent.chains[0].sites.is_empty());
    }
}
