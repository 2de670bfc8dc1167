//! A population of states that shrinks to one while the likelihood is annealed.
//!
//! A single annealed chain that starts far from the posterior ends in whichever mode
//! attracted it first. A population explores several: its members take turns under the
//! same kernels, and as the power of the likelihood rises from b to b', each gains a
//! weight of likelihood^(b' - b), as in population annealing (Hukushima & Iba 2003) and
//! sequential Monte Carlo samplers (Del Moral, Doucet & Jasra 2006). The number of
//! members falls geometrically during the annealing, so that the remaining ones get more
//! of the time. Offspring are resampled by weight only when a third of the members has to
//! go: after few steps, likelihoods depend more on where a member began than on where it
//! is going. The population belongs to warm-up: its states are not draws.

use super::resampling::systematic;
use pcadlang_engine::trace::{Constraint, Draws, Trace, TraceResult};
use pcadlang_numerics::rng::Stream;
use serde::{Deserialize, Serialize};

/// Steps a member makes before it is the next one's turn: enough that switching members,
/// a full update, costs little in comparison.
const LEG: u64 = 16;

type State = Vec<(u64, Constraint)>;

/// A state, its log-likelihood, and the log of the weight it has gained since the last
/// resampling.
type Member = (State, f64, f64);

/// The members of a population; the chain's trace is in the state of the one whose turn
/// it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Population {
    members: Vec<Member>,
    first: usize,
    turn: usize,
    steps: u64,
    power: Option<f64>,
}

impl Population {
    /// One member per trace; the chain must be in the state of the first.
    pub fn new(traces: &[Trace]) -> Self {
        let members: Vec<_> = match traces {
            [_] => Vec::new(),
            _ => traces.iter().map(|t| (t.constraints(), t.log_likelihood(), 0.0)).collect(),
        };
        Population { first: members.len(), members, turn: 0, steps: 0, power: None }
    }

    /// True if the population is valid; one read from a checkpoint may not be.
    pub fn fits(&self) -> bool {
        (self.members.is_empty() || self.turn < self.members.len()) && self.steps < 1 << 60
    }

    /// Called after each step of the annealing, with the completed fraction of it and the
    /// corresponding power. Returns the power of the next step, which stays the same
    /// until every member has had its turn.
    ///
    /// # Errors
    /// Errors of the program.
    pub fn advance(
        &mut self,
        trace: &mut Trace,
        (share, power): (f64, f64),
        draws: Draws,
        rng: &mut Stream,
    ) -> TraceResult<f64> {
        let present = *self.power.get_or_insert(power);
        self.steps += 1;
        if self.members.len() < 2 {
            self.power = Some(power);
            return Ok(power);
        }
        if !self.steps.is_multiple_of(LEG) {
            return Ok(present);
        }
        self.keep(trace);
        self.turn += 1;
        if self.turn == self.members.len() {
            self.turn = 0;
            self.weigh(power - present);
            let left = libm::round(libm::pow(self.first as f64, 1.0 - share)) as usize;
            if 3 * left <= 2 * self.members.len() {
                self.resample(left.max(1), rng);
            }
            self.power = Some(power);
        }
        trace.restore(&self.members[self.turn].0, draws)?;
        Ok(self.power.unwrap_or(power))
    }

    /// Reduces the population to one member, chosen by weight at the full power, which
    /// becomes the state of the chain.
    ///
    /// # Errors
    /// Errors of the program.
    pub fn finish(&mut self, trace: &mut Trace, draws: Draws, rng: &mut Stream) -> TraceResult<()> {
        if self.members.len() > 1 {
            self.keep(trace);
            self.weigh(1.0 - self.power.unwrap_or(0.0));
            self.resample(1, rng);
            trace.restore(&self.members[0].0, draws)?;
        }
        self.members.clear();
        Ok(())
    }

    /// Stores the state of the chain as that of the member whose turn it is.
    fn keep(&mut self, trace: &Trace) {
        let member = &mut self.members[self.turn];
        (member.0, member.1) = (trace.constraints(), trace.log_likelihood());
    }

    /// Adds the log weights that members gain when the power of the likelihood rises by
    /// `step`.
    fn weigh(&mut self, step: f64) {
        // At an equal power the gain is 0, but 0 times infinity is NaN.
        if step != 0.0 {
            self.members.iter_mut().for_each(|m| m.2 += step * m.1);
        }
    }

