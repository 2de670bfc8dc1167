//! Coordinates of choices near a pole that is not at 0, where values are too coarse to tell
//! them (see `Support::Pole`). A trace keeps them beside its values, so that a move goes on
//! from where the last one ended.
//!
//! A coordinate is used only while it is one of the choice's value, so nothing else needs to
//! know of them: an update that is undone, or that sets or draws the value, changes none.

use super::propose::Change;
use super::{Target, Trace};
use pcadlang_numerics::dist::Support;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use rustc_hash::FxHashMap;

/// The number of commits, and the coordinates that are kept, by the hash of an address.
pub type CoarseState = (u64, Vec<(u64, f64)>);

/// The coordinates that are kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Coarse {
    /// By choice or element.
    kept: FxHashMap<Target, f64>,
    /// The number of commits, which tells apart the draws of coordinates.
    commits: u64,
}

impl Trace {
    /// Keeps the coordinates of the pending changes, which are being committed.
    pub(super) fn keep_pending(&mut self) {
        self.coarse.commits += 1;
        for p in &self.graph.update.pending {
            if let Change::Free(y) = &p.change
                && let [y] = y[..]
                && Support::COARSE.contains(&y)
            {
                self.coarse.kept.insert(Target { node: p.node, element: p.element }, y);
            }
        }
    }

    /// Keeps the coordinates of these choices that were moved in place: those that their
    /// values need not tell.
    pub(super) fn keep_moved(
        &mut self,
        targets: &[Target],
        coordinates: impl Iterator<Item = Option<f64>>,
    ) {
        self.coarse.commits += 1;
        for (t, y) in targets.iter().zip(coordinates) {
            if let Some(y) = y {
                self.coarse.kept.insert(*t, y);
            }
        }
    }

    /// Returns the coordinate of a choice with this value, unless the value tells it: the
    /// one that was kept, or one of those beyond the last double before a pole, drawn anew
    /// after each commit.
    pub(super) fn coarse_coordinate(&self, t: Target, support: &Support, x: f64) -> Option<f64> {
        let kept = self.coarse.kept.get(&t).copied();
        let uniform = || {
            let key = StreamKey::new(self.address_hash(t), 0, Purpose::VALUES);
            key.stream(self.coarse.commits, 0, 0).open_uniform()
        };
        support.coarse_coordinate(x, kept, uniform)
    }

    /// The part of this that a checkpoint keeps: the number of commits, and coordinates by the
    /// hashes of their choices' addresses.
    #[doc(hidden)]
    pub fn coarse_state(&self) -> CoarseState {
        let one = |t: &Target| {
            let kept = self.coarse.kept.get(t)?;
            Some((self.address_hash(*t), *kept))
        };
        let all = if self.coarse.kept.is_empty() { &[][..] } else { self.all_targets() };
        (self.coarse.commits, all.iter().filter_map(one).collect())
    }

    /// Restores it.
    #[doc(hidden)]
    pub fn restore_coarse(&mut self, (commits, coordinates): &CoarseState) {
        self.coarse.commits = *commits;
        if coordinates.is_empty() {
            return;
        }
        let by_hash: FxHashMap<u64, f64> = coordinates.iter().copied().collect();
        for t in &self.all_targets().to_vec() {
            if let Some(y) = by_hash.get(&self.address_hash(*t)) {
                self.coarse.kept.insert(*t, *y);
            }
        }
    }
}
