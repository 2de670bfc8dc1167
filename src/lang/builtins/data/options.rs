//! What a `data` item says of its file beside the path: `mesh("x.glb", up = "z", unit = 0.01)`.
//!
//! Written as constants, since what a run reads must be known before it starts.

use crate::geom::{FileFrame, UpAxis};
use crate::lang::error::Fault;
use crate::syntax::ast::{Arg, ExprKind};

/// How a file is to be read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    frame: FileFrame,
}

impl Options {
    /// A mesh file's axes and unit.
    pub fn frame(&self) -> FileFrame {
        self.frame
    }

    /// From the arguments of a call after the path; for [kinds](super::kinds) of data that have options.
    ///
    /// # Errors
    /// An argument of another name or type, or given twice, or outside its domain: with its place among the arguments.
    pub fn parse(kind: &str, args: &[Arg]) -> Result<Options, (usize, Fault)> {
        let (mut up, mut unit) = (None, None);
        for (i, a) in args.iter().enumerate() {
            let fault = |message: String| (i, Fault::type_error(message).with_hint(hint(kind)));
            let name = match &a.name {
                Some(name) if has_options(kind) => &*name.node,
                Some(name) => return Err(fault(format!("{kind} has no option `{}`", name.node))),
                None if has_options(kind) => {
                    return Err(fault(format!("{kind} takes one path; options are given by name")));
                }
                None => return Err(fault(format!("{kind} takes one path"))),
            };
            let again = match (name, &a.value.kind) {
                ("up", ExprKind::Str(axis)) => {
                    let axis = match &**axis {
                        "x" => UpAxis::X,
                        "y" => UpAxis::Y,
                        "z" => UpAxis::Z,
                        other => return Err(fault(format!("`up` must be \"x\", \"y\" or \"z\", not \"{other}\""))),
                    };
                    up.replace(axis).is_some()
                }
                ("unit", ExprKind::Num(x)) => unit.replace(*x).is_some(),
                ("up", _) => return Err(fault("`up` must be an axis in quotes".into())),
                ("unit", _) => return Err(fault("`unit` must be a number that is written out".into())),
                _ => return Err(fault(format!("{kind} has no option `{name}`"))),
            };
            if again {
                return Err(fault(format!("`{name}` is given twice")));
            }
        }
        // Only the unit can be refused.
        let at = args.iter().position(|a| a.name.as_ref().is_some_and(|n| &*n.node == "unit")).unwrap_or(0);
        let frame = FileFrame::new(up.unwrap_or_default(), unit.unwrap_or(1.0));
        frame.map(|frame| Options { frame }).map_err(|e| (at, Fault::type_error(e.to_string()).with_hint(hint(kind))))
    }
}

/// Whether data of a kind have options.
pub fn has_options(kind: &str) -> bool {
    matches!(kind, "mesh" | "armature")
}

fn hint(kind: &str) -> String {
    match has_options(kind) {
        true => format!("for example {kind}(\"file.glb\", up = \"z\", unit = 0.01)"),
        false => format!("write {kind}(\"file\")"),
    }
}
