//! Runs a plan on a chain, step by step.

use super::place::{PlanPosition, ResumePoint};
use crate::calls::error::fail;
use crate::calls::formula::{PlanEnv, evaluate};
use crate::calls::selection::selector;
use crate::draws::{DrawRow, KernelStats, Sink};
use crate::kernel::{Kernel, StepContext};
use crate::plain::Plain;
use crate::population::Population;
use crate::record::Recorder;
use crate::run::{ChainError, ChainResult, Progress, RunOptions};
use crate::sites::Sites;
use crate::state::StateError;
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::error::{FaultKind, RunError};
use pcadlang_engine::lang::plan::{Formula, Plan, Step, StepKind, Variable};
use pcadlang_engine::lang::value::{Extent, Value};
use pcadlang_engine::trace::{Constraint, Draws, Limits, Selector, Stop, Trace};
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// How a statement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flow {
    Next,
    /// `stop`: ends the enclosing loop.
    Stop,
    /// Ends the run: steps or time used up, or cancelled.
    End,
}

/// A kernel that has run, the signature that identifies it, and what it did.
pub(super) struct Instance {
    pub signature: String,
    /// `None` if it comes from a checkpoint and has not been used since.
    pub kernel: Option<Box<dyn Kernel>>,
    /// The kernel's state in the checkpoint, until it is first used.
    pub saved: Vec<u8>,
    pub stats: KernelStats,
}

impl Instance {
    fn into_stats(self) -> KernelStats {
        match self.kernel {
            Some(kernel) => KernelStats {
                log_evidence: kernel.log_evidence(),
                step_size: kernel.step_size(),
                ..self.stats
            },
            None => self.stats,
        }
    }
}

pub(super) struct Runner<'a> {
    pub code: &'a Arc<Code>,
    pub plan: &'a Plan,
    pub options: &'a RunOptions,
    pub progress: &'a Progress,
    pub sink: &'a mut dyn Sink,
    pub chain: u32,
    pub trace: Trace,
    /// The variables of the block, and of the declared kernels being applied.
    pub variables: Vec<Value>,
    /// Where those of the innermost declared kernel begin.
    pub base: usize,
    pub instances: Vec<Instance>,
    /// The kernel of each call whose arguments are constant, once it has been built.
    pub calls: Vec<Option<usize>>,
    pub sites: Sites,
    pub recorder: Recorder,
    pub frozen: Selector,
    pub started: Instant,
    pub step: u64,
    pub warmup_steps: u64,
    pub in_warmup: bool,
    loops: u32,
    pub power: f64,
    pub population: Population,
    pub best: Option<(f64, Vec<(u64, Constraint)>)>,
    pub draws: u64,
    /// Proposals, accepted proposals and divergences up to the last draw.
    pub counted: [u64; 3],
    /// The statements being run, the outermost first.
    pub path: Vec<PlanPosition>,
    /// Where a checkpoint resumes, the outermost statement first; empty once the chain
    /// has got there.
    pub resume_path: VecDeque<PlanPosition>,
    /// True if the plan is finished.
    pub finished: bool,
    /// The number of checkpoints requested so far.
    pub asked: u64,
}

impl<'a> Runner<'a> {
    /// A chain at the beginning of a plan.
    pub fn new(
        code: &'a Arc<Code>,
        plan: &'a Plan,
        options: &'a RunOptions,
        progress: &'a Progress,
        sink: &'a mut dyn Sink,
        (chain, started): (u32, Instant),
        (mut trace, population): (Trace, Population),
    ) -> Self {
        trace.set_incremental(options.incremental);
        Runner {
            code,
            plan,
            options,
            progress,
            sink,
            chain,
            trace,
            variables: Vec::new(),
            base: 0,
            instances: Vec::new(),
            calls: Vec::new(),
            sites: Sites::default(),
            recorder: Recorder::new(plan),
            frozen: Selector::Nothing,
            started,
            step: 0,
            warmup_steps: 0,
            in_warmup: false,
            loops: 0,
            power: 1.0,
            population,
            best: None,
            draws: 0,
            counted: [0; 3],
            path: Vec::new(),
            resume_path: VecDeque::new(),
            finished: false,
            asked: 0,
        }
    }

