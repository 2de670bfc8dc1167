//! Armatures: a rig file and what it names, or a glTF file with a skin.

use super::Siblings;
use crate::scene::ArmatureValue;
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::armature::{Armature, morphs_from_json, rig_from_json};
use pcadlang_scene::geom::{FileFrame, GeomError};
use pcadlang_scene::geom::{gltf, obj};
use std::sync::Arc;

/// Reads a glTF file, or a rig, its mesh, and its morphs if it names some.
pub(super) fn load(
    file: &str,
    bytes: &[u8],
    frame: &FileFrame,
    beside: &Siblings,
) -> Result<Value, String> {
    let plain = |e: GeomError| e.to_string();
    if gltf::is_gltf(file, bytes) {
        let loaded = gltf::load(bytes, frame, beside).map_err(plain)?;
        if loaded.rig.is_none() {
            return Err(
                "the glTF file has no skin, so it does not define which joint moves which \
                        vertices; read it with mesh(…) and rig it with scene.autorig"
                    .into(),
            );
        }
        return Ok(Value::object(ArmatureValue(Arc::new(loaded.armature().map_err(plain)?))));
    }
    if *frame != FileFrame::default() {
        return Err(
            "`up` and `unit` are for glTF files; a rig file is in the scene's axes and units"
                .into(),
        );
    }
    let file = rig_from_json(bytes).map_err(plain)?;
    let within = |path: &str, e: GeomError| format!("{path}: {e}");
    let mesh = obj::indexed(&beside(&file.mesh)?).map_err(|e| within(&file.mesh, e))?;
    let rig = file.rig.clone();
    let mut body =
        Armature::new(file.rig, mesh.positions, mesh.triangles, file.influences).map_err(plain)?;
    if let Some(path) = &file.morphs {
        let morphs = morphs_from_json(&beside(path)?, &rig).map_err(|e| within(path, e))?;
        body = body.with_morphs(morphs).map_err(|e| within(path, e))?;
    }
    Ok(Value::object(ArmatureValue(Arc::new(body))))
}
