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
        site.possible = site.possible.saturating_add(outcome.possible.into());
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
