//! Kernels that a host defines: their calls in inference blocks, and their constructors.

use crate::calls::build::{Built, build};
use crate::calls::call::Call;
use crate::calls::error::fault;
use crate::calls::formula::evaluate;
use crate::kernel::{Kernel, SiteSelection};
use crate::plain::Plain;
use pcadlang_engine::lang::builtins::Args;
use pcadlang_engine::lang::error::{Fault, RunError};
use pcadlang_engine::lang::plan::Argument;
use pcadlang_engine::lang::value::Value;

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

/// Makes a host's kernel: evaluates all arguments, and leaves the rest to `make`.
///
/// # Errors
/// The fault of the call, with its position.
pub(crate) fn build_host_kernel<K: Kernel + 'static>(
    call: &mut Call,
    make: impl Fn(&mut KernelCall) -> Result<K, Fault>,
) -> Result<Built, Box<RunError>> {
    let (mut values, mut scopes, mut kernels) = (Vec::new(), Vec::new(), Vec::new());
    let mut signature = call.call.text.to_string();
    for (place, arg) in call.call.args.iter().enumerate() {
        let (mut value, mut selected, mut inner) = (Value::Unit, None, None);
        match arg {
            Argument::Omitted => {}
            Argument::Choices(_) => {
                selected = call.scope(place)?;
                signature += &selected.iter().map(|s| format!(" {s:?}")).collect::<String>();
            }
            Argument::Kernel(arg) => {
                let built = build(arg, call.setting, call.env)?;
                signature += &format!(" {}", built.signature);
                inner = Some(built.kernel);
            }
            Argument::Value(f) => {
                value = evaluate(f, call.env)?;
                signature += &format!(" {:?}", Plain::of(&value));
            }
        }
        values.push(value);
        scopes.push(selected);
        kernels.push(inner);
    }
    let values: Vec<&Value> = values.iter().collect();
    let args = Args { builtin: call.builtin, values: &values };
    let made = make(&mut KernelCall { args, scopes, kernels });
    Ok(Built::new(made.map_err(|f| fault(call.span(), f))?, signature))
}
