//! A recorded density and the state of the trace it belongs to.
//!
//! It holds as long as nothing else changes the trace: every commit counts up the trace's
//! revision, and who moves only the choices that the density is a function of says so
//! ([`Recording::moved`]). A clone of a trace has an identity of its own.

use crate::lang::tape::{ScoreSums, Tape};
use crate::num::ExactSum;
use crate::trace::{Change, NONE, Target, Trace, Weight};
use std::sync::Arc;

/// The log density of a trace as a function of the unconstrained coordinates of some of
/// its choices.
#[derive(Debug)]
pub struct Recording {
    tape: Tape,
    targets: Vec<Target>,
    identity: Arc<()>,
    revision: u64,
    /// What the scores add up to in the state the trace is in.
    start: ScoreSums,
}

impl Trace {
    /// Records the log density as a function of the unconstrained coordinates of some
    /// continuous choices, to be worked out many times without proposals; `None` where
    /// that cannot be told in a straight line. [`Recording::begin`] comes first.
    pub fn record(&mut self, targets: &[Target]) -> Option<Recording> {
        self.rollback();
        let tape = self.graph.record(&self.code, targets)?;
        let identity = Arc::clone(&self.identity);
        let revision = self.graph.revision;
        Some(Recording {
            tape,
            targets: targets.to_vec(),
            identity,
            revision,
            start: ScoreSums::default(),
        })
    }
}

impl Recording {
    /// Whether it is of the state that a trace is in.
    pub fn holds(&self, trace: &Trace) -> bool {
        self.revision == trace.graph.revision && Arc::ptr_eq(&self.identity, &trace.identity)
    }

    /// Goes on after a commit that moved these choices and nothing else.
    pub fn moved(&mut self, trace: &Trace) {
        self.revision = trace.graph.revision;
    }

    /// Takes the state the trace is in as what densities are relative to, and gives its
    /// coordinates. False if it cannot be told what the program does there: then a
    /// condition has changed since.
    pub fn begin(&mut self, trace: &Trace, y: &mut Vec<f64>) -> bool {
        let targets = &self.targets;
        let now = |i: usize| {
            let t = targets[i];
            match (&trace.graph.nodes[t.node as usize].value, t.element) {
                (v, NONE) => v.clone(),
                (v, i) => v.element(i as usize).unwrap_or_default(),
            }
        };
        let told = self.tape.stand(now, y);
        self.start.clone_from(self.tape.sums());
        told
    }

    /// What a proposal of these coordinates would weigh; `None` if only a proposal can
    /// tell.
    pub fn weigh(&mut self, y: &[f64]) -> Option<Weight> {
        if !self.tape.run(y) {
            return None;
        }
        let (new, old, none) = (self.tape.sums(), &self.start, &ExactSum::default());
        let log_weight = ExactSum::balance(
            [&new.prior, &new.likelihood, none],
            [&old.prior, &old.likelihood, none],
        );
        Some(Weight {
            log_weight,
            log_joint: log_weight,
            log_likelihood: ExactSum::difference(&new.likelihood, &old.likelihood),
            log_jacobian: new.jacobian.value(),
            ..Weight::default()
        })
    }

    /// The changes that make these coordinates the state, appended to a list.
    pub fn changes(&self, y: &[f64], out: &mut Vec<(Target, Change)>) {
        out.extend(self.targets.iter().copied().zip(self.tape.images(y).map(Change::Set)));
    }

    /// The log Jacobian of the state that densities are relative to.
    pub fn log_jacobian(&self) -> f64 {
        self.start.jacobian.value()
    }

    /// [`Trace::gradient`] where it was last run. False if a derivative is not known.
    pub fn gradient(&mut self, y: &[f64], power: f64, out: &mut Vec<f64>) -> bool {
        self.tape.gradient(y, power, out)
    }
}
