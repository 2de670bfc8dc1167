//! The table of built-ins: every function, distribution, form and kernel with its
//! arguments, units and doc line.
//!
//! Evaluation, static checks, `pcadlang doc` and the language reference all read this one
//! table. Functions here are pure: the same arguments give the same value to the last
//! bit, on every platform.

mod args;
mod compounds;
mod covariance;
pub mod data;
mod definite;
mod derivative;
mod distributions;
pub mod doc;
mod elementwise;
pub mod examples;
mod forms;
mod host;
mod inference;
mod interp;
mod known_as;
mod list;
mod log_density;
mod math;
mod matrix;
mod operators;
mod reduce;
mod row;
pub mod search;
mod table;

pub use args::Args;
pub use covariance::CovarianceValue;
pub(crate) use derivative::times;
pub use derivative::{ArgAdjoints, Binary, Derivative, Reduction, Vjp};
pub use host::{Before, HostItem, State};
pub(crate) use reduce::dot;
pub(crate) use row::{Arg, Row, arg, function, opt};
pub use table::{Constant, Defaults, InputHook, Table};

use super::error::Fault;
use super::value::{MOST_ELEMENTS, MOST_NESTED, Value};
use crate::dist::Dist;
use smallvec::SmallVec;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// A name or text: the language's own, or one that a host made.
pub type Text = Cow<'static, str>;

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
#[derive(Clone, Debug)]
pub struct Argument {
    /// Its name, usable as a keyword.
    pub name: Text,
    /// Its type.
    pub ty: Type,
    /// Its unit, or nothing.
    pub unit: Text,
    /// How its default is written; `None` if it must be given.
    pub default: Option<Text>,
    /// What a call that leaves it out gets; nothing where the function itself knows.
    pub value: Value,
    /// One line about it.
    pub doc: Text,
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

/// What a built-in is on single numbers, where that is all there is to it: what formulas
/// of scores run, and what functions of arrays do with each element.
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
#[derive(Clone)]
pub struct Builtin {
    /// Its name.
    pub name: Text,
    /// The namespace it belongs to: nothing for the language itself, `scene` for
    /// `std/scene.pcad`.
    pub module: Text,
    /// The heading it stands under in the reference.
    pub section: Text,
    /// Its arguments in order.
    pub args: Arc<[Argument]>,
    /// Whether the last argument may be given any number of times.
    pub variadic: bool,
    /// What it gives.
    pub returns: Type,
    /// One line about it.
    pub doc: Text,
    /// What it is.
    pub kind: Kind,
    /// What it is on single numbers.
    pub scalar: Option<Scalar>,
    /// Its derivative.
    pub derivative: Derivative,
    /// What stands behind it, where that is a host's and not the language's own.
    pub host: Option<HostItem>,
    /// How files are read, for a kind of data.
    pub format: Option<Arc<dyn data::DataFormat>>,
    /// An example of its use: an expression with its value behind `//`, or a program.
    pub example: Option<Text>,
}

impl fmt::Debug for Builtin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.signature())
    }
}

impl Builtin {
    /// Calls it with values, one for each argument.
    ///
    /// # Errors
    /// What is wrong with them.
    pub(crate) fn apply(&self, values: &[&Value]) -> Result<Value, Fault> {
        let args = Args { builtin: self, values };
        match self.kind {
            Kind::Function(f) => f(&args),
            Kind::Distribution(_) => {
                self.distribution(values).map(|d| Value::Dist(std::sync::Arc::new(d)))
            }
            Kind::Form(_) | Kind::Inference => Err(Fault::type_error(format!(
                "`{}` cannot be used as a function value",
                self.name
            ))),
        }
    }

    /// The distribution it makes of values.
    ///
    /// # Errors
    /// What is wrong with them, and if there is too much in it to be handled.
    pub(crate) fn distribution(&self, values: &[&Value]) -> Result<Dist, Fault> {
        let args = Args { builtin: self, values };
        let Kind::Distribution(make) = self.kind else {
            return Err(Fault::type_error(format!("`{}` is not a distribution", self.name)));
        };
        let d = make(&args)?;
        match d.parts(MOST_NESTED, MOST_ELEMENTS) {
            Some(n) if n <= MOST_ELEMENTS => Ok(d),
            Some(_) => Err(args.too_large("parts", MOST_ELEMENTS)),
            None => Err(args.too_large("nested distributions", MOST_NESTED as usize)),
        }
    }

    /// Whether this version only checks and documents it, and cannot run it yet.
    pub fn is_planned(&self) -> bool {
        matches!(self.kind, Kind::Inference)
            && self.host.is_none()
            && inference::PLANNED.contains(&&*self.name)
    }

    /// Its name as a program writes it: `normal`, `scene.lathe`.
    pub fn full_name(&self) -> String {
        if self.module.is_empty() {
            self.name.clone().into_owned()
        } else {
            format!("{}.{}", self.module, self.name)
        }
    }

    /// `name(a, b = default)`, as the reference shows it.
    pub fn signature(&self) -> String {
        let mut s = self.full_name();
        s.push('(');
        for (i, a) in self.args.iter().enumerate() {
            if i > 0 {
                s.push_str(", ");
            }
            s.push_str(&a.name);
            if let Some(d) = &a.default {
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

    /// For each parameter, the index of the written argument that feeds it; `None` for a
    /// default. With a variadic last parameter the result is as long as what was written.
    /// `args` tells the keyword of each argument, if it has one.
    ///
    /// # Errors
    /// Too many arguments, too few, one given twice, an unknown keyword: a message for
    /// the user.
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
                Some(k) => self
                    .args
                    .iter()
                    .position(|a| a.name == k)
                    .ok_or_else(|| self.no_such_argument(k))?,
            };
            // Too many are counted first, so that the message can say how many.
            if p < order.len() && order[p].replace(i).is_some() {
                return Err(format!(
                    "`{}` got its argument `{}` twice",
                    self.full_name(),
                    self.args[p].name
                ));
            }
        }
        if written > order.len() {
            let takes = match self.args.len() {
                0 => "no arguments".to_owned(),
                1 => "1 argument".to_owned(),
                n => format!("{n} arguments"),
            };
            return Err(format!(
                "`{}` takes {takes}, got {written}: {}",
                self.full_name(),
                self.signature()
            ));
        }
        match self.args.iter().zip(&order).find(|(a, o)| a.default.is_none() && o.is_none()) {
            Some((missing, _)) => Err(format!(
                "`{}` needs its argument `{}`: {}",
                self.full_name(),
                missing.name,
                self.signature()
            )),
            None => Ok(order),
        }
    }

    fn no_such_argument(&self, keyword: &str) -> String {
        let hint = match crate::diag::nearest(keyword, self.args.iter().map(|a| &*a.name)) {
            Some(near) => format!("; did you mean `{near}`?"),
            None if self.args.is_empty() => "; it takes none".to_owned(),
            None => format!(
                "; it takes {}",
                self.args.iter().map(|a| &*a.name).collect::<Vec<_>>().join(", ")
            ),
        };
        format!("`{}` has no argument `{keyword}`{hint}", self.full_name())
    }
}

#[cfg(test)]
pub(crate) mod tests;
