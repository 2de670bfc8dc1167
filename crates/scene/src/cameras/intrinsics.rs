//! Intrinsics as OpenCV, ROS, RealSense, Kinect and Kalibr write them: a matrix or fx, fy, cx, cy,
//! and coefficients of distortion. Keys are compared without capitals and underscores; others are
//! ignored.
//!
//! Sources: `cv::calibrateCamera` (order of the coefficients), ROS `sensor_msgs/CameraInfo`,
//! librealsense `rs2_intrinsics` and `rs2_project_point_to_pixel` (whose "inverse" model is the
//! "modified" one, forward), Azure Kinect `k4a_calibration_intrinsic_parameters_t`.

use super::document::{array, bare, get, number, numbers, size};
use super::pose::Pose;
use super::{Asked, CameraFile, Intrinsics, selected};
use crate::render::CameraError;
use crate::vision::Distortion;
use glam::{DMat3, DVec3};
use serde_json::{Map, Value};

/// What to do about a lens that is not of these models.
pub(super) const UNDISTORT: &str = "undistort photograph and camera first: `colmap image_undistorter`, \
    or cv2.fisheye.undistortImage with a new camera matrix";

type Object = Map<String, Value>;

/// Where the centre of the first pixel is for these tools: half a pixel from here.
pub(super) const HALF: f64 = 0.5;

/// Reads a file, or the part of it that was asked for.
pub(super) fn read(map: &Object, asked: &Asked) -> Result<Option<CameraFile>, CameraError> {
    if let Some(file) = one(map)? {
        return Ok(Some(file));
    }
    let mut parts = Vec::new();
    for (name, part) in map {
        if let Some(part) = part.as_object()
            && let Some(file) = one(part)?
        {
            parts.push((name.clone(), file));
        }
    }
    if parts.is_empty() {
        return Ok(None);
    }
    let (name, file) = selected(&parts, asked, "camera")?;
    Ok(Some(CameraFile { picture: Some(name.clone()), ..file.clone() }))
}

const MATRIX: [&str; 7] =
    ["cameramatrix", "k", "mtx", "intrinsicmatrix", "intrinsics", "intrinsic", "m1"];
const DISTORTION: [&str; 10] = [
    "distortioncoefficients",
    "distcoeffs",
    "distcoeff",
    "distortioncoeffs",
    "coeffs",
    "dist",
    "d",
    "d1",
    "distortion",
    "distcoefs",
];
const FISHEYES: [&str; 6] = ["fisheye", "equidistant", "kannala", "ftheta", "equirect", "omni"];

/// Reads one camera; `None` if the object has no focal length.
fn one(map: &Object) -> Result<Option<CameraFile>, CameraError> {
    let at = |keys: &[&str]| get(map, keys).and_then(number);
    let own = |fx: Option<f64>, fy: Option<f64>| {
        let f = fx.or(fy)?;
        Some((fx.unwrap_or(f), fy.unwrap_or(f)))
    };
    let by_key = own(at(&["fx", "focallengthx", "focalx"]), at(&["fy", "focallengthy", "focaly"]));
    let matrix = get(map, &MATRIX);
    let (format, focal, centre) = match (by_key, matrix) {
        (Some((fx, fy)), _) => {
            let centre = [["cx", "ppx", "principalpointx"], ["cy", "ppy", "principalpointy"]];
            let [Some(x), Some(y)] = centre.map(|keys| at(&keys)) else {
                return Err(CameraError::other(
                    "the camera file has fx, but no principal point: cx and cy, or ppx and ppy",
                ));
            };
            ("intrinsics (RealSense, Kinect)", [fx, fy], [x, y])
        }
        // Kalibr: fx, fy, cx, cy.
        (None, Some(value)) if array::<4>(value).is_some() => {
            let [fx, fy, x, y] = array(value).unwrap_or_default();
            ("intrinsics (Kalibr)", [fx, fy], [x, y])
        }
        (None, Some(Value::Object(inner))) if !inner.contains_key("data") => return one(inner),
        (None, Some(value)) => {
            let k = array::<9>(value).ok_or_else(|| {
                CameraError::other("the camera matrix must be 3 x 3 numbers, row by row")
            })?;
            let (focal, centre) = of_matrix(k)?;
            ("OpenCV", focal, centre)
        }
        (None, None) => return Ok(None),
    };
    let known_size = || {
        let sides = [["imagewidth", "width", "w"], ["imageheight", "height", "h"]];
        if let [Some(w), Some(h)] = sides.map(|keys| at(&keys)) {
            return size(w, h);
        }
        let both = get(map, &["imagesize", "resolution", "size", "imgsize"])?;
        array::<2>(both).and_then(|[w, h]| size(w, h))
    };
    let mut model = get(map, &["distortionmodel", "model", "cameramodel"])
        .map_or_else(String::new, |v| v.as_str().map_or_else(|| v.to_string(), str::to_owned));
    let fisheye = get(map, &["fisheyemodel", "fisheye"])
        .is_some_and(|v| v.as_bool().unwrap_or(number(v) != Some(0.0)));
    if fisheye || FISHEYES.iter().any(|f| bare(&model).contains(f)) {
        return Err(CameraError::other(format!(
            "the lens is a fisheye ({model}), which is not supported: {UNDISTORT}"
        )));
    }
    let modified = ["modified", "inverse"].iter().any(|m| bare(&model).contains(m));
    let distortion = Distortion { modified, ..distortion(map)? };
    if model.is_empty() {
        model = if distortion.is_none() { "pinhole" } else { "Brown-Conrady" }.to_owned();
    }
    let intrinsics = Intrinsics::Pixels {
        size: known_size(),
        focal,
        centre: centre.map(|c| c + HALF),
        distortion,
    };
    let mut file = CameraFile::new(format, model, intrinsics);
    file.pose = pose(map)?;
    if let Some(scale) = at(&["depthscale"]).filter(|s| *s > 0.0) {
        file.remarks.push(depth_scale(scale));
    }
    Ok(Some(file))
}

