//! The register of active choices, by address and by the selections that kernels have
//! registered.
//!
//! Each selection keeps its members in a list, so that one can be picked in constant
//! time. The order is that of the hashes of their addresses: a function of the state, not
//! of its history. Members that appear or vanish during an update are noted, and the list
//! is updated at its end.

use super::node::NodeId;
use super::select::Selector;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// A unit that a kernel can propose: a choice, or an element of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Target {
    pub(crate) node: NodeId,
    /// `NONE` for a whole choice.
    pub(crate) element: u32,
}

/// The number of a registered selection of a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Selection(pub(crate) u32);

/// A list of targets and the address hash of each, in the same order.
pub(crate) type Listed = (Arc<Vec<u64>>, Arc<Vec<Target>>);

#[derive(Clone, Debug)]
pub(crate) struct Members {
    pub selector: Selector,
    pub listed: Listed,
    /// The members that this update adds and removes.
    pub added: Vec<(u64, Target)>,
    pub removed: Vec<(u64, NodeId)>,
}

impl Members {
    pub fn new(selector: Selector, hashes: Vec<u64>, targets: Vec<Target>) -> Self {
        Members {
            selector,
            listed: (Arc::new(hashes), Arc::new(targets)),
            added: Vec::new(),
            removed: Vec::new(),
        }
    }

    /// Returns the members in order.
    pub fn targets(&self) -> &[Target] {
        &self.listed.1
    }

    /// Returns the shared list of members.
    pub fn listed(&self) -> &Arc<Vec<Target>> {
        &self.listed.1
    }

    /// Applies the changes of this update; returns the previous list if it changed.
    pub fn apply(&mut self) -> Option<Listed> {
        let (hashes, targets) = &self.listed;
        self.removed.retain(|(hash, node)| {
            let first = hashes.partition_point(|h| h < hash);
            let mut same = first..first + hashes[first..].iter().take_while(|h| *h == hash).count();
            same.any(|i| targets[i].node == *node)
        });
        if self.added.is_empty() && self.removed.is_empty() {
            return None;
        }
        let before = self.listed.clone();
        let (hashes, targets) =
            (Arc::make_mut(&mut self.listed.0), Arc::make_mut(&mut self.listed.1));
        for (hash, node) in self.removed.drain(..) {
            let first = hashes.partition_point(|h| *h < hash);
            let same = hashes[first..].iter().take_while(|h| **h == hash).count();
            let leaves = |i: &usize| targets[*i].node == node;
            if let Some(from) = (first..first + same).find(leaves) {
                let to = (from..first + same).take_while(leaves).last().map_or(from, |i| i + 1);
                hashes.drain(from..to);
                targets.drain(from..to);
            }
        }
        self.added.sort_by_key(|(hash, t)| (*hash, t.element));
        if self.added.len() > 8 {
            let mut all: Vec<(u64, Target)> =
                hashes.drain(..).zip(targets.drain(..)).chain(self.added.drain(..)).collect();
            // The sort is stable, and the list nearly sorted already.
            all.sort_by_key(|(hash, t)| (*hash, t.element));
            hashes.extend(all.iter().map(|(h, _)| *h));
            targets.extend(all.iter().map(|(_, t)| *t));
        } else {
            for (hash, target) in self.added.drain(..) {
                let mut at = hashes.partition_point(|h| *h < hash);
                while at < hashes.len()
                    && hashes[at] == hash
                    && targets[at].element < target.element
                {
                    at += 1;
                }
                hashes.insert(at, hash);
                targets.insert(at, target);
            }
        }
        // If choices vanished and appeared again, keep the old allocation: kernels that
        // sweep over a selection detect changes by pointer.
        if self.listed == before {
            self.listed = before;
            return None;
        }
        Some(before)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Choices {
    pub by_address: FxHashMap<u64, NodeId>,
    pub selections: Vec<Members>,
    /// Pairs of an earlier and a later choice at the same address: an error if both still
    /// exist at the end of the update.
    pub suspects: Vec<(NodeId, NodeId)>,
}

impl Default for Choices {
    fn default() -> Self {
        let all = Members::new(Selector::All, Vec::new(), Vec::new());
        Choices { by_address: FxHashMap::default(), selections: vec![all], suspects: Vec::new() }
    }
}

impl Choices {
    /// Returns the choice at an address.
    pub fn find(&self, hash: u64) -> Option<NodeId> {
        self.by_address.get(&hash).copied()
    }

    pub fn forget_update(&mut self) {
        self.suspects.clear();
        for m in &mut self.selections {
            m.added.clear();
            m.removed.clear();
        }
    }
}
