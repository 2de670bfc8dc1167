//! Builds kernels from their calls in plans.

use crate::calls::error::{fail, fault};
use crate::calls::formula::{PlanEnv, evaluate};
use crate::calls::host_kernel::{KernelCall as HostCall, KernelMaker};
use crate::calls::selection::{scope, selector};
use crate::kernel::{Kernel, SiteSelection};
use crate::kernels::{
    Abc, AbcSmc, Block, Delayed, Drift, Elliptical, Gibbs, Hmc, Knn, Mh, Modes, Nuts, Optimize,
    ProgramKernel, Slice, Smc, Temper,
};
use crate::plain::Plain;
use crate::plan::banks::neighbours;
use crate::run::RunOptions;
use pcadlang_engine::lang::builtins::{Args as Values, Builtin, HostItem, Inference, Kind};
use pcadlang_engine::lang::error::{Fault, RunError};
use pcadlang_engine::lang::plan::{Argument, Callee, DeclaredKernel, Formula, KernelCall};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Selector;
use std::sync::Arc;

/// A kernel, and the signature that identifies it: calls with the same text and the same
/// choices share one kernel, so that what it adapts in warm-up is used by later loops.
pub(crate) struct Built {
    pub kernel: Box<dyn Kernel>,
    pub signature: String,
}

/// What all kernels of a chain are built with.
#[derive(Clone, Copy)]
pub(crate) struct Setting<'a> {
    /// The kernels that the program declares.
    pub kernels: &'a Arc<[DeclaredKernel]>,
    /// The choices that the program froze, which kernels leave out.
    pub frozen: &'a Selector,
    pub options: &'a RunOptions,
}

/// Builds the kernel of a call.
///
/// # Errors
/// What is wrong with the call, with its position.
pub(crate) fn build(
    call: &KernelCall,
    setting: Setting,
    env: &mut PlanEnv,
) -> Result<Built, Box<RunError>> {
    let i = match call.kernel {
        Callee::Builtin(i) => i,
        Callee::Declared(i) => {
            let k = &setting.kernels[i];
            let arguments = arguments(k, call, env)?;
            let signature = format!("{}{arguments:?}", k.name.node);
            let kernels = Arc::clone(setting.kernels);
            let kernel = Box::new(ProgramKernel::new(kernels, i, arguments, env.started));
            return Ok(Built { kernel, signature });
        }
    };
    let table = Arc::clone(&env.trace.code().builtins);
    let builtin = table.get(i);
    let mut a = Args { call, builtin, setting, env };
    let (span, text) = (call.span, &call.text);
    let built = |kernel, signature| Ok(Built { kernel, signature });
    let what = match builtin.kind {
        Kind::Inference(what) => what,
        _ => return Err(a.not_a_kernel()),
    };
    match what {
        Inference::Host => return build_host_kernel(call, builtin, setting, a.env),
        Inference::Planned => {
            let message =
                format!("the kernel `{}` is not available yet in this version", builtin.name);
            let mut e = fail(span, message);
            e.hint = Some(format!("available kernels: {AVAILABLE}"));
            return Err(e);
        }
        Inference::Temper => {
            let levels = a.whole(1, 6, 2, 1000)?;
            let hottest = a.positive(2)?.unwrap_or(0.01);
            let inner = (0..levels).map(|_| a.inner()).collect::<Result<Vec<_>, _>>()?;
            let signature = format!("temper({}, {levels}, {hottest})", inner[0].signature);
            let inner = inner.into_iter().map(|b| b.kernel).collect();
            return built(Box::new(Temper::new(inner, hottest.min(1.0))), signature);
        }
        Inference::Smc => {
            let inner = a.inner()?;
            let particles = a.whole(1, 100, 2, 1_000_000)?;
            let signature = format!("smc({}, {particles})", inner.signature);
            let frozen = setting.frozen.clone();
            return built(
                Box::new(Smc::new(inner.kernel, particles as usize, frozen, span)),
                signature,
            );
        }
        Inference::Delayed => {
            let inner = a.inner()?;
            let at = a.selector(1)?;
            let signature = format!("delayed({}, {at:?})", inner.signature);
            return built(Box::new(Delayed::new(inner.kernel, at, span)), signature);
        }
        Inference::Abc => {
            let inner = a.inner()?;
            let eps = a.positive(1)?.unwrap_or(f64::INFINITY);
            if a.value(2).is_none() {
                let signature = format!("abc({}, {eps})", inner.signature);
                return built(Box::new(Abc::new(inner.kernel, eps, span)), signature);
            }
            let (particles, moves) = (a.whole(2, 100, 2, 1_000_000)?, a.whole(3, 1, 1, 10_000)?);
            let signature = format!("abc({}, {eps}, {particles}, {moves})", inner.signature);
            let (size, frozen) = ((particles as usize, moves), setting.frozen.clone());
            return built(Box::new(AbcSmc::new(inner.kernel, eps, size, frozen, span)), signature);
        }
        _ => {}
    }
    let scope = a.scope(0)?.ok_or_else(|| a.not_a_kernel())?;
    let value = |arg: &Argument| match arg {
        Argument::Value(f) => evaluate(f, a.env).ok(),
        _ => None,
    };
    let given: Vec<Value> = call.args.iter().filter_map(value).collect();
    let signature = format!("{text} {scope:?} {given:?}");
    let kernel: Box<dyn Kernel> = match what {
        Inference::Mh => Box::new(Mh::new(scope)),
        Inference::Block => Box::new(Block::new(scope)),
        Inference::Gibbs => Box::new(Gibbs::new(scope)),
        Inference::Elliptical => Box::new(Elliptical::new(scope)),
        Inference::Hmc => {
            let steps = a.whole(1, 10, 1, 10_000)?;
            Box::new(Hmc::new(scope, steps, None).summing_out(a.marginal(2)?))
        }
        Inference::Mala => Box::new(Hmc::new(scope, 1, None).summing_out(a.marginal(1)?)),
        Inference::Nuts => {
            let depth = a.whole(1, 10, 1, 20)?;
            Box::new(Nuts::new(scope, depth).summing_out(a.marginal(2)?))
        }
        Inference::Knn => Box::new(Knn::new(scope, neighbours(call, setting.options, a.env)?)),
        Inference::Drift => Box::new(Drift::new(scope, a.positive(1)?)),
        Inference::Slice => Box::new(Slice::new(scope, a.positive(1)?, a.truth(2)?)),
        Inference::Optimize => Box::new(Optimize::new(scope, a.whole(1, 100, 1, 1_000_000)?)),
        Inference::Modes => {
            let tries = a.whole(1, 200, 1, 1_000_000)?;
            let keep = a.whole(2, 16, 1, 1000)?;
            let steps = a.whole(3, 60, 1, 1_000_000)?;
            let modes = Modes::new(scope, tries, keep, steps).climbing_first(a.scope(4)?);
            Box::new(modes.by_surrogates_of(a.selector(5)?))
        }
        _ => return Err(a.not_a_kernel()),
    };
    built(kernel, signature)
}

