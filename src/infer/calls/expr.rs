//! Expressions of inference blocks: counts, weights and conditions. They can use the
//! block's own variables, the model's top-level names, and the state of the run.

use crate::infer::calls::selection::{fail, fault};
use crate::lang::builtins::{Args, Builtin, Kind};
use crate::lang::code::{Code, Operand};
use crate::lang::error::RunError;
use crate::lang::index::index_value;
use crate::lang::value::Value;
use crate::platform::clock::Instant;
use crate::syntax::ast::{BinaryOp, Expr, ExprKind, UnaryOp};
use crate::trace::{Address, Draws, Trace};
use std::sync::Arc;

/// The environment in which an expression is evaluated.
pub(crate) struct PlanEnv<'a> {
    pub code: &'a Arc<Code>,
    pub trace: &'a mut Trace,
    /// The variables of the block, innermost last.
    pub variables: &'a [(Arc<str>, Value)],
    pub draws: Draws,
    pub started: Instant,
    pub steps: u64,
    /// In a map of a kernel: the values of choices in place of their present ones.
    /// Nothing else of the state may be read then.
    pub moved: Option<&'a [(Address, Value)]>,
}

/// Evaluates an expression.
///
/// # Errors
/// What went wrong, with its position.
pub(crate) fn evaluate(e: &Expr, env: &mut PlanEnv) -> Result<Value, Box<RunError>> {
    match &e.kind {
        ExprKind::Num(x) => Ok(Value::Num(*x)),
        ExprKind::Bool(b) => Ok(Value::Bool(*b)),
        ExprKind::Str(s) => Ok(Value::Str(Arc::clone(s))),
        ExprKind::Var(name) => variable(name, e, env),
        ExprKind::Array(xs) => {
            let xs: Result<Vec<Value>, _> = xs.iter().map(|x| evaluate(x, env)).collect();
            xs.map(Value::from_elements)
        }
        ExprKind::Record(fields) => {
            let fields: Result<_, Box<RunError>> =
                fields.iter().map(|(k, v)| Ok((Arc::clone(&k.node), evaluate(v, env)?))).collect();
            fields.map(|f| Value::Record(Arc::new(f)))
        }
        ExprKind::Index { base, index } => {
            let (b, i) = (evaluate(base, env)?, evaluate(index, env)?);
            index_value(&b, &i).map_err(|f| fail(e.span, f.message))
        }
        ExprKind::Field { base, field } => {
            let b = evaluate(base, env)?;
            index_value(&b, &Value::Str(Arc::clone(&field.node)))
                .map_err(|f| fail(e.span, f.message))
        }
        ExprKind::Unary { op, expr } => {
            let v = evaluate(expr, env)?;
            let name = match op {
                UnaryOp::Neg => "neg",
                UnaryOp::Not => "not",
            };
            builtin(name, &[&v], e, env)
        }
        ExprKind::Binary { op, left, right } => {
            let a = evaluate(left, env)?;
            match (op, &a) {
                (BinaryOp::And, Value::Bool(false)) => return Ok(Value::Bool(false)),
                (BinaryOp::Or, Value::Bool(true)) => return Ok(Value::Bool(true)),
                _ => {}
            }
            let b = evaluate(right, env)?;
            match op {
                BinaryOp::And | BinaryOp::Or => Ok(b),
                _ => builtin(operator(*op), &[&a, &b], e, env),
            }
        }
        ExprKind::Call { callee, args } => {
            let ExprKind::Var(name) = &callee.kind else { return Err(unsupported(e)) };
            match &**name {
                "elapsed" => return Ok(Value::Num(env.started.elapsed().as_secs_f64())),
                "steps" => return Ok(Value::Num(env.steps as f64)),
                "value" => {
                    let [arg] = &args[..] else { return Err(unsupported(e)) };
                    let at = crate::infer::calls::selection::address(&arg.value, env)?;
                    if let Some((_, v)) =
                        env.moved.and_then(|moved| moved.iter().find(|(a, _)| *a == at))
                    {
                        return Ok(v.clone());
                    }
                    let found = env.trace.find(&at).map(|t| env.trace.value(t));
                    return found.ok_or_else(|| {
                        fail(arg.value.span, format!("this state has no choice {at}"))
                    });
                }
                "log_joint" | "log_prior" | "log_likelihood" if env.moved.is_some() => {
                    return Err(unmapped(e));
                }
                "log_joint" => return Ok(Value::Num(env.trace.log_joint())),
                "log_prior" => return Ok(Value::Num(env.trace.log_prior())),
                "log_likelihood" => return Ok(Value::Num(env.trace.log_likelihood())),
                _ => {}
            }
            let values: Result<Vec<Value>, _> =
                args.iter().map(|a| evaluate(&a.value, env)).collect();
            let values = values?;
            let called = known(name, e, env)?;
            // One value per parameter, `Unit` if it is omitted. Keyword arguments may
            // change the order.
            let order = called.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node)));
            let order = order.map_err(|message| fail(e.span, message))?;
            let placed: Vec<&Value> =
                order.iter().map(|i| i.map_or(&Value::Unit, |i| &values[i])).collect();
            apply(called, &placed, e)
        }
        ExprKind::If { cond, then, otherwise } => {
            let taken = match evaluate(cond, env)? {
                Value::Bool(true) => then,
                Value::Bool(false) => otherwise,
                v => {
                    return Err(fail(
                        cond.span,
                        format!("a condition must be a bool, got {}", v.type_name()),
                    ));
                }
            };
            match (&taken.stmts[..], &taken.result) {
                ([], Some(result)) => evaluate(result, env),
                _ => Err(unsupported(e)),
            }
        }
        _ => Err(unsupported(e)),
    }
}

