//! How the scene prepares the inputs of a program: a camera in the shape of the
//! photograph, keypoints in its pixels, contours by the detector that a run chose; and what was
//! observed undistorted, if the run's camera has a lens that distorts.

use super::camera_file::CameraFileValue;
use super::{CameraValue, DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue};
use crate::model::Program;
use indexmap::IndexMap;
use pcadlang_engine::lang::builtins::{Defaults, InputHook};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::cameras::{CameraFile, Seen};
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::Lens;

/// The arguments that default to the run's camera.
const CAMERAS: [(&str, &str); 2] = [("scene.render", "camera"), ("scene.candidates", "camera")];

/// The argument that defaults to the run's contour detector.
const DETECTOR_DEFAULT: (&str, &str) = ("scene.edges", "detector");

/// Prepares the inputs of programs.
#[derive(Debug)]
pub(super) struct Inputs;

impl InputHook for Inputs {
    fn prepare(
        &self,
        data: &mut IndexMap<String, Value>,
        defaults: &mut Defaults,
    ) -> Result<(), Fault> {
        default_camera(data, defaults)
    }

    /// What was seen through the run's lens is undistorted, once. Photographs get the contours of
    /// the detector that the run chose, if it chose one.
    fn adapt(&self, value: Value, defaults: &Defaults) -> Value {
        let camera = defaults.get(&owned(CAMERAS[0])).and_then(|v| v.downcast::<CameraValue>());
        if let Some(CameraFileValue(file)) = value.downcast::<CameraFileValue>() {
            let size = camera.map(|c| (c.0.width, c.0.height));
            return match file.seen(size) {
                Ok(seen) => Value::object(CameraValue::new(seen.camera)),
                Err(_) => value,
            };
        }
        let lens = camera.and_then(|c| c.1.as_ref());
        let value = lens.map_or(value.clone(), |lens| undistorted(value, lens));
        let chosen = defaults.get(&owned(DETECTOR_DEFAULT));
        match chosen.and_then(|v| v.downcast::<DetectorValue>()) {
            Some(detector) => ImageValue::detecting(&value, detector),
            None => value,
        }
    }
}

/// Returns what a lens saw as its pinhole would. What is not of the lens's proportions stays as it
/// is: comparators refuse it.
fn undistorted(value: Value, lens: &Lens) -> Value {
    if let Some(image) = value.downcast::<ImageValue>() {
        return image.undistorted(lens).map_or(value.clone(), Value::object);
    }
    if let Some(seen) = value.downcast::<MaskValue>() {
        let mask = seen.mask.undistorted(lens);
        return mask.map_or(value.clone(), |m| Value::object(MaskValue::new(m)));
    }
    if let Some(seen) = value.downcast::<DepthValue>() {
        let depth = seen.depth.undistorted(lens);
        return depth.map_or(value.clone(), |d| Value::object(DepthValue::new(d)));
    }
    match value.downcast::<KeypointsValue>() {
        Some(KeypointsValue(k)) => Value::object(KeypointsValue(k.undistorted(lens))),
        None => value,
    }
}

fn owned((of, name): (&str, &str)) -> (String, String) {
    (of.to_owned(), name.to_owned())
}

/// If no camera was set, uses the default view with the size of the first picture among
/// the data, by the lens that it states, or else of the first keypoints that state one. Keypoints
/// that do not state their picture's size get that of the first picture.
fn default_camera(
    data: &mut IndexMap<String, Value>,
    defaults: &mut Defaults,
) -> Result<(), Fault> {
    let picture = data.values().find_map(|v| {
        let image = v.downcast::<ImageValue>().map(ImageValue::size);
        let mask = || v.downcast::<MaskValue>().map(|m| (m.mask.width(), m.mask.height()));
        let depth = || v.downcast::<DepthValue>().map(|d| (d.depth.width(), d.depth.height()));
        image.or_else(mask).or_else(depth)
    });
    if let Some((width, height)) = picture {
        for v in data.values_mut() {
            if let Some(KeypointsValue(k)) = v.downcast::<KeypointsValue>() {
                *v = Value::object(KeypointsValue(k.clone().in_image(width, height)));
            }
        }
    }
    let keypoints =
        || data.values().find_map(|v| v.downcast::<KeypointsValue>().and_then(|k| k.0.size()));
    let size = picture.or_else(keypoints);
    let camera = match defaults.get(&owned(CAMERAS[0])) {
        Some(set) => match set.downcast::<CameraFileValue>() {
            Some(CameraFileValue(file)) => {
                let Seen { camera, lens } = file
                    .seen(size)
                    .map_err(|e| Fault::new(FaultKind::Other, format!("--camera: {e}")))?;
                CameraValue(camera, lens)
            }
            None => return Ok(()),
        },
        None => {
            let Some((width, height)) = size else { return Ok(()) };
            let stated = data.values().find_map(|v| v.downcast::<ImageValue>()?.focal());
            CameraValue::new(match stated {
                Some(focal) => Camera::default_by(width, height, focal),
                None => Camera::default_for(width, height),
            })
        }
    };
    let camera = Value::object(camera);
    for of in CAMERAS {
        defaults.insert(owned(of), camera.clone());
    }
    Ok(())
}

impl Program {
    /// Sets the camera of views that do not specify one.
    #[must_use]
    pub fn camera(self, camera: Camera) -> Program {
        CAMERAS.iter().fold(self, |p, (of, name)| {
            p.default_argument(of, name, Value::object(CameraValue::new(camera)))
        })
    }

    /// Sets the camera of views that do not specify one, from a file. What is observed is
    /// undistorted by its lens.
    #[must_use]
    #[doc(hidden)]
    pub fn camera_file(self, file: CameraFile) -> Program {
        CAMERAS.iter().fold(self, |p, (of, name)| {
            p.default_argument(of, name, Value::object(CameraFileValue(file.clone())))
        })
    }

    /// Sets the contour detector for photographs for which the program does not specify
    /// one: a value as from `data d = detector("file");`, or one with `None` for the
    /// built-in detector.
    #[must_use]
    #[doc(hidden)]
    pub fn detector(self, detector: DetectorValue) -> Program {
        let (of, name) = DETECTOR_DEFAULT;
        self.default_argument(of, name, Value::object(detector))
    }
}
