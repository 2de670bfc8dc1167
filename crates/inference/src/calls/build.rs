//! Builds kernels from their calls in plans.

use crate::calls::call::Call;
use crate::calls::error::fail;
use crate::calls::formula::{PlanEnv, evaluate};
use crate::kernel::Kernel;
use crate::kernels::ProgramKernel;
use crate::run::RunOptions;
use pcadlang_engine::lang::builtins::{Builtin, HostItem};
use pcadlang_engine::lang::error::RunError;
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

impl Built {
    pub fn new(kernel: impl Kernel + 'static, signature: String) -> Built {
        Built { kernel: Box::new(kernel), signature }
    }
}

/// Looks at a call before the chain begins.
pub(crate) type Check = fn(&KernelCall, &RunOptions) -> Result<(), Box<RunError>>;

type Make = dyn Fn(&mut Call) -> Result<Built, Box<RunError>> + Send + Sync;

/// Makes a kernel from its call; stored with its entry in the table of built-ins.
pub(crate) struct KernelMaker {
    pub make: Box<Make>,
    pub check: Option<Check>,
}

impl KernelMaker {
    /// The maker of this kernel; `None` of any other built-in.
    pub fn of(builtin: &Builtin) -> Option<&KernelMaker> {
        match &builtin.host {
            Some(HostItem::Kernel(maker)) => maker.downcast_ref(),
            _ => None,
        }
    }
}

/// The context in which all kernels of a chain are built.
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
/// The fault of the call, with its position.
pub(crate) fn build(
    call: &KernelCall,
    setting: Setting,
    env: &mut PlanEnv,
) -> Result<Built, Box<RunError>> {
    match call.kernel {
        Callee::Builtin(i) => {
            let table = Arc::clone(&env.trace.code().builtins);
            let builtin = table.get(i);
            let mut call = Call { call, builtin, setting, env };
            match KernelMaker::of(builtin) {
                Some(maker) => (maker.make)(&mut call),
                None => Err(call.not_a_kernel()),
            }
        }
        Callee::Declared(i) => {
            let k = &setting.kernels[i];
            let arguments = arguments(k, call, env)?;
            let signature = format!("{}{arguments:?}", k.name.node);
            let kernels = Arc::clone(setting.kernels);
            Ok(Built::new(ProgramKernel::new(kernels, i, arguments, env.started), signature))
        }
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
