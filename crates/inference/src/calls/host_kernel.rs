//! Kernels that a host defines: their calls in inference blocks, and their constructors.

use crate::kernel::{Kernel, SiteSelection};
use pcadlang_engine::lang::builtins::Args;
use pcadlang_engine::lang::error::Fault;

/// A call of a host's kernel in an `infer` block, with its arguments evaluated.
pub struct KernelCall<'a> {
    pub(super) args: Args<'a>,
    pub(super) scopes: Vec<Option<SiteSelection>>,
    pub(super) kernels: Vec<Option<Box<dyn Kernel>>>,
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
pub(crate) struct KernelMaker(pub(super) Box<Make>);

impl KernelMaker {
    pub fn new(
        make: impl Fn(&mut KernelCall) -> Result<Box<dyn Kernel>, Fault> + Send + Sync + 'static,
    ) -> KernelMaker {
        KernelMaker(Box::new(make))
    }
}
