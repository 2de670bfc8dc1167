//! Running an inference block: one chain, statement by statement.

pub(super) mod banks;
mod warmup;

use super::build::{arguments, build, is_constant};
use super::draws::{DrawRow, KernelStats, Sink, SiteStats};
use super::expr::{Scope, evaluate};
use super::init::{StartError, start_of, starts};
use super::kernel::{At, Kernel, Outcome};
use super::kernels::own::proposes;
use super::neighbours::Banks;
use super::population::Population;
use super::record::Recorder;
use super::selection::{fail, selector};
use super::sites::Sites;
use crate::lang::code::Code;
use crate::lang::error::RunError;
use crate::lang::value::Value;
use crate::rng::{Purpose, StreamKey};
use crate::syntax::ast::{Arg, Expr, ExprKind, KStmt, KStmtKind, KernelDecl, MixArm};
use crate::trace::{Constraint, Draws, Limits, Selector, Trace};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Bounds and settings of a run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The seed: same seed, same draws.
    pub seed: u64,
    /// Kernel applications per chain after warm-up, in place of the outermost `repeat`'s count.
    pub steps: Option<u64>,
    /// Kernel applications per chain in warm-up, in place of what the program says.
    pub warmup: Option<u64>,
    /// Time in all; the run ends at the next step. At most half of it goes to warm-up.
    pub time: Option<Duration>,
    /// False: every update re-runs the whole program.
    pub incremental: bool,
    /// Bounds on what the program may build.
    pub limits: Limits,
    /// Who looks at every draw.
    pub watch: Option<Arc<dyn Watch>>,
    /// Who finds the neighbours that `knn` proposes from.
    pub banks: Option<Arc<dyn Banks>>,
    /// Whether to count what single-site kernels do by address; it costs a few percent of a fast step.
    pub sites: bool,
}

impl Default for RunOptions {
    fn default() -> Self {
        RunOptions {
            seed: 0,
            steps: None,
            warmup: None,
            time: None,
            incremental: true,
            limits: Limits::default(),
            watch: None,
            banks: None,
            sites: false,
        }
    }
}

/// Looks at the state of a chain whenever a draw is recorded.
pub trait Watch: fmt::Debug + Send + Sync {
    /// A draw of a chain has been recorded, and this is its state. What it asks for and no observation does is drawn from
    /// `draws`. It leaves the state as it is, unless it is there to change it ([`super::calibration::geweke()`]): the chain goes on
    /// from what it leaves. Draws of one chain come in order, chains in any.
    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws);
}

/// What is shared between the chains and whoever watches them.
#[derive(Debug, Default)]
pub struct Progress {
    /// Set to end the run at the next step.
    pub cancelled: AtomicBool,
    /// Steps of all chains.
    pub steps: AtomicU64,
    /// The best log joint density of any chain, as bits.
    pub best: AtomicU64,
}

/// What a chain leaves.
#[derive(Debug)]
pub struct ChainResult {
    /// Its last state.
    pub last: Trace,
    /// The choices of its best recorded draw, and its log joint density.
    pub best: Option<(f64, Vec<(u64, Constraint)>)>,
    /// Kernel applications after and in warm-up.
    pub steps: u64,
    /// See `steps`.
    pub warmup: u64,
    /// Draws recorded.
    pub draws: u64,
    /// What the kernels did.
    pub kernels: Vec<KernelStats>,
    /// What single-site kernels did, by address, if that was asked for.
    pub sites: Vec<SiteStats>,
    /// Wall time.
    pub seconds: f64,
}

/// Why a chain ended early.
#[derive(Debug)]
pub enum ChainError {
    /// It could not start.
    Start(StartError),
    /// The program failed.
    Run(Box<RunError>),
    /// The draws could not be written.
    Sink(std::io::Error),
}

impl From<Box<RunError>> for ChainError {
    fn from(e: Box<RunError>) -> Self {
        ChainError::Run(e)
    }
}

/// How a statement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flow {
    Next,
    /// `stop`: the enclosing loop ends.
    Stop,
    /// The run ends: steps or time used up, or cancelled.
    End,
}

/// A kernel that has run, what tells it from others, and what it did.
struct Instance {
    signature: String,
    kernel: Box<dyn Kernel>,
    stats: KernelStats,
}

impl Instance {
    fn into_stats(self) -> KernelStats {
        KernelStats { log_evidence: self.kernel.log_evidence(), ..self.stats }
    }
}

