//! Finding what choices reach: which of them share a score and which scores those are, at
//! one place of the rest.
//!
//! A partition of the choices is right if no score reads choices of two groups, in any
//! joint state. To know that, it is enough to look at every joint value of each group
//! once, whatever the other groups are at: a score that reads only its group there takes
//! the same course under all values of the others ([`super::reads`]). A look at which a
//! score reads two groups makes them one, and all is looked at again.

use super::partition::Partition;
use super::reads::{Found, Label, Reader};
use super::{Elimination, Group, Marginal};
use crate::lang::code::Op;
use crate::lang::error::FaultKind;
use crate::trace::node::*;
use crate::trace::{Change, Draws, Target, Trace, TraceResult, Weight};
use rustc_hash::{FxHashMap, FxHashSet};

/// The most joint values of one group.
const MOST_VALUES: usize = 1000;

/// What looking at the joint values showed.
pub(crate) enum Explored {
    /// Every one has the same choices.
    Elimination(Elimination),
    /// These changes make choices appear or vanish.
    Structure(Vec<(Target, Change)>),
    /// The program has no value here whatever the choices are, there are choices that it
    /// never asks for, or they have other values.
    Nowhere,
}

/// Which choices are asked for in some look.
#[derive(Default)]
struct Asked {
    by_scores: FxHashSet<NodeId>,
    /// By choice: those that its distribution is made from.
    by_choice: FxHashMap<NodeId, FxHashSet<NodeId>>,
}

impl Asked {
    fn enter(&mut self, reader: &Reader, choices: &[Target]) {
        self.by_scores.extend(&reader.found.asked);
        for t in choices {
            self.by_choice.entry(t.node).or_default().extend(reader.origins(t.node));
        }
    }

    /// Whether all of these are asked for by scores, or by choices that are, in some look
    /// each.
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

/// The joint values of the groups, and in which look each was.
struct Table {
    groups: Vec<Group>,
    /// By choice: its group.
    group_of: Vec<usize>,
    /// By group: the next value, and one that the program has a value for.
    next: Vec<usize>,
    fine: Vec<Option<usize>>,
    looks: Vec<Vec<usize>>,
}

impl Table {
    fn new(m: &Marginal, partition: &Partition) -> Result<Table, usize> {
        let mut t =
            Table { groups: vec![], group_of: vec![], next: vec![], fine: vec![], looks: vec![] };
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

    /// A value for each group, of which at least one has not been looked at; `None` if
    /// all have.
    fn next(&self) -> Option<Vec<usize>> {
        let open = |i: &usize| self.next[*i] < self.groups[*i].values;
        let value = |i: usize| if open(&i) { self.next[i] } else { self.fine[i].unwrap_or(0) };
        let any = (0..self.groups.len()).any(|i| open(&i));
        (any || self.looks.is_empty()).then(|| (0..self.groups.len()).map(value).collect())
    }

    /// The program has a value there.
    fn enter(&mut self, look: Vec<usize>) {
        for (i, v) in look.iter().enumerate() {
            if self.next[i] == *v {
                self.groups[i].seen[*v] = Some(self.looks.len());
                self.next[i] += 1;
                self.fine[i] = Some(*v);
            }
        }
        self.looks.push(look);
    }

    /// A group cannot have its value of a look; false if it can have none.
    fn leave_out(&mut self, group: usize, look: &[usize]) -> bool {
        // One that the program had a value for under others is an evaluation that the
        // partition does not cover.
        let open = self.next[group] == look[group];
        self.next[group] += usize::from(open);
        open && (self.next[group] < self.groups[group].values || self.fine[group].is_some())
    }
}

impl Trace {
    /// Looks at the joint values of choices at a place, which these changes lead to;
    /// `strict` if there may be choices that nothing asks for. A proposal may be pending
    /// afterwards.
    ///
    /// # Errors
    /// If one of them is not finite there, if the choices that there are depend on one in
    /// a way that cannot be undone, or if too many depend on each other; those of the
    /// program.
    pub(crate) fn explore(
        &mut self,
        at: &[(Target, Change)],
        strict: bool,
        m: &mut Marginal,
        draws: Draws,
    ) -> TraceResult<Explored> {
        let mut own: FxHashMap<NodeId, Label> =
            m.moving.iter().map(|n| (*n, Label { site: NONE, moves: true })).collect();
        for (i, t) in m.sites.iter().enumerate() {
            let label = own.entry(t.node).or_insert(Label { site: i as u32, moves: false });
            // Elements of one choice are read together.
            *label = Label { site: label.site.min(i as u32), moves: false };
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
            let (mut found, mut asked) = (Found::default(), Asked::default());
            while let Some(look) = table.next() {
                let mut changes = at.to_vec();
                m.put(&table.groups, &look, &mut changes);
                let weight = match self.attempt(&changes, &own, m, draws)? {
                    Ok(weight) => weight,
                    Err(label) if label.site == NONE => return Ok(Explored::Nowhere),
                    Err(label) => {
                        found.structure_moves = true;
                        if m.partition.joins() == joins
                            && !table.leave_out(table.group_of[label.site as usize], &look)
                        {
                            return Ok(Explored::Nowhere);
                        }
                        if m.partition.joins() == joins { continue } else { break }
                    }
                };
                self.check_held(m.sites[0])?;
                if weight.appeared + weight.vanished > 0 {
                    return Ok(Explored::Structure(changes));
                }
                match self.moved_support(m) {
                    Some(_) if !at.is_empty() => return Ok(Explored::Nowhere),
                    Some(t) => {
                        return Err(
                            self.cannot_sum(t, "its possible values depend on other choices")
                        );
                    }
                    None => {}
                }
                let mut reader = Reader::new(&self.graph, &self.code, &own, &mut m.partition);
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
                    Explored::Nowhere
                });
            }
        }
    }

