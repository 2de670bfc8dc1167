//! The interface of kernels: one step of a chain that leaves the posterior invariant.

use super::state::StateError;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::key::mix;
pub use pcadlang_engine::lang::plan::Pick;
use pcadlang_engine::trace::{Draws, Selection, Selector, Target, Trace, TraceResult, Weight};
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The position of a step in a chain, and the randomness it may use.
#[derive(Clone, Copy, Debug)]
pub struct StepContext {
    /// The seed of the run.
    pub seed: u64,
    /// The chain.
    pub chain: u32,
    /// The step of the chain.
    pub step: u64,
    /// Whether kernels may adapt (inside `warmup`).
    pub adapting: bool,
    /// The power of the likelihood: 1 except in annealed warm-up.
    pub power: f64,
    /// Which member of a sweep the step moves (see [`Kernel::sweep`]).
    pub member: usize,
    /// Distinguishes steps within a step (see [`StepContext::within`]); 0 for the step
    /// itself.
    pub part: u64,
}

impl StepContext {
    /// A step at the full likelihood, outside of warm-up.
    pub fn new(seed: u64, chain: u32, step: u64) -> Self {
        StepContext { seed, chain, step, adapting: false, power: 1.0, member: 0, part: 0 }
    }

    /// The randomness of values drawn inside the trace; `substream` distinguishes
    /// alternatives within one step.
    pub fn draws(&self, substream: u64) -> Draws {
        let key = StreamKey::new(self.seed, self.chain, Purpose::VALUES);
        let substream = if self.part == 0 { substream } else { mix(self.part, substream) };
        Draws { key, step: self.step, substream }
    }

    /// The context of part `i` of this step, with independent randomness.
    pub fn within(&self, i: u64) -> StepContext {
        StepContext { part: mix(self.part, i + 1), member: 0, ..*self }
    }

    /// The kernel's own randomness.
    pub fn stream(&self) -> Stream {
        StreamKey::new(self.seed, self.chain, Purpose::KERNEL).stream(self.step, 0, self.part)
    }

    /// The log weight of an update, with the likelihood raised to the power.
    pub fn tempered(&self, w: &Weight) -> f64 {
        w.tempered(self.power)
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Proposals made.
    pub proposals: u32,
    /// Those accepted.
    pub accepted: u32,
    /// Those rejected because the program is undefined there (a scale that is not
    /// positive, a matrix that cannot be factored).
    pub failed: u32,
    /// Divergent trajectories: those with a very large energy error.
    pub divergent: u32,
    /// The choice that the step was about, for single-site kernels.
    #[serde(skip)]
    pub site: Option<Target>,
}

impl Outcome {
    /// One proposal, accepted or rejected.
    pub fn one(accepted: bool) -> Self {
        Outcome { proposals: 1, accepted: u32::from(accepted), ..Default::default() }
    }

    /// Adds the counts of another step.
    pub fn add(&mut self, other: Outcome) {
        let add = |a: &mut u32, b: u32| *a = a.saturating_add(b);
        add(&mut self.proposals, other.proposals);
        add(&mut self.accepted, other.accepted);
        add(&mut self.failed, other.failed);
        add(&mut self.divergent, other.divergent);
    }

    /// The same outcome, attributed to one choice.
    #[must_use]
    pub fn at(self, target: Target) -> Self {
        Outcome { site: Some(target), ..self }
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

    /// Begins a sweep, if the kernel visits its choices in turn, and returns the number
    /// of steps. [`StepContext::member`] says which of them a step is.
    fn sweep(&mut self, trace: &mut Trace) -> Option<usize> {
        let _ = trace;
        None
    }

    /// The step size of the trajectories of Hamiltonian kernels.
    #[doc(hidden)]
    fn step_size(&self) -> Option<f64> {
        None
    }

    /// The log of the evidence (the marginal likelihood), for kernels that estimate it.
    fn log_evidence(&self) -> Option<f64> {
        None
    }

    /// What the kernel has adapted and remembers, beside the state it moved last, for a
    /// checkpoint; empty if each step is a function of the state alone.
    fn save(&self, trace: &Trace) -> Vec<u8> {
        let _ = trace;
        Vec::new()
    }

    /// Restores the bytes of [`Kernel::save`] of a kernel with the same arguments.
    ///
    /// # Errors
    /// If the bytes are not such a state.
    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        match state {
            [] => Ok(()),
            _ => Err(StateError::new(format!("{} has no state", self.name()))),
        }
    }

    /// Moves the trace by one step.
    ///
    /// # Errors
    /// Errors of the program that do not depend on the proposed values.
    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome>;
}

/// Makes one step of a kernel inside another kernel: a whole sweep if it visits its
/// choices in turn.
pub(crate) fn inner_step(
    kernel: &mut dyn Kernel,
    trace: &mut Trace,
    at: &StepContext,
) -> TraceResult<Outcome> {
    let Some(members) = kernel.sweep(trace) else { return kernel.step(trace, at) };
    let mut all = Outcome::default();
    for member in 0..members {
        all.add(kernel.step(trace, &StepContext { member, ..at.within(member as u64) })?);
    }
    Ok(all)
}

/// The choices that a kernel works on: a selection, as a whole or one member at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteSelection {
    /// The choices.
    pub selector: Selector,
    /// Which of them a step moves.
    pub pick: Pick,
}

