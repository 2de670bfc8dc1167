//! The score of a trace: exact sums of log densities, and how an update changes them.

use super::journal::Before;
use super::propose::Weight;
use crate::lang::code::Probe;
use pcadlang_numerics::num::ExactSum;

/// The sums of a trace and of the update in progress.
#[derive(Clone, Debug, Default)]
pub(crate) struct Score {
    /// The log prior of the choices, and the log density of observations and factors.
    pub prior: ExactSum,
    pub likelihood: ExactSum,
    /// The log prior of what this update drew from the prior, and of what an update back
    /// would have to draw.
    pub drawn: ExactSum,
    pub undrawn: ExactSum,
    /// The log Jacobians of choices set through the unconstrained space.
    pub jacobian: ExactSum,
    /// The sums before a query, for probes; `None` outside of queries.
    pub before: Option<Before>,
}

impl Score {
    /// Begins an update.
    pub fn begin(&mut self) -> Before {
        self.drawn = ExactSum::default();
        self.undrawn = ExactSum::default();
        self.jacobian = ExactSum::default();
        Before { prior: self.prior.clone(), likelihood: self.likelihood.clone() }
    }

    /// Undoes an update.
    pub fn rollback(&mut self, before: Before) {
        self.prior = before.prior;
        self.likelihood = before.likelihood;
    }

    /// Adds the score of a new choice, drawn from the prior or not.
    pub fn add_prior(&mut self, score: f64, drawn: bool) {
        self.prior.add(score);
        if drawn {
            self.drawn.add(score);
        }
    }

    /// Returns the change of the log joint since `before`, minus what was drawn from the
    /// prior, plus `undrawn`: what an update back would have to draw.
    pub fn change(&self, before: &Before, undrawn: &ExactSum) -> f64 {
        ExactSum::difference_of_sums(
            [&self.prior, &self.likelihood, &self.drawn],
            [&before.prior, &before.likelihood, undrawn],
        )
    }

    /// Returns the effect of the current update.
    pub fn weight(&self, before: &Before, undrawn: &ExactSum) -> Weight {
        let none = ExactSum::default();
        let log_joint = ExactSum::difference_of_sums(
            [&self.prior, &self.likelihood, &none],
            [&before.prior, &before.likelihood, &none],
        );
        Weight {
            log_weight: self.change(before, undrawn),
            log_joint,
            log_likelihood: ExactSum::difference(&self.likelihood, &before.likelihood),
            log_jacobian: self.jacobian.value(),
            ..Weight::default()
        }
    }

    /// Returns the log joint density.
    pub fn log_joint(&self) -> f64 {
        joint(&self.prior, &self.likelihood)
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
            Probe::LogJoint => joint(prior, likelihood),
        }
    }
}

fn joint(prior: &ExactSum, likelihood: &ExactSum) -> f64 {
    let mut sum = prior.clone();
    sum.merge(likelihood);
    sum.value()
}
