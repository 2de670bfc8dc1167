//! Builds kernels from their calls in inference blocks.

use crate::infer::calls::expr::{PlanEnv, evaluate};
use crate::infer::calls::host_kernel::build_host_kernel;
use crate::infer::calls::selection::{fail, scope, selector};
use crate::infer::kernel::{self, Kernel};
use crate::infer::kernels::{
    Abc, AbcSmc, Block, Delayed, Drift, Elliptical, Gibbs, Hmc, Knn, Mh, Modes, Nuts, Optimize,
    ProgramKernel, Slice, Smc, Temper,
};
use crate::infer::plan::banks::neighbours;
use crate::infer::plan::{RunOptions, argument, call};
use crate::lang::builtins::HostItem;
use crate::lang::error::RunError;
use crate::lang::value::Value;
use crate::syntax::ast::{Address, Arg, Expr, ExprKind, KernelDecl, Key, Param};
use crate::syntax::print_expr;
use crate::syntax::span::Span;
use crate::trace::Selector;
use std::sync::Arc;

/// A kernel, and the signature that identifies it: calls with the same text and the same
/// choices share one kernel, so that what it adapts in warm-up is used by later loops.
pub(in crate::infer) struct Built {
    pub kernel: Box<dyn Kernel>,
    pub signature: String,
}