impl SiteSelection {
    /// Restricts the kernel to one choice per step: [`Pick::All`] becomes [`Pick::One`].
    pub(crate) fn single(self) -> Self {
        let pick = if self.pick == Pick::All { Pick::One } else { self.pick };
        SiteSelection { pick, ..self }
    }
}

/// A site selection registered with a trace.
#[derive(Clone, Debug)]
pub(crate) struct Registered {
    pub scope: SiteSelection,
    /// The selection, and the trace it is registered with.
    selection: Option<(Arc<()>, Selection)>,
    sweep: Option<Sweep>,
}

/// The members of a sweep, as a set and in order.
#[derive(Clone, Debug)]
struct Sweep {
    of: Arc<Vec<Target>>,
    order: Vec<Target>,
}

impl Registered {
    pub fn new(scope: SiteSelection) -> Self {
        Registered { scope, selection: None, sweep: None }
    }

    /// An empty selection.
    pub fn nothing() -> Self {
        Registered::new(SiteSelection { selector: Selector::Nothing, pick: Pick::All })
    }

    /// The selection in this trace, registered on first use.
    pub fn selection(&mut self, trace: &mut Trace) -> Selection {
        match &self.selection {
            Some((of, s)) if Arc::ptr_eq(of, trace.identity()) => *s,
            _ => {
                let s = trace.select(&self.scope.selector);
                self.selection = Some((Arc::clone(trace.identity()), s));
                s
            }
        }
    }

    /// The number of steps of a sweep over the members; `None` if the kernel does not
    /// sweep.
    pub fn sweep(&mut self, trace: &mut Trace) -> Option<usize> {
        if self.scope.pick != Pick::Each {
            return None;
        }
        let selection = self.selection(trace);
        let of = trace.listed(selection);
        if !self.sweep.as_ref().is_some_and(|s| Arc::ptr_eq(&s.of, of)) {
            let (of, order) = (Arc::clone(of), trace.in_program_order(selection));
            self.sweep = Some(Sweep { of, order });
        }
        Some(self.sweep.as_ref().map_or(0, |s| s.order.len()))
    }

    /// One member: chosen uniformly, with the number of candidates, or the one that the
    /// sweep has reached, with 1.
    pub fn pick(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        rng: &mut Stream,
    ) -> Option<(Target, usize)> {
        if self.scope.pick == Pick::Each {
            if self.sweep.is_none() {
                self.sweep(trace);
            }
            return self.sweep.as_ref()?.order.get(at.member).map(|t| (*t, 1));
        }
        let selection = self.selection(trace);
        let targets = trace.targets(selection);
        (!targets.is_empty()).then(|| (targets[rng.index(targets.len())], targets.len()))
    }

    /// The members that a step moves, and minus the log probability of choosing them: the
    /// log of the number of candidates.
    pub fn members(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        rng: &mut Stream,
    ) -> (Vec<Target>, f64) {
        if self.scope.pick == Pick::All {
            let selection = self.selection(trace);
            return (trace.targets(selection).to_vec(), 0.0);
        }
        match self.pick(trace, at, rng) {
            Some((t, n)) => (vec![t], libm::log(n as f64)),
            None => (Vec::new(), 0.0),
        }
    }

    /// Minus the log probability of choosing the same members in the proposed state.
    /// Single-site choice contributes the ratio of the numbers of candidates to the
    /// acceptance ratio; a sweep whose members change is rejected.
    pub fn reverse_selection(&self, trace: &Trace) -> f64 {
        let Some((_, selection)) = self.selection else { return 0.0 };
        match (self.scope.pick, &self.sweep) {
            (Pick::One, _) => libm::log(trace.targets(selection).len() as f64),
            (Pick::Each, Some(s)) if !Arc::ptr_eq(&s.of, trace.listed(selection)) => f64::INFINITY,
            _ => 0.0,
        }
    }
}

/// The Metropolis-Hastings test. The ratio must not be NaN: that is a bug of the kernel.
pub fn accepts(log_ratio: f64, rng: &mut Stream) -> bool {
    debug_assert!(!log_ratio.is_nan());
    let u = rng.open_uniform();
    log_ratio >= 0.0 || libm::log(u) < log_ratio
}

/// Accepts or rejects the pending proposal. NaN counts as a rejection.
pub fn decide(trace: &mut Trace, log_ratio: f64, rng: &mut Stream) -> Outcome {
    accept_or_reject(trace, if log_ratio.is_nan() { f64::NEG_INFINITY } else { log_ratio }, rng)
}

/// As [`decide`], for kernels whose ratio is never NaN.
pub(crate) fn accept_or_reject(trace: &mut Trace, log_ratio: f64, rng: &mut Stream) -> Outcome {
    let accepted = accepts(log_ratio, rng);
    if accepted {
        trace.commit()
    } else {
        trace.rollback()
    }
    Outcome::one(accepted)
}

/// Separates proposals at which the program is undefined (`None`) from failures of the
/// program.
pub fn recoverable<T>(result: TraceResult<T>) -> TraceResult<Option<T>> {
    match result {
        Ok(x) => Ok(Some(x)),
        Err(e) if RunError::is_recoverable(&e) => Ok(None),
        Err(e) => Err(e),
    }
}