fn variable(name: &Arc<str>, e: &Expr, env: &mut PlanEnv) -> Result<Value, Box<RunError>> {
    if let Some((_, v)) = env.variables.iter().rev().find(|(n, _)| n == name) {
        return Ok(v.clone());
    }
    if env.moved.is_some()
        && env.code.globals.get(name).is_some_and(|o| !matches!(o, Operand::Const(_)))
    {
        return Err(unmapped(e));
    }
    match env.trace.global(name, env.draws) {
        Some(v) => v,
        None => Err(fail(e.span, format!("unknown name `{name}`"))),
    }
}

fn builtin(name: &str, values: &[&Value], e: &Expr, env: &PlanEnv) -> Result<Value, Box<RunError>> {
    apply(known(name, e, env)?, values, e)
}

/// A builtin by its name.
fn known<'a>(name: &str, e: &Expr, env: &'a PlanEnv) -> Result<&'a Builtin, Box<RunError>> {
    let builtins = &env.code.builtins;
    let found = builtins.find("", name).map(|i| builtins.get(i));
    found.ok_or_else(|| fail(e.span, format!("unknown name `{name}`")))
}

fn apply(b: &Builtin, values: &[&Value], e: &Expr) -> Result<Value, Box<RunError>> {
    match b.kind {
        Kind::Function(f) => f(&Args { builtin: b, values }).map_err(|f| fault(e.span, f)),
        Kind::Distribution(_) => match b.distribution(values) {
            Ok(d) => Ok(Value::Dist(Arc::new(d))),
            Err(f) => Err(Box::new(RunError { kind: f.kind, ..*fault(e.span, f) })),
        },
        _ => Err(fail(e.span, format!("`{}` is not available here", b.name))),
    }
}

fn unmapped(e: &Expr) -> Box<RunError> {
    let mut error = fail(
        e.span,
        "a map may use only choices and constants, so that its derivatives are known".into(),
    );
    error.hint = Some("write it in terms of value(@x) of the choices it depends on".into());
    error
}

fn unsupported(e: &Expr) -> Box<RunError> {
    fail(e.span, "this expression cannot be used in an inference block".into())
}

/// The name of the built-in that implements an operator.
fn operator(op: BinaryOp) -> &'static str {
    match op {
        BinaryOp::Add => "+",
        BinaryOp::Sub => "-",
        BinaryOp::Mul => "*",
        BinaryOp::Div => "/",
        BinaryOp::Rem => "%",
        BinaryOp::Pow => "**",
        BinaryOp::Intersect => "&",
        BinaryOp::Eq => "==",
        BinaryOp::Ne => "!=",
        BinaryOp::Lt => "<",
        BinaryOp::Le => "<=",
        BinaryOp::Gt => ">",
        BinaryOp::Ge => ">=",
        BinaryOp::And => "and",
        BinaryOp::Or => "or",
        BinaryOp::Range => "..",
    }
}
