//! Contents of the file of `export e to "file";`: a mesh for a solid or a view, otherwise
//! the value as text.

use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::lower::Export;
use pcadlang_engine::lang::value::Value;
use pcadlang_library::scene::{SolidValue, ViewValue};
use pcadlang_scene::geom::{glb, obj};
use pcadlang_syntax::ast::ExprKind;

/// Returns the operand of an export; that of `best(e)` is `e`, evaluated in the current
/// state.
pub fn exported_operand(code: &Code, x: &Export) -> Option<Operand> {
    let inner = match &x.expr.kind {
        ExprKind::Call { args, .. } if args.len() == 1 => &args[0].value,
        _ => &x.expr,
    };
    code.queries.get(&inner.span).or_else(|| code.queries.get(&x.expr.span)).copied()
}

/// Returns the contents of a file with a value; the file's name determines the format.
///
/// # Errors
/// If a solid has no mesh, since it is too far away or too small for single precision.
pub fn exported(value: &Value, file: &str) -> Result<Vec<u8>, String> {
    let solid = value.downcast::<ViewValue>().map(|v| v.0.solid().clone());
    let Some(solid) = solid.or_else(|| value.downcast::<SolidValue>().map(|s| s.0.clone())) else {
        return Ok(value.to_string().into_bytes());
    };
    let mesh = solid.to_mesh().map_err(|e| e.to_string())?;
    Ok(if file.ends_with(".glb") { glb::write(&mesh) } else { obj::write(&mesh).into_bytes() })
}