const AVAILABLE: &str = "mh, block, drift, gibbs, elliptical, hmc, mala, nuts, slice, knn, delayed, temper, smc, abc, modes, optimize";

pub(crate) fn without(selector: Selector, frozen: &Selector) -> Selector {
    match frozen {
        Selector::Nothing => selector,
        _ => Selector::Minus(Box::new(selector), Box::new(frozen.clone())),
    }
}

/// The values of the parameters of a declared kernel.
///
/// # Errors
/// If an argument is missing, or its evaluation fails.
pub(crate) fn arguments(
    k: &DeclaredKernel,
    call: &KernelCall,
    env: &mut PlanEnv,
) -> Result<Vec<Value>, Box<RunError>> {
    let one =
        |(arg, (name, default)): (&Argument, &(Arc<str>, Option<Formula>))| match (arg, default) {
            (Argument::Value(f), _) | (_, Some(f)) => evaluate(f, env),
            _ => Err(fail(call.span, format!("the argument `{name}` is missing"))),
        };
    call.args.iter().zip(&k.params).map(one).collect()
}

/// Builds a kernel of a host.
///
/// # Errors
/// What is wrong with the call, with its position.
fn build_host_kernel(
    call: &KernelCall,
    builtin: &Builtin,
    setting: Setting,
    env: &mut PlanEnv,
) -> Result<Built, Box<RunError>> {
    let (mut values, mut scopes, mut kernels) = (Vec::new(), Vec::new(), Vec::new());
    let mut signature = call.text.to_string();
    for arg in &call.args {
        let (mut value, mut selected, mut inner) = (Value::Unit, None, None);
        match arg {
            Argument::Omitted => {}
            Argument::Choices(c) => {
                let mut s = scope(c, env)?;
                s.selector = without(s.selector, setting.frozen);
                signature += &format!(" {s:?}");
                selected = Some(s);
            }
            Argument::Kernel(call) => {
                let built = build(call, setting, env)?;
                signature += &format!(" {}", built.signature);
                inner = Some(built.kernel);
            }
            Argument::Value(f) => {
                value = evaluate(f, env)?;
                signature += &format!(" {:?}", Plain::of(&value));
            }
        }
        values.push(value);
        scopes.push(selected);
        kernels.push(inner);
    }
    let values: Vec<&Value> = values.iter().collect();
    let args = Values { builtin, values: &values };
    let maker = match &builtin.host {
        Some(HostItem::Kernel(maker)) => maker.downcast_ref::<KernelMaker>(),
        _ => None,
    };
    let made = match maker {
        Some(maker) => (maker.0)(&mut HostCall { args, scopes, kernels }),
        None => Err(Fault::type_error(format!("`{}` is not a kernel", builtin.full_name()))),
    };
    Ok(Built { kernel: made.map_err(|f| fault(call.span, f))?, signature })
}

