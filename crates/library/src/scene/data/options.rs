//! The options of the scene's files: axes and unit of meshes.

use pcadlang_engine::lang::builtins::data::{Literal, Options};
use pcadlang_scene::geom::{FileFrame, UpAxis};

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
