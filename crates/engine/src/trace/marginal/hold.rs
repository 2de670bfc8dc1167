//! Choices that are kept although nothing may depend on them, such as the components of a
//! mixture that no label currently selects.

use super::Marginal;
use super::explore::Explored;
use crate::lang::code::Op;
use crate::lang::key::Key;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::{Change, Draws, Selection, Target, Trace, TraceResult};
use pcadlang_numerics::dist::{Datum, Support};
use rustc_hash::FxHashSet;

/// Why a step is impossible: choices drawn for it change which choices it needs.
const BY_CHANCE: &str = "which choices it needs depends on choices drawn during the step";

/// Everything kept until [`Trace::release_held`].
#[derive(Debug, Default)]
pub struct Held {
    nodes: Vec<NodeId>,
    /// The loops around the choices, whose frames are kept too.
    loops: Vec<NodeId>,
    /// The entries of `mem` functions that contain choices, by frame.
    frames: Vec<FrameId>,
    entries: Vec<(NodeId, Key)>,
}

impl Trace {
    /// Finds everything that the choices of `sites` reach, for a kernel that moves those
    /// of `moving`. Choices that only other values of the former depend on are drawn from
    /// their prior given the rest. They and the existing choices are kept until
    /// [`Trace::release_held`], and may be members of the selections too.
    ///
    /// # Errors
    /// If a choice of `sites` does not have finitely many values, and as
    /// [`Trace::explore`]; the trace is then unchanged.
    pub fn marginalise(
        &mut self,
        sites: Selection,
        moving: Selection,
        draws: Draws,
    ) -> TraceResult<(Marginal, Held)> {
        self.rollback();
        let mut held = Held::default();
        let before = self.constraints();
        match self.explore_and_hold(sites, moving, draws, &mut held) {
            Ok(marginal) => Ok((marginal, held)),
            Err(e) => {
                self.rollback();
                self.release_held(held)?;
                self.restore(&before, draws)?;
                Err(e)
            }
        }
    }

    fn explore_and_hold(
        &mut self,
        sites: Selection,
        moving: Selection,
        draws: Draws,
        held: &mut Held,
    ) -> TraceResult<Marginal> {
        let mut m = Marginal::default();
        let here = |t: &Target| Some((*t, Change::Set(self.stored(*t)?)));
        let original: Vec<_> = self.targets(sites).iter().filter_map(here).collect();
        let there: FxHashSet<NodeId> = self.all_targets().iter().map(|t| t.node).collect();
        let mut drawn = false;
        loop {
            self.take_up(&mut m, sites, moving)?;
            match self.explore(&[], drawn, &mut m, draws)? {
                Explored::Elimination(elimination) => {
                    self.rollback();
                    // Other choices may be needed at other points.
                    if elimination.structure_moves && held.nodes.is_empty() {
                        self.hold_all(held)?;
                    }
                    if drawn || held.nodes.iter().all(|n| there.contains(n)) {
                        m.elimination = elimination.into();
                        break;
                    }
                    self.draw_others(m.sites[0], &original, &there, draws)?;
                    drawn = true;
                }
                Explored::Structure(_) if held.nodes.is_empty() => {
                    self.rollback();
                    self.hold_all(held)?;
                }
                Explored::Structure(changes) => {
                    if drawn || self.propose(&changes, draws)?.appeared == 0 {
                        return Err(self.cannot_sum(
                            m.sites[0],
                            "other choices are created or removed with it",
                        ));
                    }
                    self.commit();
                    self.hold_all(held)?;
                }
                Explored::Impossible => return Err(self.cannot_sum(m.sites[0], BY_CHANCE)),
            }
        }
        Ok(m)
    }

    /// Restores the original choices, and resamples from their prior the choices that
    /// appeared at other values.
    fn draw_others(
        &mut self,
        site: Target,
        original: &[(Target, Change)],
        there: &FxHashSet<NodeId>,
        draws: Draws,
    ) -> TraceResult<()> {
        let others = self.all_targets().iter().filter(|t| !there.contains(&t.node));
        let mut changes = original.to_vec();
        changes.extend(others.map(|t| (*t, Change::Resample)));
        // The stream is the same, so if the priors are the same, the draws and the
        // choices that depend on them are too.
        let w = self.propose(&changes, draws)?;
        if w.appeared + w.vanished > 0 {
            return Err(self.cannot_sum(site, BY_CHANCE));
        }
        self.commit();
        Ok(())
    }

