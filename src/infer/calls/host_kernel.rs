//! Kernels that a host defines: their calls in inference blocks, and their constructors.

use crate::infer::calls::build::{Built, build, without};
use crate::infer::calls::expr::{PlanEnv as Env, evaluate};
use crate::infer::calls::selection::{fail, fault, scope};
use crate::infer::kernel::{Kernel, SiteSelection};
use crate::infer::plain::Plain;
use crate::infer::plan::RunOptions;
use crate::lang::builtins::{Args, Builtin, State, Type};
use crate::lang::error::{Fault, RunError};
use crate::lang::value::Value;
use crate::syntax::ast::{Arg, Expr};
use crate::syntax::print_expr;
use crate::trace::Selector;

/// A call of a host's kernel in an `infer` block, with its arguments evaluated.
pub struct KernelCall<'a> {
    args: Args<'a>,
    scopes: Vec<Option<SiteSelection>>,
    kernels: Vec<Option<Box<dyn Kernel>>>,
}

impl KernelCall<'_> {
    /// The arguments that are plain values, such as numbers and truth values.
    pub fn args(&self) -> &Args<'_> {
        &self.args
    }

    /// The choices that argument `i` selects, without those that the program froze.
    ///
    /// # Errors
    /// If the argument is not a selection.
    pub fn scope(&self, i: usize) -> Result<SiteSelection, Fault> {
        self.scopes
            .get(i)
            .cloned()
            .flatten()
            .ok_or_else(|| self.args.wrong(i, "a selection such as @**"))
    }

    /// The kernel passed as argument `i`, for kernels that apply others. It can be taken
    /// once.
    ///
    /// # Errors
    /// If the argument is not a kernel.
    pub fn kernel(&mut self, i: usize) -> Result<Box<dyn Kernel>, Fault> {
        let found = self.kernels.get_mut(i).and_then(Option::take);
        found.ok_or_else(|| self.args.wrong(i, "a kernel such as mh(@**)"))
    }
}

type Make = dyn Fn(&mut KernelCall) -> Result<Box<dyn Kernel>, Fault> + Send + Sync;

/// Constructs a host's kernel from its call; stored with its entry in the table of
/// built-ins.
pub(crate) struct KernelMaker(Box<Make>);

impl KernelMaker {
    pub fn new(
        make: impl Fn(&mut KernelCall) -> Result<Box<dyn Kernel>, Fault> + Send + Sync + 'static,
    ) -> KernelMaker {
        KernelMaker(Box::new(make))
    }
}

/// Builds the kernel of a call.
///
/// # Errors
/// What is wrong with the call, with its position.
pub(in crate::infer) fn build_host_kernel(
    e: &Expr,
    (builtin, maker): (&Builtin, &State),
    args: &[Arg],
    frozen: &Selector,
    options: &RunOptions,
    env: &mut Env,
) -> Result<Built, Box<RunError>> {
    let order = builtin.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node)));
    let order = order.map_err(|message| fail(e.span, message))?;
    let (mut values, mut scopes, mut kernels) = (Vec::new(), Vec::new(), Vec::new());
    let mut signature = print_expr(e);
    for (from, arg) in order.iter().zip(builtin.args.iter()) {
        let (mut value, mut selected, mut inner) = (Value::Unit, None, None);
        match (from.and_then(|i| args.get(i)).map(|a| &a.value), arg.ty) {
            (None, _) => {}
            (Some(e), Type::Selection) => {
                let mut s = scope(e, env)?;
                s.selector = without(s.selector, frozen);
                signature += &format!(" {s:?}");
                selected = Some(s);
            }
            (Some(e), Type::Kernel) => {
                let built = build(e, frozen, options, env)?;
                signature += &format!(" {}", built.signature);
                inner = Some(built.kernel);
            }
            (Some(e), _) => {
                value = evaluate(e, env)?;
                signature += &format!(" {:?}", Plain::of(&value));
            }
        }
        values.push(value);
        scopes.push(selected);
        kernels.push(inner);
    }
    let values: Vec<&Value> = values.iter().collect();
    let mut call = KernelCall { args: Args { builtin, values: &values }, scopes, kernels };
    let made = match maker.downcast_ref::<KernelMaker>() {
        Some(maker) => (maker.0)(&mut call),
        None => Err(Fault::type_error(format!("`{}` is not a kernel", builtin.full_name()))),
    };
    Ok(Built { kernel: made.map_err(|f| fault(e.span, f))?, signature })
}
