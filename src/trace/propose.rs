//! The vocabulary of updates: changes, their random streams, and the effect of an update
//! on the score.

use super::choices::Target;
use super::graph::Graph;
use super::journal::Entry;
use super::node::*;
use crate::dist::Datum;
use crate::num::ExactSum;
use crate::rng::{Stream, StreamKey};
use serde::{Deserialize, Serialize};

/// The source of an update's random numbers: one stream per address, independent of the
/// order of evaluation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Draws {
    /// Seed, chain and purpose.
    pub key: StreamKey,
    /// The step of the chain.
    pub step: u64,
    /// The index of one of several alternatives at one step.
    pub substream: u64,
}

impl Draws {
    /// Returns the stream of an address.
    pub(crate) fn stream(&self, address_hash: u64) -> Stream {
        self.key.stream(self.step, address_hash, self.substream)
    }
}

/// A change of one choice in an update.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// It takes this value, in stored form (for a whitened gp: its underlying white
    /// noise).
    Set(Datum),
    /// It takes this value, as the program sees it.
    Value(Datum),
    /// It is resampled from its prior after the update.
    Resample,
    /// It becomes the image of this point of the unconstrained space under the transform
    /// of its support after the update; the log Jacobian is in [`Weight::log_jacobian`].
    Free(Vec<f64>),
    /// It becomes the image of this white noise under its Gaussian prior after the
    /// update.
    White(Vec<f64>),
}

/// A change waiting to be applied.
#[derive(Clone, Debug)]
pub(crate) struct Pending {
    pub node: NodeId,
    pub element: u32,
    pub change: Change,
}

/// A value that a choice takes when it is first drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Constraint {
    /// In stored form, as saved traces keep it.
    Stored(Datum),
    /// As the program sees it.
    Value(Datum),
}

/// The effect of an update on the score. Differences are taken between exact sums, so
/// they do not depend on the order in which terms changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weight {
    /// The change of the log joint density, minus the log density of what was drawn from
    /// the prior, plus that of what an update back would draw: the log acceptance ratio
    /// without the proposal terms of [`Change::Set`].
    pub log_weight: f64,
    /// The change of the log joint density.
    pub log_joint: f64,
    /// The change of the log density of observations and factors.
    pub log_likelihood: f64,
    /// The sum of the log Jacobians of [`Change::Free`].
    pub log_jacobian: f64,
    /// How many choices appeared and vanished.
    pub appeared: u32,
    /// See `appeared`.
    pub vanished: u32,
}

impl Weight {
    /// Returns the log weight with the likelihood raised to a power. An impossible state
    /// is impossible at every power.
    pub fn tempered(&self, power: f64) -> f64 {
        if power == 1.0 || self.log_weight.is_infinite() {
            self.log_weight
        } else {
            self.log_weight - (1.0 - power) * self.log_likelihood
        }
    }

    /// Returns the tempered log weight of an update that changes the two sums by these
    /// terms and leaves the structure unchanged.
    pub(crate) fn beside(prior: &ExactSum, likelihood: &ExactSum, power: f64) -> f64 {
        let log_weight = ExactSum::of_both(prior, likelihood);
        let flat = power == 1.0 || log_weight.is_infinite();
        if flat {
            log_weight
        } else {
            log_weight - (1.0 - power) * likelihood.difference_from_zero()
        }
    }
}

impl Graph {
    /// Returns the pending changes of a choice.
    pub fn pending_of(&self, n: NodeId) -> impl Iterator<Item = &Pending> {
        let first = self.pending.partition_point(|p| p.node < n);
        self.pending[first..].iter().take_while(move |p| p.node == n)
    }

    /// Queues changes and invalidates what depends on them.
    pub fn queue(&mut self, code: &crate::lang::code::Code, changes: &[(Target, Change)]) {
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
    pub fn probe(&self, p: crate::lang::code::Probe) -> f64 {
        use crate::lang::code::Probe;
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
