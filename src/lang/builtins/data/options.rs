//! Options of a `data` item besides the path: `mesh("x.glb", up = "z", unit = 0.01)`.
//!
//! They must be literals, because the inputs of a run must be known before it starts.

use crate::geom::{FileFrame, UpAxis};
use crate::lang::error::Fault;
use crate::syntax::ast::{Arg, Expr, ExprKind, UnaryOp};
use crate::vision::NetworkOptions;
use crate::vision::file_detector::Output;
use crate::vision::soft_map::Shows;

/// Options for reading a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    frame: FileFrame,
    network: NetworkOptions,
}

impl Options {
    /// The axes and unit of a mesh file.
    pub fn frame(&self) -> FileFrame {
        self.frame
    }

    /// The input and output format of a network.
    pub fn network(&self) -> &NetworkOptions {
        &self.network
    }

    /// Parses the arguments of a call after the path, for [kinds](super::kinds) of data
    /// that have options.
    ///
    /// # Errors
    /// An argument with an unknown name, a wrong type or a value outside its domain, or
    /// given twice: with its index among the arguments.
    pub fn parse(kind: &str, args: &[Arg]) -> Result<Options, (usize, Fault)> {
        let mut seen: Vec<&str> = Vec::new();
        let mut frame = (UpAxis::default(), 1.0);
        let mut network = NetworkOptions::default();
        for (i, a) in args.iter().enumerate() {
            let fault = |message: String| (i, Fault::type_error(message).with_hint(hint(kind)));
            let name = match &a.name {
                Some(name) if has_options(kind) => &*name.node,
                Some(name) => return Err(fault(format!("{kind} has no option `{}`", name.node))),
                None if has_options(kind) => {
                    return Err(fault(format!("{kind} takes one path; give options by name")));
                }
                None => return Err(fault(format!("{kind} takes one path"))),
            };
            let set = match kind {
                "detector" => set_network(&mut network, name, &a.value),
                _ => set_frame(&mut frame, name, &a.value),
            };
            if !set.map_err(fault)? {
                return Err(fault(format!("{kind} has no option `{name}`")));
            }
            if seen.contains(&name) {
                return Err(fault(format!("`{name}` is given twice")));
            }
            seen.push(name);
        }
        // Only the unit can be invalid here.
        let at = args
            .iter()
            .position(|a| a.name.as_ref().is_some_and(|n| &*n.node == "unit"))
            .unwrap_or(0);
        let frame = FileFrame::new(frame.0, frame.1);
        frame
            .map(|frame| Options { frame, network })
            .map_err(|e| (at, Fault::type_error(e.to_string()).with_hint(hint(kind))))
    }
}

/// Sets an option of a mesh; returns false if there is no such option.
fn set_frame(frame: &mut (UpAxis, f64), name: &str, value: &Expr) -> Result<bool, String> {
    match (name, &value.kind) {
        ("up", ExprKind::Str(axis)) => {
            frame.0 = match &**axis {
                "x" => UpAxis::X,
                "y" => UpAxis::Y,
                "z" => UpAxis::Z,
                other => {
                    return Err(format!("`up` must be \"x\", \"y\" or \"z\", not \"{other}\""));
                }
            };
        }
        ("unit", ExprKind::Num(x)) => frame.1 = *x,
        ("up", _) => return Err("`up` must be an axis in quotes".into()),
        ("unit", _) => return Err("`unit` must be a literal number".into()),
        _ => return Ok(false),
    }
    Ok(true)
}

/// Sets an option of a network; returns false if there is no such option.
fn set_network(network: &mut NetworkOptions, name: &str, value: &Expr) -> Result<bool, String> {
    let word = |ways: [&str; 2]| match &value.kind {
        ExprKind::Str(s) if **s == *ways[0] => Ok(false),
        ExprKind::Str(s) if **s == *ways[1] => Ok(true),
        _ => Err(format!("`{name}` must be \"{}\" or \"{}\"", ways[0], ways[1])),
    };
    let each = || match &value.kind {
        ExprKind::Array(all) => match &all.iter().filter_map(number).collect::<Vec<_>>()[..] {
            &[a, b, c] if all.len() == 3 => Some([a, b, c]),
            _ => None,
        },
        _ => number(value).map(|x| [x; 3]),
    };
    let each =
        || each().ok_or_else(|| format!("`{name}` must be a literal number or a list of three"));
    match name {
        "colours" => network.bgr = word(["rgb", "bgr"])?,
        "shows" => {
            network.shows =
                if word(["contours", "objects"])? { Shows::Objects } else { Shows::Contours }
        }
        "white" => network.white = number(value).ok_or("`white` must be a literal number")?,
        "mean" => network.mean = each()?,
        "spread" => network.spread = each()?,
        "logits" => match value.kind {
            ExprKind::Bool(b) => network.logits = b,
            _ => return Err("`logits` must be true or false".into()),
        },
        "output" => match &value.kind {
            ExprKind::Str(name) => network.output = Output::Named(name.to_string()),
            ExprKind::Num(n) if *n >= 1.0 && *n <= 1e6 && n.fract() == 0.0 => {
                network.output = Output::Number(*n as usize)
            }
            _ => return Err("`output` must be a name in quotes or a number from 1".into()),
        },
        _ => return Ok(false),
    }
    Ok(true)
}

/// A literal number, possibly negated.
fn number(e: &Expr) -> Option<f32> {
    match &e.kind {
        ExprKind::Num(x) => Some(*x as f32),
        ExprKind::Unary { op: UnaryOp::Neg, expr } => number(expr).map(|x| -x),
        _ => None,
    }
}

/// Whether this kind of data has options.
pub fn has_options(kind: &str) -> bool {
    matches!(kind, "mesh" | "armature" | "detector")
}

fn hint(kind: &str) -> String {
    match kind {
        "detector" => {
            "for example detector(\"network.onnx\", colours = \"bgr\", white = 255, logits = true)"
                .into()
        }
        _ if has_options(kind) => {
            format!("for example {kind}(\"file.glb\", up = \"z\", unit = 0.01)")
        }
        _ => format!("write {kind}(\"file\")"),
    }
}
