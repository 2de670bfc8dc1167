//! What a kernel is: one step of a chain that leaves the posterior invariant.

use crate::lang::error::RunError;
use crate::rng::{Purpose, Stream, StreamKey};
use crate::trace::{Draws, Selection, Selector, Target, Trace, TraceResult, Weight};

/// Where in a chain a step is, and what randomness it may use.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// The seed of the run.
    pub seed: u64,
    /// The chain.
    pub chain: u32,
    /// The step of the chain.
    pub step: u64,
    /// Whether kernels may adapt (inside `warmup`).
    pub adapting: bool,
    /// The power of the likelihood: 1 but for annealed burn-in.
    pub power: f64,
}

impl At {
    /// The randomness of values drawn inside the trace; `lane` tells alternatives of one step apart.
    pub fn draws(&self, lane: u64) -> Draws {
        Draws { key: StreamKey::new(self.seed, self.chain, Purpose::VALUES), step: self.step, lane }
    }

    /// The kernel's own randomness.
    pub fn stream(&self) -> Stream {
        StreamKey::new(self.seed, self.chain, Purpose::KERNEL).stream(self.step, 0, 0)
    }

    /// The log weight of an update with the likelihood raised to the power.
    pub fn tempered(&self, w: &Weight) -> f64 {
        if self.power == 1.0 { w.log_weight } else { w.log_weight - (1.0 - self.power) * w.log_likelihood }
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Proposals made.
    pub proposals: u32,
    /// Those accepted.
    pub accepted: u32,
    /// Those rejected because the program has no value there (a scale that is not positive, a matrix that will not factor).
    pub failed: u32,
    /// Trajectories on which the energy was not kept.
    pub divergent: u32,
}

impl Outcome {
    /// One proposal.
    pub fn one(accepted: bool) -> Self {
        Outcome { proposals: 1, accepted: u32::from(accepted), ..Default::default() }
    }

    /// One proposal that led to a domain error.
    pub fn failed() -> Self {
        Outcome { proposals: 1, failed: 1, ..Default::default() }
    }
}

/// A transition kernel.
pub trait Kernel: Send {
    /// Its name in tables.
    fn name(&self) -> String;

    /// Moves the trace by one step.
    ///
    /// # Errors
    /// Errors of the program that are not a matter of the proposed values.
    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome>;
}

/// What a kernel works on: a selection, as a whole or one member at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Scope {
    /// The choices.
    pub selector: Selector,
    /// Whether one of them is picked at each step (`one(sel)`).
    pub one: bool,
}

/// A scope registered with a trace.
#[derive(Clone, Debug)]
pub(crate) struct Registered {
    pub scope: Scope,
    selection: Option<Selection>,
}

impl Registered {
    pub fn new(scope: Scope) -> Self {
        Registered { scope, selection: None }
    }

    /// The selection in this kernel's trace.
    pub fn selection(&mut self, trace: &mut Trace) -> Selection {
        *self.selection.get_or_insert_with(|| trace.select(&self.scope.selector))
    }

    /// One member, picked uniformly, and how many there are.
    pub fn pick(&mut self, trace: &mut Trace, rng: &mut Stream) -> Option<(Target, usize)> {
        let selection = self.selection(trace);
        let targets = trace.targets(selection);
        (!targets.is_empty()).then(|| (targets[rng.index(targets.len())], targets.len()))
    }

    /// The members a step works on, and what picking them costs: the log of the number of ways.
    pub fn members(&mut self, trace: &mut Trace, rng: &mut Stream) -> (Vec<Target>, f64) {
        if self.scope.one {
            match self.pick(trace, rng) {
                Some((t, n)) => (vec![t], libm::log(n as f64)),
                None => (Vec::new(), 0.0),
            }
        } else {
            let selection = self.selection(trace);
            (trace.targets(selection).to_vec(), 0.0)
        }
    }

    /// What picking the same members costs in the proposed state: single-site picking pays the ratio of the numbers.
    pub fn ways_back(&mut self, trace: &Trace) -> f64 {
        match (self.scope.one, self.selection) {
            (true, Some(s)) => libm::log(trace.targets(s).len() as f64),
            _ => 0.0,
        }
    }
}

/// The Metropolis-Hastings test; NaN is a rejection.
pub(crate) fn accepts(log_ratio: f64, rng: &mut Stream) -> bool {
    let u = rng.open_uniform();
    log_ratio >= 0.0 || libm::log(u) < log_ratio
}

/// Keeps or undoes the pending proposal.
pub(crate) fn decide(trace: &mut Trace, log_ratio: f64, rng: &mut Stream) -> Outcome {
    let accepted = accepts(log_ratio, rng);
    if accepted {
        trace.commit()
    } else {
        trace.rollback()
    }
    Outcome::one(accepted)
}

/// Separates proposals that lead where the program has no value from failures of the program.
pub(crate) fn recoverable<T>(result: TraceResult<T>) -> TraceResult<Option<T>> {
    match result {
        Ok(x) => Ok(Some(x)),
        Err(e) if RunError::is_recoverable(&e) => Ok(None),
        Err(e) => Err(e),
    }
}
