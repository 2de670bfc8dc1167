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
use glam::{DMat3, DMat4, DVec3};
use serde_json::{Map, Value};

/// What to do about a lens that is not of these models.
pub(super) const UNDISTORT: &str = "undistort photograph and camera first: `colmap image_undistorter`, \
    or cv2.fisheye.undistortImage with a new camera matrix";

type Object = Map<String, Value>;

/// Where the centre of the first pixel is for these tools: half a pixel from here.
pub(super) const HALF: f64 = 0.5;

/// Reads a file, or the part of it that was asked for.
pub(super) fn read(map: &Object, asked: &Asked) -> Result<Option<CameraFile>, CameraError> {
    if get(map, &["m2"]).is_some() {
        return stereo(map, asked).map(Some);
    }
    if let Some(file) = one(map)? {
        return Ok(Some(file));
    }
    // One that was asked for by its name stands for itself, whatever the others are.
    if let Some(name) = asked.picture
        && let Some(part) = map.get(name).and_then(Value::as_object)
    {
        let named = |file| CameraFile { picture: Some(name.to_owned()), ..file };
        return Ok(one(part)?.map(named));
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

/// Reads one of OpenCV's two calibrated cameras, `M1` or `M2`. The pose between them is not one in
/// a world.
fn stereo(map: &Object, asked: &Asked) -> Result<CameraFile, CameraError> {
    let mut parts = Vec::new();
    for n in ["1", "2"] {
        let mut part = Object::new();
        for (key, value) in map {
            let own = bare(key);
            match own.strip_suffix(n) {
                Some("m") => part.insert("cameramatrix".into(), value.clone()),
                Some("d") => part.insert("dist".into(), value.clone()),
                _ if own.contains("size") || own.contains("width") || own.contains("height") => {
                    part.insert(key.clone(), value.clone())
                }
                _ => None,
            };
        }
        if let Some(file) = one(&part)? {
            parts.push((format!("M{n}"), file));
        }
    }
    let (name, file) = selected(&parts, asked, "camera")?;
    Ok(CameraFile { picture: Some(name.clone()), ..file.clone() })
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
const FISHEYES: [&str; 8] =
    ["fisheye", "equidistant", "kannala", "ftheta", "equirect", "omni", "eucm", "doublesphere"];
/// librealsense's `rs2_distortion`, by number.
const REALSENSE: [&str; 6] = [
    "none",
    "modified_brown_conrady",
    "inverse_brown_conrady",
    "ftheta",
    "brown_conrady",
    "kannala_brandt4",
];
/// Models of `distortion_model` that are read.
const MODELS: [&str; 8] =
    ["none", "pinhole", "plumbbob", "rational", "radtan", "brown", "opencv", "perspective"];

/// Reads one camera; `None` if the object has no focal length.
fn one(map: &Object) -> Result<Option<CameraFile>, CameraError> {
    let at = |keys: &[&str]| get(map, keys).and_then(number);
    let mut model = model(map)?;
    region(map)?;
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
    if file.pose.is_none() && get(map, &["rvecs", "tvecs", "extrinsicparameters"]).is_some() {
        file.remarks.push("positions of several views (rvecs, tvecs) are not read".into());
    }
    if let Some(scale) = at(&["depthscale"]).filter(|s| *s > 0.0) {
        file.remarks.push(depth_scale(scale));
    }
    Ok(Some(file))
}

/// The name of the lens model; empty if the file states none.
fn model(map: &Object) -> Result<String, CameraError> {
    let refused = |what: String| {
        Err(CameraError::other(format!("the lens is {what}, which is not supported: {UNDISTORT}")))
    };
    let named = |key: &str| {
        let value = get(map, &[key])?;
        let by_number = value.as_u64().and_then(|n| REALSENSE.get(usize::try_from(n).ok()?));
        Some(match (by_number, value) {
            (Some(name), _) => (*name).to_owned(),
            (None, Value::String(name)) => name.clone(),
            (None, other) => other.to_string(),
        })
    };
    let names: Vec<String> =
        ["distortionmodel", "model", "cameramodel"].into_iter().filter_map(named).collect();
    let fisheye = |name: &&String| {
        let name = bare(name);
        name == "ds" || FISHEYES.iter().any(|f| name.contains(f))
    };
    if let Some(name) = names.iter().find(fisheye) {
        return refused(format!("a fisheye ({name})"));
    }
    let flagged = get(map, &["fisheyemodel", "fisheye"])
        .is_some_and(|v| v.as_bool().unwrap_or(number(v) != Some(0.0)));
    if flagged {
        return refused("a fisheye".to_owned());
    }
    if get(map, &["xi"]).is_some() {
        return refused("omnidirectional (it has `xi`)".to_owned());
    }
    if let Some(name) = named("distortionmodel").filter(|n| !n.is_empty())
        && !MODELS.iter().any(|known| bare(&name).contains(known))
    {
        return refused(format!("of a model that is not known (`{name}`)"));
    }
    Ok(names.into_iter().next().unwrap_or_default())
}

/// Refuses ROS's pictures of a part of the sensor, whose pixels are not those of the matrix.
fn region(map: &Object) -> Result<(), CameraError> {
    let of = |map: &Object, key: &str| get(map, &[key]).and_then(number).unwrap_or(0.0);
    let roi = get(map, &["roi"]).and_then(Value::as_object);
    let part = roi.is_some_and(|roi| {
        let whole = |own: &str, side: &str| {
            [0.0, of(map, side)].contains(&of(roi, own)) && of(map, side) >= 0.0
        };
        of(roi, "xoffset") != 0.0
            || of(roi, "yoffset") != 0.0
            || !whole("width", "width") && !whole("width", "imagewidth")
            || !whole("height", "height") && !whole("height", "imageheight")
    });
    if part || of(map, "binningx") > 1.0 || of(map, "binningy") > 1.0 {
        return Err(CameraError::other(
            "the picture is of a region of interest, or binned; give the matrix of its own pixels",
        ));
    }
    Ok(())
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
    if c("skew") != 0.0 {
        return Err(CameraError::other("a skew is not supported, only pixels with right angles"));
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

/// Keys of the world's map to the camera, 3 x 4 or 4 x 4, and of its inverse.
const FROM_WORLD: [&str; 6] =
    ["extrinsic", "extrinsics", "extrinsicmatrix", "rt", "w2c", "worldtocamera"];
const TO_WORLD: [&str; 4] = ["c2w", "cam2world", "camtoworld", "cameratoworld"];

/// The world's map to the camera: a rotation, as a matrix or OpenCV's vector, and a translation; or
/// both as a matrix.
fn pose(map: &Object) -> Result<Option<Pose>, CameraError> {
    // ROS: R rectifies, P projects afterwards.
    if map.contains_key("P") || get(map, &["projectionmatrix"]).is_some() {
        return Ok(None);
    }
    let whole = |keys: &[&str]| {
        let rows = get(map, keys).and_then(numbers)?;
        let last = [0.0, 0.0, 0.0, 1.0];
        let rows: [f64; 16] = match rows.len() {
            12 => [&rows[..], &last].concat().try_into().ok()?,
            _ => rows.try_into().ok()?,
        };
        Some(DMat4::from_cols_array(&rows).transpose())
    };
    let rigid = |m: DMat4| Pose::from_world(DMat3::from_mat4(m), m.w_axis.truncate()).map(Some);
    if let Some(m) = whole(&FROM_WORLD) {
        return rigid(m);
    }
    if let Some(m) = whole(&TO_WORLD).filter(|m| m.determinant() != 0.0) {
        return rigid(m.inverse());
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
