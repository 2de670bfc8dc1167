//! Initial states: traces of positive probability, and an explanation when none is found.

use super::force::Forced;
use super::kernel::{Kernel, StepContext};
use super::kernels::{Exact, ProgramKernel, approach};
use pcadlang_engine::lang::address::Address;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{
    Change, ChoiceKind, Constraint, Draws, Limits, Selector, Target, Trace, TraceResult,
};
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_syntax::span::Span;
use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// How a chain starts: from one of a number of draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// The number of draws of positive probability.
    pub draws: u64,
    /// Where they come from, and which of them is taken.
    pub by: By,
    /// How many of the best are kept: with more than one, warm-up begins with a
    /// population that anneals.
    pub keep: usize,
    /// A time limit: once `least` draws have succeeded, and one in any case, no further ones are
    /// made after it.
    pub within: Option<Duration>,
    /// See `within`.
    pub least: u64,
}

/// Where the draws come from that a chain may start with, and which of them is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// From the prior: with probability proportional to its likelihood.
    Likelihood,
    /// From the prior: that of the highest log joint density.
    Best,
    /// Uniform in the unconstrained space, followed by a short ascent: with probability
    /// proportional to its density in that space.
    Density,
}

impl Default for Start {
    fn default() -> Self {
        Start { draws: 1, keep: 1, by: By::Likelihood, within: None, least: 0 }
    }
}

/// Half of the width of the interval of a uniform start: 2 as in Stan, and half of it after
/// every ten attempts, as a point in the middle may be possible where none further out is.
pub(crate) fn spread(attempt: u64) -> f64 {
    2.0 * libm::pow(0.5, (attempt / 10) as f64)
}

/// How many draws from the prior may have zero probability before that is an error.
pub(crate) const RETRIES: u64 = 1000;

/// Why a chain cannot start.
#[derive(Debug, Clone)]
pub enum StartError {
    /// The program failed.
    Run(Box<RunError>),
    /// Every draw had probability zero.
    Impossible(NoStart),
}

/// The terms with zero probability in the last draw.
#[derive(Debug, Clone, Default)]
pub struct NoStart {
    /// Observations and factors first, then choices.
    pub terms: Vec<ZeroTerm>,
    /// The first choices of that draw that are single numbers or truth values, with their
    /// values.
    pub drawn: Vec<(Address, Value)>,
}

/// A term of the joint density whose logarithm is -∞.
#[derive(Debug, Clone)]
pub struct ZeroTerm {
    /// Its address.
    pub address: Address,
    /// Its position in the program.
    pub span: Span,
    /// An observed value outside of the support of its distribution.
    pub outside: Option<String>,
}

impl fmt::Display for NoStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "all {RETRIES} draws from the prior have probability zero")
    }
}

/// Returns the first of at most `most` draws that does not fail with a recoverable error.
///
/// # Errors
/// The last attempt's error, or the first one that is not recoverable.
pub fn attempts<T>(most: u64, mut draw: impl FnMut(u64) -> TraceResult<T>) -> TraceResult<T> {
    let mut attempt = 0;
    loop {
        match draw(attempt) {
            Err(e) if e.is_recoverable() && attempt + 1 < most => attempt += 1,
            done => return done,
        }
    }
}

/// Draws from the prior and discards the draw, so that values which are computed once and
/// cached with the data are ready. An error is ignored: the chains will report it.
pub(super) fn draw_once(code: &Arc<Code>, seed: u64, limits: Limits) {
    let draws = Draws { key: StreamKey::new(seed, 0, Purpose::START), step: 0, substream: 0 };
    let _ = Trace::simulate(Arc::clone(code), draws, limits);
}

/// The traces a chain starts with, the best first: `how.keep` of them, or fewer if fewer
/// draws succeed.
///
/// # Errors
/// If the program fails, or if no draw has positive probability within a bounded number
/// of attempts.
pub fn starts(
    code: &Arc<Code>,
    seed: u64,
    chain: u32,
    how: Start,
    limits: Limits,
) -> Result<Vec<Trace>, StartError> {
    starts_from(code, (seed, chain), how, (None, &Forced::default()), limits)
}

