//! Changes of a choice in place by local densities, which give the dependent values and
//! scores, and the selections that switch to their other alternative. The resulting state
//! is the one that an update would give.

use crate::lang::code::{Code, Op, Operand};
use crate::lang::value::Value;
use crate::trace::Trace;
use crate::trace::choices::Target;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use crate::trace::shortcuts::register::Register;
use pcadlang_numerics::dist::{Datum, Dist};
use smallvec::SmallVec;

/// Changes to the nodes that depend on a choice.
#[derive(Default)]
struct Following {
    values: SmallVec<[(NodeId, Value); 8]>,
    /// Values of computations that become needed because selections switch.
    fresh: SmallVec<[(NodeId, Value); 8]>,
    /// Computations that no score needs any more.
    unasked: SmallVec<[NodeId; 4]>,
    /// Selections that switch to their other alternative.
    turned: SmallVec<[NodeId; 4]>,
}

impl Trace {
    /// Gives a choice with this distribution another value permanently, if that changes
    /// no structure and local densities cover it. Otherwise returns false and does
    /// nothing: an update is needed.
    pub fn set_in_place(&mut self, target: Target, dist: &Dist, value: &Datum) -> bool {
        self.update.is_none()
            && target.element == NONE
            && self.graph.set_in_place(&self.code, target.node, dist, value)
    }
}

impl Graph {
    /// See [`Trace::set_in_place`].
    fn set_in_place(&mut self, code: &Code, target: NodeId, dist: &Dist, value: &Datum) -> bool {
        let Some(local_densities) = self.local_densities(code, target) else { return false };
        let Some(at) = Register::of_datum(value) else { return false };
        let mut following = Following::default();
        let mut e = self.evaluation(code);
        e.begin(at);
        for placed in &local_densities {
            if e.run(placed, local_densities.len() == 1).is_none() {
                return false;
            }
            following.values.push((placed.entry, e.value_in(0)));
            if !e.turned.is_empty() {
                for (slot, r) in
                    placed.local_density.results.iter().filter(|(_, r)| e.is_filled(*r))
                {
                    let n = placed.base + *slot;
                    if self.store[n].state == State::Empty {
                        following.fresh.push((n, e.value_in(*r)));
                    }
                }
            }
            for slot in &placed.local_density.computations {
                let n = placed.base + *slot;
                if self.store[n].state == State::Clean {
                    let mut results = placed.local_density.results.iter();
                    match results.find(|(s, r)| s == slot && e.is_filled(*r)) {
                        Some((_, r)) => following.values.push((n, e.value_in(*r))),
                        None => following.unasked.push(n),
                    }
                }
            }
        }
        if e.summed {
            return false;
        }
        following.turned = e.turned;
        let (scores, prior, likelihood) = (e.scores, e.prior, e.likelihood);
        let is_total = |n: NodeId| matches!(self.store[n].side.as_deref(), Some(Side::Total(_)));
        if scores.iter().any(|(n, _)| is_total(*n)) || !self.follow(code, following) {
            return false;
        }
        self.revision += 1;
        let score = dist.log_density_stored(value);
        self.score.prior.sub(self.store[target].score);
        self.score.prior.add(score);
        self.score.prior.merge(&prior);
        self.score.likelihood.merge(&likelihood);
        self.store[target].score = score;
        for (n, score) in scores {
            self.store[n].score = score;
        }
        true
    }

    /// Gives nodes their new values. Returns false and does nothing if an update has to
    /// decide.
    fn follow(&mut self, code: &Code, following: Following) -> bool {
        if following.turned.is_empty() {
            for (n, value) in following.values {
                self.store[n].value = value;
            }
            return following.unasked.is_empty();
        }
        let before = self.begin();
        for (n, value) in following.values {
            self.update.save(&mut self.store, n);
            self.store[n].value = value;
        }
        let turned = self.turn(code, &following.turned, &following.fresh);
        let is_asked = |n: &NodeId| self.store[*n].state != State::Empty;
        if turned.is_none() || following.unasked.iter().any(is_asked) {
            self.rollback(before);
            return false;
        }
        self.commit();
        true
    }

    /// Switches selections to their other alternatives, and releases the previous ones;
    /// `None` if the new ones cannot be computed.
    fn turn(
        &mut self,
        code: &Code,
        selections: &[NodeId],
        fresh: &[(NodeId, Value)],
    ) -> Option<()> {
        // Acquire before releasing: one may acquire what another releases.
        for n in selections {
            let (taken, _) = self.ways(*n)?;
            if let Some(d) = self.resolve(self.store[*n].frame, taken) {
                self.take_up(code, d, *n, !matches!(taken, Operand::Local(_)), fresh)?;
            }
        }
        for n in selections {
            let (_, left) = self.ways(*n)?;
            if let Some(d) = self.resolve(self.store[*n].frame, left) {
                self.release(d, !matches!(left, Operand::Local(_)));
            }
            self.store[*n].flags ^= OTHERWISE;
        }
        self.sweep();
        Some(())
    }

    /// Acquires a node, and everything it reads if it was not evaluated before.
    fn take_up(
        &mut self,
        code: &Code,
        d: NodeId,
        user: NodeId,
        outside: bool,
        fresh: &[(NodeId, Value)],
    ) -> Option<()> {
        if self.store[d].state == State::Empty {
            let known =
                fresh.iter().find(|(n, _)| *n == d && !matches!(self.op(d), Op::Select { .. }));
            match known {
                Some((_, value)) => {
                    self.update.save(&mut self.store, d);
                    let node = &mut self.store[d];
                    node.value = value.clone();
                    node.changed = self.update.epoch;
                    node.state = State::Clean;
                    node.flags |= HELD;
                    let mut read: SmallVec<[(NodeId, bool); 8]> = SmallVec::new();
                    self.each_dep(d, |r, outside| read.push((r, outside)));
                    read.into_iter()
                        .try_for_each(|(r, outside)| self.take_up(code, r, d, outside, fresh))?;
                }
                None => self.evaluate(code, d).ok()?,
            }
        }
        self.acquire(d, user, outside);
        Some(())
    }

    /// Returns the alternative that a selection does not hold, and the one that it holds.
    fn ways(&self, n: NodeId) -> Option<(Operand, Operand)> {
        let Op::Select { then, otherwise, .. } = self.op(n) else { return None };
        let is_first = self.store[n].flags & OTHERWISE == 0;
        Some(if is_first { (*otherwise, *then) } else { (*then, *otherwise) })
    }
}
