//! How the files of a kind of data are read, and what a `data` item says of its file
//! besides the path: `mesh("x.glb", up = "z", unit = 0.01)`.
//!
//! Options are written as constants, since what a run reads must be known before it
//! starts.

use crate::lang::fault::Fault;
use crate::lang::value::Value;
use pcadlang_syntax::ast::{Expr, ExprKind, UnaryOp};
use std::fmt;
use std::sync::Arc;

/// Reads a file by its path relative to that of another, or says why it cannot.
pub type ReadRelative<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

/// How the files of a kind of data are read; the kind's name, options and documentation are
/// its row in the table of built-ins.
pub trait DataFormat: fmt::Debug + Send + Sync {
    /// Reads a value from the bytes of a file. `file` is its name in messages, and `beside`
    /// reads files by paths relative to it.
    ///
    /// # Errors
    /// If the bytes are not in this format: a message that names the file.
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        beside: &ReadRelative,
    ) -> Result<Value, Fault>;

    /// The value of a `data` item that is given no file, if this kind can do without.
    fn without_file(&self) -> Option<Value> {
        None
    }

    /// The file to read for a path, which may also name an entry in it (`file#entry`).
    fn path_of<'a>(&self, path: &'a str) -> &'a str {
        path
    }

    /// Checks the value of an option that the kind's row lists.
    ///
    /// # Errors
    /// A message for the user if the value does not fit.
    fn check_option(&self, _name: &str, _value: &Literal) -> Result<(), String> {
        Ok(())
    }

    /// A call of the kind with its options, for hints.
    fn example(&self) -> Option<&'static str> {
        None
    }
}

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
    pub(crate) fn of(e: &Expr) -> Literal {
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
pub struct Options(pub(super) Vec<(Arc<str>, Literal)>);

impl Options {
    /// One option.
    pub fn single(name: &str, value: Literal) -> Options {
        Options(vec![(name.into(), value)])
    }

    /// The options as written.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Literal)> {
        self.0.iter().map(|(name, value)| (&**name, value))
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The option of this name.
    pub fn get(&self, name: &str) -> Option<&Literal> {
        self.iter().find(|(n, _)| *n == name).map(|(_, value)| value)
    }
}
