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

/// The coordinates that are kept, by node and element.
#[derive(Clone, Debug, Default)]
pub(super) struct Coarse(FxHashMap<(u32, u32), f64>);

impl Trace {
    /// Keeps the coordinates of the pending changes, which are being committed.
    pub(super) fn keep_pending(&mut self) {
        for p in &self.graph.pending {
            if let Change::Free(y) = &p.change
                && let [y] = y[..]
                && Support::COARSE.contains(&y)
            {
                self.coarse.0.insert((p.node, p.element), y);
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
        for (t, y) in targets.iter().zip(coordinates) {
            if let Some(y) = y {
                self.coarse.0.insert((t.node, t.element), y);
            }
        }
    }

    /// Returns the coordinate of a choice with this value, unless the value tells it: the
    /// one that was kept, or one of those beyond the last double before a pole, drawn anew
    /// after each commit.
    pub(super) fn coarse_coordinate(&self, t: Target, support: &Support, x: f64) -> Option<f64> {
        let kept = self.coarse.0.get(&(t.node, t.element)).copied();
        let uniform = || {
            let key = StreamKey::new(self.address_hash(t), 0, Purpose::VALUES);
            key.stream(self.graph.revision, 0, 0).open_uniform()
        };
        support.coarse_coordinate(x, kept, uniform)
    }
}
