//! The camera of a glTF file: that of the first node of its scene that has one, or of a named
//! node. It looks along its node's -z, with +y up.

use super::pose::Pose;
use super::{Asked, CameraFile, Intrinsics, selected};
use crate::geom::gltf;
use crate::render::CameraError;
use glam::DMat4;

pub(super) fn read(bytes: &[u8], asked: &Asked) -> Result<CameraFile, CameraError> {
    let all = gltf::cameras(bytes).map_err(|e| CameraError::other(e.to_string()))?;
    let several = all.len();
    let all: Vec<_> = all.into_iter().map(|c| (c.name.clone(), c)).collect();
    let (name, camera) = match (asked.picture, &all[..]) {
        (None, [first, ..]) => first,
        (None, []) => return Err(CameraError::other("the glTF file's scene has no camera")),
        (Some(_), _) => selected(&all, asked, "camera")?,
    };
    let Some((yfov, aspect)) = camera.perspective else {
        return Err(CameraError::other(format!(
            "the glTF file's camera `{name}` is orthographic; only perspective ones are read"
        )));
    };
    let half = libm::tan(yfov / 2.0);
    let mut file =
        CameraFile::new("glTF", "perspective", Intrinsics::Angle { half, across: false, aspect });
    file.picture = Some(name.clone());
    file.pose = Some(Pose::to_world(DMat4::from(camera.to_world))?);
    if several > 1 && asked.picture.is_none() {
        file.remarks.push(format!("the file has {several} cameras; this is the first: FILE#NAME"));
    }
    Ok(file)
}
