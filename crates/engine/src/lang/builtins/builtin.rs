//! A built-in, and what it is made of.

use super::data::DataFormat;
use crate::lang::adjoint::Adjoint;
use crate::lang::fault::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Dist, Drawn, Numbers};
use pcadlang_numerics::num::Column;
use smallvec::SmallVec;
use std::any::Any;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// Arguments that built-ins had, and what takes their place.
const FORMER: &[(&str, &str, &str)] = &[
    ("scene.render", "detail", "every mesh is drawn as it is, so leave it out"),
    ("scene.people", "near", "use `hint = { box: [x, y, width, height] }`"),
];

/// A name or text, of the language or of a host.
pub type Text = Cow<'static, str>;

/// The type of an argument or result, as far as it is known statically.
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
    /// A number, or an array of numbers to process element by element.
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
    /// A kernel, a start, or another part of an inference plan.
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

/// The values of its type that an argument takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// All of them.
    Any,
    /// Positive, finite numbers.
    Positive,
    /// Finite numbers, at least 0.
    NotNegative,
    /// Numbers within bounds.
    From([f64; 2]),
    /// Numbers above 0 and below 1.
    Between01,
    /// Numbers from 0 and below 1.
    Below1,
    /// Whole numbers within bounds.
    Whole([u32; 2]),
    /// Some words.
    Words(&'static [&'static str]),
}

impl Domain {
    /// Returns whether a number is within.
    pub fn holds(self, x: f64) -> bool {
        match self {
            Domain::Any | Domain::Words(_) => true,
            Domain::Positive => x > 0.0 && x.is_finite(),
            Domain::NotNegative => x >= 0.0 && x.is_finite(),
            Domain::From([low, high]) => (low..=high).contains(&x),
            Domain::Between01 => x > 0.0 && x < 1.0,
            Domain::Below1 => (0.0..1.0).contains(&x),
            Domain::Whole([low, high]) => {
                x == libm::trunc(x) && x >= f64::from(low) && x <= f64::from(high)
            }
        }
    }
}

impl fmt::Display for Domain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Domain::Any => f.write_str("any"),
            Domain::Positive => f.write_str("positive and finite"),
            Domain::NotNegative => f.write_str("not negative and finite"),
            Domain::From([low, high]) => write!(f, "from {low} to {high}"),
            Domain::Between01 => f.write_str("strictly between 0 and 1"),
            Domain::Below1 => f.write_str("from 0 to less than 1"),
            Domain::Whole([low, high]) => write!(f, "a whole number from {low} to {high}"),
            Domain::Words(words) => {
                let quoted: Vec<String> = words.iter().map(|w| format!("\"{w}\"")).collect();
                write!(f, "one of {}", quoted.join(", "))
            }
        }
    }
}

/// One argument.
#[derive(Clone, Debug)]
pub struct Argument {
    /// Its name, usable as a keyword.
    pub name: Text,
    /// Its type.
    pub ty: Type,
    /// The values of that type that it takes.
    pub domain: Domain,
    /// Its unit, or empty.
    pub unit: Text,
    /// The default as shown in the reference; `None` for a required argument.
    pub default: Option<Text>,
    /// The default that a call receives; `nothing` if the function supplies it.
    pub value: Value,
    /// A one-line description.
    pub doc: Text,
}

/// Built-ins that are lowered to dedicated operations.
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

/// The meaning of a name of inference blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum PlanForm {
    /// A kernel: what makes it is with its entry ([`HostItem::Kernel`]).
    Kernel(KernelTraits),
    One,
    Each,
    Init,
    Anneal,
    Prior,
    Unconstrained,
    BestOf,
    Value,
    Elapsed,
    Steps,
    /// Belongs in reports.
    Reported,
}

/// The properties of a kernel that static checks use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KernelTraits {
    /// A step is not a reversible move of one state.
    pub irreversible: bool,
    /// For a kernel that applies only reversible ones: a call of it, as an example.
    pub of_reversible: Option<&'static str>,
}

