//! The `init` statement of a plan.

use crate::calls::build::arguments;
use crate::calls::error::fail;
use crate::calls::formula::{PlanEnv, evaluate};
use crate::force::Forced;
use crate::init::{By, Start};
use crate::kernels::ProgramKernel;
use crate::run::{ChainError, RunOptions};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::{BestOf, Callee, Formula, Init, KernelCall, Plan, StepKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::sync::{Arc, Mutex, PoisonError};

/// How many uniform starts a chain compares, if the plan does not say.
const RESTARTS: u64 = 4;

/// How a chain starts, the kernel that proposes its states, if any, and what is forced.
type StartOf = (Start, Option<ProgramKernel>, Forced);

/// How chains start, which is the same for all of them: worked out by the first.
#[derive(Debug, Default)]
pub(crate) struct SharedStart(Mutex<Option<StartOf>>);

impl SharedStart {
    /// Works it out. A failure is ignored: the chains will report it.
    pub fn prepare(&self, code: &Arc<Code>, plan: &Plan, options: &RunOptions) {
        let _ = self.get(|| start_of(code, plan, options));
    }

    /// Returns it, from the first call of `make` that succeeds.
    pub(super) fn get(
        &self,
        make: impl FnOnce() -> Result<StartOf, ChainError>,
    ) -> Result<StartOf, ChainError> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &*known {
            Some(start) => Ok(start.clone()),
            None => Ok(known.insert(make()?).clone()),
        }
    }
}

/// Reads the `init` statement of a plan: how to start, and the kernel it proposes from
/// (`from = …`), if any; and the `force` statements of the program.
pub(super) fn start_of(
    code: &Arc<Code>,
    plan: &Plan,
    options: &RunOptions,
) -> Result<StartOf, ChainError> {
    let key = StreamKey::new(options.seed, 0, Purpose::START);
    let forced = Forced::of(code, 0, key, &options.limits)?;
    let init = plan.steps.iter().find_map(|s| match &s.kind {
        StepKind::Init(start) => Some(start),
        _ => None,
    });
    let mut trace = Trace::prior(Arc::clone(code), options.limits.clone());
    let mut env = PlanEnv::before(&mut trace, Draws::default());
    let mut number = |n: &Option<Formula>, otherwise: u64| {
        n.as_ref().map_or(Ok(otherwise), |f| count(f, &mut env))
    };
    let BestOf { draws, keep, from } = match init {
        None => return Ok((Start::default(), None, forced)),
        Some(Init::Prior(n)) => {
            return Ok((Start { draws: number(n, 1)?, ..Start::default() }, None, forced));
        }
        Some(Init::Unconstrained(n)) => {
            let draws = number(n, RESTARTS)?;
            return Ok((Start { draws, by: By::Density, ..Start::default() }, None, forced));
        }
        Some(Init::BestOf(best)) => best,
    };
    let draws = count(draws, &mut env)?;
    let keep = keep.as_ref().map_or(Ok(1), |f| count(f, &mut env))?;
    let from = from.as_ref().map(|call| own(plan, call, &mut env)).transpose()?;
    let keep = keep.min(draws) as usize;
    Ok((Start { draws, keep, by: By::Best, ..Start::default() }, from, forced))
}

fn count(f: &Formula, env: &mut PlanEnv) -> Result<u64, Box<RunError>> {
    match evaluate(f, env)? {
        Value::Num(x) if x >= 1.0 => Ok(x as u64),
        v => Err(fail(f.span, format!("expected a number of draws, got {v}"))),
    }
}

/// The declared kernel in the `from` argument of `best_of`.
fn own(plan: &Plan, call: &KernelCall, env: &mut PlanEnv) -> Result<ProgramKernel, Box<RunError>> {
    match call.kernel {
        Callee::Declared(i) if plan.kernels[i].proposes => {
            let arguments = arguments(&plan.kernels[i], call, env)?;
            Ok(ProgramKernel::new(Arc::clone(&plan.kernels), i, arguments, env.started))
        }
        _ => {
            let mut wrong = fail(call.span, "`from` takes a kernel declared in the program".into());
            wrong.hint =
                Some("kernel near() { propose @x ~ normal(2, 0.1); } infer { init(best_of(20, from = near())); … }".into());
            Err(wrong)
        }
    }
}
