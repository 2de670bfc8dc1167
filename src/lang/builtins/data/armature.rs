//! Armatures: a rig file and what it names.

use super::Beside;
use crate::geom::GeomError;
use crate::geom::armature::{Armature, morphs_from_json, rig_from_json};
use crate::geom::obj;
use crate::lang::builtins::scene::ArmatureValue;
use crate::lang::value::Value;
use std::sync::Arc;

/// Reads a rig, its mesh, and its morphs if it names some.
pub(super) fn load(bytes: &[u8], beside: &Beside) -> Result<Value, String> {
    let plain = |e: GeomError| e.to_string();
    let file = rig_from_json(bytes).map_err(plain)?;
    let within = |path: &str, e: GeomError| format!("{path}: {e}");
    let mesh = obj::indexed(&beside(&file.mesh)?).map_err(|e| within(&file.mesh, e))?;
    let rig = file.rig.clone();
    let mut body = Armature::new(file.rig, mesh.positions, mesh.triangles, file.influences).map_err(plain)?;
    if let Some(path) = &file.morphs {
        let morphs = morphs_from_json(&beside(path)?, &rig).map_err(|e| within(path, e))?;
        body = body.with_morphs(morphs).map_err(|e| within(path, e))?;
    }
    Ok(Value::object(ArmatureValue(Arc::new(body))))
}