/// As [`starts`], but each draw is moved to what a kernel of the program proposes from
/// it. If that does not depend on the draw, the draw is made with the values that the
/// kernel proposes, so that each is compared with the observations once. Forced choices
/// have their values in all of them.
pub(crate) fn starts_from(
    code: &Arc<Code>,
    (seed, chain): (u64, u32),
    how: Start,
    (from, forced): (Option<&ProgramKernel>, &Forced),
    limits: Limits,
) -> Result<Vec<Trace>, StartError> {
    let mut begun = Instant::now();
    let key = StreamKey::new(seed, chain, Purpose::START);
    let (limits, by) = (&limits, how.by);
    let mut source = StartDraws { code, seed, chain, key, by, from, forced, limits, last: None };
    // With what they are compared by, in descending order.
    let mut best: Vec<(f64, Trace)> = Vec::new();
    let mut found = 0;
    let mut last = None;
    for attempt in 0..how.draws.saturating_add(RETRIES) {
        let draw = source.draw(attempt);
        if attempt == 0 {
            // One-time preparation, such as the analysis of a photograph, does not count
            // against the time limit.
            begun = Instant::now();
        }
        match draw {
            Ok(None) => {}
            Ok(Some(t)) if t.log_joint() > f64::NEG_INFINITY => {
                found += 1;
                let at = StepContext::new(seed, chain, attempt).within(u64::MAX - 2);
                // The greatest of logs of weights plus Gumbel noise is at an index with
                // probability proportional to its weight.
                let noise = -libm::log(-libm::log(at.stream().open_uniform()));
                let rank = match by {
                    By::Best => t.log_joint(),
                    By::Likelihood => t.log_likelihood() + noise,
                    By::Density => free_density(&t) + noise,
                };
                let place = best.partition_point(|(b, _)| *b >= rank);
                if place < how.keep.max(1) {
                    best.insert(place, (rank, t.into_owned()));
                    best.truncate(how.keep.max(1));
                }
            }
            Ok(Some(t)) if found == 0 => last = Some(Ok(t.into_owned())),
            Ok(Some(_)) => {}
            Err(e) if e.is_recoverable() => last = Some(Err(e)),
            Err(e) => return Err(StartError::Run(e)),
        }
        let late = || found >= how.least && how.within.is_some_and(|t| begun.elapsed() >= t);
        if found > 0 && (limits.stop.is_asked() || late()) || found == 0 && attempt + 1 >= RETRIES {
            break;
        }
        // Once there is a state to start from, failed attempts count as draws too.
        if found >= how.draws || (found > 0 && attempt + 1 >= how.draws) {
            break;
        }
    }
    match last {
        _ if !best.is_empty() => Ok(best.into_iter().map(|(_, t)| t).collect()),
        Some(Ok(mut t)) => {
            // Finite choices can be drawn given the data, however unlikely that is by chance.
            let at = StepContext::new(seed, chain, u64::MAX);
            let mut exact = Exact::new(Selector::Kind(ChoiceKind::Finite));
            let drawn = forced.is_empty() && exact.step(&mut t, &at).is_ok();
            match drawn && t.log_joint() > f64::NEG_INFINITY {
                true => Ok(vec![t]),
                false => Err(StartError::Impossible(explain(&t))),
            }
        }
        Some(Err(e)) => Err(StartError::Run(e)),
        None => Err(StartError::Impossible(NoStart::default())),
    }
}

/// Where draws come from.
struct StartDraws<'a> {
    code: &'a Arc<Code>,
    seed: u64,
    chain: u32,
    key: StreamKey,
    by: By,
    from: Option<&'a ProgramKernel>,
    forced: &'a Forced,
    limits: &'a Limits,
    /// The last draw, of which the next is an update, if the kernel's proposal does not
    /// depend on the draw.
    last: Option<Trace>,
}

impl StartDraws<'_> {
    /// Makes a draw; `None` if the program is undefined where the kernel leads.
    fn draw(&mut self, attempt: u64) -> TraceResult<Option<Cow<'_, Trace>>> {
        let draws = Draws { key: self.key, step: attempt, substream: 0 };
        let spread = (self.by == By::Density).then(|| spread(attempt));
        let simulate = || self.forced.draw(self.code, (Vec::new(), spread), draws, self.limits);
        if self.by == By::Density {
            let mut trace = simulate()?;
            let at = StepContext::new(self.seed, self.chain, attempt).within(u64::MAX - 3);
            // Forced choices stay where they are.
            if self.forced.is_empty() {
                approach(&mut trace, &at)?;
            }
            return Ok(Some(Cow::Owned(trace)));
        }
        let Some(from) = self.from else { return Ok(Some(Cow::Owned(simulate()?))) };
        // Steps of the plan count from 0: this part is distinct from all of them.
        let at = StepContext::new(self.seed, self.chain, attempt).within(u64::MAX - 1);
        let Some(mut last) = self.last.take() else {
            let mut trace = simulate()?;
            if from.ignores_the_state() {
                self.last = Some(trace.clone());
            }
            let Some(()) = from.leap(&mut trace, &at)? else { return Ok(None) };
            self.forced.put(&mut trace, draws)?;
            return Ok(Some(Cow::Owned(trace)));
        };
        let given = self.forced.over(from.proposal(&mut last, &at)?);
        if redrawn(&mut last, &given, draws) {
            self.forced.put(&mut last, draws)?;
        } else {
            last = self.forced.draw(self.code, (given, None), draws, self.limits)?;
        }
        Ok(Some(Cow::Borrowed(self.last.insert(last))))
    }
}

/// The log joint density of a state in the unconstrained space; -∞ where it is undefined.
pub(crate) fn free_density(trace: &Trace) -> f64 {
    let jacobian = |t: &Target| trace.free_to_move(*t).map(|(_, jacobian)| jacobian);
    let jacobians: f64 = trace.all_targets().iter().filter_map(jacobian).sum();
    let density = trace.log_joint() + jacobians;
    if density.is_nan() { f64::NEG_INFINITY } else { density }
}

