//! Gibbs updates of finite discrete choices by enumeration, in log space.
//!
//! If no value makes other choices appear or vanish, the new value comes from its exact
//! conditional. Otherwise the weight of a value is that of a single draw of the choices
//! that appear with it, and the move is a multiple-try Metropolis step as in Liu, Liang &
//! Wong (2000), with one try per value: the acceptance ratio uses the weights around the
//! new state, with fresh draws for all values but the old one.

use super::row::{KernelRow, SEL};
use crate::kernel::{
    Kernel, Outcome, Registered, SiteSelection, StepContext, accepts, recoverable,
};
use pcadlang_engine::trace::{Change, Target, Trace, TraceResult};
use pcadlang_numerics::dist::{Datum, Dist, Support};
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::Stream;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "gibbs",
    &[SEL],
    "Draws a selected finite discrete choice from its full conditional, by enumeration of \
     its values.",
    "\
for i in 0 .. 4 {
  z[i] ~ flip(0.3);
  observe normal(if z[i] { 1 } else { 0 }, 0.5) = 0.8 as y;
}
infer { repeat 100 { gibbs(@z[0]); collect z[0]; } }",
    |call| call.moving(|scope, _| Ok(Gibbs::new(scope))),
);

/// `gibbs(sel)`: draws one choice from its distribution given all others.
#[derive(Clone, Debug)]
pub struct Gibbs {
    scope: Registered,
    /// The values of the choice, their log weights, and the weights relative to the
    /// largest; kept between steps to avoid allocations.
    values: Vec<Datum>,
    /// The support that has these values.
    listed: Option<Support>,
    log: Vec<f64>,
    weights: Vec<f64>,
    /// True once a value was met that changes the set of choices: each is then proposed from
    /// the present state.
    apart: bool,
}

/// Properties of the weighed values of a choice.
#[derive(Clone, Copy, Debug, Default)]
struct Weighed {
    /// True if any of them changes the set of choices.
    structural: bool,
    failed: u32,
    /// The value whose proposal is pending.
    pending: Option<usize>,
}

impl Gibbs {
    /// A kernel for one of these choices at a time.
    pub fn new(scope: SiteSelection) -> Self {
        let scope = Registered::new(scope.single());
        let (values, listed, log, weights) = Default::default();
        Gibbs { scope, values, listed, log, weights, apart: false }
    }

    /// Lists the values of a support; false if they are infinitely many.
    fn list(&mut self, support: Support) -> bool {
        if self.listed.as_ref() != Some(&support) {
            self.listed = support.list_values(&mut self.values).then_some(support);
        }
        self.listed.is_some()
    }

    /// Computes the log weights of all values, relative to the state with value `old`,
    /// without updating the trace; `None` if that needs updates.
    fn weigh_beside(
        &mut self,
        trace: &Trace,
        at: &StepContext,
        target: Target,
        dist: &Dist,
        old: usize,
    ) -> Option<Weighed> {
        let log = &mut self.log;
        log.clear();
        let number = |w: f64| log.push(if w.is_nan() { f64::NEG_INFINITY } else { w });
        trace
            .weigh_values(target, dist, (&self.values, old), at.power, number)
            .then(Weighed::default)
    }

    /// As [`Gibbs::weigh_beside`], by updates from each value to the next, upwards and downwards
    /// from the present one: of a change point, only the terms between the two are computed.
    /// `None` if a value fails or changes the set of choices.
    fn walk(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        target: Target,
        old: usize,
    ) -> TraceResult<Option<Weighed>> {
        let mut weighed = Weighed::default();
        self.log.clear();
        self.log.resize(self.values.len(), 0.0);
        let upwards = old + 1..self.values.len();
        for (i, first) in upwards.map(|i| (i, old + 1)).chain((0..old).rev().map(|i| (i, old - 1)))
        {
            let (value, draws) = (self.values[i].clone(), at.draws(i as u64));
            let moved = match i == first {
                true => trace.propose(&[(target, Change::Set(value))], draws),
                false => match trace.propose_further(target, value, draws) {
                    Some(moved) => moved,
                    None => return Ok(None),
                },
            };
            match recoverable(moved)? {
                Some(w) if w.appeared == 0 && w.vanished == 0 => {
                    let log = at.tempered(&w);
                    self.log[i] = if log.is_nan() { f64::NEG_INFINITY } else { log };
                    weighed.pending = Some(i);
                }
                Some(_) => {
                    self.apart = true;
                    return Ok(None);
                }
                None => return Ok(None),
            }
        }
        Ok(Some(weighed))
    }

