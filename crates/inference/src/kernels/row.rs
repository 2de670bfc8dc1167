//! The rows in which kernels are declared: constants that are converted to entries of the
//! table of built-ins.

use crate::calls::build::{Built, Check, KernelMaker};
use crate::calls::call::Call;
use crate::kernel::{Kernel, SiteSelection};
use pcadlang_engine::lang::builtins::{
    Arg, Builtin, HostItem, KernelTraits, Kind, PlanForm, Row, Type, arg, opt,
};
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

/// Makes a kernel that moves the choices of its first argument.
type Moving = fn(SiteSelection, &mut Call) -> Result<Box<dyn Kernel>, Box<RunError>>;
/// Makes a kernel that applies the one of its first argument.
type Applying = fn(&mut Call) -> Result<Built, Box<RunError>>;

#[derive(Clone, Copy)]
enum Make {
    Moving(Moving),
    Applying(Applying),
}

impl KernelRow {
    const fn new(
        name: &'static str,
        args: &'static [Arg],
        doc: &'static str,
        example: &'static str,
        make: Make,
    ) -> KernelRow {
        let traits = KernelTraits { irreversible: false, of_reversible: None };
        KernelRow { name, args, doc, example, traits, make, check: None }
    }

    /// A kernel that moves the choices of its first argument. Calls with the same text,
    /// choices and values share one.
    pub const fn moving(
        name: &'static str,
        args: &'static [Arg],
        doc: &'static str,
        example: &'static str,
        make: Moving,
    ) -> KernelRow {
        KernelRow::new(name, args, doc, example, Make::Moving(make))
    }

    /// A kernel that applies the one of its first argument.
    pub const fn applying(
        name: &'static str,
        args: &'static [Arg],
        doc: &'static str,
        example: &'static str,
        make: Applying,
    ) -> KernelRow {
        KernelRow::new(name, args, doc, example, Make::Applying(make))
    }

    /// Declares that a step is not a reversible move of one state.
    pub const fn irreversible(self) -> KernelRow {
        let traits = KernelTraits { irreversible: true, ..self.traits };
        KernelRow { traits, ..self }
    }

    /// Takes only reversible kernels, as in this call.
    pub const fn of_reversible(self, example: &'static str) -> KernelRow {
        let traits = KernelTraits { of_reversible: Some(example), ..self.traits };
        KernelRow { traits, ..self }
    }

    /// Adds a check of calls before the chain begins.
    pub const fn checked(self, check: Check) -> KernelRow {
        KernelRow { check: Some(check), ..self }
    }
}

impl From<&KernelRow> for Builtin {
    fn from(k: &KernelRow) -> Builtin {
        let kind = Kind::Plan(PlanForm::Kernel(k.traits));
        let row = Row::new(kind, k.name, "Kernels", k.args, Type::Kernel, k.doc);
        let maker = match k.make {
            Make::Applying(make) => KernelMaker::new(make, k.check),
            Make::Moving(make) => {
                let make = move |call: &mut Call| {
                    let (scope, signature) = call.moved()?;
                    Ok(Built { kernel: make(scope, call)?, signature })
                };
                KernelMaker::new(make, k.check)
            }
        };
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
