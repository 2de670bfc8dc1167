//! Finds choices that determine which other choices exist, and that a run hardly ever
//! moved.

use super::draws::SiteStats;
use super::stats::JUDGED;
use pcadlang_engine::trace::{Effect, Trace};

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
