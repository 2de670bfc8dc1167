//! Applies kernels: one call, step by step, and the arms of `mix`.

use super::place::Doing;
use super::runner::{Flow, Instance, Runner};
use super::{ChainError, call};
use crate::infer::calls::build::{arguments, build, is_constant};
use crate::infer::calls::selection::fail;
use crate::infer::draws::KernelStats;
use crate::infer::kernel::{Outcome, StepContext};
use crate::infer::kernels::program_kernel::proposes;
use crate::lang::value::Value;
use crate::platform::clock::Instant;
use crate::rng::{Purpose, StreamKey};
use crate::syntax::ast::{Arg, Expr, ExprKind, KernelDecl, MixArm};
use smallvec::SmallVec;
use std::sync::atomic::Ordering;

/// The most kernels of a chain: arguments that keep changing would fill the memory.
const MOST: usize = 10_000;

/// The deepest nesting of statements and declared kernels, as a kernel may call itself.
const MOST_NESTED: usize = 200;

impl Runner<'_> {
    pub(super) fn mix(&mut self, arms: &[MixArm], doing: Doing) -> Result<Flow, ChainError> {
        if let Doing::Kernel { arm: Some(i), .. } = doing {
            return arms.get(i).map_or(Ok(Flow::Next), |a| self.apply(&a.kernel, Some(i), doing));
        }
        let mut weights: SmallVec<[f64; 8]> = SmallVec::new();
        for a in arms {
            let weight = match a.weight.kind {
                ExprKind::Num(w) => Value::Num(w),
                _ => self.value(&a.weight)?,
            };
            match weight {
                Value::Num(w) if w >= 0.0 && w.is_finite() => weights.push(w),
                v => {
                    return Err(fail(
                        a.weight.span,
                        format!("a weight must be at least 0, got {v}"),
                    )
                    .into());
                }
            }
        }
        let total: f64 = weights.iter().sum();
        let key = StreamKey::new(self.options.seed, self.chain, Purpose::MIX);
        let arm = key.stream(self.step, 0, 0).weighted(&weights, total);
        arms.get(arm).map_or(Ok(Flow::Next), |a| self.apply(&a.kernel, Some(arm), doing))
    }

    /// Applies a kernel, or another statement that has the form of a call; `arm` is its
    /// index in a `mix`.
    pub(super) fn apply(
        &mut self,
        e: &Expr,
        arm: Option<usize>,
        doing: Doing,
    ) -> Result<Flow, ChainError> {
        let Some((name, args)) = call(e) else {
            return Err(fail(e.span, "expected a kernel, such as mh(one(@**))".into()).into());
        };
        match name {
            "init" => return Ok(Flow::Next),
            "anneal" => return self.anneal(e, args),
            _ => {}
        }
        let place = e as *const Expr as usize;
        let i = match self.calls.get(&place) {
            Some(i) => *i,
            None => {
                match self.code.kernels.iter().find(|k| &*k.name.node == name && !proposes(&k.body))
                {
                    Some(k) => return self.apply_declared(e, k, args, arm),
                    None => self.instance(e, place)?,
                }
            }
        };
        let begun = Instant::now();
        let (mut steps, mut done) = match doing {
            Doing::Kernel { steps, done, .. } => (steps, done),
            _ => (0, Outcome::default()),
        };
        // A kernel that does not sweep over its choices makes one step.
        let members =
            self.instances[i].kernel.as_mut().and_then(|k| k.sweep(&mut self.trace)).unwrap_or(1);
        let mut over = steps > 0 && self.is_over();
        while steps < members && !over {
            done.add(self.step(i, steps)?);
            steps += 1;
            over = self.is_over();
            let asked = self.progress.checkpoints.load(Ordering::Relaxed);
            if asked != self.asked || over && (self.is_cancelled() || !self.in_warmup) {
                self.asked = asked;
                self.keep(Some(Doing::Kernel { arm, steps, done }))?;
            }
        }
        if !self.in_warmup {
            self.instances[i].stats.add(&done, begun.elapsed());
        }
        Ok(if over || self.is_over() { Flow::End } else { Flow::Next })
    }

    /// Applies a kernel that the program declares in terms of other kernels.
    fn apply_declared(
        &mut self,
        e: &Expr,
        k: &KernelDecl,
        args: &[Arg],
        arm: Option<usize>,
    ) -> Result<Flow, ChainError> {
        if self.path.len() >= MOST_NESTED {
            let message = format!(
                "statements and kernels of the plan are nested more than {MOST_NESTED} deep"
            );
            return Err(fail(e.span, message).into());
        }
        self.note(Doing::Kernel { arm, steps: 0, done: Outcome::default() });
        if self.resume_path.is_empty() {
            let given = arguments(k, args, e.span, &mut self.env())?;
            self.variables.extend(given);
        }
        let flow = self.body(&k.body);
        self.leave();
        flow
    }

    /// Makes one step of a kernel.
    fn step(&mut self, i: usize, member: usize) -> Result<Outcome, ChainError> {
        let at = StepContext { member, ..self.at() };
        let Some(kernel) = &mut self.instances[i].kernel else { return Ok(Outcome::default()) };
        let outcome = kernel.step(&mut self.trace, &at)?;
        if self.options.sites && !self.in_warmup {
            self.sites.count(&self.trace, &outcome);
        }
        self.step += 1;
        self.progress.steps.fetch_add(1, Ordering::Relaxed);
        if let Some(callback) = &self.options.callback {
            callback.step(self.chain, self.step, &self.trace);
        }
        Ok(outcome)
    }

    /// Returns the index of the kernel that a call denotes: a known one, or a new one.
    fn instance(&mut self, e: &Expr, place: usize) -> Result<usize, ChainError> {
        let (frozen, options) = (self.frozen.clone(), self.options);
        let mut built = build(e, &frozen, options, &mut self.env())?;
        let i = match self.instances.iter().position(|i| i.signature == built.signature) {
            Some(i) => {
                let known = &mut self.instances[i];
                if known.kernel.is_none() {
                    built.kernel.load(&std::mem::take(&mut known.saved))?;
                    known.kernel = Some(built.kernel);
                }
                i
            }
            None if self.instances.len() >= MOST => {
                let message = format!(
                    "this run already has {MOST} kernels (a kernel with different arguments counts as another)"
                );
                return Err(fail(e.span, message).into());
            }
            None => {
                let stats =
                    KernelStats { name: crate::syntax::print_expr(e), ..Default::default() };
                let (signature, kernel) = (built.signature, Some(built.kernel));
                self.instances.push(Instance { signature, kernel, saved: Vec::new(), stats });
                self.instances.len() - 1
            }
        };
        if is_constant(e) {
            self.calls.insert(place, i);
        }
        Ok(i)
    }
}
