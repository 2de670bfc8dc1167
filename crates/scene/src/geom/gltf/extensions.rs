//! Which extensions of glTF are read, which do not change the triangles, and what is said of
//! the others.

use super::json::Document;
use crate::geom::GeomError;

/// Extensions that are read.
const READ: [&str; 6] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
];

/// How the names of extensions start that do not change the triangles: materials, lights,
/// annotations, behaviour.
const HARMLESS: [&str; 34] = [
    "ADOBE_materials",
    "AGI_",
    "CESIUM_primitive_outline",
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_lights",
    "EXT_materials",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "EXT_texture",
    "FB_ngon_encoding",
    "FB_geometry_metadata",
    "GOOGLE_",
    "KHR_animation",
    "KHR_audio",
    "KHR_collision_shapes",
    "KHR_environment_map",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_lights",
    "KHR_materials",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics",
    "KHR_techniques_webgl",
    "KHR_texture",
    "KHR_xmp",
    "MOZ_",
    "MSFT_audio_emitter",
    "MSFT_packing",
    "MSFT_texture",
    "OMI_",
    "UNREAL_",
    "VRM",
];

/// The extensions of a list that may change the triangles and are not read.
fn unread(all: &[String]) -> impl Iterator<Item = &str> {
    let harmless = |x: &str| READ.contains(&x) || HARMLESS.iter().any(|h| x.starts_with(h));
    all.iter().map(|x| &**x).filter(move |x| !harmless(x))
}

/// # Errors
/// An extension that is needed and not read, with a way to do without it.
pub(super) fn check(document: &Document) -> Result<(), GeomError> {
    let Some(x) = unread(&document.extensions_required).next() else { return Ok(()) };
    Err(GeomError::invalid(format!(
        "the glTF file requires the extension {x}, which is not supported; export without it, or \
         import the file into Blender and export it from there"
    )))
}

/// What users should know of the extensions that are not needed and not read.
pub(super) fn remark(document: &Document) -> Option<String> {
    let mut names: Vec<&str> = unread(&document.extensions_used).collect();
    names.sort_unstable();
    names.dedup();
    let count = names.len();
    names.truncate(8);
    let (verb, what) = if count == 1 { ("is", "it") } else { ("are", "they") };
    let more = if count > names.len() { ", …" } else { "" };
    (count > 0).then(|| {
        format!(
            "{}{more} {verb} not read; where {what} changed the shape, the shape here is another",
            names.join(", ")
        )
    })
}