    /// As [`Gibbs::weigh_beside`], by updates. `ways` is minus the log probability of
    /// picking the choice in the present state; value `i` uses the substream
    /// `first_substream + i`.
    fn weigh(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        target: Target,
        old: usize,
        (ways, first_substream): (f64, u64),
    ) -> TraceResult<Weighed> {
        let mut weighed = Weighed::default();
        self.log.clear();
        for (i, v) in self.values.iter().enumerate() {
            if i == old {
                self.log.push(0.0);
                continue;
            }
            let change = [(target, Change::Set(v.clone()))];
            match recoverable(trace.propose(&change, at.draws(first_substream + i as u64)))? {
                Some(w) => {
                    let log = at.tempered(&w) + (ways - self.scope.reverse_selection(trace));
                    self.log.push(if log.is_nan() { f64::NEG_INFINITY } else { log });
                    weighed.structural |= w.appeared > 0 || w.vanished > 0;
                    weighed.pending = Some(i);
                }
                None => {
                    self.log.push(f64::NEG_INFINITY);
                    weighed.failed += 1;
                    weighed.pending = None;
                }
            }
        }
        Ok(weighed)
    }
}

impl Kernel for Gibbs {
    fn name(&self) -> String {
        "gibbs".into()
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let Some((target, n)) = self.scope.pick(trace, &mut rng) else {
            return Ok(Outcome::default());
        };
        let stored = trace.stored(target);
        let Some(dist) = trace.dist(target).filter(|d| self.list(d.support())) else {
            return Ok(Outcome::default());
        };
        let Some(old) = self.values.iter().position(|v| Some(v) == stored.as_ref()) else {
            return Ok(Outcome::default());
        };
        let forward = match self.weigh_beside(trace, at, target, &dist, old) {
            Some(forward) => forward,
            None => {
                let walks = self.values.len() > 2 && !self.apart;
                match if walks { self.walk(trace, at, target, old)? } else { None } {
                    Some(forward) => forward,
                    None => self.weigh(trace, at, target, old, (libm::log(n as f64), 0))?,
                }
            }
        };
        let chosen = sample_log(&self.log, &mut self.weights, &mut rng);
        let other = |(i, l): (usize, &f64)| i != old && *l > f64::NEG_INFINITY;
        let possible = u32::from(self.log.iter().enumerate().any(other));
        let failed = forward.failed;
        let mut outcome =
            Outcome { proposals: 1, failed, possible, ..Default::default() }.at(target);
        if chosen == old {
            trace.rollback();
            return Ok(outcome);
        }
        if forward.pending != Some(chosen) {
            let change = [(target, Change::Set(self.values[chosen].clone()))];
            // The same substream gives the same draws as when the value was weighed.
            if recoverable(trace.propose(&change, at.draws(chosen as u64)))?.is_none() {
                return Ok(outcome);
            }
        }
        if !forward.structural {
            trace.commit();
            outcome.accepted = 1;
            return Ok(outcome);
        }
        let (forth, log_forward) = (self.log[chosen], log_sum_exp(&self.log));
        let removed = trace.removed();
        trace.commit();
        let ways = self.scope.reverse_selection(trace);
        self.weigh(trace, at, target, chosen, (ways, self.values.len() as u64))?;
        trace.rollback();
        // The old state itself represents the old value: its weight relative to the new
        // state is minus the weight of the forward move.
        self.log[old] = -forth;
        if accepts(log_forward - forth - log_sum_exp(&self.log), &mut rng) {
            outcome.accepted = 1;
        } else {
            let undo = [(target, Change::Set(self.values[old].clone()))];
            trace.propose_constrained(&undo, &removed, at.draws(0))?;
            trace.commit();
        }
        Ok(outcome)
    }
}

