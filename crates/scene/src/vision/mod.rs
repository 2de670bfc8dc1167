//! From pictures to evidence: reading photographs, masks and depth maps, detecting
//! contours, and scoring how well rendered data explain them. This module does not depend
//! on scenes or rendering: rendered data arrive as arrays of the picture's size.
//!
//! Everywhere in this module, pixel `(i, j)` (column, row; row 0 at the top) covers
//! `[i, i+1] x [j, j+1]`, so its centre is `(i + 0.5, j + 0.5)`. Arrays are in row-major
//! order.

pub mod candidates;
pub mod chamfer;
pub mod coco_runs;
pub mod contour_ratio;
pub mod depth;
pub mod detect;
pub mod distance_transform;
pub mod elements;
pub mod error;
pub mod features;
pub mod hint;
pub mod keypoints;
pub mod lens;
pub mod mask;
mod mask_outlines;
pub mod pictures;
pub mod region;
pub mod segmentation;
mod undistort;

#[cfg(test)]
mod drawn;
#[cfg(test)]
mod testing;

pub use crate::contours::{ContourChange, ContourSlice};
pub use chamfer::{Chamfer, ChamferOptions, DistanceField};
pub use contour_ratio::{ContourRatio, ContourRatioOptions};
pub use depth::{DepthLikelihood, DepthMap, DepthTally};
pub use detect::detector::{ContourDetector, GradientDetector, MAP_SIZE, MOST_MAP_SIZE};
pub use detect::gradient;
pub use detect::soft_map::{Shows, SoftMap};
pub use distance_transform::{DistanceMap, distance_transform};
pub use elements::ComparatorError;
pub use error::VisionError;
pub use hint::{AxisHint, Hint};
pub use keypoints::{KeypointLikelihood, KeypointOptions, Keypoints};
pub use lens::{Distortion, Lens, Pinhole};
pub use mask::{Mask, MaskLikelihood};
pub use pictures::contour_map::ContourMap;
pub use pictures::photo::{Limits, Photo};
pub use pictures::{color, npy, photo};
pub use region::{Region, RegionOptions};