    /// Runs the plan to its end.
    ///
    /// # Errors
    /// If the program or the sink fails.
    pub fn run(mut self) -> Result<ChainResult, ChainError> {
        if !self.finished {
            let flow = match self.body(&self.plan.steps) {
                // A step that was stopped in the middle is abandoned: the draws and
                // checkpoints before it remain.
                Err(ChainError::Run(e)) if e.kind == FaultKind::Stopped && self.draws > 0 => {
                    self.resume_path.clear();
                    Flow::End
                }
                flow => flow?,
            };
            if !self.resume_path.is_empty() {
                return Err(StateError::new("the checkpoint belongs to another plan").into());
            }
            self.finished = flow != Flow::End;
            if self.draws == 0 {
                // What `collect` would have recorded, so that all chains have the same columns.
                let collected = self.plan.collected();
                self.record(collected.as_deref())?;
            }
            if self.finished {
                self.keep(None)?;
            }
        }
        // Later uses of the last state are not subject to the run's time limit.
        self.trace.set_limits(Limits { stop: Stop::default(), ..self.options.limits.clone() });
        let seconds = self.started.elapsed().as_secs_f64();
        let (steps, warmup) = (self.step - self.warmup_steps, self.warmup_steps);
        self.sink.chain_done(self.chain, steps, warmup, seconds).map_err(ChainError::Sink)?;
        Ok(ChainResult {
            last: self.trace,
            best: self.best,
            steps,
            warmup,
            draws: self.draws,
            observed: self.recorder.observed().clone(),
            kernels: self.instances.into_iter().map(Instance::into_stats).collect(),
            sites: self.sites.into_stats(),
            seconds,
            contradicted: None,
        })
    }

    pub fn at(&self) -> StepContext {
        let at = StepContext::new(self.options.seed, self.chain, self.step);
        StepContext { adapting: self.in_warmup, power: self.power, ..at }
    }

    /// The randomness of what the state does not determine: predictions, and choices that
    /// no observation depends on. It is new after every step and after every draw.
    pub fn predictive(&self) -> Draws {
        let key = StreamKey::new(self.options.seed, self.chain, Purpose::PREDICT);
        Draws { key, step: self.step, substream: self.draws }
    }

