//! From pictures to evidence: reading photographs, masks and depth maps, detecting
//! contours, and scoring how well rendered data explain them. This module does not depend
//! on scenes or rendering: rendered data arrive as arrays of the picture's size.
//!
//! Everywhere in this module, pixel `(i, j)` (column, row; row 0 at the top) covers
//! `[i, i+1] x [j, j+1]`, so its centre is `(i + 0.5, j + 0.5)`. Arrays are in row-major
//! order.

pub mod candidates;
pub mod chamfer;
pub mod color;
pub mod contour_map;
pub mod contour_ratio;
pub mod depth;
pub mod detector;
pub mod distance_transform;
pub mod elements;
pub mod error;
pub mod exif;
pub mod features;
mod field;
pub mod file_detector;
pub mod forest;
pub mod gradient;
pub mod keypoints;
pub mod mask;
mod nearest;
mod network_options;
pub mod nms;
pub mod npy;
#[cfg(feature = "onnx")]
pub mod onnx;
pub mod photo;
pub mod region;
pub mod resize;
pub mod soft_map;
mod thin;

#[cfg(test)]
mod testing;

pub use chamfer::{Chamfer, ChamferOptions};
pub use contour_map::ContourMap;
pub use contour_ratio::{ContourRatio, ContourRatioOptions};
pub use depth::{DepthLikelihood, DepthMap};
pub use detector::{ContourDetector, GradientDetector};
pub use distance_transform::{DistanceMap, distance_transform};
pub use elements::{ComparatorError, ContourDelta, Elements};
pub use error::VisionError;
pub use file_detector::{FileDetector, NetworkOptions};
pub use forest::Forest;
pub use keypoints::{KeypointLikelihood, KeypointOptions, Keypoints};
pub use mask::{Mask, MaskLikelihood};
pub use photo::{Limits, Photo};
pub use region::{Region, RegionOptions};
pub use soft_map::SoftMap;
