//! Exploration: which choices share a score, and which scores those are, at one point of
//! the other choices.
//!
//! A partition of the choices is valid if no score reads choices of two groups, in any
//! joint state. To check that, it is enough to evaluate every joint value of each group
//! once, whatever the values of the other groups: a score that reads only its own group
//! there behaves in the same way for all values of the others ([`super::reads`]). If a
//! score reads two groups under some assignment, the groups are merged and the
//! exploration starts again.

use super::partition::Partition;
use super::reads::{Found, Label, Reader};
use super::{Elimination, Group, Marginal};
use crate::lang::code::Op;
use crate::lang::error::FaultKind;
use crate::trace::node::*;
use crate::trace::{Change, Draws, Target, Trace, TraceResult, Weight};
use rustc_hash::{FxHashMap, FxHashSet};

/// The maximum number of joint values of one group.
const MOST_VALUES: usize = 1000;

/// The result of exploring the joint values.
pub enum Explored {
    /// All joint values have the same choices.
    Elimination(Elimination),
    /// These changes make choices appear or vanish.
    Structure(Vec<(Target, Change)>),
    /// The program fails here whatever the values of the choices, some choices are never
    /// needed, or the supports are different.
    Impossible,
}

/// The choices that are needed under some assignment.
#[derive(Default)]
struct Requested {
    by_scores: FxHashSet<NodeId>,
    /// By choice: the choices that its distribution depends on.
    by_choice: FxHashMap<NodeId, FxHashSet<NodeId>>,
}

impl Requested {
    fn enter(&mut self, reader: &Reader, choices: &[Target]) {
        self.by_scores.extend(&reader.found.asked);
        for t in choices {
            self.by_choice.entry(t.node).or_default().extend(reader.origins(t.node));
        }
    }

    /// True if each of these is needed, under some assignment, by a score or by a choice
    /// that is needed.
    fn has_all(&self, choices: &[Target]) -> bool {
        let mut all = self.by_scores.clone();
        let mut open: Vec<NodeId> = all.iter().copied().collect();
        while let Some(n) = open.pop() {
            let more = self.by_choice.get(&n).into_iter().flatten().copied();
            open.extend(more.filter(|d| all.insert(*d)));
        }
        choices.iter().all(|t| all.contains(&t.node))
    }
}

/// The joint values of the groups, and the assignment in which each occurred.
struct Table {
    groups: Vec<Group>,
    /// By choice: its group.
    group_of: Vec<usize>,
    /// By group: the next value to evaluate, and a value at which the program does not
    /// fail.
    next: Vec<usize>,
    fine: Vec<Option<usize>>,
    assignments: Vec<Vec<usize>>,
}

impl Table {
    fn new(m: &Marginal, partition: &Partition) -> Result<Table, usize> {
        let mut t = Table {
            groups: vec![],
            group_of: vec![],
            next: vec![],
            fine: vec![],
            assignments: vec![],
        };
        let mut places = FxHashMap::default();
        for (i, values) in m.values.iter().enumerate() {
            let place = *places.entry(partition.root(i as u32)).or_insert_with(|| {
                t.groups.push(Group { values: 1, ..Group::default() });
                t.groups.len() - 1
            });
            let group = &mut t.groups[place];
            group.values = group.values.saturating_mul(values.len());
            group.sites.push(i);
            t.group_of.push(place);
            if group.values > MOST_VALUES {
                return Err(i);
            }
        }
        t.groups.iter_mut().for_each(|g| g.seen = vec![None; g.values]);
        (t.next, t.fine) = (vec![0; t.groups.len()], vec![None; t.groups.len()]);
        Ok(t)
    }

    /// Returns a value for each group, at least one of them not evaluated yet; `None` if
    /// all have been.
    fn next(&self) -> Option<Vec<usize>> {
        let open = |i: &usize| self.next[*i] < self.groups[*i].values;
        let value = |i: usize| if open(&i) { self.next[i] } else { self.fine[i].unwrap_or(0) };
        let any = (0..self.groups.len()).any(|i| open(&i));
        (any || self.assignments.is_empty()).then(|| (0..self.groups.len()).map(value).collect())
    }

    /// Records an assignment at which the program does not fail.
    fn enter(&mut self, look: Vec<usize>) {
        for (i, v) in look.iter().enumerate() {
            if self.next[i] == *v {
                self.groups[i].seen[*v] = Some(self.assignments.len());
                self.next[i] += 1;
                self.fine[i] = Some(*v);
            }
        }
        self.assignments.push(look);
    }

    /// Records that a group cannot have its value in an assignment; false if no possible
    /// value remains.
    fn leave_out(&mut self, group: usize, look: &[usize]) -> bool {
        // If the value was possible with other values of the other groups, the partition
        // does not cover this failure.
        let open = self.next[group] == look[group];
        self.next[group] += usize::from(open);
        open && (self.next[group] < self.groups[group].values || self.fine[group].is_some())
    }
}