    /// Proposes changes; where the program has no value, what the evaluation that failed
    /// depends on.
    fn attempt(
        &mut self,
        changes: &[(Target, Change)],
        own: &FxHashMap<NodeId, Label>,
        m: &mut Marginal,
        draws: Draws,
    ) -> TraceResult<Result<Weight, Label>> {
        self.rollback();
        let before = self.graph.begin();
        self.graph.draws = draws;
        self.graph.queue(&self.code, changes);
        match self.graph.propagate(&self.code) {
            Err(e) if e.is_recoverable() => {
                let failed = std::mem::take(&mut self.graph.failed);
                let new = failed.last().filter(|n| self.is_improper_draw(**n)).copied();
                let label = Reader::new(&self.graph, &self.code, own, &mut m.partition)
                    .read_failed(&failed);
                self.graph.rollback(&self.code, before);
                match new {
                    Some(node) => Err(self.cannot_sum(
                        Target { node, element: NONE },
                        "it is improper and is created together with other choices",
                    )),
                    None => Ok(Err(label)),
                }
            }
            // A choice that stays, in a frame that goes, and the same choice in the frame
            // that comes instead.
            Err(e) if e.kind == FaultKind::Duplicate => {
                let refused = self.check_held(m.sites[0]).err();
                self.graph.rollback(&self.code, before);
                Err(refused.unwrap_or(e))
            }
            settled => self.pend(before, settled).map(Ok),
        }
    }

    fn is_improper_draw(&self, n: NodeId) -> bool {
        matches!(self.graph.op(&self.code, n), Op::Draw { .. })
            && self.graph.dist_of(&self.code, n).is_some_and(|d| d.is_improper())
    }

    /// Whether a frame goes of which a choice is to stay, or a loop that has some.
    fn check_held(&self, t: Target) -> TraceResult<()> {
        let g = &self.graph;
        let stays = |f: &FrameId| {
            let frame = &g.frames[*f as usize];
            let mut nodes =
                frame.base..frame.base + self.code.blocks[frame.block as usize].len() as u32;
            nodes.any(|n| g.nodes[n as usize].refs > 0)
        };
        match g.detached.iter().any(stays) {
            true => Err(self.cannot_sum(t, "other choices are created or removed with it")),
            false => Ok(()),
        }
    }
}

impl Table {
    fn into_elimination(self, found: Found) -> Elimination {
        let Found { structure_moves, values_move, .. } = found;
        let mut elimination = Elimination {
            groups: self.groups,
            looks: self.looks,
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
