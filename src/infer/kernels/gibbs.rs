//! Gibbs updates of finite discrete choices by enumeration, in log space.
//!
//! While no value makes other choices appear or vanish, the new value comes from its exact conditional. Otherwise each
//! value's weight is that of the one draw of what appears with it, and the move is a multiple-try Metropolis step (Liu,
//! Liang & Wong 2000) with one try a value: the weights around the new state, with fresh draws for all values but the old
//! one, make the ratio.

use crate::dist::Datum;
use crate::infer::kernel::{At, Kernel, Outcome, Registered, Scope, accepts, recoverable};
use crate::num::log_sum_exp;
use crate::rng::Stream;
use crate::trace::{Change, Target, Trace, TraceResult};

/// `gibbs(sel)`: draws one choice from its distribution given all else.
#[derive(Clone, Debug)]
pub struct Gibbs {
    scope: Registered,
}

/// The log weights of a choice's values relative to the state, and whether any of them changes the set of choices.
struct Weights {
    log: Vec<f64>,
    structural: bool,
    failed: u32,
}

impl Gibbs {
    /// The kernel for one of these choices at a time.
    pub fn new(scope: Scope) -> Self {
        Gibbs { scope: Registered::new(Scope { one: true, ..scope }) }
    }

    /// The weights of all values. The lane of value `i` is `first_lane + i`.
    fn weights(
        &mut self,
        trace: &mut Trace,
        at: &At,
        target: Target,
        values: &[Datum],
        n: usize,
        first_lane: u64,
    ) -> TraceResult<Weights> {
        let mut weights = Weights { log: Vec::with_capacity(values.len()), structural: false, failed: 0 };
        let current = trace.stored(target);
        for (i, v) in values.iter().enumerate() {
            if Some(v) == current.as_ref() {
                weights.log.push(0.0);
                continue;
            }
            let change = [(target, Change::Set(v.clone()))];
            match recoverable(trace.propose(&change, at.draws(first_lane + i as u64)))? {
                Some(w) => {
                    let ways = libm::log(n as f64) - self.scope.ways_back(trace);
                    let log = at.tempered(&w) + ways;
                    weights.log.push(if log.is_nan() { f64::NEG_INFINITY } else { log });
                    weights.structural |= w.appeared > 0 || w.vanished > 0;
                }
                None => {
                    weights.log.push(f64::NEG_INFINITY);
                    weights.failed += 1;
                }
            }
        }
        trace.rollback();
        Ok(weights)
    }
}

impl Kernel for Gibbs {
    fn name(&self) -> String {
        "gibbs".into()
    }

    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let Some((target, n)) = self.scope.pick(trace, &mut rng) else { return Ok(Outcome::default()) };
        let Some(values) = trace.dist(target).and_then(|d| d.support().finite_values()) else {
            return Ok(Outcome::default());
        };
        let before = trace.stored(target);
        let forward = self.weights(trace, at, target, &values, n, 0)?;
        let chosen = sample_log(&forward.log, &mut rng);
        let mut outcome = Outcome { proposals: 1, failed: forward.failed, ..Default::default() };
        if Some(&values[chosen]) == before.as_ref() {
            return Ok(outcome);
        }
        let change = [(target, Change::Set(values[chosen].clone()))];
        // The same lane: the same draws as when it was weighed.
        let Some(w) = recoverable(trace.propose(&change, at.draws(chosen as u64)))? else { return Ok(outcome) };
        if !forward.structural && w.appeared == 0 && w.vanished == 0 {
            trace.commit();
            outcome.accepted = 1;
            return Ok(outcome);
        }
        let removed = trace.removed();
        trace.commit();
        let selection = self.scope.selection(trace);
        let n_after = trace.targets(selection).len();
        let lanes = values.len() as u64;
        let backward = self.weights(trace, at, target, &values, n_after, lanes)?;
        let Some(old) = before.and_then(|b| values.iter().position(|v| *v == b)) else { return Ok(outcome) };
        // The old state itself stands for the old value: its weight back is minus its weight forth.
        let mut back = backward.log;
        back[old] = -forward.log[chosen];
        let ratio = log_sum_exp(&forward.log) - forward.log[chosen] - log_sum_exp(&back);
        if accepts(ratio, &mut rng) {
            outcome.accepted = 1;
        } else {
            let undo = [(target, Change::Set(values[old].clone()))];
            trace.propose_constrained(&undo, &removed, at.draws(0))?;
            trace.commit();
        }
        Ok(outcome)
    }
}

/// An index with probability proportional to exp(log[i]).
fn sample_log(log: &[f64], rng: &mut Stream) -> usize {
    let total = log_sum_exp(log);
    let mut u = rng.uniform();
    let mut last = 0;
    for (i, l) in log.iter().enumerate() {
        let p = libm::exp(l - total);
        if p > 0.0 {
            last = i;
            if u < p {
                return i;
            }
            u -= p;
        }
    }
    last
}
