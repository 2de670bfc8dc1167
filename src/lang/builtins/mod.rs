//! The table of built-ins: every function, distribution, form and kernel with its arguments, units and doc line.
//!
//! Evaluation, static checks, `pcadlang doc` and the language reference all read this one table. Functions here are pure:
//! the same arguments give the same value to the last bit, on every platform.

mod args;
mod covariance;
pub mod data;
mod derivative;
mod distributions;
pub mod doc;
mod elementwise;
mod forms;
mod inference;
mod interp;
mod list;
mod math;
mod matrix;
mod operators;
mod reduce;
pub mod scene;
mod table;

pub use args::Args;
pub use covariance::CovarianceValue;
pub(crate) use derivative::times;
pub use derivative::{Binary, Derivative, Pull, Pulled, Reduction};
pub(crate) use reduce::dot;
pub use table::{Constant, Table};

use super::error::Fault;
use super::value::Value;
use crate::dist::Dist;
use smallvec::SmallVec;
use std::fmt;
use std::sync::Arc;

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

/// What a built-in is on single numbers, where that is all there is to it: what formulas of scores run, and what functions
/// of arrays do with each element.
#[derive(Clone, Copy)]
pub enum Scalar {
    /// A number of a number.
    Unary(fn(f64) -> f64),
    /// A number of two.
    Binary(fn(f64, f64) -> f64),
    /// A truth value of two numbers.
    Test(fn(f64, f64) -> bool),
    /// A truth value of a truth value.
    Logic(fn(bool) -> bool),
    /// A distribution by its parameters.
    Family {
        /// The distribution, if there is one.
        make: fn(&[f64]) -> Option<Dist>,
        /// The log density of a number, without keeping it.
        log_density: fn(&[f64], f64) -> Option<f64>,
    },
    /// A distribution over 0, 1, … by an array of weights.
    Weights {
        /// The distribution, if there is one.
        make: fn(&Arc<[f64]>) -> Option<Dist>,
        /// The log probability of a number, without making it.
        log_probability: fn(&[f64], f64) -> Option<f64>,
    },
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
    /// What it is on single numbers.
    pub scalar: Option<Scalar>,
    /// Its derivative.
    pub derivative: Derivative,
}

/// A pure function of the language's own namespace.
const fn function(
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
    f: fn(&Args) -> Result<Value, Fault>,
) -> Builtin {
    Builtin::new(Kind::Function(f), name, section, args, returns, doc)
}

impl fmt::Debug for Builtin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.signature())
    }
}

impl Builtin {
    /// One of the language's own namespace, of which no derivative is known.
    const fn new(
        kind: Kind,
        name: &'static str,
        section: &'static str,
        args: &'static [Arg],
        returns: Type,
        doc: &'static str,
    ) -> Builtin {
        let derivative = Derivative::Unknown;
        Builtin { name, module: "", section, args, variadic: false, returns, doc, kind, scalar: None, derivative }
    }

    /// The same, known to be this on single numbers.
    const fn scalar(self, f: Scalar) -> Builtin {
        Builtin { scalar: Some(f), ..self }
    }

    /// The same with a last argument that may be given any number of times.
    const fn variadic(self) -> Builtin {
        Builtin { variadic: true, ..self }
    }

    /// The same with its vector-Jacobian product.
    const fn pull(self, f: Pull) -> Builtin {
        Builtin { derivative: Derivative::Product(f), ..self }
    }

    /// The same with a derivative.
    const fn derivative(self, derivative: Derivative) -> Builtin {
        Builtin { derivative, ..self }
    }

    /// The same, with a derivative of zero wherever there is one.
    const fn flat(self) -> Builtin {
        Builtin { derivative: Derivative::Zero, ..self }
    }

    /// Calls it with values, one for each argument.
    ///
    /// # Errors
    /// What is wrong with them.
    pub(crate) fn apply(&self, values: &[&Value]) -> Result<Value, Fault> {
        let args = Args { builtin: self, values };
        match self.kind {
            Kind::Function(f) => f(&args),
            Kind::Distribution(f) => f(&args).map(|d| Value::Dist(std::sync::Arc::new(d))),
            Kind::Form(_) | Kind::Inference => {
                Err(Fault::type_error(format!("`{}` cannot be used as a function value", self.name)))
            }
        }
    }

    /// Whether this version only checks and documents it, and cannot run it yet.
    pub fn is_planned(&self) -> bool {
        matches!(self.kind, Kind::Inference) && inference::PLANNED.contains(&self.name)
    }

    /// Its name as a program writes it: `normal`, `scene.lathe`.
    pub fn full_name(&self) -> String {
        if self.module.is_empty() { self.name.to_owned() } else { format!("{}.{}", self.module, self.name) }
    }

    /// `name(a, b = default)`, as the reference shows it.
    pub fn signature(&self) -> String {
        let mut s = self.full_name();
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

    /// For each parameter, the index of the written argument that feeds it; `None` for a default. With a variadic last
    /// parameter the result is as long as what was written. `args` tells the keyword of each argument, if it has one.
    ///
    /// # Errors
    /// Too many arguments, too few, one given twice, an unknown keyword: a message for the user.
    pub fn match_names<'a>(
        &self,
        args: impl Iterator<Item = Option<&'a str>>,
    ) -> Result<SmallVec<[Option<usize>; 8]>, String> {
        let mut order: SmallVec<[Option<usize>; 8]> = smallvec::smallvec![None; self.args.len()];
        let mut written = 0;
        for (i, keyword) in args.enumerate() {
            written += 1;
            let p = match keyword {
                None if i >= self.args.len() && self.variadic => {
                    order.push(Some(i));
                    continue;
                }
                None => i,
                Some(k) => self.args.iter().position(|a| a.name == k).ok_or_else(|| self.no_such_argument(k))?,
            };
            // Too many are counted first, so that the message can say how many.
            if p < order.len() && order[p].replace(i).is_some() {
                return Err(format!("`{}` gets its argument `{}` twice", self.full_name(), self.args[p].name));
            }
        }
        if written > order.len() {
            let takes = match self.args.len() {
                0 => "no arguments".to_owned(),
                1 => "1 argument".to_owned(),
                n => format!("{n} arguments"),
            };
            return Err(format!("`{}` takes {takes}, got {written}: {}", self.full_name(), self.signature()));
        }
        match self.args.iter().zip(&order).find(|(a, o)| a.default.is_none() && o.is_none()) {
            Some((missing, _)) => {
                Err(format!("`{}` needs its argument `{}`: {}", self.full_name(), missing.name, self.signature()))
            }
            None => Ok(order),
        }
    }

    fn no_such_argument(&self, keyword: &str) -> String {
        let hint = match crate::diag::nearest(keyword, self.args.iter().map(|a| a.name)) {
            Some(near) => format!("; did you mean `{near}`?"),
            None if self.args.is_empty() => "; it takes none".to_owned(),
            None => format!("; it takes {}", self.args.iter().map(|a| a.name).collect::<Vec<_>>().join(", ")),
        };
        format!("`{}` has no argument `{keyword}`{hint}", self.full_name())
    }
}

#[cfg(test)]
mod tests;
