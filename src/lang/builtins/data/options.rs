//! What a `data` item says of its file besides the path:
//! `mesh("x.glb", up = "z", unit = 0.01)`.
//!
//! Options are written as constants, since what a run reads must be known before it starts.

use super::super::{Builtin, Table};
use crate::lang::error::Fault;
use crate::syntax::ast::{Arg, Expr, ExprKind, UnaryOp};
use std::sync::Arc;

/// A constant as written.
#[derive(Clone, Debug, PartialEq)]
pub enum Literal {
    /// A number.
    Num(f64),
    /// A string.
    Str(Arc<str>),
    /// A truth value.
    Bool(bool),
    /// An array of numbers.
    Nums(Vec<f64>),
    /// Anything else.
    Other,
}

impl Literal {
    fn of(e: &Expr) -> Literal {
        let number = |e: &Expr| match Literal::of(e) {
            Literal::Num(x) => Some(x),
            _ => None,
        };
        match &e.kind {
            ExprKind::Num(x) => Literal::Num(*x),
            ExprKind::Str(s) => Literal::Str(Arc::from(&**s)),
            ExprKind::Bool(b) => Literal::Bool(*b),
            ExprKind::Unary { op: UnaryOp::Neg, expr } => {
                number(expr).map_or(Literal::Other, |x| Literal::Num(-x))
            }
            ExprKind::Array(all) => {
                all.iter().map(number).collect::<Option<_>>().map_or(Literal::Other, Literal::Nums)
            }
            _ => Literal::Other,
        }
    }
}

/// How a file is to be read: options by name, in the order they are written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options(Vec<(Arc<str>, Literal)>);

impl Options {
    /// One option.
    pub fn single(name: &str, value: Literal) -> Options {
        Options(vec![(name.into(), value)])
    }

    /// The options as written.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Literal)> {
        self.0.iter().map(|(name, value)| (&**name, value))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The option of this name.
    pub fn get(&self, name: &str) -> Option<&Literal> {
        self.iter().find(|(n, _)| *n == name).map(|(_, value)| value)
    }
}

impl Table {
    /// The options of a kind of data, from the arguments of a call after the path.
    ///
    /// # Errors
    /// An argument of another name or type, or given twice, or outside its domain: with
    /// its place among the arguments.
    pub fn options(&self, kind: &str, args: &[Arg]) -> Result<Options, (usize, Fault)> {
        let mut options = Options::default();
        let Some(builtin) = self.kind(kind) else { return Ok(options) };
        for (i, a) in args.iter().enumerate() {
            let fault = |message: String| (i, Fault::type_error(message).with_hint(hint(builtin)));
            let name = match &a.name {
                Some(name) if is_option(builtin, &name.node) => &*name.node,
                Some(name) => return Err(fault(format!("{kind} has no option `{}`", name.node))),
                None if has_options(builtin) => {
                    return Err(fault(format!("{kind} takes one path; give options by name")));
                }
                None => return Err(fault(format!("{kind} takes one path"))),
            };
            let value = Literal::of(&a.value);
            if let Some(format) = &builtin.format {
                format.check_option(name, &value).map_err(fault)?;
            }
            if options.get(name).is_some() {
                return Err(fault(format!("`{name}` is given twice")));
            }
            options.0.push((name.into(), value));
        }
        Ok(options)
    }

    /// Whether data of a kind have options.
    pub fn has_options(&self, kind: &str) -> bool {
        self.kind(kind).is_some_and(has_options)
    }
}

fn has_options(kind: &Builtin) -> bool {
    kind.args.len() > 1
}

fn is_option(kind: &Builtin, name: &str) -> bool {
    kind.args.iter().skip(1).any(|a| a.name == name)
}

fn hint(kind: &Builtin) -> String {
    match kind.format.as_ref().and_then(|format| format.example()) {
        Some(example) => format!("for example {example}"),
        None => format!("write {}(\"file\")", kind.name),
    }
}
