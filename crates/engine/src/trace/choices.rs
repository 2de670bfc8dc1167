//! The register of active choices, by address and by the selections that kernels have
//! registered.
//!
//! Each selection keeps its members in a list, so that one can be picked in constant
//! time. The order is that of the hashes of their addresses: a function of the state, not
//! of its history. Members that appear or vanish during an update are noted, and the list
//! is updated at its end.

use super::journal::Entry;
use super::node::*;
use super::select::Selector;
use super::store::Store;
use super::terms::{pop_key, push_key};
use super::update::{Failure, Update};
use crate::lang::error::FaultKind;
use pcadlang_numerics::dist::Dist;
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

    /// Registers a selection, or returns the one already registered for this selector.
    pub fn selection(&mut self, store: &Store, selector: &Selector) -> Selection {
        if let Some(i) = self.selections.iter().position(|m| m.selector == *selector) {
            return Selection(i as u32);
        }
        let all = self.selections[0].listed.clone();
        let listed = all.0.iter().zip(all.1.iter()).filter(|(_, t)| store.selects(selector, t));
        let (hashes, targets) = listed.map(|(hash, t)| (*hash, *t)).unzip();
        let members = Members::new(selector.clone(), hashes, targets);
        self.selections.push(members);
        Selection(self.selections.len() as u32 - 1)
    }

    /// Registers a new choice.
    pub fn register(
        &mut self,
        (store, update): (&Store, &mut Update),
        n: NodeId,
        hash: u64,
        elements: Option<usize>,
        dist: &Dist,
    ) {
        if let Some(old) = self.by_address.insert(hash, n)
            && old != n
        {
            self.suspects.push((old, n));
            update.note(Entry::AddressShadowed(hash, old));
        }
        update.note(Entry::ChoiceAdded(n, hash));
        let needs_facts = self.selections.len() > 1;
        let needs_address = self.selections.iter().any(|m| m.selector.needs_address());
        let mut facts = needs_facts.then(|| store.facts(n, needs_address, Some(dist)));
        for i in 0..self.selections.len() {
            for e in 0..elements.unwrap_or(1) {
                let element = if elements.is_some() { e as u32 } else { NONE };
                let selected = match &mut facts {
                    None => true,
                    Some(f) if element != NONE && needs_address => {
                        push_key(&mut f.address, element);
                        let yes = self.selections[i].selector.selects(f);
                        pop_key(&mut f.address);
                        yes
                    }
                    Some(f) => self.selections[i].selector.selects(f),
                };
                if selected {
                    self.selections[i].added.push((hash, Target { node: n, element }));
                }
            }
        }
    }

    /// Removes a choice from the register.
    pub fn unregister(&mut self, update: &mut Update, n: NodeId, hash: u64) {
        if self.by_address.get(&hash) == Some(&n) {
            self.by_address.remove(&hash);
            update.note(Entry::ChoiceRemoved(n, hash));
        }
        for m in &mut self.selections {
            let before = m.added.len();
            m.added.retain(|(_, t)| t.node != n);
            if m.added.len() == before {
                m.removed.push((hash, n));
            }
        }
    }

    /// Ends an update: updates the members of selections, and fails at the second of two
    /// choices with the same address.
    pub fn update_selections(&mut self, store: &Store, update: &mut Update) -> Result<(), Failure> {
        for i in 0..self.selections.len() {
            if let Some(before) = self.selections[i].apply() {
                update.note(Entry::TargetsReplaced { selection: i as u32, before });
            }
        }
        self.check_duplicates(store)
    }

    /// Fails if two choices have the same address, at the second of them.
    fn check_duplicates(&mut self, store: &Store) -> Result<(), Failure> {
        for (old, new) in std::mem::take(&mut self.suspects) {
            let alive = |n: NodeId| store[n].state != State::Empty;
            if alive(old) && alive(new) {
                let message = format!("a second choice at the address {}", store.address(new));
                let hint = Some("give each choice its own name or key".to_owned());
                return Err(store.fail(new, FaultKind::Duplicate, message, hint));
            }
        }
        Ok(())
    }
}