/// Builds the kernel of a call. Choices that the program froze are excluded.
///
/// # Errors
/// What is wrong with the call, with its position.
pub(in crate::infer) fn build(
    e: &Expr,
    frozen: &Selector,
    options: &RunOptions,
    env: &mut PlanEnv,
) -> Result<Built, Box<RunError>> {
    let Some((name, args)) = call(e) else {
        return Err(fail(e.span, "expected a kernel, such as mh(one(@**))".into()));
    };
    if let Some(k) = env.code.kernels.iter().find(|k| &*k.name.node == name) {
        let arguments = arguments(k, args, e.span, env)?;
        let signature = format!("{name}{arguments:?}");
        let kernel = ProgramKernel::new(Arc::clone(env.code), k.clone(), arguments, env.started);
        return Ok(Built { kernel: Box::new(kernel), signature });
    }
    let builtins = Arc::clone(&env.code.builtins);
    let known = builtins.find("", name).map(|i| builtins.get(i));
    if let Some(b) = known
        && let Some(HostItem::Kernel(maker)) = &b.host
    {
        return build_host_kernel(e, (b, maker), args, frozen, options, env);
    }
    if known.is_some_and(|b| b.is_planned()) {
        let mut e =
            fail(e.span, format!("the kernel `{name}` is not available yet in this version"));
        e.hint = Some(format!("available kernels: {AVAILABLE}"));
        return Err(e);
    }
    let Some(first) = args.first() else {
        return Err(fail(e.span, format!("`{name}` needs a selection of choices, e.g. @**")));
    };
    if name == "temper" {
        let levels = whole(argument(args, 1, "levels"), "levels", 6, 2, 1000, env)?;
        let hottest = positive(argument(args, 2, "hottest"), name, "hottest", env)?.unwrap_or(0.01);
        let mut inner = Vec::with_capacity(levels as usize);
        for _ in 0..levels {
            inner.push(build(&first.value, frozen, options, env)?);
        }
        let signature = format!("temper({}, {levels}, {hottest})", inner[0].signature);
        let kernel = Temper::new(inner.into_iter().map(|b| b.kernel).collect(), hottest.min(1.0));
        return Ok(Built { kernel: Box::new(kernel), signature });
    }
    if name == "smc" {
        let inner = build(&first.value, frozen, options, env)?;
        let particles = whole(argument(args, 1, "particles"), "particles", 100, 2, 1_000_000, env)?;
        let signature = format!("smc({}, {particles})", inner.signature);
        let kernel = Smc::new(inner.kernel, particles as usize, frozen.clone(), e.span);
        return Ok(Built { kernel: Box::new(kernel), signature });
    }
    if name == "delayed" {
        let inner = build(&first.value, frozen, options, env)?;
        let at = argument(args, 1, "at")
            .ok_or_else(|| fail(e.span, "delayed needs an observation, given as `at`".into()))?;
        let observations = selector(at, env)?;
        let signature = format!("delayed({}, {observations:?})", inner.signature);
        let kernel = Delayed::new(inner.kernel, observations, e.span);
        return Ok(Built { kernel: Box::new(kernel), signature });
    }
    if name == "abc" {
        let inner = build(&first.value, frozen, options, env)?;
        let eps = positive(argument(args, 1, "eps"), name, "eps", env)?;
        let eps = eps.ok_or_else(|| {
            fail(e.span, "abc needs the tolerance `eps`, the largest accepted distance".into())
        })?;
        let Some(particles) = argument(args, 2, "particles") else {
            let signature = format!("abc({}, {eps})", inner.signature);
            return Ok(Built { kernel: Box::new(Abc::new(inner.kernel, eps, e.span)), signature });
        };
        let particles = whole(Some(particles), "particles", 100, 2, 1_000_000, env)?;
        let moves = whole(argument(args, 3, "moves"), "moves", 1, 1, 10_000, env)?;
        let signature = format!("abc({}, {eps}, {particles}, {moves})", inner.signature);
        let kernel =
            AbcSmc::new(inner.kernel, eps, (particles as usize, moves), frozen.clone(), e.span);
        return Ok(Built { kernel: Box::new(kernel), signature });
    }
    let mut scope = scope(&first.value, env)?;
    scope.selector = without(scope.selector, frozen);
    // The printed call identifies the arguments, unless it contains names.
    let given: Vec<Value> = match is_constant(e) {
        true => Vec::new(),
        false => args[1..].iter().filter_map(|a| evaluate(&a.value, env).ok()).collect(),
    };
    let signature = format!("{} {scope:?} {given:?}", print_expr(e));
    let kernel: Box<dyn Kernel> = match name {
        "mh" => Box::new(Mh::new(scope)),
        "block" => Box::new(Block::new(scope)),
        "gibbs" => Box::new(Gibbs::new(scope)),
        "elliptical" => Box::new(Elliptical::new(scope)),
        "hmc" => {
            let steps = whole(argument(args, 1, "steps"), "steps", 10, 1, 10_000, env)?;
            Box::new(Hmc::new(scope, steps, None).summing_out(marginal(args, 2, frozen, env)?))
        }
        "mala" => Box::new(Hmc::new(scope, 1, None).summing_out(marginal(args, 1, frozen, env)?)),
        "nuts" => {
            let depth = whole(argument(args, 1, "max_depth"), "max_depth", 10, 1, 20, env)?;
            Box::new(Nuts::new(scope, depth).summing_out(marginal(args, 2, frozen, env)?))
        }
        "knn" => Box::new(Knn::new(scope, neighbours(e, args, options, env)?)),
        "drift" => {
            Box::new(Drift::new(scope, positive(argument(args, 1, "scale"), name, "scale", env)?))
        }
        "slice" => {
            let width = positive(argument(args, 1, "width"), name, "width", env)?;
            Box::new(Slice::new(
                scope,
                width,
                truth(argument(args, 2, "doubling"), "doubling", env)?,
            ))
        }
        "optimize" => Box::new(Optimize::new(
            scope,
            whole(argument(args, 1, "steps"), "steps", 100, 1, 1_000_000, env)?,
        )),
        "modes" => {
            let tries = whole(argument(args, 1, "tries"), "tries", 200, 1, 1_000_000, env)?;
            let keep = whole(argument(args, 2, "keep"), "keep", 16, 1, 1000, env)?;
            let steps = whole(argument(args, 3, "steps"), "steps", 60, 1, 1_000_000, env)?;
            let first = argument(args, 4, "first").map(|e| self::scope(e, env)).transpose()?;
            let first =
                first.map(|s| kernel::SiteSelection { selector: without(s.selector, frozen), ..s });
            let coarse =
                argument(args, 5, "at").map_or(Ok(Selector::Nothing), |e| selector(e, env))?;
            Box::new(
                Modes::new(scope, tries, keep, steps)
                    .climbing_first(first)
                    .by_surrogates_of(coarse),
            )
        }
        _ => return Err(fail(e.span, format!("`{name}` is not a kernel"))),
    };
    Ok(Built { kernel, signature })
}