    /// The environment of expressions.
    pub fn env(&mut self) -> PlanEnv<'_> {
        let draws = self.predictive();
        let (started, steps) = (self.started, self.step);
        let variables = self.variables.get(self.base..).unwrap_or_default();
        PlanEnv { trace: &mut self.trace, variables, draws, started, steps, moved: None }
    }

    pub fn value(&mut self, e: &Formula) -> Result<Value, Box<RunError>> {
        let v = evaluate(e, &mut self.env())?;
        match v.extent() {
            Extent::Fits => Ok(v),
            _ => {
                Err(fail(e.span, "this value has too many elements, or is nested too deep".into()))
            }
        }
    }

    pub fn count(&mut self, e: &Formula) -> Result<u64, Box<RunError>> {
        match self.value(e)? {
            Value::Num(x) if x >= 0.0 && x == libm::trunc(x) => Ok(x as u64),
            v => Err(fail(e.span, format!("expected a whole number of repetitions, got {v}"))),
        }
    }

    /// Applies the program's `freeze` statements.
    pub fn freeze(&mut self) -> Result<(), ChainError> {
        for f in &*self.plan.freezes {
            let s = selector(f, &mut self.env())?;
            self.frozen = match std::mem::replace(&mut self.frozen, Selector::Nothing) {
                Selector::Nothing => s,
                old => Selector::Union(Box::new(old), Box::new(s)),
            };
        }
        Ok(())
    }

    /// Runs statements in order, starting where a checkpoint resumes.
    pub fn body(&mut self, steps: &'a [Step]) -> Result<Flow, ChainError> {
        let level = self.path.len();
        let mut back = self.resume_path.pop_front();
        let first = back.as_ref().map_or(0, |p| p.statement);
        for (statement, s) in steps.iter().enumerate().skip(first) {
            let place = back.take().unwrap_or(PlanPosition {
                statement,
                depth: self.variables.len(),
                point: ResumePoint::Begins,
            });
            let point = place.point.clone();
            self.path.truncate(level);
            self.path.push(place);
            match self.statement(s, None, point)? {
                Flow::Next => {}
                flow => {
                    self.path.truncate(level);
                    return Ok(flow);
                }
            }
        }
        self.path.truncate(level);
        Ok(Flow::Next)
    }

    /// Records how far the present statement has got.
    pub fn note(&mut self, point: ResumePoint) {
        if let Some(place) = self.path.last_mut() {
            place.point = point;
        }
    }

    /// Drops the variables that were added since the present statement began.
    pub fn leave(&mut self) {
        self.variables.truncate(self.depth());
    }

    /// The number of variables when the present statement began.
    pub fn depth(&self) -> usize {
        self.path.last().map_or(0, |p| p.depth)
    }

    /// Binds a variable. Those of statements that have ended are dropped.
    fn bind(&mut self, variable: Variable, value: Value) {
        self.variables.truncate(self.base + variable);
        self.variables.push(value);
    }

    /// The innermost loop that counts its passes: the pass, their number, and the step at
    /// which it began.
    pub fn innermost(&self) -> Option<(u64, u64, u64)> {
        self.path.iter().rev().find_map(|p| match p.point {
            ResumePoint::Loop { pass, of, first } => Some((pass, of, first)),
            _ => None,
        })
    }

    /// Runs a statement; `arm` is its index in a `mix`.
    pub fn statement(
        &mut self,
        s: &'a Step,
        arm: Option<usize>,
        point: ResumePoint,
    ) -> Result<Flow, ChainError> {
        match &s.kind {
            StepKind::Init(_) => Ok(Flow::Next),
            StepKind::Anneal(from) => self.anneal(from, s.span),
            StepKind::Warmup(count, body) => self.warmup(count, body, point),
            StepKind::Repeat(count, body) => self.repeat(count, body, point),
            StepKind::Every(count, body) => {
                // When resuming within the body, it is known to be due.
                if !self.resume_path.is_empty() {
                    return self.body(body);
                }
                let n = self.count(count)?.max(1);
                match self.innermost() {
                    Some((pass, ..)) if (pass + 1).is_multiple_of(n) => self.body(body),
                    _ => Ok(Flow::Next),
                }
            }
            StepKind::Mix(arms) => self.mix(arms, point),
            StepKind::For(items, variable, body) => {
                let (begin, items) = match point {
                    ResumePoint::Items { item, all: Some(all) } => {
                        (item, all.iter().map(Plain::value).collect())
                    }
                    _ => (0, self.value(items)?.passes()),
                };
                let all: Option<Vec<Plain>> = items.iter().map(Plain::of).collect();
                let all: Option<Arc<[Plain]>> = all.map(Arc::from);
                for (item, value) in items.into_iter().enumerate().skip(begin) {
                    self.note(ResumePoint::Items { item, all: all.clone() });
                    if self.resume_path.is_empty() {
                        self.bind(*variable, value);
                    }
                    let flow = self.body(body)?;
                    self.leave();
                    match flow {
                        Flow::Next => {}
                        Flow::Stop => break,
                        Flow::End => return Ok(Flow::End),
                    }
                }
                Ok(Flow::Next)
            }
            StepKind::StopWhen(cond) => match self.value(cond)? {
                Value::Bool(true) => Ok(Flow::Stop),
                Value::Bool(false) => Ok(Flow::Next),
                v => {
                    Err(fail(cond.span, format!("`stop when` needs a bool, got {}", v.type_name()))
                        .into())
                }
            },
            StepKind::Collect(columns) => {
                if !self.in_warmup {
                    self.record(Some(columns))?;
                }
                Ok(Flow::Next)
            }
            StepKind::Let(variable, value) => {
                let v = self.value(value)?;
                self.bind(*variable, v);
                Ok(Flow::Next)
            }
            StepKind::Propose(..)
            | StepKind::Draw(..)
            | StepKind::Map(..)
            | StepKind::MapDrawn(..) => {
                Err(fail(s.span, "`propose` belongs in a kernel".into()).into())
            }
            StepKind::Apply(call) => self.apply(call, arm, point),
        }
    }

    /// The pass, the number of passes and the first step of a loop: at its beginning, or
    /// where a checkpoint resumes.
    pub fn passes(
        &mut self,
        count: &Formula,
        point: ResumePoint,
    ) -> Result<(u64, u64, u64), ChainError> {
        match point {
            ResumePoint::Loop { pass, of, first } => Ok((pass, of, first)),
            _ => Ok((0, self.count(count)?, self.step)),
        }
    }

    fn repeat(
        &mut self,
        count: &Formula,
        body: &'a [Step],
        point: ResumePoint,
    ) -> Result<Flow, ChainError> {
        let (mut i, passes, first) = self.passes(count, point)?;
        let outermost = self.loops == 0 && !self.in_warmup;
        let unbounded = outermost && (self.options.steps.is_some() || self.options.time.is_some());
        while i < passes || unbounded && (i == 0 || self.step > first) {
            let flow = self.pass((i, passes, first), body)?;
            i += 1;
            match flow {
                Flow::Next => {}
                Flow::Stop => break,
                Flow::End => return Ok(Flow::End),
            }
            if outermost && !self.recorder.collects() {
                self.record(None)?;
            }
        }
        Ok(Flow::Next)
    }

    /// Runs one pass of a loop.
    pub fn pass(
        &mut self,
        (i, of, first): (u64, u64, u64),
        body: &'a [Step],
    ) -> Result<Flow, ChainError> {
        self.note(ResumePoint::Loop { pass: i, of, first });
        if self.loops == 0 {
            self.progress.pass.store(i, Ordering::Relaxed);
            self.progress.passes.store(of, Ordering::Relaxed);
        }
        // However late it is, a warm-up and what follows make a step each: a state that has not
        // moved would be a draw from the prior.
        let is_first = i == 0 && self.used() == 0;
        if self.resume_path.is_empty() && (self.is_done() || self.is_late() && !is_first) {
            self.keep(None)?;
            return Ok(Flow::End);
        }
        self.loops += 1;
        let flow = self.body(body);
        self.loops -= 1;
        self.leave();
        flow
    }

    /// True if the run was cancelled: by its progress, whose flag is among those of the
    /// limits, or by its callback.
    pub fn is_cancelled(&self) -> bool {
        self.options.limits.stop.is_set()
            || self.options.callback.as_ref().is_some_and(|w| w.is_over())
    }

    /// Waits while the run is paused. The chain's clock is stopped meanwhile.
    pub fn pause(&mut self) {
        let waited = self.progress.pause.wait(|| self.is_cancelled());
        self.started = self.started.checked_add(waited).unwrap_or(self.started);
        let limits = self.trace.limits().clone();
        let stop = limits.stop.clone().later(waited);
        self.trace.set_limits(Limits { stop, ..limits });
    }

    /// True if the run, or its warm-up, has used up its steps or time.
    pub fn is_over(&self) -> bool {
        self.is_done() || self.is_late()
    }

    /// The steps of the warm-up, or of what follows it.
    fn used(&self) -> u64 {
        self.step - self.warmup_steps
    }

    /// True if the run is cancelled, or it or its warm-up has made its steps.
    fn is_done(&self) -> bool {
        let bound = if self.in_warmup { self.options.warmup } else { self.options.steps };
        self.is_cancelled() || bound.is_some_and(|n| self.used() >= n)
    }

    /// True if the run, or its warm-up, has used up its time. A warm-up whose steps are given
    /// makes all of them, and any makes those of a search.
    fn is_late(&self) -> bool {
        let searches = self.options.warmup.is_some() || self.used() < self.options.search.warmup;
        match self.options.time {
            Some(_) if self.in_warmup && searches => false,
            Some(t) => self.started.elapsed() >= if self.in_warmup { t / 2 } else { t },
            None => false,
        }
    }

    /// Passes a checkpoint to the sink, if it takes any: at the beginning of the present
    /// statement, or as far in it as `point` says. A chain with variables that are not
    /// plain data has no checkpoints.
    pub fn keep(&mut self, point: Option<ResumePoint>) -> Result<(), ChainError> {
        if !self.sink.takes_checkpoints() {
            return Ok(());
        }
        if let Some(checkpoint) = self.checkpoint(point) {
            self.sink.checkpoint(&checkpoint).map_err(ChainError::Sink)?;
        }
        Ok(())
    }

    /// Records a draw.
    pub fn record(&mut self, collected: Option<&[(String, Operand)]>) -> Result<(), ChainError> {
        let draws = self.predictive();
        let mut values = self.recorder.values(self.code, &mut self.trace, collected, draws)?;
        if self.options.pointwise {
            self.recorder.add_pointwise(&self.trace, &mut values);
        }
        let (values, more) = self.recorder.row(&values);
        if more || self.draws == 0 {
            self.sink.columns(self.recorder.columns()).map_err(ChainError::Sink)?;
        }
        let log_joint = self.trace.log_joint();
        let sum =
            |f: fn(&KernelStats) -> u64| self.instances.iter().map(|i| f(&i.stats)).sum::<u64>();
        let now = [sum(|s| s.proposals), sum(|s| s.accepted), sum(|s| s.divergent)];
        let since = |i: usize| now[i].saturating_sub(self.counted[i]);
        let [proposals, accepted, divergent] = [since(0), since(1), since(2)];
        self.counted = now;
        let row = DrawRow {
            chain: self.chain,
            draw: self.draws,
            step: self.step,
            log_joint,
            log_prior: self.trace.log_prior(),
            log_likelihood: self.trace.log_likelihood(),
            acceptance: accepted as f64 / proposals as f64,
            divergent,
            values,
        };
        self.sink.draw(&row).map_err(ChainError::Sink)?;
        if let Some(callback) = &self.options.callback {
            callback.draw(self.chain, &mut self.trace, draws);
        }
        self.draws += 1;
        if self.best.as_ref().is_none_or(|(b, _)| log_joint > *b) {
            self.best = Some((log_joint, self.trace.constraints()));
        }
        Ok(())
    }
}
