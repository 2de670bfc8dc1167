//! The rows in which kernels are declared: constants that are converted to entries of the
//! table of built-ins.

pub(super) use crate::calls::build::Built;
use crate::calls::build::{Check, KernelMaker};
use crate::calls::call::Call;
use pcadlang_engine::lang::builtins::{Arg, Builtin, HostItem, KernelTraits, Kind, PlanForm, Row};
pub(super) use pcadlang_engine::lang::builtins::{Type, arg, flag, int, num, opt};
use pcadlang_engine::lang::error::RunError;
use std::sync::Arc;

/// A kernel of the language.
#[derive(Clone, Copy)]
pub(crate) struct KernelRow {
    name: &'static str,
    args: &'static [Arg],
    doc: &'static str,
    /// A program that uses it.
    example: &'static str,
    traits: KernelTraits,
    make: Make,
    check: Option<Check>,
}

/// Makes a kernel from its call.
type Make = fn(&mut Call) -> Result<Built, Box<RunError>>;

impl KernelRow {
    pub const fn new(
        name: &'static str,
        args: &'static [Arg],
        doc: &'static str,
        example: &'static str,
        make: Make,
    ) -> KernelRow {
        let traits = KernelTraits { irreversible: false, of_reversible: None };
        KernelRow { name, args, doc, example, traits, make, check: None }
    }

    /// Declares that a step is not a reversible move of one state.
    pub const fn irreversible(mut self) -> KernelRow {
        self.traits.irreversible = true;
        self
    }

    /// Takes only reversible kernels, as in this call.
    pub const fn of_reversible(mut self, example: &'static str) -> KernelRow {
        self.traits.of_reversible = Some(example);
        self
    }

    /// Adds a check of calls before the chain begins.
    pub const fn checked(mut self, check: Check) -> KernelRow {
        self.check = Some(check);
        self
    }
}

impl From<&KernelRow> for Builtin {
    fn from(k: &KernelRow) -> Builtin {
        let kind = Kind::Plan(PlanForm::Kernel(k.traits));
        let row = Row::new(kind, k.name, "Kernels", k.args, Type::Kernel, k.doc);
        let maker = KernelMaker { make: Box::new(k.make), check: k.check };
        Builtin {
            host: Some(HostItem::Kernel(Arc::new(maker))),
            example: Some(k.example.into()),
            ..Builtin::from(&row)
        }
    }
}

pub(super) const SEL: Arg = arg("sel", Type::Selection, "The choices it moves.");
pub(super) const INNER: Arg = arg("move", Type::Kernel, "The inner kernel.");
pub(super) const MARGINAL: Arg = opt(
    "marginal",
    Type::Selection,
    "none",
    "Finite discrete choices to marginalise: they are summed out of the density and then drawn \
     given the rest. Choices that no score depends on together are summed one by one, others \
     jointly: at most 1000 joint values, or chains and trees of any length where their density \
     can be recorded. Choices that cannot be summed out are an error.",
);

/// A program with one number and one observation, followed by a plan.
macro_rules! number {
    ($plan:literal) => {
        concat!("assume x ~ normal(0, 1);\nobserve normal(x, 1) = 2 as y;\n", $plan)
    };
}
pub(super) use number;
