//! Which of the choices each score reads, in one state (including a pending proposal).
//!
//! What an evaluation reads determines its course: if that is unchanged, so are its
//! course and its value, whatever the rest of the trace is. So two choices are
//! independent given the rest if no score reads both of them, in any state that they may
//! be in. What a score reads is found by following its operands, never by comparing
//! values: a value that is equal for two values of a choice may differ for a third.

use super::partition::Partition;
use crate::lang::code::Op;
use crate::trace::gradient::Given;
use crate::trace::node::*;
use crate::trace::store::Store;
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

type Inputs = SmallVec<[NodeId; 8]>;

/// The choices that a value depends on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label {
    /// One of the summed-out choices, which represents its group; [`NONE`] if there is
    /// none.
    pub site: u32,
    /// True if it depends on a choice that the kernel moves.
    pub moves: bool,
    /// All of the summed-out choices, if [`Sets`] are kept.
    pub set: u32,
}

const NOTHING: Label = Label { site: NONE, moves: false, set: 0 };

/// Sets of choices, by number; 0 is the empty one.
#[derive(Debug)]
pub(super) struct Sets {
    all: Vec<SmallVec<[u32; 4]>>,
    unions: FxHashMap<(u32, u32), u32>,
    /// True if a set has become too large.
    pub overflow: bool,
}

impl Sets {
    /// The largest set that is kept.
    const LARGEST: usize = 12;

    /// Creates the empty set, and the sets of one of `n` choices, which are numbered from
    /// 1.
    pub fn singletons(n: usize) -> Sets {
        let alone = (0..n as u32).map(|i| SmallVec::from_slice(&[i]));
        let all = std::iter::once(SmallVec::new()).chain(alone).collect();
        Sets { all, unions: FxHashMap::default(), overflow: false }
    }

    /// Returns the members of a set, in ascending order.
    pub fn members(&self, set: u32) -> &[u32] {
        &self.all[set as usize]
    }

    fn union(&mut self, a: u32, b: u32) -> u32 {
        if a == b || b == 0 || self.overflow {
            return a;
        }
        if a == 0 {
            return b;
        }
        let key = (a.min(b), a.max(b));
        if let Some(known) = self.unions.get(&key) {
            return *known;
        }
        let mut both = self.all[a as usize].clone();
        both.extend_from_slice(&self.all[b as usize]);
        both.sort_unstable();
        both.dedup();
        self.overflow |= both.len() > Self::LARGEST;
        let made = if both == self.all[a as usize] {
            a
        } else if both == self.all[b as usize] {
            b
        } else {
            self.all.push(both);
            self.all.len() as u32 - 1
        };
        self.unions.insert(key, made);
        made
    }
}

/// The progress of following a node.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Visit {
    Not,
    Open,
    Done,
}

/// The findings in one state.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Scores that depend on a choice: the node, and one choice of the group.
    pub scores: Vec<(NodeId, u32)>,
    /// Nodes that contain observations and factors which depend on a choice, and which
    /// exist for some of its values only or are other nodes in each state; with that
    /// choice.
    pub owners: FxHashMap<NodeId, u32>,
    /// The scores, and the nodes that contain some, that depend on choices, each with the
    /// set of choices, if sets are kept.
    pub factors: Vec<(NodeId, u32)>,
    /// The choices that observations and factors depend on.
    pub asked: Vec<NodeId>,
    /// True if what is read depends on choices that the kernel moves.
    pub structure_moves: bool,
    /// True if what is read, or which nodes exist, depends on choices that are summed out.
    pub structure_varies: bool,
    /// True if the distributions of choices that are summed out depend on choices that
    /// the kernel moves.
    pub values_move: bool,
    /// True if observations are made in a `mem` function: any choice may decide whether
    /// they exist.
    pub anywhere: bool,
    /// True if the existence of observations depends on choices in a way that is not
    /// tracked.
    pub unclear: bool,
}

impl Found {
    /// Records that what is below a node depends on a choice; all such choices are in one
    /// group.
    pub fn own(&mut self, owner: NodeId, site: u32, partition: &mut Partition) {
        let first = *self.owners.entry(owner).or_insert(site);
        partition.join(first, site);
    }
}

