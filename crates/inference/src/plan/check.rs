//! What kernels check of their calls before a chain begins.

use crate::calls::build::KernelMaker;
use crate::run::RunOptions;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::{Callee, Step};

/// Checks the calls of a plan.
///
/// # Errors
/// What a kernel finds wrong with a call.
pub(super) fn check(
    code: &Code,
    steps: &[Step],
    options: &RunOptions,
) -> Result<(), Box<RunError>> {
    for step in steps {
        for call in step.calls() {
            if let Callee::Builtin(i) = call.kernel
                && let Some(check) = KernelMaker::of(code.builtins.get(i)).and_then(|m| m.check)
            {
                check(call, options)?;
            }
        }
        check(code, step.body(), options)?;
    }
    Ok(())
}
