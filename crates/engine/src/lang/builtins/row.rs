//! The rows in which the language's own built-ins are declared: constants that are
//! converted to entries of the table.

use super::builtin::{
    Args, Argument, Builtin, Derivative, Domain, HostItem, Kind, PreviousEvaluation, Scalar, State,
    Text, Type, Vjp,
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
    /// The values of that type that it takes.
    pub domain: Domain,
    /// The unit of its numbers, for the reference.
    pub unit: &'static str,
    /// Its default, if it may be left out.
    pub default: Option<Default>,
    /// A sentence for the reference.
    pub doc: &'static str,
}

/// The default of an argument.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Default {
    Num(f64),
    Bool(bool),
    Str(&'static str),
    Nums(&'static [f64]),
    /// Supplied by the run or the function; the reference describes it by this text.
    Described(&'static str),
}

impl Default {
    /// Its text in the reference, with at most four significant digits, and its value.
    fn entry(self) -> (Text, Value) {
        let shown = |value: Value| (Text::Owned(value.to_string()), value);
        match self {
            Default::Num(x) => {
                let rounded = format!("{x:.3e}").parse().map_or(x, |x: f64| x);
                (Value::Num(rounded).to_string().into(), Value::Num(x))
            }
            Default::Bool(b) => shown(Value::Bool(b)),
            Default::Str(s) => shown(Value::str(s)),
            Default::Nums(xs) => shown(Value::array(xs)),
            Default::Described(text) => (text.into(), Value::Unit),
        }
    }
}

/// A required argument.
pub const fn arg(name: &'static str, ty: Type, doc: &'static str) -> Arg {
    Arg { name, ty, domain: Domain::Any, unit: "", default: None, doc }
}

/// An optional argument whose default the run or the function supplies.
pub const fn opt(name: &'static str, ty: Type, default: &'static str, doc: &'static str) -> Arg {
    arg(name, ty, doc).or(Default::Described(default))
}

/// An optional number.
pub const fn num(name: &'static str, default: f64, doc: &'static str) -> Arg {
    arg(name, Type::Num, doc).or(Default::Num(default))
}

/// An optional whole number within bounds.
pub const fn int(name: &'static str, default: u32, bounds: [u32; 2], doc: &'static str) -> Arg {
    arg(name, Type::Int, doc).or(Default::Num(default as f64)).within(Domain::Whole(bounds))
}

/// An optional truth value, false by default.
pub const fn flag(name: &'static str, doc: &'static str) -> Arg {
    arg(name, Type::Bool, doc).or(Default::Bool(false))
}

/// An optional word, by default the first of them.
pub const fn word(name: &'static str, words: &'static [&'static str], doc: &'static str) -> Arg {
    arg(name, Type::Str, doc).or(Default::Str(words[0])).within(Domain::Words(words))
}

impl Arg {
    /// Adds a default.
    pub const fn or(self, default: Default) -> Arg {
        Arg { default: Some(default), ..self }
    }

    /// Adds a unit.
    pub const fn unit(self, unit: &'static str) -> Arg {
        Arg { unit, ..self }
    }

    /// Restricts its values.
    pub const fn within(self, domain: Domain) -> Arg {
        Arg { domain, ..self }
    }

    /// Takes positive, finite numbers only.
    pub const fn positive(self) -> Arg {
        self.within(Domain::Positive)
    }
}

impl From<&Arg> for Argument {
    fn from(a: &Arg) -> Argument {
        let (default, value) = a.default.map(Default::entry).unzip();
        Argument {
            name: a.name.into(),
            ty: a.ty,
            domain: a.domain,
            unit: a.unit.into(),
            default,
            value: value.unwrap_or_default(),
            doc: a.doc.into(),
        }
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
    /// The last argument may be repeated.
    pub variadic: bool,
    /// The type of its result.
    pub returns: Type,
    /// Its text in the reference.
    pub doc: &'static str,
    /// Its kind, with its evaluation.
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
        Builtin {
            name: r.name.into(),
            module: r.module.into(),
            section: r.section.into(),
            args: r.args.iter().map(Argument::from).collect(),
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