pub(super) struct Reader<'a> {
    graph: &'a Store,
    /// Choices that are summed out, and those that move.
    own: &'a FxHashMap<NodeId, Label>,
    partition: &'a mut Partition,
    seen: Vec<Visit>,
    labels: Vec<Label>,
    pub found: Found,
    pub sets: Option<Sets>,
}

impl<'a> Reader<'a> {
    pub fn new(
        graph: &'a Store,
        own: &'a FxHashMap<NodeId, Label>,
        partition: &'a mut Partition,
    ) -> Self {
        let n = graph.len();
        let (seen, labels) = (vec![Visit::Not; n], vec![NOTHING; n]);
        let found = Found::default();
        Reader { graph, own, partition, seen, labels, found, sets: None }
    }

    /// Returns through which of their values, given by their indices, the choices determine
    /// each node, if sets are kept; `None` for nodes whose existence depends on some, or that
    /// depend on too many to tell.
    pub fn given(&mut self, indices: &[usize]) -> FxHashMap<NodeId, Option<Given>> {
        let all: Vec<NodeId> = self.graph.clean().collect();
        let at = |x: &u32| (*x, indices[*x as usize] as u32);
        all.into_iter().map(|n| (n, self.reads(n).map(|x| x.iter().map(at).collect()))).collect()
    }

    fn reads(&mut self, n: NodeId) -> Option<&[u32]> {
        let (label, placed) = (self.visit(n), self.placed(n).0);
        let sets = self.sets.as_ref().filter(|s| !s.overflow && placed.site == NONE)?;
        Some(sets.members(label.set))
    }

    /// Follows every score, and merges the groups of choices that one score reads.
    /// `choices` are those of the trace.
    pub fn read_all(&mut self, choices: impl Iterator<Item = NodeId>) {
        for n in self.graph.clean().filter(|n| self.graph.slot_facts(*n).is_effect) {
            self.read_effect(n);
        }
        let asked = self.found.asked.len();
        // Held choices have scores too, even if nothing depends on them.
        for n in choices {
            self.visit(n);
        }
        self.found.asked.truncate(asked);
    }

    /// Returns the choices that the distribution of a choice depends on.
    pub fn origins(&self, n: NodeId) -> Vec<NodeId> {
        let (mut open, mut seen, mut found) = (self.inputs(n), FxHashSet::default(), Vec::new());
        while let Some(d) = open.pop() {
            if seen.insert(d) {
                match self.graph.op(d) {
                    Op::Draw { .. } => found.push(d),
                    _ => open.extend(self.inputs(d)),
                }
            }
        }
        found
    }

    /// Returns what the nodes on the stack of a failed evaluation depend on.
    pub fn read_failed(&mut self, stack: &[NodeId]) -> Label {
        let mut label = NOTHING;
        for n in stack {
            let (placed, _) = self.placed(*n);
            label = self.join(label, placed);
            for d in self.inputs(*n) {
                if self.graph[d].state == State::Clean {
                    let read = self.visit(d);
                    label = self.join(label, read);
                }
            }
        }
        label
    }

    /// Follows an effect: an observation, a factor, or a node that contains some.
    fn read_effect(&mut self, n: NodeId) {
        let read = self.visit(n);
        let (placed, owner) = self.placed(n);
        let is_score = matches!(self.graph.op(n), Op::Observe { .. } | Op::Factor { .. });
        let own = if is_score { read } else { self.decided(n) };
        let label = self.join(own, placed);
        if label.site != NONE {
            self.found.factors.push((owner.unwrap_or(n), label.set));
        }
        match owner {
            _ if label.site == NONE => {}
            Some(owner) => self.found.own(owner, label.site, self.partition),
            None if is_score => self.found.scores.push((n, label.site)),
            None => self.found.own(n, label.site, self.partition),
        }
    }

    fn join(&mut self, a: Label, b: Label) -> Label {
        if a.site != NONE && b.site != NONE {
            self.partition.join(a.site, b.site);
        }
        let set = self.sets.as_mut().map_or(0, |sets| sets.union(a.set, b.set));
        Label { site: a.site.min(b.site), moves: a.moves || b.moves, set }
    }

