//! Changes of choices that are summed out, without updates: what one of them changes as it goes
//! from one value to another is learnt from the first update that does this, and written in
//! place from then on.
//!
//! An update writes nodes, which the choice owns, and references to nodes that these read, which
//! are lent. Invariant: a node has one owner, and what is lent has no other owner and is never
//! without references. So no change of another choice changes what a change writes: if a node
//! depended on two choices, the last node on the way from it to one of them that the other owns
//! would read a node that is lent to the one and belongs to the other.

use crate::lang::tape::ScoreSums;
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::{Change, Draws, Target, Trace, Weight};
use pcadlang_numerics::dist::Datum;
use rustc_hash::{FxHashMap, FxHashSet};

/// How many nodes are kept for each node of a trace.
const MOST: usize = 8;

/// A choice, by number, and the indices of the values that it leaves and takes.
pub(super) type FromTo = (u32, u32, u32);

/// The changes learnt so far.
#[derive(Debug)]
pub(super) struct Flips {
    known: FxHashMap<FromTo, Flip>,
    marks: FxHashMap<NodeId, Mark>,
    /// Nodes to which a tape gives more than one number.
    others: FxHashSet<NodeId>,
    /// How many nodes are kept.
    kept: usize,
}

/// One change: what nodes are after it, and references that they acquire or release.
#[derive(Debug, Default)]
struct Flip {
    nodes: Vec<(NodeId, Image)>,
    references: Vec<Reference>,
}

/// The plain fields of a node, and its side if that is a list of nodes.
#[derive(Debug)]
struct Image {
    value: Value,
    score: f64,
    state: State,
    flags: u8,
    deps: Option<Deps>,
}

#[derive(Clone, Copy, Debug)]
struct Reference {
    user: NodeId,
    to: NodeId,
    outside: bool,
    acquired: bool,
    lent: bool,
}

/// The choices that a node has to do with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mark {
    Owned(u32),
    Lent(u32),
    LentToSome,
}

impl Image {
    fn of(graph: &Graph, n: NodeId) -> Image {
        let Node { value, score, state, flags, .. } = &graph.store[n];
        let deps = match graph.store[n].side.as_deref() {
            Some(Side::Deps(deps)) => Some(deps.clone()),
            _ => None,
        };
        Image { value: value.clone(), score: *score, state: *state, flags: flags & !SAVED, deps }
    }

    fn same(&self, other: &Image) -> bool {
        let plain = |i: &Image| (i.score.to_bits(), i.state, i.flags);
        plain(self) == plain(other) && self.deps == other.deps && self.value.same(&other.value)
    }

    fn put(&self, node: &mut Node) {
        node.value.clone_from(&self.value);
        (node.score, node.state, node.flags) = (self.score, self.state, self.flags);
        match (node.side.as_deref_mut(), &self.deps) {
            (Some(Side::Deps(here)), Some(deps)) => here.clone_from(deps),
            (None, Some(deps)) => node.side = Some(Box::new(Side::Deps(deps.clone()))),
            (Some(Side::Deps(_)), None) => node.side = None,
            _ => {}
        }
    }
}

/// The nodes that a node holds, and whether each is of another frame.
fn held(graph: &Graph, n: NodeId) -> Vec<(NodeId, bool)> {
    let mut all = Vec::new();
    if graph.store[n].flags & HELD != 0 {
        graph.each_dep(n, |d, outside| all.push((d, outside)));
    }
    all
}

