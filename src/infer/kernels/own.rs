//! Kernels that programs declare: Metropolis-Hastings with proposals of their own.
//!
//! The body is played on the present state and draws from each `propose @x ~ d` as it comes; then all choices change at
//! once. The density of the way back is found by replay: the body is played again on the new state, with the old values as
//! what it would have to draw. Every expression reads the state the play began in, never a value proposed in it.

use crate::dist::{Datum, Dist};
use crate::infer::expr::{Scope, evaluate};
use crate::infer::kernel::{At, Kernel, Outcome, accepts, recoverable};
use crate::infer::selection::{address, fail};
use crate::lang::code::Code;
use crate::lang::value::Value;
use crate::rng::{Purpose, Stream, StreamKey};
use crate::syntax::ast::{Expr, KStmt, KStmtKind, KernelDecl};
use crate::trace::{Change, Draws, Target, Trace, TraceResult};
use std::sync::Arc;
use std::time::Instant;

/// A kernel of the program, with its arguments.
#[derive(Clone, Debug)]
pub(crate) struct Own {
    code: Arc<Code>,
    declared: KernelDecl,
    arguments: Vec<(Arc<str>, Value)>,
    started: Instant,
}

/// One `propose` of a play.
struct Proposed {
    target: Target,
    dist: Dist,
}

impl Own {
    /// A declared kernel with the values of its parameters, in a chain that began at `started`.
    pub fn new(code: Arc<Code>, declared: KernelDecl, arguments: Vec<(Arc<str>, Value)>, started: Instant) -> Self {
        Own { code, declared, arguments, started }
    }

    /// What the body proposes in a state.
    fn play(&self, trace: &mut Trace, at: &At) -> TraceResult<Vec<Proposed>> {
        let key = StreamKey::new(at.seed, at.chain, Purpose::PREDICT);
        let mut play =
            Play { own: self, draws: Draws { key, step: at.step, lane: at.part }, steps: at.step, all: Vec::new() };
        let mut variables = self.arguments.clone();
        play.body(&self.declared.body, trace, &mut variables)?;
        Ok(play.all)
    }
}

struct Play<'a> {
    own: &'a Own,
    draws: Draws,
    steps: u64,
    all: Vec<Proposed>,
}

impl Play<'_> {
    /// What expressions can see.
    fn env<'b>(&'b self, trace: &'b mut Trace, variables: &'b [(Arc<str>, Value)]) -> Scope<'b> {
        let (code, started) = (&self.own.code, self.own.started);
        Scope { code, trace, variables, draws: self.draws, started, steps: self.steps }
    }

    fn body(&mut self, body: &[KStmt], trace: &mut Trace, variables: &mut Vec<(Arc<str>, Value)>) -> TraceResult<()> {
        let depth = variables.len();
        for s in body {
            match &s.kind {
                KStmtKind::Let { name, expr } => {
                    let v = evaluate(expr, &mut self.env(trace, variables))?;
                    variables.push((Arc::clone(&name.node), v));
                }
                KStmtKind::For { var, iter, body } => {
                    let over = evaluate(iter, &mut self.env(trace, variables))?;
                    for item in over.passes() {
                        variables.push((Arc::clone(&var.node), item));
                        let done = self.body(body, trace, variables);
                        variables.pop();
                        done?;
                    }
                }
                KStmtKind::Propose { target, dist } => {
                    let proposed = self.proposed(target, dist, trace, variables)?;
                    if self.all.iter().any(|p| p.target == proposed.target) {
                        return Err(fail(s.span, "this choice is proposed twice in one kernel".into()));
                    }
                    self.all.push(proposed);
                }
                _ => {
                    let message = "a kernel that proposes has only `let`, `for` and `propose` in it";
                    let mut e = fail(s.span, message.into());
                    e.hint = Some("kernels that apply other kernels are written without `propose`".into());
                    return Err(e);
                }
            }
        }
        variables.truncate(depth);
        Ok(())
    }

    fn proposed(
        &self,
        target: &Expr,
        dist: &Expr,
        trace: &mut Trace,
        variables: &[(Arc<str>, Value)],
    ) -> TraceResult<Proposed> {
        let mut env = self.env(trace, variables);
        let at = address(target, &mut env)?;
        let dist = match evaluate(dist, &mut env)? {
            Value::Dist(d) => Dist::clone(&d),
            v => return Err(fail(dist.span, format!("`propose` needs a distribution, got {}", v.type_name()))),
        };
        let Some(found) = trace.find(&at) else {
            let mut e = fail(target.span, format!("there is no choice {at} in this state"));
            e.hint = Some("a kernel can only propose choices that are there; mh and block make others appear".into());
            return Err(e);
        };
        if trace.elements(found).is_some() || trace.dist(found).is_some_and(|d| d.is_stored_whitened()) {
            let message = format!("{at} cannot be proposed as a whole");
            return Err(fail(target.span, message));
        }
        Ok(Proposed { target: found, dist })
    }
}

