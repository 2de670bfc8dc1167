//! Banks in plans: which ones a plan names, and the neighbours that a kernel gets from
//! them.

use super::{RunOptions, argument, call};
use crate::infer::calls::expr::{PlanEnv, evaluate};
use crate::infer::calls::selection::fail;
use crate::infer::neighbours::Neighbours;
use crate::lang::error::RunError;
use crate::lang::value::Value;
use crate::syntax::ast::{Arg, Expr, ExprKind, KStmt, KStmtKind};
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
pub(super) fn check(plan: &[KStmt], options: &RunOptions) -> Result<(), Box<RunError>> {
    plan.iter().try_for_each(|s| match &s.kind {
        KStmtKind::Warmup { body, .. }
        | KStmtKind::Repeat { body, .. }
        | KStmtKind::Every { body, .. }
        | KStmtKind::For { body, .. } => check(body, options),
        KStmtKind::Mix(arms) => arms.iter().try_for_each(|a| check_kernel(&a.kernel, options)),
        KStmtKind::Expr(e) => check_kernel(e, options),
        _ => Ok(()),
    })
}

fn check_kernel(e: &Expr, options: &RunOptions) -> Result<(), Box<RunError>> {
    let Some(("knn", args)) = call(e) else { return Ok(()) };
    let k = match argument(args, 2, "k").map(|k| &k.kind) {
        None => K,
        Some(ExprKind::Num(x)) => whole(*x).unwrap_or(K),
        Some(_) => return Ok(()),
    };
    match argument(args, 1, "bank").map(|b| &b.kind) {
        Some(ExprKind::Str(bank)) => find(options, e, bank, k).map(|_| ()),
        _ => Ok(()),
    }
}

fn whole(x: f64) -> Option<usize> {
    ((1.0..=MOST).contains(&x) && x == libm::trunc(x)).then_some(x as usize)
}

fn find(
    options: &RunOptions,
    e: &Expr,
    bank: &str,
    k: usize,
) -> Result<Arc<Neighbours>, Box<RunError>> {
    match &options.banks {
        Some(banks) => banks.neighbours(bank, k).map_err(|message| fail(e.span, message)),
        None => Err(fail(e.span, format!("knn: the bank {bank:?} is not known to this run"))),
    }
}

/// Looks up the neighbours for a call of `knn`.
///
/// # Errors
/// If its arguments are wrong, or the bank cannot be used.
pub(in crate::infer) fn neighbours(
    e: &Expr,
    args: &[Arg],
    options: &RunOptions,
    env: &mut PlanEnv,
) -> Result<Arc<Neighbours>, Box<RunError>> {
    let Some(bank) = argument(args, 1, "bank") else {
        return Err(fail(e.span, "knn needs a bank made by `pcadlang learn`".into()));
    };
    let name = match evaluate(bank, env)? {
        Value::Str(s) => s,
        v => return Err(fail(bank.span, format!("knn: `bank` must be a string, got {v}"))),
    };
    let k = match argument(args, 2, "k") {
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
    find(options, e, &name, k)
}
