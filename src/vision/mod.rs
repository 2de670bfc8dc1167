//! From pictures to evidence: reading photographs, masks and depth maps; contours; distance transforms; pixel likelihoods.
//! Nothing here knows of scenes or of rendering: what is compared with a picture arrives as arrays of its size.
//!
//! Everywhere in this module a pixel `(i, j)` (column, row; row 0 on top) covers `[i, i+1] x [j, j+1]`, so its centre is at
//! `(i + 0.5, j + 0.5)`, and arrays run row by row.

pub mod color;
pub mod contour_map;
pub mod depth;
pub mod detector;
pub mod distance_transform;
pub mod error;
pub mod exif;
pub mod gradient;
pub mod mask;
pub mod nms;
pub mod npy;
pub mod photo;
pub mod resize;
mod thin;

pub use contour_map::ContourMap;
pub use depth::{DepthLikelihood, DepthMap};
pub use detector::{ContourDetector, GradientDetector};
pub use distance_transform::{DistanceMap, distance_transform};
pub use error::VisionError;
pub use mask::{Mask, MaskLikelihood};
pub use photo::{Limits, Photo};