    /// Returns what a node's value depends on.
    fn visit(&mut self, root: NodeId) -> Label {
        if self.seen[root] != Visit::Not {
            return self.labels[root];
        }
        let mut stack: Vec<(NodeId, Inputs, usize, Label)> =
            vec![(root, self.inputs(root), 0, NOTHING)];
        self.seen[root] = Visit::Open;
        while let Some((n, inputs, next, label)) = stack.last_mut() {
            if let Some(input) = inputs.get(*next).copied() {
                if self.seen[input] == Visit::Not {
                    self.seen[input] = Visit::Open;
                    let inner = self.inputs(input);
                    stack.push((input, inner, 0, NOTHING));
                } else {
                    *next += 1;
                    let (own, read) = (*label, self.labels[input]);
                    let joined = self.join(own, read);
                    if let Some((_, _, _, label)) = stack.last_mut() {
                        *label = joined;
                    }
                }
                continue;
            }
            let (n, read) = (*n, *label);
            stack.pop();
            self.labels[n] = self.ended(n, read);
            self.seen[n] = Visit::Done;
        }
        self.labels[root]
    }

    /// Returns what the value of a node depends on, given what its inputs depend on.
    fn ended(&mut self, n: NodeId, read: Label) -> Label {
        if !matches!(self.graph.op(n), Op::Draw { .. }) {
            let open = read.moves && !self.found.structure_moves
                || read.site != NONE && !self.found.structure_varies;
            if open {
                let decided = self.decided(n);
                self.found.structure_moves |= decided.moves;
                self.found.structure_varies |= decided.site != NONE;
            }
            return read;
        }
        let own = self.own.get(&n).copied().unwrap_or(NOTHING);
        self.found.asked.push(n);
        self.found.values_move |= own.site != NONE && read.moves;
        let decided = self.decided(n);
        self.found.structure_moves |= decided.moves;
        self.found.structure_varies |= decided.site != NONE;
        let score = self.join(own, read);
        if score.site != NONE {
            self.found.scores.push((n, score.site));
            self.found.factors.push((n, score.set));
        }
        // A choice keeps its value whatever its distribution becomes, except white noise,
        // whose value depends on its parameters.
        if self.graph.is_whitened(n) { score } else { own }
    }

    /// Returns all nodes that a node's value or structure is computed from.
    fn inputs(&self, n: NodeId) -> Inputs {
        let (g, mut all) = (self.graph, Inputs::new());
        g.each_dep(n, |d, _| all.push(d));
        let frame = &g[g[n].frame];
        let of_a_pass = match g.op(n) {
            Op::Item => true,
            Op::Param { .. } => matches!(frame.args, Arguments::Item | Arguments::Fold),
            _ => false,
        };
        if of_a_pass && frame.owner != NodeId::NONE {
            let home = g[frame.owner].frame;
            g.op(frame.owner).operands(|o| all.extend(g.resolve(home, o)));
            if let Some(Side::Loop(l)) = g[frame.owner].side.as_deref() {
                all.extend(l.deps.iter().copied());
            }
        }
        all
    }

    /// Returns what decides which nodes a node reads, and which of them exist.
    fn decided(&mut self, n: NodeId) -> Label {
        let mut all = Inputs::new();
        self.graph.deciders(n, |d| all.push(d));
        let mut label = NOTHING;
        for d in all {
            let read = self.visit(d);
            label = self.join(label, read);
        }
        label
    }

    /// Returns what decides whether a node exists, and the outermost node around it for
    /// which a choice, summed out or moving, decides that: frames created for a proposal
    /// have other nodes each time.
    fn placed(&mut self, n: NodeId) -> (Label, Option<NodeId>) {
        let (mut label, mut outermost, mut in_memo) = (NOTHING, None, false);
        let mut owner = self.graph[self.graph[n].frame].owner;
        while owner != NodeId::NONE {
            let mut decided = self.decided(owner);
            if matches!(self.graph.op(owner), Op::Mem { .. }) {
                // Its entries exist for calls that may be anywhere, so every choice may
                // decide.
                self.found.anywhere = true;
                decided.site = 0;
            }
            if decided.site != NONE || decided.moves {
                self.found.unclear |= in_memo;
                outermost = Some(owner);
            }
            in_memo |= matches!(self.graph.op(owner), Op::Mem { .. });
            label = self.join(label, decided);
            owner = self.graph[self.graph[owner].frame].owner;
        }
        self.found.structure_moves |= label.moves;
        self.found.structure_varies |= label.site != NONE;
        (label, outermost)
    }
}
