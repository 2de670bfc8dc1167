//! Choices that decide which others there are, and whether a run moved them.

use super::draws::SiteStats;
use crate::trace::{Effect, Trace};

/// Proposals of a choice before it is judged.
const JUDGED: u64 = 100;
/// The least fraction of them that is accepted where a choice moves.
const MOVES: f64 = 0.01;

/// The choices on which the structure of a state depends (whether others are there, and
/// how many) and that the single-site kernels of a run hardly ever moved, with the
/// fraction of proposals accepted.
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
