//! The kinds of data that a table has.

use super::format::{Literal, Options, ReadRelative};
use crate::lang::builtins::{Builtin, Table};
use crate::lang::fault::Fault;
use crate::lang::value::Value;
use pcadlang_syntax::ast::Arg;

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

    /// Reads data of a kind from the bytes of a file: see
    /// [`DataFormat::load`](super::DataFormat::load).
    ///
    /// # Errors
    /// An unknown kind, or bytes that are not of that kind.
    pub fn load(
        &self,
        kind: &str,
        file: &str,
        bytes: &[u8],
        options: &Options,
        beside: &ReadRelative,
    ) -> Result<Value, Fault> {
        match self.kind(kind).and_then(|b| b.format.as_ref()) {
            Some(format) => format.load(file, bytes, options, beside),
            None => {
                let fault = Fault::type_error(format!("there is no data of type `{kind}`"));
                Err(fault.with_nearest(kind, "there are", self.kinds()))
            }
        }
    }

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

    /// True if data of a kind have options.
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
