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
    /// True if kernels may adapt (inside `warmup`).
    pub adapting: bool,
    /// The power of the likelihood: 1 except in annealed warm-up.
    pub power: f64,
    /// Distinguishes steps within a step (see [`StepContext::within`]); 0 for the step
    /// itself.
    pub part: u64,
}

impl StepContext {
    /// A step at the full likelihood, outside of warm-up.
    pub fn new(seed: u64, chain: u32, step: u64) -> Self {
        StepContext { seed, chain, step, adapting: false, power: 1.0, part: 0 }
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
        StepContext { part: mix(self.part, i + 1), ..*self }
    }

    /// The kernel's own randomness.
    pub fn stream(&self) -> Stream {
        StreamKey::new(self.seed, self.chain, Purpose::KERNEL).stream(self.step, 0, self.part)
    }

    /// The change of the log likelihood in a stage, raised to the power.
    pub(crate) fn tempered_change(&self, change: f64) -> f64 {
        if change.is_finite() { self.power * change } else { change }
    }

    /// The log weight of an update, with the likelihood raised to the power.
    pub fn tempered(&self, w: &Weight) -> f64 {
        w.tempered(self.power)
    }
}

/// The outcome of a step.
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
    /// Proposals of single-site kernels that led, or could have led, to another state of
    /// positive probability.
    pub possible: u32,
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
        add(&mut self.possible, other.possible);
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

    /// The choices over which the kernel may sweep.
    #[doc(hidden)]
    fn scope(&mut self) -> Option<&mut Registered> {
        None
    }

    /// Begins a sweep, if the kernel visits its choices in turn, and returns the number
    /// of steps in the present state. When a checkpoint resumes, the sweep continues after
    /// the choice with this address hash.
    fn sweep(&mut self, trace: &mut Trace, after: Option<u64>) -> Option<usize> {
        self.scope()?.sweep(trace, after)
    }

    /// True if a step makes one proposal, which may be decided in stages.
    #[doc(hidden)]
    fn decides_in_stages(&mut self, _: &Trace) -> bool {
        false
    }

    /// The number of steps of the sweep that remain in the present state.
    #[doc(hidden)]
    fn remaining(&mut self, trace: &mut Trace) -> usize {
        self.scope().map_or(0, |s| s.remaining(trace))
    }

    /// The address hash of the choice that the sweep has visited last.
    #[doc(hidden)]
    fn visited(&mut self, trace: &Trace) -> Option<u64> {
        self.scope()?.visited(trace)
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

    /// The kernel's adaptation and memory, beside the state it moved last, for a
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
    let Some(mut left) = kernel.sweep(trace, None) else { return kernel.step(trace, at) };
    let (mut all, mut steps) = (Outcome::default(), 0);
    while left > 0 {
        all.add(kernel.step(trace, &at.within(steps))?);
        steps += 1;
        left = kernel.remaining(trace);
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
pub struct Registered {
    pub(crate) scope: SiteSelection,
    /// The selection, and the trace it is registered with.
    selection: Option<(Arc<()>, Selection)>,
    sweep: Option<Sweep>,
}

/// The members of a sweep, as a set and in program order, and how many were visited.
///
/// A step may create and remove members. The place of a choice in the program does not
/// depend on its value, and the order of places is the same in all states. So a sweep
/// applies one kernel for each possible place, in a fixed order; where the present state
/// has no member the kernel does nothing. Each of them leaves the posterior invariant, and
/// so does the sweep.
#[derive(Clone, Debug, Default)]
struct Sweep {
    of: Arc<Vec<Target>>,
    order: Vec<Target>,
    visited: usize,
}

impl Registered {
    pub(crate) fn new(scope: SiteSelection) -> Self {
        Registered { scope, selection: None, sweep: None }
    }

    /// An empty selection.
    pub(crate) fn nothing() -> Self {
        Registered::new(SiteSelection { selector: Selector::Nothing, pick: Pick::All })
    }

    /// The selection in this trace, registered on first use.
    pub(crate) fn selection(&mut self, trace: &mut Trace) -> Selection {
        match &self.selection {
            Some((of, s)) if Arc::ptr_eq(of, trace.identity()) => *s,
            _ => {
                let s = trace.select(&self.scope.selector);
                self.selection = Some((Arc::clone(trace.identity()), s));
                s
            }
        }
    }

    /// See [`Kernel::sweep`].
    fn sweep(&mut self, trace: &mut Trace, after: Option<u64>) -> Option<usize> {
        if self.scope.pick != Pick::Each {
            return None;
        }
        let sweep = self.sweep_in(trace);
        let is_last = |t: &Target| Some(trace.address_hash(*t)) == after;
        let last = after.and_then(|_| sweep.order.iter().position(is_last));
        sweep.visited = last.map_or(0, |i| i + 1);
        Some(sweep.order.len() - sweep.visited)
    }

    /// See [`Kernel::remaining`].
    fn remaining(&mut self, trace: &mut Trace) -> usize {
        if self.sweep.is_none() {
            return 0;
        }
        let sweep = self.sweep_in(trace);
        sweep.order.len() - sweep.visited
    }

    /// See [`Kernel::visited`].
    fn visited(&self, trace: &Trace) -> Option<u64> {
        self.sweep.as_ref()?.last().map(|t| trace.address_hash(t))
    }

    /// The sweep with the members of the present state.
    fn sweep_in(&mut self, trace: &mut Trace) -> &mut Sweep {
        let selection = self.selection(trace);
        let of = trace.listed(selection);
        if !self.sweep.as_ref().is_some_and(|s| Arc::ptr_eq(&s.of, of)) {
            let (of, order) = (Arc::clone(of), trace.in_program_order(selection));
            let last = self.sweep.as_ref().and_then(Sweep::last);
            let place = |last| order.iter().position(|t| *t == last);
            let visited = last.map_or(0, |t| place(t).map_or(order.len(), |i| i + 1));
            self.sweep = Some(Sweep { of, order, visited });
        }
        self.sweep.get_or_insert_default()
    }

    /// One member: chosen uniformly, with the number of candidates, or the next one of the
    /// sweep, with 1.
    pub(crate) fn pick(&mut self, trace: &mut Trace, rng: &mut Stream) -> Option<(Target, usize)> {
        if self.scope.pick == Pick::Each {
            let sweep = self.sweep_in(trace);
            // Without a caller that counts, sweeps follow each other.
            let next = if sweep.visited < sweep.order.len() { sweep.visited } else { 0 };
            sweep.visited = next + 1;
            return sweep.order.get(next).map(|t| (*t, 1));
        }
        let selection = self.selection(trace);
        let targets = trace.targets(selection);
        (!targets.is_empty()).then(|| (targets[rng.index(targets.len())], targets.len()))
    }

    /// The members that a step moves, and minus the log probability of choosing them: the
    /// log of the number of candidates.
    pub(crate) fn members(&mut self, trace: &mut Trace, rng: &mut Stream) -> (Vec<Target>, f64) {
        if self.scope.pick == Pick::All {
            let selection = self.selection(trace);
            return (trace.targets(selection).to_vec(), 0.0);
        }
        match self.pick(trace, rng) {
            Some((t, n)) => (vec![t], libm::log(n as f64)),
            None => (Vec::new(), 0.0),
        }
    }

    /// Minus the log probability of choosing the same members in the proposed state.
    /// Single-site choice contributes the ratio of the numbers of candidates to the
    /// acceptance ratio. A move of a sweep is rejected if its choice is then no member.
    pub(crate) fn reverse_selection(&self, trace: &Trace) -> f64 {
        let Some((_, selection)) = self.selection else { return 0.0 };
        match (self.scope.pick, &self.sweep) {
            (Pick::One, _) => libm::log(trace.targets(selection).len() as f64),
            (Pick::Each, Some(s)) if !Arc::ptr_eq(&s.of, trace.listed(selection)) => {
                let stays = s.last().is_some_and(|t| trace.targets(selection).contains(&t));
                if stays { 0.0 } else { f64::INFINITY }
            }
            _ => 0.0,
        }
    }
}

impl Sweep {
    fn last(&self) -> Option<Target> {
        self.order.get(self.visited.checked_sub(1)?).copied()
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
    let log_ratio = if log_ratio.is_nan() { f64::NEG_INFINITY } else { log_ratio };
    let accepted = accepts(log_ratio, rng);
    end(trace, log_ratio, accepted)
}

/// Accepts or rejects the pending proposal; where observations wait, one that passes is tested
/// once more by the ratio of each stage, which is tempered. The product of the probabilities is
/// balanced as the one test of the whole ratio is (Banterle, Grazian, Lee and Robert 2019,
/// "Accelerating Metropolis-Hastings algorithms by delayed acceptance", Foundations of Data
/// Science 1).
///
/// # Errors
/// If the program fails as the observations are evaluated, other than where it is undefined.
pub(crate) fn accept_or_reject(
    trace: &mut Trace,
    at: &StepContext,
    log_ratio: f64,
    rng: &mut Stream,
) -> TraceResult<Outcome> {
    accept_or_reject_last(trace, at, log_ratio, rng, |_| Ok(0.0))
}

/// As [`accept_or_reject`], with a part of the log ratio that takes time, and is of the last test.
///
/// # Errors
/// As [`accept_or_reject`], and that of `last`; the proposal is then rejected.
pub(crate) fn accept_or_reject_last(
    trace: &mut Trace,
    at: &StepContext,
    log_ratio: f64,
    rng: &mut Stream,
    last: impl FnOnce(&mut Trace) -> TraceResult<f64>,
) -> TraceResult<Outcome> {
    let (mut last, mut ratio) = (Some(last), log_ratio);
    let accepted = loop {
        if ratio > f64::NEG_INFINITY
            && !trace.observations_wait()
            && let Some(last) = last.take()
        {
            ratio += last(trace).inspect_err(|_| trace.rollback())?;
        }
        if !accepts(ratio, rng) {
            break false;
        }
        let Some(change) = trace.next_stage() else { break true };
        let Some(change) = recoverable(change)? else { break false };
        ratio = at.tempered_change(change);
    };
    Ok(end(trace, log_ratio, accepted))
}

/// Ends the pending proposal.
fn end(trace: &mut Trace, log_ratio: f64, accepted: bool) -> Outcome {
    if accepted {
        trace.commit()
    } else {
        trace.rollback()
    }
    let possible = u32::from(log_ratio > f64::NEG_INFINITY);
    Outcome { possible, ..Outcome::one(accepted) }
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