impl Trace {
    /// Evaluates the joint values of the choices at a point, to which the changes `at`
    /// lead. With `strict`, choices may exist that nothing needs. A proposal may be
    /// pending afterwards.
    ///
    /// # Errors
    /// If the possible values of a choice depend on other choices, if which other choices
    /// exist depends on one in a way that cannot be undone, or if too many depend on each
    /// other; or if the program fails.
    pub fn explore(
        &mut self,
        at: &[(Target, Change)],
        strict: bool,
        m: &mut Marginal,
        draws: Draws,
    ) -> TraceResult<Explored> {
        let mut own: FxHashMap<NodeId, Label> =
            m.moving.iter().map(|n| (*n, Label { site: NONE, moves: true, set: 0 })).collect();
        for (i, t) in m.sites.iter().enumerate() {
            let label = own.entry(t.node).or_insert(Label { site: i as u32, moves: false, set: 0 });
            // Elements of one choice are read together.
            *label = Label { site: label.site.min(i as u32), moves: false, set: 0 };
            m.partition.join(label.site, i as u32);
        }
        loop {
            let joins = m.partition.joins();
            let mut table = Table::new(m, &m.partition).map_err(|i| {
                let what = format!(
                    "it is coupled with other choices, and together they have more than {MOST_VALUES} joint values"
                );
                self.cannot_sum(m.sites[i], &what)
            })?;
            let (mut found, mut asked) = (Found::default(), Requested::default());
            while let Some(look) = table.next() {
                let mut changes = at.to_vec();
                m.put(&table.groups, &look, &mut changes);
                let weight = match self.attempt(&changes, &own, m, draws)? {
                    Ok(weight) => weight,
                    Err(label) if label.site == NONE => return Ok(Explored::Impossible),
                    Err(label) => {
                        found.structure_moves = true;
                        if m.partition.joins() == joins
                            && !table.leave_out(table.group_of[label.site as usize], &look)
                        {
                            return Ok(Explored::Impossible);
                        }
                        if m.partition.joins() == joins { continue } else { break }
                    }
                };
                self.check_held(m.sites[0])?;
                if weight.appeared + weight.vanished > 0 {
                    return Ok(Explored::Structure(changes));
                }
                match self.moved_support(m) {
                    Some(_) if !at.is_empty() => return Ok(Explored::Impossible),
                    Some(t) => {
                        return Err(
                            self.cannot_sum(t, "its possible values depend on other choices")
                        );
                    }
                    None => {}
                }
                let mut reader = Reader::new(&self.graph, &own, &mut m.partition);
                reader.read_all(self.all_targets().iter().map(|t| t.node));
                if strict {
                    asked.enter(&reader, self.all_targets());
                }
                let read = reader.found;
                if read.anywhere {
                    (1..m.sites.len()).for_each(|i| m.partition.join(0, i as u32));
                }
                if read.unclear {
                    let why = "a `mem` function called under its control makes observations";
                    return Err(self.cannot_sum(m.sites[0], why));
                }
                found.scores.extend(read.scores);
                read.owners.iter().for_each(|(n, site)| found.own(*n, *site, &mut m.partition));
                found.structure_moves |= read.structure_moves;
                found.values_move |= read.values_move;
                table.enter(look);
            }
            if m.partition.joins() == joins {
                let all = !strict || asked.has_all(self.all_targets());
                return Ok(if all {
                    Explored::Elimination(table.into_elimination(found))
                } else {
                    Explored::Impossible
                });
            }
        }
    }

    /// Proposes changes; if the program fails, returns what the failed evaluation depends
    /// on.
    fn attempt(
        &mut self,
        changes: &[(Target, Change)],
        own: &FxHashMap<NodeId, Label>,
        m: &mut Marginal,
        draws: Draws,
    ) -> TraceResult<Result<Weight, Label>> {
        self.rollback();
        let before = self.graph.begin();
        self.graph.update.draws = draws;
        self.graph.update.queue(&mut self.graph.store, &self.code, changes);
        match self.graph.propagate(&self.code) {
            Err(e) if e.is_recoverable() => {
                let failed = std::mem::take(&mut self.graph.update.failed);
                let new = failed.last().filter(|n| self.is_improper_draw(**n)).copied();
                let label = Reader::new(&self.graph, own, &mut m.partition).read_failed(&failed);
                self.graph.rollback(before);
                match new {
                    Some(node) => Err(self.cannot_sum(
                        Target { node, element: NONE },
                        "it is improper and is created together with other choices",
                    )),
                    None => Ok(Err(label)),
                }
            }
            // A held choice exists in a frame that is removed, and again in the frame
            // that replaces it.
            Err(e) if e.kind == FaultKind::Duplicate => {
                let refused = self.check_held(m.sites[0]).err();
                self.graph.rollback(before);
                Err(refused.unwrap_or(e))
            }
            propagated => self.pend(before, propagated).map(Ok),
        }
    }

    fn is_improper_draw(&self, n: NodeId) -> bool {
        matches!(self.graph.op(n), Op::Draw { .. })
            && self.graph.dist_of(n).is_some_and(|d| d.is_improper())
    }

    /// Fails if a detached frame contains a held choice, or a loop around one.
    fn check_held(&self, t: Target) -> TraceResult<()> {
        match self.detaches_held() {
            true => Err(self.cannot_sum(t, "other choices are created or removed with it")),
            false => Ok(()),
        }
    }

    /// True if the pending update detaches a frame that contains a held choice, or a loop
    /// around one.
    pub(super) fn detaches_held(&self) -> bool {
        let g = &self.graph;
        let stays = |f: &FrameId| {
            let frame = &g.store[*f];
            let mut slots = self.code.blocks[frame.block].slots();
            slots.any(|s| g.store[frame.base + s].refs > 0)
        };
        g.update.detached.iter().any(stays)
    }
}

impl Table {
    fn into_elimination(self, found: Found) -> Elimination {
        let Found { structure_moves, values_move, .. } = found;
        let mut elimination = Elimination {
            groups: self.groups,
            assignments: self.assignments,
            structure_moves,
            values_move,
            ..Elimination::default()
        };
        for (n, site) in found.scores {
            let group = self.group_of[site as usize];
            if elimination.reached.insert(n, group).is_none() {
                elimination.groups[group].scores.push(n);
            }
        }
        for (n, site) in found.owners {
            let group = self.group_of[site as usize];
            if elimination.owners.insert(n, group).is_none() {
                elimination.groups[group].owners.push(n);
            }
        }
        elimination
    }
}
