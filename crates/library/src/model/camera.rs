//! The camera and the contour detector that a run sets for a program.

use super::Program;
use crate::scene::{CAMERAS, CameraValue, DETECTOR_DEFAULT, DetectorValue};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::render::Camera;

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