/// Whether a kernel proposes values itself, rather than applying others.
pub(crate) fn proposes(body: &[KStmt]) -> bool {
    body.iter().any(|s| match &s.kind {
        KStmtKind::Propose { .. } => true,
        KStmtKind::For { body, .. } | KStmtKind::Repeat { body, .. } | KStmtKind::Every { body, .. } => proposes(body),
        _ => false,
    })
}

fn old_values(trace: &Trace, all: &[Proposed]) -> Vec<Option<Datum>> {
    all.iter().map(|p| trace.stored(p.target)).collect()
}

/// The log density of drawing these values; what a proposal cannot draw has none.
fn log_density(all: &[Proposed], values: &[Option<Datum>]) -> f64 {
    let one = |(p, x): (&Proposed, &Option<Datum>)| match x {
        Some(x) if p.dist.support().fits(x) => p.dist.log_density(x),
        _ => f64::NEG_INFINITY,
    };
    all.iter().zip(values).map(one).sum()
}

impl Kernel for Own {
    fn name(&self) -> String {
        self.declared.name.node.to_string()
    }

    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome> {
        let mut rng: Stream = at.stream();
        let forth = self.play(trace, at)?;
        if forth.is_empty() {
            return Ok(Outcome::default());
        }
        let old = old_values(trace, &forth);
        let new: Vec<Option<Datum>> = forth.iter().map(|p| Some(p.dist.sample(&mut rng))).collect();
        let change = |(p, x): (&Proposed, &Option<Datum>)| Some((p.target, Change::Set(x.clone()?)));
        let changes: Vec<_> = forth.iter().zip(&new).filter_map(change).collect();
        let Some(w) = recoverable(trace.propose(&changes, at.draws(0)))? else { return Ok(Outcome::failed()) };
        if forth.iter().any(|p| trace.was_removed(p.target)) || w.log_weight == f64::NEG_INFINITY {
            trace.rollback();
            return Ok(Outcome::one(false));
        }
        // The replay asks the new state, which must not be pending for that.
        let removed = trace.removed();
        trace.commit();
        let back = recoverable(self.play(trace, at))?;
        let same = |back: &Vec<Proposed>| back.iter().map(|p| p.target).eq(forth.iter().map(|p| p.target));
        let log_back = back.filter(same).map_or(f64::NEG_INFINITY, |back| log_density(&back, &old));
        let ratio = at.tempered(&w) + log_back - log_density(&forth, &new);
        if accepts(ratio, &mut rng) {
            return Ok(Outcome::one(true));
        }
        let undo: Vec<_> = forth.iter().zip(&old).filter_map(change).collect();
        trace.propose_constrained(&undo, &removed, at.draws(1))?;
        trace.commit();
        Ok(Outcome::one(false))
    }
}