/// The arguments of a call of a built-in kernel, by their places.
struct Args<'a, 'e> {
    call: &'a KernelCall,
    builtin: &'a Builtin,
    setting: Setting<'a>,
    env: &'a mut PlanEnv<'e>,
}

impl<'a> Args<'a, '_> {
    fn not_a_kernel(&self) -> Box<RunError> {
        fail(self.call.span, format!("`{}` is not a kernel", self.builtin.name))
    }

    fn value(&self, place: usize) -> Option<&'a Formula> {
        let call = self.call;
        match call.args.get(place) {
            Some(Argument::Value(f)) => Some(f),
            _ => None,
        }
    }

    fn name(&self, place: usize) -> &'a str {
        let builtin = self.builtin;
        builtin.args.get(place).map_or("", |a| &a.name)
    }

    /// The kernel that this one applies.
    fn inner(&mut self) -> Result<Built, Box<RunError>> {
        match self.call.args.first() {
            Some(Argument::Kernel(call)) => build(call, self.setting, self.env),
            _ => Err(self.not_a_kernel()),
        }
    }

    /// The choices that an argument selects, without frozen ones.
    fn scope(&mut self, place: usize) -> Result<Option<SiteSelection>, Box<RunError>> {
        let Some(Argument::Choices(c)) = self.call.args.get(place) else { return Ok(None) };
        let s = scope(c, self.env)?;
        Ok(Some(SiteSelection { selector: without(s.selector, self.setting.frozen), ..s }))
    }

    /// The finite choices that a kernel sums out; none unless given.
    fn marginal(&mut self, place: usize) -> Result<Selector, Box<RunError>> {
        Ok(self.scope(place)?.map_or(Selector::Nothing, |s| s.selector))
    }

    /// The observations that surrogates replace; none unless given.
    fn selector(&mut self, place: usize) -> Result<Selector, Box<RunError>> {
        let Some(Argument::Choices(c)) = self.call.args.get(place) else {
            return Ok(Selector::Nothing);
        };
        selector(&c.selection, self.env)
    }

    /// A positive number, if it is given.
    fn positive(&mut self, place: usize) -> Result<Option<f64>, Box<RunError>> {
        let (kernel, name) = (&self.builtin.name, self.name(place));
        let Some(f) = self.value(place) else { return Ok(None) };
        let wrong = |v| fail(f.span, format!("{kernel}: `{name}` must be positive, got {v}"));
        match evaluate(f, self.env)? {
            Value::Num(s) if s > 0.0 => Ok(Some(s)),
            v => Err(wrong(v)),
        }
    }

    /// A truth value; false unless given.
    fn truth(&mut self, place: usize) -> Result<bool, Box<RunError>> {
        let name = self.name(place);
        let Some(f) = self.value(place) else { return Ok(false) };
        let wrong = |v| fail(f.span, format!("`{name}` must be true or false, got {v}"));
        match evaluate(f, self.env)? {
            Value::Bool(b) => Ok(b),
            v => Err(wrong(v)),
        }
    }

    /// A whole number.
    fn whole(
        &mut self,
        place: usize,
        default: u32,
        least: u32,
        most: u32,
    ) -> Result<u32, Box<RunError>> {
        let name = self.name(place);
        let Some(f) = self.value(place) else { return Ok(default) };
        let is_whole =
            |x: f64| x >= f64::from(least) && x <= f64::from(most) && x == libm::trunc(x);
        match evaluate(f, self.env)? {
            Value::Num(x) if is_whole(x) => Ok(x as u32),
            v => Err(fail(
                f.span,
                format!("`{name}` must be a whole number from {least} to {most}, got {v}"),
            )),
        }
    }
}
