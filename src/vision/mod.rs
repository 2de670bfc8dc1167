//! Looking at pictures: photographs, their contours, and how well rendered contours, masks and depths explain them.
//!
//! Knows nothing of meshes, cameras, programs or traces: rendered contours arrive as slices of numbers.

pub mod chamfer;
mod color;
pub mod contour_map;
pub mod contour_ratio;
mod depth;
mod detector;
pub mod distance_transform;
pub mod elements;
mod error;
mod field;
mod gradient;
mod mask;
pub mod npy;
mod photo;
mod resize;

#[cfg(test)]
mod testing;

pub use chamfer::{Chamfer, ChamferOptions};
pub use contour_map::ContourMap;
pub use contour_ratio::{ContourRatio, ContourRatioOptions};
pub use depth::{DepthLikelihood, DepthMap};
pub use detector::ContourDetector;
pub use elements::{ComparatorError, Elements};
pub use error::VisionError;
pub use gradient::GradientDetector;
pub use mask::{Mask, MaskLikelihood};
pub use photo::{Limits, Photo};
