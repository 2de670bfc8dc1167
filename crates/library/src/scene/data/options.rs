//! The options of the scene's files: axes and unit of meshes, inputs and outputs of
//! networks.

use pcadlang_engine::lang::builtins::data::{Literal, Options};
use pcadlang_scene::geom::{FileFrame, UpAxis};
use pcadlang_scene::vision::NetworkOptions;
use pcadlang_scene::vision::file_detector::Output;
use pcadlang_scene::vision::soft_map::Shows;

/// The axes and the unit of a mesh file.
///
/// # Errors
/// A value that does not fit: a message for the user.
pub(super) fn frame(options: &Options) -> Result<FileFrame, String> {
    let (mut up, mut unit) = (UpAxis::default(), 1.0);
    for (name, value) in options.iter() {
        match (name, value) {
            ("up", Literal::Str(axis)) => {
                up = match &**axis {
                    "x" => UpAxis::X,
                    "y" => UpAxis::Y,
                    "z" => UpAxis::Z,
                    other => {
                        return Err(format!("`up` must be \"x\", \"y\" or \"z\", not \"{other}\""));
                    }
                };
            }
            ("up", _) => return Err("`up` must be an axis in quotes".into()),
            ("unit", Literal::Num(x)) => unit = *x,
            ("unit", _) => return Err("`unit` must be a literal number".into()),
            _ => {}
        }
    }
    FileFrame::new(up, unit).map_err(|e| e.to_string())
}

/// How a network takes its picture and gives its map.
///
/// # Errors
/// A value that does not fit: a message for the user.
pub(super) fn network(options: &Options) -> Result<NetworkOptions, String> {
    let mut network = NetworkOptions::default();
    for (name, value) in options.iter() {
        let word = |ways: [&str; 2]| match value {
            Literal::Str(s) if **s == *ways[0] => Ok(false),
            Literal::Str(s) if **s == *ways[1] => Ok(true),
            _ => Err(format!("`{name}` must be \"{}\" or \"{}\"", ways[0], ways[1])),
        };
        let channels = || match value {
            Literal::Num(x) => Ok([*x as f32; 3]),
            Literal::Nums(xs) if xs.len() == 3 => Ok([xs[0], xs[1], xs[2]].map(|x| x as f32)),
            _ => Err(format!("`{name}` must be a literal number or a list of three")),
        };
        match (name, value) {
            ("colours", _) => network.bgr = word(["rgb", "bgr"])?,
            ("shows", _) => {
                network.shows = match word(["contours", "objects"])? {
                    true => Shows::Objects,
                    false => Shows::Contours,
                }
            }
            ("white", Literal::Num(x)) => network.white = *x as f32,
            ("white", _) => return Err("`white` must be a literal number".into()),
            ("mean", _) => network.mean = channels()?,
            ("spread", _) => network.spread = channels()?,
            ("logits", Literal::Bool(b)) => network.logits = *b,
            ("logits", _) => return Err("`logits` must be true or false".into()),
            ("output", Literal::Str(name)) => network.output = Output::Named(name.to_string()),
            ("output", Literal::Num(n)) if *n >= 1.0 && *n <= 1e6 && n.fract() == 0.0 => {
                network.output = Output::Number(*n as usize)
            }
            ("output", _) => {
                return Err("`output` must be a name in quotes or a number from 1".into());
            }
            _ => {}
        }
    }
    Ok(network)
}
