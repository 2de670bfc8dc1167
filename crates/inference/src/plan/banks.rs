//! Banks in plans: which ones a plan names, and the neighbours that a kernel gets from
//! them.

use crate::calls::error::fail;
use crate::calls::formula::{PlanEnv, evaluate};
use crate::neighbours::Neighbours;
use crate::run::RunOptions;
use pcadlang_engine::lang::builtins::{Inference, Kind};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::{Argument, Callee, Formula, FormulaKind, KernelCall, Step};
use pcadlang_engine::lang::value::Value;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// The number of neighbours, if a kernel does not specify it.
const K: usize = 10;
/// The most neighbours: more of them are no more informative than the prior.
const MOST: f64 = 10_000.0;

/// Looks up the neighbours that a plan's kernels will need, so that an unusable bank is
/// an error before the chain begins. Banks whose names are computed are looked up when
/// their kernel is built.
///
/// # Errors
/// As [`neighbours`].
pub(super) fn check(
    code: &Code,
    steps: &[Step],
    options: &RunOptions,
) -> Result<(), Box<RunError>> {
    let is_knn = |call: &KernelCall| match call.kernel {
        Callee::Builtin(i) => {
            matches!(code.builtins.get(i).kind, Kind::Inference(Inference::Knn))
        }
        Callee::Declared(_) => false,
    };
    for step in steps {
        for call in step.calls().filter(|call| is_knn(call)) {
            let constant = |place| match value(call, place).map(|f| &f.kind) {
                Some(FormulaKind::Const(v)) => Some(v),
                _ => None,
            };
            let k = match (value(call, 2), constant(2)) {
                (None, _) => K,
                (_, Some(Value::Num(x))) => whole(*x).unwrap_or(K),
                _ => continue,
            };
            if let Some(Value::Str(bank)) = constant(1) {
                find(options, call.span, bank, k)?;
            }
        }
        check(code, step.body(), options)?;
    }
    Ok(())
}

fn value(call: &KernelCall, place: usize) -> Option<&Formula> {
    match call.args.get(place) {
        Some(Argument::Value(f)) => Some(f),
        _ => None,
    }
}

fn whole(x: f64) -> Option<usize> {
    ((1.0..=MOST).contains(&x) && x == libm::trunc(x)).then_some(x as usize)
}

fn find(
    options: &RunOptions,
    span: Span,
    bank: &str,
    k: usize,
) -> Result<Arc<Neighbours>, Box<RunError>> {
    match &options.banks {
        Some(banks) => banks.neighbours(bank, k).map_err(|message| fail(span, message)),
        None => Err(fail(span, format!("knn: the bank {bank:?} is not known to this run"))),
    }
}

/// Looks up the neighbours for a call of `knn`.
///
/// # Errors
/// If its arguments are wrong, or the bank cannot be used.
pub(crate) fn neighbours(
    call: &KernelCall,
    options: &RunOptions,
    env: &mut PlanEnv,
) -> Result<Arc<Neighbours>, Box<RunError>> {
    let Some(bank) = value(call, 1) else {
        return Err(fail(call.span, "knn needs a bank made by `pcadlang learn`".into()));
    };
    let name = match evaluate(bank, env)? {
        Value::Str(s) => s,
        v => return Err(fail(bank.span, format!("knn: `bank` must be a string, got {v}"))),
    };
    let k = match value(call, 2) {
        None => K,
        Some(k) => match evaluate(k, env)? {
            Value::Num(x) if whole(x).is_some() => x as usize,
            v => {
                return Err(fail(
                    k.span,
                    format!("knn: `k` must be a whole number from 1 to {MOST}, got {v}"),
                ));
            }
        },
    };
    find(options, call.span, &name, k)
}
