//! What may be an object of revolution in a photograph, as values: a thin layer over [`crate::vision::candidates`].

use super::observed::MaskValue;
use super::{CAMERA, CameraValue, IMAGE, ImageValue, native};
use crate::lang::builtins::{Row, Type, arg, opt};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use crate::render::Camera;
use crate::vision::candidates::{Axis, Candidate, CandidateOptions, candidates, tilts};
use glam::DVec3;
use std::sync::Arc;

pub(super) const TABLE: &[Row] = &[native(
    "candidates",
    "Finding",
    &[
        arg("photo", IMAGE, "The photograph; nothing is found in contours alone."),
        opt("most", Type::Int, "20", "How many are given at most, 1 to 64."),
        opt("size", Type::Int, "128", "The longer side of the picture worked on, 32 to 512.").unit("pixels"),
        opt("camera", CAMERA, "the run's", "The camera; without one, that of the run."),
    ],
    Type::Array,
    "Regions of a photograph that may be objects of revolution, the likeliest first. Each is a record: `score`; `mask`; `axes`, one or two \
     records, the more symmetric first: `symmetry`, 0 to 1; the ends `foot` and `top`, where the plane through the origin that faces the \
     camera is seen there; their distance `length`; the unit vectors `along`, from foot to top, and `toward` the camera; `widths`, 24 half widths \
     from foot to top; `tilts`, 80 angles by which the axis may be turned towards the camera, radians, and `rims`, how much speaks for each of \
     them, 0 to 1: whether an end, if it is flat, is seen as an ellipse so high. Lengths are in scene units. A function of picture and camera alone, found once.",
    |a| {
        if matches!(a.values.first(), Some(Value::Unit)) {
            return Ok(Value::List(Arc::from([])));
        }
        let image = a.object::<ImageValue>(0, "an image")?;
        let Some(photo) = image.as_photo() else { return Ok(Value::List(Arc::from([]))) };
        let most = if a.given(1) { a.int_in(1, 1, 64)? as usize } else { CandidateOptions::default().most };
        let size = if a.given(2) { a.int_in(2, 32, 512)? as u32 } else { CandidateOptions::default().size };
        let camera = match a.given(3) {
            true => a.object::<CameraValue>(3, "a camera")?.0,
            false => Camera::default_for(photo.width(), photo.height()),
        };
        let options = CandidateOptions { most, size };
        let found = image.candidates.get(options, |o| Ok(candidates(photo, o)));
        let found = found.map_err(|e: String| Fault::new(FaultKind::Other, format!("scene.candidates: {e}")))?;
        let scale = [
            f64::from(camera.width) / f64::from(photo.width().max(1)),
            f64::from(camera.height) / f64::from(photo.height().max(1)),
        ];
        Ok(Value::List(found.iter().map(|c| value(c, &camera, scale)).collect()))
    },
)];

/// A candidate as a record; `scale` is what a pixel of the photograph is in the camera's.
fn value(c: &Candidate, camera: &Camera, scale: [f64; 2]) -> Value {
    let axes = c.axes.iter().map(|a| axis(a, camera, scale)).collect();
    Value::record([
        ("score", Value::Num(c.score)),
        ("mask", Value::object(MaskValue::new(c.mask.clone()))),
        ("axes", Value::List(axes)),
    ])
}

fn axis(a: &Axis, camera: &Camera, scale: [f64; 2]) -> Value {
    // The plane through the origin that faces the camera.
    let depth = (-camera.eye).dot(camera.forward).max(Camera::NEAR);
    let there = |[x, y]: [f64; 2]| camera.unproject(x * scale[0], y * scale[1], depth);
    let (foot, top) = (there(a.foot), there(a.top));
    let length = foot.distance(top);
    let along = (top - foot).normalize_or(camera.up);
    let pixels = f64::hypot(a.top[0] - a.foot[0], a.top[1] - a.foot[1]).max(1e-9);
    let widths = a.widths.iter().map(|w| w / pixels * length).collect::<Vec<_>>();
    let vector = |v: DVec3| Value::array(v.to_array().to_vec());
    Value::record([
        ("symmetry", Value::Num(a.symmetry)),
        ("foot", vector(foot)),
        ("top", vector(top)),
        ("length", Value::Num(length)),
        ("along", vector(along)),
        ("toward", vector(-camera.forward)),
        ("widths", Value::array(widths)),
        ("tilts", Value::array(tilts().collect::<Vec<_>>())),
        ("rims", Value::array(a.rims.clone())),
    ])
}
