//! The rows in which the language's own built-ins are declared: constants that are
//! converted to entries of the table.

use super::builtin::{
    Args, Argument, Builtin, Derivative, HostItem, Kind, PreviousEvaluation, Scalar, State, Type,
    Vjp,
};
use super::call::call_host;
use super::data::DataFormat;
use crate::lang::fault::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::Drawn;
use std::sync::Arc;

/// One argument; see [`Argument`].
#[derive(Clone, Copy, Debug)]
pub struct Arg {
    /// Its name, by which calls may give it.
    pub name: &'static str,
    /// Its type.
    pub ty: Type,
    /// The unit of its numbers, for the reference.
    pub unit: &'static str,
    /// The text of its default, if it may be left out.
    pub default: Option<&'static str>,
    /// A sentence for the reference.
    pub doc: &'static str,
}

/// A required argument.
pub const fn arg(name: &'static str, ty: Type, doc: &'static str) -> Arg {
    Arg { name, ty, unit: "", default: None, doc }
}

/// An optional argument with its default.
pub const fn opt(name: &'static str, ty: Type, default: &'static str, doc: &'static str) -> Arg {
    Arg { name, ty, unit: "", default: Some(default), doc }
}

impl Arg {
    /// Adds a unit.
    pub const fn unit(self, unit: &'static str) -> Arg {
        Arg { unit, ..self }
    }
}

/// A function that may start from its previous evaluation, and returns the state that it
/// keeps beside its value.
pub type Resume = fn(&Args, Option<&PreviousEvaluation>) -> Result<(Value, State), Fault>;

/// One built-in; see [`Builtin`].
#[derive(Clone, Copy)]
pub struct Row {
    /// Its name within its module.
    pub name: &'static str,
    /// Its module; empty for the language's own namespace.
    pub module: &'static str,
    /// The section of the reference that lists it.
    pub section: &'static str,
    /// Its arguments, in the order of a call.
    pub args: &'static [Arg],
    /// True if the last argument may be repeated.
    pub variadic: bool,
    /// Its result.
    pub returns: Type,
    /// Its text in the reference.
    pub doc: &'static str,
    /// Its kind and its evaluation.
    pub kind: Kind,
    /// The same function of numbers, if there is one.
    pub scalar: Option<Scalar>,
    /// Its derivative.
    pub derivative: Derivative,
    /// How it starts from its previous evaluation, for an incremental function.
    pub incremental: Option<Resume>,
    /// How files are read, for a kind of data.
    pub format: Option<fn() -> Arc<dyn DataFormat>>,
}

/// A pure function in the language's own namespace.
pub const fn function(
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
    f: fn(&Args) -> Result<Value, Fault>,
) -> Row {
    Row::new(Kind::Function(f), name, section, args, returns, doc)
}

impl Row {
    /// A row in the language's own namespace, without a known derivative.
    pub const fn new(
        kind: Kind,
        name: &'static str,
        section: &'static str,
        args: &'static [Arg],
        returns: Type,
        doc: &'static str,
    ) -> Row {
        let derivative = Derivative::Unknown;
        Row {
            name,
            module: "",
            section,
            args,
            variadic: false,
            returns,
            doc,
            kind,
            scalar: None,
            derivative,
            incremental: None,
            format: None,
        }
    }

    /// An incremental function in the language's own namespace: it returns its value with the
    /// state that it keeps, and may start from its previous evaluation, which only saves work.
    pub const fn incremental(
        name: &'static str,
        section: &'static str,
        args: &'static [Arg],
        returns: Type,
        doc: &'static str,
        f: Resume,
    ) -> Row {
        let kind = Kind::Function(call_host);
        Row { incremental: Some(f), ..Row::new(kind, name, section, args, returns, doc) }
    }

    /// Adds its action on single numbers.
    pub const fn scalar(self, f: Scalar) -> Row {
        Row { scalar: Some(f), ..self }
    }

    /// Allows the last argument to be repeated.
    pub const fn variadic(self) -> Row {
        Row { variadic: true, ..self }
    }

    /// Adds its vector-Jacobian product.
    pub const fn vjp(self, f: Vjp) -> Row {
        Row { derivative: Derivative::Product(f), ..self }
    }

    /// Adds its derivative.
    pub const fn derivative(self, derivative: Derivative) -> Row {
        Row { derivative, ..self }
    }

    /// Declares that its derivative is zero wherever it exists.
    pub const fn flat(self) -> Row {
        Row { derivative: Derivative::Zero, ..self }
    }
}

impl From<&Row> for Builtin {
    fn from(r: &Row) -> Builtin {
        let argument = |a: &Arg| Argument {
            name: a.name.into(),
            ty: a.ty,
            unit: a.unit.into(),
            default: a.default.map(Into::into),
            value: Value::Unit,
            doc: a.doc.into(),
        };
        Builtin {
            name: r.name.into(),
            module: r.module.into(),
            section: r.section.into(),
            args: r.args.iter().map(argument).collect(),
            variadic: r.variadic,
            returns: r.returns,
            doc: r.doc.into(),
            kind: r.kind,
            scalar: r.scalar,
            drawn: Drawn::Unknown,
            derivative: r.derivative,
            host: r
                .incremental
                .map(|call| HostItem::Incremental { call: Arc::new(call), vjp: None }),
            format: r.format.map(|format| format()),
            example: None,
        }
    }
}