const AVAILABLE: &str = "mh, block, drift, gibbs, elliptical, hmc, mala, nuts, slice, knn, delayed, temper, smc, abc, modes, optimize";

pub(in crate::infer) fn without(selector: Selector, frozen: &Selector) -> Selector {
    match frozen {
        Selector::Nothing => selector,
        _ => Selector::Minus(Box::new(selector), Box::new(frozen.clone())),
    }
}

/// The finite choices that a kernel sums out.
fn marginal(
    args: &[Arg],
    place: usize,
    frozen: &Selector,
    env: &mut PlanEnv,
) -> Result<Selector, Box<RunError>> {
    let Some(e) = argument(args, place, "marginal") else { return Ok(Selector::Nothing) };
    Ok(without(selector(e, env)?, frozen))
}

/// The values of the parameters of a declared kernel, by name.
///
/// # Errors
/// If an argument is missing, or its evaluation fails.
pub(in crate::infer) fn arguments(
    k: &KernelDecl,
    args: &[Arg],
    call: Span,
    env: &mut PlanEnv,
) -> Result<Vec<(Arc<str>, Value)>, Box<RunError>> {
    let one = |(i, p): (usize, &Param)| {
        let given = argument(args, i, &p.name.node).or(p.default.as_ref());
        let given = given
            .ok_or_else(|| fail(call, format!("the argument `{}` is missing", p.name.node)))?;
        Ok((Arc::clone(&p.name.node), evaluate(given, env)?))
    };
    k.params.iter().enumerate().map(one).collect()
}

/// A positive numeric argument of a kernel, if it is given.
fn positive(
    e: Option<&Expr>,
    kernel: &str,
    name: &str,
    env: &mut PlanEnv,
) -> Result<Option<f64>, Box<RunError>> {
    let Some(e) = e else { return Ok(None) };
    match evaluate(e, env)? {
        Value::Num(s) if s > 0.0 => Ok(Some(s)),
        v => Err(fail(e.span, format!("{kernel}: `{name}` must be positive, got {v}"))),
    }
}

/// A boolean argument of a kernel; false unless given.
fn truth(e: Option<&Expr>, name: &str, env: &mut PlanEnv) -> Result<bool, Box<RunError>> {
    let Some(e) = e else { return Ok(false) };
    match evaluate(e, env)? {
        Value::Bool(b) => Ok(b),
        v => Err(fail(e.span, format!("`{name}` must be true or false, got {v}"))),
    }
}

/// A whole-number argument of a kernel.
fn whole(
    e: Option<&Expr>,
    name: &str,
    default: u32,
    least: u32,
    most: u32,
    env: &mut PlanEnv,
) -> Result<u32, Box<RunError>> {
    let Some(e) = e else { return Ok(default) };
    match evaluate(e, env)? {
        Value::Num(x) if x >= f64::from(least) && x <= f64::from(most) && x == libm::trunc(x) => {
            Ok(x as u32)
        }
        v => Err(fail(
            e.span,
            format!("`{name}` must be a whole number from {least} to {most}, got {v}"),
        )),
    }
}

/// Whether a call means the same whenever it is executed: it contains no names.
pub(in crate::infer) fn is_constant(e: &Expr) -> bool {
    let arguments = |args: &[Arg]| args.iter().all(|a| is_constant(&a.value));
    match &e.kind {
        ExprKind::Num(_) | ExprKind::Str(_) | ExprKind::Bool(_) | ExprKind::TagSel { .. } => true,
        ExprKind::Address(a) => has_constant_keys(a),
        ExprKind::Call { args, .. } => arguments(args),
        ExprKind::Unary { expr, .. } => is_constant(expr),
        ExprKind::Binary { left, right, .. } => is_constant(left) && is_constant(right),
        _ => false,
    }
}

fn has_constant_keys(a: &Address) -> bool {
    a.segments.iter().flat_map(|s| &s.keys).all(|k| !matches!(k, Key::Expr(_)))
}
