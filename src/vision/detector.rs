//! What finds contours in a photograph.

use super::{ContourMap, Photo};

/// Finds the contours of a photograph.
pub trait ContourDetector {
    /// The contours; its size is the detector's working size, in the shape of the photograph.
    fn detect(&self, photo: &Photo) -> ContourMap;
}
