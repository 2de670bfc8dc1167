//! The table of built-ins: every function, distribution, form and kernel with its arguments, units and doc line.
//!
//! Evaluation, static checks, `pcadlang doc` and the language reference all read this one table.

mod args;

pub use args::Args;

use super::error::Fault;
use super::value::Value;
use crate::dist::Dist;
use std::fmt;

/// The type of an argument or result, as far as it can be told before a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// Anything.
    Any,
    /// A number.
    Num,
    /// A whole number.
    Int,
    /// A truth value.
    Bool,
    /// A string.
    Str,
    /// A number, or an array of them taken element by element.
    Nums,
    /// An array.
    Array,
    /// A record.
    Record,
    /// A function.
    Function,
    /// A distribution.
    Dist,
    /// A likelihood.
    Likelihood,
    /// A covariance function.
    Covariance,
    /// A scene or host object, by its type name.
    Object(&'static str),
    /// A selection of addresses.
    Selection,
    /// A step of inference.
    Kernel,
}

impl fmt::Display for Type {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Type::Any => "any",
            Type::Num => "number",
            Type::Int => "whole number",
            Type::Bool => "bool",
            Type::Str => "string",
            Type::Nums => "number or array",
            Type::Array => "array",
            Type::Record => "record",
            Type::Function => "function",
            Type::Dist => "distribution",
            Type::Likelihood => "likelihood",
            Type::Covariance => "covariance",
            Type::Object(name) => name,
            Type::Selection => "selection",
            Type::Kernel => "kernel",
        })
    }
}

/// One argument.
#[derive(Clone, Copy, Debug)]
pub struct Arg {
    /// Its name, usable as a keyword.
    pub name: &'static str,
    /// Its type.
    pub ty: Type,
    /// Its unit, or nothing.
    pub unit: &'static str,
    /// How its default is written; `None` if it must be given.
    pub default: Option<&'static str>,
    /// One line about it.
    pub doc: &'static str,
}

/// An argument that must be given.
pub const fn arg(name: &'static str, ty: Type, doc: &'static str) -> Arg {
    Arg { name, ty, unit: "", default: None, doc }
}

/// An argument with a default.
pub const fn opt(name: &'static str, ty: Type, default: &'static str, doc: &'static str) -> Arg {
    Arg { name, ty, unit: "", default: Some(default), doc }
}

impl Arg {
    /// The same with a unit.
    pub const fn unit(self, unit: &'static str) -> Arg {
        Arg { unit, ..self }
    }
}

/// Forms: built-ins that are lowered to operations of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Form {
    Map,
    Fold,
    Mem,
    LogJoint,
    LogPrior,
    LogLikelihood,
}

/// What a built-in is.
#[derive(Clone, Copy)]
pub enum Kind {
    /// A pure function of its arguments.
    Function(fn(&Args) -> Result<Value, Fault>),
    /// A family of distributions.
    Distribution(fn(&Args) -> Result<Dist, Fault>),
    /// A form.
    Form(Form),
    /// Known to inference blocks only: kernels, starts, monitors.
    Inference,
}

/// One built-in.
#[derive(Clone, Copy)]
pub struct Builtin {
    /// Its name.
    pub name: &'static str,
    /// The namespace it belongs to: nothing for the language itself, `scene` for `std/scene.pcad`.
    pub module: &'static str,
    /// The heading it stands under in the reference.
    pub section: &'static str,
    /// Its arguments in order.
    pub args: &'static [Arg],
    /// Whether the last argument may be given any number of times.
    pub variadic: bool,
    /// What it gives.
    pub returns: Type,
    /// One line about it.
    pub doc: &'static str,
    /// What it is.
    pub kind: Kind,
}

impl fmt::Debug for Builtin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.signature())
    }
}

impl Builtin {
    /// `name(a, b = default)`, as the reference shows it.
    pub fn signature(&self) -> String {
        let mut s = if self.module.is_empty() { self.name.to_owned() } else { format!("{}.{}", self.module, self.name) };
        s.push('(');
        for (i, a) in self.args.iter().enumerate() {
            if i > 0 {
                s.push_str(", ");
            }
            s.push_str(a.name);
            if let Some(d) = a.default {
                s.push_str(" = ");
                s.push_str(d);
            }
        }
        if self.variadic {
            s.push_str(", …");
        }
        s.push(')');
        s
    }
}

/// The built-ins a program sees, by index and by name.
#[derive(Clone, Debug)]
pub struct Table {
    entries: IndexMap<(&'static str, &'static str), Builtin>,
}

impl Default for Table {
    fn default() -> Self {
        Table::new([])
    }
}

impl Table {
    /// The built-ins of the language and these.
    pub fn new(more: impl IntoIterator<Item = Builtin>) -> Self {
        let core = [operators::TABLE, math::TABLE, list::TABLE, distributions::TABLE, forms::TABLE];
        let all = core.into_iter().flatten().copied().chain(more);
        Table { entries: all.map(|b| ((b.module, b.name), b)).collect() }
    }

    /// The built-in at an index.
    pub fn get(&self, i: u32) -> &Builtin {
        &self.entries[i as usize]
    }

    /// The index of a built-in.
    pub fn find(&self, module: &str, name: &str) -> Option<u32> {
        self.entries.get_index_of(&(module, name) as &dyn NameKey).map(|i| i as u32)
    }

    /// All of them, in the order of the reference.
    pub fn iter(&self) -> impl Iterator<Item = &Builtin> {
        self.entries.values()
    }
}