impl Flips {
    /// None so far; the tape gives these nodes more than one number.
    pub fn new(others: FxHashSet<NodeId>) -> Flips {
        let (known, marks) = Default::default();
        Flips { known, marks, others, kept: 0 }
    }

    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.known.len()
    }

    /// Learns a change and the way back from an update of the trace, which stays as it is.
    /// False if that is not possible here; `None` if changes cannot be written at all.
    pub fn learn(
        &mut self,
        trace: &mut Trace,
        (choice, from, to): FromTo,
        (target, value): (Target, &Datum),
        draws: Draws,
    ) -> Option<bool> {
        if self.known.contains_key(&(choice, from, to)) {
            return Some(true);
        }
        let possible = |w: Weight| w.appeared + w.vanished == 0 && w.log_joint.is_finite();
        let full = self.kept > MOST * trace.graph.store.len();
        let change = [(target, Change::Set(value.clone()))];
        if full || !trace.propose(&change, draws).is_ok_and(possible) {
            trace.rollback();
            return Some(false);
        }
        let (mut nodes, mut plain, mut references) = (Vec::new(), true, FxHashMap::default());
        let is_plain = |side: Option<&Side>| matches!(side, None | Some(Side::Deps(_)));
        for entry in trace.graph.update.journal() {
            match entry {
                Entry::Node { id, .. } => nodes.push(*id),
                Entry::Acquired(n, _) | Entry::Released(n, _) => {
                    references.insert(*n, i64::from(trace.graph.store[*n].refs));
                }
                Entry::Side(n, old) => {
                    let now = trace.graph.store[*n].side.as_deref();
                    plain &= is_plain(old.as_deref()) && is_plain(now);
                }
                _ => plain = false,
            }
        }
        let show = |trace: &Trace| {
            let one = |n: &NodeId| (Image::of(&trace.graph, *n), held(&trace.graph, *n));
            nodes.iter().map(one).collect::<Vec<_>>()
        };
        let after = show(trace);
        trace.rollback();
        let before = show(trace);
        let all = nodes.into_iter().zip(before.into_iter().zip(after));
        let all: Vec<_> = all.filter(|(_, ((b, _), (a, _)))| !b.same(a)).collect();
        if !plain || !all.iter().all(|(n, _)| self.own(*n, choice)) {
            return None;
        }
        let (mut there, mut back) = (Flip::default(), Flip::default());
        for (user, ((before, old), (after, new))) in all {
            for (acquired, some, others) in [(false, &old, &new), (true, &new, &old)] {
                let mut others = others.clone();
                for (to, outside) in some {
                    let lent = self.lend(*to, choice)?;
                    if let Some(i) = others.iter().position(|one| one == &(*to, *outside)) {
                        others.swap_remove(i);
                        continue;
                    }
                    let one = Reference { user, to: *to, outside: *outside, acquired, lent };
                    there.references.push(one);
                    back.references.push(Reference { acquired: !acquired, ..one });
                    *references.entry(*to).or_insert(i64::from(trace.graph.store[*to].refs)) -=
                        if acquired { 1 } else { -1 };
                }
            }
            back.nodes.push((user, before));
            there.nodes.push((user, after));
        }
        // Otherwise something else holds or releases nodes.
        if references.iter().any(|(n, refs)| *refs != i64::from(trace.graph.store[*n].refs)) {
            return None;
        }
        self.kept += 2 * there.nodes.len();
        self.known.insert((choice, from, to), there);
        self.known.insert((choice, to, from), back);
        Some(true)
    }

    /// Lets a choice own a node; false if it has to do with another choice, or is given more
    /// than one number.
    fn own(&mut self, n: NodeId, choice: u32) -> bool {
        let mark = self.marks.entry(n).or_insert(Mark::Owned(choice));
        let free = matches!(mark, Mark::Owned(c) | Mark::Lent(c) if *c == choice);
        *mark = Mark::Owned(choice);
        free && !self.others.contains(&n)
    }

    /// Lends a node to a choice, unless that owns it: then false. `None` if another does.
    fn lend(&mut self, n: NodeId, choice: u32) -> Option<bool> {
        let mark = self.marks.entry(n).or_insert(Mark::Lent(choice));
        match mark {
            Mark::Owned(c) => (*c == choice).then_some(false),
            Mark::Lent(c) if *c == choice => Some(true),
            _ => {
                *mark = Mark::LentToSome;
                Some(true)
            }
        }
    }

    /// Writes changes that are known, one of each choice. False, with the trace as it was, if
    /// nothing would hold a node that is lent.
    pub fn write(&self, graph: &mut Graph, changes: &[FromTo]) -> bool {
        let flips = || changes.iter().filter_map(|c| self.known.get(c));
        let references = || flips().flat_map(|f| &f.references);
        let count = |graph: &mut Graph, undo: bool| {
            for r in references() {
                let refs = &mut graph.store[r.to].refs;
                *refs =
                    if r.acquired == undo { refs.wrapping_sub(1) } else { refs.wrapping_add(1) };
            }
        };
        count(graph, false);
        if references().any(|r| r.lent && !r.acquired && graph.store[r.to].refs == 0) {
            count(graph, true);
            return false;
        }
        let mut untidy = Vec::new();
        for r in references().filter(|r| r.outside) {
            if r.acquired {
                graph.store.add_outside(r.to, r.user);
            } else {
                let list = graph.store.outside_mut(r.to);
                list.gone += 1;
                if list.is_untidy() && list.gone > 8 {
                    untidy.push(r.to);
                }
            }
        }
        let (mut old, mut new) = (ScoreSums::default(), ScoreSums::default());
        for (n, image) in flips().flat_map(|f| &f.nodes) {
            for (sums, after) in [(&mut old, false), (&mut new, true)] {
                if after {
                    image.put(&mut graph.store[*n]);
                }
                let facts = graph.slot_facts(*n);
                if (facts.is_draw || facts.is_effect) && graph.store[*n].state == State::Clean {
                    graph.put_scored(*n, &mut sums.prior, &mut sums.likelihood);
                }
            }
        }
        new.replace(&old, &mut graph.score.prior, &mut graph.score.likelihood);
        untidy.into_iter().for_each(|n| graph.store.tidy(n));
        true
    }
}
