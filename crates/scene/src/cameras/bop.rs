//! BOP's `scene_camera.json` (bop_toolkit, `bop_datasets_format.md`): for each picture a
//! matrix and, in some data sets, the camera's place in the world, in millimetres.
//!
//! The toolkit itself has the centre of the first pixel at 0 in `misc.depth_im_to_dist_im` and at
//! 0.5 in its renderers. Its data sets were calibrated with OpenCV, or rendered by BlenderProc,
//! which writes (width - 1) / 2: so it is 0 here.

use super::document::array;
use super::intrinsics::{HALF, depth_scale, of_matrix};
use super::pose::Pose;
use super::{Asked, CameraFile, Intrinsics, selected};
use crate::render::CameraError;
use crate::vision::Distortion;
use glam::DMat3;
use serde_json::{Map, Value};

pub(super) fn read(
    map: &Map<String, Value>,
    asked: &Asked,
) -> Result<Option<CameraFile>, CameraError> {
    let single = map.contains_key("cam_K").then(|| (String::new(), map));
    let several = map.iter().filter_map(|(id, v)| Some((id.clone(), v.as_object()?)));
    let all: Vec<_> = match single {
        Some(one) => vec![one],
        None => several.filter(|(_, v)| v.contains_key("cam_K")).collect(),
    };
    if all.is_empty() {
        return Ok(None);
    }
    let (id, of) = selected(&all, asked, "picture")?;
    let wrong = |key: &'static str, wanted| move || CameraError::Invalid { key, wanted };
    let numbers = "9 numbers, row by row";
    let k = of.get("cam_K").and_then(array::<9>).ok_or_else(wrong("cam_K", numbers))?;
    let (focal, centre) = of_matrix(k)?;
    let intrinsics = Intrinsics::Pixels {
        size: None,
        focal,
        centre: centre.map(|c| c + HALF),
        distortion: Distortion::default(),
    };
    let mut file = CameraFile::new("BOP", "pinhole", intrinsics);
    file.picture = (!id.is_empty()).then(|| id.clone());
    if let (Some(r), Some(t)) = (of.get("cam_R_w2c"), of.get("cam_t_w2c")) {
        let r: [f64; 9] = array(r).ok_or_else(wrong("cam_R_w2c", numbers))?;
        let t: [f64; 3] = array(t).ok_or_else(wrong("cam_t_w2c", "three numbers"))?;
        file.pose = Some(Pose::from_world(DMat3::from_cols_array(&r).transpose(), t.into())?);
        file.remarks.push("BOP's lengths are millimetres: unit = 0.001 for metres".to_owned());
    }
    if let Some(scale) = of.get("depth_scale").and_then(Value::as_f64).filter(|s| *s > 0.0) {
        file.remarks.push(depth_scale(scale));
    }
    Ok(Some(file))
}
