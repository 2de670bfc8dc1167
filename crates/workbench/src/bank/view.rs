//! The picture of a scene: finding the view in a program.

use pcadlang_engine::lang::code::Operand;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_library::scene::{SolidValue, ViewValue};
use pcadlang_scene::render::{Camera, View};
use std::sync::Arc;

/// Returns the operand of a program's picture: the last top-level name that is a view,
/// otherwise the last that is a solid.
pub fn picture(trace: &mut Trace, draws: Draws) -> Option<Operand> {
    let globals: Vec<Operand> = trace.code().globals.values().rev().copied().collect();
    let mut solid = None;
    for o in globals {
        let Ok(values) = trace.query(&[o], draws) else { continue };
        let Some(v) = values.first() else { continue };
        if v.downcast::<ViewValue>().is_some() {
            return Some(o);
        }
        if solid.is_none() && v.downcast::<SolidValue>().is_some() {
            solid = Some(o);
        }
    }
    solid
}

/// Converts a value to a view: a view itself, or a solid seen from `camera` (by default,
/// the default camera at 256 x 256).
pub fn as_view(value: &Value, camera: Option<Camera>) -> Option<Arc<View>> {
    if let Some(v) = value.downcast::<ViewValue>() {
        return Some(Arc::clone(&v.0));
    }
    let camera = camera.unwrap_or_else(|| Camera::default_for(256, 256));
    value.downcast::<SolidValue>().map(|s| Arc::new(View::new(s.0.clone(), camera)))
}

/// Returns a program's view: the last top-level name that is a view, or else the last
/// solid, seen from a camera.
pub fn view(trace: &mut Trace, draws: Draws, camera: Option<Camera>) -> Option<Arc<View>> {
    let at = picture(trace, draws)?;
    let values = trace.query(&[at], draws).ok()?;
    as_view(values.first()?, camera)
}
