//! `transforms.json` of Blender's data sets for NeRFs, instant-ngp and nerfstudio: a lens by its
//! angle of view or in pixels, for all pictures or for each, and the matrix of each camera (x
//! right, y up, z backward) to the world, which has z up in these tools.
//!
//! Sources: instant-ngp `scripts/colmap2nerf.py`, nerfstudio's data conventions and
//! `cameras.camera_utils` (whose radial distortion has four terms).

use super::document::{array, number, size};
use super::intrinsics::UNDISTORT;
use super::pose::Pose;
use super::{Asked, CameraFile, Intrinsics, selected};
use crate::render::CameraError;
use crate::vision::Distortion;
use glam::DMat4;
use serde_json::{Map, Value};

pub(super) fn read(
    map: &Map<String, Value>,
    asked: &Asked,
) -> Result<Option<CameraFile>, CameraError> {
    let frames = match map.get("frames") {
        Some(Value::Array(frames)) => frames.as_slice(),
        _ if map.contains_key("camera_angle_x") || map.contains_key("fl_x") => &[],
        _ => return Ok(None),
    };
    let named = |(i, f): (usize, &'_ Value)| {
        let name = f.get("file_path").and_then(Value::as_str);
        name.map_or_else(|| i.to_string(), str::to_owned)
    };
    let all: Vec<(String, &Value)> =
        frames.iter().enumerate().map(|(i, f)| (named((i, f)), f)).collect();
    let chosen = match all.is_empty() {
        true => None,
        false => Some(selected(&all, asked, "picture")?),
    };
    let get = |key: &str| {
        chosen.and_then(|(_, f)| f.get(key)).or_else(|| map.get(key)).filter(|v| !v.is_null())
    };
    let at = |key: &str| get(key).and_then(number);
    let model = get("camera_model").and_then(Value::as_str).unwrap_or("pinhole").to_owned();
    let fisheye = get("is_fisheye").and_then(Value::as_bool).unwrap_or(false);
    if fisheye
        || ["FISHEYE", "EQUIRECT", "OMNI", "FOV"].iter().any(|f| model.to_uppercase().contains(f))
    {
        return Err(CameraError::other(format!(
            "the lens is a fisheye ({model}), which is not supported: {UNDISTORT}"
        )));
    }
    let side = at("w").zip(at("h")).and_then(|(w, h)| size(w, h));
    let half = |key: &str| at(key).filter(|a| *a > 0.0 && *a < 3.1).map(|a| libm::tan(a / 2.0));
    let angles = (half("camera_angle_x"), half("camera_angle_y"));
    let term = |key: &str| at(key).unwrap_or(0.0);
    let distortion = Distortion {
        radial: ["k1", "k2", "k3", "k4"].map(term),
        tangential: ["p1", "p2"].map(term),
        ..Distortion::default()
    };
    let focal = match (at("fl_x").or(at("fl_y")), angles, side) {
        (Some(f), ..) => Some([at("fl_x").unwrap_or(f), at("fl_y").unwrap_or(f)]),
        (None, (Some(a), b), Some((w, h))) => {
            let fx = f64::from(w) / 2.0 / a;
            Some([fx, b.map_or(fx, |b| f64::from(h) / 2.0 / b)])
        }
        (None, (None, Some(b)), Some((_, h))) => Some([f64::from(h) / 2.0 / b; 2]),
        _ => None,
    };
    let intrinsics = match (focal, angles) {
        (Some(focal), _) => {
            let middle = side.map(|(w, h)| [f64::from(w) / 2.0, f64::from(h) / 2.0]);
            let centre = at("cx").zip(at("cy")).map(|(x, y)| [x, y]).or(middle);
            let centre = centre.ok_or(CameraError::Missing("cx"))?;
            Intrinsics::Pixels { size: side, focal, centre, distortion }
        }
        (None, (Some(half), _)) => Intrinsics::Angle { half, across: true, aspect: None },
        (None, (None, Some(half))) => Intrinsics::Angle { half, across: false, aspect: None },
        (None, (None, None)) => return Err(CameraError::Missing("camera_angle_x")),
    };
    let mut file = CameraFile::new("transforms.json (NeRF)", model, intrinsics);
    if let Some((name, frame)) = chosen {
        file.picture = Some(name.clone());
        let matrix =
            frame.get("transform_matrix").ok_or(CameraError::Missing("transform_matrix"))?;
        let m: [f64; 16] = array(matrix).ok_or(CameraError::Invalid {
            key: "transform_matrix",
            wanted: "4 x 4 numbers, row by row",
        })?;
        file.pose = Some(Pose::to_world(DMat4::from_cols_array(&m).transpose())?);
    }
    Ok(Some(file))
}