pub(crate) struct Runner<'a> {
    code: &'a Arc<Code>,
    options: &'a RunOptions,
    progress: &'a Progress,
    sink: &'a mut dyn Sink,
    chain: u32,
    trace: Trace,
    variables: Vec<(Arc<str>, Value)>,
    instances: Vec<Instance>,
    /// By the place of a call that always means the same: its kernel.
    places: FxHashMap<usize, usize>,
    sites: Sites,
    recorder: Recorder,
    frozen: Selector,
    started: Instant,
    step: u64,
    warmup_steps: u64,
    in_warmup: bool,
    loops: u32,
    power: f64,
    population: Population,
    best: Option<(f64, Vec<(u64, Constraint)>)>,
    draws: u64,
}

/// Runs one chain of a plan.
///
/// # Errors
/// If it cannot start, the program fails, or the sink does.
pub(crate) fn run_chain(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    chain: u32,
) -> Result<ChainResult, ChainError> {
    let started = Instant::now();
    let how = start_of(code, plan, options)?;
    banks::check(plan, options)?;
    let mut begun = starts(code, options.seed, chain, how, options.limits).map_err(ChainError::Start)?;
    for trace in &mut begun {
        super::force::apply(code, trace, options, chain)?;
    }
    run_among(code, plan, options, progress, sink, (chain, started), begun)
}

/// Runs a plan from a state there is, in place of a start of its own; what the program forces is not forced again. Streams of
/// random numbers belong to seed, chain and step: two runs from one state need different chains.
///
/// # Errors
/// If the program fails, or the sink does.
pub fn run_from(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    chain: u32,
    mut trace: Trace,
) -> Result<ChainResult, ChainError> {
    let started = Instant::now();
    banks::check(plan, options)?;
    trace.rollback();
    run_among(code, plan, options, progress, sink, (chain, started), vec![trace])
}

/// Runs a plan from the best of some states.
fn run_among(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    (chain, started): (u32, Instant),
    mut begun: Vec<Trace>,
) -> Result<ChainResult, ChainError> {
    let population = Population::new(&begun);
    let mut trace = begun.swap_remove(0);
    trace.set_incremental(options.incremental);
    let mut runner = Runner {
        code,
        options,
        progress,
        sink,
        chain,
        trace,
        variables: Vec::new(),
        instances: Vec::new(),
        places: FxHashMap::default(),
        sites: Sites::default(),
        recorder: Recorder::new(code, plan),
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
    };
    runner.freeze()?;
    runner.body(plan)?;
    if runner.draws == 0 {
        runner.record(None)?;
    }
    let seconds = started.elapsed().as_secs_f64();
    let (steps, warmup) = (runner.step - runner.warmup_steps, runner.warmup_steps);
    runner.sink.chain_done(chain, steps, warmup, seconds).map_err(ChainError::Sink)?;
    Ok(ChainResult {
        last: runner.trace,
        best: runner.best,
        steps,
        warmup,
        draws: runner.draws,
        kernels: runner.instances.into_iter().map(Instance::into_stats).collect(),
        sites: runner.sites.into_stats(),
        seconds,
    })
}

/// The name and arguments of a call.
pub(super) fn call(e: &Expr) -> Option<(&str, &[crate::syntax::ast::Arg])> {
    match &e.kind {
        ExprKind::Call { callee, args } => match &callee.kind {
            ExprKind::Var(name) => Some((name, args)),
            _ => None,
        },
        _ => None,
    }
}

/// An argument by its name or place.
pub(super) fn argument<'a>(args: &'a [crate::syntax::ast::Arg], place: usize, name: &str) -> Option<&'a Expr> {
    let named = args.iter().find(|a| a.name.as_ref().is_some_and(|n| &*n.node == name));
    named.or_else(|| args.get(place).filter(|a| a.name.is_none())).map(|a| &a.value)
}

