//! From nodes to addresses. Frames store a hash of their prefix; the address itself is
//! built on request.

use super::graph::Graph;
use super::node::*;
use crate::lang::address::{Address, AddressSegment};
use crate::lang::code::{BlockKind, Code, DistSpec, Op, Operand, Site};
use crate::lang::key::{Key, mix};
use smallvec::SmallVec;
use std::sync::Arc;

impl Graph {
    /// The keys of the loops around a frame, up to its function, outermost first, without
    /// those that the site's target carries.
    fn loop_keys(&self, code: &Code, frame: FrameId, carried: u32) -> SmallVec<[Key; 2]> {
        let mut keys = SmallVec::new();
        let mut level = 0;
        let mut f = frame;
        loop {
            let here = &self.frames[f as usize];
            match code.blocks[here.block as usize].kind {
                BlockKind::Loop => {
                    if carried & (1 << level) == 0 {
                        keys.extend(here.key.clone());
                    }
                    level += 1;
                }
                BlockKind::Branch => {}
                _ => break,
            }
            f = self.nodes[here.owner as usize].frame;
        }
        keys.reverse();
        keys
    }

    /// Returns the hash of the path through a site.
    pub fn site_hash(&self, code: &Code, frame: FrameId, site: u32) -> u64 {
        self.hash_site(code, frame, &code.sites[site as usize], None, &[])
    }

    /// [`Graph::site_hash`] for an element of a `map` or an entry of `mem`.
    pub fn keyed_site_hash(&self, code: &Code, frame: FrameId, site: u32, key: &Key) -> u64 {
        self.hash_site(code, frame, &code.sites[site as usize], Some(key), &[])
    }

    /// [`Graph::site_hash`] for a choice with its own keys.
    pub fn own_keyed_hash(&self, code: &Code, frame: FrameId, site: u32, own: &[Key]) -> u64 {
        self.hash_site(code, frame, &code.sites[site as usize], None, own)
    }

    fn hash_site(
        &self,
        code: &Code,
        frame: FrameId,
        site: &Site,
        element: Option<&Key>,
        own: &[Key],
    ) -> u64 {
        let last = site.segments.len().saturating_sub(1);
        let mut h = self.frames[frame as usize].path;
        for (i, s) in site.segments.iter().enumerate() {
            h = mix(h, s.hash);
            if i == 0 {
                h = self.loop_keys(code, frame, site.carried).iter().fold(h, |h, k| k.hash_into(h));
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

    /// Returns the address through a site; mirrors [`Graph::hash_site`].
    fn spell_site(
        &self,
        code: &Code,
        frame: FrameId,
        site: u32,
        own: &[Key],
    ) -> Vec<AddressSegment> {
        let mut segments = self.prefix(code, frame);
        self.append_site(code, frame, site, None, own, &mut segments);
        segments
    }

    /// Appends the segments that a site adds.
    fn append_site(
        &self,
        code: &Code,
        frame: FrameId,
        site: u32,
        element: Option<&Key>,
        own: &[Key],
        segments: &mut Vec<AddressSegment>,
    ) {
        let site = &code.sites[site as usize];
        let last = site.segments.len().saturating_sub(1);
        for (i, s) in site.segments.iter().enumerate() {
            let mut keys = Vec::new();
            if i == 0 {
                keys.extend(self.loop_keys(code, frame, site.carried));
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
    fn prefix(&self, code: &Code, frame: FrameId) -> Vec<AddressSegment> {
        let mut calls = Vec::new();
        let mut f = frame;
        loop {
            let here = &self.frames[f as usize];
            match code.blocks[here.block as usize].kind {
                BlockKind::Root => break,
                // A function that a plan calls.
                _ if here.owner == NONE => break,
                BlockKind::Function { .. } => {
                    let (Op::Call { site, .. }
                    | Op::Map { site, .. }
                    | Op::Fold { site, .. }
                    | Op::Mem { site, .. }) = self.op(code, here.owner)
                    else {
                        break;
                    };
                    let home = self.nodes[here.owner as usize].frame;
                    calls.push((home, *site, here.key.as_ref()));
                    f = home;
                }
                _ => f = self.nodes[here.owner as usize].frame,
            }
        }
        let mut segments = Vec::new();
        for (home, site, key) in calls.into_iter().rev() {
            self.append_site(code, home, site, key, &[], &mut segments);
        }
        segments
    }

    /// Returns a choice's own keys.
    pub fn own_keys(&self, code: &Code, frame: FrameId, keys: &[Operand]) -> SmallVec<[Key; 2]> {
        keys.iter().filter_map(|k| Key::from_value(self.value(code, frame, *k))).collect()
    }

    /// Returns the address of a choice, observation or factor.
    pub fn address(&self, code: &Code, n: NodeId) -> Address {
        let frame = self.nodes[n as usize].frame;
        let segments = match self.op(code, n) {
            Op::Draw { site, keys, .. } => {
                let own = self.own_keys(code, frame, keys);
                self.spell_site(code, frame, *site, &own)
            }
            Op::Observe { site, .. } | Op::Factor { site, .. } => {
                self.spell_site(code, frame, *site, &[])
            }
            _ => self.prefix(code, frame),
        };
        Address { segments }
    }

    /// Returns the address for which a node is executed: its own, or that of the choice
    /// or call around it.
    pub fn address_near(&self, code: &Code, n: NodeId) -> Address {
        let n = self.drawn_from(code, n).unwrap_or(n);
        let mut address = self.address(code, n);
        if address.segments.is_empty()
            && let Some(name) = self.name_of(code, n)
        {
            address.segments.push(AddressSegment { name, occurrence: 1, keys: Vec::new() });
        }
        address
    }

    /// Returns the choice or observation for which alone a nameless distribution is made.
    fn drawn_from(&self, code: &Code, n: NodeId) -> Option<NodeId> {
        let facts = self.slot_facts(code, n);
        let [user] = facts.users[..] else { return None };
        let user = n - facts.slot + user;
        let (Op::Draw { dist, .. } | Op::Observe { dist, .. }) = self.op(code, user) else {
            return None;
        };
        let made_for = matches!(dist, DistSpec::Value(Operand::Local(s)) if *s == facts.slot);
        (made_for && self.name_of(code, n).is_none()).then_some(user)
    }

    /// Returns the top-level name of a node.
    pub fn name_of(&self, code: &Code, n: NodeId) -> Option<Arc<str>> {
        if self.nodes[n as usize].frame != 0 {
            return None;
        }
        let slot = Operand::Local(self.slot(n));
        code.globals.iter().find(|(_, o)| **o == slot).map(|(name, _)| Arc::clone(name))
    }
}
