//! Shipped human bodies, for examples, benchmarks and tests.

use pcadlang_library::shipped;
use pcadlang_scene::geom::armature::{Armature, morphs_from_json, rig_from_json};
use pcadlang_scene::geom::{GeomError, obj};
use std::sync::Arc;

/// Loads a human body: `human.lod2` (coarse), `human.lod1` or `human`.
pub fn human(lod: &str) -> Result<Arc<Armature>, GeomError> {
    let file =
        |end: &str| shipped::file(&format!("std/human/{lod}.{end}")).unwrap_or_default().as_bytes();
    let rig = rig_from_json(file("rig.json"))?;
    let mesh = obj::indexed(file("obj"))?;
    let morphs = morphs_from_json(file("morphs.json"), &rig.rig)?;
    Ok(Arc::new(
        Armature::new(rig.rig, mesh.positions, mesh.triangles, rig.influences)?
            .with_morphs(morphs)?,
    ))
}