    /// Resamples `left` offspring by weight.
    fn resample(&mut self, left: usize, rng: &mut Stream) {
        let top = self.members.iter().map(|m| m.2).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = match top {
            f64::NEG_INFINITY => vec![1.0; self.members.len()],
            _ => self.members.iter().map(|m| libm::exp(m.2 - top)).collect(),
        };
        let offspring = |i: usize| (self.members[i].0.clone(), self.members[i].1, 0.0);
        self.members = systematic(&weights, left, rng).into_iter().map(offspring).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::draw;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    fn population(log_likelihoods: &[f64]) -> Population {
        let state = |i: usize| {
            vec![(i as u64, Constraint::Stored(pcadlang_numerics::dist::Datum::Num(0.0)))]
        };
        let members: Vec<_> =
            log_likelihoods.iter().enumerate().map(|(i, l)| (state(i), *l, 0.0)).collect();
        Population { first: members.len(), members, turn: 0, steps: 0, power: None }
    }

    fn offspring(p: &Population, of: u64) -> usize {
        p.members.iter().filter(|m| m.0[0].0 == of).count()
    }

    #[test]
    fn offspring_are_in_proportion() {
        for seed in 0..200 {
            let mut rng = StreamKey::new(seed, 0, Purpose::POPULATION).stream(0, 0, 0);
            let mut p = population(&[0.0, libm::log(6.0), libm::log(3.0), f64::NEG_INFINITY]);
            p.weigh(0.25);
            p.weigh(0.75);
            p.resample(10, &mut rng);
            assert_eq!([0, 1, 2, 3].map(|i| offspring(&p, i)), [1, 6, 3, 0]);
            // At an equal power all members have the same probability, and their number
            // may fall.
            let mut p = population(&[-1e300, 5.0, 700.0, 0.0]);
            p.weigh(0.0);
            p.resample(2, &mut rng);
            assert_eq!(p.members.len(), 2);
            assert!((0..4).all(|i| offspring(&p, i) <= 1));
        }
    }

    #[test]
    fn impossible_members_leave_no_trace_of_nan() {
        let mut rng = StreamKey::new(1, 0, Purpose::POPULATION).stream(0, 0, 0);
        let mut p = population(&[f64::NEG_INFINITY, f64::NEG_INFINITY]);
        p.weigh(0.5);
        p.resample(2, &mut rng);
        assert_eq!(p.members.len(), 2);
    }

    /// Twelve members are reduced to eight, five, three, two and one as the power rises,
    /// not one by one.
    #[test]
    fn members_go_by_thirds() {
        let text = "assume x ~ normal(0, 1); observe normal(x, 1) = 0;";
        let begun: Vec<Trace> = (0..12).map(|i| draw(text, 1, i)).collect();
        let mut rng = StreamKey::new(1, 0, Purpose::POPULATION).stream(0, 0, 0);
        let (mut trace, mut p) = (begun[0].clone(), Population::new(&begun));
        let mut sizes = vec![12];
        for step in 0..=10_000 {
            let share = f64::from(step) / 10_000.0;
            p.advance(&mut trace, (share, share), Draws::default(), &mut rng).unwrap();
            if sizes.last() != Some(&p.members.len()) {
                sizes.push(p.members.len());
            }
        }
        assert_eq!(sizes, [12, 8, 5, 3, 2, 1]);
    }

    #[test]
    fn the_turns_of_all_members_are_equally_long() {
        let text = "assume x ~ normal(0, 1); observe normal(x, 1) = 0;";
        let begun: Vec<Trace> = (0..3).map(|i| draw(text, 1, i)).collect();
        let value = |t: &Trace| t.stored(t.all_targets()[0]);
        let mut rng = StreamKey::new(1, 0, Purpose::POPULATION).stream(0, 0, 0);
        let (mut trace, mut p) = (begun[0].clone(), Population::new(&begun));
        for step in 1..3 * LEG {
            p.advance(&mut trace, (0.0, 0.5), Draws::default(), &mut rng).unwrap();
            assert_eq!(value(&trace), value(&begun[(step / LEG) as usize]), "after step {step}");
        }
    }
}
