//! The changes that an update applies, and its effect on the score.

use crate::lang::code::{Code, Probe};
use crate::trace::choices::Target;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::propose::{Change, Pending, Weight};
use pcadlang_numerics::num::ExactSum;

impl Graph {
    /// Returns the pending changes of a choice.
    pub fn pending_of(&self, n: NodeId) -> impl Iterator<Item = &Pending> {
        let first = self.pending.partition_point(|p| p.node < n);
        self.pending[first..].iter().take_while(move |p| p.node == n)
    }

    /// Queues changes and invalidates what depends on them.
    pub fn queue(&mut self, code: &Code, changes: &[(Target, Change)]) {
        self.pending.extend(changes.iter().map(|(t, c)| Pending {
            node: t.node,
            element: t.element,
            change: c.clone(),
        }));
        self.pending.sort_by_key(|p| p.node);
        if !self.incremental {
            self.invalidate_everything(code);
        }
        for (t, _) in changes {
            self.save(t.node);
            if self.nodes[t.node as usize].flags & TARGET == 0 {
                self.nodes[t.node as usize].flags |= TARGET;
                self.invalidate_target(code, t.node);
            }
        }
    }

    /// Returns the log prior of what an update back would have to draw; for choices that
    /// vanished, as it was before the update.
    fn undrawn(&self) -> ExactSum {
        let mut sum = self.undrawn.clone();
        let mut retired = self.retired.clone();
        retired.sort_by_key(|(n, _)| *n);
        if !retired.is_empty() {
            for entry in &self.journal {
                let Entry::Node { id, score, state, .. } = entry else { continue };
                let first = retired.partition_point(|(n, _)| n < id);
                // A choice that appeared or was resampled is undone with what it added to
                // `drawn`.
                if let Some((_, s)) = retired.get_mut(first).filter(|(n, _)| n == id)
                    && *state != State::Empty
                    && !self.redrawn.contains(&(*id, NONE))
                {
                    *s = *score;
                }
            }
        }
        retired.iter().for_each(|(_, s)| sum.add(*s));
        sum
    }

    /// Returns the effect of the current update on the score.
    pub fn weight(&self, prior: &ExactSum, likelihood: &ExactSum) -> Weight {
        let none = ExactSum::default();
        let log_joint = ExactSum::difference_of_sums(
            [&self.prior, &self.likelihood, &none],
            [prior, likelihood, &none],
        );
        let log_weight = ExactSum::difference_of_sums(
            [&self.prior, &self.likelihood, &self.drawn],
            [prior, likelihood, &self.undrawn()],
        );
        Weight {
            log_weight,
            log_joint,
            log_likelihood: ExactSum::difference(&self.likelihood, likelihood),
            log_jacobian: self.jacobian.value(),
            appeared: self.appeared,
            vanished: self.vanished,
        }
    }

    /// Returns the log joint density.
    pub fn log_joint(&self) -> f64 {
        let mut sum = self.prior.clone();
        sum.merge(&self.likelihood);
        sum.value()
    }

    /// Returns a property of the whole trace.
    pub fn probe(&self, p: Probe) -> f64 {
        let (prior, likelihood) = match &self.before {
            Some(b) => (&b.prior, &b.likelihood),
            None => (&self.prior, &self.likelihood),
        };
        match p {
            Probe::LogPrior => prior.value(),
            Probe::LogLikelihood => likelihood.value(),
            Probe::LogJoint => {
                let mut sum = prior.clone();
                sum.merge(likelihood);
                sum.value()
            }
        }
    }
}
