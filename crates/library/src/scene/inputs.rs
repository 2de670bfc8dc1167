//! How the scene prepares the inputs of a program: a camera in the shape of the
//! photograph, keypoints in its pixels, contours by the detector that a run chose.

use super::{CameraValue, DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue};
use crate::model::Program;
use indexmap::IndexMap;
use pcadlang_engine::lang::builtins::{Defaults, InputHook};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::render::Camera;

/// The arguments that default to the run's camera.
const CAMERAS: [(&str, &str); 2] = [("scene.render", "camera"), ("scene.candidates", "camera")];

/// The argument that defaults to the run's contour detector.
const DETECTOR_DEFAULT: (&str, &str) = ("scene.edges", "detector");

/// Prepares the inputs of programs.
#[derive(Debug)]
pub(super) struct Inputs;

impl InputHook for Inputs {
    fn prepare(&self, data: &mut IndexMap<String, Value>, defaults: &mut Defaults) {
        default_camera(data, defaults);
    }

    /// Photographs get the contours of the detector that the run chose, if it chose one.
    fn adapt(&self, value: Value, defaults: &Defaults) -> Value {
        let chosen = defaults.get(&owned(DETECTOR_DEFAULT));
        match chosen.and_then(|v| v.downcast::<DetectorValue>()) {
            Some(detector) => ImageValue::detecting(&value, detector),
            None => value,
        }
    }
}

fn owned((of, name): (&str, &str)) -> (String, String) {
    (of.to_owned(), name.to_owned())
}

/// If no camera was set, uses the default view with the size of the first picture among
/// the data, or else of the first keypoints that state one. Keypoints that do not state
/// their picture's size get that of the first picture.
fn default_camera(data: &mut IndexMap<String, Value>, defaults: &mut Defaults) {
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
    if defaults.contains_key(&owned(CAMERAS[0])) {
        return;
    }
    let keypoints =
        || data.values().find_map(|v| v.downcast::<KeypointsValue>().and_then(|k| k.0.size()));
    if let Some((width, height)) = picture.or_else(keypoints) {
        let camera = Value::object(CameraValue(Camera::default_for(width, height)));
        for of in CAMERAS {
            defaults.insert(owned(of), camera.clone());
        }
    }
}

impl Program {
    /// Sets the camera of views that do not specify one.
    #[must_use]
    pub fn camera(self, camera: Camera) -> Program {
        CAMERAS.iter().fold(self, |p, (of, name)| {
            p.default_argument(of, name, Value::object(CameraValue(camera)))
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