/// Draws an index with probability proportional to exp(log[i]), at least one of which is
/// not zero.
fn sample_log(log: &[f64], weights: &mut Vec<f64>, rng: &mut Stream) -> usize {
    let max = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    weights.clear();
    weights.extend(log.iter().map(|l| if *l == max { 1.0 } else { libm::exp(l - max) }));
    rng.weighted(weights, weights.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pick;
    use pcadlang_engine::trace::{ChoiceKind, Selector};

    /// One program whose choices do not depend on the value, and one in which one of the
    /// values has an additional choice.
    #[test]
    fn a_step_is_one_proposal_accepted_where_the_value_changes() {
        let texts = [
            "assume k ~ categorical([1, 2, 3]); observe normal(k, 1) = 1;",
            "assume k ~ categorical([1, 2, 3]); assume m = if k == 0 { x ~ normal(0, 1); x } else { 0.5 * k };
             observe normal(m, 1) = 1;",
        ];
        for text in texts {
            let mut trace = crate::testing::trace(text, 1);
            let finite = Selector::Kind(ChoiceKind::Finite);
            let selection = trace.select(&finite);
            let k = trace.targets(selection)[0];
            let mut kernel = Gibbs::new(SiteSelection { selector: finite, pick: Pick::One });
            let mut moves = 0;
            for step in 0..200 {
                let before = trace.stored(k);
                let outcome = kernel.step(&mut trace, &StepContext::new(1, 0, step)).unwrap();
                let moved = u32::from(trace.stored(k) != before);
                assert_eq!(
                    (outcome.proposals, outcome.accepted, outcome.failed),
                    (1, moved, 0),
                    "{text}, step {step}"
                );
                moves += moved;
            }
            assert!((1..200).contains(&moves), "{text}: {moves}");
        }
    }

    /// Weights by a walk over the values are those of each value by itself, to the last bit, also
    /// where values are impossible, and where the state is.
    #[test]
    fn a_walk_gives_the_weights_of_single_updates() {
        let rates = "for i in 0 .. 30 { observe poisson(if i < t { a } else { b }) = y[i] as y; }";
        let map = "let r = map(fn(i) { if t > i { a } else { b } }, 0 .. 30);
            for i in 0 .. 30 { observe poisson(r[i]) = y[i] as y; }";
        let other = "for i in 0 .. 30 { observe poisson(if i <= 0.5 * t or t == 7 { a } else { b }) = y[i] as y; }
            observe normal(t + a + b, 3) = 9;";
        let edge = "for i in 0 .. 30 { observe poisson(if i < t { a } else { b }) = y[i] as y; }
            observe uniform(0, t) = 5;";
        for body in [rates, map, other, edge] {
            let text = format!(
                "let y = map(fn(i) {{ (i * 7) % 5 }}, 0 .. 30); assume a ~ gamma(2, 1); assume b ~ gamma(2, 1);
                 assume t ~ uniform_discrete(1, 29); {body}"
            );
            let mut trace = crate::testing::trace(&text, 1);
            let selector = Selector::Kind(ChoiceKind::Finite);
            let selection = trace.select(&selector);
            let t = trace.targets(selection)[0];
            let mut kernel = Gibbs::new(SiteSelection { selector, pick: Pick::One });
            assert!(kernel.list(trace.dist(t).unwrap().support()));
            let mut moved = 0;
            for step in 0..40 {
                let at = StepContext::new(1, 0, step);
                let stored = trace.stored(t);
                let old = kernel.values.iter().position(|v| Some(v) == stored.as_ref()).unwrap();
                kernel.walk(&mut trace, &at, t, old).unwrap().unwrap();
                let walked = kernel.log.clone();
                kernel.weigh(&mut trace, &at, t, old, (0.0, 0)).unwrap();
                let bits = |log: &[f64]| log.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&walked), bits(&kernel.log), "{body}, step {step}");
                trace.rollback();
                let before = trace.log_joint();
                kernel.step(&mut trace, &at).unwrap();
                moved += u32::from(trace.log_joint() != before);
            }
            assert!(moved > 5, "{body}: {moved}");
        }
    }
}
