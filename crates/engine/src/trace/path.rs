//! From nodes to addresses. Frames store a hash of their prefix; the address itself is
//! built on request.

use super::choices::Target;
use super::node::*;
use super::store::Store;
use crate::lang::address::{Address, AddressSegment};
use crate::lang::code::{BlockKind, DistSpec, Op, Operand, Site};
use crate::lang::key::{Key, mix};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::sync::Arc;

impl Store {
    /// The keys of the loops around a frame, up to its function, outermost first, without
    /// those that the site's target carries.
    fn loop_keys(&self, frame: FrameId, carried: u32) -> SmallVec<[Key; 2]> {
        let mut keys = SmallVec::new();
        let mut level = 0;
        let mut f = frame;
        loop {
            let here = &self[f];
            match self.code.blocks[here.block].kind {
                BlockKind::Loop => {
                    if carried & (1 << level) == 0 {
                        keys.extend(here.key.clone());
                    }
                    level += 1;
                }
                BlockKind::Branch => {}
                _ => break,
            }
            f = self[here.owner].frame;
        }
        keys.reverse();
        keys
    }

    /// Returns the hash of the path through a site.
    pub fn site_hash(&self, frame: FrameId, site: SiteId) -> u64 {
        self.hash_site(frame, &self.code.sites[site], None, &[])
    }

    /// [`Store::site_hash`] for an element of a `map` or an entry of `mem`.
    pub fn keyed_site_hash(&self, frame: FrameId, site: SiteId, key: &Key) -> u64 {
        self.hash_site(frame, &self.code.sites[site], Some(key), &[])
    }

    /// [`Store::site_hash`] for a choice with its own keys.
    pub fn own_keyed_hash(&self, frame: FrameId, site: SiteId, own: &[Key]) -> u64 {
        self.hash_site(frame, &self.code.sites[site], None, own)
    }

    fn hash_site(&self, frame: FrameId, site: &Site, element: Option<&Key>, own: &[Key]) -> u64 {
        let last = site.segments.len().saturating_sub(1);
        let mut h = self[frame].path;
        for (i, s) in site.segments.iter().enumerate() {
            h = mix(h, s.hash);
            if i == 0 {
                h = self.loop_keys(frame, site.carried).iter().fold(h, |h, k| k.hash_into(h));
            }
            if i + 1 == last || last == 0 {
                h = element.iter().fold(h, |h, k| k.hash_into(h));
            }
            if i == last {
                h = own.iter().fold(h, |h, k| k.hash_into(h));
            }
        }
        h
    }

    /// Returns the address through a site; mirrors [`Store::hash_site`].
    fn spell_site(&self, frame: FrameId, site: SiteId, own: &[Key]) -> Vec<AddressSegment> {
        let mut segments = self.prefix(frame);
        self.append_site(frame, site, None, own, &mut segments);
        segments
    }

    /// Appends the segments that a site adds.
    fn append_site(
        &self,
        frame: FrameId,
        site: SiteId,
        element: Option<&Key>,
        own: &[Key],
        segments: &mut Vec<AddressSegment>,
    ) {
        let site = &self.code.sites[site];
        let last = site.segments.len().saturating_sub(1);
        for (i, s) in site.segments.iter().enumerate() {
            let mut keys = Vec::new();
            if i == 0 {
                keys.extend(self.loop_keys(frame, site.carried));
            }
            if i + 1 == last || last == 0 {
                keys.extend(element.cloned());
            }
            if i == last {
                keys.extend_from_slice(own);
            }
            segments.push(AddressSegment {
                name: Arc::clone(&s.name),
                occurrence: s.occurrence,
                keys,
            });
        }
    }

    /// Returns the address prefix of a frame: the calls that lead to its function.
    /// Iterative, because calls may be nested deeply.
    fn prefix(&self, frame: FrameId) -> Vec<AddressSegment> {
        let mut calls = Vec::new();
        let mut f = frame;
        loop {
            let here = &self[f];
            match self.code.blocks[here.block].kind {
                BlockKind::Root => break,
                // A function that a plan calls.
                _ if here.owner == NodeId::NONE => break,
                BlockKind::Function { .. } => {
                    let (Op::Call { site, .. }
                    | Op::Map { site, .. }
                    | Op::Fold { site, .. }
                    | Op::Mem { site, .. }) = self.op(here.owner)
                    else {
                        break;
                    };
                    let home = self[here.owner].frame;
                    calls.push((home, *site, here.key.as_ref()));
                    f = home;
                }
                _ => f = self[here.owner].frame,
            }
        }
        let mut segments = Vec::new();
        for (home, site, key) in calls.into_iter().rev() {
            self.append_site(home, site, key, &[], &mut segments);
        }
        segments
    }

