//! Registering choices and selections, and what selectors need to know of a choice.

use super::propagate::Failure;
use crate::lang::address::Address;
use crate::lang::code::{Code, Op};
use crate::lang::error::FaultKind;
use crate::lang::key::Key;
use crate::trace::choices::{Members, Selection, Target};
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::select::{Facts, Selector};
use pcadlang_numerics::dist::{Dist, Support};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::sync::Arc;

impl Graph {
    /// Registers a selection, or returns the one already registered for this selector.
    pub fn selection(&mut self, code: &Code, selector: &Selector) -> Selection {
        if let Some(i) = self.choices.selections.iter().position(|m| m.selector == *selector) {
            return Selection(i as u32);
        }
        let all = self.choices.selections[0].listed.clone();
        let listed =
            all.0.iter().zip(all.1.iter()).filter(|(_, t)| self.selects(code, selector, t));
        let (hashes, targets) = listed.map(|(hash, t)| (*hash, *t)).unzip();
        let members = Members::new(selector.clone(), hashes, targets);
        self.choices.selections.push(members);
        Selection(self.choices.selections.len() as u32 - 1)
    }

    /// Whether a selector selects a choice.
    pub fn selects(&self, code: &Code, selector: &Selector, t: &Target) -> bool {
        let mut facts = self.facts(code, t.node, selector.needs_address(), None);
        if t.element != NONE && selector.needs_address() {
            push_key(&mut facts.address, t.element);
        }
        selector.selects(&facts)
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
        while n != NONE {
            let frame = &self.frames[self.nodes[n as usize].frame as usize];
            place.push(u64::from(n - frame.base));
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
        let frame = |n: NodeId| self.nodes[n as usize].frame;
        let mut frames: Vec<u32> = nodes.iter().map(|n| frame(*n)).collect();
        frames.sort_unstable();
        frames.dedup();
        let mut places: Vec<_> =
            frames.iter().map(|f| (self.place(self.frames[*f as usize].base), *f)).collect();
        places.sort_unstable();
        let ranks: FxHashMap<u32, usize> =
            places.into_iter().enumerate().map(|(rank, (_, f))| (f, rank)).collect();
        nodes.sort_unstable_by_key(|n| (ranks.get(&frame(*n)), *n));
    }

    /// Returns the facts that selectors need about a choice (or an observation, for
    /// `project`).
    pub fn facts(&self, code: &Code, n: NodeId, with_address: bool, dist: Option<&Dist>) -> Facts {
        let made = if dist.is_none() { self.dist_of(code, n) } else { None };
        let dist = dist.or(made.as_ref());
        let support = dist.map(Dist::stored_support);
        Facts {
            choice: matches!(self.op(code, n), Op::Draw { .. }),
            address: if with_address { self.address(code, n) } else { Address::default() },
            tags: self.tags(code, n),
            discrete: support.as_ref().is_some_and(Support::has_discrete_part),
            finite: support.as_ref().is_some_and(Support::is_finite),
            gaussian: dist.is_some_and(Dist::is_gaussian),
        }
    }

    /// Returns the distribution of a choice under the current values of its parameters.
    pub fn dist_of(&self, code: &Code, n: NodeId) -> Option<Dist> {
        let Op::Draw { dist, .. } = self.op(code, n) else { return None };
        if let Some(simple) = self.simple_dist(code, n) {
            return Some(simple);
        }
        let frame = self.nodes[n as usize].frame;
        self.make_dist(code, n, frame, dist, &mut Deps::new()).ok()
    }

    fn tags(&self, code: &Code, n: NodeId) -> Vec<(Arc<str>, Option<Key>)> {
        let mut tags = Vec::new();
        let mut node = n;
        loop {
            let frame = self.nodes[node as usize].frame;
            let (Op::Draw { site, .. }
            | Op::Call { site, .. }
            | Op::Map { site, .. }
            | Op::Fold { site, .. }
            | Op::Mem { site, .. }) = self.op(code, node)
            else {
                let owner = self.frames[frame as usize].owner;
                if owner == NONE {
                    return tags;
                }
                node = owner;
                continue;
            };
            for t in &code.sites[*site as usize].tags {
                let value = t.value.and_then(|o| Key::from_value(self.value(code, frame, o)));
                tags.push((Arc::clone(&code.tags[t.name as usize]), value));
            }
            match self.frames[frame as usize].owner {
                NONE => return tags,
                owner => node = owner,
            }
        }
    }

    /// Registers a new choice.
    pub fn register_choice(
        &mut self,
        code: &Code,
        n: NodeId,
        hash: u64,
        elements: Option<usize>,
        dist: &Dist,
    ) -> Result<(), Failure> {
        if let Some(old) = self.choices.by_address.insert(hash, n)
            && old != n
        {
            self.choices.suspects.push((old, n));
            self.note(Entry::AddressShadowed(hash, old));
        }
        self.note(Entry::ChoiceAdded(n, hash));
        let needs_facts = self.choices.selections.len() > 1;
        let needs_address = self.choices.selections.iter().any(|m| m.selector.needs_address());
        let mut facts = needs_facts.then(|| self.facts(code, n, needs_address, Some(dist)));
        for i in 0..self.choices.selections.len() {
            for e in 0..elements.unwrap_or(1) {
                let element = if elements.is_some() { e as u32 } else { NONE };
                let selected = match &mut facts {
                    None => true,
                    Some(f) if element != NONE && needs_address => {
                        push_key(&mut f.address, element);
                        let yes = self.choices.selections[i].selector.selects(f);
                        pop_key(&mut f.address);
                        yes
                    }
                    Some(f) => self.choices.selections[i].selector.selects(f),
                };
                if selected {
                    self.choices.selections[i].added.push((hash, Target { node: n, element }));
                }
            }
        }
        Ok(())
    }

    /// Removes a choice from the register.
    pub fn unregister_choice(&mut self, n: NodeId, hash: u64) {
        if self.choices.by_address.get(&hash) == Some(&n) {
            self.choices.by_address.remove(&hash);
            self.note(Entry::ChoiceRemoved(n, hash));
        }
        for m in &mut self.choices.selections {
            let before = m.added.len();
            m.added.retain(|(_, t)| t.node != n);
            if m.added.len() == before {
                m.removed.push((hash, n));
            }
        }
    }

    /// Ends an update: updates the members of selections, and fails at the second of two
    /// choices with the same address.
    pub fn update_selections(&mut self, code: &Code) -> Result<(), Failure> {
        for i in 0..self.choices.selections.len() {
            if let Some(before) = self.choices.selections[i].apply() {
                self.note(Entry::TargetsReplaced { selection: i as u32, before });
            }
        }
        self.check_duplicates(code)
    }

    /// Fails if two choices have the same address, at the second of them.
    fn check_duplicates(&mut self, code: &Code) -> Result<(), Failure> {
        for (old, new) in std::mem::take(&mut self.choices.suspects) {
            let alive = |n: NodeId| self.nodes[n as usize].state != State::Empty;
            if alive(old) && alive(new) {
                let message = format!("a second choice at the address {}", self.address(code, new));
                let hint = Some("give each choice its own name or key".to_owned());
                return Err(self.fail(code, new, FaultKind::Duplicate, message, hint));
            }
        }
        Ok(())
    }
}

pub(crate) fn push_key(address: &mut Address, element: u32) {
    if let Some(last) = address.segments.last_mut() {
        last.keys.push(Key::Num(f64::from(element).to_bits()));
    }
}

fn pop_key(address: &mut Address) {
    if let Some(last) = address.segments.last_mut() {
        last.keys.pop();
    }
}
