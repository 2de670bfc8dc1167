//! Warm-up: loops whose draws are discarded, in which kernels adapt and the likelihood
//! may be annealed.

use super::place::ResumePoint;
use super::runner::{Flow, Runner};
use super::search_time;
use crate::calls::error::fail;
use crate::run::ChainError;
use pcadlang_engine::lang::plan::{Formula, Step};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Limits;
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};
use pcadlang_syntax::span::Span;
use std::sync::atomic::Ordering;

impl<'a> Runner<'a> {
    pub(super) fn warmup(
        &mut self,
        count: &Formula,
        body: &'a [Step],
        point: ResumePoint,
    ) -> Result<Flow, ChainError> {
        let (mut i, passes, first) = self.passes(count, point)?;
        self.in_warmup = true;
        self.progress.warming.fetch_add(1, Ordering::Relaxed);
        let mut flow = Flow::Next;
        // More passes than the program says are made only while they make steps: a loop
        // without kernels would never end.
        let unbounded = self.options.warmup.is_some();
        while i < passes || unbounded && (i == 0 || self.step > first) {
            flow = self.pass((i, passes, first), body)?;
            i += 1;
            if flow != Flow::Next {
                break;
            }
        }
        let (draws, mut rng) = (self.predictive(), self.population_stream());
        self.population.finish(&mut self.trace, draws, &mut rng)?;
        self.in_warmup = false;
        self.progress.warming.fetch_sub(1, Ordering::Relaxed);
        self.power = 1.0;
        self.warmup_steps = self.step;
        if let (None, Some(time)) = (search_time(self.options), self.options.time) {
            let left = time.saturating_sub(self.started.elapsed());
            let limits = self.trace.limits().clone();
            let stop = limits.stop.clone().or_within(Some(left));
            self.trace.set_limits(Limits { stop, ..limits });
        }
        Ok(if flow == Flow::End && self.is_cancelled() { Flow::End } else { Flow::Next })
    }

    /// `anneal(from)`: raises the power of the likelihood from 1/from to 1 over a
    /// warm-up.
    pub(super) fn anneal(&mut self, from: &Formula, span: Span) -> Result<Flow, ChainError> {
        if !self.in_warmup {
            return Err(fail(
                span,
                "`anneal` is allowed only in `warmup`, whose draws are discarded".into(),
            )
            .into());
        }
        let from = match self.value(from)? {
            Value::Num(t) if t >= 1.0 => t,
            v => {
                let message = format!("expected a temperature of at least 1, got {v}");
                return Err(fail(from.span, message).into());
            }
        };
        let (pass, of, _) = self.innermost().unwrap_or_default();
        let passed = pass as f64 / (of as f64).max(1.0);
        // Under a time limit the schedule follows the clock. The number of steps is
        // recorded, and a replay by steps counts passes instead.
        let share = match (self.options.warmup, self.options.time) {
            (Some(n), _) => self.step as f64 / (n.max(1) as f64),
            (None, Some(t)) => {
                let clock = self.started.elapsed().as_secs_f64() / (t.as_secs_f64() / 2.0);
                // While less than a search is made, it follows the steps if the clock is ahead.
                let least = self.options.search.warmup.max(1) as f64;
                passed.max(if self.step as f64 > least {
                    clock
                } else {
                    clock.min(self.step as f64 / least)
                })
            }
            (None, None) => passed,
        };
        let share = share.clamp(0.0, 1.0);
        let power = libm::pow(from, share - 1.0);
        let (draws, mut rng) = (self.predictive(), self.population_stream());
        self.power = self.population.advance(&mut self.trace, (share, power), draws, &mut rng)?;
        Ok(Flow::Next)
    }

    fn population_stream(&self) -> Stream {
        StreamKey::new(self.options.seed, self.chain, Purpose::POPULATION).stream(self.step, 0, 0)
    }
}