/// The kind of a built-in.
#[derive(Clone, Copy)]
pub enum Kind {
    /// A pure function of its arguments.
    Function(fn(&Args) -> Result<Value, Fault>),
    /// A family of distributions.
    Distribution(fn(&Args) -> Result<Dist, Fault>),
    /// A form.
    Form(Form),
    /// Known only to inference plans: kernels, starts, monitors.
    Plan(PlanForm),
}

/// The action of a built-in on single numbers, if that determines it completely. Compiled
/// score formulas run it, and functions of arrays apply it to each element.
#[derive(Clone, Copy)]
pub enum Scalar {
    /// A function of one number.
    Unary(fn(f64) -> f64),
    /// A function of two numbers.
    Binary(fn(f64, f64) -> f64),
    /// A predicate on two numbers.
    Test(fn(f64, f64) -> bool),
    /// A function of a truth value.
    Logic(fn(bool) -> bool),
    /// A family of distributions with numbers as parameters.
    Family(Numbers),
    /// A distribution over 0, 1, … with an array of weights.
    Weights {
        /// Makes the distribution; `None` if the weights are invalid.
        make: fn(&Arc<[f64]>) -> Option<Dist>,
        /// The log probability of a number, without constructing the distribution.
        log_probability: fn(&[f64], f64) -> Option<f64>,
    },
}

/// The arguments of one call, in the table's order; omitted ones are `nothing`.
pub struct Args<'a> {
    /// The called built-in.
    pub builtin: &'a Builtin,
    /// The values.
    pub values: &'a [&'a Value],
}

/// Which argument: its position, or its name.
pub trait Which: Copy {
    /// Returns its position.
    fn position(self, args: &[Argument]) -> usize;
}

impl Which for usize {
    #[inline]
    fn position(self, _: &[Argument]) -> usize {
        self
    }
}

impl Which for &str {
    fn position(self, args: &[Argument]) -> usize {
        let found = args.iter().position(|a| a.name == self);
        debug_assert!(found.is_some(), "no argument `{self}`");
        found.unwrap_or(usize::MAX)
    }
}

/// The adjoints of a call's arguments, in order; omitted trailing ones are zero.
pub type ArgAdjoints = SmallVec<[Adjoint; 4]>;

/// Maps the arguments, the result and its adjoint to the adjoints of the arguments;
/// `None` where they are unknown.
pub type Vjp = fn(&Args, &Value, &Adjoint) -> Option<ArgAdjoints>;