/// What a depth scale of BOP means for a depth map.
pub(super) fn depth_scale(scale: f64) -> String {
    format!(
        "its depth maps have {scale} mm to a unit: depth(…, scale = {}) for metres",
        1000.0 / scale
    )
}

/// Focal lengths and principal point of a matrix, row by row.
pub(super) fn of_matrix(k: [f64; 9]) -> Result<([f64; 2], [f64; 2]), CameraError> {
    let [fx, skew, cx, below, fy, cy, p, q, one] = k;
    if below != 0.0 || p != 0.0 || q != 0.0 || (one - 1.0).abs() > 1e-9 {
        return Err(CameraError::other(
            "the camera matrix must be [fx 0 cx; 0 fy cy; 0 0 1], row by row",
        ));
    }
    if skew.abs() > 1e-6 * fx.abs() {
        return Err(CameraError::other(format!(
            "the camera matrix has a skew of {skew}; only pixels with right angles are supported"
        )));
    }
    Ok(([fx, fy], [cx, cy]))
}

/// The coefficients of distortion, in OpenCV's order or by name.
fn distortion(map: &Object) -> Result<Distortion, CameraError> {
    let listed = get(map, &DISTORTION);
    let coefficients = match listed {
        Some(Value::Object(inner)) if !inner.contains_key("data") => by_name(inner)?,
        Some(value) => numbers(value).ok_or_else(|| {
            CameraError::other("the coefficients of distortion must be a list of numbers")
        })?,
        None => by_name(map)?,
    };
    of_opencv(&coefficients)
}

/// Coefficients by name, in OpenCV's order.
fn by_name(map: &Object) -> Result<Vec<f64>, CameraError> {
    let c = |key: &str| get(map, &[key]).and_then(number).unwrap_or(0.0);
    if c("codx") != 0.0 || c("cody") != 0.0 {
        return Err(CameraError::other("a centre of distortion (codx, cody) is not supported"));
    }
    Ok(["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"].map(c).to_vec())
}

/// Distortion from k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, …, s4[, τx, τy]]]].
pub(super) fn of_opencv(all: &[f64]) -> Result<Distortion, CameraError> {
    if !matches!(all.len(), 0 | 4 | 5 | 8 | 12 | 14) {
        return Err(CameraError::other(format!(
            "{} coefficients of distortion; OpenCV's models have 4, 5, 8, 12 or 14",
            all.len()
        )));
    }
    let c = |i: usize| all.get(i).copied().unwrap_or(0.0);
    if c(12) != 0.0 || c(13) != 0.0 {
        return Err(CameraError::other(format!(
            "the lens model has a tilted sensor, which is not supported: {UNDISTORT}"
        )));
    }
    Ok(Distortion {
        radial: [c(0), c(1), c(4), 0.0],
        divisor: [c(5), c(6), c(7)],
        tangential: [c(2), c(3)],
        prism: [c(8), c(9), c(10), c(11)],
        modified: false,
    })
}

/// The world's map to the camera: a rotation, as a matrix or OpenCV's vector, and a translation.
fn pose(map: &Object) -> Result<Option<Pose>, CameraError> {
    // ROS: R rectifies, P projects afterwards.
    if map.contains_key("P") || get(map, &["projectionmatrix"]).is_some() {
        return Ok(None);
    }
    let rotation = get(map, &["rvec", "rotationvector", "r", "rotation", "rotationmatrix"]);
    let translation = get(map, &["tvec", "translationvector", "t", "translation"]);
    let (Some(r), Some(t)) = (rotation.and_then(numbers), translation.and_then(array::<3>)) else {
        return Ok(None);
    };
    let rotation = match r[..] {
        [x, y, z] => {
            let v = DVec3::new(x, y, z);
            match v.length() {
                0.0 => DMat3::IDENTITY,
                angle => DMat3::from_axis_angle(v / angle, angle),
            }
        }
        _ => match <[f64; 9]>::try_from(r) {
            Ok(m) => DMat3::from_cols_array(&m).transpose(),
            Err(_) => return Ok(None),
        },
    };
    Pose::from_world(rotation, t.into()).map(Some)
}
