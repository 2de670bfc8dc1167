//! Open3D's `PinholeCameraIntrinsic`, `PinholeCameraParameters` and `PinholeCameraTrajectory`:
//! matrices column by column, the extrinsic one from the world to the camera (x right, y down, z
//! forward).

use super::document::{array, number, size};
use super::intrinsics::{HALF, of_matrix};
use super::pose::Pose;
use super::{Asked, CameraFile, Intrinsics, selected};
use crate::render::CameraError;
use crate::vision::Distortion;
use glam::{DMat3, DMat4};
use serde_json::{Map, Value};

pub(super) fn read(
    map: &Map<String, Value>,
    asked: &Asked,
) -> Result<Option<CameraFile>, CameraError> {
    let class = map.get("class_name").and_then(Value::as_str).unwrap_or_default();
    if let ("PinholeCameraTrajectory", Some(Value::Array(all))) = (class, map.get("parameters")) {
        let all: Vec<_> =
            all.iter().enumerate().map(|(i, of)| (i.to_string(), of.as_object())).collect();
        let (number, of) = selected(&all, asked, "picture")?;
        let of = of.ok_or(CameraError::NotAnObject)?;
        return Ok(parameters(of)?.map(|f| CameraFile { picture: Some(number.clone()), ..f }));
    }
    parameters(map)
}

fn parameters(map: &Map<String, Value>) -> Result<Option<CameraFile>, CameraError> {
    let of = map.get("intrinsic").and_then(Value::as_object).unwrap_or(map);
    let Some(matrix) = of.get("intrinsic_matrix").filter(|m| m[0].is_number()) else {
        return Ok(None);
    };
    let wrong = |key: &'static str, wanted| CameraError::Invalid { key, wanted };
    let columns: [f64; 9] =
        array(matrix).ok_or_else(|| wrong("intrinsic_matrix", "9 numbers, column by column"))?;
    let (focal, centre) =
        of_matrix(DMat3::from_cols_array(&columns).transpose().to_cols_array())
            .map_err(|_| wrong("intrinsic_matrix", "[fx 0 0 0 fy 0 cx cy 1], column by column"))?;
    let side = |key: &str| of.get(key).and_then(number);
    let intrinsics = Intrinsics::Pixels {
        size: side("width").zip(side("height")).and_then(|(w, h)| size(w, h)),
        focal,
        centre: centre.map(|c| c + HALF),
        distortion: Distortion::default(),
    };
    let mut file = CameraFile::new("Open3D", "pinhole", intrinsics);
    if let Some(extrinsic) = map.get("extrinsic") {
        let wanted = "16 numbers, column by column, as Open3D writes them";
        let m: [f64; 16] = array(extrinsic).ok_or_else(|| wrong("extrinsic", wanted))?;
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err(wrong("extrinsic", wanted));
        }
        let m = DMat4::from_cols_array(&m);
        file.pose = Some(Pose::from_world(DMat3::from_mat4(m), m.w_axis.truncate())?);
    }
    Ok(Some(file))
}