/// The derivative of a function.
#[derive(Clone, Copy, Debug)]
pub enum Derivative {
    /// Unknown.
    Unknown,
    /// Zero wherever it exists: comparing, counting, rounding, and results without
    /// numbers.
    Zero,
    /// Its vector-Jacobian product.
    Product(Vjp),
    /// dy/dx, as a function of x and y, of a function of one number applied element by
    /// element.
    Unary(fn(f64, f64) -> f64),
    /// The partial derivatives of a function of two numbers, applied element by element.
    Binary(&'static Binary),
    /// The derivatives of a function of an array with a single number as its result.
    Reduction(&'static Reduction),
}

/// A function of two numbers, with loops over numbers in a buffer (see
/// `derivative::of_pairs`).
#[derive(Debug)]
pub struct Binary {
    /// dz/dx and dz/dy, as functions of x, y and z.
    pub slopes: fn(f64, f64, f64) -> [f64; 2],
    /// Computes results in a buffer: the arguments are the buffer, the columns of x and
    /// y, and the index and number of the results.
    pub forward: fn(&mut [f64], Column, Column, usize, usize),
    /// Adds to the adjoints of the arguments: takes the buffer, the adjoints at the same
    /// indices, and the rest as for `forward`.
    pub reverse: fn(&[f64], &mut [f64], Column, Column, usize, usize),
    /// The vector-Jacobian product for results that are objects.
    pub objects: Option<Vjp>,
}

/// A function of an array with a single number as its result.
#[derive(Debug)]
pub struct Reduction {
    /// The function.
    pub value: fn(&[f64]) -> f64,
    /// Writes its partial derivatives, one per element, given the array and the result.
    pub slopes: fn(&[f64], f64, &mut [f64]),
}

/// The state that a function keeps between evaluations.
pub type State = Arc<dyn Any + Send + Sync>;

type Function = dyn Fn(&Args) -> Result<Value, Fault> + Send + Sync;
pub(super) type Incremental =
    dyn Fn(&Args, Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> + Send + Sync;
type Make = dyn Fn(&Args) -> Result<Dist, Fault> + Send + Sync;
type Product = dyn Fn(&Args, &Value, &Adjoint) -> Option<Vec<Adjoint>> + Send + Sync;

/// An evaluation from which a later one may resume. It is stored with its result (in a
/// node of a trace or an operation of a tape) and immutable, so that restoring an earlier
/// state of the trace restores it as well.
pub struct PreviousEvaluation {
    /// The arguments.
    pub args: Vec<Value>,
    /// The result.
    pub value: Value,
    /// The state that the function kept.
    pub state: State,
}

impl fmt::Debug for PreviousEvaluation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Before")
            .field("args", &self.args)
            .field("value", &self.value)
            .finish_non_exhaustive()
    }
}

/// A host's part of a built-in.
#[derive(Clone)]
pub enum HostItem {
    /// A function.
    Function {
        /// The function.
        call: Arc<Function>,
        /// Its vector-Jacobian product.
        vjp: Option<Arc<Product>>,
    },
    /// A function that may resume from an earlier evaluation.
    Incremental {
        /// The function.
        call: Arc<Incremental>,
        /// Its vector-Jacobian product.
        vjp: Option<Arc<Product>>,
    },
    /// A family of distributions.
    Family(Arc<Make>),
    /// A family of likelihoods.
    Likelihood(Arc<Function>),
    /// A maker of kernels; only the crate of kernels knows its type.
    Kernel(State),
}

/// One built-in.
#[derive(Clone)]
pub struct Builtin {
    /// Its name.
    pub name: Text,
    /// Its namespace: empty for the language itself, `scene` for `std/scene.pcad`.
    pub module: Text,
    /// The heading of its section in the reference.
    pub section: Text,
    /// Its arguments in order.
    pub args: Arc<[Argument]>,
    /// The last argument may be repeated.
    pub variadic: bool,
    /// The type of the result.
    pub returns: Type,
    /// A one-line description.
    pub doc: Text,
    /// Its kind and implementation.
    pub kind: Kind,
    /// Its action on single numbers.
    pub scalar: Option<Scalar>,
    /// The type of a draw from a family of distributions.
    pub drawn: Drawn,
    /// Its derivative.
    pub derivative: Derivative,
    /// The closures behind it: of what a host brings, of a kernel, and of an incremental
    /// function.
    pub host: Option<HostItem>,
    /// How files are read, for a kind of data.
    pub format: Option<Arc<dyn DataFormat>>,
    /// An example of its use: an expression with its value behind `//`, or a program.
    pub example: Option<Text>,
}

impl fmt::Debug for Builtin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.signature())
    }
}

impl Builtin {
    /// Returns its name as in a program: `normal`, `scene.lathe`.
    pub fn full_name(&self) -> String {
        if self.module.is_empty() {
            self.name.clone().into_owned()
        } else {
            format!("{}.{}", self.module, self.name)
        }
    }

    /// Returns `name(a, b = default)`, as in the reference.
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

    /// Returns, for each parameter, the index of the written argument that supplies it;
    /// `None` for a default. Further arguments of a variadic last parameter are appended.
    /// `args` has the keyword of each argument, if any.
    ///
    /// # Errors
    /// Too many or too few arguments, a duplicate, or an unknown keyword: a message for
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
            // Excess arguments are only counted here, so that the message below can give
            // their number.
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
        let name = self.full_name();
        if let Some((.., now)) = FORMER.iter().find(|(of, k, _)| (*of, *k) == (&*name, keyword)) {
            return format!("`{name}` has no argument `{keyword}` any more; {now}");
        }
        let hint = match pcadlang_syntax::diag::nearest(keyword, self.args.iter().map(|a| &*a.name))
        {
            Some(near) => format!("; did you mean `{near}`?"),
            None if self.args.is_empty() => "; it takes none".to_owned(),
            None => format!(
                "; it takes {}",
                self.args.iter().map(|a| &*a.name).collect::<Vec<_>>().join(", ")
            ),
        };
        format!("`{name}` has no argument `{keyword}`{hint}")
    }
}