/// Draws all choices of a trace again, except for those that are given, by an update with the
/// same result as [`Trace::generate`]; false, with the trace as it was, if the update fails.
fn redrawn(trace: &mut Trace, given: &[(u64, Constraint)], draws: Draws) -> bool {
    let change = |t: &Target| {
        let hash = trace.address_hash(*t);
        match given.iter().find(|(of, _)| *of == hash) {
            Some((_, Constraint::Value(x))) => (*t, Change::Value(x.clone())),
            Some((_, Constraint::Stored(x))) => (*t, Change::Set(x.clone())),
            None => (*t, Change::Resample),
        }
    };
    let changes: Vec<_> = trace.all_targets().iter().map(change).collect();
    let done = trace.propose(&changes, draws).is_ok();
    if done {
        trace.commit()
    } else {
        trace.rollback()
    }
    done
}

/// The terms of a trace that have zero probability.
fn explain(t: &Trace) -> NoStart {
    let mut outside: HashMap<Address, String> = t.outside_support().into_iter().collect();
    let zero = t.impossible().into_iter();
    let zero =
        zero.map(|(address, span)| ZeroTerm { outside: outside.remove(&address), address, span });
    let single = |(address, value, _): (Address, Value, _)| match value {
        Value::Num(_) | Value::Bool(_) => Some((address, value)),
        _ => None,
    };
    NoStart {
        terms: zero.collect(),
        drawn: t.choices().into_iter().filter_map(single).take(6).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::compiled;

    /// Draws by updates of the draw before are those from scratch, also of choices that
    /// appear and vanish.
    #[test]
    fn draws_by_updates_are_those_from_scratch() {
        let text = "assume open ~ flip(0.5);
            fn wall() { thick ~ normal(0, 1); floor ~ iid(beta(2, 2), 3); thick + floor[0] }
            assume inside = if open { wall() } else { 0 };
            assume f ~ gp(mean = 0, cov = sq_exp(1, 0.5), at = [0, 0.5, 1]);
            assume x ~ normal(inside, 1);
            observe normal(f + x, 0.5) = [1, 2, 0];
            let n = 2 + 1;
            kernel near(m) { propose s ~ flip(0.5); propose @x ~ normal(m + (if s { 1 } else { 0 }), 0.1);
              propose @f ~ mv_normal([0, m, 0], chol = 0.1 * identity(n)); propose @open ~ flip(0.7); }
            infer { init(best_of(30, keep = 5, from = near(2))); repeat 1 { drift(@x); } }";
        let compiled_text = compiled(text);
        let plan = &compiled_text.plans[0];
        let kernels: Arc<[_]> = Arc::clone(&plan.kernels);
        let from = ProgramKernel::new(kernels, 0, vec![Value::Num(2.0)], Instant::now());
        assert!(from.ignores_the_state());
        let key = StreamKey::new(7, 0, Purpose::START);
        let limits = Limits::default();
        let (code, from) = (&compiled_text.code, Some(&from));
        let mut source = StartDraws {
            code,
            seed: 7,
            chain: 0,
            key,
            by: By::Best,
            from,
            forced: &Forced::default(),
            limits: &limits,
            last: None,
        };
        // Functions that make no choice are no part of the state either.
        let same = text.replace("normal(m +", "normal(sum(map(twice, [m])) - m +");
        let plan = &compiled(&format!("fn twice(x) {{ 2 * x }} {same}")).plans[0];
        let own = ProgramKernel::new(Arc::clone(&plan.kernels), 0, Vec::new(), Instant::now());
        assert!(own.ignores_the_state());
        // What depends on a choice is another matter.
        let other = text.replace("normal(m +", "normal(m + x +");
        let plan = &compiled(&other).plans[0];
        let own = ProgramKernel::new(Arc::clone(&plan.kernels), 0, Vec::new(), Instant::now());
        assert!(!own.ignores_the_state());
        let mut opened = 0;
        for attempt in 0..40 {
            let found = source.draw(attempt).unwrap().unwrap().into_owned();
            let draws = Draws { key, step: attempt, substream: 0 };
            if attempt == 0 {
                continue;
            }
            let at = StepContext::new(7, 0, attempt).within(u64::MAX - 1);
            let given = from.unwrap().proposal(&mut found.clone(), &at).unwrap();
            let scratch =
                Trace::generate(Arc::clone(code), given, draws, limits.clone()).unwrap().0;
            let choices = |t: &Trace| {
                let mut all = t.constraints();
                all.sort_by_key(|(hash, _)| *hash);
                all
            };
            assert_eq!(choices(&found), choices(&scratch), "{attempt}");
            assert_eq!(found.log_joint().to_bits(), scratch.log_joint().to_bits(), "{attempt}");
            opened += u32::from(found.constraints().len() > 3);
        }
        assert!(opened > 10 && opened < 39, "{opened}");
    }
}
