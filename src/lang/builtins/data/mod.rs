//! Data: what a `data` item can hold, and the formats that read it from a file's bytes.
//!
//! The names are built-ins so that they are documented and checked like any other. A
//! program cannot call them on values it computes, because what a run reads must be known
//! before it starts. Which files may be read, and where they lie, is not decided here:
//! formats get bytes.

mod csv;
mod json;
mod options;

pub use options::{Literal, Options};

use super::{Arg, Args, Builtin, Row, Table, Type, arg, function};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use std::fmt;
use std::sync::Arc;

pub(crate) const SECTION: &str = "Data files";

/// Reads a file by its path relative to that of another, or says why it cannot.
pub type Beside<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

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
        beside: &Beside,
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

/// The argument of kinds that take nothing but a path.
pub(crate) const FILE: &[Arg] =
    &[arg("file", Type::Str, "The path, relative to the program's folder.")];

/// The row of a kind of data.
pub(crate) const fn kind(
    name: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
    format: fn() -> Arc<dyn DataFormat>,
) -> Row {
    Row { format: Some(format), ..function(name, SECTION, args, returns, doc, not_an_expression) }
}

pub(super) const TABLE: &[Row] = &[
    kind(
        "csv",
        FILE,
        Type::Record,
        "A table with a header line: a record of columns, numbers, bools or strings.",
        || Arc::new(Text(csv::parse)),
    ),
    kind("json", FILE, Type::Any, "JSON: objects are records, null is nothing.", || {
        Arc::new(Text(json::parse))
    }),
];

/// A format without options.
#[derive(Debug)]
struct Text(fn(&[u8]) -> Result<Value, String>);

impl DataFormat for Text {
    fn load(&self, file: &str, bytes: &[u8], _: &Options, _: &Beside) -> Result<Value, Fault> {
        (self.0)(bytes).map_err(|why| unreadable(file, &why))
    }
}

/// The error of a file that cannot be read as its kind.
pub(crate) fn unreadable(file: &str, why: &str) -> Fault {
    Fault::new(FaultKind::Other, format!("{file}: {why}"))
}

pub(crate) fn not_an_expression(a: &Args) -> Result<Value, Fault> {
    let name = &a.builtin.name;
    let message = format!("{name}: only `data` items can read files");
    Err(Fault::new(FaultKind::Other, message)
        .with_hint(format!("write `data d = {name}(\"file\");` at the top level")))
}

impl Table {
    /// The kinds of data: what may stand after the colon of `data d: kind;`.
    pub fn kinds(&self) -> impl Iterator<Item = &str> + Clone {
        self.iter().filter(|b| b.format.is_some()).map(|b| &*b.name)
    }

    /// The built-in that is a kind of data.
    pub(crate) fn kind(&self, name: &str) -> Option<&Builtin> {
        self.find("", name).map(|i| self.get(i)).filter(|b| b.format.is_some())
    }

    /// The file to read for data of a kind.
    pub fn path_of<'a>(&self, kind: &str, path: &'a str) -> &'a str {
        match self.kind(kind).and_then(|b| b.format.as_ref()) {
            Some(format) => format.path_of(path),
            None => path,
        }
    }

    /// Reads data of a kind from the bytes of a file: see [`DataFormat::load`].
    ///
    /// # Errors
    /// An unknown kind, or bytes that are not of that kind.
    pub fn load(
        &self,
        kind: &str,
        file: &str,
        bytes: &[u8],
        options: &Options,
        beside: &Beside,
    ) -> Result<Value, Fault> {
        match self.kind(kind).and_then(|b| b.format.as_ref()) {
            Some(format) => format.load(file, bytes, options, beside),
            None => {
                let fault = Fault::type_error(format!("there is no data of type `{kind}`"));
                Err(fault.with_nearest(kind, "there are", self.kinds()))
            }
        }
    }
}
