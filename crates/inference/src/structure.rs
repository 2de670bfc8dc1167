//! Finds choices that a run hardly ever moved, and that determine which other choices exist,
//! or depend on each other.

use super::draws::SiteStats;
use super::stats::JUDGED;
use pcadlang_engine::trace::{Effect, Trace};
use rustc_hash::FxHashSet;

/// The acceptance rate from which a choice counts as moving.
const MOVES: f64 = 0.01;

/// The choices that determine the structure of a state (whether other choices exist, and
/// how many) and that the single-site kernels of a run hardly ever moved, with their
/// acceptance rates.
pub fn stuck_structure(state: &Trace, sites: &[SiteStats]) -> Vec<(String, f64)> {
    let stuck = |s: &SiteStats| s.acceptance().filter(|a| s.proposals >= JUDGED && *a < MOVES);
    let mut trace = None;
    let mut found = Vec::new();
    for (site, rate) in sites.iter().filter_map(|s| Some((s, stuck(s)?))) {
        let trace = trace.get_or_insert_with(|| state.clone());
        let Some(target) = site.address.parse().ok().and_then(|a| trace.find(&a)) else { continue };
        let reach = trace.dependents(target);
        if reach.terms.iter().any(|t| t.effect == Effect::Structural) {
            found.push((site.address.clone(), rate));
        }
    }
    found
}

/// The most choices that are compared with each other.
const MOST: usize = 200;

/// The choices that never moved, although other values of them are possible, and that share a
/// term of the density with another such choice: each may hold the other in place. One by
/// itself, such as the label of a point far from all other components, is where it belongs.
pub fn stuck_together(state: &Trace, sites: &[SiteStats]) -> Vec<String> {
    let stuck: Vec<&SiteStats> = sites.iter().filter(|s| s.is_stuck()).take(MOST).collect();
    if stuck.len() < 2 {
        return Vec::new();
    }
    let mut trace = state.clone();
    let mut terms = |s: &&SiteStats| {
        let target = s.address.parse().ok().and_then(|a| trace.find(&a));
        let reach = target.map(|t| trace.dependents(t).terms).unwrap_or_default();
        let of = reach.into_iter().map(|d| d.address.to_string()).chain([s.address.clone()]);
        of.collect::<FxHashSet<String>>()
    };
    let all: Vec<FxHashSet<String>> = stuck.iter().map(&mut terms).collect();
    let shares = |i: usize| (0..all.len()).any(|j| j != i && !all[i].is_disjoint(&all[j]));
    (0..all.len()).filter(|i| shares(*i)).map(|i| stuck[i].address.clone()).collect()
}
