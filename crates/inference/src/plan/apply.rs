//! Applies kernels: one call, step by step, and the arms of `mix`.

use super::place::ResumePoint;
use super::runner::{Flow, Instance, Runner};
use crate::calls::build::{Setting, arguments, build};
use crate::calls::error::fail;
use crate::kernel::Outcome;
use crate::run::ChainError;
use crate::stats::KernelStats;
use pcadlang_engine::lang::plan::{Callee, Formula, KernelCall, Step};
use pcadlang_engine::lang::value::Value;
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use smallvec::SmallVec;
use std::sync::atomic::Ordering;

/// The most kernels of a chain: arguments that keep changing would fill the memory.
const MOST: usize = 10_000;

/// The deepest nesting of statements and declared kernels, as a kernel may call itself.
const MOST_NESTED: usize = 200;

impl<'a> Runner<'a> {
    pub(super) fn mix(
        &mut self,
        arms: &'a [(Formula, Step)],
        point: ResumePoint,
    ) -> Result<Flow, ChainError> {
        if let ResumePoint::Kernel { arm: Some(i), .. } = point {
            return arms.get(i).map_or(Ok(Flow::Next), |a| self.statement(&a.1, Some(i), point));
        }
        let mut weights: SmallVec<[f64; 8]> = SmallVec::new();
        for (weight, _) in arms {
            match self.value(weight)? {
                Value::Num(w) if w >= 0.0 && w.is_finite() => weights.push(w),
                v => {
                    let message = format!("a weight must be at least 0, got {v}");
                    return Err(fail(weight.span, message).into());
                }
            }
        }
        let total: f64 = weights.iter().sum();
        let key = StreamKey::new(self.options.seed, self.chain, Purpose::MIX);
        let arm = key.stream(self.step, 0, 0).weighted(&weights, total);
        arms.get(arm).map_or(Ok(Flow::Next), |a| self.statement(&a.1, Some(arm), point))
    }

    /// Applies a kernel; `arm` is its index in a `mix`.
    pub(super) fn apply(
        &mut self,
        call: &'a KernelCall,
        arm: Option<usize>,
        point: ResumePoint,
    ) -> Result<Flow, ChainError> {
        let i = match (self.calls.get(call.index), call.kernel) {
            (Some(Some(i)), _) => *i,
            (_, Callee::Declared(k)) if !self.plan.kernels[k].proposes => {
                return self.apply_declared(call, k, arm);
            }
            _ => self.instance(call)?,
        };
        if self.progress.pause.is_on() {
            self.pause();
        }
        let begun = Instant::now();
        let (mut steps, after, mut done) = match point {
            ResumePoint::Kernel { steps, after, done, .. } => (steps, after, done),
            _ => (0, None, Outcome::default()),
        };
        // A kernel that does not sweep over its choices makes one step.
        let kernel = &mut self.instances[i].kernel;
        let sweep = kernel.as_mut().and_then(|k| k.sweep(&mut self.trace, after));
        let mut left = sweep.unwrap_or(usize::from(steps == 0));
        let mut over = steps > 0 && self.is_over();
        while left > 0 && !over {
            done.add(self.step(i)?);
            steps += 1;
            let kernel = self.instances[i].kernel.as_mut().filter(|_| sweep.is_some());
            left = kernel.map_or(0, |k| k.remaining(&mut self.trace));
            over = self.is_over();
            let asked = self.progress.checkpoints.load(Ordering::Relaxed);
            if asked != self.asked || over && (self.is_cancelled() || !self.in_warmup) {
                self.asked = asked;
                let kernel = self.instances[i].kernel.as_mut();
                let after = kernel.and_then(|k| k.visited(&self.trace));
                self.keep(Some(ResumePoint::Kernel { arm, steps, after, done }))?;
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
        call: &'a KernelCall,
        k: usize,
        arm: Option<usize>,
    ) -> Result<Flow, ChainError> {
        if self.path.len() >= MOST_NESTED {
            let message = format!(
                "statements and kernels of the plan are nested more than {MOST_NESTED} deep"
            );
            return Err(fail(call.span, message).into());
        }
        let declared = &self.plan.kernels[k];
        self.note(ResumePoint::Kernel { arm, steps: 0, after: None, done: Outcome::default() });
        let depth = self.depth();
        if self.resume_path.is_empty() {
            let given = arguments(declared, call, &mut self.env())?;
            self.variables.truncate(depth);
            self.variables.extend(given);
        }
        let outer = std::mem::replace(&mut self.base, depth);
        let flow = self.body(&declared.steps);
        self.base = outer;
        self.leave();
        flow
    }

    /// Makes one step of a kernel.
    fn step(&mut self, i: usize) -> Result<Outcome, ChainError> {
        let at = self.at();
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
    fn instance(&mut self, call: &KernelCall) -> Result<usize, ChainError> {
        let (frozen, kernels) = (self.frozen.clone(), &self.plan.kernels);
        let setting = Setting { kernels, frozen: &frozen, options: self.options };
        let mut built = build(call, setting, &mut self.env())?;
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
                return Err(fail(call.span, message).into());
            }
            None => {
                let stats = KernelStats { name: call.text.to_string(), ..Default::default() };
                let (signature, kernel) = (built.signature, Some(built.kernel));
                self.instances.push(Instance { signature, kernel, saved: Vec::new(), stats });
                self.instances.len() - 1
            }
        };
        if call.is_constant {
            if self.calls.len() <= call.index {
                self.calls.resize(call.index + 1, None);
            }
            self.calls[call.index] = Some(i);
        }
        Ok(i)
    }
}