impl Runner<'_> {
    fn at(&self) -> At {
        let at = At::new(self.options.seed, self.chain, self.step);
        At { adapting: self.in_warmup, power: self.power, ..at }
    }

    fn predictive(&self) -> Draws {
        let key = StreamKey::new(self.options.seed, self.chain, Purpose::PREDICT);
        Draws { key, step: self.step, lane: 0 }
    }

    /// What expressions can see.
    fn env(&mut self) -> Scope<'_> {
        let draws = self.predictive();
        let (started, steps) = (self.started, self.step);
        Scope {
            code: self.code,
            trace: &mut self.trace,
            variables: &self.variables,
            draws,
            started,
            steps,
            moved: None,
        }
    }

    fn value(&mut self, e: &Expr) -> Result<Value, Box<RunError>> {
        evaluate(e, &mut self.env())
    }

    fn count(&mut self, e: &Expr) -> Result<u64, Box<RunError>> {
        match self.value(e)? {
            Value::Num(x) if x >= 0.0 && x == libm::trunc(x) => Ok(x as u64),
            v => Err(fail(e.span, format!("a whole number of times was expected, got {v}"))),
        }
    }

    /// Applies the program's `freeze`.
    fn freeze(&mut self) -> Result<(), ChainError> {
        for f in &self.code.freezes {
            let s = selector(f, &mut self.env())?;
            self.frozen = match std::mem::replace(&mut self.frozen, Selector::Nothing) {
                Selector::Nothing => s,
                old => Selector::Union(Box::new(old), Box::new(s)),
            };
        }
        Ok(())
    }

    fn body(&mut self, stmts: &[KStmt]) -> Result<Flow, ChainError> {
        for s in stmts {
            match self.statement(s)? {
                Flow::Next => {}
                flow => return Ok(flow),
            }
        }
        Ok(Flow::Next)
    }

    fn statement(&mut self, s: &KStmt) -> Result<Flow, ChainError> {
        match &s.kind {
            KStmtKind::Warmup { count, body } => self.warmup(count, body),
            KStmtKind::Repeat { count, body } => self.repeat(count, body),
            KStmtKind::Every { count, body } => {
                let n = self.count(count)?.max(1);
                let pass = self.variables.iter().rev().find(|(name, _)| &**name == PASS);
                match pass {
                    Some((_, Value::Num(i))) if (*i as u64 + 1).is_multiple_of(n) => self.body(body),
                    _ => Ok(Flow::Next),
                }
            }
            KStmtKind::Mix(arms) => self.mix(arms),
            KStmtKind::For { var, iter, body } => {
                let over = self.value(iter)?;
                for item in over.passes() {
                    self.variables.push((Arc::clone(&var.node), item));
                    let flow = self.body(body);
                    self.variables.pop();
                    match flow? {
                        Flow::Next => {}
                        Flow::Stop => break,
                        Flow::End => return Ok(Flow::End),
                    }
                }
                Ok(Flow::Next)
            }
            KStmtKind::StopWhen(cond) => match self.value(cond)? {
                Value::Bool(true) => Ok(Flow::Stop),
                Value::Bool(false) => Ok(Flow::Next),
                v => Err(fail(cond.span, format!("`stop when` needs a bool, got {}", v.type_name())).into()),
            },
            KStmtKind::Collect(exprs) => {
                if !self.in_warmup {
                    self.record(Some(exprs))?;
                }
                Ok(Flow::Next)
            }
            KStmtKind::Let { name, expr } => {
                let v = self.value(expr)?;
                self.variables.push((Arc::clone(&name.node), v));
                Ok(Flow::Next)
            }
            KStmtKind::Propose { .. } | KStmtKind::Map { .. } => {
                Err(fail(s.span, "`propose` belongs in a kernel".into()).into())
            }
            KStmtKind::Expr(e) => self.apply(e),
        }
    }

    fn repeat(&mut self, count: &Expr, body: &[KStmt]) -> Result<Flow, ChainError> {
        let passes = self.count(count)?;
        let outermost = self.loops == 0 && !self.in_warmup;
        let unbounded = outermost && (self.options.steps.is_some() || self.options.time.is_some());
        let (mut i, first) = (0, self.step);
        while i < passes || unbounded && (i == 0 || self.step > first) {
            let flow = self.pass(i, passes, body)?;
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

    /// One pass of a loop.
    fn pass(&mut self, i: u64, of: u64, body: &[KStmt]) -> Result<Flow, ChainError> {
        if self.is_over() {
            return Ok(Flow::End);
        }
        let depth = self.variables.len();
        self.variables.push((Arc::from(PASS), Value::Num(i as f64)));
        self.variables.push((Arc::from(PASSES), Value::Num(of as f64)));
        self.loops += 1;
        let flow = self.body(body);
        self.loops -= 1;
        self.variables.truncate(depth);
        flow
    }

    fn is_cancelled(&self) -> bool {
        self.progress.cancelled.load(Ordering::Relaxed)
    }

    /// Whether the run, or the warm-up, has used up what it was given.
    fn is_over(&self) -> bool {
        if self.is_cancelled() {
            return true;
        }
        let used = self.step - self.warmup_steps;
        let bound = if self.in_warmup { self.options.warmup } else { self.options.steps };
        if bound.is_some_and(|n| used >= n) {
            return true;
        }
        match self.options.time {
            Some(t) => self.started.elapsed() >= if self.in_warmup { t / 2 } else { t },
            None => false,
        }
    }

    fn mix(&mut self, arms: &[MixArm]) -> Result<Flow, ChainError> {
        let mut weights: SmallVec<[f64; 8]> = SmallVec::new();
        for a in arms {
            let weight = match a.weight.kind {
                ExprKind::Num(w) => Value::Num(w),
                _ => self.value(&a.weight)?,
            };
            match weight {
                Value::Num(w) if w >= 0.0 && w.is_finite() => weights.push(w),
                v => return Err(fail(a.weight.span, format!("a weight must be at least 0, got {v}")).into()),
            }
        }
        let total: f64 = weights.iter().sum();
        let key = StreamKey::new(self.options.seed, self.chain, Purpose::MIX);
        let arm = key.stream(self.step, 0, 0).weighted(&weights, total);
        arms.get(arm).map_or(Ok(Flow::Next), |a| self.apply(&a.kernel))
    }

    /// Applies a kernel, or another statement that looks like a call.
    fn apply(&mut self, e: &Expr) -> Result<Flow, ChainError> {
        let Some((name, args)) = call(e) else {
            return Err(fail(e.span, "a kernel such as mh(one(@**)) was expected".into()).into());
        };
        match name {
            "init" => return Ok(Flow::Next),
            "anneal" => return self.anneal(e, args),
            _ => {}
        }
        let place = e as *const Expr as usize;
        let i = match self.places.get(&place) {
            Some(i) => *i,
            None => match self.code.kernels.iter().find(|k| &*k.name.node == name && !proposes(&k.body)) {
                Some(k) => return self.apply_declared(e, k, args),
                None => self.instance(e, place)?,
            },
        };
        let begun = Instant::now();
        let mut flow = Flow::Next;
        let outcome = match self.instances[i].kernel.sweep(&mut self.trace) {
            None => self.step(i, 0)?,
            Some(members) => {
                let mut all = Outcome::default();
                for member in 0..members {
                    all.add(self.step(i, member)?);
                    if self.is_over() {
                        flow = Flow::End;
                        break;
                    }
                }
                all
            }
        };
        if !self.in_warmup {
            self.instances[i].stats.add(&outcome, begun.elapsed());
        }
        Ok(if self.is_over() { Flow::End } else { flow })
    }

    /// Applies a kernel that the program declares from other kernels.
    fn apply_declared(&mut self, e: &Expr, k: &KernelDecl, args: &[Arg]) -> Result<Flow, ChainError> {
        let given = arguments(k, args, e.span, &mut self.env())?;
        let depth = self.variables.len();
        self.variables.extend(given);
        let flow = self.body(&k.body);
        self.variables.truncate(depth);
        flow
    }

    /// One step of a kernel.
    fn step(&mut self, i: usize, member: usize) -> Result<Outcome, ChainError> {
        let at = At { member, ..self.at() };
        let outcome = self.instances[i].kernel.step(&mut self.trace, &at)?;
        if self.options.sites && !self.in_warmup {
            self.sites.count(&self.trace, &outcome);
        }
        self.step += 1;
        self.progress.steps.fetch_add(1, Ordering::Relaxed);
        Ok(outcome)
    }

    /// The kernel a call stands for: one that is known, or a new one.
    fn instance(&mut self, e: &Expr, place: usize) -> Result<usize, ChainError> {
        let (frozen, options) = (self.frozen.clone(), self.options);
        let built = build(e, &frozen, options, &mut self.env())?;
        let i = match self.instances.iter().position(|i| i.signature == built.signature) {
            Some(i) => i,
            None => {
                let stats = KernelStats { name: self.label(e), ..Default::default() };
                self.instances.push(Instance { signature: built.signature, kernel: built.kernel, stats });
                self.instances.len() - 1
            }
        };
        if is_constant(e) {
            self.places.insert(place, i);
        }
        Ok(i)
    }

    /// The text of a kernel for tables.
    fn label(&self, e: &Expr) -> String {
        crate::syntax::print_expr(e)
    }

    /// Records a draw.
    fn record(&mut self, exprs: Option<&[Expr]>) -> Result<(), ChainError> {
        let draws = self.predictive();
        let values = self.recorder.values(self.code, &mut self.trace, exprs, draws)?;
        if self.draws == 0 {
            self.recorder.fix_columns(&values);
            self.sink.columns(self.recorder.columns()).map_err(ChainError::Sink)?;
        }
        let log_joint = self.trace.log_joint();
        let row = DrawRow {
            chain: self.chain,
            draw: self.draws,
            step: self.step,
            log_joint,
            log_prior: self.trace.log_prior(),
            log_likelihood: self.trace.log_likelihood(),
            values: self.recorder.flatten(&values),
        };
        self.sink.draw(&row).map_err(ChainError::Sink)?;
        if let Some(watch) = &self.options.watch {
            watch.draw(self.chain, &mut self.trace, draws);
        }
        self.draws += 1;
        if self.best.as_ref().is_none_or(|(b, _)| log_joint > *b) {
            self.best = Some((log_joint, self.trace.constraints()));
        }
        Ok(())
    }
}

/// The variables a loop keeps for `every` and `anneal`; not names a program can write.
const PASS: &str = "#pass";
const PASSES: &str = "#passes";
