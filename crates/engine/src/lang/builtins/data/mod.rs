//! Data: what a `data` item can hold, and the formats that read it from a file's bytes.
//!
//! The names are built-ins so that they are documented and checked like any other. A
//! program cannot call them on values it computes, because what a run reads must be known
//! before it starts. Which files may be read, and where they lie, is not decided here:
//! formats get bytes.

mod csv;
mod format;
mod json;
mod kinds;

pub use format::{DataFormat, Literal, Options, ReadRelative};
pub use json::Json;

use super::{Arg, Args, Row, Type, arg, function};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use std::sync::Arc;

/// The section of the reference for kinds of data.
pub const SECTION: &str = "Data files";

/// The argument of kinds that take nothing but a path.
pub const FILE: &[Arg] = &[arg("file", Type::Str, "The path, relative to the program's folder.")];

/// The row of a kind of data.
pub const fn kind(
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
        "A table with a header line: a record of columns, numbers, bools or strings. Empty, NA and NaN fields are missing entries: see `is_missing`.",
        || Arc::new(Text(csv::parse)),
    ),
    kind("json", FILE, Type::Any, "JSON: objects are records, null is nothing.", || {
        Arc::new(Text(|bytes, _| json::parse(bytes)))
    }),
];

/// A format without options, which may name the file.
#[derive(Debug)]
struct Text(fn(&[u8], &str) -> Result<Value, String>);

impl DataFormat for Text {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        _: &Options,
        _: &ReadRelative,
    ) -> Result<Value, Fault> {
        (self.0)(bytes, file).map_err(|why| unreadable(file, &why))
    }
}

/// The error of a file that cannot be read as its kind.
pub fn unreadable(file: &str, why: &str) -> Fault {
    Fault::new(FaultKind::Other, format!("{file}: {why}"))
}

/// Evaluates a kind of data: always an error, since only `data` items read files.
///
/// # Errors
/// Always.
pub fn not_an_expression(a: &Args) -> Result<Value, Fault> {
    let name = &a.builtin.name;
    let message = format!("{name}: only `data` items can read files");
    Err(Fault::new(FaultKind::Other, message)
        .with_hint(format!("write `data d = {name}(\"file\");` at the top level")))
}