    /// Returns a choice's own keys.
    pub fn own_keys(&self, frame: FrameId, keys: &[Operand]) -> SmallVec<[Key; 2]> {
        keys.iter().filter_map(|k| Key::from_value(self.value(frame, *k))).collect()
    }

    /// Returns the address of a choice, observation or factor.
    pub fn address(&self, n: NodeId) -> Address {
        let frame = self[n].frame;
        let segments = match self.op(n) {
            Op::Draw { site, keys, .. } => {
                let own = self.own_keys(frame, keys);
                self.spell_site(frame, *site, &own)
            }
            Op::Observe { site, .. } | Op::Factor { site, .. } => {
                self.spell_site(frame, *site, &[])
            }
            _ => self.prefix(frame),
        };
        Address { segments }
    }

    /// Returns the address for which a node is executed: its own, or that of the choice
    /// or call around it.
    pub fn address_near(&self, n: NodeId) -> Address {
        let n = self.drawn_from(n).unwrap_or(n);
        let mut address = self.address(n);
        if address.segments.is_empty()
            && let Some(name) = self.name_of(n)
        {
            address.segments.push(AddressSegment { name, occurrence: 1, keys: Vec::new() });
        }
        address
    }

    /// Returns the choice or observation for which alone a nameless distribution is made.
    fn drawn_from(&self, n: NodeId) -> Option<NodeId> {
        let facts = self.slot_facts(n);
        let [user] = facts.users[..] else { return None };
        let user = n - facts.slot + user;
        let (Op::Draw { dist, .. } | Op::Observe { dist, .. }) = self.op(user) else {
            return None;
        };
        let made_for = matches!(dist, DistSpec::Value(Operand::Local(s)) if *s == facts.slot);
        (made_for && self.name_of(n).is_none()).then_some(user)
    }

    /// Returns the top-level name of a node.
    pub fn name_of(&self, n: NodeId) -> Option<Arc<str>> {
        if self[n].frame != FrameId::ROOT {
            return None;
        }
        let slot = Operand::Local(self.slot(n));
        self.code.globals.iter().find(|(_, o)| **o == slot).map(|(name, _)| Arc::clone(name))
    }

    /// Sorts choices by their position in the program: slot by slot and pass by pass,
    /// from the outside in.
    pub fn in_program_order(&self, targets: &[Target]) -> Vec<Target> {
        let mut keyed: Vec<_> = targets.iter().map(|t| (self.place(t.node), *t)).collect();
        keyed.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.element.cmp(&b.1.element)));
        keyed.into_iter().map(|(_, t)| t).collect()
    }

    /// Returns the slots and passes that lead to a node, from the outside in.
    fn place(&self, mut n: NodeId) -> SmallVec<[u64; 6]> {
        let mut place = SmallVec::new();
        while n != NodeId::NONE {
            let frame = &self[self[n].frame];
            place.push(u64::from((n - frame.base).0));
            // The entries of a `mem` function have no order.
            let entry = if matches!(frame.args, Arguments::Values(_)) { frame.path } else { 0 };
            place.extend([u64::from(frame.pass), entry]);
            n = frame.owner;
        }
        place.reverse();
        place
    }

    /// Sorts nodes frame by frame, in an order that depends on the state only; node
    /// numbers depend on its history.
    pub fn sort_by_place(&self, nodes: &mut [NodeId]) {
        let frame = |n: NodeId| self[n].frame;
        let mut frames: Vec<FrameId> = nodes.iter().map(|n| frame(*n)).collect();
        frames.sort_unstable();
        frames.dedup();
        let mut places: Vec<_> = frames.iter().map(|f| (self.place(self[*f].base), *f)).collect();
        places.sort_unstable();
        let ranks: FxHashMap<FrameId, usize> =
            places.into_iter().enumerate().map(|(rank, (_, f))| (f, rank)).collect();
        nodes.sort_unstable_by_key(|n| (ranks.get(&frame(*n)), *n));
    }
}