    /// Adds the current members of the selections.
    fn take_up(&self, m: &mut Marginal, sites: Selection, moving: Selection) -> TraceResult<()> {
        let not = |t: &Target| {
            self.cannot_sum(*t, "it is not a discrete choice with finitely many values")
        };
        let known: FxHashSet<Target> = m.sites.iter().copied().collect();
        for t in self.targets(sites).iter().filter(|t| !known.contains(t)) {
            let support = self
                .dist(*t)
                .map(|d| d.stored_support())
                .filter(Support::is_finite)
                .ok_or_else(|| not(t))?;
            let values: Vec<Datum> =
                support.finite_values().filter(|v| !v.is_empty()).ok_or_else(|| not(t))?;
            m.sites.push(*t);
            m.values.push(values);
            m.supports.push(support);
        }
        m.partition.grow(m.sites.len());
        m.moving.clear();
        for t in self.targets(moving) {
            let moves = self.dist(*t).is_some_and(|d| !d.stored_support().is_discrete());
            if moves && m.moving.last() != Some(&t.node) {
                m.moving.push(t.node);
            }
        }
        Ok(())
    }

    /// Keeps all choices until [`Trace::release_held`], even if nothing depends on them.
    ///
    /// # Errors
    /// If some are in a `mem` function that makes observations.
    pub fn hold_choices(&mut self) -> TraceResult<Held> {
        self.rollback();
        let mut held = Held::default();
        match self.hold_all(&mut held) {
            Ok(()) => Ok(held),
            Err(e) => {
                self.release_held(held)?;
                Err(e)
            }
        }
    }

    fn hold_all(&mut self, held: &mut Held) -> TraceResult<()> {
        let mut new: Vec<NodeId> = self.all_targets().iter().map(|t| t.node).collect();
        new.sort_unstable();
        new.dedup();
        new.retain(|n| held.nodes.binary_search(n).is_err());
        self.graph.begin();
        for n in &new {
            self.graph.acquire(*n, *n, false);
            self.hold_frames(*n, held);
        }
        self.graph.commit();
        held.nodes.extend(new);
        held.nodes.sort_unstable();
        let makes_observations = |f: &&FrameId| {
            let block = self.graph.store[**f].block;
            !self.code.blocks[block].effects.is_empty()
        };
        match held.frames.iter().find(makes_observations) {
            Some(_) => {
                let t = Target { node: held.nodes[0], element: NONE };
                Err(self.cannot_sum(t, "it is in a `mem` function that makes observations"))
            }
            None => Ok(()),
        }
    }

    /// Holds the loops and the entries of `mem` functions that contain a choice, as code
    /// that reads or calls them would.
    fn hold_frames(&mut self, n: NodeId, held: &mut Held) {
        let mut f = self.graph.store[n].frame;
        while self.graph.store[f].owner != NodeId::NONE {
            let (owner, key) = (self.graph.store[f].owner, self.graph.store[f].key.clone());
            if let Some(Side::Memo(m)) = self.graph.store[owner].side.as_deref_mut()
                && let Some(key) = key
                && let Some(entry) = m.entries.get_mut(&key)
                && !held.frames.contains(&f)
            {
                let old = *entry;
                entry.1 += 1;
                self.graph.update.note(Entry::Memo(owner, key.clone(), Some(old)));
                held.frames.push(f);
                held.entries.push((owner, key));
            }
            if matches!(self.graph.op(owner), Op::For { .. } | Op::Map { .. })
                && !held.loops.contains(&owner)
            {
                self.graph.acquire(owner, owner, false);
                held.loops.push(owner);
            }
            f = self.graph.store[owner].frame;
        }
    }

    /// Releases held choices; those that nothing depends on vanish.
    ///
    /// # Errors
    /// If the program fails.
    pub fn release_held(&mut self, held: Held) -> TraceResult<()> {
        self.rollback();
        if held.nodes.is_empty() {
            return Ok(());
        }
        let before = self.graph.begin();
        held.nodes.iter().chain(&held.loops).for_each(|n| self.graph.release(*n, false));
        held.entries.iter().for_each(|(memo, key)| self.graph.leave_memo(*memo, key));
        let propagated = self.graph.propagate(&self.code);
        self.pend(before, propagated)?;
        self.commit();
        Ok(())
    }
}
