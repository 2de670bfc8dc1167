//! The interface of a program: its parameters and data, found without lowering it.

use crate::lang::builtins::Table;
use crate::lang::builtins::data::Options;
use crate::lang::load::Loaded;
use pcadlang_syntax::ast::{ExprKind, ItemKind};
use pcadlang_syntax::print_expr;

/// A `param`.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamItem {
    /// Its name, prefixed by the namespace of an included file and a slash.
    pub name: String,
    /// The declared type.
    pub ty: Option<String>,
    /// The default as written.
    pub default: Option<String>,
    /// The help text.
    pub help: Option<String>,
}

/// A `data` item.
#[derive(Clone, Debug, PartialEq)]
pub struct DataItem {
    /// Its name.
    pub name: String,
    /// Its kind: as declared, or the kind that its default reads.
    pub ty: Option<String>,
    /// True if it has a default.
    pub has_default: bool,
    /// The reading options of its default; a file that replaces it is read in the same
    /// way.
    pub options: Options,
    /// The help text.
    pub help: Option<String>,
}

/// The parameters and data of a program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Interface {
    /// Its parameters, in order.
    pub params: Vec<ParamItem>,
    /// Its data, in order.
    pub data: Vec<DataItem>,
}

/// Reads a program's interface off its text.
pub fn inspect(loaded: &Loaded, builtins: &Table) -> Interface {
    let mut found = Interface::default();
    if !loaded.units.is_empty() {
        unit(loaded, builtins, 0, "", &mut found);
    }
    found
}

fn unit(loaded: &Loaded, builtins: &Table, index: usize, prefix: &str, found: &mut Interface) {
    let unit_ = &loaded.units[index];
    for (i, item) in unit_.program.items.iter().enumerate() {
        match &item.kind {
            ItemKind::Param(d) => found.params.push(ParamItem {
                name: format!("{prefix}{}", d.name.node),
                ty: d.ty.as_ref().map(|t| t.node.to_string()),
                default: d.default.as_ref().map(print_expr),
                help: d.help.as_ref().map(|h| h.node.to_string()),
            }),
            ItemKind::Data(d) => {
                let read = d.default.as_ref().and_then(|e| match &e.kind {
                    ExprKind::Call { callee, args } => match &callee.kind {
                        ExprKind::Var(kind) => {
                            Some((kind.to_string(), args.get(1..).unwrap_or_default()))
                        }
                        _ => None,
                    },
                    _ => None,
                });
                // Errors in options are reported when the program is lowered.
                let options =
                    read.as_ref().and_then(|(kind, args)| builtins.options(kind, args).ok());
                found.data.push(DataItem {
                    name: format!("{prefix}{}", d.name.node),
                    ty: d.ty.as_ref().map(|t| t.node.to_string()).or(read.map(|(kind, _)| kind)),
                    has_default: d.default.is_some(),
                    options: options.unwrap_or_default(),
                    help: d.help.as_ref().map(|h| h.node.to_string()),
                });
            }
            ItemKind::Include { alias, .. } => {
                if let Some(inner) = unit_.includes.get(i).copied().flatten() {
                    match alias {
                        Some(a) => unit(loaded, builtins, inner, &format!("{}/", a.node), found),
                        None => unit(loaded, builtins, inner, prefix, found),
                    }
                }
            }
            _ => {}
        }
    }
}
