//! The vocabulary of updates: changes, their random streams, and the effect of an update
//! on the score.

use super::node::NodeId;
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::num::ExactSum;
use pcadlang_numerics::rng::{Stream, StreamKey};
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
